"""A texture in a rectangle of a region's pixels, as it is: blended as the state says."""

import gpu
from gpu_extras.batch import batch_for_shader

_VERTEX = """
void main()
{
  place = texCoord;
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 0.0, 1.0);
}
"""

_FRAGMENT = """
void main()
{
  fragColour = texture(picture, place);
}
"""

_shaders: list[gpu.types.GPUShader] = []


def draw_texture(
    texture: gpu.types.GPUTexture,
    rectangle: tuple[float, float, float, float],
    shares: tuple[float, float] = (0.0, 1.0),
) -> None:
    """Draw it in a ``rectangle``: left, bottom, width and height, pixels from the region's lower left corner.

    Of its width only the part between two ``shares`` is drawn.
    """
    (left, bottom, width, height), (begin, end) = rectangle, shares
    x0, x1, top = left + begin * width, left + end * width, bottom + height
    corners = ((x0, bottom), (x1, bottom), (x0, top), (x1, top))
    places = ((begin, 0.0), (end, 0.0), (begin, 1.0), (end, 1.0))
    shader = _shader()
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners, "texCoord": places})
    shader.bind()
    seen = gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix()
    shader.uniform_float("ModelViewProjectionMatrix", seen)
    shader.uniform_sampler("picture", texture)
    batch.draw(shader)


def forget_shader() -> None:
    """Let go of what is on the graphics card."""
    _shaders.clear()


def _shader() -> gpu.types.GPUShader:
    """Draws a texture as it is; Blender's own for images differ from version to version."""
    if not _shaders:
        info = gpu.types.GPUShaderCreateInfo()
        info.push_constant("MAT4", "ModelViewProjectionMatrix")
        info.sampler(0, "FLOAT_2D", "picture")
        info.vertex_in(0, "VEC2", "pos")
        info.vertex_in(1, "VEC2", "texCoord")
        between = gpu.types.GPUStageInterfaceInfo("r2sego_texture")
        between.smooth("VEC2", "place")
        info.vertex_out(between)
        info.fragment_out(0, "VEC4", "fragColour")
        info.vertex_source(_VERTEX)
        info.fragment_source(_FRAGMENT)
        _shaders.append(gpu.shader.create_from_info(info))
    return _shaders[0]
