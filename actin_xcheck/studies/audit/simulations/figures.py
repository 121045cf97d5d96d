"""Figs. 10 to 20: what the article sees on the pictures of its deforming cells, one row a figure."""

from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.simulations import cases
from actin_xcheck.studies.audit.simulations.checks import Check, simulation
from actin_xcheck.studies.audit.simulations.patterns import UNIFORM, VISIBLE, WAYWARD
from actin_xcheck.studies.audit.simulations.readouts import (
    area_change,
    centroid_x,
    fronts,
    half_width,
    highest_at,
    hot_share,
    largest_displacement,
    rim_agreement,
    rim_excess,
    smallest_angle,
    unevenness,
    waywardness,
)


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


FIGURES_OF_CELLS: tuple[Row, ...] = (
    simulation(
        "fig10",
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
        cases.FIG11_ONE_TERM,
        [
            Check("grows: area change", area_change, 0.5114, low=0),
            Check("number of fronts", fronts, 0.5114, 1.5, 2.5),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.5114, low=0.5),
        ],
    ),
    simulation(
        "fig12",
        cases.FIG12,
        [
            *_fronts_along_y((0.05, 0.1329)),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.1329, low=0.5),
            Check("shrinks: area change", area_change, 0.1329, high=0),
        ],
    ),
    simulation(
        "fig13",
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
        cases.FIG14,
        [
            Check("grows: area change", area_change, 0.1636, low=0),
            Check("number of fronts", fronts, 0.1636, 3.5, 4.5),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.1636, low=0.5),
        ],
    ),
    simulation(
        "fig15",
        cases.FIG14,
        [
            Check("deformed significantly: largest |u|", largest_displacement, 0.1636, low=VISIBLE),
            Check("mesh suitable: smallest angle in degrees", smallest_angle, 0.1636, low=10),
        ],
        "The limit of the smallest angle is that of the family of meshes, deformed.",
    ),
    simulation(
        "fig16",
        cases.FIG16,
        [
            Check("expands: area change at 0.0361", area_change, 0.0361, low=0),
            Check("expands on: area change at 0.518", area_change, 0.518, low=0),
            Check("uniformly: deviation over mean motion", waywardness, 0.518, high=WAYWARD),
        ],
    ),
    simulation(
        "fig17",
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
        cases.FIG19,
        [
            Check("protrudes: rim's deviation from a circle", unevenness, 0.0722, low=VISIBLE),
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.0722, low=0),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.0722, low=0.5),
        ],
    ),
    Row(
        "fig20a",
        _photograph,
    ),
    simulation(
        "fig20b",
        cases.FIG19,
        [
            Check("actin at the periphery: rim over centre less 1", rim_excess, 0.0722, low=0),
            Check("actin is high where the rim protrudes: correlation", rim_agreement, 0.0722, low=0.5),
        ],
        "The photograph itself cannot be decided; that the model gives such a cell can.",
    ),
)
