"""What a night tries, and in which order: what failed last, what fails most often, what is cheapest."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly.checks import Checked, Control, Costed, Diluted, Item
from actin_xcheck.nightly.history.database import read_claims, read_nights, read_series
from actin_xcheck.nightly.history.record import Series
from actin_xcheck.nightly.nights import STOPPED
from actin_xcheck.runs.method import METHODS, find_method
from actin_xcheck.studies.compare import DEFAULT_SCENES
from actin_xcheck.studies.converge.plan import Refined
from actin_xcheck.studies.faults.catalogue import FAULTS
from actin_xcheck.studies.faults.checks import AREA, CURVED, FIELD, FV, PAPER, SUITE, Check, Compared, Studied
from actin_xcheck.studies.stored import seconds_of

MEMORY_OF = 20
"""Nights from which it is known how often a check fails."""

EXTRA: tuple[Check, ...] = (
    *(Compared(scene, (PAPER, FV), 5, steps=100) for scene in DEFAULT_SCENES),
    Diluted((PAPER, FV), 3),
    *(
        Compared(scene, (PAPER, FV), 4, steps=100)
        for scene in (
            "growing-disk",
            "manufactured-moving",
            "manufactured-static",
            "stirred",
            "stirred-static",
        )
    ),
    *(
        Compared(scene, (PAPER, FV), 4, steps=100)
        for scene in (
            "mode-02-wall-270",
            "mode-0-cell",
            "mode-2-cell",
            "mode-1-viscous-cell",
            "mode-2-free-cell",
        )
    ),
    *(
        Compared(scene, (PAPER, FV), 4, steps=200)
        for scene in ("fig12-mixed-31-02-21", "fig16-uniform-expansion")
    ),
    # a free viscoelastic rim whose load sees phi: one order less in h than elsewhere
    Studied("fitted-ring-elastic", CURVED, Refined.H, 4, (AREA,)),
    Studied("fitted-ring-elastic", CURVED, Refined.DT, 5, (FIELD, AREA)),
)
"""What a night has time for beyond the quick checks that faults are held against."""

GUESSED = 5.0
"""Seconds of a check of which no night has told."""

KERNEL = 0.055
"""Seconds of the reference kernel on the machine of which seconds are guessed."""

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

    def order(self, item: Item) -> tuple[bool, float, float]:
        """By which items are sorted: failed last, often failing, cheap."""
        return item.name not in self.failed, -self.often.get(item.name, 0.0), self.expected(item)


@dataclass(frozen=True)
class Plan:
    """What a night tries, each part in order.

    Attributes
    ----------
    checks : of the harness.
    controls : negative controls, which need the checks.
    costs : measured one by one.
    """

    checks: tuple[Item, ...]
    controls: tuple[Control, ...] = ()
    costs: tuple[Item, ...] = ()

    @property
    def items(self) -> tuple[Item, ...]:
        """All of it."""
        return (*self.checks, *self.controls, *self.costs)


def suite() -> Plan:
    """Everything there is."""
    checks = [Checked(check, _guess(check)) for check in (*SUITE, *EXTRA)]
    controls = [Control(name, GUESSED) for name in FAULTS]
    costs = [
        Costed(COST_SCENE, name, COST_REFINE, COST_STEPS, COST_RTOL, 3.0)
        for name, method in METHODS.items()
        if not method.driven_by
    ]
    return Plan(tuple(checks), tuple(controls), tuple(costs))


def _guess(check: Check) -> float:
    """Seconds, where no night has told: half more than its runs take, and what every check does."""
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


def chosen(plan: Plan, only: Sequence[str], failed: bool, known: Past) -> Plan:
    """The part of a plan that was asked for, in order.

    Parameters
    ----------
    plan : everything.
    only : patterns of names, as a shell's; all without any.
    failed : whether to leave out what did not fail when it was run last.
    known : the past.

    Controls bring the checks along that they are held against.  UserError where nothing is left.
    """
    wanted = {item.name for item in plan.items}
    if only:
        for pattern in only:
            if not any(fnmatchcase(name, pattern) for name in wanted):
                some = ", ".join(
                    item.name for item in (*plan.checks[:3], *plan.controls[:1], *plan.costs[:1])
                )
                raise UserError(
                    f"--only: no check is called {pattern!r}; valid: such as {some}; * and ? match"
                )
        wanted = {name for name in wanted if any(fnmatchcase(name, pattern) for pattern in only)}
    if failed:
        wanted &= known.failed
        if not wanted:
            raise UserError("--failed: nothing failed when it was run last; valid: without")
    controls = [item for item in plan.controls if item.name in wanted]
    quick = {check.name for check in SUITE} if controls else set()

    return Plan(
        tuple(sorted((i for i in plan.checks if i.name in wanted | quick), key=known.order)),
        tuple(sorted(controls, key=known.order)),
        tuple(sorted((i for i in plan.costs if i.name in wanted), key=known.order)),
    )
