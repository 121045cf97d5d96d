"""The page of a hunt for faults, from `faults.h5` alone."""

from pathlib import Path

from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.studies.faults.record import FILE_NAME, read_hunt


def write_faults_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/faults.h5` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    stored = read_hunt(folder / FILE_NAME)
    text = (
        environment(folder)
        .get_template("faults.html")
        .render(
            attributes=stored.attributes,
            faults=stored.faults,
            checks=stored.checks,
            caught=sum(row.caught for row in stored.faults),
            missed=[row for row in stored.faults if not row.caught],
            red=[row for row in stored.checks if row.red],
            catches={row.name: sum(one.check == row.name for one in stored.faults) for row in stored.checks},
            file=stored.path,
        )
    )
    return put_page(folder, text)
