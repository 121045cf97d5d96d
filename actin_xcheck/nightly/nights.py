"""Where nights lie: their folders beside one another, the history over all of them."""

import platform
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from actin_xcheck.core import files
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly.history.database import append, read_nights
from actin_xcheck.nightly.history.record import Judged, Kind, Night, Number
from actin_xcheck.nightly.record import FILE_NAME, Done, Kept, read_night
from actin_xcheck.runs.executor import cores

HISTORY = "history.sqlite"

STOPPED = "stopped"
"""Numbers of the history: seconds after which a check was stopped, so that it takes longer."""


def new_folder(reports: Path, begun: datetime) -> Path:
    """Make the folder of a night, named by its date (UTC), with a number behind where that is taken.

    By a folder that is there, or by a night of the history whose folder is not.  UserError where it cannot be
    made.
    """
    history = reports / HISTORY
    taken = {one.night.name for one in read_nights(history)} if history.exists() else set()
    return files.new_folder(reports / f"{begun.astimezone(UTC):%Y-%m-%d}", taken)


def nights_in(reports: Path) -> Iterator[Kept]:
    """The nights whose folders lie here, in the order in which they were begun."""
    found = []
    for path in reports.glob(f"*/{FILE_NAME}"):
        try:
            found.append(read_night(path.parent))
        except UserError:
            continue
    yield from sorted(found, key=lambda one: (one.begun.date, one.begun.name))


def unfinished(reports: Path) -> Kept:
    """The last night that did not come to its end; UserError where there is none."""
    found = [one for one in nights_in(reports) if not one.closed]
    if not found:
        raise UserError(f"--resume: no night in {reports} was interrupted; valid: without")
    return found[-1]


def machine() -> str:
    """What tells this machine from others whose times are not comparable: processor, cores, system."""
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = (line.partition(":")[2] for line in cpuinfo.read_text().splitlines() if "model name" in line)
        name = next(models, name)
    return f"{name.strip()}, {cores()} cores, {platform.system()}"


def judged_in(done: tuple[Done, ...]) -> Iterator[Judged]:
    """The claims of a night as the history keeps them."""
    for one in done:
        for claim, file in zip(one.claims, one.files, strict=True):
            yield Judged(claim, one.name, one.seconds, file)


def numbers_of(kept: Kept) -> Iterator[Number]:
    """The numbers of a night beside the values of its claims."""
    yield Number("kernel", Kind.TIME, kept.begun.kernel, "s")
    for one in kept.done:
        yield from one.numbers
        yield Number(f"red/{one.name}", Kind.COUNT, float(one.red))
    for left in kept.left_out:
        if left.seconds:
            yield Number(f"{STOPPED}/{left.name}", Kind.TIME, left.seconds, "s")


def night_of(kept: Kept) -> Night:
    """What the history says of a night."""
    begun = kept.begun
    versions = {name: version for name, version in begun.versions.items() if name != "commit"}
    return Night(
        begun.name, begun.date, begun.versions["commit"], versions, begun.machine, begun.command,
        60 * begun.minutes, kept.seconds,
    )  # fmt: skip


def remember(history: Path, kept: Kept) -> Night:
    """Add a night to the history, once however often this is asked for, as it is called there."""
    night = night_of(kept)
    if history.exists():
        for one in read_nights(history):
            if one.night.date == night.date and one.night.machine == night.machine:
                return one.night
    return append(history, night, numbers_of(kept), judged_in(kept.done))
