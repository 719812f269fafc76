"""A plan of small pictures, and what its stand-in for the program obeys."""

from __future__ import annotations

import secrets

import pytest
from fake_experiment import PLAN, pictures

from r2sego_blender.experiments.cells import cells_of
from r2sego_blender.experiments.inputs import fixed_inputs
from r2sego_blender.experiments.object_store import ObjectStore
from r2sego_blender.experiments.plan import Plan


@pytest.fixture
def plan_file(tmp_path):
    pictures(tmp_path / "room", 6, 0)
    pictures(tmp_path / "held_out", 2, 20)
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path / "plan.toml"


@pytest.fixture
def plan(plan_file):
    return Plan.load(plan_file)


@pytest.fixture
def two_cells(plan_file):
    """The plan with one seed, as its file has it then."""
    plan_file.write_text(PLAN.replace("[0, 1]", "[0]"))
    return Plan.load(plan_file)


@pytest.fixture
def cells(plan, tmp_path):
    """The cells of the plan, whose imports are there."""
    found = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    for cell in found:
        cell.imported.mkdir(parents=True, exist_ok=True)
    return found


@pytest.fixture
def control(tmp_path, monkeypatch):
    """What the stand-in obeys, and where it notes the commands that it finished."""
    folder = tmp_path / "control"
    folder.mkdir()
    monkeypatch.setenv("FAKE_CONTROL", str(folder))
    return folder


@pytest.fixture
def store(tmp_path):
    """Storage in a folder."""
    return ObjectStore.at((tmp_path / "storage").as_uri())


@pytest.fixture
def s3(monkeypatch):
    """A bucket on an S3 server of this machine, on loopback."""
    pytest.importorskip("s3fs", reason="make install CLUSTER=1")
    server = pytest.importorskip("moto.server", reason="pip install moto[server]: an S3 server")
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    running.start()
    host, port = running.get_host_and_port()
    for name, value in {
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
    }.items():
        monkeypatch.setenv(name, value)
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()
    bucket = f"rooms-{secrets.token_hex(4)}"  # the server forgets nothing in its process
    s3fs.S3FileSystem().mkdir(bucket)
    yield ObjectStore.at(f"s3://{bucket}/first try")
    running.stop()
    s3fs.S3FileSystem.clear_instance_cache()
