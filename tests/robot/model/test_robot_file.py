"""Robot files from anywhere: what is read, what is refused, and that nothing else is opened."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.robot_file import compiled_robot, gather_robot, robot_digest, robot_spec
from r2sego_blender.robot.model.safe_xml import parse_xml

_BODY = '<body><freejoint/><geom type="mesh" mesh="part" name="shape"/></body>'
_OPENED: list[Path] = []
_WATCHING = False


def _watch(event: str, arguments: tuple) -> None:
    if _WATCHING and event == "open" and isinstance(arguments[0], (str, bytes)):
        _OPENED.append(Path(os.fsdecode(arguments[0])))


sys.addaudithook(_watch)  # a hook cannot be taken away again


def opened_by(source: Path) -> list[Path]:
    """The files Python opened to read ``source``, whether it was refused or not."""
    global _WATCHING
    _OPENED.clear()
    _WATCHING = True
    try:
        robot_spec(str(source))
    except RobotError:
        pass
    finally:
        _WATCHING = False
    return [path for path in _OPENED if path.suffix not in {".py", ".pyc"}]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A robot's folder with a mesh in it, beside a folder with another."""
    for name in ("robot", "secret"):
        (tmp_path / name).mkdir()
        trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / name / "part.stl")
    (tmp_path / "secret" / "more.xml").write_text("<mujoco><worldbody/></mujoco>")
    return tmp_path / "robot"


def mjcf(asset: str = '<mesh file="part.stl"/>', body: str = _BODY, before: str = "") -> str:
    return f"<mujoco>{before}<asset>{asset}</asset><worldbody>{body}</worldbody></mujoco>"


def urdf(mesh: str, before: str = "") -> str:
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    shape = f'<collision><geometry><mesh filename="{mesh}"/></geometry></collision>'
    return f'<robot name="r">{before}<link name="base">{inertial}{shape}</link></robot>'


def include(name: str) -> str:
    return f'<mujoco><include file="{name}"/></mujoco>'


def write(folder: Path, text: str, name: str = "robot.xml") -> Path:
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    return path


def test_meshes_of_the_folder_load(folder):
    model = robot_spec(str(write(folder, mjcf()))).compile()
    assert model.nmesh == 1
    assert model.mesh("part").vertnum == 8


def test_mujoco_opens_nothing(folder):
    """Everything is in memory before MuJoCo compiles: it works when the folder is gone."""
    spec = robot_spec(str(write(folder, mjcf())))
    shutil.rmtree(folder)
    assert spec.compile().nmesh == 1


def test_includes_are_put_in(folder):
    body = '<body name="b"><freejoint/><geom size="1"/></body>'
    write(folder, '<mujoco><compiler angle="radian"/><include file="more.xml"/></mujoco>', "parts/first.xml")
    write(folder, f"<mujoco><worldbody>{body}</worldbody></mujoco>", "parts/more.xml")
    path = write(folder, '<mujoco><include file="parts/first.xml"/></mujoco>')
    assert robot_spec(str(path)).compile().body("b").id == 1
    assert {name.name for name in opened_by(path)} == {"robot.xml", "first.xml", "more.xml"}


def test_the_digest_knows_includes_and_meshes(folder):
    assert robot_digest("embedded:humanoid") == robot_digest(str(folder / "none.xml")) == ""
    path = write(folder, mjcf())
    before = robot_digest(str(path))
    assert before == robot_digest(str(path)) != ""
    mesh = next(folder.rglob("*.stl"))
    trimesh.creation.box((1.0, 2.0, 3.0)).export(mesh)
    changed = robot_digest(str(path))
    assert changed != before
    write(folder, include("more.xml"))
    write(folder, "<mujoco><worldbody/></mujoco>", "more.xml")
    first = robot_digest(str(path))
    write(folder, '<mujoco><worldbody><body name="b"/></worldbody></mujoco>', "more.xml")
    assert robot_digest(str(path)) not in (first, changed, "")


OUTSIDE = {
    "include, parent": (include("../secret/more.xml"), "<include file>"),
    "include, absolute": (include("{secret}/more.xml"), "<include file>"),
    "include, through the folder": (include("a/../../secret/more.xml"), "<include file>"),
    "mesh, parent": (mjcf('<mesh name="part" file="../secret/part.stl"/>'), "<mesh file>"),
    "mesh, absolute": (mjcf('<mesh name="part" file="{secret}/part.stl"/>'), "<mesh file>"),
    "mesh, file address": (mjcf('<mesh name="part" file="file://{secret}/part.stl"/>'), "<mesh file>"),
    "mesh, web address": (mjcf('<mesh name="part" file="http://example.org/part.stl"/>'), "<mesh file>"),
    "mesh, backslashes": (mjcf('<mesh name="part" file="..\\\\secret\\\\part.stl"/>'), "<mesh file>"),
    "mesh, link": (mjcf('<mesh name="part" file="link.stl"/>'), "<mesh file>"),
    "mesh, linked folder": (mjcf('<mesh name="part" file="linked/part.stl"/>'), "<mesh file>"),
    "mesh of a default": (mjcf(before='<default><mesh file="../secret/a.stl"/></default>'), "<mesh file>"),
    "meshdir, parent": (mjcf(before='<compiler meshdir="../secret"/>'), "<compiler meshdir>"),
    "meshdir, absolute": (mjcf(before='<compiler meshdir="{secret}"/>'), "<compiler meshdir>"),
    "assetdir": (mjcf(before='<compiler assetdir="../secret"/>'), "<compiler assetdir>"),
    "texturedir": (mjcf(before='<compiler texturedir="/etc"/>'), "<compiler texturedir>"),
    "texture": (mjcf('<texture type="2d" file="../secret/a.png"/>'), "<texture file>"),
    "cube texture": (mjcf('<texture type="cube" fileright="/etc/a.png"/>'), "<texture fileright>"),
    "height field": (mjcf('<hfield file="../secret/a.png" size="1 1 1 1"/>'), "<hfield file>"),
    "skin": (mjcf('<skin file="../secret/a.skn"/>'), "<skin file>"),
    "package": (urdf("package://robot/../secret/part.stl"), "<mesh filename>"),
    "URDF, parent": (urdf("../secret/part2.stl"), "<mesh filename>"),
    "URDF, file address": (urdf("file://{secret}/part.stl"), "<mesh filename>"),
    "URDF, meshdir": (urdf("part.stl", '<mujoco><compiler meshdir="../secret"/></mujoco>'), "<compiler meshdir>"),
}


@pytest.mark.parametrize("case", OUTSIDE)
def test_files_outside_the_folder_are_refused_and_not_opened(folder, case):
    text, place = OUTSIDE[case]
    secret = folder.parent / "secret"
    if "link" in case:
        if os.name == "nt":
            pytest.skip("links need privileges")
        (folder / "link.stl").symlink_to(secret / "part.stl")
        (folder / "linked").symlink_to(secret, target_is_directory=True)
    path = write(folder, text.replace("{secret}", str(secret)))
    with pytest.raises(RobotError, match=r"leaves the robot's folder|not relative|no file's name") as error:
        robot_spec(str(path))
    assert f"robot.xml, line 1, {place}" in str(error.value)
    assert error.value.cure
    assert opened_by(path) == [path]


@pytest.mark.skipif(os.name == "nt", reason="links need privileges")
def test_link_inside_the_folder_is_followed(folder):
    (folder / "same.stl").symlink_to(folder / "part.stl")
    robot_spec(str(write(folder, mjcf('<mesh name="part" file="same.stl"/>')))).compile()


@pytest.mark.skipif(os.name == "nt", reason="pipes are no files there")
def test_pipe_is_not_waited_for(folder):
    os.mkfifo(folder / "pipe.stl")
    path = write(folder, mjcf('<mesh name="part" file="pipe.stl"/>'))
    with pytest.raises(RobotError, match=r"there is no file 'pipe\.stl'"):
        robot_spec(str(path))
    assert opened_by(path) == [path]


REFUSED = {
    "missing mesh": (mjcf('<mesh name="part" file="gone.stl"/>'), "<mesh file>: there is no file"),
    "missing include": (include("gone.xml"), "<include file>: there is no file"),
    "mesh of another kind": (mjcf('<mesh name="part" file="robot.xml"/>'), "no STL, OBJ or MSH"),
    "NaN": (mjcf(body='<body pos="0 nan 0"/>'), r"<body pos>: '0 nan 0' is not finite"),
    "NaN of C": (mjcf(body='<body pos="0 -NAN(1) 0"/>'), "<body pos>: .* is not finite"),
    "infinity": (mjcf(body='<body><joint range="0 INF"/></body>'), r"<joint range>: '0 INF' is not finite"),
    "negative mass": (mjcf(body='<body><inertial pos="0 0 0" mass="-1"/></body>'), "mass>: .* negative"),
    "negative mass of a link": (
        '<robot name="a"><link name="b"><inertial><mass value=" -2"/></inertial></link></robot>',
        "<mass value>: the mass is negative",
    ),
    "overflow": (mjcf(body='<body><geom size="1e999"/></body>'), "<geom size>: '1e999' is not finite"),
    "plugin": (mjcf(before='<extension><plugin plugin="mujoco.pid"/></extension>'), "<extension>: .*plugins"),
    "plugin of a body": (mjcf(body='<body><plugin plugin="x"/></body>'), "<plugin>: .* no plugins"),
    "other model": (mjcf('<model name="a" file="b.xml"/>'), "<model>: .* no other models"),
    "replicate": (mjcf(body='<replicate count="100000000"><body/></replicate>'), "<replicate>: .* 20000"),
    "replicate in replicate": (
        mjcf(body='<replicate count="999"><replicate count="999"><body/></replicate></replicate>'),
        "20000",
    ),
    "replicate, no count": (mjcf(body='<replicate count="1e8"><body/></replicate>'), "20000"),
    "composite": (mjcf(body='<body><composite count="9 9 9"/></body>'), "no composite objects"),
    "flexcomp": (mjcf(body='<flexcomp count="999 999 999" name="f"/>'), "no deformable objects"),
    "height field": (mjcf(body='<body><geom type="hfield" hfield="a"/></body>'), "height fields"),
    "built-in mesh": (mjcf('<mesh name="part" builtin="sphere" params="20"/>'), "no built-in meshes"),
    "entities": ('<!DOCTYPE a [<!ENTITY b "c">]><mujoco/>', "may not declare a document type"),
    "cycle": (include("robot.xml"), "included again"),
    "deep": ("<mujoco>" + "<body>" * 200 + "</body>" * 200 + "</mujoco>", "100 levels"),
    "wide": ("<mujoco><body " + " ".join(f"a{index}='1'" for index in range(300)) + "/></mujoco>", "256 attributes"),
    "large": ("<mujoco>" + " " * (16 << 20) + "</mujoco>", "16 MiB"),
    "many": ("<mujoco>" + "<body/>" * 50_001 + "</mujoco>", "50000 elements"),
    "xacro": ('<robot xmlns:xacro="x"><xacro:include filename="/etc/passwd"/></robot>', "Expand xacro"),
    "no robot": ("<svg/>", "<svg>: <svg> is no robot"),
    "no XML": ("solid part", "this is no XML"),
    "unknown file": (mjcf(body='<body><geom file="part.stl"/></body>'), "<geom file>: .* no files here"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line_with_its_place(folder, case):
    text, says = REFUSED[case]
    with pytest.raises(RobotError, match=says) as error:
        robot_spec(str(write(folder, text)))
    message = str(error.value)
    assert "\n" not in message
    assert message.startswith(str(folder / "robot.xml"))
    assert error.value.cure


def test_too_large_files_are_refused(folder, monkeypatch):
    with (folder / "part.stl").open("wb") as file:
        file.truncate((128 << 20) + 1)
    with pytest.raises(RobotError, match=r"'part\.stl' has more than 128 MiB"):
        robot_spec(str(write(folder, mjcf())))


def test_billion_laughs_end_at_once(folder):
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 30))
    text = f'<!DOCTYPE m [<!ENTITY l0 "ha">{laughs}]><mujoco model="&l29;"/>'
    with pytest.raises(RobotError, match="document type"):
        robot_spec(str(write(folder, text)))


def test_left_out_is_what_a_robot_does_not_need(folder):
    text = mjcf(
        '<mesh file="part.stl"/><texture name="t" type="2d" builtin="flat" width="1" height="1"/>'
        '<material name="m" texture="t"/><hfield name="h" nrow="9" ncol="9" size="1 1 1 1"/>',
        body='<geom type="plane" size="1 1 1"/><geom type="hfield" hfield="h"/><light/>'
        f'<body name="table"><geom size="1"/></body>{_BODY}',
        before='<option timestep="5"/><size memory="900G"/><sensor><clock/></sensor>'
        '<custom><numeric name="n" size="99999999"/></custom>',
    )
    model = robot_spec(str(write(folder, text))).compile()
    assert (model.ngeom, model.ntex, model.nhfield, model.nlight, model.nsensor, model.nnumeric) == (1, 0, 0, 0, 0, 0)
    assert model.nbody == 2
    assert model.opt.timestep == mujoco.MjModel.from_xml_string("<mujoco/>").opt.timestep


@pytest.mark.parametrize(
    ("mesh", "before"),
    [
        ("package://robot/meshes/part.stl", ""),
        ("../meshes/part.stl", ""),
        ("anything/part.stl", '<mujoco><compiler meshdir="../meshes"/></mujoco>'),
        ("part.stl", '<mujoco><compiler meshdir="../meshes" strippath="false"/></mujoco>'),
    ],
)
def test_urdf_of_a_package(folder, mesh, before):
    (folder / "meshes").mkdir()
    (folder / "part.stl").rename(folder / "meshes" / "part.stl")
    path = write(folder, urdf(mesh, before), "urdf/robot.urdf")
    model = robot_spec(str(path)).compile()
    assert model.nmesh == 1
    assert model.joint(0).type[0] == mujoco.mjtJoint.mjJNT_FREE
    write(folder.parent, urdf("../../secret/part.stl"), "robot/urdf/other.urdf")
    with pytest.raises(RobotError, match="leaves the robot's folder"):
        robot_spec(str(folder / "urdf" / "other.urdf"))


@pytest.mark.parametrize("inner", ["", "robots/one/"])
def test_a_package_is_the_folder_with_its_package_xml(folder, inner):
    """Whatever is between it and the robot's file; a package of another name is not looked into."""
    (folder / "package.xml").write_text("<package><!-- <name>old</name> --><name> many_robots </name></package>")
    for name in ("robots", "robots/one", "robots/one/urdf", "robots/one/meshes", "meshes"):
        (folder / name).mkdir(exist_ok=True)
    shutil.copy(folder / "part.stl", folder / inner / "meshes" / "own.stl")
    mesh = f"package://many_robots/{inner}meshes/own.stl"
    path = write(folder, urdf(mesh), "robots/one/urdf/robot.urdf")
    assert robot_spec(str(path)).compile().nmesh == 1
    assert {file.name for file in opened_by(path)} == {"robot.urdf", "own.stl", "package.xml"}
    (folder / "package.xml").write_text("<package><name>another</name></package>")
    named = mesh.replace("many_robots", folder.name)  # as an installed package may be called by its folder alone
    assert robot_spec(str(write(folder, urdf(named), "robots/one/urdf/robot.urdf"))).compile().nmesh == 1
    (folder / "package.xml").write_text("<package><name>many_robots</name></package>")
    write(folder, urdf(mesh.replace("many", "other")), "robots/one/urdf/robot.urdf")
    with pytest.raises(RobotError, match=r"there is no file '.*own\.stl'") as error:
        robot_spec(str(path))
    assert str(folder) in error.value.cure
    write(folder, urdf("package://many_robots/../secret/part.stl"), "robots/one/urdf/robot.urdf")
    with pytest.raises(RobotError, match="leaves the robot's folder"):
        robot_spec(str(path))


def test_names_around_a_robot_are_no_packages(folder):
    """A folder above without a package.xml lends its name to nobody."""
    path = write(folder, urdf(f"package://{folder.parent.name}/secret/part.stl"), "robot.urdf")
    with pytest.raises(RobotError, match="there is no file"):
        robot_spec(str(path))
    assert opened_by(path) == [path]


@pytest.mark.parametrize("before", ["", '<compiler meshdir="../meshes"/>'])
def test_a_name_of_an_included_file_begins_there_too(folder, before):
    (folder / "meshes").mkdir()
    (folder / "part.stl").rename(folder / "meshes" / "part.stl")
    name = "part.stl" if before else "../meshes/part.stl"
    write(folder, mjcf(f'<mesh name="part" file="{name}"/>', before=before), "xml_parts/body.xml")
    path = write(folder, include("xml_parts/body.xml"))
    assert robot_spec(str(path)).compile().nmesh == 1
    write(folder, mjcf('<mesh name="part" file="../../secret/part.stl"/>'), "xml_parts/body.xml")
    with pytest.raises(RobotError, match=r"body\.xml, line 1, <mesh file>: .* leaves the robot's folder"):
        robot_spec(str(path))
    assert [file for file in opened_by(path) if not file.is_relative_to(folder)] == []


FRAMES = {
    "no body has this": '<mass value="0.4"/><inertia ixx="0.002" iyy="0.002" izz="0.0045" ixy="0" ixz="0" iyz="0"/>',
    "next to nothing": '<mass value="4e-15"/><inertia ixx="2e-27" iyy="2e-27" izz="2e-27" ixy="0" ixz="0" iyz="0"/>',
}


@pytest.mark.parametrize("kind", FRAMES)
@pytest.mark.parametrize("joint", ["fixed", "continuous"])
def test_inertias_that_no_body_has_are_balanced_and_bounded(folder, kind, joint):
    frame = f"""<link name="frame"><inertial>{FRAMES[kind]}</inertial></link><joint name="to_frame" type="{joint}">
        <parent link="base"/><child link="frame"/><axis xyz="0 0 1"/></joint></robot>"""
    path = write(folder, urdf("part.stl").replace("</robot>", frame), "robot.urdf")
    model, bounded = compiled_robot(str(path))
    assert bounded == ("frame",)
    low, middle, high = np.sort(model.body("frame").inertia)
    assert low + middle >= high and low >= 1e-5 and model.body("frame").mass[0] >= 1e-3
    np.testing.assert_array_equal(model.body("base").inertia, np.ones(3))
    with pytest.raises(ValueError, match="inertia"):
        robot_spec(str(path)).compile()


def test_an_mjcf_s_owner_is_told_how_to_bound_its_inertias(folder):
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 3"/>'
    path = write(folder, mjcf("", f'<body><freejoint/>{inertial}<geom size="1"/></body>'))
    with pytest.raises(RobotError, match=r'<compiler balanceinertia="true" boundmass="0\.001" boundinertia='):
        compiled_robot(str(path))


def test_urdf_pictures_and_gazebo_are_left_out(folder):
    text = urdf("part.stl", '<gazebo><plugin filename="libevil.so"/></gazebo>').replace(
        "<collision>", '<visual><geometry><mesh filename="part.dae"/></geometry></visual><collision>'
    )
    assert robot_spec(str(write(folder, text, "robot.urdf"))).compile().nmesh == 1


def test_files_of_one_name_are_kept_apart(folder):
    (folder / "other").mkdir()
    trimesh.creation.box((0.2, 0.2, 0.2)).export(folder / "other" / "part.stl")
    assets = '<mesh name="part" file="part.stl"/><mesh name="big" file="other/part.stl"/>'
    model = robot_spec(str(write(folder, mjcf(assets)))).compile()
    sizes = [abs(model.mesh_vert[model.mesh(name).vertadr[0]]).max() for name in ("part", "big")]
    assert sizes == pytest.approx([0.05, 0.1])


def test_everything_has_a_name(folder):
    body = '<body><freejoint/><geom size="1"/><body><joint/><geom size="1"/></body></body>'
    model = robot_spec(str(write(folder, mjcf("", body)))).compile()
    assert all(model.body(index).name for index in range(1, model.nbody))
    assert all(model.joint(index).name for index in range(model.njnt))


def test_real_robots_stay_as_mujoco_reads_them(shared_robot):
    for name in ("g1/unitree_mujoco_g1/scene_29dof.xml", "h1/h1/h1.xml"):
        path = shared_robot(name)
        ours, theirs = robot_spec(str(path)).compile(), mujoco.MjModel.from_xml_path(str(path))
        assert (ours.nq, ours.nu, ours.nmesh) == (theirs.nq, theirs.nu, theirs.nmesh)
        np.testing.assert_allclose(ours.body_mass, theirs.body_mass)
        np.testing.assert_array_equal(ours.mesh_vert, theirs.mesh_vert)


def test_real_urdf_opens_its_package_alone(shared_robot):
    path = shared_robot("h1/h1/urdf/h1.urdf")
    robot = RobotModel.load(path, ["torso_link", [0.1, 0.03, 0.69], [0, 0.7, 0], {"hfov_deg": 69}])
    assert [len(leg.joints) for leg in robot.legs] == [5, 5]
    package = path.resolve().parents[1]
    opened = opened_by(path)
    assert len(opened) > 10
    assert all(file.is_relative_to(package) for file in opened)


@pytest.fixture(scope="module")
def meshes_everywhere(tmp_path_factory) -> Path:
    """A robot's folder where the folders around it and in it have meshes of one name."""
    base = tmp_path_factory.mktemp("fuzz")
    (base / "robot" / "a").mkdir(parents=True)
    (base / "secret").mkdir()
    for place in (base, base / "robot", base / "robot" / "a", base / "secret"):
        trimesh.creation.box((1, 1, 1)).export(place / "part.stl")
    return base / "robot"


@settings(max_examples=150, deadline=None)
@given(
    name=st.recursive(
        st.sampled_from(["..", ".", "part.stl", "a", "secret", "/", "//", "file:", "package://", "~", "%2e%2e"]),
        lambda parts: st.lists(parts, min_size=1, max_size=4).map("/".join),
        max_leaves=6,
    )
)
def test_no_name_opens_a_file_outside(meshes_everywhere, name):
    for text in (mjcf(f'<mesh name="part" file="{name}"/>'), urdf(name), include(name)):
        opened = opened_by(write(meshes_everywhere, text))
        assert all(path.is_relative_to(meshes_everywhere) for path in opened)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_a_tree_or_refused(data):
    source = Path("robot.xml")
    try:
        tree = parse_xml(data, source)
    except RobotError as error:
        assert "robot.xml" in str(error)
    else:
        assert tree.tag


def test_gathered_tree_names_gathered_files_only(folder):
    (folder / "meshes").mkdir()
    (folder / "part.stl").rename(folder / "meshes" / "part.stl")
    root, files = gather_robot(write(folder, mjcf(before='<compiler meshdir="meshes"/>')))
    assert [element.get("file") for element in root.iter("mesh")] == list(files) == ["part.stl"]
    assert not [name for element in root.iter("compiler") for name in element.attrib]
