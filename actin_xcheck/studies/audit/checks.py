"""From the article's words about a simulation to a verdict: intervals, two codes, several readings.

The article shows pictures and says what is seen on them.  Each such sentence becomes a `Check`: a readout
that must lie in an interval.  It holds, fails or stays open by more than the numerical uncertainty, for both
codes, in the limit of fine meshes and small steps, at the article's own resolution, and under every reading
of what the article leaves ambiguous.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Self

import numpy as np

from actin_xcheck.core.model import Delta
from actin_xcheck.report.exhibits import Line, Plot, Sheet, Shot, Shots
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit import (
    AuditRow,
    Finding,
    Judgement,
    RowAnswer,
    answer,
    answered,
    article,
    examined,
    examines,
    readouts,
)
from actin_xcheck.studies.audit.readouts import Readout, pattern
from actin_xcheck.studies.audit.runs import Evidence, Limit, RunCell, RunFamily, time_of
from actin_xcheck.theory.dispersion import Mode, active_slope, k2_crit
from actin_xcheck.theory.exact import Threshold, threshold
from actin_xcheck.theory.growth import amplitude_at_rest

HOLDS, FAILS, OPEN = "holds", "fails", "open"


@dataclass(frozen=True)
class RowCheck:
    """A sentence of the article: a readout at an output time that must lie between two numbers."""

    words: str
    readout: Readout
    t: float
    low: float = -math.inf
    high: float = math.inf

    @classmethod
    def of(cls, said: Mapping[str, Any]) -> Self:
        """The check that `article.toml` says; `of` is what is asked of a readout that takes it."""
        readout, asked = getattr(readouts, said["reads"]), dict(said.get("of", {}))
        if "pattern" in asked:
            asked["field"] = pattern(asked.pop("pattern"), asked.pop("turned", 0.0))
        bounds = {bound: said[bound] for bound in ("low", "high") if bound in said}
        return cls(said["says"], readout(**asked) if asked else readout, time_of(said["t"]), **bounds)

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


def row_of(key: str) -> AuditRow:
    """Return the row of this key: what simulates it and how it is examined stands in `article.toml`."""
    said = article()[key]
    if "checks" in said:
        return AuditRow(key, partial(_simulated, key), RunCell.named(said["cell"]).families)
    return AuditRow(key, partial(examined, key), partial(_by_finite_elements, said.get("cells", ())))


def _by_finite_elements(names: Sequence[str]) -> tuple[RunFamily, ...]:
    return tuple(RunCell.named(name).families()[0] for name in names)


def _simulated(key: str, *evidence: Evidence) -> Finding:
    """The finding on one simulation; `because` says what is known of the reason beyond the numbers."""
    said = article()[key]
    because = said.get("because", "").format(**answered(key).values)
    finding = judged(list(map(RowCheck.of, said["checks"])), because, *evidence)
    if not key.startswith("fig"):  # a sentence's cell is shown with its figure
        return finding
    fem, fv, *_ = evidence
    return replace(finding, exhibits=(_film(fem), *finding.exhibits, *_courses(fem, fv)))


def judged(
    checks: Sequence[RowCheck], because: str, fem: Evidence, fv: Evidence, *readings: Evidence
) -> Finding:
    """Return the finding that checks of one cell come to."""
    own = fem.family.reading
    states = {
        own: [_worse(c.state(fem.limit(c.readout, c.t)), c.state(fv.limit(c.readout, c.t))) for c in checks]
    }
    states |= {
        reading.family.reading: [c.state(reading.limit(c.readout, c.t)) for c in checks]
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
    if fem.family.published and published != states[own]:
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


def _published(check: RowCheck, fem: Evidence) -> str:
    return check.state(Limit(fem.at_published(check.readout, check.t), 0.0))


def _lacking(checks: Sequence[RowCheck], states: dict[str, list[str]]) -> str:
    """Which checks fail, and under how many of the readings."""
    counts = {
        check.words: sum(found[i] == FAILS for found in states.values()) for i, check in enumerate(checks)
    }
    return "; ".join(f"“{w}” fails under {n} of {len(states)}" for w, n in counts.items() if n) + "."


def _computed(check: RowCheck, fem: Evidence, fv: Evidence) -> str:
    both = (fem.limit(check.readout, check.t), fv.limit(check.readout, check.t))
    text = f"{check.words} ({check.interval}): FEM {both[0]}, FV {both[1]}"
    if fem.family.published:
        text += f", {fem.at_published(check.readout, check.t):.4g} as published"
    return text


def _numbers(checks: Sequence[RowCheck], fem: Evidence, fv: Evidence) -> dict[str, float]:
    numbers = {}
    for check in checks:
        for code, evidence in (("FEM", fem), ("FV", fv)):
            found = evidence.limit(check.readout, check.t)
            numbers[f"{check.words} | {code}"] = found.value
            numbers[f"{check.words} | {code} uncertainty"] = found.uncertainty
        numbers[f"{check.words} | as published"] = fem.at_published(check.readout, check.t)
    return numbers


def _sheet(checks: Sequence[RowCheck], fem: Evidence, fv: Evidence, readings: Sequence[Evidence]) -> Sheet:
    """Checks down, resolutions and readings across; each cell a value and whether it holds."""
    codes = ("FEM", "FV", *("FEM" for _ in readings))
    limits = [f"{code}: {e.family.reading}" for code, e in zip(codes, (fem, fv, *readings), strict=True)]
    rows = [("what the article says", "asked", "article's mesh and step", *limits)]
    for check in checks:
        found = [evidence.limit(check.readout, check.t) for evidence in (fem, fv, *readings)]
        cells = (f"{limit} {check.state(limit)}" for limit in found)
        shown = "not printed"
        if fem.family.published:
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
    if fem.family.published:
        runs.insert(0, ("FEM, as published", fem.runs[fem.family.published]))
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


@examines("s5.1-validation")
def _on_the_wall() -> RowAnswer:
    """What w1,1 would do by the linear theory of the static wall (3.6), started at rest."""
    near = replace(load_scene("fig06-mode-11").physics, delta=Delta.NONE)
    return answer(True, growth=float(amplitude_at_rest(near, Mode(1, 1), 1.7183)))


@examines("s5.4-failure")
def _fails(*evidence: Evidence) -> RowAnswer:
    """What ends the run as published, and what ends it where growth is resolved."""
    runs = [(one, dt, run) for one in evidence for (_, dt), run in one.runs.items()]
    ends = [
        f"{one.family.reading.split(',')[0]}, Δt = {dt:g}: {run.attributes['outcome']}"
        + (f" ({run.attributes['message']})" if run.attributes["message"] else "")
        for one, dt, run in runs
    ]
    scene = load_scene(evidence[0].family.scene)
    # f'/mu, the rate at which short waves grow there (3.6); diffusion cuts it off at k_crit only
    growth = active_slope(replace(scene.physics, delta=Delta.NONE)) / scene.parameters.mu
    (_, step, published), *others = runs
    _, fine, resolved = next(one for one in others if one[1] < step)  # the same reading comes first
    survives = resolved.attributes["outcome"] == "completed"
    return answer(
        published.attributes["outcome"] != "completed",
        ends="; ".join(ends),
        step=step,
        growth=growth,
        per_step=growth * step,
        finer=step / fine,
        then="passes that time, so what fails is the scheme" if survives else "ends too",
        end=published.series["time"][-1],
        largest=published.series["a_max"].max(),
        largest_resolved=resolved.series["a_max"].max(),
    )


def _thresholds(*changes: dict[str, float]) -> list[Threshold]:
    """The thresholds in psi (m = 0) of Fig. 14's cell, delta = 0, with other parameters."""
    cell = replace(load_scene("fig14-four-fronts").physics, delta=Delta.NONE)
    return [threshold(cell.varied(**one), 0) for one in changes]


@examines("s5-remark5.1")
def _tonicity_sets_the_transition() -> RowAnswer:
    found = _thresholds({}, {"p": 0.0})
    return answer(all(one.psi is not None for one in found), found=found)


@examines("s5-remark5.1-others")
def _other_parameters(at: list[dict[str, float]]) -> RowAnswer:
    """How a_sat and p move the threshold, from that of the first."""
    psi = [one.psi or math.nan for one in _thresholds(*at)]
    moved = all(abs(one / psi[0] - 1) > 0.01 for one in psi[1:])
    names = (", ".join(f"{name} = {value:g}" for name, value in one.items()) for one in at)
    return answer(moved, psi=dict(zip(names, psi, strict=True)))


@examines("s6-fronts")
def _realistic(evidence: Evidence) -> RowAnswer:
    """Four fronts, on meshes that cannot resolve what is unstable."""
    k_crit = np.sqrt(k2_crit(replace(load_scene(evidence.family.scene).physics, delta=Delta.NONE)))
    end = evidence.finest.times[-1]
    heights = {
        f"mesh {refine}, dt {dt:g}": readouts.front_height(4)(run, end)
        for (refine, dt), run in evidence.runs.items()
    }
    counts = [(refine, readouts.fronts(run, end)) for (refine, _), run in evidence.runs.items()]
    least, largest = min(heights.values()), max(heights.values())
    return answer(
        all(count == 4 for _, count in counts),
        end=end,
        counts=", ".join(f"{count:.0f} on mesh {refine}" for refine, count in counts),
        least=least,
        largest=largest,
        k_crit=k_crit,
        shortest=2 * np.pi / k_crit,
        spread=(largest - least) / largest,
        heights=heights,
    )


@examines("s6-bias")
def _bias(evidence: Evidence) -> RowAnswer:
    """What |sin x sin y| contains, and what is left of it."""
    modes = Mode(4, 1), Mode(2, 1), Mode(1, 1), Mode(3, 1)
    shares = {str(mode): readouts.mode_share(mode.value, mode.m)(evidence.finest, 0.0) for mode in modes}
    wanted, *others = shares.values()
    return answer(wanted > 0.5 and max(others) < 1e-9, shares=shares)


@examines("s5.4-kinds")
def _all_kinds(expanding: Evidence, contracting: Evidence, uneven: Evidence) -> RowAnswer:
    grown, shrunk = (one.limit(readouts.area_change, 0.0361) for one in (expanding, contracting))
    rim = uneven.limit(readouts.unevenness, 0.0722)
    kinds = grown.value > grown.uncertainty, -shrunk.value > shrunk.uncertainty, rim.value > 0.01
    return answer(all(kinds), grown=grown, shrunk=shrunk, rim=rim)


@examines("s5.3-phase", "s7-converse")
def _displacements_follow_actin(*evidence: Evidence, either: bool) -> RowAnswer:
    """Correlation of a with |u| on several cells: all high, or (`either`) all of large size."""
    found = {
        f"{one.family.scene}, t = {t:g}": one.limit(readouts.displacement_agreement, t)
        for one in evidence
        for t in load_scene(one.family.scene).output_times[-2:]
    }
    sizes = [abs(limit.value) if either else limit.value for limit in found.values()]
    return answer(all(size > 0.5 for size in sizes), found=found)


@examines("s5.3-polarity")
def _polarities(*evidence: Evidence) -> RowAnswer:
    """The index of polarity at the end of each simulation."""
    ends = [(one, load_scene(one.family.scene).time.end) for one in evidence]
    return answer(
        True, found={f"{one.family.scene}, t = {t:g}": one.limit(readouts.polarity, t) for one, t in ends}
    )
