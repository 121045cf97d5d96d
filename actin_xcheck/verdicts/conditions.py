"""Of which data a method's orders are claimed: theory's conditions, asked of a scene's own formulas.

Orders in time above 2 need da/dt to meet the boundary condition of a, and to be continuous across the ring:
the stages of the pairs are of order 2, and what they miss there is passed on at less than the pairs' order.
"""

import numpy as np

from actin_xcheck.core.model import Array
from actin_xcheck.core.parameters import CAVEATS, Closure, Delta, Rheology
from actin_xcheck.runs.method import Method
from actin_xcheck.scene.expression import coordinates
from actin_xcheck.scene.resolve import in_scene_frame, resolve
from actin_xcheck.scene.scene import Scene
from actin_xcheck.verdicts.quantities import Quantity

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


def orders_lost_in_h(scene: Scene) -> int:
    """Orders that no element reaches in a scene: 1 where the load of a free viscoelastic rim sees phi.

    The rim's load is then an integral of f(phi) w.n, and phi = div u has a trace of order k in P_k:
    positions, and with them everything, fall from k + 1 to k.
    """
    fixed = scene.motion is not None or scene.physics.closure is Closure.IRROTATIONAL_WALL
    elastic = scene.physics.rheology is Rheology.VISCOELASTIC
    return int(elastic and scene.parameters.p != 0 and not fixed)


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
    if model.delta is not Delta.RING or p.psi or scene.initial.u or scene.initial.eigenmode:
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
