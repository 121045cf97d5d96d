"""Sentences of Sections 5.4, 6 and 7 about simulations, one row each."""

from dataclasses import replace
from functools import partial

from actin_xcheck.core.model import Delta, Rheology
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit.row import Row
from actin_xcheck.studies.audit.simulations import cases
from actin_xcheck.studies.audit.simulations.checks import Case, Check, simulation
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
from actin_xcheck.theory.growth import amplitude_at_rest
from actin_xcheck.theory.modes import Mode


def _several() -> tuple[Study, ...]:
    return _by_finite_elements(cases.FIG12, cases.FIG13, cases.FIG14, cases.FIG17)


def _polar() -> tuple[Study, ...]:
    polar = cases.FIG06, cases.FIG11, cases.FIG12, cases.FIG13, cases.FIG18, cases.FIG19
    return _by_finite_elements(*polar)


def _other_parameters() -> tuple[Study, ...]:
    return _by_finite_elements(cases.FIG16, cases.FIG17, cases.FIG18)


def _by_finite_elements(*simulated: Case) -> tuple[Study, ...]:
    return tuple(case.studies()[0] for case in simulated)


def _failing() -> tuple[Study, ...]:
    published = load_scene(FAILING).as_published
    assert published.refine is not None
    assert published.dt is not None
    as_published, resolved = (published.refine, published.dt), (5, 1e-5)
    brief = (("time.end", 4e-3), ("time.outputs", (1e-3, 4e-3)))  # before round-off has grown to order 1
    kept = (("model.rheology", str(Rheology.VISCOELASTIC)),)
    viscous, viscoelastic = str(Rheology.VISCOUS), str(Rheology.VISCOELASTIC)
    return (
        Study(FAILING, "audit", viscous, (), FEM, (as_published,)),
        Study(FAILING, "brief", viscous, brief, FEM, (resolved,)),
        Study(FAILING, "kept", viscoelastic, kept, FEM, (as_published,)),
        Study(FAILING, "kept-brief", viscoelastic, (*kept, *brief), FEM, (resolved,)),
    )


def _realistic() -> tuple[Study, ...]:
    case = cases.REALISTIC.studies()[0]
    return (replace(case, levels=((4, 0.02), (5, 0.02), (5, 0.01)), published=None),)


def _on_the_wall() -> str:
    near = replace(load_scene("fig06-mode-11").physics, delta=Delta.NONE)
    growth = float(amplitude_at_rest(near, Mode(1, 1), 1.7183))
    return (
        f"By linear theory on the static wall (3.6), started at rest, it would be {growth:.1f} times the "
        "initial one. The article compares shapes after two to four steps, which are those of its initial "
        "condition; a growth rate tells the theories apart."
    )


def _uniform(end: float) -> list[Check]:
    return [Check("uniform: deviation over mean motion", waywardness, end, high=WAYWARD)]


SENTENCES_SIMULATED: tuple[Row, ...] = (
    simulation(
        "s5-domain",
        cases.FIG06,
        [Check("area change", area_change, 4 * cases.PAPER_DT, -0.01, 0.01)],
    ),
    simulation(
        "s5.1-validation",
        cases.FIG06,
        [Check("w1,1 grows: amplitude over the initial one", growth_of(W11), 1.7183, low=1)],
        _on_the_wall,
    ),
    simulation(
        "s5.2-small-u",
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
        partial(displacements_follow_actin, True),
        _several,
    ),
    Row(
        "s5.3-polarity",
        polarities,
        _polar,
    ),
    simulation(
        "s5.4-hopf",
        cases.HOPF,
        [Check("a is uniform: its spread over its mean", nonuniformity, cases.LONG_END, high=UNIFORM)],
    ),
    simulation(
        "s5.4-hopf-inside",
        cases.HOPF_INSIDE,
        [Check("a is uniform: its spread over its mean", nonuniformity, cases.LONG_END, high=UNIFORM)],
    ),
    simulation(
        "s5.4-raise-psi",
        cases.RAISED,
        [Check("non-uniform: rim's deviation from a circle", unevenness, cases.LOCALISED, low=UNIFORM)],
    ),
    Row(
        "s5.4-kinds",
        all_kinds,
        _other_parameters,
    ),
    Row(
        "s5-remark5.1-others",
        other_parameters,
    ),
    *(
        simulation(
            f"s5.4-uniform-p-{dict(case.changes)['parameters.p']:g}",
            case,
            [Check("a is uniform: its spread over its mean", nonuniformity, cases.LONG_END, high=UNIFORM)],
        )
        for case in cases.DOWN_IN_P
    ),
    simulation(
        "s5.4-p3",
        cases.STRONG_PRESSURE,
        [Check("expands: area change", area_change, 0.0361, low=0), *_uniform(0.0361)],
    ),
    simulation(
        "s5.4-weak-pressure",
        cases.WEAK_PRESSURE,
        [Check("expands: area change", area_change, 0.0361, low=0), *_uniform(0.0361)],
    ),
    simulation(
        "s5.4-not-shown",
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
    Row("s5.4-failure", fails, _failing),
    Row(
        "s5-remark5.1",
        tonicity_sets_the_transition,
    ),
    Row("s6-bias", bias, _realistic),
    Row("s6-fronts", realistic, _realistic),
    simulation(
        "s7-regions",
        cases.FIG14,
        [Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.1636, low=0.5)],
    ),
    Row(
        "s7-converse",
        partial(displacements_follow_actin, False),
        _several,
    ),
    simulation(
        "s7-uniform",
        cases.FIG16,
        [
            Check("a is uniform: its spread over its mean", nonuniformity, 0.518, high=UNIFORM),
            *_uniform(0.518),
        ],
    ),
    simulation(
        "s7-heaviside",
        cases.NO_RING,
        [Check("does not expand without the ring: area change", area_change, 0.0361, -1e-3, 1e-3)],
        "A uniform pressure has no gradient and moves nothing: all of Fig. 16's expansion is the ring's.",
    ),
    Row(
        "s7-experiment",
        observations,
    ),
    simulation(
        "s7-expansion",
        cases.FIG16,
        [
            Check("expands: area change", area_change, 0.518, low=0),
            Check("a is higher on the rim than in the centre: ratio less 1", rim_excess, 0.518, low=0),
        ],
    ),
    simulation(
        "s7-contraction",
        cases.FIG17,
        [
            Check("contracts: area change", area_change, 0.518, high=0),
            Check("highest a started at the centre: its radius", highest_at, 0.518, high=0.1),
        ],
    ),
    simulation(
        "s7-counter-pressure",
        cases.NO_PRESSURE,
        [Check("shrinks by more than rnd makes it: area change", area_change, 0.0361, high=-1e-3)],
        "A uniform a exerts no force whatever ψ is: without pressure the cell keeps its size but for the "
        "1e-3 of its perturbation.",
    ),
    simulation(
        "s7-curvature",
        cases.FIG19,
        [
            Check("non-uniform: rim's deviation from a circle", unevenness, 0.0722, low=VISIBLE),
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.0722, low=0),
            Check("a follows the rim's curvature: correlation", curvature_agreement, 0.0722, low=0.5),
        ],
    ),
)
