"""The settings of training the splats, a section of ``settings.Settings``."""

from __future__ import annotations

from dataclasses import dataclass

from .fields import setting
from .slots import TRAINERS


@dataclass(frozen=True)
class TrainingSettings:
    """3D Gaussian splatting of the visual asset."""

    backend: str = setting(
        "cpu",
        "What renders and moves the Gaussians: the embedded CPU kernels, or gsplat on an NVIDIA GPU.",
        choices=tuple(TRAINERS.labels),
        added=True,
    )
    steps_per_round: int = setting(5000, "Optimisation steps a round.", 1, 200000)
    max_gaussians: int = setting(150000, "Hard budget of Gaussians, the backdrop not counted.", 1000, 5000000)
    real_weight: float = setting(1.0, "Weight of a registered capture.", 0.0, 10.0)
    synthetic_weight: float = setting(0.5, "Weight of a pseudo-observation.", 0.0, 10.0)
    ssim_weight: float = setting(0.2, "Share of 1 - SSIM in the loss, the rest is L1.", 0.0, 1.0)
    opaque_weight: float = setting(
        0.01, "Weight of 1 - alpha where a surface is known, against the image loss.", 0.0, 10.0
    )
    backdrop_gaussians: int = setting(
        12000, "Gaussians of the shell behind what no photograph shows; 0: none.", 0, 200000
    )
    every_third_pixel_share: float = setting(
        0.0, "Share of the steps, at the start, on every third pixel a side, others each time.", 0.0, 1.0
    )
    every_second_pixel_share: float = setting(
        0.0, "Share of the steps, after those, on every second pixel a side, others each time.", 0.0, 1.0
    )
    image_cache_mb: int = setting(
        1024, "Memory for prepared images, the rest is loaded anew.", 16, 65536, changes_result=False
    )
    captures_first_share: float = setting(0.25, "Share of a round's steps, at the start, on captures alone.", 0.0, 1.0)
    capture_oversampling: int = setting(3, "How often a capture is drawn for each pseudo-observation.", 1, 100)
    sh_degree: int = setting(1, "Highest degree of the spherical harmonics.", 0, 3)
    disc_stride_px: int = setting(
        2, "Pixels a side that share one Gaussian lifted from depth, where there is detail.", 1, 32
    )
    detailed_share: float = setting(
        0.4, "Share of a picture with most detail; elsewhere twice as many pixels a side share one.", 0.0, 1.0
    )
    first_gaussians: str = setting(
        "spheres",
        "First Gaussians at points: faint spheres as in 3DGS, or discs along the surface they show.",
        choices=("spheres", "discs"),
    )
    position_learning_rate: float = setting(
        1.6e-4, "Learning rate of the means at the start, times the scene's extent.", 0.0, 1.0, formerly="position_rate"
    )
    position_decay: float = setting(0.01, "Learning rate of the means at the end over that at the start.", 1e-6, 1.0)
    densification: str = setting(
        "none",
        "How Gaussians are added: the start is all, the worst of all views, dead ones moved, or as 3DGS did.",
        choices=("none", "growth", "relocation", "original"),
    )
    densify_every_steps: int = setting(100, "Steps between additions of Gaussians.", 10, 10000)
    densify_from_share: float = setting(0.03, "Share of the steps before the first addition.", 0.0, 1.0)
    densify_until_share: float = setting(0.5, "Share of the steps after which none is added.", 0.0, 1.0)
    split_scale: float = setting(
        0.01, "Size over the scene's extent above which a Gaussian is split, not copied.", 0.0, 1.0
    )
    gradient_threshold: float = setting(2e-4, "Mean screen-space gradient above which 3DGS adds a Gaussian.", 0.0, 1.0)
    dead_opacity: float = setting(0.005, "Gaussians fainter than this are removed or moved.", 0.0, 1.0)
    opacity_reset_steps: int = setting(
        3000, "Steps between the resets of opacity that 3DGS does while it adds.", 10, 1000000
    )
    opacity_regularization: float = setting(
        0.0, "Weight of the mean opacity in the loss: what is not needed fades.", 0.0, 1.0, formerly="opacity_pull"
    )
    scale_regularization: float = setting(
        0.0, "Weight of the mean scale (m) in the loss: nothing grows that need not.", 0.0, 1.0, formerly="scale_pull"
    )
    max_scale_m: float = setting(
        0.15, "Largest standard deviation of a Gaussian, in any direction; 0: no limit.", 0.0, 1000.0
    )
    dropout_share: float = setting(
        0.2, "Share of the Gaussians that each step leaves out, drawn anew; 0: none.", 0.0, 0.9
    )
    later_rounds_learning_rate_ratio: float = setting(
        0.3,
        "Learning rates in the second round over the first's, in the third over the second's.",
        0.0,
        1.0,
        formerly="later_rounds_rate",
    )
    depth_weight: float = setting(0.0, "Weight of relative depth errors against known depth.", 0.0, 10.0)
    normal_weight: float = setting(0.0, "Weight of the depth's slope errors against known normals.", 0.0, 10.0)
    exposure_learning_rate: float = setting(
        0.0,
        "Learning rate of a generated frame's brightness; 0: it is taken as it is.",
        0.0,
        1.0,
        formerly="exposure_rate",
    )
    pose_learning_rate: float = setting(
        0.0,
        "Learning rate of a generated frame's pose (rad, m); 0: it stays as registered.",
        0.0,
        1.0,
        formerly="pose_rate",
    )
    learning_rate_annealing: float = setting(
        1.0,
        "All learning rates start as many times higher, and end as many times lower.",
        1.0,
        10.0,
        formerly="rate_swing",
    )
    scale_learning_rate: float = setting(
        0.01, "Learning rate of the logarithms of the scales.", 0.0, 1.0, formerly="scale_rate"
    )
    rotation_learning_rate: float = setting(
        2e-3, "Learning rate of the quaternions.", 0.0, 1.0, formerly="rotation_rate"
    )
    opacity_learning_rate: float = setting(
        0.05, "Learning rate of the opacities' logits.", 0.0, 1.0, formerly="opacity_rate"
    )
    colour_learning_rate: float = setting(5e-3, "Learning rate of the colours.", 0.0, 1.0, formerly="colour_rate")
    harmonics_learning_rate_ratio: float = setting(
        0.05,
        "Learning rate of the higher harmonics over that of the colours.",
        0.0,
        1.0,
        formerly="harmonics_rate_ratio",
    )
