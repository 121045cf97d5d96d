"""What the commands share: options, where their results go, and the words they were given."""

import math
import shlex
import sys
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import CAVEATS
from actin_xcheck.core.parameters import IN_UNITS, far_from_the_article
from actin_xcheck.scene.scene import Scene

Refine = Annotated[
    int | None, typer.Option(help="The mesh has 2**REFINE layers (5: 2113 nodes).", min=1, max=10)
]
Dt = Annotated[float | None, typer.Option(help="Largest time step.")]
Rtol = Annotated[
    float | None, typer.Option(help="Let adaptive methods choose steps with this local error.", min=1e-13)
]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing output.")]


def report_folder(out_dir: Path | None, kind: str) -> Path:
    """Return the folder a user named, else one for this kind of report and this moment."""
    return out_dir or Path("reports") / f"{kind}-{datetime.now():%Y%m%d-%H%M%S}"


def make_folder(folder: Path) -> Path:
    """Make a folder where there is none and return it; UserError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out: cannot make the folder {folder}: {error.strerror}") from error
    return folder


def command() -> str:
    """The command this process was started with, to be typed again."""
    return "python -m actin_xcheck " + shlex.join(sys.argv[1:])


def resuming_command() -> str:
    """The one that goes on with what this process has begun."""
    words = [word for word in sys.argv[1:] if word not in ("--force", "--resume")]
    return "python -m actin_xcheck " + shlex.join([*words, "--resume"])


def warn_of(scene: Scene) -> None:
    """Say on standard error what a user must know before believing the scene's results."""
    if caveat := CAVEATS.get(scene.physics.closure):
        print(f"warning: {scene.name}: {caveat}", file=sys.stderr)
    if scene.dimensional:
        groups = ", ".join(f"{name} = {value:.4g}" for name, value in asdict(scene.parameters).items())
        print(f"{scene.name}: [dimensional] makes {groups} (3.1)", file=sys.stderr)
        for sentence in far_from_the_article(scene.parameters):
            print(f"warning: {scene.name}: {sentence}; {IN_UNITS}", file=sys.stderr)


def check_step(dt: float | None) -> None:
    """Refuse what is no time step."""
    if dt is not None and not 0 < dt < math.inf:
        raise UserError(f"--dt: {dt:g} is not a time step; valid: a number > 0")
