"""What linear theory says of time steps and meshes: amplification of the schemes, limits, resolvable waves.

About a = 1, u = 0 a mode of wave number k has two unknowns, its dilation phi and its content P = a + phi (the
perturbation of what a material element holds).  As in (3.6), with e = E - p_e and E = 1 + nu',

    dphi/dt = -(e phi + f' a)/mu,    dP/dt = -(k_a + d k^2) (P - phi),

exact on the static disk of `irrotational-wall`; where delta varies it is taken as 0.  The schemes take the
first explicitly (the article's (B.23) all but E phi) and the second implicitly.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from actin_xcheck.core.model import Array, Delta, Model
from actin_xcheck.runs.method import Method, load
from actin_xcheck.theory.dispersion import active_slope, growth_rates, k2_crit, stiffness
from actin_xcheck.theory.modes import wavenumber

FASTEST = (1, 1)
"""The mode that grows fastest: (3.6)'s largest rate falls with k^2 as long as e > 0."""

SHORTEST_WAVE = 1e8
"""k^2 of waves that diffusion damps at once: shorter than on any mesh."""


@dataclass(frozen=True, eq=False)
class Pair:
    """An additive Runge-Kutta pair: coefficients (s, s) and weights (s,) of its halves.

    Attributes
    ----------
    explicit, b_explicit : of the motion.
    implicit, b_implicit : of the content; the diagonal is 0, gamma, gamma, ...
    """

    explicit: Array
    implicit: Array
    b_explicit: Array
    b_implicit: Array


def is_known(method: Method) -> bool:
    """Whether the scheme is one of ours: of another package's steps theory knows nothing."""
    return method.family in ("fem", "fv")


def pair_of(method: Method) -> Pair | None:
    """The pair that one of our methods takes steps with; None for the first-order scheme (B.23)."""
    options = dict(method.options)
    if "time" in options:
        tableaux: Any = load("fem.tableaux:TABLEAUX")
        tableau = tableaux[options["time"]]
        return Pair(tableau.explicit, tableau.implicit, tableau.b, tableau.b)
    if method.order_dt == 1:
        return None
    gamma: Any = load("fv.second_order:GAMMA")
    stages: Any = load("fv.second_order:STAGES")
    last = stages[-1]
    first, second = last.explicit
    explicit = np.array([[0, 0, 0], [gamma, 0, 0], [first, second, 0]])
    implicit = np.array([[0, 0, 0], [0, gamma, 0], [0, *last.implicit, gamma]])
    return Pair(explicit, implicit, explicit[-1], implicit[-1])


def constant(model: Model) -> Model:
    """The model as linear theory takes it: delta 0 where it varies in space."""
    return model if model.delta is Delta.FULL else replace(model, delta=Delta.NONE)


def step_matrix(pair: Pair | None, model: Model, k2: float, dt: float) -> Array:
    """The map (2, 2) of (phi, P) over one step."""
    par = model.parameters
    decay, rate = model.reaction_rate() + par.d * k2, model.reaction_rate()
    slope, e = active_slope(model), stiffness(model)
    dilation, content = np.eye(2)
    if pair is None:
        moved = dilation - dt * (e * dilation + slope * (content - dilation)) / (
            par.mu + dt * (1 + par.nu_prime)
        )
        # (1 + k_a dt) M a + dt d K a = M(t) a + k_a dt H(t), perturbed: H by phi, M a by P, K a by k^2 a
        held = content + dt * (rate * dilation + par.d * k2 * moved)
        return np.array([moved, held / (1 + dt * decay)])
    speeds: list[Array] = []
    gains: list[Array] = []
    for number, (ours, theirs) in enumerate(zip(pair.explicit, pair.implicit, strict=True)):
        gamma = theirs[number]
        phi = dilation + dt * sum((w * s for w, s in zip(ours, speeds, strict=False)), np.zeros(2))
        known = content + dt * sum((w * g for w, g in zip(theirs, gains, strict=False)), np.zeros(2))
        p = (known + dt * gamma * decay * phi) / (1 + dt * gamma * decay)
        speeds.append(-(e * phi + slope * (p - phi)) / par.mu)
        gains.append(-decay * (p - phi))
    return np.array(
        [
            dilation + dt * np.tensordot(pair.b_explicit, speeds, 1),
            content + dt * np.tensordot(pair.b_implicit, gains, 1),
        ]
    )


def amplification(pair: Pair | None, model: Model, k2: float, dt: float) -> complex:
    """The eigenvalue of a step that belongs to the leading rate: the larger one."""
    roots: NDArray[np.complex128] = np.linalg.eigvals(step_matrix(pair, model, k2, dt)).astype(complex)
    return complex(max(roots, key=lambda root: (abs(root), root.imag)))


def leading_rate(model: Model, k2: float) -> complex:
    """The leading root of (3.6)."""
    return complex(growth_rates(model, k2)[0])


def computed_rate(pair: Pair | None, model: Model, k2: float, dt: float) -> float:
    """The growth rate ln |R|/dt that steps of dt show."""
    return float(np.log(abs(amplification(pair, model, k2, dt))) / dt)


def growth_error(pair: Pair | None, model: Model, k2: float, dt: float, end: float) -> float:
    """Relative error of a mode's amplitude at the end of a run: R^(end/dt) e^(-lambda end) - 1."""
    rate = leading_rate(model, k2)
    factor = amplification(pair, model, k2, dt)
    if factor == 0:
        return 1.0
    exponent = np.log(factor) * end / dt - rate * end
    return float(abs(np.expm1(np.clip(exponent.real, -700, 700) + 1j * exponent.imag)))


def largest_accurate_step(pair: Pair | None, model: Model, end: float, bound: float) -> float:
    """The dt up to which the fastest mode's amplitude at the end is right within a bound; at most the end."""
    k2 = wavenumber(*FASTEST) ** 2
    return _first(lambda dt: growth_error(pair, model, k2, dt, end) - bound, 1e-6 * end, end)


def explicit_limit(pair: Pair | None, model: Model) -> float:
    """The dt beyond which the shortest waves are amplified, however fine the mesh; infinite where none are.

    v = A^-1 (F - B u) is a bounded operator, so that the explicit motion has a limit that no mesh lowers:
    from elasticity, e dt/mu, and from what actin a step leaves behind in such waves, f' dt/mu.  Infinite too
    where they grow by themselves (e < 0).
    """
    if stiffness(model) < 0:
        return float("inf")
    longest = 1e4
    limit = _first(
        lambda dt: abs(amplification(pair, model, SHORTEST_WAVE, dt)) - (1 + _MARGIN), 1e-6, longest
    )
    return limit if limit < longest else float("inf")


_MARGIN = 1e-6
"""By which a factor must exceed 1: that of waves which do not move is 1 but for round-off."""


def _first(excess: Callable[[float], float], low: float, high: float) -> float:
    """Where excess first becomes positive between two time steps, seen at eight of a decade; else `high`."""
    steps = np.geomspace(low, high, round(8 * np.log10(high / low)) + 1).tolist()
    after = next((i for i, dt in enumerate(steps) if excess(dt) > 0), None)
    if after is None:
        return float(high)
    return float(brentq(excess, steps[after - 1], steps[after])) if after else float(low)


def resolvable_h(model: Model, space: int) -> float:
    """The h at which pi k/h, the shortest wave on nodes h/k apart, is sqrt(k^2_crit); infinite without one.

    Waves beyond k_crit decay; a mesh that cannot hold those below it leaves out some that grow.
    """
    critical = k2_crit(model)
    return float(np.pi * space / np.sqrt(critical)) if critical > 0 else float("inf")


def growth_time(model: Model) -> float:
    """mu/f', the time in which active stress makes a perturbation e times as large."""
    return model.parameters.mu / active_slope(model)
