"""What a night is made of: checks of the harness, negative controls and measured costs, and their lights."""

import math
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Protocol

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.errors import Ending, UserError
from actin_xcheck.nightly.record import Done, Number, NumberKind
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics, command
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.store import reading
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.chart.measure import Sample, command_of, measured
from actin_xcheck.studies.checks import Compared
from actin_xcheck.studies.converge import Error, Order
from actin_xcheck.studies.faults import FAULTS, Check, control, held_against
from actin_xcheck.studies.faults.fault import Calls, replaced, there, watched
from actin_xcheck.studies.stored import AskedRun
from actin_xcheck.verdicts.triangulate import Triangle

COMPARISON, ORDERS = "compare.h5", "converge.h5"


class Group(StrEnum):
    """A light; its value is what a reader sees."""

    CONSERVATION = "conservation"
    GEOMETRY = "geometric conservation"
    EXACT = "exact solutions"
    MODES = "modes"
    REFERENCE = "reference values"
    AGREEMENT = "FEM ~ FV ~ theory"
    ORDERS = "orders"
    REDUCTIONS = "smaller models, tolerances"
    ENDS = "runs to the end"
    CONTROLS = "negative controls"
    COST = "work and time"
    BASELINE = "against the baseline"
    OTHER = "other"


_SHARED = {
    ClaimKind.GROWTH_RATE: Group.MODES,
    ClaimKind.TRANSIENT: Group.MODES,
    ClaimKind.TRIANGLE: Group.AGREEMENT,
    ClaimKind.ORDER_H: Group.ORDERS,
    ClaimKind.ORDER_DT: Group.ORDERS,
    ClaimKind.REDUCTION: Group.REDUCTIONS,
    ClaimKind.INVARIANCE: Group.REDUCTIONS,
    ClaimKind.TOLERANCE: Group.REDUCTIONS,
    ClaimKind.COVERAGE: Group.AGREEMENT,
    ClaimKind.CONTROL: Group.CONTROLS,
    ClaimKind.CLEAN: Group.CONTROLS,
}
"""Lights of claims that have none of their name."""


def group_of(claim: Claim) -> Group:
    """The light of a claim; codes and theory that agree on the area have moved the cell alike."""
    if claim.kind is ClaimKind.TRIANGLE and claim.quantity == "area":
        return Group.GEOMETRY
    return _SHARED.get(claim.kind) or Group[claim.kind.name]


NO_VERDICT = "comes to a verdict"
"""What is claimed of a check that broke down, and fails."""


def no_verdict(check: str, trouble: str) -> Claim:
    """What fails where a check broke down: it has the light of what it would have judged."""
    what, _, subject = check.partition(" ")
    return Claim(
        kind={"fault": ClaimKind.CONTROL, "cost": ClaimKind.COST}.get(what, ClaimKind.ENDS),
        scene=subject if what == "fault" else check,
        methods=(),
        statement=NO_VERDICT,
        value=math.nan,
        bound=0.0,
        command=command("nightly", only=check),
        path=f"/{subject}",
        note=trouble,
    )


class Item(Protocol):
    """Something that a night carries out by itself."""

    @property
    def name(self) -> str:
        """What it is called, the same every night."""
        ...

    @property
    def guess(self) -> float:
        """About how many seconds it takes, where no night has told."""
        ...

    @property
    def timed(self) -> bool:
        """Whether it runs by itself, on this machine: its time is what is measured."""
        ...

    def find(self, folder: Path) -> Done:
        """Carry it out in this process, with files into a folder of its own."""
        ...


class NotDecided(Exception):
    """A control about which this night cannot say anything, and why."""


@dataclass(frozen=True)
class CheckItem:
    """A check of the harness; while it runs it is noted which functions with a known fault it calls."""

    check: Check
    guess: float = field(compare=False)
    watches: bool = True
    timed = False

    @property
    def name(self) -> str:
        """That of the check."""
        return self.check.name

    def find(self, folder: Path) -> Done:
        """Its claims, and the numbers in its files."""
        targets = there(fault.target for fault in FAULTS.values()) if self.watches else ()
        with watched(targets) as calls:
            claims = self.check.claims(folder)
        # an order that was claimed and can no longer be read off has not held
        orders = [claim for claim in claims if group_of(claim) is Group.ORDERS]
        silent = [claim for claim in orders if not claim.judged]
        if silent or not any(claim.judged for claim in claims):
            said = f"{len(silent)} of its orders came to no" if silent else "none of its claims came to a"
            claims = [*claims, no_verdict(self.name, f"{said} verdict")]
        places = [located(claim, folder) for claim in claims]
        return Done(
            name=self.name,
            claims=tuple(claim for _, claim in places),
            files=tuple(file for file, _ in places),
            numbers=tuple(numbers_in(folder, self.name)),
            reached=tuple(target for target, one in calls.items() if one.count),
        )


@dataclass(frozen=True)
class Control:
    """A deliberate fault, against the checks of this night that call what it replaces.

    Attributes
    ----------
    fault : its name.
    guess : seconds.
    checks : that are green without it, in the order in which they are tried.
    whole : whether all checks have been run, so that a fault that is not caught is one that is missed.
    """

    fault: str
    guess: float = field(compare=False)
    checks: tuple[Check, ...] = field(default=(), compare=False)
    whole: bool = field(default=True, compare=False)
    timed = False

    @property
    def name(self) -> str:
        """The word and the fault's name."""
        return f"fault {self.fault}"

    @property
    def target(self) -> str:
        """What the fault replaces."""
        return FAULTS[self.fault].target

    def find(self, folder: Path) -> Done:
        """One claim: that a check turns red.  NotDecided where too few checks were run to say so."""
        caught = held_against((FAULTS[self.fault], self.checks), folder)
        if not caught.caught and not self.whole:
            raise NotDecided(f"not caught by the {len(self.checks)} checks that were run before it")
        return Done(self.name, (control(caught),), ("",))


@dataclass(frozen=True)
class Costed:
    """What a scene costs by a method: time in reference kernels, counted work, memory; runs by itself."""

    scene: str
    method: str
    refine: int
    steps: int
    rtol: float | None
    guess: float = field(compare=False)
    timed = True

    @property
    def name(self) -> str:
        """The word, scene and method."""
        return f"cost {self.scene} {self.method} refine {self.refine}"

    def find(self, folder: Path) -> Done:
        """That the run completes; how much it costs, which no bound judges, but the history does."""
        scene, method = load_scene(self.scene), METHODS[self.method]
        point = Numerics(
            method, self.refine, scene.time.end / self.steps, self.rtol if method.adaptive else None
        )
        sample = measured(AskedRun(scene, point), folder)
        kernels = float(np.median(sample.kernels))
        command = command_of(point, scene)
        claim = Claim(
            kind=ClaimKind.COST,
            scene=self.scene,
            methods=(self.method,),
            statement=f"completes, and is measured (refine {self.refine})",
            value=0.0 if sample.answer.ending == Ending.COMPLETED else math.nan,
            bound=0.0,
            command=command,
            path=f"/cost/{self.method}",
            note=sample.answer.message
            or f"{kernels:.1f} reference kernels, {sample.seconds:.3g} s, {sample.steps} steps",
        )
        return Done(self.name, (claim,), ("",), tuple(_costs(self.name, sample, kernels, command)))


def _costs(name: str, sample: Sample, kernels: float, command: str) -> list[Number]:
    tried = sample.steps + sample.rejected
    counted = {"steps": tried, "factorisations": sample.factorisations, "solves": sample.solves}
    return [
        Number(f"{name}/kernels", NumberKind.TIME, kernels, "reference kernels", command),
        Number(
            f"{name}/kernels per step", NumberKind.TIME, kernels / max(tried, 1), "reference kernels", command
        ),
        Number(f"{name}/memory", NumberKind.MEMORY, float(sample.memory), "bytes", command),
        *(
            Number(f"{name}/{what}", NumberKind.COUNT, float(count), "", command)
            for what, count in counted.items()
        ),
    ]


DILUTION = "uniform-dilution"
DILUTION_TEXT = f"""
name = "{DILUTION}"
source = "Volumes alone change a: a constant concentration on a cell that grows and is sheared"
[parameters]
psi = 0
p = 0
[model]
reaction = false
[motion]
x = "exp(t/2)*(x0 + t*y0)"
y = "exp(t/2)*y0"
[initial]
a = "1"
[time]
end = 0.5
[expect.exact]
a = "exp(-t)"
bound = {{ h2 = 1e-11, dt = 0 }}
"""


@dataclass(frozen=True)
class Diluted:
    """A constant concentration on a cell that grows and is sheared is diluted by its volumes, exactly."""

    methods: tuple[str, ...]
    refine: int
    steps: int = 50
    bounded: bool = True

    @property
    def name(self) -> str:
        """The words of the command."""
        return " ".join(["compare", DILUTION, *self.methods, f"refine {self.refine}"])

    def claims(self, folder: Path) -> list[Claim]:
        """What is claimed of each run and of both: that the exact solution is met is a matter of volumes."""
        place = folder / f"{DILUTION}.toml"
        place.write_text(DILUTION_TEXT, encoding="utf-8")
        claims = Compared(str(place), self.methods, self.refine, self.steps).claims(folder)
        return [
            replace(claim, kind=ClaimKind.GEOMETRY) if claim.kind is ClaimKind.EXACT else claim
            for claim in claims
        ]


def night_long(fault: str) -> AbstractContextManager[Calls]:
    """A deliberate fault for all that a check does; UserError where there is none of that name."""
    if fault not in FAULTS:
        raise UserError(f"--fault: {fault!r} is not a fault; valid: {', '.join(FAULTS)}")
    return replaced(FAULTS[fault].target, FAULTS[fault].wrong)


def located(claim: Claim, folder: Path) -> tuple[str, Claim]:
    """The file in a check's folder that holds a claim's numbers, and the claim with its path in that file."""
    for name in (COMPARISON, ORDERS):
        if (folder / name).exists():
            return name, claim
    runs = sorted(_finished(folder), key=lambda run: run.stat().st_mtime_ns)
    if not runs:
        return "", claim
    inside = claim.path.split("/", 4)[-1]  # behind /runs/<scene>/<method>/, which a comparison links
    return runs[0].name, replace(claim, path=f"/{inside}")


def _finished(folder: Path) -> list[Path]:
    """The runs of a folder, without what is left of one that was killed."""
    return [run for run in folder.glob("*.vtkhdf") if not run.stem.endswith(".partial")]


def numbers_in(folder: Path, check: str) -> Iterator[Number]:
    """Observed orders, errors, rates, steps and times that the files in a check's folder hold."""
    if (folder / ORDERS).exists():
        yield from _of_orders(folder)
    if (folder / COMPARISON).exists():
        with reading(folder / COMPARISON, "report of a study") as file:
            triangles = read_table(file["tables/triangles"], Triangle)
        for triangle in triangles:
            if triangle.quantity == "growth_rate":
                for method, corner in zip(triangle.methods, triangle.corners, strict=False):
                    key = f"rate/{triangle.scene}/{method} · {check}"
                    yield Number(key, NumberKind.RATE, corner.value, "", f"{COMPARISON}/tables/triangles")
    for run in sorted(_finished(folder)):
        if "--coarser-" in run.name:
            continue
        with reading(run, "run") as file:
            steps = len(file["run/series/time"]) - 1
            seconds = float(file["run"].attrs["wall_seconds"])
        yield Number(f"steps/{run.stem} · {check}", NumberKind.COUNT, float(steps), "", run.name)
        yield Number(f"step/{run.stem} · {check}", NumberKind.TIME, seconds / max(steps, 1), "s", run.name)


def _of_orders(folder: Path) -> Iterator[Number]:
    with reading(folder / ORDERS, "report of a study") as file:
        orders = read_table(file["tables/orders"], Order)
        errors = read_table(file["tables/errors"], Error)
    known = {one.key: one.error for one in errors if np.isfinite(one.error)}  # the last of each
    for key, error in known.items():
        yield Number(f"error/{key}", NumberKind.ERROR, error, "", f"{ORDERS}/tables/errors")
    for one in orders:
        yield Number(f"order/{one.key}", NumberKind.ORDER, one.last, "", f"{ORDERS}/tables/orders")
