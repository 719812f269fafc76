"""Structural conditions in Cycles and EEVEE: what the proxy looks like along a camera path.

Every pixel's ray goes through its centre, as in the z-buffer: an antialiased depth has
flying points. What the faces carry reaches the pixels by shader outputs (AOVs), which both
engines have and which, unlike material and object indices, take any number of objects.
"""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import bpy
import numpy as np

from ...core.atomic_files import write_whole
from ...core.cameras import Camera
from ...core.errors import GenerationError
from ...core.file_locks import try_lock
from ...geometry.proxy.proxy import GeometryProxy
from ..shared import versions
from ..shared.cameras import create_camera, set_camera, use_frame_of
from ..shared.meshes import add_attribute, assign_materials, mesh_from_arrays
from ..shared.outliner import remove_objects

MANIFEST = "manifest.json"
"""Written last: a folder without it holds no complete path."""

PASSES = ("Depth", "Distance", "Normal", "NormalCamera", "Provenance", "Instance", "Validity")
"""The passes of each EXR, in metres, unit vectors and numbers, as in ``generation.conditions``.

Provenance tells where nothing is seen (0); Depth and Distance mean nothing there.
"""

NEAR_M = 0.02
"""Surfaces nearer to the camera plane than this are not drawn, as in the z-buffer."""

_UNFINISHED = ".unfinished-"
_LOCKS = ".locks"
_NAMES = {"cycles": "Cycles", "eevee": "EEVEE"}
_NAME = "R2S-EGO conditions"
_EXACT_HALF = 2048  # EEVEE keeps AOVs as 16-bit floats: whole numbers up to here


def renderer_name(engine: str) -> str:
    """What results call ``engine`` ("cycles" or "eevee") of this Blender: "Cycles 4.5.15"."""
    return f"{_NAMES[engine]} {versions.VERSION}"


class ConditionScene:
    """A Blender scene of its own with one proxy, which renders from any number of cameras.

    The mesh goes to the render engine with the first frame and stays there.
    """

    def __init__(self, proxy: GeometryProxy, engine: str = "cycles") -> None:
        """Raises GenerationError for an engine this Blender lacks, or more objects than EEVEE can number."""
        if engine == "eevee" and proxy.instance.max(initial=0) > _EXACT_HALF:
            raise GenerationError(
                f"EEVEE tells at most {_EXACT_HALF} objects apart",
                where="generation.renderer",
                cure="Choose the z-buffer or Cycles.",
            )
        self._scene = _scene_of(engine)
        self._material = _condition_material(engine)
        self._camera: bpy.types.Object | None = None
        mesh = mesh_from_arrays(_NAME, proxy.vertices, proxy.faces)
        add_attribute(mesh, "provenance", proxy.provenance.astype(np.int32) + 1)
        add_attribute(mesh, "instance", proxy.instance)
        add_attribute(mesh, "supported", (proxy.support > 0).astype(np.int32))
        assign_materials(mesh, [self._material], np.zeros(len(proxy.faces), np.int32))
        self._scene.collection.objects.link(bpy.data.objects.new(_NAME, mesh))
        _declare_passes(self._scene)
        versions.write_multilayer(self._scene)

    def render(self, camera: Camera, file: Path) -> None:
        """Write the passes seen from ``camera`` as the multilayer EXR ``file``, which is never half there.

        Raises GenerationError when Blender could not render or write it.
        """
        scene = self._scene
        if self._camera is None:
            self._camera = create_camera(_NAME, camera)
            self._camera.data.clip_start = NEAR_M
            scene.collection.objects.link(self._camera)
        else:
            set_camera(self._camera, camera)
        use_frame_of(self._camera, scene)
        unfinished = file.with_name(_UNFINISHED + file.name)
        scene.render.filepath = versions.render_filepath(unfinished)
        try:
            _render_now(scene)
        except RuntimeError as error:
            raise GenerationError(
                f"Blender could not render: {error}", where=file, cure="Render again, smaller where memory is short."
            ) from error
        if not unfinished.is_file():
            raise GenerationError("Blender wrote no image", where=file, cure="Is the disk full?")
        try:
            unfinished.replace(file)
        except OSError as error:
            raise GenerationError(
                f"the image cannot be written: {error.strerror}", where=file, cure="Choose another folder."
            ) from error

    def remove(self) -> None:
        """Take the scene and all that is in it out of Blender."""
        remove_objects(self._scene.collection.objects)
        bpy.data.materials.remove(self._material)
        bpy.data.scenes.remove(self._scene)


def render_path(
    scene: ConditionScene,
    path: Sequence[Camera],
    folder: Path,
    engine: str,
    on_frame: Callable[[int], None] = lambda index: None,
    only: range | None = None,
) -> list[Path]:
    """Render from every camera of ``path``: ``000.exr`` and on, and a manifest.

    With ``only`` the frames of that range, as where several machines share a clip: whoever finds
    all of them there in the end writes the manifest. ``on_frame`` hears the index of each frame
    that is begun. Returns the images. Raises GenerationError when Blender could not render one,
    or the path has none in the range.
    """
    part = [index for index in range(len(path)) if only is None or index in only]
    if only is not None and not part:
        raise GenerationError(
            f"the clip has no frame from {only.start} to {only.stop - 1}",
            where=folder,
            cure=f"It has 0 to {len(path) - 1}.",
        )
    folder.mkdir(parents=True, exist_ok=True)
    manifest = folder / MANIFEST
    manifest.unlink(missing_ok=True)
    files = [folder / f"{index:03d}.exr" for index in range(len(path))]
    for index in part:
        on_frame(index)
        scene.render(path[index], files[index])
    if all(file.is_file() for file in files):
        _write_manifest(folder, files, path, engine)
    return [files[index] for index in part]


def render_shared(scene: ConditionScene, path: Sequence[Camera], folder: Path, engine: str) -> list[Path]:
    """As ``render_path``, the frames alone that nobody has rendered or is rendering; those are returned.

    Any number of Blenders may do so at once on one folder. A frame is one's own while its lock is held, which the
    system drops where a Blender dies: another then takes the frame. Raises as ``render_path``, and SceneError where
    the disk knows no locks.
    """
    locks = folder / _LOCKS
    locks.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{index:03d}.exr" for index in range(len(path))]
    written = []
    for camera, file in zip(path, files, strict=True):
        if file.is_file():
            continue
        with _taken(locks / file.stem) as is_ours:
            if is_ours and not file.is_file():  # another may have ended it since
                scene.render(camera, file)
                written.append(file)
    while not (folder / MANIFEST).is_file() and all(file.is_file() for file in files):
        with _taken(locks / MANIFEST) as is_ours:
            if is_ours:
                _write_manifest(folder, files, path, engine)
    if (folder / MANIFEST).is_file():
        shutil.rmtree(locks, ignore_errors=True)
    return written


@contextlib.contextmanager
def _taken(lock: Path) -> Iterator[bool]:
    """Within its ``with`` block the lock is held; whether it could be: not where all is done, and locks are gone."""
    try:
        file = lock.open("ab")
    except FileNotFoundError:
        yield False
        return
    with file:
        yield try_lock(file)


def _write_manifest(folder: Path, files: Sequence[Path], path: Sequence[Camera], engine: str) -> None:
    frames = [{"file": f.name, "camera": c.to_json()} for f, c in zip(files, path, strict=True)]
    content = {"complete": True, "renderer": renderer_name(engine), "passes": PASSES, "frames": frames}
    write_whole(folder / MANIFEST, json.dumps(content, indent=1))


def _render_now(scene: bpy.types.Scene) -> None:
    bpy.ops.render.render(write_still=True, scene=scene.name)


def _declare_passes(scene: bpy.types.Scene) -> None:
    layer = scene.view_layers[0]
    layer.use_pass_combined = False
    layer.use_pass_z = True
    for name in PASSES[1:]:
        aov = layer.aovs.add()
        aov.name = name
        aov.type = "COLOR" if name.startswith("Normal") else "VALUE"


def _scene_of(engine: str) -> bpy.types.Scene:
    """A scene with one exact sample: no antialiasing, denoising, light or blur. EXRs know no view transform."""
    scene = bpy.data.scenes.new(_NAME)
    try:
        scene.render.engine = versions.RENDER_ENGINES[engine]
    except TypeError as error:
        bpy.data.scenes.remove(scene)
        raise GenerationError(
            f"{_NAMES[engine]} is not enabled in this Blender", where=engine, cure="Enable its add-on."
        ) from error
    scene.render.use_persistent_data = True
    scene.render.use_motion_blur = False
    scene.render.use_compositing = scene.render.use_sequencer = False
    if engine == "cycles":
        # The first sample of Cycles goes through the pixel's centre whatever the filter.
        scene.cycles.device = "CPU"
        scene.cycles.samples = 1
        scene.cycles.use_adaptive_sampling = False
        scene.cycles.use_denoising = False
        scene.cycles.max_bounces = 0
    else:
        scene.eevee.taa_render_samples = 1
        scene.render.filter_size = 0.0
    return scene


def _condition_material(engine: str) -> bpy.types.Material:
    material = bpy.data.materials.new(_NAME)
    if not material.use_nodes:
        material.use_nodes = True
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    nodes.clear()
    # Cycles takes a surface without a shader, or a black one, for transparent, and a glowing one for a lamp.
    surface, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    if engine == "cycles":
        material.cycles.emission_sampling = "NONE"
    link(surface.outputs[0], output.inputs["Surface"])
    geometry, view = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeCameraData")
    normal = geometry.outputs["True Normal"]  # towards the camera; EEVEE packs the other normals coarsely
    to_camera, to_opencv = nodes.new("ShaderNodeVectorTransform"), nodes.new("ShaderNodeVectorMath")
    to_camera.vector_type, to_camera.convert_from, to_camera.convert_to = "NORMAL", "WORLD", "CAMERA"
    to_opencv.operation = "MULTIPLY"
    to_opencv.inputs[1].default_value = (1.0, -1.0, 1.0)  # shaders' camera space: y up, z forward
    link(normal, to_camera.inputs[0])
    link(to_camera.outputs[0], to_opencv.inputs[0])
    valid = nodes.new("ShaderNodeMath")
    valid.operation = "GREATER_THAN"
    link(_attribute(material, "supported"), valid.inputs[0])
    link(geometry.outputs["Backfacing"], valid.inputs[1])
    for name, value in (
        ("Distance", view.outputs["View Distance"]),
        ("Normal", normal),
        ("NormalCamera", to_opencv.outputs[0]),
        ("Provenance", _attribute(material, "provenance")),
        ("Instance", _attribute(material, "instance")),
        ("Validity", valid.outputs[0]),
    ):
        aov = nodes.new("ShaderNodeOutputAOV")
        aov.aov_name = name
        link(value, aov.inputs["Color" if name.startswith("Normal") else "Value"])
    return material


def _attribute(material: bpy.types.Material, name: str) -> bpy.types.NodeSocket:
    """A face's whole number; rounded, since EEVEE interpolates it between the corners."""
    nodes = material.node_tree.nodes
    attribute, rounded = nodes.new("ShaderNodeAttribute"), nodes.new("ShaderNodeMath")
    attribute.attribute_name = name
    rounded.operation = "ROUND"
    material.node_tree.links.new(attribute.outputs["Fac"], rounded.inputs[0])
    return rounded.outputs[0]
