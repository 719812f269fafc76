"""gsplat on CUDA (Ye et al. 2025): renders and differentiates on the GPU, where the Gaussians stay.

The image's planes come to the host, where the losses are, and their gradients go back: a few
megabytes a step. gsplat's conventions are ours but for limits that no picture shows: alpha is
held at 0.999 where our kernels hold it at 0.99. Sums are in the order of the GPU's threads, so that
a training is not the same to the bit each time.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import torch

from ...core.cameras import Camera
from ...core.errors import SettingsError
from ..kernels.adam import AdamState
from ..kernels.packing import HARMONICS, LOG_SCALE, LOGIT_OPACITY, MEAN, QUATERNION, PackedGaussians, pack, unpack
from ..kernels.projection import NEAREST_M
from ..kernels.projection_gradient import BETA_1, BETA_2, TINIEST_SQUARE
from ..kernels.tiles import DEPTH_PLANE, IMAGE_PLANES, TILE_PX, TRANSMITTANCE_PLANE
from ..rendering.rasterizer import Background
from ..vector_language.aligned_memory import aligned

BACKENDS = {"gsplat": "gsplat on CUDA"}
ORDER = 1

_CURE = (
    "Install R2S-EGO with its extra `cuda` on a machine with an NVIDIA GPU and nvcc, or set training.backend to cpu."
)


def cuda_rasterization() -> tuple[Callable[..., Any], torch.device]:
    """gsplat's ``rasterization`` and the device it works on.

    Raises SettingsError when gsplat, a GPU, or gsplat's kernels, which it builds at first use, are missing.
    """
    try:
        import gsplat

        if not torch.cuda.is_available():
            raise RuntimeError("torch finds no CUDA device")
        from gsplat.cuda import _backend  # compiles its kernels where that was not done yet

        if _backend._C is None:
            raise RuntimeError("it has no kernels, and there is no nvcc to compile them")
    except (ImportError, OSError, RuntimeError) as error:
        raise SettingsError(f"gsplat cannot run: {error}", where="training.backend", cure=_CURE) from error
    return gsplat.rasterization, torch.device("cuda")


def require() -> None:
    """Raises SettingsError where gsplat cannot run."""
    cuda_rasterization()


def make(gaussians: PackedGaussians, state: AdamState) -> GsplatBackend:
    """The engine on this machine's GPU. Raises SettingsError where it cannot run."""
    return GsplatBackend(gaussians, state, *cuda_rasterization())


class GsplatBackend:
    """See ``SplatBackend``. Gaussians are rows (N, C) on the device, in the order of packed places.

    ``rasterization`` has the signature and conventions of gsplat's.
    """

    _rows: torch.Tensor
    _first: torch.Tensor
    _second: torch.Tensor

    def __init__(
        self, gaussians: PackedGaussians, state: AdamState, rasterization: Callable[..., Any], device: torch.device
    ) -> None:
        self._packed, self._state = gaussians, state
        self._rasterization, self._device = rasterization, device
        self._shape = (0, 0)
        self._identity = self._tensor([1.0, 0.0, 0.0, 0.0])
        self._kept: torch.Tensor | None = None
        self._load()

    def __len__(self) -> int:
        return len(self._packed)

    def forward(
        self, camera: Camera, background: Background, degree: int, with_depth: bool, dilation_px2: float
    ) -> None:
        self._reserve(camera.shape)
        rows = self._rows.requires_grad_()
        quaternions = rows[:, QUATERNION:LOGIT_OPACITY]
        quaternions = torch.where(quaternions.any(dim=1, keepdim=True), quaternions, self._identity)
        opacities = torch.sigmoid(rows[:, LOGIT_OPACITY])
        if self._kept is not None:
            opacities = opacities * self._kept
        self._view = self._tensor(camera.camera_from_world).requires_grad_()
        intrinsics = [[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]]
        colours, alphas, self._meta = self._rasterization(
            rows[:, MEAN:LOG_SCALE],
            quaternions,
            rows[:, LOG_SCALE:QUATERNION].exp(),
            opacities,
            rows[:, HARMONICS:].unflatten(1, (-1, 3)),
            self._view[None],
            self._tensor(intrinsics)[None],
            camera.width,
            camera.height,
            near_plane=NEAREST_M,
            eps2d=dilation_px2,
            sh_degree=min(degree, round(self._packed.coefficients**0.5) - 1),
            packed=False,
            render_mode="RGB+D" if with_depth else "RGB",
        )
        self._meta["means2d"].retain_grad()
        transmittance = 1.0 - alphas[0, ..., 0]
        colour = colours[0, ..., :3] + transmittance[..., None] * self._behind(background, camera.shape)
        depth_sum = colours[0, ..., 3:].unbind(-1)
        self._camera, self._output = camera, [*colour.unbind(-1), alphas[0, ..., 0], *depth_sum]
        inside = self._planes[:, : camera.height, : camera.width]
        shown = torch.stack([*self._output[:3], transmittance, *depth_sum]).detach()
        inside[: len(shown)] = shown.cpu().numpy()

    @property
    def planes(self) -> np.ndarray:
        return self._planes

    @property
    def gradient_planes(self) -> np.ndarray:
        return self._gradients

    def step(
        self,
        rates: np.ndarray,
        opacity_regularization: float,
        scale_regularization: float,
        with_alpha: bool,
        with_depth: bool,
    ) -> None:
        used = [0, 1, 2, *([TRANSMITTANCE_PLANE] * with_alpha), *([DEPTH_PLANE] * with_depth)]
        upstream = self._tensor(self._gradients[used, : self._camera.height, : self._camera.width])
        torch.autograd.backward([self._output[plane] for plane in used], list(upstream))
        rows, gradient = self._rows.detach(), self._rows.grad
        assert gradient is not None
        blended = (gradient != 0.0).any(dim=1, keepdim=True)
        opacity, scales = torch.sigmoid(rows[:, LOGIT_OPACITY]), rows[:, LOG_SCALE:QUATERNION].exp()
        gradient[:, LOGIT_OPACITY] += opacity_regularization * opacity * (1.0 - opacity)
        gradient[:, LOG_SCALE:QUATERNION] += scale_regularization * scales
        half_image = self._tensor([0.5 * self._camera.width, 0.5 * self._camera.height])
        shift = (self._meta["means2d"].grad[0] * half_image).norm(dim=1)
        self._statistics += blended * torch.stack([shift, torch.ones_like(shift)], dim=1)
        self._rows = self._adam(rows, gradient, blended, self._tensor(rates))

    def _adam(
        self, rows: torch.Tensor, gradient: torch.Tensor, blended: torch.Tensor, rates: torch.Tensor
    ) -> torch.Tensor:
        """The rows after a step of those ``blended`` (N, 1); each counts its own steps."""
        self._steps += blended
        steps = self._steps.clamp(min=1.0)
        correction = (1.0 - BETA_2**steps).sqrt() / (1.0 - BETA_1**steps)
        first = self._first * BETA_1 + gradient * (1.0 - BETA_1)
        second = self._second * BETA_2 + gradient.square() * (1.0 - BETA_2)
        moved = rows - rates * correction * first / (second + TINIEST_SQUARE).sqrt()
        self._first = torch.where(blended, first, self._first)
        self._second = torch.where(blended, second, self._second)
        return torch.where(blended, moved, rows)

    def pose_gradient(self) -> np.ndarray:
        assert self._view.grad is not None
        gradient, view = (x.cpu().numpy()[:3].astype(np.float64) for x in (self._view.grad, self._view.detach()))
        turn = gradient @ view.T  # of exp(w, 0) camera_from_world = (1 + [w]) camera_from_world
        return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1], *gradient[:, 3]])

    @contextlib.contextmanager
    def leaving_out(self, left_out: np.ndarray | None) -> Iterator[None]:
        if left_out is not None:
            self._kept = self._tensor(~left_out.reshape(-1)[: len(self._packed)])
        try:
            yield
        finally:
            self._kept = None

    def bound_log_scales(self, largest: float) -> None:
        self._rows.detach()[:, LOG_SCALE:QUATERNION].clamp_(max=largest)

    @property
    def gaussians(self) -> PackedGaussians:
        self._fetch(self._packed.chunks, self._rows)
        self._packed.hide_rest()
        return self._packed

    @contextlib.contextmanager
    def lent(self) -> Iterator[None]:
        _ = self.gaussians
        for chunks, rows in self._remembered():
            self._fetch(chunks, rows)
        yield
        self._load()

    def _remembered(self) -> list[tuple[np.ndarray, torch.Tensor]]:
        """Adam's state in the host's chunks, and on the device."""
        state = self._state
        return [
            (state.first, self._first),
            (state.second, self._second),
            (state.statistics, self._statistics),
            (state.steps[:, None], self._steps),
        ]

    def _load(self) -> None:
        state = self._state
        self._rows = self._unpacked(self._packed.chunks)
        self._first, self._second = self._unpacked(state.first), self._unpacked(state.second)
        self._statistics, self._steps = self._unpacked(state.statistics), self._unpacked(state.steps[:, None])

    def _unpacked(self, chunks: np.ndarray) -> torch.Tensor:
        return self._tensor(unpack(chunks, len(self._packed)))

    def _fetch(self, chunks: np.ndarray, rows: torch.Tensor) -> None:
        """Write the device's rows (N, C) into the host's chunks."""
        packed = pack(rows.detach().cpu().numpy())
        chunks[: len(packed)] = packed

    def _behind(self, background: Background, shape: tuple[int, int]) -> torch.Tensor:
        """The background as (3,), or (H, W, 3)."""
        image = np.asarray(background, np.float32)
        if image.ndim == 3 and image.shape != (*shape, 3):
            image = image[:, : shape[0], : shape[1]].transpose(1, 2, 0)  # planes of whole tiles
        return self._tensor(image)

    def _reserve(self, shape: tuple[int, int]) -> None:
        if shape != self._shape:
            self._shape = shape
            height, width = (-(-side // TILE_PX) * TILE_PX for side in shape)
            self._planes, self._gradients = (aligned((IMAGE_PLANES, height, width)) for _ in range(2))

    def _tensor(self, values: Any) -> torch.Tensor:
        return torch.tensor(np.ascontiguousarray(values, np.float32), device=self._device)
