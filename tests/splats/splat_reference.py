"""A plain float64 torch rasteriser: the formulas of 3DGS, pixel by Gaussian, no tiles."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import torch
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.splats.asset import SplatAsset

torch.set_num_threads(1)  # the tensors are small: threads would only wait for each other


def harmonics(d: torch.Tensor, degree: int) -> torch.Tensor:
    """(N, K) basis from the textbook's associated Legendre forms, signs as in 3DGS."""
    x, y, z = d.unbind(-1)
    pi = math.pi
    rows = [torch.full_like(x, 0.5 * math.sqrt(1 / pi))]
    if degree > 0:
        c = math.sqrt(3 / (4 * pi))
        rows += [-c * y, c * z, -c * x]
    if degree > 1:
        c = 0.5 * math.sqrt(15 / pi)
        rows += [c * x * y, -c * y * z, 0.25 * math.sqrt(5 / pi) * (3 * z * z - (x * x + y * y + z * z))]
        rows += [-c * x * z, 0.5 * c * (x * x - y * y)]
    if degree > 2:
        r2 = x * x + y * y + z * z
        rows += [
            -0.25 * math.sqrt(35 / (2 * pi)) * y * (3 * x * x - y * y),
            0.5 * math.sqrt(105 / pi) * x * y * z,
            -0.25 * math.sqrt(21 / (2 * pi)) * y * (5 * z * z - r2),
            0.25 * math.sqrt(7 / pi) * z * (5 * z * z - 3 * r2),
            -0.25 * math.sqrt(21 / (2 * pi)) * x * (5 * z * z - r2),
            0.25 * math.sqrt(105 / pi) * z * (x * x - y * y),
            -0.25 * math.sqrt(35 / (2 * pi)) * x * (x * x - 3 * y * y),
        ]
    return torch.stack(rows, -1)


def rotations(q: torch.Tensor) -> torch.Tensor:
    """(N, 3, 3) of quaternions wxyz of any length."""
    w, x, y, z = (q / q.norm(dim=-1, keepdim=True)).unbind(-1)
    return torch.stack(
        [
            1 - 2 * (y * y + z * z),
            2 * (x * y - w * z),
            2 * (x * z + w * y),
            2 * (x * y + w * z),
            1 - 2 * (x * x + z * z),
            2 * (y * z - w * x),
            2 * (x * z - w * y),
            2 * (y * z + w * x),
            1 - 2 * (x * x + y * y),
        ],
        -1,
    ).reshape(-1, 3, 3)


def on_screen(
    means, log_scales, quaternions, logit_opacities, sh, camera: Camera, camera_from_world=None, dilation_px2=0.3
) -> SimpleNamespace:
    """The Gaussians ahead of the camera by depth: their ``number``, ``centre`` and the rest.

    ``camera_from_world`` (4, 4), a tensor, stands in for the camera's own.
    """
    transform = torch.tensor(camera.camera_from_world) if camera_from_world is None else camera_from_world
    p = means @ transform[:3, :3].T + transform[:3, 3]
    keep = p[:, 2] > 0.2
    p, number = p[keep], torch.nonzero(keep)[:, 0]
    nearest = torch.argsort(p[:, 2], stable=True)
    p, number = p[nearest], number[nearest]
    x, y, z = p.unbind(-1)
    margin_x, margin_y = 0.15 * camera.width / camera.fx, 0.15 * camera.height / camera.fy
    held_x = (x / z).clamp(-camera.cx / camera.fx - margin_x, (camera.width - camera.cx) / camera.fx + margin_x)
    held_y = (y / z).clamp(-camera.cy / camera.fy - margin_y, (camera.height - camera.cy) / camera.fy + margin_y)
    zero = torch.zeros_like(z)
    jacobian = torch.stack(
        [
            torch.stack([camera.fx / z, zero, -camera.fx * held_x / z], -1),
            torch.stack([zero, camera.fy / z, -camera.fy * held_y / z], -1),
        ],
        1,
    )
    axes = rotations(quaternions[number]) * log_scales[number].exp()[:, None, :]
    screen_axes = jacobian @ transform[:3, :3] @ axes
    covariance = screen_axes @ screen_axes.transpose(1, 2) + dilation_px2 * torch.eye(2, dtype=torch.float64)
    direction = means[number] + transform[:3, :3].T @ transform[:3, 3]
    direction = direction / direction.norm(dim=-1, keepdim=True)
    colour = torch.einsum("nk,nkc->nc", harmonics(direction, round(sh.shape[1] ** 0.5) - 1), sh[number]) + 0.5
    return SimpleNamespace(
        number=number,
        centre=torch.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], -1),
        covariance=covariance,
        depth=z,
        colour=colour.clamp(min=0.0),
        opacity=torch.sigmoid(logit_opacities[number]),
    )


def alphas(screen: SimpleNamespace, camera: Camera) -> torch.Tensor:
    """(n, H, W): each Gaussian's alpha at each pixel, neither held at 0.99 nor cut at 1/255."""
    v, u = torch.meshgrid(
        torch.arange(camera.height, dtype=torch.float64) + 0.5,
        torch.arange(camera.width, dtype=torch.float64) + 0.5,
        indexing="ij",
    )
    conic = torch.linalg.inv(screen.covariance)[:, :, :, None, None]
    dx, dy = (axis - screen.centre[:, k, None, None] for k, axis in enumerate((u, v)))
    power = -0.5 * (conic[:, 0, 0] * dx * dx + conic[:, 1, 1] * dy * dy) - conic[:, 0, 1] * dx * dy
    return screen.opacity[:, None, None] * power.exp()


def weights(screen: SimpleNamespace, camera: Camera) -> tuple[torch.Tensor, torch.Tensor]:
    """(n, H, W): what each Gaussian adds to each pixel; and the transmittance left (H, W)."""
    transmittance, rows = torch.ones(camera.shape, dtype=torch.float64), []
    for alpha in alphas(screen, camera).clamp(max=0.99):
        counts = (alpha >= 1 / 255) & (transmittance > 1e-4)
        alpha = torch.where(counts, alpha, torch.zeros_like(alpha))
        rows.append(alpha * transmittance)
        transmittance = transmittance * (1 - alpha)
    none = torch.zeros((0, *camera.shape), dtype=torch.float64)
    return torch.cat([none, *(row[None] for row in rows)]), transmittance


def rasterize(
    means,
    log_scales,
    quaternions,
    logit_opacities,
    sh,
    camera: Camera,
    background=(0.0, 0.0, 0.0),
    camera_from_world=None,
    dilation_px2=0.3,
):
    """(colour (H, W, 3), alpha (H, W), depth sum (H, W)), differentiable, float64."""
    screen = on_screen(means, log_scales, quaternions, logit_opacities, sh, camera, camera_from_world, dilation_px2)
    weight, transmittance = weights(screen, camera)
    image = torch.einsum("nhw,nc->hwc", weight, screen.colour)
    image = image + transmittance[..., None] * torch.tensor(background, dtype=torch.float64)
    return image, 1 - transmittance, torch.einsum("nhw,n->hw", weight, screen.depth)


def twisted(camera: Camera, twist: torch.Tensor) -> torch.Tensor:
    """exp(w, t) camera_from_world for a twist (6,) of rotation w and translation t."""
    x, y, z, *shift = twist.unbind()
    zero = torch.zeros_like(x)
    rows = [[zero, -z, y, shift[0]], [z, zero, -x, shift[1]], [-y, x, zero, shift[2]], [zero] * 4]
    generator = torch.stack([torch.stack(row) for row in rows])
    return torch.linalg.matrix_exp(generator) @ torch.tensor(camera.camera_from_world)


def random_asset(rng: np.random.Generator, count: int = 60, degree: int = 3) -> SplatAsset:
    """Gaussians of all sizes and shapes in front of, beside and behind ``small_camera``."""
    return SplatAsset(
        means=rng.uniform([-2.0, -1.5, -0.5], [2.0, 1.5, 4.0], (count, 3)),
        log_scales=rng.uniform(-4.0, -0.7, (count, 3)),
        quaternions=rng.normal(size=(count, 4)) * rng.uniform(0.5, 3.0, (count, 1)),
        logit_opacities=rng.uniform(-3.0, 6.0, count),
        sh=rng.normal(scale=0.4, size=(count, (degree + 1) ** 2, 3)),
    )


def small_camera(width: int = 45, height: int = 35) -> Camera:
    """A camera at the origin looking along z, turned a little; the size fits no tile."""
    pose = look_at(np.array([0.05, -0.1, -0.3]), np.array([0.1, 0.05, 2.0]), up=(0.0, -1.0, 0.1))
    return Camera(width, height, 0.8 * width, 0.9 * width, 0.48 * width, 0.53 * height, pose)


def parameters(asset: SplatAsset) -> list[torch.Tensor]:
    """The five groups as float64 leaves that want gradients."""
    groups = (asset.means, asset.log_scales, asset.quaternions, asset.logit_opacities, asset.sh)
    return [torch.tensor(group, dtype=torch.float64, requires_grad=True) for group in groups]


def frozen(asset: SplatAsset) -> list[torch.Tensor]:
    """The five groups as float64 tensors without gradients."""
    return [leaf.detach() for leaf in parameters(asset)]


@st.composite
def cameras(draw: st.DrawFn, largest_px: int = 70) -> Camera:
    """Portrait and landscape, unequal focal lengths, the principal point anywhere near."""
    width, height = draw(st.integers(1, largest_px)), draw(st.integers(1, largest_px))
    fx, fy = (draw(st.floats(0.4, 3.0)) * max(width, height) for _ in range(2))
    cx, cy = (draw(st.floats(-0.3, 1.3)) * side for side in (width, height))
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([draw(st.floats(-3.0, 3.0)) for _ in range(3)]).as_matrix()
    pose[:3, 3] = [draw(st.floats(-3.0, 3.0)) for _ in range(3)]
    return Camera(width, height, fx, fy, cx, cy, pose)


_KINDS = {  # ranges of the logarithms of the three scales
    "mixed": ((-4.0, -0.7),) * 3,
    "tiny": ((-12.0, -6.0),) * 3,
    "huge": ((0.0, 4.0),) * 3,
    "thin": ((-1.0, 2.0), (-9.0, -5.0), (-9.0, -5.0)),
    "flat": ((-2.0, 0.5), (-2.0, 0.5), (-12.0, -7.0)),
}


@st.composite
def scenes(
    draw: st.DrawFn, most: int = 40, largest_px: int = 70, kinds: tuple[str, ...] = tuple(_KINDS)
) -> tuple[SplatAsset, Camera]:
    """A camera, and Gaussians of one of several kinds in front of, beside and behind it."""
    camera, rng = draw(cameras(largest_px)), np.random.default_rng(draw(st.integers(0, 10**6)))
    asset = random_asset(rng, draw(st.integers(0, most)), draw(st.integers(0, 3)))
    low, high = np.transpose(_KINDS[draw(st.sampled_from(kinds))])
    asset.log_scales[:] = rng.uniform(low, high, (len(asset), 3))
    pose = camera.world_from_camera
    asset.means[:] = asset.means @ pose[:3, :3].T + pose[:3, 3]
    return asset, camera
