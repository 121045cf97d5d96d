"""What a run says of growth: the rate of a mode, and how far the energy of a perturbation came."""

from typing import Literal

from actin_xcheck.core import lagrange
from actin_xcheck.core.parameters import Closure, Rheology
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.scene import Scene


def fitted_rate(scene: Scene, run: Run) -> complex:
    """The growth rate that the scene expects, as measured; nan where no exponentials fit."""
    from actin_xcheck.theory.eigenfields import growth_rate  # here: few scenes expect one
    from actin_xcheck.theory.growth import fit_growth

    expected, series = scene.expect.growth_rate, run.series
    assert expected is not None
    oscillates = bool(growth_rate(scene.physics, expected.m, expected.n).imag)
    # a start at rest excites both roots of (3.6), an eigenmode one, or a conjugate pair
    exponentials: Literal[1, 2] = 1 if scene.initial.eigenmode and not oscillates else 2
    try:
        return fit_growth(series["time"], series["mode_amplitude"], expected.window, exponentials).rate
    except ValueError:
        return complex("nan")


def energy_growth(scene: Scene, run: Run) -> float:
    """The energy of a perturbation of a = 1, u = 0 at the last frame over that at the first."""
    return _energy(scene, run, -1) / _energy(scene, run, 0)


def _energy(scene: Scene, run: Run, frame: int) -> float:
    """The energy of a perturbation of a = 1, u = 0 in a frame of a run, as `predict transient` has it.

    Gradients are those on the reference disk: what that neglects is of the perturbation's third power.
    """
    rule = lagrange.rule(run.order, 4 * run.order - 2)
    dx = rule.dx(run.xi, run.cells)
    a = rule.blend(run.a_points[frame] - 1, run.cells)
    if scene.physics.rheology is Rheology.VISCOUS:
        return float((a**2 * dx).sum() / 2)
    (along, across), (up, upward) = lagrange.gradient(rule, run.points[frame] - run.xi, run.xi, run.cells)
    _, nu_prime = scene.physics.elastic_moduli()
    dilation = along + upward
    stored = along**2 + upward**2 + (across + up) ** 2 / 2 + nu_prime * dilation**2
    if scene.physics.closure is Closure.IRROTATIONAL_WALL:  # with u.n = 0, what the wall's friction adds
        stored = (1 + nu_prime) * dilation**2 + (up - across) ** 2 / 2
    return float(((a**2 + stored) * dx).sum() / 2)
