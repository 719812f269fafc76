"""The asset's Gaussians in a 3D view, blended from far to near as they were trained.

They are painted into a picture of their own, in sRGB as the trainer blends them (projection as in
``splats/kernels/projection.py``), with the mean depth of what each pixel shows. The picture is laid into
the view at that depth, so that meshes stand before and behind the splats, and kept until the view
changes. Colours are those averaged over all directions.
"""

from typing import NamedTuple

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...r2sego_blender.bridge.asset.show_asset import DrawnSplats
from .clipping_region import kept

NEAREST_M = 0.2
"""Splats nearer than this are not drawn, as in the trainer."""

_PICTURES = 4
"""So many views' pictures stay on the graphics card: a quad view's."""

_ORDERS = 1 << 16
"""Depths that are told apart in a view."""

_TILE_PX = 32
"""Without a graphics card a picture is laid in tiles of so many pixels a side, the empty ones left out."""

_VERTEX = """
void main()
{
  vec4 toX = vec4(clipFromObject[0][0], clipFromObject[1][0], clipFromObject[2][0], clipFromObject[3][0]);
  vec4 toY = vec4(clipFromObject[0][1], clipFromObject[1][1], clipFromObject[2][1], clipFromObject[3][1]);
  vec3 toW = vec3(clipFromObject[0][3], clipFromObject[1][3], clipFromObject[2][3]);
  vec4 clip = clipFromObject * vec4(pos, 1.0);
  splatColour = color;
  splatAt = vec2(0.0);
  splatNearness = 0.0;
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);  // outside
  if (clip.w < nearest || color.a * 255.0 <= 1.0) {
    return;
  }
  vec3 centre = clip.xyz / clip.w;

  // How the place in pixels changes with that in the object; beside the view held, as 3DGS does.
  vec2 held = clamp(centre.xy, -1.3, 1.3);
  vec3 acrossX = (toX.xyz - held.x * toW) * (0.5 * viewSize.x / clip.w);
  vec3 acrossY = (toY.xyz - held.y * toW) * (0.5 * viewSize.y / clip.w);

  // The covariance in pixels, a little wider, and its axes.
  vec3 rowX = covarianceFirst;
  vec3 rowY = vec3(rowX.y, covarianceSecond.x, covarianceSecond.y);
  mat3 covariance = mat3(rowX, rowY, vec3(rowX.z, rowY.z, covarianceSecond.z));
  vec3 alongX = covariance * acrossX;
  float a = dot(acrossX, alongX) + 0.3;
  float b = dot(acrossY, alongX);
  float c = dot(acrossY, covariance * acrossY) + 0.3;
  float middle = 0.5 * (a + c);
  float apart = sqrt(max(0.25 * (a - c) * (a - c) + b * b, 0.0));
  vec2 longer = a >= c ? vec2(1.0, 0.0) : vec2(0.0, 1.0);
  if (abs(b) > 1e-6) {
    longer = normalize(vec2(b, middle + apart - a));
  }
  vec2 shorter = vec2(-longer.y, longer.x);

  // This corner, in standard deviations, so far out that alpha falls to 1/255.
  float reach = sqrt(2.0 * log(255.0 * color.a));
  int corner = gl_VertexID & 3;
  splatAt = reach * vec2((corner & 1) == 0 ? -1.0 : 1.0, (corner & 2) == 0 ? -1.0 : 1.0);
  vec2 deviations = sqrt(vec2(middle + apart, max(middle - apart, 0.0)));
  vec2 offset = splatAt.x * deviations.x * longer + splatAt.y * deviations.y * shorter;
  splatNearness = 0.5 - 0.5 * centre.z;
  gl_Position = vec4(centre.xy + 2.0 * offset / viewSize, centre.z, 1.0);
}
"""

_FRAGMENT = """
void main()
{
  float alpha = min(splatColour.a * exp(-0.5 * dot(splatAt, splatAt)), 0.99);
  if (alpha * 255.0 < 1.0) {
    discard;
  }
  colourSum = vec4(splatColour.rgb * alpha, alpha);
  nearnessSum = vec4(splatNearness * alpha, alpha, 0.0, alpha);
}
"""

_WHOLE_VERTEX = """
void main()
{
  gl_Position = vec4(pos, 0.0, 1.0);
}
"""

_DEVELOPING_FRAGMENT = """
void main()
{
  vec4 sum = texelFetch(colours, ivec2(gl_FragCoord.xy), 0);
  vec3 srgb = clamp(sum.rgb / max(sum.a, 1e-6), 0.0, 1.0);
  vec3 curved = pow((srgb + 0.055) / 1.055, vec3(2.4));
  vec3 linear = mix(curved, srgb / 12.92, vec3(lessThanEqual(srgb, vec3(0.04045))));
  fragColour = vec4(linear * sum.a, sum.a);
}
"""

_LAYING_FRAGMENT = """
void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy - viewOrigin);
  vec4 colour = texelFetch(colours, place, 0);
  if (colour.a * 255.0 < 1.0) {
    discard;
  }
  fragColour = colour * opacity;
  vec2 sum = texelFetch(nearnesses, place, 0).rg;
  gl_FragDepth = 1.0 - sum.r / sum.g;
}
"""


class _Shaders(NamedTuple):
    """What paints splats, makes linear light of what was painted, and lays it into a view."""

    paint: gpu.types.GPUShader
    develop: gpu.types.GPUShader
    lay: gpu.types.GPUShader


_shaders: list[_Shaders | None] = []


class Seen(NamedTuple):
    """What a view shows: ``clip_from_object`` (4, 4) is its perspective matrix times the object's.

    ``kept_sides`` are its Clipping Region's, of planes in the object.
    """

    clip_from_object: np.ndarray
    kept_sides: np.ndarray | None


def farthest_first(centres: np.ndarray, clip_from_object: np.ndarray) -> np.ndarray:
    """The order (M,) in which those of ``centres`` (N, 3) float32 that lie before the camera are drawn.

    ``clip_from_object`` (4, 4) is the view's perspective matrix times the object's. Depths that hardly
    differ count as equal; of those the first is drawn first.
    """
    parallel = _is_parallel(clip_from_object)
    row = clip_from_object[2 if parallel else 3].astype(np.float32)
    depth = centres @ row[:3] + row[3]
    seen = np.arange(len(depth)) if parallel else np.flatnonzero(depth >= NEAREST_M)
    if not len(seen):
        return seen
    depth = depth[seen] if parallel else np.log(depth[seen])
    lowest, highest = float(depth.min()), float(depth.max())
    scale = (_ORDERS - 1) / max(highest - lowest, 1e-6)
    keys = np.clip((highest - depth) * np.float32(scale), 0, _ORDERS - 1).astype(np.uint16)
    return seen[np.argsort(keys, kind="stable")]  # NumPy sorts 16 bits by digits: ten times as fast


def _is_parallel(clip_from_object: np.ndarray) -> bool:
    """Whether a view has no perspective."""
    return not np.any(clip_from_object[3, :3])


def _triangles(order: np.ndarray) -> np.ndarray:
    """(2 M, 3) uint32: of each splat's four corners two triangles."""
    corners = np.array([0, 1, 2, 2, 1, 3], np.uint32)
    return (4 * order.astype(np.uint32)[:, None] + corners).reshape(-1, 3)


def seen_tiles(alphas: np.ndarray, tile_px: int) -> np.ndarray:
    """(T, 4) the tiles of a picture in which something is seen: left, bottom, right and top, pixels.

    ``alphas`` is (H, W), the lowest row first; tiles begin at its lower left corner and end with it.
    """
    height, width = alphas.shape
    rows, columns = np.arange(0, height, tile_px), np.arange(0, width, tile_px)
    highest = np.maximum.reduceat(np.maximum.reduceat(alphas, rows, axis=0), columns, axis=1)
    row, column = np.nonzero(highest * 255.0 >= 1.0)  # as much as is laid
    left, bottom = columns[column], rows[row]
    right, top = np.minimum(left + tile_px, width), np.minimum(bottom + tile_px, height)
    return np.stack([left, bottom, right, top], axis=1)


class GaussianSplats:
    """Splats on the graphics card, and the pictures painted of them, one a view.

    ``colours`` (N, 4) are sRGB and opacity; of ``splats`` only the ``chosen`` (M,) are kept.
    """

    def __init__(self, splats: DrawnSplats, colours: np.ndarray, chosen: np.ndarray) -> None:
        self.count = len(chosen)
        self._centres = np.ascontiguousarray(splats.means[chosen])
        covariances = splats.covariances(chosen)
        columns = {
            "pos": self._centres,
            "color": colours[chosen],
            "covarianceFirst": covariances[:, :3],
            "covarianceSecond": covariances[:, 3:],
        }
        form = gpu.types.GPUVertFormat()
        for name, values in columns.items():
            form.attr_add(id=name, comp_type="F32", len=values.shape[1], fetch_mode="FLOAT")
        self._corners = gpu.types.GPUVertBuf(form, 4 * self.count)
        for name, values in columns.items():
            self._corners.attr_fill(name, np.ascontiguousarray(np.repeat(values, 4, axis=0), np.float32))
        self._pictures: dict[int, Picture] = {}

    def draw(self, view: int, seen: Seen, opacity: float, anew: bool) -> bool:
        """Draw them into the view being drawn, which ``view`` tells from others; False where they are not.

        A view that is not as its picture was painted is painted only if ``anew``.
        """
        shaders = _shaders_of_this_blender()
        if shaders is None:
            return False
        left, bottom, *size = gpu.state.viewport_get()
        size = tuple(size)
        picture = self._pictures.get(view)
        if picture is None or not picture.shows(seen, size):
            if not anew:
                return False
            picture = self._painted(view, seen, size, shaders)
        picture.lay((left, bottom), opacity, shaders)
        return True

    def _painted(self, view: int, seen: Seen, size: tuple[int, int], shaders: _Shaders) -> "Picture":
        """The view's picture, painted anew."""
        picture = self._pictures.pop(view, None)
        if picture is None or picture.size != size:
            picture = Picture(size)
        while len(self._pictures) >= _PICTURES:
            del self._pictures[next(iter(self._pictures))]
        self._pictures[view] = picture
        chosen = kept(self._centres, seen.kept_sides)
        triangles = _triangles(chosen[farthest_first(self._centres[chosen], seen.clip_from_object)])
        batch = None
        if len(triangles):
            indices = gpu.types.GPUIndexBuf(type="TRIS", seq=triangles)
            batch = gpu.types.GPUBatch(type="TRIS", buf=self._corners, elem=indices)
        picture.paint(batch, seen, shaders)
        return picture


class Picture:
    """What a view of ``size`` pixels shows of the splats, both times alpha, and with it.

    ``colours`` are in sRGB, as blended; laid is what they are in linear light, as the view wants it.
    ``nearnesses`` are 1 less the depth buffer's value: most of that lies so near to 1 that sums of it
    would be off by metres.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.size = size
        self.colours = gpu.types.GPUTexture(size, format="RGBA16F")
        self.nearnesses = gpu.types.GPUTexture(size, format="RG32F")
        self._painted = gpu.types.GPUFrameBuffer(color_slots=(self.colours, self.nearnesses))
        self._laid = gpu.types.GPUTexture(size, format="RGBA16F")
        self._developed = gpu.types.GPUFrameBuffer(color_slots=(self._laid,))
        self._where: gpu.types.GPUBatch | None = None
        self._seen: Seen | None = None

    def shows(self, seen: Seen, size: tuple[int, int]) -> bool:
        """Whether the picture is one of this view."""
        return self.size == size and self._seen is not None and all(map(np.array_equal, self._seen, seen))

    def paint(self, batch: gpu.types.GPUBatch | None, seen: Seen, shaders: _Shaders) -> None:
        """Blend the splats of ``batch`` in its order."""
        shader, clip_from_object = shaders.paint, seen.clip_from_object
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(False)
        with self._painted.bind():
            self._painted.clear(color=(0.0, 0.0, 0.0, 0.0))
            if batch is not None:
                gpu.state.blend_set("ALPHA_PREMULT")
                shader.bind()
                shader.uniform_float("clipFromObject", clip_from_object.T.ravel().tolist())
                shader.uniform_float("viewSize", self.size)
                shader.uniform_float("nearest", 0.0 if _is_parallel(clip_from_object) else NEAREST_M)
                batch.draw(shader)
                gpu.state.blend_set("NONE")
        with self._developed.bind():
            shaders.develop.bind()
            shaders.develop.uniform_sampler("colours", self.colours)
            _whole(shaders.develop).draw(shaders.develop)
        self._where = self._seen_part(shaders.lay)
        self._seen = seen

    def lay(self, origin: tuple[int, int], opacity: float, shaders: _Shaders) -> None:
        """Lay the picture over what is drawn from ``origin`` on, behind what is nearer."""
        if self._where is None:
            return
        shader = shaders.lay
        gpu.state.blend_set("ALPHA_PREMULT")
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        shader.bind()
        shader.uniform_float("viewOrigin", origin)
        shader.uniform_float("opacity", opacity)
        shader.uniform_sampler("colours", self._laid)
        shader.uniform_sampler("nearnesses", self.nearnesses)
        self._where.draw(shader)
        gpu.state.depth_mask_set(False)
        gpu.state.depth_test_set("NONE")
        gpu.state.blend_set("NONE")

    def _seen_part(self, shader: gpu.types.GPUShader) -> gpu.types.GPUBatch | None:
        """Where the picture is laid, None for nowhere; everywhere by a graphics card, which would have to
        wait for the answer."""
        if gpu.platform.device_type_get() != "SOFTWARE":
            return _whole(shader)
        width, height = self.size
        pixels = self._laid.read()
        pixels.dimensions = 4 * width * height  # in more than one, Blender 4.3 tells wrong strides
        alphas = np.asarray(pixels).reshape(height, width, 4)[..., 3]
        tiles = seen_tiles(alphas, _TILE_PX) / (0.5 * np.array([width, height, width, height])) - 1.0
        if not len(tiles):
            return None
        corners = tiles[:, [0, 1, 2, 1, 0, 3, 0, 3, 2, 1, 2, 3]].reshape(-1, 2)  # two triangles each
        return batch_for_shader(shader, "TRIS", {"pos": corners.astype(np.float32)})


def _whole(shader: gpu.types.GPUShader) -> gpu.types.GPUBatch:
    """All of what is drawn into."""
    corners = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))
    return batch_for_shader(shader, "TRI_STRIP", {"pos": corners})


def forget_shaders() -> None:
    """Let go of what is on the graphics card."""
    _shaders.clear()


def _shaders_of_this_blender() -> _Shaders | None:
    """The shaders; None for a Blender that refuses one."""
    if not _shaders:
        try:
            _shaders.append(_Shaders(_painting_shader(), _developing_shader(), _laying_shader()))
        except Exception as error:  # what a driver refuses differs; an overlay must not raise
            print(f"R2S-EGO: splats are drawn as discs: {error}")
            _shaders.append(None)
    return _shaders[0]


def _painting_shader():
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "clipFromObject")
    info.push_constant("VEC2", "viewSize")
    info.push_constant("FLOAT", "nearest")
    inputs = (("VEC3", "pos"), ("VEC4", "color"), ("VEC3", "covarianceFirst"), ("VEC3", "covarianceSecond"))
    for place, (kind, name) in enumerate(inputs):
        info.vertex_in(place, kind, name)
    between = gpu.types.GPUStageInterfaceInfo("r2sego_gaussian")
    between.flat("VEC4", "splatColour")
    between.flat("FLOAT", "splatNearness")
    between.smooth("VEC2", "splatAt")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "colourSum")
    info.fragment_out(1, "VEC4", "nearnessSum")
    info.vertex_source(_VERTEX)
    info.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(info)


def _developing_shader():
    info = _whole_shader_info("colours")
    info.fragment_source(_DEVELOPING_FRAGMENT)
    return gpu.shader.create_from_info(info)


def _laying_shader():
    info = _whole_shader_info("colours", "nearnesses")
    info.push_constant("VEC2", "viewOrigin")
    info.push_constant("FLOAT", "opacity")
    if hasattr(info, "depth_write"):  # OpenGL, all that Blender 4.3 has but for Apple's, needs no word of it
        info.depth_write("ANY")
    info.fragment_source(_LAYING_FRAGMENT)
    return gpu.shader.create_from_info(info)


def _whole_shader_info(*textures: str) -> "gpu.types.GPUShaderCreateInfo":
    """A shader's that reads ``textures`` for each pixel of what is drawn into, but for its fragments."""
    info = gpu.types.GPUShaderCreateInfo()
    for place, name in enumerate(textures):
        info.sampler(place, "FLOAT_2D", name)
    info.vertex_in(0, "VEC2", "pos")
    info.fragment_out(0, "VEC4", "fragColour")
    info.vertex_source(_WHOLE_VERTEX)
    return info
