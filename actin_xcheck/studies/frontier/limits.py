"""Theory as a report shows it: lines drawn into the maps, curves and a table beside them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from actin_xcheck.core.model import Model
from actin_xcheck.report.exhibits import Chapter, Line, Plot, Sheet
from actin_xcheck.runs.method import Method
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.frontier.answers import BOUND
from actin_xcheck.studies.frontier.planes import Axis, Plane, end_at
from actin_xcheck.studies.frontier.theory import (
    FASTEST,
    computed_rate,
    constant,
    explicit_limit,
    growth_error,
    growth_time,
    is_known,
    largest_accurate_step,
    leading_rate,
    pair_of,
    resolvable_h,
)
from actin_xcheck.theory.dispersion import sigma_prime
from actin_xcheck.theory.modes import wavenumber

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
