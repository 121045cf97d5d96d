"""`render` and `export`: a stored run as pictures, and for other people's tools."""

from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import Json
from actin_xcheck.core.choices import FIELDS

Stored = Annotated[Path, typer.Argument(help="A stored run, .vtkhdf.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]


def render_command(
    file: Stored,
    out_file: Annotated[
        Path | None, typer.Option("--out", help="A .png, .gif or .mp4; default: FILE with .png.")
    ] = None,
    time: Annotated[
        float | None, typer.Option(help="Output time to draw in a .png; default: the last.")
    ] = None,
    field: Annotated[str, typer.Option(help=f"One of {', '.join(FIELDS)}.")] = "a",
    force: Force = False,
    json: Json = False,
) -> None:
    """Draw a frame of a stored run as a .png, or its film as a .gif or (where ffmpeg is found) an .mp4.

    Needs no display.  Curved cells are drawn curved; the grey line is the cell's rim at its start.
    """
    from actin_xcheck.cli.output import FilesAnswer, say
    from actin_xcheck.runs.pictures import render
    from actin_xcheck.runs.store import read_run

    run = read_run(file)
    path = _free(out_file or file.with_suffix(".png"), "--out", force)
    times = render(run, path, time, field)
    if json:
        say(FilesAnswer(command="render", files=(str(path),), times=times))
    else:
        print(f"{path}: {len(times)} {'frame' if len(times) == 1 else 'frames'}")


def export_command(
    file: Stored,
    to: Annotated[
        Path, typer.Option("--to", help="film.xdmf (with film.h5), or film.pvd (with a .vtu a frame).")
    ],
    force: Force = False,
    json: Json = False,
) -> None:
    """Write the film of a stored run for other tools: XDMF with straight triangles, or VTU with curved cells.

    ParaView 5.12 and later need neither: they open the .vtkhdf itself; film.pvd is for those before.
    """
    from actin_xcheck.cli.output import FilesAnswer, say
    from actin_xcheck.runs.pictures import export, files_of
    from actin_xcheck.runs.store import read_run

    run = read_run(file)
    for path in files_of(run, to):
        _free(path, "--to", force)
    files = export(run, to)
    if json:
        say(FilesAnswer(command="export", files=tuple(map(str, files)), times=tuple(run.times.tolist())))
    else:
        print(f"{files[0]}: {len(run.times)} frames in {len(files)} files")


def _free(path: Path, option: str, force: bool) -> Path:
    """Return a path that may be written; UserError where something is there."""
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.core.files import make_folder

    if path.exists() and not force:
        raise UserError(f"{option}: {path} exists already; valid: another name, or --force")
    make_folder(path.parent)
    return path
