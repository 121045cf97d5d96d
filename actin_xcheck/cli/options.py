"""What the commands share: options, tables, and the words they were given.

The modules of commands import what help needs, and a command the rest when it is called: help and a
mistake in a word are there at once.
"""

import math
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from actin_xcheck.core.choices import CAVEATS
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.parameters import IN_UNITS, far_from_the_article

if TYPE_CHECKING:
    from rich.table import Table

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
Json = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object on one line.")]

_WHOLE = 10_000
"""Characters of the longest line that a table may have where nobody looks at it."""


def print_table(table: "Table") -> None:
    """Print a table as wide as a terminal, and in whole lines where there is none."""
    from rich.console import Console

    Console(highlight=False, width=None if sys.stdout.isatty() else _WHOLE).print(table)


def command() -> str:
    """The command this process was started with, to be typed again."""
    from actin_xcheck.runs.numerics import typed

    return typed(sys.argv[1:])


def resuming_command() -> str:
    """The one that goes on with what this process has begun."""
    from actin_xcheck.runs.numerics import typed

    words = [word for word in sys.argv[1:] if word not in ("--force", "--resume")]
    return typed([*words, "--resume"])


def warn_of(scene: "Scene") -> None:
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
