"""What a night is made of: checks of the harness, negative controls, and measured costs."""

import math
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.outcome import Ending
from actin_xcheck.nightly import groups
from actin_xcheck.nightly.files import located, numbers_in
from actin_xcheck.nightly.history.record import Kind, Number
from actin_xcheck.runs.machine import reference_kernel
from actin_xcheck.runs.method import METHODS
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.chart.measure import Sample, measured
from actin_xcheck.studies.chart.points import Point
from actin_xcheck.studies.faults.catalogue import FAULTS
from actin_xcheck.studies.faults.checks import QUIET, Check, Compared
from actin_xcheck.studies.faults.fault import Calls, replaced, there, watched
from actin_xcheck.studies.faults.hunt import control, held_against


@dataclass(frozen=True)
class Found:
    """What an item found.

    Attributes
    ----------
    claims : what came out.
    files : of each claim, relative to the item's folder: what holds its number; empty where nothing is kept.
    numbers : for the history, beside the claims.
    reached : functions with a known fault that were called.
    """

    claims: tuple[Claim, ...]
    files: tuple[str, ...]
    numbers: tuple[Number, ...] = ()
    reached: tuple[str, ...] = ()


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

    def find(self, folder: Path) -> Found:
        """Carry it out in this process, with files into a folder of its own."""
        ...


class NotDecided(Exception):
    """A control about which this night cannot say anything, and why."""


@dataclass(frozen=True)
class Checked:
    """A check of the harness; while it runs it is noted which functions with a known fault it calls."""

    check: Check
    guess: float
    watches: bool = True

    @property
    def name(self) -> str:
        """That of the check."""
        return self.check.name

    def find(self, folder: Path) -> Found:
        """Its claims, and the numbers in its files."""
        targets = there(fault.target for fault in FAULTS.values()) if self.watches else ()
        with watched(targets) as calls:
            claims = self.check.claims(folder)
        # an order that was claimed and can no longer be read off has not held
        orders = [claim for claim in claims if groups.group_of(claim) is groups.Group.ORDERS]
        silent = [claim for claim in orders if not claim.judged]
        if silent or not any(claim.judged for claim in claims):
            said = f"{len(silent)} of its orders came to no" if silent else "none of its claims came to a"
            claims = [*claims, groups.no_verdict(self.name, f"{said} verdict")]
        reached = tuple(target for target, one in calls.items() if one.count)
        places = [located(claim, folder) for claim in claims]
        return Found(
            tuple(claim for _, claim in places),
            tuple(file for file, _ in places),
            tuple(numbers_in(folder, self.name)),
            reached,
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
    guess: float
    checks: tuple[Check, ...] = ()
    whole: bool = True

    @property
    def name(self) -> str:
        """The word and the fault's name."""
        return f"fault {self.fault}"

    @property
    def target(self) -> str:
        """What the fault replaces."""
        return FAULTS[self.fault].target

    def find(self, folder: Path) -> Found:
        """One claim: that a check turns red.  NotDecided where too few checks were run to say so."""
        caught = held_against((FAULTS[self.fault], self.checks), folder)
        if not caught.caught and not self.whole:
            raise NotDecided(f"not caught by the {len(self.checks)} checks that were run before it")
        return Found((control(caught),), ("",))


@dataclass(frozen=True)
class Costed:
    """What a scene costs by a method: time in reference kernels, counted work, memory; runs by itself."""

    scene: str
    method: str
    refine: int
    steps: int
    rtol: float | None
    guess: float

    @property
    def name(self) -> str:
        """The word, scene and method."""
        return f"cost {self.scene} {self.method} refine {self.refine}"

    def find(self, folder: Path) -> Found:
        """That the run completes; how much it costs, which no bound judges, but the history does."""
        scene, method = load_scene(self.scene), METHODS[self.method]
        point = Point(
            method, self.refine, scene.time.end / self.steps, self.rtol if method.adaptive else None
        )
        before = reference_kernel()
        sample = measured((scene, point), QUIET)
        kernels = float(np.median(sample.wall) / (before + reference_kernel())[0] * 2)
        command = point.command(scene)
        claim = Claim(
            kind=ClaimKind.COST,
            scene=self.scene,
            methods=(self.method,),
            statement=f"completes, and is measured (refine {self.refine})",
            value=0.0 if sample.ending == Ending.COMPLETED else math.nan,
            bound=0.0,
            command=command,
            path=f"/cost/{self.method}",
            note=sample.message
            or f"{kernels:.1f} reference kernels, {sample.seconds:.3g} s, {sample.steps} steps",
        )
        return Found((claim,), ("",), tuple(_costs(self.name, sample, kernels, command)))


def _costs(name: str, sample: Sample, kernels: float, command: str) -> list[Number]:
    tried = sample.steps + sample.rejected
    counted = {"steps": tried, "factorisations": sample.factorisations, "solves": sample.solves}
    return [
        Number(f"{name}/kernels", Kind.TIME, kernels, "reference kernels", command),
        Number(f"{name}/kernels per step", Kind.TIME, kernels / max(tried, 1), "reference kernels", command),
        Number(f"{name}/memory", Kind.MEMORY, float(sample.memory), "bytes", command),
        *(Number(f"{name}/{what}", Kind.COUNT, float(count), "", command) for what, count in counted.items()),
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
