"""What a night tries: what failed last, what fails most often, what is cheapest; and how it begins."""

import math
import platform
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from itertools import accumulate
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import locked, new_folder
from actin_xcheck.nightly.history import FILE_NAME as HISTORY
from actin_xcheck.nightly.history import STOPPED, Series, find_night, read_claims, read_nights, read_series
from actin_xcheck.nightly.items import CheckItem, Control, Costed, Diluted, Item, night_long
from actin_xcheck.nightly.record import FILE_NAME, Begun, Kept, nights_in, write_night
from actin_xcheck.runs.executor import cores
from actin_xcheck.runs.method import METHODS, Method, find_method
from actin_xcheck.runs.numerics import KERNEL, seconds_of
from actin_xcheck.runs.provenance import provenance
from actin_xcheck.studies.checks import AREA, CURVED, FIELD, FV, IMEX, OWN, PAPER, SUITE, Compared, Studied
from actin_xcheck.studies.compare import DEFAULT_SCENES
from actin_xcheck.studies.converge.plan import Refined
from actin_xcheck.studies.deliveries import DeliveriesOfTheDate
from actin_xcheck.studies.faults import FAULTS, Check
from actin_xcheck.studies.random_scenes import OfTheDate

PAGES = 0.08
"""Share of a budget that is left for pages and the history."""

MEMORY_OF = 20
"""Nights from which it is known how often a check fails."""

_EXACT = (
    "growing-disk", "manufactured-moving", "manufactured-static", "stirred", "stirred-static",
    "mode-02-wall-270", "mode-0-cell", "mode-2-cell", "mode-1-viscous-cell", "mode-2-free-cell",
)  # fmt: skip

RANDOM = 20
"""Scenes of the date in a check: a thousand are there for a night that has the time."""

EXTRA: tuple[Check, ...] = (
    *(Compared(scene, pair, 5, steps=100) for scene in DEFAULT_SCENES for pair in ((PAPER, FV), (IMEX, OWN))),
    Diluted((PAPER, FV), 3),
    *(Compared(scene, (PAPER, FV), 4, steps=100) for scene in _EXACT),
    *(
        Compared(scene, (PAPER, FV), 4, steps=200)
        for scene in ("fig12-mixed-31-02-21", "fig16-uniform-expansion")
    ),
    # a free viscoelastic rim whose load sees phi: one order less in h than elsewhere
    Studied("fitted-ring-elastic", CURVED, Refined.H, 4, (AREA,)),
    Studied("fitted-ring-elastic", CURVED, Refined.DT, 5, (FIELD, AREA)),
    DeliveriesOfTheDate(5, (1e-3, 1e-4)),
    *(OfTheDate(first, RANDOM) for first in range(0, 1000, RANDOM)),
)
"""What a night has time for beyond the quick checks that faults are held against."""

GUESSED = 5.0
"""Seconds of a check of which no night has told."""

COST_SCENE, COST_REFINE, COST_STEPS, COST_RTOL = "fig14-four-fronts", 3, 40, 1e-4


@dataclass(frozen=True)
class Past:
    """What the history says of checks, by name.

    Seconds are those of tonight: a machine that was busy then, or is now, has the reference kernel say so.

    Attributes
    ----------
    seconds : the last time each took, on a cluster where it was never measured.
    failed : those that failed when they were run last.
    often : share of nights in which each failed.
    stopped : seconds after which some were stopped, since they were last over.
    pace : seconds that one takes which is guessed.
    """

    seconds: Mapping[str, float] = field(default_factory=dict)
    failed: frozenset[str] = frozenset()
    often: Mapping[str, float] = field(default_factory=dict)
    stopped: Mapping[str, float] = field(default_factory=dict)
    pace: float = 1.0

    def expected(self, item: Item) -> float:
        """Seconds that an item will take: what was stopped needs more, and is given twice as much."""
        usual = self.seconds.get(item.name, self.pace * item.guess)
        return max(usual, 2 * self.stopped.get(item.name, 0.0))

    def order(self, item: Item) -> tuple[bool, bool, bool, float, float]:
        """By which items are sorted: checks, controls, costs; of each failed last, often failing, cheap."""
        failed, often = item.name in self.failed, self.often.get(item.name, 0.0)
        return item.timed, isinstance(item, Control), not failed, -often, self.expected(item)


def suite() -> tuple[Item, ...]:
    """Everything there is: checks of the harness, controls, which need them, costs, measured one by one."""
    checks = [CheckItem(check, _guess(check)) for check in (*SUITE, *EXTRA)]
    controls = [Control(name, GUESSED) for name in FAULTS]
    costs = [
        Costed(COST_SCENE, name, COST_REFINE, COST_STEPS, COST_RTOL, _guessed(method))
        for name, method in METHODS.items()
        if not method.driven_by
    ]
    return (*checks, *controls, *costs)


def _guessed(method: Method) -> float:
    """Seconds of what is measured up to three times, beside the reference kernel."""
    return 1.0 + 3 * seconds_of(method, COST_REFINE, COST_STEPS)


def _guess(check: Check) -> float:
    """Seconds, where no night has told: half more than its runs take, and what every check does."""
    if isinstance(check, OfTheDate | DeliveriesOfTheDate):
        return check.seconds
    if not isinstance(check, Compared):
        return GUESSED
    runs = sum(seconds_of(find_method(name), check.refine, check.steps) for name in check.methods)
    return 1.0 + 1.5 * runs


def past(history: Path, kernel: float = math.nan) -> Past:
    """What the nights in a history tell; nothing where there is none.

    Parameters
    ----------
    history : its file.
    kernel : seconds of the reference kernel tonight; nan: as it was in every night, and is here.
    """
    pace = 1.0 if math.isnan(kernel) else kernel / KERNEL
    if not history.exists():
        return Past(pace=pace)
    last = [read_claims(history, one.night.name) for one in read_nights(history)[-MEMORY_OF:]]
    elsewhere = {
        one.check: one.seconds
        for night in last
        for one in night.values()
        if np.isfinite([one.seconds, one.claim.value]).all()  # what hung says nothing
    }
    whole = {_name(one.key): one for one in read_series(history, "seconds/*")}
    stopped = {_name(one.key): one for one in read_series(history, f"{STOPPED}/*")}
    kernels = {
        night.name: value
        for one in read_series(history, "kernel")
        for night, value in zip(one.nights, one.values, strict=True)
    }

    def tonight(one: Series) -> float:
        """Its last seconds, on a machine as busy as this is."""
        slower = kernel / kernels.get(one.nights[-1].name, math.nan)
        return float(one.values[-1]) * (slower if math.isfinite(slower) else 1.0)

    seconds = {name: tonight(one) for name, one in whole.items()}
    red = {one.key: one.values[-MEMORY_OF:] for one in read_series(history, "red/*")}
    return Past(
        elsewhere | {name: value for name, value in seconds.items() if np.isfinite(value)},
        frozenset(_name(key) for key, values in red.items() if values[-1] > 0),
        {_name(key): float((values > 0).mean()) for key, values in red.items()},
        {
            name: tonight(one)
            for name, one in stopped.items()
            if name not in whole or whole[name].nights[-1].date < one.nights[-1].date
        },
        pace,
    )


def _name(key: str) -> str:
    return key.split("/", 1)[1]


def chosen(items: Sequence[Item], only: Sequence[str], failed: bool, known: Past) -> tuple[Item, ...]:
    """The items that were asked for, in order.

    Parameters
    ----------
    items : everything.
    only : patterns of names, as a shell's; all without any.
    failed : whether to leave out what did not fail when it was run last.
    known : the past.

    Controls bring the checks along that they are held against.  UserError where nothing is left.
    """
    wanted = {item.name for item in items}
    if only:
        for pattern in only:
            if not any(fnmatchcase(name, pattern) for name in wanted):
                first = {type(item): item.name for item in reversed(items)}  # of each kind
                some = ", ".join(reversed(first.values()))
                raise UserError(
                    f"--only: no check is called {pattern!r}; valid: such as {some}; * and ? match"
                )
        wanted = {name for name in wanted if any(fnmatchcase(name, pattern) for pattern in only)}
    if failed:
        wanted &= known.failed
        if not wanted:
            raise UserError("--failed: nothing failed when it was run last; valid: without")
    if any(isinstance(item, Control) and item.name in wanted for item in items):
        wanted |= {check.name for check in SUITE}
    return tuple(sorted((item for item in items if item.name in wanted), key=known.order))


@dataclass(frozen=True)
class Wish:
    """What a night is asked for.

    Attributes
    ----------
    reports : folder of all nights.
    minutes : in all; None: as long as it takes, or as the night that is gone on with has left.
    fault, baseline : names of a deliberate fault and of a night to compare with; empty without.
    only : patterns of checks; all without any.
    failed : whether to leave out what did not fail when it was run last.
    resume : whether to go on with the night that was interrupted.
    command : what makes it again.
    """

    reports: Path
    minutes: float | None = None
    fault: str = ""
    baseline: str = ""
    only: tuple[str, ...] = ()
    failed: bool = False
    resume: bool = False
    command: str = ""

    @property
    def history(self) -> Path:
        """Of all nights."""
        return self.reports / HISTORY


@dataclass(frozen=True)
class Tonight:
    """A night that has begun: what it tries, what the past says, how far it has come, the budget's end."""

    items: tuple[Item, ...]
    known: Past
    kept: Kept
    deadline: float


def planned(wish: Wish, suite: Sequence[Item], known: Past) -> tuple[Item, ...]:
    """What a night will try, of what there is and is known; UserError for a mistake in what was asked."""
    if wish.resume and (wish.only or wish.failed or wish.fault or wish.baseline):
        raise UserError(
            "--resume: goes on with what the night was begun with; "
            "valid: without --only, --failed, --fault and --baseline"
        )
    items = with_fault(chosen(suite, wish.only, wish.failed, known), wish.fault)
    if wish.baseline:
        find_night(read_nights(wish.history), wish.baseline)
    return items


def cost(wish: Wish, suite: Sequence[Item], workers: int) -> tuple[int, float, int]:
    """How many checks a night would try, about how many seconds all of them take, and how many have time."""
    known = past(wish.history)
    shares = (known.expected(one) / (1 if one.timed else workers) for one in planned(wish, suite, known))
    ends = list(accumulate(shares))
    budget = 60 * (wish.minutes or math.inf) * (1 - PAGES)
    return len(ends), ends[-1], sum(end <= budget for end in ends)


def with_fault(items: Sequence[Item], fault: str) -> tuple[Item, ...]:
    """The items of a night; with a deliberate fault its checks alone, which need not tell what they call."""
    if not fault:
        return tuple(items)
    with night_long(fault):
        return tuple(replace(item, watches=False) for item in items if isinstance(item, CheckItem))


@contextmanager
def begun(wish: Wish, suite: Sequence[Item], kernel: float) -> Iterator[Tonight]:
    """Begin a night in a folder of its own, or go on with one, and have that folder to oneself.

    What the same code has answered is taken up, as in any study; `kernel` is what the reference kernel takes,
    in seconds.  UserError where there is nothing to go on with, or a check that was planned is no more.
    """
    now, known = time.time(), past(wish.history, kernel)
    items = planned(wish, suite, known)
    folder = unfinished(wish.reports).folder if wish.resume else night_folder(wish.reports, datetime.now(UTC))
    with locked(folder / FILE_NAME):
        if wish.resume:
            kept = unfinished(wish.reports)
            items = _gone_on_with(kept, suite)
            kept = replace(kept, done=(), begun=replace(kept.begun, versions=provenance()))
        else:
            kept = Kept(folder, _begun(folder.name, wish, items, kernel))
        write_night(kept)
        minutes, spent = (wish.minutes, 0.0) if wish.minutes else (kept.begun.minutes, kept.seconds)
        yield Tonight(items, known, kept, now + 60 * minutes * (1 - PAGES) - spent)


def _begun(name: str, wish: Wish, items: Sequence[Item], kernel: float) -> Begun:
    return Begun(
        name=name,
        date=datetime.now(UTC).isoformat(
            timespec="microseconds"
        ),  # by which it is told from others of the day
        versions=provenance(),
        machine=machine(),
        command=wish.command,
        minutes=wish.minutes or math.inf,
        fault=wish.fault,
        baseline=wish.baseline,
        planned=tuple(item.name for item in items),
        kernel=kernel,
    )


def _gone_on_with(kept: Kept, suite: Sequence[Item]) -> tuple[Item, ...]:
    """What a night had planned, in its order."""
    known = {item.name: item for item in suite}
    if gone := [name for name in kept.begun.planned if name not in known]:
        raise UserError(
            f"--resume: {kept.folder} planned {gone[0]!r}, which is no check any more; valid: without"
        )
    return with_fault([known[name] for name in kept.begun.planned], kept.begun.fault)


def night_folder(reports: Path, moment: datetime) -> Path:
    """Make the folder of a night, named by its date (UTC), with a number behind where that is taken.

    By a folder that is there, or by a night of the history whose folder is not.  UserError where it cannot be
    made.
    """
    history = reports / HISTORY
    taken = {one.night.name for one in read_nights(history)} if history.exists() else set()
    return new_folder(reports / f"{moment.astimezone(UTC):%Y-%m-%d}", taken)


def unfinished(reports: Path) -> Kept:
    """The last night that did not come to its end; UserError where there is none."""
    found = [one for one in nights_in(reports) if not one.closed]
    if not found:
        raise UserError(f"--resume: no night in {reports} was interrupted; valid: without")
    return found[-1]


def machine() -> str:
    """What tells this machine from others whose times are not comparable: processor, cores, system."""
    name, cpuinfo = platform.processor() or platform.machine(), Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = (line.partition(":")[2] for line in cpuinfo.read_text().splitlines() if "model name" in line)
        name = next(models, name)
    return f"{name.strip()}, {cores()} cores, {platform.system()}"
