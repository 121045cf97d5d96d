"""`judge`: what another code computed, held against the truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from actin_xcheck.cli.conduct import SceneWord, command, study_command
from actin_xcheck.core.errors import UserError

if TYPE_CHECKING:
    from actin_xcheck.studies.study import Study

Files = Annotated[list[Path], typer.Argument(metavar="FILE...", show_default=False)]
Steps = Annotated[list[float] | None, typer.Option(help="Of each file, in their order.", min=1e-12)]


@study_command("judge")
def judge(
    scene: SceneWord,
    files: Files,
    h: Steps = None,
    dt: Steps = None,
    order: Annotated[float | None, typer.Option(help="That the code declares, in what is given.")] = None,
    within: Annotated[float, typer.Option(help="Error up to which a number is right.", min=1e-9)] = 0.01,
    field: Annotated[str, typer.Option(help="Name of the concentration in a mesh.")] = "a",
    units: Annotated[str, typer.Option(help='As "um, s"; else numbers are non-dimensional.')] = "",
) -> "Study":
    """Hold what another code computed of a scene against the truth: errors, orders, lag, and claims.

    FILE is a CSV with the column time and any of area, total_actin, centroid_x, centroid_y, polarity,
    mode_amplitude, probe_1_a, probe_1_x, probe_1_y and so on; a .vtu, .pvd, .xdmf or .vtkhdf of triangles
    with a concentration; or a run of ours.  Several files with --h or --dt give an observed order.  The truth
    is a reference or an exact solution where the scene has one, else a run to a hundredth of the apparent
    error.
    Exit code 0 when all claims hold, 1 when one fails, 2 for a mistake in what was asked or in a file.
    """
    from math import nan

    from actin_xcheck.scene.scene import load_scene
    from actin_xcheck.studies.judge import judge as study
    from actin_xcheck.studies.judge.theirs import read_theirs, sorted_by_step

    loaded = load_scene(scene)
    for option, steps in (("--h", h), ("--dt", dt)):
        if steps and len(steps) != len(files):
            raise UserError(f"{option}: {len(steps)} for {len(files)} files; valid: one for each, or none")
    if len({path.stem for path in files}) < len(files):
        raise UserError("two files have one name; valid: names that differ")
    given = [read_theirs(path, loaded, field, units) for path in files]
    return study(loaded, sorted_by_step(given, h, dt), within, nan if order is None else order, command())
