"""What is known of a scene without running it, as references or an exact mode, and how far runs are off."""

import tomllib
from dataclasses import dataclass
from decimal import Decimal
from enum import StrEnum
from functools import cache

import numpy as np
from numpy.polynomial import legendre

from actin_xcheck.core import lagrange
from actin_xcheck.core.model import Array
from actin_xcheck.core.parameters import Closure
from actin_xcheck.runs.growth import fitted_rate
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.expression import coordinates
from actin_xcheck.scene.resolve import in_scene_frame, turn_matrix
from actin_xcheck.scene.scene import Scene
from actin_xcheck.theory.eigenfields import growth_rate

ESTIMATED = 3.0
"""Safety factor of an estimate that nothing confirms, as of Richardson's where no order does."""

PRINTED = 1e-9
"""Reference values are printed to ten digits at most."""

_RADIAL, _ANGULAR = 24, 96  # points of a spectral quadrature over the disk


@dataclass(frozen=True, eq=False)
class Known:
    """Values (k,) in the scene's frame, nan where not known; where they come from; their uncertainty."""

    values: Array
    origin: str
    uncertainty: float


def known(scene: Scene, quantity: str, t: float) -> Known | None:
    """What is known of a quantity at an output time, or None.

    Parameters
    ----------
    scene : what was run.
    quantity : "area", "total_actin", "probe_a" (k,), "probe_x" (2 k,) or "growth_rate" (real part, and
        frequency where there is one); of others nothing is known.
    t : an output time.
    """
    if quantity == "growth_rate":
        return _mode(scene)
    if quantity in ("centroid", "polarity"):
        return None
    if quantity == "area" and scene.physics.closure is Closure.IRROTATIONAL_WALL and not scene.motion:
        return Known(np.array([np.pi]), "static disk", 0.0)
    for at in scene.expect.reference.at if scene.expect.reference else ():
        if at.time == t and (printed := getattr(at, quantity)) is not None:
            values = np.ravel(np.asarray(printed, dtype=float))
            return Known(values, "reference", _printed(scene.text, quantity))
    return _exact(scene, quantity, t)


@cache
def _printed(text: str, quantity: str) -> float:
    """One unit of the last digit to which a scene (TOML) states its reference values of a quantity."""
    stated = tomllib.loads(text, parse_float=Decimal)["expect"]["reference"]["at"]
    values = np.concatenate(
        [np.ravel(np.array(at[quantity], dtype=object)) for at in stated if quantity in at]
    )
    places = [-int(value.as_tuple().exponent) for value in map(Decimal, values) if value.is_finite()]
    return max(10.0 ** -max(places, default=0), PRINTED)


def rate_parts(rate: complex, oscillates: bool) -> Array:
    """A growth rate as numbers: its real part, and its frequency where the mode oscillates."""
    return np.array([rate.real, abs(rate.imag)] if oscillates else [rate.real])


def _mode(scene: Scene) -> Known | None:
    expected = scene.expect.growth_rate
    if expected is None:
        return None
    rate = growth_rate(scene.physics, expected.m, expected.n)
    return Known(rate_parts(rate, bool(rate.imag)), "exact mode", _beyond_linear(scene, rate))


def _beyond_linear(scene: Scene, rate: complex) -> float:
    """Estimate what terms of higher order than linear change of a fitted rate; of an eigenmode it is known.

    They multiply a mode by itself: that feeds the axisymmetric ones and those of twice its angular number.
    What comes back to it is of second order in its amplitude where it is axisymmetric, else of third.
    """
    expected, start = scene.expect.growth_rate, scene.initial.eigenmode
    assert expected is not None
    if start is None:
        return 0.0
    largest = start.amplitude * np.exp(max(rate.real, 0.0) * expected.window[1])
    return float(ESTIMATED * scene.physics.feeding() * largest ** (2 if expected.m else 1))


def _exact(scene: Scene, quantity: str, t: float) -> Known | None:
    """From `[expect.exact]`, where it is also known how the material points move."""
    expected = scene.expect.exact
    active = scene.physics.contracts or scene.physics.pressed
    at_rest = not active and scene.initial.u is None
    if expected is None or not (scene.motion or at_rest):
        return None

    def place(xi: Array) -> Array:
        if scene.motion is None:
            return xi
        return np.array([formula(x0=xi[0], y0=xi[1], t=t) for formula in (scene.motion.x, scene.motion.y)])

    def a(x: Array, xi: Array) -> Array:
        return expected.a(**coordinates(x), x0=xi[0], y0=xi[1], t=t)

    if quantity in ("area", "total_actin"):
        xi, areas = _polar()
        x = place(xi)
        density = a(x, xi) if quantity == "total_actin" else np.ones(xi.shape[1:])
        values = np.array([(areas * _jacobian(x) * density).sum()])
    else:
        xi = np.array(scene.probes.points, dtype=float).reshape(-1, 2).T
        x = place(xi)
        values = a(x, xi) if quantity == "probe_a" else x.T.ravel()
    return Known(values, "exact solution", 0.0)


def _polar() -> tuple[Array, Array]:
    """Points (2, r, theta) of Gauss' rule along radii, equidistant in angle, and weights dr dtheta (r, 1)."""
    nodes, weights = legendre.leggauss(_RADIAL)
    r, theta = (1 + nodes) / 2, 2 * np.pi * np.arange(_ANGULAR) / _ANGULAR
    points = r[:, None] * np.array([np.cos(theta), np.sin(theta)])[:, None]
    return points, weights[:, None] / 2 * 2 * np.pi / _ANGULAR


def _jacobian(x: Array) -> Array:
    """det d(x, y)/d(r, theta) at the points of `_polar` whose images are x (2, r, theta)."""
    nodes, _ = legendre.leggauss(_RADIAL)
    vandermonde = legendre.legvander(nodes, _RADIAL - 1)
    slopes = legendre.legvander(nodes, _RADIAL - 2) @ legendre.legder(np.eye(_RADIAL))
    along_r = 2 * np.einsum("rs,dst->drt", slopes @ np.linalg.inv(vandermonde), x)
    waves = 1j * np.arange(_ANGULAR // 2 + 1)
    waves[-1] = 0  # the highest wave has no derivative on these points
    around = np.fft.irfft(waves * np.fft.rfft(x, axis=2), _ANGULAR, axis=2)
    return np.asarray(along_r[0] * around[1] - along_r[1] * around[0])


class Quantity(StrEnum):
    """What is measured at the end of a run; area, total actin and probes are series of it."""

    CONCENTRATION = "concentration"
    AREA = "area"
    TOTAL_ACTIN = "total_actin"
    PROBES = "probe_a"
    GROWTH_RATE = "growth_rate"
    AMPLITUDE = "mode_amplitude"
    """Of the mode whose growth is measured: no fit, whose rate would depend on how often the mode is seen."""

    @property
    def words(self) -> str:
        """What its error is, for a reader."""
        return _WORDS[self]

    @property
    def is_functional(self) -> bool:
        """Whether it is one number of the whole cell, which may converge faster than the field does."""
        return self not in (Quantity.CONCENTRATION, Quantity.PROBES)

    @property
    def floor(self) -> float:
        """Relative errors up to this are round-off: modes have an amplitude of 1e-6 on a = 1."""
        return 1e-8 if self in (Quantity.GROWTH_RATE, Quantity.AMPLITUDE) else ROUND_OFF


_WORDS = {
    Quantity.CONCENTRATION: "concentration (relative L2)",
    Quantity.AREA: "area (relative)",
    Quantity.TOTAL_ACTIN: "total actin (relative)",
    Quantity.PROBES: "concentration at the probes (largest)",
    Quantity.GROWTH_RATE: "growth rate (relative)",
    Quantity.AMPLITUDE: "logarithm of the mode's amplitude",
}


def error_of(scene: Scene, run: Run, quantity: Quantity) -> float:
    """Error at the end against what the scene expects; nan where the run has no such number."""
    if run.attributes["outcome"] != "completed":
        return np.nan
    match quantity:
        case Quantity.CONCENTRATION:
            return l2_error(scene, run)
        case Quantity.GROWTH_RATE:
            assert scene.mode is not None
            exact = growth_rate(scene.physics, *scene.mode)
            error = fitted_rate(scene, run) - exact
            return float((error.real if not exact.imag else abs(error)) / abs(exact))
        case _:
            return reference_errors(scene, run)[quantity]


def change_between(scene: Scene, coarse: Run, fine: Run, quantity: Quantity) -> float:
    """Difference of two levels at the end, of single numbers with its sign; nan where one did not get there.

    Of the concentration on one mesh only, where both know it in the same cells.
    """
    if any(run.attributes["outcome"] != "completed" for run in (coarse, fine)):
        return np.nan
    match quantity:
        case Quantity.CONCENTRATION:
            return cell_difference(fine, coarse)
        case Quantity.AMPLITUDE:  # the change of rate times the time that has passed
            return float(np.log(np.abs(coarse.series[quantity][-1] / fine.series[quantity][-1])))
        case _:
            one, other = (np.asarray(run.series[quantity][-1]) for run in (coarse, fine))
            return float((one - other) / other if quantity.is_functional else np.abs(one - other).max())


def l2_error(scene: Scene, run: Run) -> float:
    """Relative L2 error at the end against `[expect.exact]`.

    Of the P_k field on its curved cells for finite elements, of cell averages for finite volumes.
    """
    assert scene.expect.exact is not None
    rule = lagrange.rule(run.order, 4 * run.order - 2)  # exact for the square of the field
    x, xi, a = (rule.blend(nodal, run.cells) for nodal in (run.points[-1], run.xi, run.a_points[-1]))
    exact = in_scene_frame(scene, scene.expect.exact.a, x, xi, float(run.times[-1]))
    dx = rule.dx(run.points[-1], run.cells)
    if run.family == "fv":
        areas = dx.sum(axis=0)
        exact = (exact * dx).sum(axis=0) / areas
        return float(np.sqrt(areas @ (run.a_cells[-1] - exact) ** 2 / (areas @ exact**2)))
    return float(np.sqrt(((a - exact) ** 2 * dx).sum() / (exact**2 * dx).sum()))


def reference_errors(scene: Scene, run: Run) -> dict[str, float]:
    """Largest error over the reference times: relative for area and total actin, absolute for probes.

    nan where the run did not reach a reference time that is judged; a quantity none of whose values is judged
    (they are nan in the scene) has none.
    """
    assert scene.expect.reference is not None
    errors: dict[str, list[float]] = {}
    for at in scene.expect.reference.at:
        row = int(np.argmin(np.abs(run.series["time"] - at.time)))
        reached = abs(run.series["time"][row] - at.time) < 1e-9
        for quantity in ("area", "total_actin", "probe_a", "probe_x"):
            expected = getattr(at, quantity)
            if expected is None:
                continue
            got: Array = run.series[quantity][row]
            if quantity == "probe_x":
                got = got @ turn_matrix(scene)
            scale = expected if quantity in {"area", "total_actin"} else 1.0
            difference = np.abs(np.asarray(got) - np.asarray(expected, dtype=float)) / scale
            judged = np.isfinite(np.asarray(expected, dtype=float))
            errors.setdefault(quantity, []).extend(difference[judged] if reached else judged[judged] * np.nan)
    return {quantity: float(np.max(values)) for quantity, values in errors.items() if values}


def cell_difference(first: Run, second: Run) -> float:
    """Relative L2 difference of the cell averages of two runs at their last frames, in `first`'s areas."""
    areas = lagrange.areas(first.points[-1], first.cells)
    difference = first.a_cells[-1] - second.a_cells[-1]
    return float(np.sqrt(areas @ difference**2 / (areas @ first.a_cells[-1] ** 2)))


ROUND_OFF = 1e-12
"""Relative errors of this size are round-off unless a study says otherwise."""
