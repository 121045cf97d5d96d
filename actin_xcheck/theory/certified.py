"""The list of growth rates as a theorem: bounds by hand, counts and enclosures in ball arithmetic.

Three steps, each a proof (the derivation stands in docs/certified.md):

1. By testing the transport equation with a itself: every mode right of `above` has m < M (`beyond`), and lies
   in a rectangle for its m (`region`).
2. The determinant of `exact.py` over q^2 is analytic there, and its argument along the rectangle is followed
   through balls that do not hold 0: the number of modes inside.
3. Newton's interval operator maps a ball around each rate into itself: it holds exactly one mode.

As many disjoint balls as the count says make the list complete.  Needs python-flint, whose `arb` numbers are
intervals with rigorous rounding; parameters are taken as the doubles that they are.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from actin_xcheck.core.model import Closure, Model, Rheology
from actin_xcheck.theory.dispersion import active_slope, stiffness
from actin_xcheck.theory.exact import DiskModes

_BITS = 128
_SMALLEST = 1e-13
"""Of a piece of a contour: a mode may lie on it."""


@dataclass(frozen=True)
class Certified:
    """A mode that exists: its angular number, and a ball that holds its rate and no other.

    Attributes
    ----------
    m : angular number.
    rate : the middle of the ball.
    radius : of the ball, so that the rate is known to 12 digits at least.
    """

    m: int
    rate: complex
    radius: float


@dataclass(frozen=True)
class Region:
    """Where modes of an angular number can be: Re <= right, |Im| <= top; nowhere if empty."""

    right: float
    top: float
    empty: bool = False


def proved(model: Model, numbers: range | None, above: float) -> tuple[list[Certified], int]:
    """Return every mode right of `above` of the angular numbers, all that can have one if None is given.

    Also the M from which on no angular number has one.

    Raises
    ------
    ValueError : `above` is not right of where rates accumulate, or nothing is derived for the closure.
    ArithmeticError : what is found is not proved.
    ImportError : python-flint is not installed.
    """
    import flint

    none_from = beyond(model, above)
    found: list[Certified] = []
    before, flint.ctx.prec = flint.ctx.prec, _BITS
    try:
        for m in range(none_from) if numbers is None else numbers:
            found += _Disk(model, m).proved(above) if m < none_from else []
    finally:
        flint.ctx.prec = before
    return found, none_from


def crossing(model: Model, m: int, psi: float, share: float = 1e-9) -> tuple[float, float]:
    """Return psi's between which a mode of angular number m crosses Re lambda = 0, around a known threshold.

    None grows at the first, at least one does at the second; errors as `proved`, ArithmeticError too where
    that is not so.
    """
    import flint

    low, high = psi * (1 - share), psi * (1 + share)
    before, flint.ctx.prec = flint.ctx.prec, _BITS
    try:
        counts = []
        for one in (low, high):
            _check(model.varied(psi=one), 0.0)
            counts.append(_Disk(model.varied(psi=one), m).count(0.0))
    finally:
        flint.ctx.prec = before
    if counts[0] or not counts[1]:
        raise ArithmeticError(f"m = {m}: {counts} modes grow at psi = {low:.12g} and {high:.12g}")
    return low, high


def region(model: Model, m: int, above: float) -> Region:
    """Return where modes right of `above` can be, from Re z + k + d x^2 <= g(x), |Im z| <= g(x).

    x >= m is |grad a|/|a|, and g(x) = G (1 + beta/(2 m + 2) + alpha sqrt((1 + x)/(m + 1))).
    """
    size, alpha, beta = _bounds(model, m, above)
    d, rest = model.parameters.d, model.reaction_rate() + above

    def g(x: float) -> float:
        return size * (1 + beta / (2 * m + 2) + alpha * math.sqrt((1 + x) / (m + 1)))

    def excess(x: float) -> float:  # convex
        return d * x**2 + rest - g(x)

    x = float(m)
    while excess(x) <= 0 or 2 * d * x < size * alpha / (2 * math.sqrt((1 + x) * (m + 1))):
        x = 1.01 * x + 0.01
    if x == m > 0 and excess(x) > 1e-9:
        return Region(above, 0.0, empty=True)
    most = g(x) * (1 + 1e-9) + 1e-3
    right = most - model.reaction_rate() - d * m**2
    # m = 0: the cell's even expansion and decay, s1/2 + s2 = 0 and z = -k_a, which the estimate does not see
    return Region(right if m else max(right, 0.1), most)


def beyond(model: Model, above: float) -> int:
    """Return M: no angular number m >= M has a mode right of `above`; ValueError as `proved`."""
    _check(model, above)
    d, m = model.parameters.d, 1
    while True:
        size, alpha, beta = _bounds(model, m, above, all_beyond=True)
        if d * m**2 > size * (1 + beta / (2 * m + 2) + alpha) * (1 + 1e-9):
            return m
        m += 1


def _check(model: Model, above: float) -> None:
    if model.closure is Closure.TRACTION_FREE:
        raise ValueError(f"closure '{model.closure}': its modes are counted in floating point only")
    if not above > -model.reaction_rate():
        raise ValueError(f"above = {above:g} must lie right of -k_a = {-model.reaction_rate():g}")
    blocking = {name: x for name, x in DiskModes(model, 1).boundary_points().items() if x >= above}
    if blocking or (model.rheology is Rheology.VISCOELASTIC and stiffness(model) < 0):
        raise ValueError(f"above = {above:g} must lie right of where rates accumulate: {blocking}")
    if model.parameters.d <= 0:
        raise ValueError("without diffusion (d = 0) there are infinitely many modes")


def _bounds(model: Model, m: int, above: float, all_beyond: bool = False) -> tuple[float, float, float]:
    """G, alpha and beta: of |f' rho/K|, |(s1 + s2)/D| and |s1/D| right of `above`, see docs/certified.md.

    Each is a quotient of linear functions of z with real coefficients: its modulus in a half-plane right of
    its pole is largest on the real axis, at `above` or at infinity.  With `all_beyond` for all numbers >= m.
    """
    p, slope, e = model.parameters, abs(active_slope(model)), stiffness(model)
    if model.rheology is Rheology.VISCOUS:
        rho, K, s1, whole = (0.0, 1.0), (0.0, p.mu), (0.0, p.mu1), (0.0, p.mu)
    else:
        rho, K, s1, whole = (1.0, 0.0), (p.mu, e), (p.mu1, 1.0), (p.mu, 1 + p.nu_prime)
    size = slope * _largest(rho, K, above)
    if model.closure is Closure.IRROTATIONAL_WALL or m == 0:
        return size, 0.0, 0.0
    if all_beyond:
        least = 1 - (_largest(K, whole, above) + _largest(s1, whole, above) / 2) / (m + 1)
        if least <= 0:
            return size, math.inf, math.inf
        return size, 1 / least, _largest(s1, whole, above) / least
    D = (
        whole[0] - K[0] / (m + 1) - s1[0] / (2 * m + 2),
        whole[1] - K[1] / (m + 1) - s1[1] / (2 * m + 2),
    )
    return size, _largest(whole, D, above), _largest(s1, D, above)


def _largest(over: tuple[float, float], under: tuple[float, float], above: float) -> float:
    """Bound |(a z + b)/(c z + d)| right of `above`, a hair above what rounding makes of it."""
    (a, b), (c, d) = over, under
    least = c * above + d
    if c < 0 or least <= 0:
        raise ValueError(f"above = {above:g} must lie right of {-d / c if c else math.inf:g}")
    at_infinity = [abs(a) / c] if c > 0 else []
    return max(abs(a * above + b) / least, *at_infinity, 0.0) * (1 + 1e-12)


@dataclass(frozen=True)
class _Dual:
    """A ball and one of the derivative in z there."""

    value: Any
    slope: Any

    def __add__(self, other: Any) -> "_Dual":
        other = _dual(other)
        return _Dual(self.value + other.value, self.slope + other.slope)

    def __mul__(self, other: Any) -> "_Dual":
        other = _dual(other)
        return _Dual(self.value * other.value, self.slope * other.value + self.value * other.slope)

    def __truediv__(self, other: "_Dual") -> "_Dual":
        value = self.value / other.value
        return _Dual(value, (self.slope - value * other.slope) / other.value)

    def __sub__(self, other: Any) -> "_Dual":
        return self + _dual(other) * -1

    __radd__, __rmul__ = __add__, __mul__


def _dual(given: Any) -> _Dual:
    return given if isinstance(given, _Dual) else _Dual(given, 0)


class _Disk:
    """The determinant of one angular number in ball arithmetic."""

    def __init__(self, model: Model, m: int) -> None:
        from flint import acb, arb

        self._acb, self._arb = acb, arb
        self.model, self.m = model, m
        p = model.parameters
        exact = {name: acb(getattr(p, name)) for name in ("psi", "p", "d", "a_sat", "mu1", "mu2", "nu")}
        self.d, self.mu1, self.mu2 = exact["d"], exact["mu1"], exact["mu2"]
        self.nu = exact["nu"] / (1 - 2 * exact["nu"])
        delta = 0 if p.p == 0 else int(model.delta == "full")
        one = 1 / exact["a_sat"]
        self.slope = exact["psi"] * (2 - one) * (-one).exp() + exact["p"] * delta / acb.pi()
        self.pressure = exact["p"] * (2 + delta) / 2
        self.reaction = acb(model.reaction_rate())

    def proved(self, above: float) -> list[Certified]:
        """Return every mode right of `above`, or raise as `proved`."""
        count = self.count(above)
        found = []
        for rate in DiskModes(self.model, self.m).rates(above) if count else ():
            ball = self._enclosed(complex(rate))
            if not ball.real > above:
                raise ArithmeticError(f"m = {self.m}: the mode at {rate:.12g} may not be right of {above:g}")
            rounding = 2.0**-52 * abs(rate)  # of its middle to a double
            found.append(Certified(self.m, complex(ball.mid()), float(ball.rad()) + rounding))
        apart = all(
            abs(one.rate - other.rate) > one.radius + other.radius
            for i, one in enumerate(found)
            for other in found[:i]
        )
        if count != len(found) or not apart:
            raise ArithmeticError(f"m = {self.m}: {count} modes are there, {len(found)} were found")
        return found

    def _enclosed(self, rate: complex) -> Any:
        """A ball around a rate that Newton's operator z - f(z)/f'(ball) maps into itself."""
        acb, arb = self._acb, self._arb
        middle = acb(rate.real, rate.imag)
        for _ in range(4):
            value = self._at(middle)
            middle = acb((middle - value.value / value.slope).mid())
        for digits in (30, 26, 22, 18, 15, 13):
            reach = arb(0, 10.0**-digits * max(abs(rate), 1e-3))
            ball = middle + acb(reach, reach)
            image = middle - self._at(middle).value / self._at(ball).slope
            if ball.contains_interior(image):
                return image
        raise ArithmeticError(f"m = {self.m}: no ball around {rate:.12g} is mapped into itself")

    def count(self, above: float) -> int:
        """How many modes are right of `above`, or raise as `proved`."""
        where = region(self.model, self.m, above)
        return 0 if where.empty or where.right <= above else self.winding(above, where.right, where.top)

    def winding(self, left: float, right: float, top: float) -> int:
        """Zeros in a rectangle about the real axis: the change of the argument around it, over 2 pi.

        Twice that along its upper half, for the function is real on the axis.
        """
        path = [complex(right), complex(right, top), complex(left, top), complex(left)]
        pieces, total = list(pairwise(path)), self._arb(0)
        while pieces:
            a, b = pieces.pop()
            change = self._change(a, b)
            if change is not None:
                total += change
            elif abs(b - a) < _SMALLEST * (1 + abs(a)):
                raise ArithmeticError(f"m = {self.m}: a mode may lie on the contour at {a:.6g}")
            else:
                pieces += [((a + b) / 2, b), (a, (a + b) / 2)]
        turns = (total / self._arb.pi()).unique_fmpz()
        if turns is None:
            raise ArithmeticError(f"m = {self.m}: no whole number of turns")
        return int(turns)

    def _change(self, a: complex, b: complex) -> Any | None:
        """The change of the argument from a to b, None where the values in between may be 0.

        By the mean value theorem they lie in f(middle) + f'(ball) (ball - middle), which is convex.
        """
        acb = self._acb
        start, end = (acb(z.real, z.imag) for z in (a, b))
        ball, middle = start.union(end), acb((a + b).real / 2, (a + b).imag / 2)
        centre = self._at(middle).value
        values = (centre + self._at(ball).slope * (ball - middle)) / centre
        if not (values.is_finite() and values.real > 0):
            return None
        return (self._at(end).value / centre).arg() - (self._at(start).value / centre).arg()

    def _at(self, z: Any) -> _Dual:
        """The determinant over q^2 (`exact.py`) and its derivative, for a ball z."""
        m, at = self.m, _Dual(z, self._acb(1))
        viscous = self.model.rheology is Rheology.VISCOUS
        s1 = _dual(self.mu1) if viscous else at * self.mu1 + 1
        s2 = _dual(self.mu2) if viscous else at * self.mu2 + self.nu
        K = s1 + s2 if viscous else s1 + s2 - self.pressure
        rho, k = (_dual(self._acb(1)) if viscous else at), self.reaction
        q = at + k - rho * self.slope / K
        y = q * (-1 / self.d)
        closure = self.model.closure
        if m == 0:
            wall = closure is Closure.IRROTATIONAL_WALL
            return self._e(1, y) * (at + k) * (1 if wall else s1 * self._acb(0.5) + s2)
        j, over = self._e(m, y), self._e(m + 1, y)
        dj = j * m - y * over
        if closure is Closure.IRROTATIONAL_WALL:
            return dj
        f = self.slope
        P, W = (at + k) * s1, q * K * 2
        share = self._acb(1) / (4 * (m + 1))
        U, V = (P * (m + 2) - W * m) * share, (W * (m + 2) - P * m) * share
        ddj = (q / _dual(self.d) + m**2) * j - dj
        flux = (K * q * dj, s1 * rho * (-m), _dual(self._acb(0)))
        across = (j * (f * self.d * m), V, _dual(self._acb(-m)))
        pull = (
            s1 * ddj * (-f * self.d) - s2 * q * j * f,
            s1 * U * (m + 1) + s2 * P,
            s1 * (m * (m - 1)),
        )
        return _determinant((flux, across, pull)) / (q * q)

    def _e(self, m: int, y: _Dual) -> _Dual:
        """J_m(kappa)/kappa^m as an entire function of y = kappa^2; its derivative is -1/2 that of m + 1."""
        value, slope = ((-y.value / 4).hypgeom_0f1(n + 1, regularized=True) / 2**n for n in (m, m + 1))
        return _Dual(value, -slope / 2 * y.slope)


def _determinant(rows: tuple[tuple[_Dual, ...], ...]) -> _Dual:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
