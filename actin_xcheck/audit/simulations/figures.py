"""Figs. 6 to 20: what the article sees on the pictures of its simulations, one row a figure."""

import numpy as np

from actin_xcheck.audit.row import Finding, Judgement, Row
from actin_xcheck.audit.simulations import cases
from actin_xcheck.audit.simulations.checks import Check, simulation
from actin_xcheck.audit.simulations.readouts import (
    Field,
    area_change,
    centroid_x,
    displacement_likeness,
    displacement_peak,
    fronts,
    half_width,
    highest_at,
    hot_share,
    largest_displacement,
    likeness,
    mode_share,
    rim_agreement,
    rim_excess,
    ripples_along_x,
    smallest_angle,
    unevenness,
    waywardness,
)
from actin_xcheck.prediction import Mode

VISIBLE = 0.05
"""A twentieth of the radius: what one sees on a printed picture of a cell."""

ALIKE = 0.9
"""Least correlation of two patterns that are called alike."""

WAYWARD = 0.1
"""A uniform motion deviates from its mean by less than a tenth."""

UNIFORM = 0.01
"""A rim within 1 % of a circle looks like one."""

W11, W02, W21 = Mode(1, 1).value, Mode(0, 2).value, Mode(2, 1).value
W31, W41 = Mode(3, 1).value, Mode(4, 1).value


def _signed(field: Field, sign: float) -> Field:
    """A field times a number."""
    return lambda x: sign * field(x)


def _turned(field: Field, angle: float) -> Field:
    """w_m,n with theta_1 = angle."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return lambda x: field(turn @ x)


def _photograph() -> Finding:
    return Finding(
        Judgement.UNDECIDABLE,
        "No number: a photograph of a stained cell has no concentration in units of the model.",
        "One fibroblast's image can be compared with a picture of the simulation by eye only.",
    )


def _fronts_along_y(outputs: tuple[float, ...]) -> list[Check]:
    """Figs. 12 and 13: protrudes along y on two fronts, narrows in x, stays where it is."""
    end = outputs[-1]
    return [
        Check("half-width along y grows beyond 1", half_width(1), end, low=1),
        Check("half-width along x falls below 1", half_width(0), end, high=1),
        Check("number of fronts", fronts, end, 1.5, 2.5),
        Check("does not translate: centroid along x", centroid_x, end, -1e-3, 1e-3),
    ]


FIGURES_SIMULATED: tuple[Row, ...] = (
    simulation(
        "fig06",
        "Fig. 6, Section 5.1.1",
        "With a = 1.0009 + rnd sin x at ψ = 62.4, a_h after two and u_h after four steps show w1,1.",
        cases.FIG06,
        [
            Check("a is like w1,1: correlation", likeness(W11), 2 * cases.PAPER_DT, low=ALIKE),
            Check(
                "u's x component is like w1,1: correlation",
                displacement_likeness(W11),
                4 * cases.PAPER_DT,
                low=ALIKE,
            ),
        ],
        "sin x has the mode's shape before any step is taken (correlation 0.996 with w1,1), and any radial "
        "expansion has u_x = U(r) cos θ: neither picture tests the theory. Fig. 6c is tested without "
        "the perturbation below.",
    ),
    simulation(
        "fig06-unperturbed",
        "Fig. 6c, tested",
        "u_h shows w1,1 because w1,1 is excited; here without the perturbation, where it must not.",
        cases.FIG06_UNPERTURBED,
        [
            Check(
                "u's x component is not like w1,1: correlation",
                displacement_likeness(W11),
                4 * cases.PAPER_DT,
                high=0.5,
            )
        ],
        "The uniform expansion that the ring's pressure drives has the same u_x with no mode excited.",
    ),
    simulation(
        "fig07",
        "Fig. 7, Section 5.1.2",
        "At p = 1.646, ψ = 38.24, a_h shows -w0,2 at t = 3.61e-3 and u_h is highest around r = 0.8 "
        "then and at t = 0.024.",
        cases.FIG07,
        [
            Check("a is like -w0,2: correlation", likeness(_signed(W02, -1)), 3.61e-3, low=ALIKE),
            Check("|u| is largest at r = 0.8: its radius", displacement_peak, 3.61e-3, 0.75, 0.85),
            Check("still at t = 0.024: its radius", displacement_peak, 0.024, 0.75, 0.85),
            Check("no oscillation there at t = 0.024: maxima along a ray", ripples_along_x, 0.024, 0.5, 1.5),
        ],
    ),
    simulation(
        "fig07-small-rnd",
        "Fig. 7, rnd = 1e-5",
        "As Fig. 7 with rnd at the lower end of its range, where the ring's own pattern prevails.",
        cases.FIG07_SMALL_RND,
        [Check("a is like -w0,2: correlation", likeness(_signed(W02, -1)), 3.61e-3, low=ALIKE)],
        "rnd is printed as a number between 1e-3 and 1e-5 only; the pattern at this time is that of the jump "
        "at r = 0.8, which excites every mode of angular number 0 at once.",
    ),
    simulation(
        "s5.1.2-membrane",
        "Section 5.1.2, (5.1)",
        "With δ on the boundary only (5.1) and the parameters of Tables 1 and 2, u_h has its highest value "
        "around the boundary.",
        cases.FIG07_MEMBRANE,
        [Check("|u| is largest at the rim: its radius", displacement_peak, 0.024, low=0.95)],
    ),
    simulation(
        "fig08b",
        "Fig. 8b and c, Table 5",
        "At ψ = 310 dyn/cm², a = 1 + |0.1 cos x|, a_h shows w0,2 + 2 w2,1 within 15 steps.",
        cases.FIG13,
        [
            Check(
                "a is like w0,2 + 2 w2,1 (θ₁ = π/2): correlation",
                likeness(lambda x: W02(x) + 2 * _turned(W21, np.pi / 2)(x)),
                cases.FIFTEEN_FINE,
                low=ALIKE,
            )
        ],
        "cos x = J₀(r) - 2 J₂(r) cos 2θ + … (Jacobi and Anger): the mixture and its factor 2 are those "
        "of the initial condition.",
    ),
    simulation(
        "fig08e",
        "Fig. 8e and f, Table 5",
        "At ψ = 200 dyn/cm², a = 1 + |0.1 sin² y|, a_h shows w3,1 - w0,2 - 3 w2,1 within 15 steps.",
        cases.FIG12,
        [
            Check(
                "a is like w3,1 - w0,2 - 3 w2,1: correlation",
                likeness(lambda x: W31(x) - W02(x) - 3 * W21(x)),
                cases.FIFTEEN_FINE,
                low=ALIKE,
            ),
            Check("a has a share of w3,1: |correlation|", mode_share(W31, 3), cases.FIFTEEN_FINE, low=0.05),
        ],
        "sin² y is even in x and in y, so that every odd harmonic, w3,1 in whatever phase, is zero and stays "
        "zero: the model keeps the symmetry.",
    ),
    simulation(
        "fig09b",
        "Fig. 9b and c, Table 5",
        "At ψ = 367 dyn/cm², a = 1 + |0.1 sin x sin y|, a_h shows w4,1 within 15 steps.",
        cases.FIG14,
        [
            Check(
                "a is like w4,1 (θ₁ = π/4): correlation",
                likeness(_turned(W41, np.pi / 4)),
                cases.FIFTEEN_FINE,
                low=ALIKE,
            ),
            Check(
                "for comparison, a is less like -w0,2: correlation",
                likeness(_signed(W02, -1)),
                cases.FIFTEEN_FINE,
                high=0.5,
            ),
        ],
        "|sin x sin y| carries -w0,2 beside w4,1, and the circle's own mode, which grows here while m = 4 "
        "decays, takes over within these steps.",
    ),
    simulation(
        "fig09e",
        "Fig. 9e and f, Table 5",
        "At ψ = 110 dyn/cm², a = 1 + |Σ 0.1 sin x sin y|, a_h shows w2,1 within 15 steps.",
        cases.FIG11,
        [Check("a has a share of w2,1: |correlation|", mode_share(W21, 2), cases.FIFTEEN, low=ALIKE)],
        "The bars make the sum 2 |sin x sin y|, which a quarter turn maps onto itself while it changes "
        "the sign of w2,1: its share is zero and stays zero. Without the bars it is 2 sin x sin y, w2,1 "
        "turned by π/4.",
    ),
    simulation(
        "fig09e-no-bars",
        "Fig. 9e and f, read without the bars",
        "As Fig. 9e, with a = 1 + 0.1 sin x sin y: the reading under which w2,1 can be excited.",
        cases.FIG11_NO_BARS,
        [Check("a has a share of w2,1: |correlation|", mode_share(W21, 2), cases.FIFTEEN, low=ALIKE)],
        "At t = 0 that pattern has the mode's shape already.",
    ),
    simulation(
        "fig10",
        "Fig. 10, Section 5.3.1",
        "The cell expands uniformly with actin at the periphery (t = 0.5114), then moves in the positive x "
        "direction (1.7183) and has translated and expanded significantly (3.365).",
        cases.FIG06,
        [
            Check("expands: area change at 0.5114", area_change, 0.5114, low=0),
            Check("uniformly: deviation over mean motion", waywardness, 0.5114, high=WAYWARD),
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.5114, low=0),
            Check("moves to +x: centroid at 1.7183", centroid_x, 1.7183, low=0.01),
            Check("expands significantly: area change at 3.365", area_change, 3.365, low=0.01),
            Check("has translated: centroid along x", centroid_x, 3.365, low=VISIBLE),
        ],
        "The perturbation decays, because at ψ = 62.4 no mode of the moving cell grows. What does translate "
        "the cell is examined under s5.3.1-translation.",
    ),
    simulation(
        "fig11",
        "Fig. 11, Section 5.3.2",
        "With w2,1 excited the cell grows and protrudes on two fronts without translating; actin is highest "
        "at the periphery where it protrudes.",
        cases.FIG11,
        [
            Check("grows: area change", area_change, 0.5114, low=0),
            Check("number of fronts", fronts, 0.5114, 1.5, 2.5),
            Check("does not translate: centroid along x", centroid_x, 0.5114, -1e-3, 1e-3),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.5114, low=0.5),
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.5114, low=0),
        ],
        "2 |sin x sin y| has four fronts by symmetry; two need the reading without bars (fig11-no-bars).",
    ),
    simulation(
        "fig11-no-bars",
        "Fig. 11, read without the bars",
        "As Fig. 11, with a = 1 + 0.1 sin x sin y.",
        cases.FIG11_NO_BARS,
        [
            Check("grows: area change", area_change, 0.5114, low=0),
            Check("number of fronts", fronts, 0.5114, 1.5, 2.5),
            Check("does not translate: centroid along x", centroid_x, 0.5114, -1e-3, 1e-3),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.5114, low=0.5),
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.5114, low=0),
        ],
    ),
    simulation(
        "fig11-one-term",
        "Fig. 11, one term of the sum",
        "As Fig. 11, with a = 1 + |0.1 sin x sin y|.",
        cases.FIG11_ONE_TERM,
        [
            Check("grows: area change", area_change, 0.5114, low=0),
            Check("number of fronts", fronts, 0.5114, 1.5, 2.5),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.5114, low=0.5),
        ],
    ),
    simulation(
        "fig12",
        "Fig. 12, Section 5.3.2",
        "The cell grows along y on two fronts and narrows in x without translating; at n = 130 actin is high "
        "where it protrudes; in general its area decreases.",
        cases.FIG12,
        [
            *_fronts_along_y((0.05, 0.1329)),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.1329, low=0.5),
            Check("shrinks: area change", area_change, 0.1329, high=0),
        ],
    ),
    simulation(
        "fig13",
        "Fig. 13, Section 5.3.2",
        "The cell grows along y on two fronts and narrows in x without translating; actin is high around the "
        "centroid at n = 50 and n = 146.",
        cases.FIG13,
        [
            *_fronts_along_y((0.0511, 0.1493)),
            Check("highest a started near the centre: its radius at n = 50", highest_at, 0.0511, high=0.5),
            Check("and at n = 146", highest_at, 0.1493, high=0.5),
            Check(
                "the region of high a shrinks: its share, n = 146 over n = 50",
                lambda run, t: hot_share(run, t) / hot_share(run, 0.0511),
                0.1493,
                high=1,
            ),
        ],
    ),
    simulation(
        "fig14",
        "Fig. 14, Section 5.3.2",
        "With w4,1 excited the cell grows on four fronts; actin is highest where protrusion is highest.",
        cases.FIG14,
        [
            Check("grows: area change", area_change, 0.1636, low=0),
            Check("number of fronts", fronts, 0.1636, 3.5, 4.5),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.1636, low=0.5),
        ],
    ),
    simulation(
        "fig15",
        "Fig. 15",
        "At t = 0.1636 the cell has deformed significantly, but the mesh is still suitable.",
        cases.FIG14,
        [
            Check("deformed significantly: largest |u|", largest_displacement, 0.1636, low=VISIBLE),
            Check("mesh suitable: smallest angle in degrees", smallest_angle, 0.1636, low=10),
        ],
        "The limit of the smallest angle is that of the family of meshes, deformed.",
    ),
    simulation(
        "fig16",
        "Fig. 16, Section 5.4",
        "At (ψ, p) = (70.366, 0.433) the cell expands uniformly until t = 0.518.",
        cases.FIG16,
        [
            Check("expands: area change at 0.0361", area_change, 0.0361, low=0),
            Check("expands on: area change at 0.518", area_change, 0.518, low=0),
            Check("uniformly: deviation over mean motion", waywardness, 0.518, high=WAYWARD),
        ],
    ),
    simulation(
        "fig17",
        "Fig. 17, Section 5.4",
        "At p = -0.433 the cell contracts uniformly; a increases from the boundary to the centroid.",
        cases.FIG17,
        [
            Check("contracts: area change at 0.518", area_change, 0.518, high=0),
            Check("uniformly: deviation over mean motion", waywardness, 0.518, high=WAYWARD),
            Check("a is lower on the rim than in the centre: ratio less 1", rim_excess, 0.518, high=0),
            Check("highest a started at the centre: its radius", highest_at, 0.518, high=0.1),
        ],
    ),
    simulation(
        "fig18",
        "Fig. 18, Section 5.4",
        "At (ψ, p) = (7.8e3, 0.026) the cell contracts non-uniformly with actin around its centroid.",
        cases.FIG18,
        [
            Check("contracts: area change", area_change, 0.0722, high=-VISIBLE),
            Check("non-uniformly: rim's deviation from a circle", unevenness, 0.0722, low=UNIFORM),
            Check("actin around the centroid: rim over centre less 1", rim_excess, 0.0722, high=-VISIBLE),
        ],
        "Actin has been around the centroid before (fig18-earlier); by the time of Fig. 18c it is uniform to "
        "less than 1 % again. f'/μ = 545: round-off has grown to order 1 by t = 0.068, so that only "
        "statements about the whole cell can be judged there.",
    ),
    simulation(
        "fig18-earlier",
        "Fig. 18, Section 5.4, before the printed time",
        f"As Fig. 18, at t = {cases.LOCALISED}: does the cell contract with actin around its centroid?",
        cases.FIG18,
        [
            Check("contracts: area change", area_change, cases.LOCALISED, high=-VISIBLE),
            Check(
                "actin around the centroid: rim over centre less 1",
                rim_excess,
                cases.LOCALISED,
                high=-VISIBLE,
            ),
        ],
    ),
    simulation(
        "fig19",
        "Fig. 19, Section 5.4",
        "At (ψ, p) = (1.3e3, 0.026) actin is high at the periphery and highest where the cell protrudes.",
        cases.FIG19,
        [
            Check("protrudes: rim's deviation from a circle", unevenness, 0.0722, low=VISIBLE),
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.0722, low=0),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.0722, low=0.5),
        ],
    ),
    Row(
        "fig20a",
        "Fig. 20a",
        "Epifluorescence shows F-actin at the periphery, highest where a fibroblast protrudes.",
        _photograph,
    ),
    simulation(
        "fig20b",
        "Fig. 20b, Section 5.4",
        "The simulated cell (ψ = 1.3e3, p = 0.026) agrees qualitatively with the photograph: actin at the "
        "periphery, highest where it protrudes.",
        cases.FIG19,
        [
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.0722, low=0),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.0722, low=0.5),
        ],
        "The photograph itself cannot be decided; that the model gives such a cell can.",
    ),
)
