"""What there is to know of every learned backend before it runs: its licences, what it takes, where it is looked for.

The one table of them. Standard library alone.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..core.errors import MachineError
from ..core.user_configuration import configuration_folder
from .environment import python_of

_MAPANYTHING = "git+https://github.com/facebookresearch/map-anything@f7ebafb4d8349776705aaa686cf928988d1bd7f4"
_DEPTH_ANYTHING_3 = (
    "depth-anything-3 @ git+https://github.com/ByteDance-Seed/Depth-Anything-3@2c21ea849ceec7b469a3e62ea0c0e270afc3281a"
)
_TORCH = ("torch==2.7.1", "torchvision==0.22.1")


@dataclass(frozen=True)
class Recipe:
    """How an environment of its own is made.

    ``packages``: what pip is given, each of one version or commit, torch first and apart. ``clone``: a
    repository that is no package and its commit, with the folders of it that modules are found in.
    """

    packages: tuple[str, ...]
    torch: tuple[str, ...] = _TORCH
    clone: tuple[str, str] | None = None
    paths: tuple[str, ...] = ()


@dataclass(frozen=True)
class LearnedBackend:
    """A model behind an adapter.

    ``variable`` names the interpreter of its environment; ``needs`` what else of the environment has to be there,
    variables that name files or folders. ``modules``: any of them says it is installed. ``worker``: the module
    of ``workers.models`` that runs in it. ``download`` of the weights, ``memory`` and ``seconds`` a photograph are what
    ``source`` says, "" where nobody does; none of them was measured here.
    """

    name: str
    label: str
    slot: str
    variable: str
    modules: tuple[str, ...]
    code_licence: str
    weights_licence: str
    needs_gpu: bool = False
    download: str = ""
    memory: str = ""
    seconds: str = ""
    source: str = ""
    needs: tuple[str, ...] = ()
    worker: str = ""
    recipe: Recipe | None = None

    @property
    def folder(self) -> Path:
        """Where ``r2sego backend install`` makes its environment. Raises MachineError without a home."""
        return (
            configuration_folder() / "backends" / self.variable.removeprefix("R2SEGO_").removesuffix("_PYTHON").lower()
        )

    def interpreter(self) -> str:
        """The Python that its variable names, else that of ``folder``.

        Raises MachineError where there is neither.
        """
        named = os.environ.get(self.variable, "")
        if named and not Path(named).is_file():
            raise MachineError(f"{self.variable} names no file", where=named, cure=self.cure)
        python = Path(named) if named else python_of(self.folder)
        if not python.is_file():
            raise MachineError(f"{self.label} is not set up on this machine", where=self.variable, cure=self.cure)
        return str(python)

    @property
    def cure(self) -> str:
        """What helps where it is not there."""
        how = (
            f"`r2sego backend install {self.name}` says how, or set" if self.recipe else "See docs/backends.md, and set"
        )
        return f"{how} {self.variable} to the python of its environment."


_BACKENDS = (
    *(
        LearnedBackend(
            f"depth-anything-3-{size.lower()}",
            f"Depth Anything 3, {size}",
            "depth_estimator",
            "R2SEGO_DEPTH_ANYTHING_3_PYTHON",
            ("depth_anything_3",),
            "Apache-2.0",
            "Apache-2.0",
            download=f"about {download} GB",
            source=f"its README: {billions} billion parameters",
            worker="depth_anything_3",
            recipe=Recipe(("numpy==1.26.4", "xformers==0.0.31", _DEPTH_ANYTHING_3)),
        )
        for size, download, billions in (("BASE", 0.5, 0.12), ("SMALL", 0.3, 0.08))
    ),
    LearnedBackend(
        "mapanything",
        "MapAnything",
        "depth_estimator",
        "R2SEGO_MAPANYTHING_PYTHON",
        ("mapanything",),
        "Apache-2.0",
        "Apache-2.0",
        worker="mapanything",
        recipe=Recipe(("numpy==1.26.4", f"mapanything @ {_MAPANYTHING}")),
    ),
    LearnedBackend(
        "vggt",
        "VGGT",
        "depth_estimator",
        "R2SEGO_VGGT_PYTHON",
        ("vggt", "mapanything"),
        "VGGT licence",
        "CC BY-NC 4.0, not commercial",
        download="about 5 GB",
        memory="3.2 GB of GPU memory for 8 photographs, 5.6 for 20",
        seconds="0.014 on an H100",
        source="its README: a billion parameters; a table of the aggregator alone",
        worker="vggt",
        recipe=Recipe(("numpy==1.26.4", f"mapanything @ {_MAPANYTHING}")),
    ),
    LearnedBackend(
        "moge-2",
        "MoGe-2",
        "depth_estimator",
        "R2SEGO_MOGE_PYTHON",
        ("moge",),
        "MIT, and Apache-2.0",
        "MIT",
        download="about 0.4 GB",
        seconds="0.06 on an A100 or RTX 3090, of its larger model",
        source="its README: 104 million parameters",
        worker="moge",
        recipe=Recipe(
            ("numpy==1.26.4", "moge @ git+https://github.com/microsoft/MoGe@07444410f1e33f402353b99d6ccd26bd31e469e8")
        ),
    ),
    *(
        LearnedBackend(
            name,
            label,
            "depth_estimator",
            "R2SEGO_DUST3R_PYTHON",
            (name,),
            "CC BY-NC-SA 4.0, not commercial",
            "CC BY-NC-SA 4.0, and terms of the training data",
            worker="dust3r",
            recipe=Recipe(
                (
                    "numpy==1.26.4",
                    "einops==0.8.0",
                    "huggingface-hub==0.25.2",
                    "matplotlib==3.9.2",
                    "opencv-python-headless==4.10.0.84",
                    "pillow==10.4.0",
                    "roma==1.5.1",
                    "safetensors==0.4.5",
                    "scikit-learn==1.5.2",
                    "scipy==1.14.1",
                    "tqdm==4.66.5",
                    "trimesh==4.5.1",
                ),
                clone=("https://github.com/naver/mast3r", "f5209afc300cec36239a7ac992263f36847bbba0"),
                paths=(".", "dust3r"),
            ),
        )
        for name, label in (("mast3r", "MASt3R"), ("dust3r", "DUSt3R"))
    ),
    LearnedBackend(
        "sam3",
        "SAM 3",
        "object masks",
        "R2SEGO_SAM3_PYTHON",
        ("sam3",),
        "SAM licence",
        "SAM licence, given on request",
        needs_gpu=True,
    ),
    LearnedBackend(
        "sam3d",
        "SAM 3D Objects",
        "shape_prior",
        "R2SEGO_SAM3D_PYTHON",
        ("sam3d_objects",),
        "SAM licence",
        "SAM licence, given on request",
        needs_gpu=True,
        memory="32 GB of GPU memory",
        source="its README",
        needs=("R2SEGO_SAM3D_REPOSITORY",),
    ),
    LearnedBackend(
        "nksr",
        "NKSR",
        "surface",
        "R2SEGO_NKSR_PYTHON",
        ("nksr",),
        "NVIDIA Source Code License, not commercial",
        "CC BY-SA 4.0",
        needs_gpu=True,
    ),
    LearnedBackend(
        "viewcrafter",
        "ViewCrafter",
        "generator",
        "R2SEGO_VIEWCRAFTER_PYTHON",
        ("pytorch_lightning",),
        "as its repository says",
        "as its repository says",
        needs_gpu=True,
        memory="24 GB of GPU memory, 14 GB for 512 x 320",
        seconds="120 a clip on an A100",
        source="its README",
        needs=("R2SEGO_VIEWCRAFTER_REPOSITORY",),
    ),
    LearnedBackend(
        "difix3d",
        "Difix3D+",
        "method to compare with",
        "R2SEGO_DIFIX3D_PYTHON",
        ("pipeline_difix",),
        "NVIDIA License, not commercial",
        "NVIDIA License, not commercial, and Stability AI's for SD-Turbo",
        needs_gpu=True,
        worker="difix3d",
        recipe=Recipe(
            (
                "numpy==1.26.4",
                "diffusers==0.25.1",
                "einops==0.8.0",
                "huggingface-hub==0.25.1",
                "peft==0.9.0",
                "pillow==10.4.0",
                "transformers==4.38.0",
            ),
            clone=("https://github.com/nv-tlabs/Difix3D", "c76edc595586e16732c91ddee82f3a6d83a8a9cc"),
            paths=("src",),
        ),
    ),
    LearnedBackend(
        "genfusion",
        "GenFusion",
        "method to compare with",
        "R2SEGO_GENFUSION_PYTHON",
        ("diff_surfel_rasterization",),
        "MIT, and the Gaussian-Splatting License, not commercial",
        "as its repository says",
        needs_gpu=True,
        needs=("R2SEGO_GENFUSION_REPOSITORY",),
    ),
)

LEARNED_BACKENDS: Mapping[str, LearnedBackend] = {one.name: one for one in _BACKENDS}
"""Every backend that runs in an environment of its own, by its name in its slot."""
