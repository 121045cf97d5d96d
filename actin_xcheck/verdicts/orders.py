"""What successive levels say: observed orders beside a declared one, and the uncertainty of a number.

The rules for orders p_i = log(e_i/e_{i+1}) / log(s_i/s_{i+1}) between successive levels:

* a level without a number (its run failed) proves nothing: FAIL;
* levels whose error is at most the round-off floor are not judged; with fewer than two local orders above it
  the verdict is `in round-off`;
* PASS when the last two local orders lie within 0.15 of the declared one;
* `not yet asymptotic` when the last three approach it, each closer than the one before and the last by at
  least a quarter of the distance: a next term of the error, h^(1/2) relative to the leading one or higher,
  lets that distance fall by 0.71 a level or faster; and when the error of a single number changes its sign
  once among the last four levels, where its leading terms cancel, and the last two orders are far apart;
* the same where round-off ends the orders, the last of them within 0.15, before there are three;
* FAIL when an error rises out of round-off again;
* FAIL in every other case: they have settled elsewhere, or not at all.

The slope of the least-squares line through all levels above the floor is reported with its interval, and
decides nothing: it holds the coarse levels too.

The uncertainty is that of Richardson's extrapolation with a safety factor.  With declared order p and
changes c1 = |fine - coarser|, c2 = |coarser - coarsest| between levels whose h doubles, it is Roache's grid
convergence index (J. Fluids Eng. 116, 1994, 405) as Oberkampf and Roy restrict it (Verification and
Validation in Scientific Computing, 2010, chapter 8):

    U = Fs max(c1, c2 / 2^p) / (2^q - 1)

* Fs = 1.25 and q = p where the observed order log2(c2/c1) lies within a tenth of p and both changes go the
  same way: errors that go up and down have no order, whatever two changes say;
* else Fs = 3 and q = the observed order, at least 1/2 and at most p; with two levels Fs = 3 and q = p, but
  1 where a third one gave no number: h is too large there for more;
* Fs = 3 wherever meshes are not similar, so that the factor of h^p differs from level to level;
* a change smaller than order p leaves of the one before it is an accident (errors that change sign) and is
  not believed: hence the max.

To this comes what the method itself says of its steps.  Levels share errors in time that do not fall with
h: the first step has the same length on all of them, and no longer one shows what a tolerance has left.

Vectors have one uncertainty, in the largest norm.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import linregress
from scipy.stats import t as student

from actin_xcheck.core.model import Array
from actin_xcheck.core.parameters import CAVEATS, Delta, Rheology
from actin_xcheck.runs.method import Method
from actin_xcheck.scene.expression import coordinates
from actin_xcheck.scene.resolve import in_scene_frame, resolve
from actin_xcheck.scene.scene import Scene
from actin_xcheck.verdicts.known import ROUND_OFF, Quantity

TOLERANCE = 0.15
"""Of the last two local orders about the declared one."""

APPROACHES = 0.75
"""The most that may be left, from one level to the next, of a local order's distance to the declared one."""

CONFIDENCE = 0.95


class Verdict(StrEnum):
    """What observed orders say about a declared one."""

    PASS = "PASS"
    FAIL = "FAIL"
    IN_ROUND_OFF = "in round-off"
    """Too few errors stand above the floor to read an order off."""
    NOT_YET_ASYMPTOTIC = "not yet asymptotic"
    """The local orders approach the declared one and have not reached it on these levels."""
    MEASURED = "measured"
    """Nothing is declared."""


@dataclass(frozen=True)
class ObservedOrder:
    """What a sequence of errors shows.

    Attributes
    ----------
    slope, low, high : of log error over log step by least squares, with the ends of its 95 % confidence
        interval; nan where there are too few levels.
    local : orders between successive levels, one fewer than levels; nan where one of the two is no number or
        in round-off.
    verdict, reason : see the rules of this module.
    """

    slope: float
    low: float
    high: float
    local: tuple[float, ...]
    verdict: Verdict
    reason: str


def local_orders(steps: ArrayLike, errors: ArrayLike, floor: float = 0.0) -> Array:
    """Orders (n - 1,) between successive levels with steps (n,) and errors (n,).

    nan where an error is no number or no larger than `floor`.
    """
    s, e = np.asarray(steps, dtype=float), np.asarray(errors, dtype=float)
    log_e = np.log(np.where(_above(e, floor), e, np.nan))
    return np.asarray(np.diff(log_e) / np.diff(np.log(s)))


def observe(
    steps: Sequence[float],
    errors: Sequence[float],
    declared: float | None,
    at_least: bool = False,
    floor: float = ROUND_OFF,
) -> ObservedOrder:
    """Read the order off errors and judge it.

    Parameters
    ----------
    steps : h or dt of the levels, decreasing, (n,) with n >= 3.
    errors : relative, (n,), with their signs where they are of single numbers; nan where a run gave none.
    declared : the order claimed, or None where nothing is claimed.
    at_least : whether a higher order holds too: functionals may superconverge.
    floor : errors up to this are round-off.

    ValueError where there are fewer than three levels or the steps do not decrease.
    """
    if len(steps) < 3 or len(steps) != len(errors) or np.any(np.diff(steps) >= 0):
        raise ValueError(f"steps {list(steps)} must decrease, be three or more and have an error each")
    s, e = np.asarray(steps, dtype=float), np.asarray(errors, dtype=float)
    local = local_orders(steps, np.abs(e), floor)
    verdict, reason = _judge(e, local, declared, at_least, floor)
    return ObservedOrder(*_fit(s, np.abs(e), floor), tuple(local.tolist()), verdict, reason)


def _above(errors: Array, floor: float) -> NDArray[np.bool_]:
    """Which errors are numbers above the floor; an error of 0 never is."""
    return np.isfinite(errors) & (errors > max(floor, 0.0))


def _fit(steps: Array, errors: Array, floor: float) -> tuple[float, float, float]:
    """Least-squares slope and its interval by Student's t with n - 2 degrees of freedom."""
    used = _above(errors, floor)
    if used.sum() < 2:
        return np.nan, np.nan, np.nan
    if used.sum() == 2:
        return float(local_orders(steps[used], errors[used])[0]), np.nan, np.nan
    fit = linregress(np.log(steps[used]), np.log(errors[used]))
    half = float(student.ppf((1 + CONFIDENCE) / 2, used.sum() - 2) * fit.stderr)
    return float(fit.slope), float(fit.slope - half), float(fit.slope + half)


def _judge(
    errors: Array, local: Array, declared: float | None, at_least: bool, floor: float
) -> tuple[Verdict, str]:
    """The verdict and a sentence for it."""
    if declared is None:
        return Verdict.MEASURED, "no order is claimed"
    if missing := int((~np.isfinite(errors)).sum()):
        return Verdict.FAIL, f"{missing} of {len(errors)} levels gave no number"
    above = _above(np.abs(errors), floor)
    if np.any(above[1:] & ~above[:-1]):
        return Verdict.FAIL, "an error rises out of round-off again"
    known = local[np.isfinite(local)]
    if len(known) < 2:
        return Verdict.IN_ROUND_OFF, f"fewer than two local orders stand above errors of {floor:.0e}"
    distance = np.maximum(declared - known, 0) if at_least else np.abs(known - declared)
    last = " and ".join(f"{one:.2f}" for one in known[-2:])
    if np.all(distance[-2:] <= TOLERANCE):
        return Verdict.PASS, f"the last two local orders are {last}"
    if len(known) > 2 and distance[-1] <= APPROACHES * distance[-2] and distance[-2] < distance[-3]:
        return Verdict.NOT_YET_ASYMPTOTIC, f"the local orders approach {declared:g}; the last two are {last}"
    if len(known) < len(local) and distance[-1] <= min(TOLERANCE, APPROACHES * distance[-2]):
        return (
            Verdict.NOT_YET_ASYMPTOTIC,
            f"the local orders approach {declared:g} where round-off ends them; the last two are {last}",
        )
    turns = np.count_nonzero(np.diff(np.sign(errors[above][-4:])))
    if turns == 1 and abs(known[-1] - known[-2]) > TOLERANCE:
        return Verdict.NOT_YET_ASYMPTOTIC, f"the error changes its sign; the last two local orders are {last}"
    return Verdict.FAIL, f"the last two local orders are {last}, not {declared:g}"


_ANGLES = np.linspace(0, 2 * np.pi, 37)
_OUTWARD = np.array([np.cos(_ANGLES), np.sin(_ANGLES)])
_EPS = 1e-3
"""Step of central differences, which are good to 1e-5."""

_NOTHING = 1e-4


def why_not(scene: Scene, method: Method, quantity: Quantity) -> str:
    """Why the method's orders are not claimed of a quantity of the scene; empty where they are."""
    if not method.order_h:
        return "declared to stall: the exhibit of what does not converge on triangles"
    if scene.expect.exact:
        if method.order_dt > 2 and not _flux_of_change(scene) <= _NOTHING:
            return (
                "n·∇(∂a/∂t), at fixed material points, does not vanish on the moving rim: above order 2 in "
                "time the stages, which are of order 2, cost up to one order there"
            )
        return ""
    if scene.motion is None and (caveat := CAVEATS.get(scene.physics.closure)):
        return caveat
    if scene.expect.growth_rate:
        # modes meet n.grad a = 0, but not n.grad div v = 0, which the explicit stages would need
        if method.order_dt > 3:
            return (
                "a mode's div v has a flux through the moving rim: the stages, which are of order 2, keep a "
                "near order 3.75"
            )
        return ""
    if _flux_at_start(scene) > 1e-6:
        return "the initial concentration breaks n·∇a = 0 at t = 0"
    if method.order_dt > 2 and not _starts_smoothly(scene):
        return (
            "above order 2 in time the initial data would have to meet n·∇(∂a/∂t) = 0 too, which is not known"
        )
    if method.order_dt > 3 and scene.physics.rheology is Rheology.VISCOELASTIC:
        return "above order 3 ∂²a/∂t² would have to meet it as well, which is not known where u acts back"
    if method.order_dt > 3 and quantity is Quantity.CONCENTRATION:
        return (
            "as soon as its motion depends on the angle, a moving rim has n·∇(∂a/∂t) ≠ 0: the field may fall "
            "to about 3.5 where stages are of order 2, area and total actin keep 4"
        )
    return ""


def orders_lost_in_h(scene: Scene, knows_rim: bool) -> int:
    """Orders lost in a scene: 1 where the load of a free viscoelastic rim sees phi, but for who knows that.

    The rim's load is then an integral of f(phi) w.n, and phi = div u has a trace of order k in P_k:
    positions, and with them everything, fall from k + 1 to k.  A method that `knows_rim` carries phi there.
    """
    return int(scene.motion is None and scene.physics.rim_sees_dilation and not knows_rim)


def _flux_at_start(scene: Scene) -> float:
    """Largest |n.grad a| on the rim at t = 0."""
    _, slope, _ = _inwards(scene, 1.0)
    return float(np.abs(slope).max())


def _starts_smoothly(scene: Scene) -> bool:
    """Whether n.grad(da/dt) = 0 on the rim at t = 0, and da/dt is continuous across the ring.

    Known where the load of a cell at rest is axisymmetric because psi = 0 and a is uniform from the
    ring outwards: mu div v + f is constant then, so that da/dt = d Delta a - a div v + 1 - a is uniform there
    too, and continuous across the ring where d [Delta a] = a [div v] = -a [f]/mu.
    """
    model, p = scene.physics, scene.parameters
    if model.delta is not Delta.RING or model.contracts or scene.initial.u or scene.initial.eigenmode:
        return False
    beyond = np.linspace(p.l0, 1, 9)[:, None] * _OUTWARD[:, None]
    values = scene.initial.a(**coordinates(beyond))
    value, slope, curvature = _inwards(scene, p.l0)
    phi = np.zeros_like(value)
    f_jump = model.active_stress(value, phi, 1.0) - model.active_stress(value, phi, 0.0)
    jump = -p.d * curvature + value * f_jump / p.mu  # a is uniform beyond
    return float(max(np.ptp(values), np.abs(slope).max(), np.abs(jump).max())) < _NOTHING


def _inwards(scene: Scene, radius: float) -> tuple[Array, Array, Array]:
    """The initial concentration, its radial slope and curvature just inside a circle, by angle."""
    depth = 1e-2 * np.arange(7)
    points = (radius - depth)[:, None, None] * _OUTWARD
    values = np.array([scene.initial.a(**coordinates(at)) * np.ones(_ANGLES.size) for at in points])
    value, slope, half = np.polynomial.polynomial.polyfit(-depth, values, 6)[:3]
    return value, slope, 2 * half


def _flux_of_change(scene: Scene) -> float:
    """Largest |n.grad(da/dt)| on the rim, at fixed material points, in the course of an exact solution.

    nan where its formula ends at the rim, so that it has no difference across.
    """
    expected, motion = scene.expect.exact, resolve(scene).motion
    assert expected is not None
    formula = expected.a

    def place(xi: Array, t: float) -> Array:
        return xi if motion is None else motion(xi, t)

    def change(xi: Array, t: float) -> Array:
        start = min(max(t - _EPS, 0.0), scene.time.end - 2 * _EPS)  # formulas need have no value beyond
        where = (t - start) / _EPS  # of the three times: 0, 1 or 2
        weights = where - 1.5, 2.0 - 2.0 * where, where - 0.5  # the slope of the parabola through them
        values = (in_scene_frame(scene, formula, place(xi, s), xi, s) for s in start + _EPS * np.arange(3))
        rate = sum(weight * value for weight, value in zip(weights, values, strict=True)) / _EPS
        return np.asarray(rate) * np.ones(xi.shape[1])

    largest = 0.0
    for t in np.linspace(0.0, scene.time.end, 3):
        pairs = [(_OUTWARD + step, _OUTWARD - step) for step in _EPS * np.eye(2)[:, :, None]]
        slopes = np.array([(change(one, t) - change(other, t)) / (2 * _EPS) for one, other in pairs])
        stretch = np.array([(place(one, t) - place(other, t)) / (2 * _EPS) for one, other in pairs])
        inverse = np.linalg.inv(stretch.transpose(2, 1, 0))  # (n, 2, 2): dxi/dx
        gradient, normal = (np.einsum("nji,jn->in", inverse, one) for one in (slopes, _OUTWARD))
        flux = np.abs((gradient * normal).sum(axis=0) / np.hypot(*normal)).max()
        largest = float(np.maximum(largest, flux))
    return largest


ASYMPTOTIC, ELSEWHERE = 1.25, 3.0
"""Safety factors where the observed order confirms the declared one, and where it does not or cannot."""

CONFIRMED = 0.1
"""Of the declared order: how near the observed one must come."""


def uncertainty(
    values: Sequence[Array],
    order: float,
    ratio: float,
    similar: bool,
    floor: float,
    steps: float = 0.0,
    lacks: bool = False,
) -> tuple[float, str, float]:
    """The uncertainty of the first of two or three levels, how it came about, and the observed order.

    The order is nan where there is none to observe.

    Parameters
    ----------
    values : (k,) each, finest first, h doubling from one to the next.
    order : p, as declared.
    ratio : what the error grows by to the second level if it has that order; 2^p but for rounded steps.
    similar : whether meshes are similar for this quantity, so that an observed order means something.
    floor : the round-off, which is added.
    steps : the errors of the steps in time, as the method estimates them, which are added too.
    lacks : whether a still coarser level gave no number.
    """
    size, how, observed = _of_levels(values, order, ratio, similar, floor, lacks)
    return size + steps + floor, how + (f", errors of the steps {steps:.1e}" if steps else ""), observed


def _of_levels(
    values: Sequence[Array], order: float, ratio: float, similar: bool, floor: float, lacks: bool
) -> tuple[float, str, float]:
    """The part that levels show."""
    fine, coarse = values[:2]
    change = float(np.abs(fine - coarse).max())
    if len(values) < 3:
        power = 1.0 if lacks else order
        how = (
            f"Fs = {ELSEWHERE:g}, two levels of order {power:g}{', for a third one failed' if lacks else ''}"
        )
        return ELSEWHERE * change / (ratio ** (power / order) - 1), how, np.nan
    before = float(np.abs(coarse - values[2]).max())
    if max(change, before) <= floor:
        return 0.0, "round-off", np.nan
    with np.errstate(divide="ignore"):
        observed = float(np.log2(before) - np.log2(change))
    goes_on = float(((fine - coarse) * (coarse - values[2])).sum()) > 0
    confirmed = similar and goes_on and abs(observed - order) <= CONFIRMED * order
    power = order if confirmed else min(max(observed, 0.5), order)
    factor = ASYMPTOTIC if confirmed else ELSEWHERE
    largest = max(change, before / 2**order)
    how = f"Fs = {factor:g}, observed order {observed:.2f} of {order:g}"
    return factor * largest / (ratio ** (power / order) - 1), how, observed
