"""`paper`: the audit of the article, row by row."""

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from actin_xcheck.cli.options import Json, command


def paper_command(
    only: Annotated[
        list[str] | None, typer.Option(help="One row, such as fig14 or eq3.7; may be given more than once.")
    ] = None,
    out_dir: Annotated[Path | None, typer.Option("--out", help="Folder for the results.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing audit.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
    json: Json = False,
) -> None:
    """Hold every equation, table, figure and number of the article against what is computed here.

    Takes about a quarter of an hour on two cores; given an interrupted audit's folder, it goes on there if
    the code is the same commit.  A row's key stands beside it on the page.
    """
    from difflib import get_close_matches

    from actin_xcheck.cli.output import ReportAnswer, conclude
    from actin_xcheck.cli.progress import Progress
    from actin_xcheck.core.errors import UserError
    from actin_xcheck.studies.audit.examine import examine
    from actin_xcheck.studies.audit.page import write_audit_page
    from actin_xcheck.studies.audit.record import FILE_NAME
    from actin_xcheck.studies.audit.row import Judgement
    from actin_xcheck.studies.audit.rows import ROWS
    from actin_xcheck.studies.folder import report_folder, report_in

    keys = list(dict.fromkeys(only)) if only else list(ROWS)
    for key in keys:
        if key not in ROWS:
            near = get_close_matches(key, ROWS, 3) or list(ROWS)[:5]
            some = ", ".join(near)
            raise UserError(
                f"--only: no row is called {key!r}; valid are {some} and others, {len(ROWS)} in all"
            )
    folder = report_folder(out_dir, "paper")
    with report_in(folder, FILE_NAME, "an audit", force):
        with Progress(quiet) as progress:
            entries = examine(keys, folder, command(), progress.report)
        page = write_audit_page(folder)
    counts = Counter(entry.finding.judgement for entry in entries)
    said = tuple(
        f"{entry.key} ({entry.place}): {entry.finding.judgement}\n"
        f"  {entry.finding.computed}\n  {entry.finding.reason}"
        for entry in entries
        if only
    )
    found = ", ".join(f"{counts[judgement]} {judgement}" for judgement in Judgement if counts[judgement])
    verdicts = {str(judgement): counts[judgement] for judgement in Judgement if counts[judgement]}
    conclude(ReportAnswer(command="paper", page=str(page), verdicts=verdicts, findings=said), found, json)
