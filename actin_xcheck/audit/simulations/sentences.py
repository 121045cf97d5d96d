"""Sentences of Sections 5.4, 6 and 7 about simulations, one row each."""

from dataclasses import replace

import numpy as np

from actin_xcheck.audit.row import Finding, Judgement, Row
from actin_xcheck.audit.simulations import cases
from actin_xcheck.audit.simulations.checks import Check, Evidence, simulation
from actin_xcheck.audit.simulations.figures import UNIFORM, VISIBLE
from actin_xcheck.audit.simulations.readouts import (
    area_change,
    front_height,
    fronts,
    highest_at,
    nonuniformity,
    rim_agreement,
    rim_excess,
    unevenness,
)
from actin_xcheck.audit.simulations.studies import FEM, Study
from actin_xcheck.model import Delta, Rheology
from actin_xcheck.prediction import active_slope, k2_crit, threshold
from actin_xcheck.scene import load_scene

_FAILING = load_scene("sec54-failure")
_GROWTH = active_slope(replace(_FAILING.physics, delta=Delta.NONE)) / _FAILING.parameters.mu
"""f'/mu, the rate at which short waves grow there (3.6); diffusion cuts it off at k_crit only."""


def _fails(published: Evidence, kept: Evidence, resolved: Evidence) -> Finding:
    """Section 5.4's failure: what ends the run as published, and what a resolved step does."""
    ends = [
        f"{evidence.study.reading}, Δt = {dt:g}: {run.attributes['outcome']}"
        + (f" ({run.attributes['message']})" if run.attributes["message"] else "")
        for evidence in (published, kept, resolved)
        for (_, dt), run in evidence.runs.items()
    ]
    (level,) = published.runs
    (fine,) = resolved.runs
    as_published, small = (e.runs[level] for e, level in ((published, level), (resolved, fine)))
    broke = as_published.attributes["outcome"] != "completed"
    numbers = {
        "growth per step as published": _GROWTH * level[1],
        "area change at the end as published": float(np.ptp(as_published.series["area"])),
        "largest a as published": float(as_published.series["a_max"].max()),
        "largest a, resolved step": float(small.series["a_max"].max()),
    }
    return Finding(
        Judgement.IN_KIND if broke else Judgement.NOT_REPRODUCED,
        "; ".join(ends) + f". A step of {level[1]:g} lets f'/μ = {_GROWTH:.0f} act for "
        f"{_GROWTH * level[1]:.1f} units; the largest a is then {numbers['largest a as published']:.3g}.",
        (
            "The run ends as the article says. "
            if broke
            else "The scheme runs on to its end instead of failing. "
        )
        + "With that step no growth of this model is resolved: what ends, or does not, is the scheme. Under "
        "the viscoelastic reading the model itself ends where 1 + φ reaches 0.",
        numbers=numbers,
    )


def _failure() -> Row:
    dt = _FAILING.as_published.dt or 0.0
    refine = _FAILING.as_published.refine or 6
    short = 1e-3  # seven e-foldings of f'/mu
    kept = (("model.rheology", str(Rheology.VISCOELASTIC)),)
    brief = (("time.end", short), ("time.outputs", (short,)))
    reading = str(Rheology.VISCOUS)
    studies = (
        Study(_FAILING.name, "audit", reading, (), FEM, ((refine, dt),)),
        Study(_FAILING.name, "kept", str(Rheology.VISCOELASTIC), kept, FEM, ((refine, dt),)),
        Study(_FAILING.name, "brief", reading, brief, FEM, ((5, short / 100),)),
    )
    return Row(
        "s5.4-failure",
        "Section 5.4",
        "At ψ = 1.04e5 the cell deforms non-uniformly and rapidly and the numerical algorithm fails.",
        _fails,
        studies,
    )


def _tonicity_sets_the_transition() -> Finding:
    """Remark 5.1 and Section 7: psi is the bifurcation parameter."""
    cell = replace(load_scene("fig14-four-fronts").physics, delta=Delta.NONE)
    found = threshold(cell, 0)
    rest = threshold(replace(cell, parameters=replace(cell.parameters, p=0.0)), 0)
    holds = found.psi is not None and rest.psi is not None
    return Finding(
        Judgement.REPRODUCED if holds else Judgement.NOT_REPRODUCED,
        f"The moving cell's first mode (m = 0) grows for ψ > {found.psi:.3f} at p = 0.26 and "
        f"ψ > {rest.psi:.3f} at p = 0, both as {found.crossing}s; no mode grows at ψ = 0.",
        "The steady state loses stability as ψ grows, and p moves the threshold. Its value is not the "
        "article's 62.4, which belongs to a static wall.",
        numbers={"psi* at p = 0.26": found.psi or np.nan, "psi* at p = 0": rest.psi or np.nan},
    )


def _realistic(*evidence: Evidence) -> Finding:
    """Section 6: four fronts, on meshes that cannot resolve what is unstable."""
    (study,) = evidence
    cell = load_scene("sec6-realistic").physics
    k_crit = np.sqrt(k2_crit(replace(cell, delta=Delta.NONE)))
    end = study.finest.times[-1]
    heights = {level: front_height(4)(run, end) for level, run in study.runs.items()}
    counts = {level: fronts(run, end) for level, run in study.runs.items()}
    four = all(count == 4 for count in counts.values())
    spread = max(heights.values()) - min(heights.values())
    return Finding(
        Judgement.IN_KIND if four else Judgement.NOT_REPRODUCED,
        f"At t = {end:g} the strongest harmonic of the rim is "
        + ", ".join(f"{counts[level]:.0f} on mesh {level[0]}" for level in counts)
        + f"; the fourth is {min(heights.values()):.3g} to {max(heights.values()):.3g} of the radius.",
        f"Four fronts are in the initial condition. k_crit = {k_crit:.0f}: the shortest unstable wave is "
        f"{2 * np.pi / k_crit:.3g} radii long, no mesh here resolves it, and the fronts' height changes by "
        f"{spread / max(heights.values()):.0%} between meshes: their number can be judged, not their size.",
        numbers={f"fourth harmonic, mesh {level[0]}, dt {level[1]:g}": h for level, h in heights.items()},
    )


def _row_of_realistic() -> Row:
    case = cases.REALISTIC.studies()[0]
    study = replace(case, levels=((4, 0.02), (5, 0.02), (5, 0.01)), published=None)
    return Row(
        "s6-fronts",
        "Section 6",
        "With the realistic parameters the result is protrusion on four fronts, similar to Fig. 14.",
        _realistic,
        (study,),
    )


def _uniform(end: float) -> list[Check]:
    return [Check("uniform: rim's deviation from a circle", unevenness, end, high=UNIFORM)]


SENTENCES_SIMULATED: tuple[Row, ...] = (
    *(
        simulation(
            f"s5.4-uniform-p-{dict(case.changes)['parameters.p']:g}",
            "Section 5.4",
            "At ψ = 38.24, with p lowered from 1.75 to 0, a stays what w0,1 predicts: uniform; here "
            f"p = {dict(case.changes)['parameters.p']:g}.",
            case,
            [Check("a is uniform: its spread over its mean", nonuniformity, 0.0361, high=UNIFORM)],
        )
        for case in cases.DOWN_IN_P
    ),
    simulation(
        "s5.4-p3",
        "Section 5.4",
        "At p = 3.0 (ψ = 62.4) the deformations are those of w0,1: uniform expansion.",
        cases.STRONG_PRESSURE,
        [Check("expands: area change", area_change, 0.0361, low=0), *_uniform(0.0361)],
    ),
    simulation(
        "s5.4-weak-pressure",
        "Section 5.4",
        "(ψ, p) = (70.366, 0.026) gives uniform expansion.",
        cases.WEAK_PRESSURE,
        [Check("expands: area change", area_change, 0.0361, low=0), *_uniform(0.0361)],
    ),
    simulation(
        "s5.4-not-shown",
        "Section 5.4, results not shown",
        "(ψ, p) = (3.033e4, 0.026) gives non-uniform deformation.",
        cases.NOT_SHOWN,
        [
            Check(
                "non-uniform: rim's deviation from a circle",
                unevenness,
                cases.NOT_SHOWN_END,
                low=UNIFORM,
            )
        ],
        "f'/μ = 2121: beyond t = 0.014 round-off has grown to order 1, so the run ends there.",
    ),
    _failure(),
    Row(
        "s5-remark5.1",
        "Remark 5.1, Section 7",
        "The contractile tonicity is the bifurcation parameter that takes the steady state to instability.",
        _tonicity_sets_the_transition,
    ),
    _row_of_realistic(),
    simulation(
        "s7-regions",
        "Section 7",
        "Regions with high actin are those with large deformation (shown on Fig. 14's cell).",
        cases.FIG14,
        [Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.1636, low=0.5)],
    ),
    simulation(
        "s7-expansion",
        "Section 7",
        "Where the cell expands, actin is highest around its periphery (shown on Fig. 16's cell).",
        cases.FIG16,
        [
            Check("expands: area change", area_change, 0.518, low=0),
            Check("a is higher on the rim than in the centre: ratio less 1", rim_excess, 0.518, low=0),
        ],
        "The ring expands most, which dilutes it: dilution is stronger there than in the middle.",
    ),
    simulation(
        "s7-contraction",
        "Section 7",
        "Where the cell contracts, actin is highest around its centroid (shown on Fig. 17's cell).",
        cases.FIG17,
        [
            Check("contracts: area change", area_change, 0.518, high=0),
            Check("highest a started at the centre: its radius", highest_at, 0.518, high=0.1),
        ],
    ),
    simulation(
        "s7-counter-pressure",
        "Section 7",
        "An adequate counter pressure is required to prevent shrinking (here p = 0, ψ = 70.366).",
        cases.NO_PRESSURE,
        [Check("shrinks without pressure: area change", area_change, 0.0361, high=0)],
        "A uniform a exerts no force whatever ψ is: without pressure the cell keeps its size but for the "
        "1e-3 of its perturbation.",
    ),
    simulation(
        "s7-curvature",
        "Section 7",
        "For non-uniform deformations actin is predominant at the periphery (shown on Fig. 19's cell).",
        cases.FIG19,
        [
            Check("non-uniform: rim's deviation from a circle", unevenness, 0.0722, low=VISIBLE),
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.0722, low=0),
        ],
    ),
)
