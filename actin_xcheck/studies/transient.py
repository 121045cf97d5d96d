"""How far perturbations of the rest state grow before they decay, where every eigenvalue says that they do.

Eigenvalues say what becomes of a perturbation in the end.  Until then a sum of decaying modes that are not
orthogonal can grow: G(t) is the largest factor by which its energy has grown (`fem/linearised.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from scipy.optimize import minimize_scalar

from actin_xcheck.core.files import replace_file
from actin_xcheck.core.model import Array, Closure, Model, Rheology
from actin_xcheck.report.exhibits import Chapter, Line, Plot, Sheet
from actin_xcheck.runs.method import PERTURBATIONS, POWERS, load
from actin_xcheck.studies.study import Report, Study, Table, Task

AMPLITUDE = 1e-6
"""Largest entry of the start of a scene: what is quadratic in it is a ten-thousandth of it."""

TIMES = np.geomspace(0.01, 10.0, 40)
"""At which G is shown."""

STEPS = np.geomspace(1e-3, 1.0, 10)
"""Of the schemes."""

SHARES = (0.25, 0.5, 0.75, 1.0)
"""Of psi at which the schemes are tried."""

MORE = 1.1
"""A scheme that amplifies more than this, relative to the model, does so by itself."""

_COEFFICIENTS = 9
"""Of the polynomials in r^2 of a start: their misfit is 1e-6 of it at most where d is that of Table 2."""


@dataclass(frozen=True)
class TransientCase:
    """Perturbations of angular number m of a model whose delta is constant."""

    model: Model
    m: int


@dataclass(frozen=True)
class LargestGrowth:
    """What becomes of perturbations of one angular number.

    Attributes
    ----------
    closure, rheology, m : of which.
    rate : the largest real part of the growth rates.
    slope : dG/dt at t = 0.
    peak, at : the largest G and when, up to the last of `TIMES`; G is inf where nothing bounds it.
    refined : how much the largest G changes on a finer ray, relative.
    growth : G at `TIMES`.
    """

    closure: Closure
    rheology: Rheology
    m: int
    rate: float
    slope: float
    peak: float
    at: float
    refined: float
    growth: Array


@dataclass(frozen=True)
class SchemeRow:
    """What a scheme makes of perturbations of one angular number by steps of one size.

    `model` and `scheme` are the largest amplifications of the model and of powers of the step, `radius` is
    the spectral radius of that, `rate` what it stands for, its logarithm over dt.
    """

    scheme: str
    m: int
    psi: float
    dt: float
    model: float
    scheme_largest: float
    radius: float
    rate: float


@dataclass(frozen=True)
class SchemeRows:
    """All schemes and steps for one angular number and psi."""

    rows: tuple[SchemeRow, ...]


def largest(case: TransientCase, folder: Path) -> LargestGrowth:
    """Compute G for one angular number, and leave the start that reaches its largest as a scene."""
    model = case.model
    of = (model.closure, model.rheology, case.m)
    if model.rim_sees_dilation:
        nothing = np.full(TIMES.size, np.inf)
        return LargestGrowth(
            *of, rate=np.nan, slope=np.inf, peak=np.inf, at=0, refined=np.nan, growth=nothing
        )
    found = load(PERTURBATIONS)(model, case.m)
    growth = np.array([found.growth(t) for t in TIMES])
    peak, at = _peak(found, growth)
    finer = load(PERTURBATIONS)(model, case.m, 4, 16).growth(at) if at else 1.0
    if at:
        replace_file(folder / scene_file(case), start_scene(case, at, found).encode())
    return LargestGrowth(
        *of,
        rate=found.leading_rate,
        slope=found.initial_slope,
        peak=peak,
        at=at,
        refined=abs(finer / peak - 1),
        growth=growth,
    )


def _peak(found: Any, growth: Array) -> tuple[float, float]:
    """The largest G over [0, the last of `TIMES`] and when it is reached; 1 at t = 0 where all decays."""
    best = int(np.argmax(growth))
    if growth[best] <= 1:
        return 1.0, 0.0
    if best == TIMES.size - 1:
        return float(growth[-1]), float(TIMES[-1])
    low, high = TIMES[max(best - 1, 0)], TIMES[best + 1]
    top = minimize_scalar(lambda t: -found.growth(t), bounds=(low, high), options={"xatol": 1e-3})
    return float(-top.fun), float(top.x)


def schemes(case: TransientCase, folder: Path) -> SchemeRows:
    """Powers of the steps of every scheme for one angular number, by steps of `STEPS`.

    In the energy with what diffusion takes in a step: without, a scheme that is explicit in a load on the rim
    amplifies what is rough there by dt/h, and the model does not.
    """
    rows, psi = [], case.model.parameters.psi
    for dt in STEPS:
        found = load(PERTURBATIONS)(case.model, case.m, 2, 8, over=float(dt))
        model = max(1.0, *(found.growth(t) for t in TIMES)) if found.leading_rate < 0 else np.inf
        for name, step in _steps().items():
            size, radius = load(POWERS)(step(found, dt))
            rate = float(np.log(max(radius, 1e-300)) / dt)
            rows.append(SchemeRow(name, case.m, psi, float(dt), model, size, radius, rate))
    return SchemeRows(tuple(rows))


def _steps() -> dict[str, Any]:
    """How each scheme makes a step, by its name."""
    constants: Any = tuple(load(f"fv.solver:{name}") for name in ("GAMMA", "DELTA"))
    gamma, delta = constants
    explicit = np.array([[0, 0, 0], [gamma, 0, 0], [delta, 1 - delta, 0]])
    implicit = np.array([[0, 0, 0], [0, gamma, 0], [0, 1 - gamma, gamma]])
    pairs = {f"pair of order {order}": order for order in (2, 3, 4, 5)}
    return {
        "article's (B.23)": lambda found, dt: found.paper_step(dt),
        **{name: lambda found, dt, order=order: found.pair_step(dt, order) for name, order in pairs.items()},
        "volumes' ARS(2,2,2)": lambda found, dt: found.pair_step(
            dt, (explicit, implicit, explicit[-1], implicit[-1])
        ),
    }


def scene_file(case: TransientCase) -> str:
    """The name of the scene that starts from the optimal perturbation."""
    return f"transient-{case.m}-{case.model.closure}-{case.model.rheology}.toml"


def start_scene(case: TransientCase, t: float, found: Any | None = None) -> str:
    """Return the scene (TOML) that starts from the perturbation of most growth at t, and ends there.

    Fields are r^m times polynomials in r^2: with u_r = U cos m theta, u_theta = Z sin m theta, those of U + Z
    begin with r^(m+1), those of U - Z with r^|m-1|.
    """
    model, m, t = case.model, case.m, round(t, 4)
    found = found or load(PERTURBATIONS)(model, m)
    nodes = found.mode.ray.nodes
    a, along, across = np.split(found.start(t)[0], 3)
    largest = max(np.abs(one).max() for one in (a, along, across))
    a, more, less = (AMPLITUDE / largest * one for one in (a, (along + across) / 2, (along - across) / 2))
    parts = {"a": (a, m), "more": (more, m + 1), "less": (less, abs(m - 1))}
    text = {key: _polynomial(nodes, values, power) for key, (values, power) in parts.items()}
    scene: dict[str, Any] = {
        "name": scene_file(case)[:-5],
        "source": f"Verification: the perturbation of angular number {m} that grows most until it decays",
        "parameters": {name: getattr(model.parameters, name) for name in _PARAMETERS},
        "model": {name: str(getattr(model, name)) for name in ("rheology", "closure", "delta")},
        "initial": {"a": f"1 + {_wave(text['a'], 'cos', m)}"},
        "time": {"end": t},
        "probes": {"points": [[0, 0], [0.4, 0], [0.8, 0], [1, 0], [0, 1]]},
        "expect": {"transient": {"m": m, "bound": {"h2": BOUND}}},
    }
    if model.rheology is Rheology.VISCOELASTIC:
        scene["initial"]["u"] = [
            f"{_wave(text['more'], 'cos', m + 1)} + {_wave(text['less'], 'cos', m - 1)}",
            f"{_wave(text['more'], 'sin', m + 1)} - {_wave(text['less'], 'sin', m - 1)}",
        ]
    return tomli_w.dumps(scene)


_PARAMETERS = ("psi", "p", "d", "a_sat", "mu1", "mu2", "nu")

BOUND = 10.0
"""Of a scene's growth, relative, per h^2: 1 % on 2113 nodes."""


def _wave(radial: str, wave: str, m: int) -> str:
    """The formula of a function of r times cos or sin of m theta."""
    if m == 0:
        return f"({radial})" if wave == "cos" else "0"
    return f"({radial})*{wave}({'' if m == 1 else f'{m}*'}theta)"


def _polynomial(r: Array, values: Array, power: int) -> str:
    """The formula of r^power times a polynomial in r^2 through values (n,) at radii (n,)."""
    basis = np.polynomial.chebyshev.chebvander(2 * r**2 - 1, _COEFFICIENTS - 1) * r[:, None] ** power
    fitted = np.linalg.lstsq(basis, values, rcond=None)[0]
    coefficients = np.polynomial.Polynomial([-1, 2])  # Chebyshev's argument in s = r^2
    monomials = np.polynomial.Chebyshev(fitted)(coefficients).coef
    nested = f"{monomials[-1]:.12g}"
    for one in monomials[-2::-1]:
        nested = f"{one:.12g} + r**2*({nested})"
    return f"r{f'**{power}' if power > 1 else ''}*({nested})" if power else nested


def transient(models: Sequence[Model], numbers: Sequence[int]) -> Study:
    """Chart G over time for each model and angular number, and over psi and dt for the schemes.

    Schemes are those of the first model.
    """
    cases = [TransientCase(model, m) for model in models for m in numbers]
    psi = models[0].parameters.psi
    tried = [TransientCase(models[0].varied(psi=share * psi), m) for share in SHARES for m in numbers]
    if models[0].rim_sees_dilation:
        tried = []
    answers = yield [
        *(Task(largest, one, 6.0) for one in cases),
        *(Task(schemes, one, 8.0) for one in tried),
    ]
    found, stepped = answers[: len(cases)], answers[len(cases) :]
    rows = [row for answer in stepped for row in answer.rows]
    said = [replace(one, growth=one.growth[:0]) for one in found]
    tables = {
        "transient": Table("Largest amplification", said, shown=_SHOWN),
        "schemes": Table("Powers of the schemes' steps", rows),
    }
    return Report(
        "Growth before decay",
        _LEAD,
        tables=tables if rows else {"transient": tables["transient"]},
        findings=(*_findings(found), *_scheme_findings(rows)),
        chapters=(_growth_chapter(found), *([_scheme_chapter(rows)] if rows else [])),
    )


_SHOWN = ("closure", "rheology", "m", "rate", "slope", "peak", "at", "refined")

_LEAD = (
    "The largest factor G(t) by which the energy (1/2) ∫ a² + ε(u):ε(u) + ν'φ² of a small perturbation of "
    "a = 1, u = 0 has grown at t, over all perturbations of an angular number; for the viscous rheology the "
    "energy is that of a. Where all rates are negative everything decays in the end; G says how far it may "
    "grow before."
)


def _findings(found: Sequence[LargestGrowth]) -> list[str]:
    stable = [one for one in found if one.rate < 0 and one.peak > 1 and np.isfinite(one.peak)]
    said = [
        f"{one.closure}, {one.rheology}, m = {one.m}: every mode decays, and an energy grows {one.peak:.4g} "
        f"times (an amplitude {one.peak**0.5:.3g} times) by t = {one.at:.3g}"
        for one in sorted(stable, key=lambda one: -one.peak)[:3]
    ]
    if any(one.peak == np.inf for one in found):
        said.append(
            "viscoelastic cells with p ≠ 0 and a free rim: no energy of first derivatives bounds the dilation"
            " that the rim's load takes, and G is infinite for every t > 0"
        )
    return said


def _growth_chapter(found: Sequence[LargestGrowth]) -> Chapter:
    plots = []
    for closure, rheology in dict.fromkeys((one.closure, one.rheology) for one in found):
        lines = tuple(
            Line(f"m = {one.m}", TIMES, one.growth)
            for one in found
            if (one.closure, one.rheology) == (closure, rheology) and np.isfinite(one.peak)
        )
        key, title = f"{closure}-{rheology}", f"{closure}, {rheology}"
        if lines:
            plots.append(Plot(key, title, "", "t", lines, log=True, ylabel="G(t)"))
    return Chapter("growth", "Growth before decay", "", tuple(plots))


def _scheme_chapter(rows: Sequence[SchemeRow]) -> Chapter:
    """Where schemes amplify what the model damps, over psi and dt, and how much at the largest psi."""
    head = (
        "scheme",
        "ψ",
        f"dt from which it amplifies {MORE:g} times as much",
        "dt from which it grows for ever",
    )
    lines: list[Line] = []
    sheet: list[tuple[str, ...]] = [head]
    for name in dict.fromkeys(row.scheme for row in rows):
        for psi in dict.fromkeys(row.psi for row in rows):
            mine = [row for row in rows if (row.scheme, row.psi) == (name, psi) and np.isfinite(row.model)]
            if mine:
                more = [row.dt for row in mine if row.scheme_largest > MORE * row.model]
                ever = [row.dt for row in mine if row.radius > 1 + 1e-9]
                sheet.append(
                    (name, f"{psi:g}", *(f"{min(dts):.3g}" if dts else "none" for dts in (more, ever)))
                )
        last = [row for row in rows if row.scheme == name and row.psi == rows[-1].psi]
        worst = [max(row.scheme_largest / row.model for row in last if row.dt == dt) for dt in STEPS]
        lines.append(Line(name, STEPS, np.array(worst)))
    note = f"Of all m; steps from {STEPS[0]:g} to {STEPS[-1]:g}, and ψ at which all modes decay."
    return Chapter(
        "schemes",
        "What the schemes amplify",
        "Powers of each scheme's step on the same ray, in the same energy: what space does is left out.",
        (
            Plot(
                "amplified",
                "Largest amplification over the model's",
                f"ψ = {rows[-1].psi:g}",
                "dt",
                tuple(lines),
                log=True,
            ),
            Sheet("damped", "Where a scheme amplifies what the model damps", note, tuple(sheet)),
        ),
    )


def _scheme_findings(rows: Sequence[SchemeRow]) -> list[str]:
    wrong = [row for row in rows if np.isfinite(row.model) and row.radius > 1 + 1e-9]
    if not rows:
        return []
    if not wrong:
        return [f"no scheme grows for ever with steps up to {STEPS[-1]:g} where the model's modes decay"]
    first = {row.scheme: row for row in sorted(wrong, key=lambda row: -row.dt)}
    return [
        f"{name} grows for ever from dt = {row.dt:.3g} on at psi = {row.psi:g} (m = {row.m}), where the "
        "model's modes decay"
        for name, row in first.items()
    ]
