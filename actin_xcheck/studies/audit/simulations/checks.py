"""From the article's words about a simulation to a verdict: intervals, two codes, several readings.

The article shows pictures and says what is seen on them.  Each such sentence becomes a `Check`: a readout
that must lie in an interval.  It holds, fails or stays open by more than the numerical uncertainty, for both
codes, in the limit of fine meshes and small steps, at the article's own resolution, and under every reading
of what the article leaves ambiguous.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from actin_xcheck.core.model import Closure, Rheology
from actin_xcheck.report.exhibits import Line, Plot, Sheet, Shot, Shots
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.scene import Scene, load_scene
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.simulations.readouts import Readout
from actin_xcheck.studies.audit.simulations.studies import FEM, FV, Changes, Evidence, Level, Limit, Study

HOLDS, FAILS, OPEN = "holds", "fails", "open"

_MOVING = (Closure.REFERENCE_NORMAL, Closure.CURRENT_NORMAL, Closure.TRACTION_FREE)


@dataclass(frozen=True)
class Check:
    """A sentence of the article: a readout at an output time that must lie between two numbers."""

    words: str
    readout: Readout
    t: float
    low: float = -math.inf
    high: float = math.inf

    def state(self, found: Limit) -> str:
        """Whether it holds, fails or is open for a value with its uncertainty; no value fails."""
        if not math.isfinite(found.value):
            return FAILS
        reach = found.uncertainty if math.isfinite(found.uncertainty) else math.inf
        if self.low < found.value - reach and found.value + reach < self.high:
            return HOLDS
        outside = found.value + reach < self.low or found.value - reach > self.high
        return FAILS if outside else OPEN

    @property
    def interval(self) -> str:
        """What is asked for."""
        if math.isinf(self.high):
            return f"> {self.low:g}"
        return f"< {self.high:g}" if math.isinf(self.low) else f"{self.low:g} … {self.high:g}"


@dataclass(frozen=True)
class Case:
    """A simulation of the article: a shipped scene, run as published and in families to extrapolate from.

    Attributes
    ----------
    scene : shipped scene.
    steps : of the family's largest time step.
    changes : output times, or another parameter of the same scene; not a reading.
    label : names the case; tells those of one scene apart, where more than its output times is changed.
    rims : closures to read the rim's conditions as; one is enough where the cell stays a circle.
    """

    scene: str
    steps: int
    changes: Changes = ()
    label: str = "audit"
    rims: tuple[Closure, ...] = _MOVING

    def studies(self) -> tuple[Study, ...]:
        """Finite elements, finite volumes, and finite elements under the other readings."""
        scene = load_scene(self.scene)
        end = dict(self.changes).get("time.end", scene.time.end)
        published = scene.as_published
        dt = end / self.steps
        family = ((3, dt), (4, dt), (5, dt), (4, dt / 2), (4, dt / 4))
        own: Level | None = None
        if published.refine and published.dt:
            own = published.refine, published.dt
        brief = (4, dt), (5, dt), (4, dt / 2)
        reading = _reading(scene.physics.rheology, scene.physics.closure)
        return (
            Study(self.scene, self.label, reading, self.changes, FEM, family, own),
            Study(self.scene, self.label, reading, self.changes, FV, family),
            *(
                Study(self.scene, label, other, (*self.changes, *changes), FEM, brief)
                for label, other, changes in self._other_readings(scene)
            ),
        )

    def _other_readings(self, scene: Scene) -> list[tuple[str, str, Changes]]:
        """The ways to read rheology and rim other than the scene's own."""
        own = scene.physics.rheology, scene.physics.closure
        return [
            (
                f"{self.label}-{rheology}-{closure}",
                _reading(rheology, closure),
                (("model.rheology", str(rheology)), ("model.closure", str(closure))),
            )
            for rheology, closure in product(Rheology, self.rims)
            if (rheology, closure) != own
        ]


def _reading(rheology: Rheology, closure: Closure) -> str:
    return f"{rheology}, {closure}"


def simulation(key: str, case: Case, checks: Sequence[Check], because: str | Callable[[], str] = "") -> Row:
    """Return the row of one simulation; `because` says what is known of the reason beyond the numbers."""

    def examine(*evidence: Evidence) -> Finding:
        finding = _judged(checks, because() if callable(because) else because, *evidence)
        if not key.startswith("fig"):  # a sentence's cell is shown with its figure
            return finding
        fem, fv, *_ = evidence
        return replace(finding, exhibits=(_film(fem), *finding.exhibits, *_courses(fem, fv)))

    return Row(key, examine, case.studies)


def _judged(
    checks: Sequence[Check], because: str, fem: Evidence, fv: Evidence, *readings: Evidence
) -> Finding:
    own = fem.study.reading
    states = {
        own: [_worse(c.state(fem.limit(c.readout, c.t)), c.state(fv.limit(c.readout, c.t))) for c in checks]
    }
    states |= {
        reading.study.reading: [c.state(reading.limit(c.readout, c.t)) for c in checks]
        for reading in readings
    }
    giving = [name for name, found in states.items() if all(state == HOLDS for state in found)]
    if giving:
        judgement = Judgement.IN_KIND
        under = "; ".join(giving) if len(giving) < len(states) else f"all {len(states)} readings"
        reason = f"Every check holds beyond the numerical uncertainty under {under}."
    elif any(all(state != FAILS for state in found) for found in states.values()):
        judgement = Judgement.UNDECIDABLE
        reason = "No reading fails, but a check is closer to its bound than the numerical uncertainty."
    else:
        judgement = Judgement.NOT_REPRODUCED
        reason = "No reading of rheology and rim gives the picture: " + _lacking(checks, states)
    published = [_published(check, fem) for check in checks]
    if fem.study.published and published != states[own]:
        changed = [
            f"{check.words}: {there} there, {here} in the limit"
            for check, there, here in zip(checks, published, states[own], strict=True)
            if there != here
        ]
        reason += f" At the article's own mesh and step, {'; '.join(changed)}."
    failures = list(dict.fromkeys(message for e in (fem, fv, *readings) for message in e.failures))
    return Finding(
        judgement,
        "; ".join(_computed(check, fem, fv) for check in checks) + ".",
        " ".join(filter(None, [reason, because, *(f"Ended early: {message}." for message in failures[:3])])),
        (_sheet(checks, fem, fv, readings),),
        _numbers(checks, fem, fv),
    )


def _worse(one: str, other: str) -> str:
    return next(state for state in (FAILS, OPEN, HOLDS) if state in (one, other))


def _published(check: Check, fem: Evidence) -> str:
    return check.state(Limit(fem.at_published(check.readout, check.t), 0.0))


def _lacking(checks: Sequence[Check], states: dict[str, list[str]]) -> str:
    """Which checks fail, and under how many of the readings."""
    counts = {
        check.words: sum(found[i] == FAILS for found in states.values()) for i, check in enumerate(checks)
    }
    return "; ".join(f"“{w}” fails under {n} of {len(states)}" for w, n in counts.items() if n) + "."


def _computed(check: Check, fem: Evidence, fv: Evidence) -> str:
    both = (fem.limit(check.readout, check.t), fv.limit(check.readout, check.t))
    text = f"{check.words} ({check.interval}): FEM {both[0]}, FV {both[1]}"
    if fem.study.published:
        text += f", {fem.at_published(check.readout, check.t):.4g} as published"
    return text


def _numbers(checks: Sequence[Check], fem: Evidence, fv: Evidence) -> dict[str, float]:
    numbers = {}
    for check in checks:
        for code, evidence in (("FEM", fem), ("FV", fv)):
            found = evidence.limit(check.readout, check.t)
            numbers[f"{check.words} | {code}"] = found.value
            numbers[f"{check.words} | {code} uncertainty"] = found.uncertainty
        numbers[f"{check.words} | as published"] = fem.at_published(check.readout, check.t)
    return numbers


def _sheet(checks: Sequence[Check], fem: Evidence, fv: Evidence, readings: Sequence[Evidence]) -> Sheet:
    """Checks down, resolutions and readings across; each cell a value and whether it holds."""
    codes = ("FEM", "FV", *("FEM" for _ in readings))
    limits = [f"{code}: {e.study.reading}" for code, e in zip(codes, (fem, fv, *readings), strict=True)]
    rows = [("what the article says", "asked", "article's mesh and step", *limits)]
    for check in checks:
        found = [evidence.limit(check.readout, check.t) for evidence in (fem, fv, *readings)]
        cells = (f"{limit} {check.state(limit)}" for limit in found)
        shown = "not printed"
        if fem.study.published:
            shown = f"{fem.at_published(check.readout, check.t):.4g} {_published(check, fem)}"
        rows.append((f"{check.words}, t = {check.t:g}", check.interval, shown, *cells))
    note = "Extrapolated to h = Δt = 0; ± is the largest change when one run is left out."
    return Sheet("checks", "What the article says, checked", note, tuple(rows))


def _film(fem: Evidence) -> Shots:
    run = fem.finest
    shots = tuple(
        Shot(f"t = {t:.4g}", run.points[i], run.triangles, run.a_cells[i]) for i, t in enumerate(run.times)
    )
    return Shots("film", "The cell", f"Cell means of a; FEM, {run.xi.shape[1]} nodes", shots)


def _courses(fem: Evidence, fv: Evidence) -> list[Plot]:
    """Area and polarity over time: the article's resolution, finest runs of both codes."""
    runs: list[tuple[str, Run]] = [("FEM, finest", fem.finest), ("FV, finest", fv.finest)]
    if fem.study.published:
        runs.insert(0, ("FEM, as published", fem.runs[fem.study.published]))
    return [
        Plot(
            name,
            title,
            "",
            "t",
            tuple(Line(label, run.series["time"], np.asarray(run.series[name])) for label, run in runs),
        )
        for name, title in (("area", "Area"), ("polarity", "Index of polarity"))
    ]
