"""A part of a region that is drawn once and then shown as a picture, at the cost of its pixels alone."""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import gpu
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

_VERTEX = """
void main()
{
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 0.0, 1.0);
  texel = place;
}
"""

_FRAGMENT = """
void main()
{
  fragColour = texelFetch(picture, ivec2(texel), 0);
}
"""

_shaders: list[gpu.types.GPUShader] = []


class KeptPicture:
    """A rectangle of a region: ``left``, ``bottom``, ``width`` and ``height`` in its pixels, made whole.

    What is drawn between ``drawing()``, in the region's pixels, is what ``draw()`` shows there.
    """

    def __init__(self, left: float, bottom: float, width: float, height: float) -> None:
        left, bottom = math.floor(left), math.floor(bottom)
        self.place = left, bottom, math.ceil(width), math.ceil(height)
        # As what views are drawn into: shapes and words are blended in linear light in both.
        self._pixels = gpu.types.GPUTexture(self.place[2:], format="SRGB8_A8")
        self._drawn_into = gpu.types.GPUFrameBuffer(color_slots=self._pixels)

    @contextmanager
    def drawing(self) -> Iterator[None]:
        """Within it, all that is drawn goes into the picture, which is empty at first."""
        left, bottom, width, height = self.place
        with self._drawn_into.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            self._drawn_into.clear(color=(0.0, 0.0, 0.0, 0.0))
            gpu.matrix.load_matrix(Matrix.Identity(4))
            gpu.matrix.load_projection_matrix(_pixels_of(left, bottom, width, height))
            yield

    def draw(self) -> None:
        """Show it in the region, for which it was made."""
        left, bottom, width, height = self.place
        shader = _shader()
        corners = ((0, 0), (width, 0), (0, height), (width, height))
        places = [(left + x, bottom + y) for x, y in corners]
        batch = batch_for_shader(shader, "TRI_STRIP", {"pos": places, "place": corners})
        gpu.state.blend_set("ALPHA_PREMULT")  # which colours blended over nothing are
        shader.bind()
        seen = gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix()
        shader.uniform_float("ModelViewProjectionMatrix", seen)
        shader.uniform_sampler("picture", self._pixels)
        batch.draw(shader)
        gpu.state.blend_set("NONE")


def forget_shader() -> None:
    """Let go of what is on the graphics card."""
    _shaders.clear()


def _pixels_of(left: int, bottom: int, width: int, height: int) -> Matrix:
    """The projection that maps a rectangle of a region to all of what is drawn into."""
    return Matrix((
        (2.0 / width, 0.0, 0.0, -2.0 * left / width - 1.0),
        (0.0, 2.0 / height, 0.0, -2.0 * bottom / height - 1.0),
        (0.0, 0.0, -0.01, 0.0),
        (0.0, 0.0, 0.0, 1.0),
    ))  # fmt: skip


def _shader() -> gpu.types.GPUShader:
    if not _shaders:
        info = gpu.types.GPUShaderCreateInfo()
        info.push_constant("MAT4", "ModelViewProjectionMatrix")
        info.sampler(0, "FLOAT_2D", "picture")
        info.vertex_in(0, "VEC2", "pos")
        info.vertex_in(1, "VEC2", "place")
        between = gpu.types.GPUStageInterfaceInfo("r2sego_kept_picture")
        between.smooth("VEC2", "texel")
        info.vertex_out(between)
        info.fragment_out(0, "VEC4", "fragColour")
        info.vertex_source(_VERTEX)
        info.fragment_source(_FRAGMENT)
        _shaders.append(gpu.shader.create_from_info(info))
    return _shaders[0]
