"""Sentences of Sections 5.4, 6 and 7 about simulations, one row each."""

from dataclasses import replace
from functools import partial

from actin_xcheck.core.model import Delta, Rheology
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit.row import Row
from actin_xcheck.studies.audit.simulations import cases
from actin_xcheck.studies.audit.simulations.checks import Check, simulation
from actin_xcheck.studies.audit.simulations.findings import (
    FAILING,
    all_kinds,
    bias,
    displacements_follow_actin,
    fails,
    observations,
    other_parameters,
    polarities,
    realistic,
    tonicity_sets_the_transition,
)
from actin_xcheck.studies.audit.simulations.patterns import UNIFORM, VISIBLE, W11, WAYWARD
from actin_xcheck.studies.audit.simulations.readouts import (
    area_change,
    curvature_agreement,
    displacement_over_contrast,
    growth_of,
    highest_at,
    nonuniformity,
    rim_agreement,
    rim_excess,
    unevenness,
    waywardness,
)
from actin_xcheck.studies.audit.simulations.studies import FEM, Study
from actin_xcheck.theory import Mode, amplitude_at_rest

_NEAR = replace(load_scene("fig06-mode-11").physics, delta=Delta.NONE)
_WALL_GROWTH = float(amplitude_at_rest(_NEAR, Mode(1, 1), 1.7183))

SEVERAL = tuple(case.studies()[0] for case in (cases.FIG12, cases.FIG13, cases.FIG14, cases.FIG17))
POLAR = tuple(
    case.studies()[0]
    for case in (cases.FIG06, cases.FIG11, cases.FIG12, cases.FIG13, cases.FIG18, cases.FIG19)
)


def _failure() -> Row:
    published = FAILING.as_published
    assert published.refine is not None
    assert published.dt is not None
    as_published, resolved = (published.refine, published.dt), (5, 1e-5)
    brief = (("time.end", 4e-3), ("time.outputs", (1e-3, 4e-3)))  # before round-off has grown to order 1
    kept = (("model.rheology", str(Rheology.VISCOELASTIC)),)
    viscous, viscoelastic = str(Rheology.VISCOUS), str(Rheology.VISCOELASTIC)
    return Row(
        "s5.4-failure",
        "Section 5.4",
        "At ψ = 1.04e5 the cell deforms non-uniformly and rapidly and the numerical algorithm fails.",
        fails,
        (
            Study(FAILING.name, "audit", viscous, (), FEM, (as_published,)),
            Study(FAILING.name, "brief", viscous, brief, FEM, (resolved,)),
            Study(FAILING.name, "kept", viscoelastic, kept, FEM, (as_published,)),
            Study(FAILING.name, "kept-brief", viscoelastic, (*kept, *brief), FEM, (resolved,)),
        ),
    )


def _rows_of_realistic() -> tuple[Row, ...]:
    case = cases.REALISTIC.studies()[0]
    study = replace(case, levels=((4, 0.02), (5, 0.02), (5, 0.01)), published=None)
    return (
        Row(
            "s6-bias",
            "Section 6",
            "The perturbation |rnd sin x sin y| biases the excitation of w4,1.",
            bias,
            (study,),
        ),
        Row(
            "s6-fronts",
            "Section 6",
            "With the realistic parameters the result is protrusion on four fronts, similar to Fig. 14.",
            realistic,
            (study,),
        ),
    )


def _uniform(end: float) -> list[Check]:
    return [Check("uniform: deviation over mean motion", waywardness, end, high=WAYWARD)]


SENTENCES_SIMULATED: tuple[Row, ...] = (
    simulation(
        "s5-domain",
        "Section 5",
        "At 0 < t_s << 1 the domain's evolution is negligible (here after the four steps of Fig. 6).",
        cases.FIG06,
        [Check("area change", area_change, 4 * cases.PAPER_DT, -0.01, 0.01)],
    ),
    simulation(
        "s5.1-validation",
        "Sections 3.3 and 5.1",
        "Near the bifurcation point (ψ = 62.4) the numerical results are consistent with linear theory, by "
        "which w1,1 grows.",
        cases.FIG06,
        [Check("w1,1 grows: amplitude over the initial one", growth_of(W11), 1.7183, low=1)],
        f"By linear theory on the static wall (3.6), started at rest, it would be {_WALL_GROWTH:.1f} "
        "times the initial one. The article compares shapes after two to four steps, which are those of its "
        "initial condition; a growth rate tells the theories apart.",
    ),
    simulation(
        "s5.2-small-u",
        "Section 5.2.1",
        "The displacements are small, with small amplitudes compared with those of a (Fig. 9b's cell).",
        cases.FIG14,
        [
            Check(
                "largest |u| over the spread of a",
                displacement_over_contrast,
                cases.FIFTEEN_FINE,
                high=1,
            )
        ],
    ),
    Row(
        "s5.3-phase",
        "Section 5.3",
        "Plots of the displacement are either in or out of phase with those of a.",
        partial(displacements_follow_actin, True),
        SEVERAL,
    ),
    Row(
        "s5.3-polarity",
        "Figs. 10e, 11e, 12d, 13d, 18e, 19g",
        "The index of polarity, short over long axis of the smallest ellipse around the cell, over time.",
        polarities,
        POLAR,
    ),
    simulation(
        "s5.4-hopf",
        "Section 5.4",
        "In the Hopf region close to the oscillatory one a stays uniform, w0,1 (here ψ = 34, p = 0.26).",
        cases.HOPF,
        [Check("a is uniform: its spread over its mean", nonuniformity, cases.LONG_END, high=UNIFORM)],
    ),
    simulation(
        "s5.4-hopf-inside",
        "Section 5.4, results not shown",
        "With an oscillatory instability near the rim and a Hopf instability inside, a is that of w0,1 (here "
        "ψ = 34.8, p = 0.8, where b of w1,1 changes its sign with δ).",
        cases.HOPF_INSIDE,
        [Check("a is uniform: its spread over its mean", nonuniformity, cases.LONG_END, high=UNIFORM)],
    ),
    simulation(
        "s5.4-raise-psi",
        "Section 5.4",
        "With Table 2 otherwise, raising ψ makes deformations non-uniform (here ψ = 7.8e3, p = 0.26).",
        cases.RAISED,
        [Check("non-uniform: rim's deviation from a circle", unevenness, cases.LOCALISED, low=UNIFORM)],
    ),
    Row(
        "s5.4-kinds",
        "Sections 5.4 and 7",
        "Depending on p and ψ the cell expands uniformly, contracts uniformly or deforms non-uniformly.",
        all_kinds,
        tuple(case.studies()[0] for case in (cases.FIG16, cases.FIG17, cases.FIG18)),
    ),
    Row(
        "s5-remark5.1-others",
        "Remark 5.1",
        "The saturation concentration and the pressure coefficient also play a key role.",
        other_parameters,
    ),
    *(
        simulation(
            f"s5.4-uniform-p-{dict(case.changes)['parameters.p']:g}",
            "Section 5.4",
            "At ψ = 38.24, with p lowered from 1.75 to 0, a stays what w0,1 predicts: uniform; here "
            f"p = {dict(case.changes)['parameters.p']:g}.",
            case,
            [Check("a is uniform: its spread over its mean", nonuniformity, cases.LONG_END, high=UNIFORM)],
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
        tonicity_sets_the_transition,
    ),
    *_rows_of_realistic(),
    simulation(
        "s7-regions",
        "Section 7",
        "Regions with high actin are those with large deformation (shown on Fig. 14's cell).",
        cases.FIG14,
        [Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.1636, low=0.5)],
    ),
    Row(
        "s7-converse",
        "Section 7",
        "Regions of the cell with large displacements have high actin.",
        partial(displacements_follow_actin, False),
        SEVERAL,
    ),
    simulation(
        "s7-uniform",
        "Sections 5.3 and 7",
        "If actin is uniform the cell expands or contracts uniformly and isotropically (Fig. 16's cell).",
        cases.FIG16,
        [
            Check("a is uniform: its spread over its mean", nonuniformity, 0.518, high=UNIFORM),
            *_uniform(0.518),
        ],
    ),
    simulation(
        "s7-heaviside",
        "Section 7",
        "The Heaviside function lets pressure- and polymerisation-induced protrusion be told apart (Fig. "
        "16's cell without the ring: only osmotic pressure).",
        cases.NO_RING,
        [Check("does not expand without the ring: area change", area_change, 0.0361, -1e-3, 1e-3)],
        "A uniform pressure has no gradient and moves nothing: all of Fig. 16's expansion is the ring's.",
    ),
    Row(
        "s7-experiment",
        "Section 7",
        "High actin goes with large deformation in complete agreement with experimental observations.",
        observations,
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
        [Check("shrinks by more than rnd makes it: area change", area_change, 0.0361, high=-1e-3)],
        "A uniform a exerts no force whatever ψ is: without pressure the cell keeps its size but for the "
        "1e-3 of its perturbation.",
    ),
    simulation(
        "s7-curvature",
        "Section 7",
        "For non-uniform deformations actin is predominant at the periphery and highest at regions with the "
        "highest curvature (shown on Fig. 19's cell).",
        cases.FIG19,
        [
            Check("non-uniform: rim's deviation from a circle", unevenness, 0.0722, low=VISIBLE),
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.0722, low=0),
            Check("a follows the rim's curvature: correlation", curvature_agreement, 0.0722, low=0.5),
        ],
    ),
)
