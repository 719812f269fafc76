"""What is missing in the system is named together with the one line that installs it, or installed."""

import importlib.util
from pathlib import Path

import pytest

PATH = Path(__file__).parents[2] / "batch" / "check_system.py"
_spec = importlib.util.spec_from_file_location("check_system", PATH)
check_system = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(check_system)

APT = ["apt-get update -qq", "apt-get install -y --no-install-recommends libegl1 procps"]


def load_all_but(*absent: str):
    def load(library: str) -> None:
        if library in absent:
            raise OSError(library)

    return load


@pytest.fixture
def machine(monkeypatch):
    """``machine(uid, missing)``: one with apt-get and what is missing; the list of what was run on it."""

    def of(uid: int, missing: list[str], heals: bool = True, status: int = 0) -> list[str]:
        left, ran = [missing], []

        def run(words, **_):
            ran.append(" ".join(words))
            if heals and "install" in words:
                left[0] = []
            return check_system.subprocess.CompletedProcess(words, status)

        monkeypatch.setattr(check_system.os, "geteuid", lambda: uid, raising=False)
        monkeypatch.setattr(check_system, "missing_parts", lambda: left[0])
        monkeypatch.setattr(check_system.shutil, "which", lambda name: name == "apt-get")
        monkeypatch.setattr(check_system.subprocess, "run", run)
        return ran

    return of


def test_nothing_is_missing_where_all_is_there():
    assert check_system.missing_parts(load_all_but(), lambda _: True) == []


@pytest.mark.parametrize(
    ("program", "install", "packages"),
    [
        ("apt-get", "apt-get install -y --no-install-recommends", "libxi6 libgl1 libegl1 procps strace g++"),
        ("dnf", "dnf install -y", "libXi mesa-libGL mesa-libEGL procps-ng strace gcc-c++"),
        ("pacman", "pacman -S --noconfirm", "libxi libglvnd mesa procps-ng strace gcc"),
    ],
)
def test_the_cure_is_in_the_words_of_the_machines_package_manager(program, install, packages):
    absent = load_all_but("libXi.so.6", "libGL.so.1", "libEGL.so.1")
    missing = check_system.missing_parts(absent, lambda _: False)
    assert missing == ["libXi.so.6", "libGL.so.1", "libEGL.so.1", "ps", "strace", "g++"]
    *_, command = check_system.cure(missing, which=lambda name: name == program)
    assert command == f"{install} {packages}"


def test_a_user_is_told_one_line_and_nothing_is_run(machine, capsys):
    ran = machine(1000, ["libEGL.so.1", "ps"])
    assert check_system.main([]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("The tests need libEGL.so.1, ps; ") and "YES=1" in line
    assert line.endswith(f": sudo {APT[0]} && sudo {APT[1]}")
    assert ran == []


@pytest.mark.parametrize(
    ("uid", "arguments", "expected"),
    [(0, [], APT), (0, ["--yes"], APT), (1000, ["--yes"], [f"sudo {line}" for line in APT])],
)
def test_root_or_yes_installs(machine, uid, arguments, expected):
    ran = machine(uid, ["libEGL.so.1", "ps"])
    assert check_system.main(arguments) == 0
    assert ran == expected


def test_an_installation_that_fails_or_does_not_help_is_told(machine, capsys):
    machine(0, ["libEGL.so.1"], heals=False)
    assert check_system.main([]) == 1
    assert "Still missing: libEGL.so.1" in capsys.readouterr().err
    ran = machine(0, ["libEGL.so.1"], status=100)
    assert check_system.main([]) == 1
    assert ran == APT[:1]


def test_without_a_package_manager_it_names_debians_packages(machine, monkeypatch, capsys):
    machine(0, ["libSM.so.6"])
    monkeypatch.setattr(check_system.shutil, "which", lambda name: None)
    assert check_system.main(["--yes"]) == 1
    assert "libsm6" in capsys.readouterr().err


def test_packages_alone_are_told_to_a_script(machine, capsys):
    machine(0, ["libSM.so.6", "ps"])
    assert check_system.main(["--packages"]) == 1
    assert capsys.readouterr().out == "libsm6 procps\n"
