"""Figs. 6 to 9: the modes that the article sees excited after a few steps, one row a panel."""

import numpy as np

from actin_xcheck.studies.audit.row import Row
from actin_xcheck.studies.audit.simulations import cases
from actin_xcheck.studies.audit.simulations.checks import Check, simulation
from actin_xcheck.studies.audit.simulations.patterns import ALIKE, W02, W11, W21, W31, W41, signed, turned
from actin_xcheck.studies.audit.simulations.readouts import (
    displacement_likeness,
    displacement_peak,
    likeness,
    mode_share,
    ripples_along_x,
)

FIGURES_OF_MODES: tuple[Row, ...] = (
    simulation(
        "fig06",
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
        cases.FIG07,
        [
            Check("a is like -w0,2: correlation", likeness(signed(W02, -1)), 3.61e-3, low=ALIKE),
            Check("|u| is largest at r = 0.8: its radius", displacement_peak, 3.61e-3, 0.75, 0.85),
            Check("still at t = 0.024: its radius", displacement_peak, 0.024, 0.75, 0.85),
            Check("no oscillation there at t = 0.024: maxima along a ray", ripples_along_x, 0.024, 0.5, 1.5),
        ],
    ),
    simulation(
        "fig07-small-rnd",
        cases.FIG07_SMALL_RND,
        [Check("a is like -w0,2: correlation", likeness(signed(W02, -1)), 3.61e-3, low=ALIKE)],
        "rnd is printed as a number between 1e-3 and 1e-5 only; the pattern at this time is that of the jump "
        "at r = 0.8, which excites every mode of angular number 0 at once.",
    ),
    simulation(
        "s5.1.2-membrane",
        cases.FIG07_MEMBRANE,
        [Check("|u| is largest at the rim: its radius", displacement_peak, 0.024, low=0.95)],
    ),
    simulation(
        "fig08b",
        cases.FIG13,
        [
            Check(
                "a is like w0,2 + 2 w2,1 (θ₁ = π/2): correlation",
                likeness(lambda x: W02(x) + 2 * turned(W21, np.pi / 2)(x)),
                cases.FIFTEEN_FINE,
                low=ALIKE,
            )
        ],
        "cos x = J₀(r) - 2 J₂(r) cos 2θ + … (Jacobi and Anger): the mixture and its factor 2 are those "
        "of the initial condition.",
    ),
    simulation(
        "fig08e",
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
        cases.FIG14,
        [
            Check(
                "a is like w4,1 (θ₁ = π/4): correlation",
                likeness(turned(W41, np.pi / 4)),
                cases.FIFTEEN_FINE,
                low=ALIKE,
            ),
            Check(
                "for comparison, a is less like -w0,2: correlation",
                likeness(signed(W02, -1)),
                cases.FIFTEEN_FINE,
                high=0.5,
            ),
        ],
        "|sin x sin y| carries -w0,2 beside w4,1, and the circle's own mode, which grows here while m = 4 "
        "decays, takes over within these steps.",
    ),
    simulation(
        "fig09e",
        cases.FIG11,
        [Check("a has a share of w2,1: |correlation|", mode_share(W21, 2), cases.FIFTEEN, low=ALIKE)],
        "The bars make the sum 2 |sin x sin y|, which a quarter turn maps onto itself while it changes "
        "the sign of w2,1: its share is zero and stays zero. Without the bars it is 2 sin x sin y, w2,1 "
        "turned by π/4.",
    ),
    simulation(
        "fig09e-no-bars",
        cases.FIG11_NO_BARS,
        [Check("a has a share of w2,1: |correlation|", mode_share(W21, 2), cases.FIFTEEN, low=ALIKE)],
        "At t = 0 that pattern has the mode's shape already.",
    ),
)
