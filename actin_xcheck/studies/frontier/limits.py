"""What linear theory says of time steps and meshes, and the lines, curves and table that show it.

About a = 1, u = 0 a mode of wave number k has two unknowns, its dilation phi and its content P = a + phi (the
perturbation of what a material element holds).  As in (3.6), with e = E - p_e and E = 1 + nu',

    dphi/dt = -(e phi + f' a)/mu,    dP/dt = -(k_a + d k^2) (P - phi),

exact on the static disk of `irrotational-wall`; where delta varies it is taken as 0.  The schemes take the
first explicitly (the article's (B.23) all but E phi) and the second implicitly.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from actin_xcheck.core.model import Array, Delta, Model
from actin_xcheck.report.exhibits import Chapter, Line, Plot, Sheet
from actin_xcheck.runs.method import Method, load
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.frontier.answers import BOUND
from actin_xcheck.studies.frontier.planes import Axis, Plane, end_at
from actin_xcheck.theory.dispersion import (
    active_slope,
    growth_rates,
    k2_crit,
    sigma_prime,
    stiffness,
    wavenumber,
)

FASTEST = (1, 1)
"""The mode that grows fastest: (3.6)'s largest rate falls with k^2 as long as e > 0."""

SHORTEST_WAVE = 1e8
"""k^2 of waves that diffusion damps at once: shorter than on any mesh."""


@dataclass(frozen=True, eq=False)
class LimitPair:
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


def pair_of(method: Method) -> LimitPair | None:
    """The pair that one of our methods takes steps with; None for the first-order scheme (B.23)."""
    options = dict(method.options)
    if "time" in options:
        tableaux: Any = load("fem.tableaux:TABLEAUX")
        tableau = tableaux[options["time"]]
        return LimitPair(tableau.explicit, tableau.implicit, tableau.b, tableau.b)
    if method.order_dt == 1:
        return None
    gamma: Any = load("fv.solver:GAMMA")
    stages: Any = load("fv.solver:STAGES")
    last = stages[-1]
    first, second = last.explicit
    explicit = np.array([[0, 0, 0], [gamma, 0, 0], [first, second, 0]])
    implicit = np.array([[0, 0, 0], [0, gamma, 0], [0, *last.implicit, gamma]])
    return LimitPair(explicit, implicit, explicit[-1], implicit[-1])


def constant(model: Model) -> Model:
    """The model as linear theory takes it: delta 0 where it varies in space."""
    return model if model.delta is Delta.FULL else replace(model, delta=Delta.NONE)


def step_matrix(pair: LimitPair | None, model: Model, k2: float, dt: float) -> Array:
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


def amplification(pair: LimitPair | None, model: Model, k2: float, dt: float) -> complex:
    """The eigenvalue of a step that belongs to the leading rate: the larger one."""
    roots: NDArray[np.complex128] = np.linalg.eigvals(step_matrix(pair, model, k2, dt)).astype(complex)
    return complex(max(roots, key=lambda root: (abs(root), root.imag)))


def leading_rate(model: Model, k2: float) -> complex:
    """The leading root of (3.6)."""
    return complex(growth_rates(model, k2)[0])


def computed_rate(pair: LimitPair | None, model: Model, k2: float, dt: float) -> float:
    """The growth rate ln |R|/dt that steps of dt show."""
    return float(np.log(abs(amplification(pair, model, k2, dt))) / dt)


def growth_error(pair: LimitPair | None, model: Model, k2: float, dt: float, end: float) -> float:
    """Relative error of a mode's amplitude at the end of a run: R^(end/dt) e^(-lambda end) - 1."""
    rate = leading_rate(model, k2)
    factor = amplification(pair, model, k2, dt)
    if factor == 0:
        return 1.0
    exponent = np.log(factor) * end / dt - rate * end
    return float(abs(np.expm1(np.clip(exponent.real, -700, 700) + 1j * exponent.imag)))


def largest_accurate_step(pair: LimitPair | None, model: Model, end: float, bound: float) -> float:
    """The dt up to which the fastest mode's amplitude at the end is right within a bound; at most the end."""
    k2 = wavenumber(*FASTEST) ** 2
    return _first(lambda dt: growth_error(pair, model, k2, dt, end) - bound, 1e-6 * end, end)


def explicit_limit(pair: LimitPair | None, model: Model) -> float:
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


_SAMPLES = 25
"""Points of a line."""

ONE_STEP = "one step: Δt is the whole run"
GROWTH = "one growth time, μ/f′"
AMPLITUDE = f"w1,1 grows right within {BOUND:.0%} below"
EXPLICIT = "shortest waves damped below"
RESOLVED = "waves up to k_crit fit the mesh below"


def model_at(scene: Scene, psi: float, p: float) -> Model:
    """The scene's model at some psi and p, as linear theory takes it."""
    physics = scene.physics
    return constant(physics.varied(psi=psi, p=p))


def lines_of(scene: Scene, method: Method, plane: Plane) -> tuple[Line, ...]:
    """The limits that theory draws into a plane, those that lie outside of it left out."""
    match plane.name:
        case "psi,dt":
            lines = _psi_dt(scene, method, plane.x)
        case "psi,h":
            psi = _along(plane.x)
            h = [resolvable_h(model_at(scene, one, scene.parameters.p), method.space) for one in psi]
            lines = [Line(RESOLVED, psi, np.array(h))]
        case "dt,h":
            lines = _dt_h(scene, method, plane)
        case _:
            lines = _psi_p(scene, plane)
    return tuple(line for line in lines if _crosses(line, plane))


def theory_chapter(scene: Scene, methods: Sequence[Method]) -> Chapter:
    """Amplification on the fastest mode over dt, and the limits at several psi."""
    model = model_at(scene, scene.parameters.psi, scene.parameters.p)
    k2, end = wavenumber(*FASTEST) ** 2, scene.time.end
    dt = end / 2.0 ** np.arange(10, -1, -0.5)
    rate = leading_rate(model, k2)
    exhibits: list[Plot | Sheet] = []
    pairs, across = {one.name: pair_of(one) for one in methods if is_known(one)}, np.log10(dt)
    if rate.real > 0:
        lines = [
            Line(name, across, np.array([computed_rate(pair, model, k2, one) for one in dt]))
            for name, pair in pairs.items()
        ]
        lines.append(Line(f"exact, λ = {rate.real:.4g}", across, np.full(len(dt), rate.real), guide=True))
        note = (
            f"ln |R|/Δt of the fastest mode, w1,1 with k² = {k2:.4g}, at ψ = {scene.parameters.psi:g}, R "
            "being the scheme's amplification factor over one step. With long steps a mode grows too slowly: "
            "a run answers too little, and nothing blows up."
        )
        exhibits.append(Plot("growth", "Growth rate that a scheme computes", note, "log₁₀ Δt", tuple(lines)))
    lines = [
        Line(name, across, np.log10([growth_error(pair, model, k2, one, end) for one in dt]))
        for name, pair in pairs.items()
    ]
    lines.append(Line(f"{BOUND:.0%}", across, np.full(len(dt), np.log10(BOUND)), guide=True))
    note = "log₁₀ of the relative error of the same mode's amplitude at the end of the run, from R alone."
    exhibits.append(Plot("amplitude", "Error of its amplitude at the end", note, "log₁₀ Δt", tuple(lines)))
    exhibits.append(_sheet(scene, methods))
    note = (
        "Each scheme on the exact modes of the static disk with an irrotational wall, where (3.6) is exact; "
        "δ is taken as 0 where it varies. Nothing here knows of saturation, of the moving rim or of the "
        "ring, so that a line is a guide to where a border lies and not the border."
    )
    return Chapter("theory", "Theory beside it", note, tuple(exhibits))


def _psi_dt(scene: Scene, method: Method, axis: Axis) -> list[Line]:
    psi = _along(axis)
    models = [model_at(scene, one, scene.parameters.p) for one in psi]
    ends = np.array([end_at(scene, one) for one in psi])
    lines = [
        Line(ONE_STEP, psi, ends),
        Line(GROWTH, psi, np.array([growth_time(model) for model in models])),
    ]
    if not is_known(method):
        return lines
    pair = pair_of(method)
    accurate = [largest_accurate_step(pair, *each, BOUND) for each in zip(models, ends, strict=True)]
    return [
        *lines,
        Line(AMPLITUDE, psi, np.array(accurate)),
        Line(EXPLICIT, psi, np.array([explicit_limit(pair, model) for model in models])),
    ]


def _dt_h(scene: Scene, method: Method, plane: Plane) -> list[Line]:
    model = model_at(scene, scene.parameters.psi, scene.parameters.p)
    end, low, high = scene.time.end, plane.y.values[0], plane.y.values[-1]
    upright = {ONE_STEP: end, GROWTH: growth_time(model)}
    if is_known(method):
        pair = pair_of(method)
        upright |= {
            AMPLITUDE: largest_accurate_step(pair, model, end, BOUND),
            EXPLICIT: explicit_limit(pair, model),
        }
    lines = [Line(name, np.array([at, at]), np.array([low, high])) for name, at in upright.items()]
    across = np.array([plane.x.values[0], plane.x.values[-1]])
    return [*lines, Line(RESOLVED, across, np.full(2, resolvable_h(model, method.space)))]


def _psi_p(scene: Scene, plane: Plane) -> list[Line]:
    """Where waves begin to grow (k_crit^2 = 0) and where infinitely many do (e = 0), for both delta."""
    p, par = _along(plane.y), scene.parameters
    psi_per_slope = 1 / sigma_prime(replace(par, psi=1.0))
    across = np.array([plane.x.values[0], plane.x.values[-1]])
    stiff = 1 + par.nu_prime
    return [
        Line("b(0) = 0: waves grow beyond, δ = 0", (par.mu + stiff - p) * psi_per_slope, p),
        Line("e = 0, δ = 0: all waves grow above", across, np.full(2, stiff)),
        Line("e = 0, δ = 1: the same in the ring", across, np.full(2, stiff / 1.5)),
    ]


def _along(axis: Axis) -> np.ndarray:
    low, high = axis.values[0], axis.values[-1]
    return np.geomspace(low, high, _SAMPLES) if axis.log else np.linspace(low, high, _SAMPLES)


def _crosses(line: Line, plane: Plane) -> bool:
    """Whether any of it lies in the plane."""
    inside = (line.x >= plane.x.values[0]) & (line.x <= plane.x.values[-1])
    inside &= (line.y >= plane.y.values[0]) & (line.y <= plane.y.values[-1])
    return bool(inside.any())


def _sheet(scene: Scene, methods: Sequence[Method]) -> Sheet:
    header = ("ψ", "end", "λ of w1,1", "μ/f′", "k_crit", "method")
    rows: list[tuple[str, ...]] = [(*header, "Δt, w1,1 right", "Δt, explicit limit", "h, k_crit resolved")]
    for psi in sorted({10.0, 100.0, scene.parameters.psi, 1e3, 1e4}):
        model, end = model_at(scene, psi, scene.parameters.p), end_at(scene, psi)
        rate = leading_rate(model, wavenumber(*FASTEST) ** 2)
        for method in filter(is_known, methods):
            pair, h = pair_of(method), resolvable_h(model, method.space)
            first = (
                f"{psi:g}", f"{end:.3g}", f"{rate.real:.4g}", f"{growth_time(model):.3g}",
                f"{np.pi * method.space / h:.3g}" if np.isfinite(h) else "none",
            )  # fmt: skip
            limit = explicit_limit(pair, model)
            rows.append(
                (
                    *first,
                    method.name,
                    f"{largest_accurate_step(pair, model, end, BOUND):.2g}",
                    f"{limit:.2g}" if np.isfinite(limit) else "none",
                    f"{h:.2g}" if np.isfinite(h) else "none",
                )
            )
    note = (
        "End of a run; largest rate (3.6); growth time; sqrt(k²_crit); Δt up to which w1,1's amplitude at "
        f"the end is right within {BOUND:.0%} (at most the end); Δt beyond which the scheme amplifies the "
        "shortest waves, on any mesh; h at which the shortest wave that nodes hold, π k/h, is k_crit."
    )
    return Sheet("limits", "Limits", note, tuple(rows))
