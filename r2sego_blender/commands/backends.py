"""``r2sego backend install``: an environment for a learned model, made with consent alone."""

from __future__ import annotations

from pathlib import Path

import click

from .options import ANY_PATH, Commands, Output, output_options


@click.group(cls=Commands)
def backend() -> None:
    """Learned models in environments of their own."""


@backend.command()
@click.argument("name")
@click.option("--consent", is_flag=True, help="Do it: packages, code and weights come from the network.")
@click.option("--to", "folder", type=ANY_PATH, help="The environment's folder; without it, one among your settings.")
@output_options("--json-progress")
def install(name: str, consent: bool, folder: Path | None, output: Output) -> None:
    """Say what would be done to set up the learned backend NAME, with its licences; with --consent do it.

    `r2sego doctor --backends` names them. Nothing of them comes with this project, and nothing is fetched otherwise.
    """
    from ..core.errors import SettingsError
    from ..workers.backend_environment import in_words, steps_of
    from ..workers.backend_environment import install as make
    from ..workers.learned_backends import LEARNED_BACKENDS

    if name not in LEARNED_BACKENDS:
        raise SettingsError(
            f"there is no learned backend {name}",
            where="r2sego backend install",
            cure=f"Name one of {', '.join(one.name for one in LEARNED_BACKENDS.values() if one.recipe)}.",
        )
    known = LEARNED_BACKENDS[name]
    place = (folder or known.folder).absolute()
    steps = steps_of(known, place)
    if not consent:
        output.show(
            {
                "name": name,
                "folder": str(place),
                "code_licence": known.code_licence,
                "weights_licence": known.weights_licence,
                "download": known.download,
                "commands": [list(step.command) for step in steps],
            },
            lambda told: [
                f"# {known.label}: code under {told['code_licence']}, weights under {told['weights_licence']}",
                *in_words(steps),
                "# nothing was done: add --consent to have it done, from the network",
            ],
        )
        return
    python = make(known, place, output.progress)
    output.tell(python=str(python), variable=f"{known.variable}={python}" if folder else "")


COMMANDS = (backend,)
