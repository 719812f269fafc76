"""Every setting of the method (the paper's H) and of the embedded backends.

Each value and its one-line doc live here once: the command line, Blender's panels and
the presets derive from these frozen dataclasses. ``docs/settings.md`` is made from them.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..core.errors import SettingsError
from .fields import setting
from .slots import GENERATORS, REGISTRARS, RENDERERS, SURFACES
from .training_settings import TrainingSettings


@dataclass(frozen=True)
class CaptureSettings:
    """Import and registration of the photographs."""

    max_side_px: int = setting(640, "Photographs are scaled down to this longest side.", 64, 8192)
    matcher: str = setting(
        "xfeat",
        "How photographs are matched: with XFeat beside SIFT where SIFT finds little, or with SIFT alone.",
        choices=("xfeat", "sift"),
        added=True,
    )
    max_features: int = setting(8000, "SIFT features a photograph.", 500, 50000)
    min_matches: int = setting(15, "Matches two photographs need to count as overlapping.", 8, 1000)
    match_ratio: float = setting(0.75, "A match's distance over that of the second best.", 0.3, 0.99)
    max_error_px: float = setting(2.0, "Pixels a match may lie off its epipolar line.", 0.2, 20.0)
    solve_max_side_px: int = setting(1600, "Longest side at which photographs without poses are solved.", 200, 8192)
    max_keyframes: int = setting(
        40, "Photographs taken of a video, or of a scan or a folder that has more: sharp ones.", 3, 100000
    )
    floor_tolerance_m: float = setting(0.03, "Points this near belong to the floor.", 0.002, 0.5)
    refine_poses: str = setting(
        "auto",
        "Whether given poses are adjusted to the photographs: where that clearly makes them agree.",
        choices=("auto", "always", "never"),
    )
    correct_exposure: str = setting(
        "auto",
        "Whether captures are brought to one exposure and white balance: where those clearly differ.",
        choices=("auto", "never"),
        added=True,
    )
    pose_sigma_m: float = setting(0.01, "Standard deviation of given positions, each axis.", 0.0001, 1.0)
    pose_sigma_deg: float = setting(0.3, "Standard deviation of given rotations, each axis.", 0.001, 10.0)


@dataclass(frozen=True)
class StereoSettings:
    """Dense slanted-plane PatchMatch on the posed captures."""

    max_side_px: int = setting(640, "Depth maps have at most this longest side.", 64, 4096)
    sources: int = setting(5, "Other captures each capture is matched against.", 1, 16)
    levels: int = setting(3, "Image sizes estimated, each half the next, coarsest first.", 1, 5)
    iterations: int = setting(4, "Red-black sweeps of propagation and refinement a level.", 1, 20)
    geometric_rounds: int = setting(4, "Rounds a level that ask the captures' depths to agree.", 0, 8)
    geometric_sweeps: int = setting(2, "Red-black sweeps of each such round.", 1, 20)
    geometric_weight: float = setting(0.3, "Cost of a pixel of reprojection error in them.", 0.0, 2.0)
    patch_radius_px: int = setting(5, "Half width of the matching window.", 2, 15)
    patch_stride_px: int = setting(2, "Distance of the samples of the matching window.", 1, 4)
    consistency: float = setting(0.015, "Relative depth difference two captures may agree by.", 0.001, 0.2)
    max_cost: float = setting(0.5, "Matching cost (1 - NCC) above which a depth is dropped.", 0.05, 2.0)
    min_segment_share: float = setting(
        0.001, "Share of the image below which a patch of reliable depth is dropped.", 0.0, 0.1
    )
    point_spacing_m: float = setting(0.02, "Side of a voxel that keeps one observed point.", 0.002, 0.5)

    def __post_init__(self) -> None:
        if self.patch_stride_px > self.patch_radius_px:  # such a window may have no samples at all
            raise SettingsError(
                f"{self.patch_stride_px} is above stereo.patch_radius_px, {self.patch_radius_px}",
                where="setting stereo.patch_stride_px",
                cure="Lower it, or widen the window.",
            )


@dataclass(frozen=True)
class PriorSettings:
    """Shape priors of objects: retrieval from meshes and alignment."""

    candidates: int = setting(3, "Meshes of a library aligned in full for an object.", 1, 100)
    screening_margin: float = setting(
        0.15, "Energy in small images by which a mesh may be worse than the best and be aligned.", 0.0, 3.0
    )
    max_energy: float = setting(0.45, "Energy above which an aligned shape is rejected.", 0.0, 3.0)
    min_iou: float = setting(0.75, "Silhouette overlap below which an aligned shape is rejected.", 0.0, 1.0)
    min_points: int = setting(100, "Observed points an object needs before a shape is accepted.", 0, 100000)
    symmetry: str = setting(
        "never",
        "Whether an object that no mesh fits is completed by its own mirror symmetry.",
        choices=("never", "unmatched"),
    )
    max_mirror_energy: float = setting(0.4, "Energy above which a mirror plane of an object is rejected.", 0.0, 1.0)


@dataclass(frozen=True)
class ProxySettings:
    """Completion of room planes and fusion into the geometry proxy."""

    surface: str = setting(
        "tsdf",
        "What makes the surface of depth: fused distances, screened Poisson or, if installed, NKSR.",
        choices=tuple(SURFACES.labels),
    )
    planes: int = setting(14, "Planes looked for in the observed points.", 0, 64)
    plane_tolerance_m: float = setting(0.02, "Points this near support a plane.", 0.002, 0.2)
    plane_share: float = setting(0.005, "Share of the observed points a plane needs.", 0.0005, 0.5)
    envelope_share: float = setting(
        0.985, "Share of the observed points in front of a plane that bounds the room.", 0.5, 1.0
    )
    voxel_m: float = setting(0.025, "Side of a voxel of the fused distance field.", 0.005, 0.5)
    truncation_m: float = setting(0.06, "Distance at which the fused field is cut off.", 0.01, 1.0)
    min_component_m2: float = setting(0.02, "Loose surfaces smaller than this are dropped.", 0.0, 10.0)
    completed_weight: float = setting(0.1, "Weight of completed depth against observed 1.0.", 0.0, 1.0)
    asset_weight: float = setting(0.1, "Weight of the current asset's depth against observed 1.0.", 0.0, 1.0)
    layout: str = setting(
        "auto",
        "Whether the room's layout carries captures that nothing else tells the depth of: where they hardly overlap.",
        choices=("auto", "never"),
        added=True,
    )


@dataclass(frozen=True)
class CollisionSettings:
    """The collision surface made of the geometry proxy."""

    simplification_m: float = setting(0.04, "Vertices in a cell of this side are merged.", 0.005, 0.5)
    cell_m: float = setting(0.4, "Largest cell of the convex decomposition.", 0.05, 2.0)
    min_cell_m: float = setting(0.06, "Cells this small are cut no further.", 0.01, 1.0)
    tolerance_m: float = setting(0.02, "How far a convex piece may leave the surface.", 0.002, 0.2)
    carrying_tolerance_m: float = setting(
        0.01, "The same for its sides that face up, on which things come to rest.", 0.002, 0.2
    )
    thickness_m: float = setting(0.05, "Depth of a piece behind its surface.", 0.005, 0.5)
    floor_tolerance_m: float = setting(0.03, "Level surfaces this near z = 0 are the floor.", 0.0, 0.2)
    completed_floor_m: float = setting(
        0.08, "What was only completed, not observed, is the floor up to this height.", 0.0, 0.5
    )
    min_component_m: float = setting(0.15, "Loose pieces smaller than this are dropped.", 0.0, 2.0)
    decomposition: str = setting(
        "planes", "What cuts the surface into convex pieces: flat pieces, or CoACD.", choices=("planes", "coacd")
    )
    coacd_region_m: float = setting(1.0, "Side of the regions that CoACD gets one by one.", 0.2, 10.0)
    coacd_timeout_s: float = setting(
        120.0, "Time for a region; one that takes longer is cut into flat pieces.", 1.0, 3600.0
    )
    max_pieces: int = setting(2500, "Most convex pieces; the tolerance grows until they are few enough.", 10, 20000)


@dataclass(frozen=True)
class TextureSettings:
    """The textured mesh of the geometry proxy."""

    hole_m: float = setting(1.0, "Holes with a rim shorter than this are closed first.", 0.0, 100.0)
    faces: int = setting(30000, "Faces the proxy is decimated to.", 4, 1000000)
    size_px: int = setting(2048, "Side of the texture.", 64, 8192)
    unwrap_seconds: float = setting(
        120.0, "Time for xatlas; then fewer faces, and then boxes, are unwrapped.", 0.0, 3600.0
    )
    padding_px: int = setting(4, "Texels between charts.", 1, 32)
    best_captures: int = setting(3, "Captures blended at a texel.", 1, 16)
    depth_tolerance: float = setting(
        0.015, "Relative depth difference at which a capture still sees a texel.", 0.001, 0.2
    )
    edge_px: int = setting(
        2, "Background this near a capture's depth edge is not taken from it if another sees it.", 0, 16
    )
    border_px: float = setting(20.0, "Width over which a capture fades out at its border.", 0.0, 500.0)


@dataclass(frozen=True)
class RolloutSettings:
    """The robot proxy: simulated rollouts of the declared behaviour."""

    successes: int = setting(12, "Successful rollouts a round.", 1, 1000)
    max_attempts: int = setting(60, "Rollouts tried a round before giving up.", 1, 10000)
    processes: int = setting(
        0, "Processes that simulate, each an attempt; 0: one a core.", 0, 256, changes_result=False
    )
    step_s: float = setting(0.004, "Time step of the simulation.", 0.0005, 0.005)
    max_force_n: float = setting(
        120.0, "Bound of the helping force on the base, each axis, of a 35 kg robot.", 0.0, 5000.0
    )
    max_torque_nm: float = setting(
        60.0, "Bound of the helping torque on the base, each axis, of a 35 kg robot.", 0.0, 2000.0
    )


@dataclass(frozen=True)
class SelectionSettings:
    """Scoring and selection of target views (the paper's Eq. 2)."""

    target_views: int = setting(12, "Target views a round, the paper's K.", 1, 500)
    nms_window: int = setting(15, "Window of temporal suppression; a rollout's targets are more frames apart.", 1, 1000)
    alpha_threshold: float = setting(0.8, "A pixel whose asset alpha is lower is missing.", 0.0, 1.0)
    validity_threshold: float = setting(0.8, "A pixel whose proxy validity is at least this is available.", 0.0, 1.0)
    scoring_scale: float = setting(
        1.0, "Candidates are scored on a sample of the pixels, this share a side.", 0.05, 1.0
    )
    overlap_scale: float = setting(
        0.25, "Image scale at which a target's overlap with the captures is measured.", 0.05, 1.0
    )
    overlap_tolerance: float = setting(
        0.03, "Relative depth difference at which a capture still sees a proxy point.", 0.001, 0.2
    )
    candidates: str = setting(
        "rollouts",
        "Candidate views: of the robot's rollouts, or of cameras flying freely (ablation).",
        choices=("rollouts", "flight"),
    )
    ranking: str = setting(
        "marginal",
        "How targets are ranked: by what each adds to those before it, by their score alone, or at random (ablations).",
        choices=("marginal", "score", "random"),
    )
    geometry: str = setting(
        "proxy", "Geometry availability: the proxy's, or 1 everywhere (ablation).", choices=("proxy", "ignored")
    )


@dataclass(frozen=True)
class GenerationSettings:
    """Camera paths, structural conditions and the embedded generator."""

    clip_frames: int = setting(25, "Frames a clip, N_f; the last one is kept.", 2, 200)
    clip_scale: float = setting(
        0.5, "Image scale of the clip's frames before the last, for the embedded generator.", 0.1, 1.0
    )
    generator: str = setting(
        "blending",
        "Who makes the clips: the embedded blending, ViewCrafter, or the program in R2SEGO_GENERATOR.",
        choices=tuple(GENERATORS.labels),
    )
    renderer: str = setting(
        "z-buffer",
        "Who renders the structural conditions: the library itself, or an engine of Blender.",
        choices=tuple(RENDERERS.labels),
    )
    kept_conditions: str = setting("clip", "Structural conditions that stay in the bundle.", choices=("clip", "target"))
    max_replacements: int = setting(12, "Rejected frames a round replaced by the next-ranked candidates.", 0, 500)
    depth_tolerance: float = setting(
        0.02, "Relative depth difference at which a capture still sees a point.", 0.001, 0.2
    )
    best_captures: int = setting(5, "Captures blended at a pixel.", 1, 16)
    edge_erosion_px: int = setting(
        1, "Background this near a capture's depth edge is not taken from that capture.", 0, 16
    )
    border_px: float = setting(40.0, "Width over which a capture fades out at its border.", 0.0, 500.0)
    hole_confidence: float = setting(0.1, "Confidence of a pixel that no capture saw.", 0.0, 1.0)


@dataclass(frozen=True)
class RegistrationSettings:
    """Estimation of a generated frame's pose from patches of the captures found in it."""

    registrar: str = setting(
        "pnp",
        "Where a frame's patches are first looked for: about its query, or about the pose that VGGT estimates.",
        choices=tuple(REGISTRARS.labels),
        added=True,
    )
    max_captures: int = setting(6, "Captures a frame is compared with: its reference, then the best seen.", 1, 64)
    search_radius_px: float = setting(
        48.0, "How far from where the query would see it a patch of a capture is looked for.", 8.0, 500.0
    )
    min_correlation: float = setting(0.6, "Correlation below which a patch is not found.", 0.1, 0.99)
    match_ratio: float = setting(0.85, "Distance of a patch to the best place and to the second best one.", 0.1, 1.0)
    max_error_px: float = setting(4.0, "Reprojection error of an inlier.", 0.5, 20.0)
    focal_sigma: float = setting(
        0.005, "Relative standard deviation of a frame's focal length about the query's.", 1e-5, 1.0
    )
    min_inliers: int = setting(30, "Inliers below which a frame is rejected.", 6, 10000)
    min_agreement: float = setting(
        0.25, "Share of the patches to be seen that must be inliers; in wrong places 0.1 are.", 0.0, 1.0
    )
    min_spread: float = setting(0.25, "Share of the image's 4 x 3 cells that must hold inliers.", 0.0, 1.0)
    max_sigma_m: float = setting(
        0.03, "Standard deviation of the camera's centre beyond which a frame is rejected.", 0.0001, 5.0
    )
    max_sigma_deg: float = setting(
        1.0, "Standard deviation of its rotation beyond which a frame is rejected.", 0.001, 90.0
    )
    max_offset_m: float = setting(0.1, "Distance from the query pose beyond which a frame is rejected.", 0.001, 5.0)
    max_turn_deg: float = setting(4.0, "Rotation from the query pose beyond which a frame is rejected.", 0.1, 90.0)
    max_focal_error: float = setting(
        0.06, "Relative error of the estimated focal length beyond which a frame is rejected.", 0.001, 1.0
    )


@dataclass(frozen=True)
class Settings:
    """The fixed configuration H of a refinement; defaults are the paper's."""

    seed: int = setting(0, "Seed of everything random.", 0, 2**31 - 1)
    rounds: int = setting(3, "Refinement rounds, L.", 1, 100)
    captures: CaptureSettings = CaptureSettings()
    stereo: StereoSettings = StereoSettings()
    priors: PriorSettings = PriorSettings()
    proxy: ProxySettings = ProxySettings()
    collision: CollisionSettings = CollisionSettings()
    texture: TextureSettings = TextureSettings()
    rollouts: RolloutSettings = RolloutSettings()
    selection: SelectionSettings = SelectionSettings()
    generation: GenerationSettings = GenerationSettings()
    registration: RegistrationSettings = RegistrationSettings()
    training: TrainingSettings = TrainingSettings()
