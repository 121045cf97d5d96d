"""Growth rates out of time series, and their extrapolation to h = 0 and dt = 0."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import hankel
from scipy.optimize import least_squares
from scipy.special import exprel

from actin_xcheck.core.model import Array, Model
from actin_xcheck.theory.dispersion import Mode, active_slope, growth_rates, leading_growth_rate


@dataclass(frozen=True)
class GrowthFit:
    """A sum of exponentials through a time series: amplitude(t) = Re sum_j amplitudes[j] exp(rates[j] t).

    Attributes
    ----------
    rates : by decreasing real part, + imaginary part first.
    amplitudes : of the same order, at t = 0 of the series.
    residual : root mean square of the misfit over that of the series.
    """

    rates: tuple[complex, ...]
    amplitudes: tuple[complex, ...]
    residual: float

    @property
    def rate(self) -> complex:
        """The leading rate."""
        return self.rates[0]


def fit_growth(
    t: Array, amplitude: Array, window: tuple[float, float], exponentials: Literal[1, 2] = 1
) -> GrowthFit:
    """Fit one or two exponentials to the samples of a mode's amplitude (n,) at times t (n,) inside a window.

    One: a straight line through log|amplitude|.  Two (both real, or a conjugate pair): least squares on the
    amplitude itself, started from a matrix pencil; sampling need not be uniform.  A run that starts at u = 0
    excites both roots of (3.6) and needs two.

    Raises ValueError where the window holds too few samples (3 and 6), where one exponential is asked of a
    series that changes sign, where two are asked of a series in which only one stands out of the noise, and
    where the iteration does not settle.
    """
    inside = (t >= window[0]) & (t <= window[1])
    s, y = t[inside], amplitude[inside]
    if len(s) < 3 * exponentials:
        raise ValueError(f"{len(s)} samples in t = {window[0]:g} .. {window[1]:g}: need {3 * exponentials}")
    s = s - t[inside][0]
    rates = _one_rate(s, y) if exponentials == 1 else _two_rates(s, y)
    basis = np.exp(np.outer(s, rates))
    if exponentials == 1:
        at_start = np.array([np.sign(y[0]) * np.exp(np.mean(np.log(np.abs(y)) - rates[0].real * s))])
    else:
        at_start = np.linalg.lstsq(basis, y.astype(complex), rcond=None)[0]
    misfit = float(np.linalg.norm((basis @ at_start).real - y) / np.linalg.norm(y))
    amplitudes = at_start * np.exp(-rates * t[inside][0])
    return GrowthFit(tuple(map(complex, rates)), tuple(map(complex, amplitudes)), misfit)


def _one_rate(s: Array, y: Array) -> NDArray[np.complex128]:
    """Slope of log|y| over s."""
    if np.any(y * y[0] <= 0):
        raise ValueError("the amplitude changes sign in the window: one exponential cannot follow it")
    return np.array([polynomial.polyfit(s, np.log(np.abs(y)), 1)[1]], dtype=complex)


def _two_rates(s: Array, y: Array) -> NDArray[np.complex128]:
    """The rates mean +- sqrt(spread) that leave the least misfit (variable projection)."""
    length = s[-1]
    y = y / np.linalg.norm(y)

    def misfit(z: Array) -> Array:
        basis = _pair_basis(z[0], z[1], s / length)
        return np.asarray(basis @ np.linalg.lstsq(basis, y, rcond=None)[0] - y)

    start = _pencil(s / length, y)
    found = least_squares(misfit, start, jac="3-point", x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15)
    if not found.success:
        raise ValueError(f"no two exponentials found: {found.message}")
    root = np.sqrt(complex(found.x[1]))
    return np.array([found.x[0] + root, found.x[0] - root]) / length


def _pair_basis(mean: float, spread: float, s: Array) -> Array:
    """Two real functions that span exp((mean +- sqrt(spread)) s), smooth through spread = 0: (n, 2)."""
    root = np.sqrt(abs(spread))
    if spread >= 0:
        leading = np.exp((mean + root) * s)
        return np.stack([leading, leading * s * exprel(-2 * root * s)], axis=1)
    envelope = np.exp(mean * s)
    return np.stack([envelope * np.cos(root * s), envelope * s * np.sinc(root * s / np.pi)], axis=1)


def _pencil(s: Array, y: Array) -> Array:
    """Mean and squared half-difference of two rates by the matrix pencil on at most 200 uniform samples."""
    uniform = np.linspace(s[0], s[-1], min(len(s), 200))
    samples = CubicSpline(s, y)(uniform)
    half = len(uniform) // 2
    _, singular, modes = np.linalg.svd(hankel(samples[:half], samples[half - 1 :]), full_matrices=False)
    if singular[1] <= max(4 * singular[2], 1e-13 * singular[0]):
        raise ValueError("only one exponential stands out of the noise in the window: fit one")
    signal = modes[:2].T
    steps = np.linalg.eigvals(np.linalg.lstsq(signal[:-1], signal[1:], rcond=None)[0])
    rates = np.log(steps.astype(complex)) / (uniform[1] - uniform[0])
    return np.array([rates.mean().real, (((rates[0] - rates[1]) / 2) ** 2).real])


def amplitude_at_rest(model: Model, mode: Mode, t: ArrayLike) -> Array:
    """Return the exact amplitude a(t) of a mode that starts with a(0) = 1 and u(0) = 0; shape of t.

    With u = 0 the force balance reads mu div v = -f' a, so that a'(0) = f'/mu - k_a - d k^2: both roots of
    (3.6) are excited.  Raises ValueError unless delta is constant.
    """
    t = np.asarray(t, dtype=float)
    leading = leading_growth_rate(model, mode.m, mode.n)
    rates = growth_rates(model, mode.k**2)
    if mode.k == 0 or len(rates) == 1:
        return np.exp(leading * t).real
    par = model.parameters
    slope = active_slope(model) / par.mu - model.reaction_rate() - par.d * mode.k**2
    gap = leading - rates[1]
    # the divided difference of e^{lambda t} between the roots, which a double root turns into t e^{lambda t}
    difference = t * np.exp(leading * t) if gap == 0 else -np.exp(leading * t) * np.expm1(-gap * t) / gap
    return np.asarray(np.exp(rates[1] * t) + (slope - rates[1]) * difference).real


@dataclass(frozen=True)
class Extrapolation:
    """A value at h = 0 and dt = 0 (where they were varied) and how it was reached.

    Attributes
    ----------
    limit : the extrapolated value; real or complex as the values were.
    coefficients : of the error terms the data could determine, among "h^2", "dt", "dt^2", "h^4",
        "h^2 dt".
    residual : root mean square of the misfit; round-off where no datum is left over.
    """

    limit: complex
    coefficients: dict[str, complex]
    residual: float


def extrapolate(h: ArrayLike, dt: ArrayLike, values: ArrayLike) -> Extrapolation:
    """Extrapolate values (n,), computed at mesh sizes h (n,) and steps dt (n,), to h = dt = 0.

    Least squares with value = limit + c_h h^2 + c_t dt + c_tt dt^2 + c_hh h^4 + c_ht h^2 dt, where a term is
    kept only if the data tell it from those before it: h^2 needs two mesh sizes, h^4 three, and so on.  Where
    h or dt was not varied the limit still holds its error.  Raises ValueError unless the three arrays are of
    one length of at least 2.
    """
    h, dt, values = np.atleast_1d(h), np.atleast_1d(dt), np.atleast_1d(values)
    if not h.shape == dt.shape == values.shape or h.ndim != 1 or len(h) < 2:
        raise ValueError(f"h {h.shape}, dt {dt.shape} and values {values.shape} must be of one length >= 2")
    h_max, dt_max = float(h.max()), float(dt.max())
    H, T = h / h_max, dt / dt_max
    candidates = {
        "h^2": (H**2, h_max**2),
        "dt": (T, dt_max),
        "dt^2": (T**2, dt_max**2),
        "h^4": (H**4, h_max**4),
        "h^2 dt": (H**2 * T, h_max**2 * dt_max),
    }
    scales: dict[str, float] = {}
    columns = np.ones((len(h), 1))
    for name, (term, scale) in candidates.items():
        wider = np.column_stack([columns, term])
        # 1e-3: a term that close to the span of the others would only amplify their noise
        if wider.shape[1] <= len(h) and np.linalg.svd(wider, compute_uv=False)[-1] > 1e-3:
            columns, scales[name] = wider, scale
    solution = np.linalg.lstsq(columns, values, rcond=None)[0]
    misfit = float(np.sqrt(np.mean(np.abs(columns @ solution - values) ** 2)))
    limit, *slopes = solution.tolist()
    named = {name: slope / scale for (name, scale), slope in zip(scales.items(), slopes, strict=True)}
    return Extrapolation(limit, named, misfit)
