"""Findings about simulations that are no intervals: failures, initial conditions, several cases at once."""

from dataclasses import replace

import numpy as np

from actin_xcheck.core.model import Delta
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit.row import Finding, Judgement
from actin_xcheck.studies.audit.simulations.patterns import UNIFORM, W11, W21, W31, W41
from actin_xcheck.studies.audit.simulations.readouts import (
    area_change,
    displacement_agreement,
    front_height,
    fronts,
    mode_share,
    polarity,
    unevenness,
)
from actin_xcheck.studies.audit.simulations.studies import Evidence
from actin_xcheck.theory.dispersion import active_slope, k2_crit
from actin_xcheck.theory.threshold import threshold

FAILING = "sec54-failure"
"""The scene of Section 5.4's failure."""


def fails(*evidence: Evidence) -> Finding:
    """Section 5.4's failure: what ends the run as published, and what ends it where growth is resolved."""
    ends = [
        f"{one.study.reading}, Δt = {dt:g}: {run.attributes['outcome']}"
        + (f" ({run.attributes['message']})" if run.attributes["message"] else "")
        for one in evidence
        for (_, dt), run in one.runs.items()
    ]
    scene = load_scene(FAILING)
    # f'/mu, the rate at which short waves grow there (3.6); diffusion cuts it off at k_crit only
    growth = active_slope(replace(scene.physics, delta=Delta.NONE)) / scene.parameters.mu
    published, *others = (run for one in evidence for run in one.runs.values())
    step = float(published.attributes["dt"])
    broke = published.attributes["outcome"] != "completed"
    resolved = next(run for run in others if run.attributes["dt"] < step)  # the same reading comes first
    survives = resolved.attributes["outcome"] == "completed"
    return Finding(
        Judgement.IN_KIND if broke else Judgement.NOT_REPRODUCED,
        "; ".join(ends) + ".",
        f"A step of {step:g} lets f'/μ = {growth:.0f} act for {growth * step:.1f} units at once, which no "
        "explicit load resolves. "
        + ("The run ends as the article says" if broke else "The scheme runs on instead of failing")
        + f"; with {step / resolved.attributes['dt']:.0f} times smaller steps the same reading "
        + ("passes that time, so what fails is the scheme." if survives else "ends too."),
        numbers={
            "growth per step as published": growth * step,
            "end as published": float(published.series["time"][-1]),
            "largest a as published": float(published.series["a_max"].max()),
            "largest a, resolved step": float(resolved.series["a_max"].max()),
        },
    )


def tonicity_sets_the_transition() -> Finding:
    """Remark 5.1 and Section 7: psi is the bifurcation parameter."""
    cell = replace(load_scene("fig14-four-fronts").physics, delta=Delta.NONE)
    found = threshold(cell, 0)
    rest = threshold(cell.varied(p=0.0), 0)
    holds = found.psi is not None and rest.psi is not None
    return Finding(
        Judgement.REPRODUCED if holds else Judgement.NOT_REPRODUCED,
        f"The moving cell's first mode (m = 0) grows for ψ > {found.psi:.3f} at p = 0.26 and "
        f"ψ > {rest.psi:.3f} at p = 0, both as {found.crossing}s; no mode grows at ψ = 0.",
        "The steady state loses stability as ψ grows, and p moves the threshold. Its value is not the "
        "article's 62.4, which belongs to a static wall.",
        numbers={"psi* at p = 0.26": found.psi or np.nan, "psi* at p = 0": rest.psi or np.nan},
    )


def realistic(*evidence: Evidence) -> Finding:
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


def observations() -> Finding:
    """Section 7: agreement with experiments that are cited."""
    return Finding(
        Judgement.UNDECIDABLE,
        "The experiments are cited, not tabulated: there is no number to compare with.",
        "Agreement with photographs of other cells is a matter of the eye.",
    )


def bias(evidence: Evidence) -> Finding:
    """Section 6: what |sin x sin y| contains, and what is left of it."""
    run = evidence.finest
    modes = {"w4,1": (W41, 4), "w2,1": (W21, 2), "w1,1": (W11, 1), "w3,1": (W31, 3)}
    shares = {name: mode_share(field, m)(run, 0.0) for name, (field, m) in modes.items()}
    others = max(share for name, share in shares.items() if name != "w4,1")
    return Finding(
        Judgement.REPRODUCED if shares["w4,1"] > 0.5 and others < 1e-9 else Judgement.NOT_REPRODUCED,
        "Correlation of the initial a with "
        + ", ".join(f"{name} {s:.2g}" for name, s in shares.items())
        + ".",
        "|sin x sin y| is even in x and y and unchanged by a quarter turn: of these it can hold w4,1 only.",
        numbers=shares,
    )


def all_kinds(expanding: Evidence, contracting: Evidence, uneven: Evidence) -> Finding:
    """Sections 5.4 and 7: the three kinds of deformation."""
    grown, shrunk = (e.limit(area_change, 0.0361) for e in (expanding, contracting))
    rim = uneven.limit(unevenness, 0.0722)
    kinds = (grown.value > grown.uncertainty, -shrunk.value > shrunk.uncertainty, rim.value > UNIFORM)
    return Finding(
        Judgement.IN_KIND if all(kinds) else Judgement.NOT_REPRODUCED,
        f"At t = 0.0361 the area changes by {grown} (p = 0.433) and {shrunk} (p = -0.433) at "
        f"ψ = 70.366; the rim deviates from a circle by {rim} at ψ = 7.8e3, p = 0.026, t = 0.0722.",
        "The signs of p and the size of ψ select the kind: "
        + ", ".join(
            f"{name} {'occurs' if kind else 'does not occur'}"
            for name, kind in zip(
                ("uniform expansion", "uniform contraction", "non-uniform deformation"), kinds, strict=True
            )
        )
        + ".",
        numbers={"expansion": grown.value, "contraction": shrunk.value, "unevenness": rim.value},
    )


def displacements_follow_actin(either: bool, *evidence: Evidence) -> Finding:
    """Correlation of a with |u| on several cells: all high, or (`either`) all of large size."""
    found = {
        f"{e.study.scene}, t = {t:g}": e.limit(displacement_agreement, t)
        for e in evidence
        for t in load_scene(e.study.scene).output_times[-2:]
    }
    sizes = [abs(limit.value) if either else limit.value for limit in found.values()]
    together = all(size > 0.5 for size in sizes)
    return Finding(
        Judgement.IN_KIND if together else Judgement.NOT_REPRODUCED,
        "Correlation of a with |u|: " + ", ".join(f"{name} {limit}" for name, limit in found.items()) + ".",
        "Asked is " + ("more than 0.5 in size" if either else "more than 0.5") + " on each of these cells. "
        "Where the cell contracts towards its middle the displacement is largest where actin is lowest.",
        numbers={name: limit.value for name, limit in found.items()},
    )


def polarities(*evidence: Evidence) -> Finding:
    """The index of polarity at the end of six simulations."""
    ends = {e.study.scene: (load_scene(e.study.scene).time.end, e) for e in evidence}
    found = {f"{name}, t = {t:g}": e.limit(polarity, t) for name, (t, e) in ends.items()}
    return Finding(
        Judgement.UNDECIDABLE,
        ", ".join(f"{name}: {limit}" for name, limit in found.items()) + ".",
        "The article prints curves without numbers; these are the values at the ends of the runs, to be held "
        "against the pictures by eye.",
        numbers={name: limit.value for name, limit in found.items()},
    )


def other_parameters() -> Finding:
    """Remark 5.1: a_sat and p move the threshold."""
    cell = replace(load_scene("fig14-four-fronts").physics, delta=Delta.NONE)
    found = {
        f"a_sat = {a_sat:g}, p = {p:g}": threshold(cell.varied(a_sat=a_sat, p=p), 0).psi or np.nan
        for a_sat, p in ((1.4, 0.26), (1.1, 0.26), (0.6, 0.26), (1.4, 1.0))
    }
    base = found["a_sat = 1.4, p = 0.26"]
    moved = all(abs(psi / base - 1) > 0.01 for name, psi in found.items() if psi != base)
    return Finding(
        Judgement.REPRODUCED if moved else Judgement.NOT_REPRODUCED,
        "The cell's threshold ψ* (m = 0) is "
        + ", ".join(f"{psi:.2f} for {name}" for name, psi in found.items())
        + ".",
        "a_sat enters through σ'(1) (3.9) and p through the stiffness 1 + ν' - p.",
        numbers=found,
    )
