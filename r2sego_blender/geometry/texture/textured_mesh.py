"""A mesh with one texture of baked light: rendered, and written as GLB."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from trimesh.exchange.gltf import export_glb

from ...core.cameras import Camera
from ..visibility.rasterizer import MeshRasterizer

_UNLIT = "KHR_materials_unlit"


@dataclass(frozen=True)
class TexturedMesh:
    """``vertices`` (V, 3) float32 in the world, metres; ``faces`` (F, 3) int32; ``uvs`` (V, 2)
    float32 in [0, 1], v downwards; ``texture`` (S, S, 3) uint8 sRGB; ``method`` of the
    unwrapping; ``seen``: the share of the surface's texels that a capture sees."""

    vertices: np.ndarray
    faces: np.ndarray
    uvs: np.ndarray
    texture: np.ndarray
    method: str
    seen: float

    def render(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """The view (H, W, 3) float32 in [0, 1], bilinear texels, and where there is a surface (H, W)."""
        buffers = MeshRasterizer(self.vertices, self.faces).render(camera, [self.uvs])
        image = sampled(self.texture, buffers.attributes[0])
        image[buffers.face < 0] = 0
        return image, buffers.face >= 0

    def png(self) -> bytes:
        """The texture as PNG."""
        buffer = io.BytesIO()
        Image.fromarray(self.texture).save(buffer, "PNG", compress_level=6)
        return buffer.getvalue()

    def glb(self) -> bytes:
        """The mesh as binary glTF: Y up, one unlit material, since the light is in the texture."""
        y_up = self.vertices[:, [0, 2, 1]] * np.array([1, 1, -1], np.float32)
        picture = Image.open(io.BytesIO(self.png()))
        material = trimesh.visual.material.PBRMaterial(
            name="baked", baseColorTexture=picture, metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True
        )
        # trimesh counts v upwards and turns it round again for glTF.
        visual = trimesh.visual.TextureVisuals(self.uvs * [1, -1] + [0, 1], material=material)
        mesh = trimesh.Trimesh(y_up, self.faces, visual=visual, process=False)
        scene = trimesh.Scene()
        scene.add_geometry(mesh, node_name="proxy", geom_name="proxy")
        return export_glb(scene, include_normals=False, tree_postprocessor=_unlit)


def sampled(texture: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    """Bilinear colours (..., 3) float32 of a texture (S, S, 3) uint8 at uvs (..., 2), v downwards."""
    size = texture.shape[0]
    place = np.clip(np.asarray(uvs, np.float32) * size - 0.5, 0, size - 1)
    first = np.minimum(place.astype(np.int64), size - 2)
    column, row = first[..., 0], first[..., 1]
    across, down = (np.clip(place - first, 0, 1)[..., axis, None] for axis in range(2))
    upper = texture[row, column] * (1 - across) + texture[row, column + 1] * across
    lower = texture[row + 1, column] * (1 - across) + texture[row + 1, column + 1] * across
    return ((upper * (1 - down) + lower * down) / 255).astype(np.float32)


def _unlit(document: dict[str, Any]) -> None:
    document["extensionsUsed"] = [*document.get("extensionsUsed", []), _UNLIT]
    for material in document["materials"]:
        material["extensions"] = {_UNLIT: {}}
