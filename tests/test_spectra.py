"""The finite elements' own spectrum about the steady state converges to the exact one."""

from dataclasses import replace

import numpy as np
import pytest

from actin_xcheck.core.model import Model
from actin_xcheck.core.parameters import Closure, Delta, Parameters, Rheology
from actin_xcheck.studies import theory
from actin_xcheck.studies.theory import discrete_rates, discrete_threshold
from actin_xcheck.theory.dispersion import Version, active_slope
from actin_xcheck.theory.exact import threshold

STRONG = Model(Parameters(270.0, 0.0), delta=Delta.NONE)
PRESSED = Model(Parameters(240.0, 0.26), delta=Delta.FULL)
CELLS = {
    "m=0": (STRONG, 0),
    "m=1": (STRONG, 1),
    "m=2 pair": (STRONG, 2),
    "m=3 pair": (replace(STRONG, parameters=Parameters(300.0, 0.0)), 3),
    "m=4": (replace(STRONG, parameters=Parameters(500.0, 0.0)), 4),
    "pressure": (PRESSED, 1),
    "pressure, pair": (PRESSED, 2),
    "viscous": (replace(PRESSED, rheology=Rheology.VISCOUS), 2),
    "traction-free, gauged": (replace(PRESSED, closure=Closure.TRACTION_FREE), 1),
    "traction-free, pair": (
        Model(Parameters(200.0, 0.26), closure=Closure.TRACTION_FREE, delta=Delta.FULL),
        2,
    ),
    "wall": (replace(PRESSED, closure=Closure.IRROTATIONAL_WALL), 1),
}


def limit_of(found):
    """Richardson's, from two meshes."""
    return found.rates[1] + (found.rates[1] - found.rates[0]) / 3


@pytest.mark.parametrize("name", CELLS)
def test_discrete_rates_converge_at_second_order(name):
    """Every closure, both rheologies, with and without pressure; angular number and all."""
    model, m = CELLS[name]
    found = discrete_rates(model, m, (5, 6) if m == 4 else (4, 5))
    assert found.orders[0] == pytest.approx(2, abs=0.2)
    if not found.exact.imag:
        assert limit_of(found).real == pytest.approx(found.exact.real, rel=5e-3)


def test_the_linearisation_as_printed_would_be_noticed(monkeypatch):
    """(2/pi) p delta in place of (p/pi) delta: the limit is wrong by far more than the mesh's error."""
    right = discrete_rates(PRESSED, 1, (4, 5))
    monkeypatch.setattr(theory, "active_slope", lambda model: active_slope(model, Version.AS_PRINTED))
    wrong = discrete_rates(PRESSED, 1, (4, 5))
    assert abs(limit_of(wrong) - right.exact) > 5 * abs(limit_of(right) - right.exact)


@pytest.mark.slow
@pytest.mark.parametrize("closure", [Closure.REFERENCE_NORMAL, Closure.TRACTION_FREE])
@pytest.mark.parametrize("m", range(5))
def test_discrete_thresholds_are_the_exact_ones_within_a_percent(closure, m):
    model = Model(Parameters(0.0, 0.26), closure=closure, delta=Delta.NONE)
    coarse, fine = (discrete_threshold(model, m, refine) for refine in ((3, 4) if m < 3 else (4, 5)))
    assert fine + (fine - coarse) / 3 == pytest.approx(threshold(model, m).psi, rel=0.01)
    assert np.log2((coarse - threshold(model, m).psi) / (fine - threshold(model, m).psi)) > 1.5
