"""Exact modes of the disk for every closure: the growth rates of the *moving* cell about a = 1, u = 0.

Thresholds are where the first of them stops decaying.

The article's dispersion relation takes eigenfunctions with n.grad w = 0 for the displacement too (3.4), which
is not the model's boundary condition.  Here the boundary conditions are kept.  With delta constant and
everything proportional to exp(lambda t), write s1 = mu1 lambda + 1, s2 = mu2 lambda + nu',
K = mu lambda + 1 + nu' - p_e, rho = lambda (`viscoelastic`, u the displacement), or s1 = mu1, s2 = mu2,
K = mu, rho = 1 (`viscous`, u the velocity).  In the disk

    s1 (grad phi + (1/2) rot omega) + grad(s2 phi - p_e phi + f' a) = 0,    phi = div u, omega = curl u,
    (lambda + k_a) a - d Lap a + rho phi = 0,

so h = K phi + f' a is harmonic with conjugate (s1/2) omega: h = H r^m cos m theta and
omega = (2/s1) H r^m sin m theta.  Then Lap a = (q/d) a + rho h/(K d) with q = lambda + k_a - rho f'/K, hence,
J^ being J_m(kappa r)/kappa^m, kappa^2 = -q/d, and with H = K q s1 eta,

    a   = [ alpha K q J^  - rho s1 eta r^m ] cos m theta,
    u_r = [ -alpha f' d dJ^/dr        + eta U r^(m+1) + C m r^(m-1) ] cos m theta,
    u_t = [  alpha f' d (m/r) J^      + eta V r^(m+1) - C m r^(m-1) ] sin m theta,
    phi = [ -alpha f' q J^ + eta P r^m ] cos m theta,           P = (lambda + k_a) s1,  W = 2 K q,
    U = ((m+2) P - m W)/(4(m+1)),   V = ((m+2) W - m P)/(4(m+1)).

Conditions at r = 1: da/dr = 0 and, the traction (sigma_v + sigma_e) n carrying s2 without p_e because sigma_p
does not vanish there,

    normal closures      u_t = 0,  s1 du_r/dr + s2 phi = 0;
    `traction-free`      s1 du_r/dr + s2 phi = 0,  du_t/dr - u_t - m u_r = 0; for m = 1 the gauge's uniform
                         force parts omega from h (unknown gamma) and asks for int u = 0;
    `irrotational-wall`  u_r = 0,  omega = 0: H = 0 and J_m'(kappa) = 0, the dispersion relation (3.6).

At q = 0 the alpha and C columns coincide, and to the next order alpha and eta: a double zero of the
determinant that is no mode; it is divided out.  For m = 0 the determinant factors by hand.  What is left is
analytic where K != 0, and its zeros are counted by the argument principle: a list of roots is complete or it
is an error.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import jv, jve

from actin_xcheck.core.model import Closure, Model, Rheology
from actin_xcheck.theory.dispersion import active_slope, stiffness

ComplexArray = NDArray[np.complex128]
Bessel = Callable[[int, ComplexArray], ComplexArray]

LARGEST_PSI = 1e5
"""Beyond it a threshold is not looked for: the article's largest psi is 1.04e5."""


@dataclass(frozen=True)
class DiskModes:
    """The modes with angular number m of a model with constant delta on the unit disk.

    Parameters
    ----------
    model : parameters, rheology and closure; delta must be constant where p != 0 (ValueError otherwise).
    m : angular number, >= 0.
    """

    model: Model
    m: int

    def __post_init__(self) -> None:
        stiffness(self.model)  # raises where delta varies

    def boundary_points(self) -> dict[str, float]:
        """Real points left of which no list is complete: roots accumulate there or conditions degenerate."""
        p, closure = self.model.parameters, self.model.closure
        if self.model.rheology is Rheology.VISCOUS:
            return {}
        points = {"-(1 + nu' - p_e)/mu": -stiffness(self.model) / p.mu, "-1/mu1": -1 / p.mu1}
        if closure in {Closure.REFERENCE_NORMAL, Closure.CURRENT_NORMAL} and self.model.sees("phi"):
            points["-(1 + nu')/mu"] = -(1 + p.nu_prime) / p.mu
        if closure is Closure.TRACTION_FREE:
            points["-(1/2 + nu')/(mu1/2 + mu2)"] = -(0.5 + p.nu_prime) / (p.mu1 / 2 + p.mu2)
        return points

    def determinant(self, rate: ArrayLike, bessel: Bessel = jve) -> ComplexArray:
        """Return the determinant at complex rates, of their shape: analytic up to a positive factor.

        `jve` keeps it in range along contours, `scipy.special.jv` makes it analytic.
        """
        z = np.asarray(rate, dtype=complex)
        s1, s2, K, rho = self.moduli(z)
        reaction, d = self.model.reaction_rate(), self.model.parameters.d
        q = z + reaction - rho * active_slope(self.model) / K
        closure = self.model.closure
        if self.m == 0:  # da/dr = 0 leaves J_1(kappa)/kappa = 0 or a uniform state
            kappa = np.sqrt(-q / d)
            expansion = z**0 if closure is Closure.IRROTATIONAL_WALL else s1 / 2 + s2
            return np.asarray(bessel(1, kappa) / kappa * (z + reaction) * expansion)
        if closure is Closure.IRROTATIONAL_WALL:
            return _regular(self.m, np.sqrt(-q / d), bessel)[1]
        return _det(self.conditions(z, bessel)) / (K * q**2)

    def conditions(self, z: ComplexArray, bessel: Bessel = jv) -> list[list[ComplexArray]]:
        """Return the rim's conditions on (alpha, eta, C[, gamma]) at rates z: rows of arrays of z's shape.

        For m = 0, which has no C, on (alpha, eta); not for `irrotational-wall`.
        """
        s1, s2, K, rho = self.moduli(z)
        reaction, d = self.model.reaction_rate(), self.model.parameters.d
        m, slope = self.m, active_slope(self.model)
        q = z + reaction - rho * slope / K
        j, dj = _regular(m, np.sqrt(-q / d), bessel)
        P, U, V = self.swirl(z)
        zero, one = np.zeros_like(z), np.ones_like(z)
        ddj = -dj + (q / d + m**2) * j
        radial = [-slope * d * dj, U, m * one]
        angular = [slope * d * m * j, V, -m * one]
        radial_slope = [-slope * d * ddj, (m + 1) * U, m * (m - 1) * one]
        angular_slope = [slope * d * m * (dj - j), (m + 1) * V, -m * (m - 1) * one]
        dilation = [-slope * q * j, P, zero]
        no_flux = [K * q * dj, -m * rho * s1, zero]
        traction = [s1 * e + s2 * f for e, f in zip(radial_slope, dilation, strict=True)]
        if m == 0:
            return [no_flux[:2], traction[:2]]
        if self.model.closure is not Closure.TRACTION_FREE:
            return [no_flux, angular, traction]
        shear = [t - u - m * r for t, u, r in zip(angular_slope, angular, radial, strict=True)]
        if m > 1:
            return [no_flux, traction, shear]
        # gamma: omega alone, in units of r sin theta; U = -1/8, V = 3/8
        mean = [-slope * d * j, (U - V) / 4, one, -one / 8]
        return [[*no_flux, zero], [*traction, -s1 / 4], [*shear, one / 2], mean]

    def swirl(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """P, U and V of the displacement that belongs to the harmonic part h, per eta."""
        s1, _, K, rho = self.moduli(z)
        m, reaction = self.m, self.model.reaction_rate()
        P = (z + reaction) * s1
        W = 2 * (K * (z + reaction) - rho * active_slope(self.model))
        return P, ((m + 2) * P - m * W) / (4 * (m + 1)), ((m + 2) * W - m * P) / (4 * (m + 1))

    def count(self, above: float) -> int:
        """Return how many growth rates have a real part > `above`; raises as `rates` does."""
        if blocking := {name: x for name, x in self.boundary_points().items() if x >= above}:
            named = ", ".join(f"{name} = {x:.6g}" for name, x in blocking.items())
            raise ValueError(f"above = {above:g} must lie right of {named}")
        count = self._count(self._box(above))
        if self._count(self._box(above, 4.0)) != count:
            raise ArithmeticError(f"m = {self.m}: modes beyond the search box {self._box(above)}")
        return count

    def rates(self, above: float) -> ComplexArray:
        """Return every growth rate with real part > `above`, by decreasing real part, pairs + first.

        Raises
        ------
        ValueError : `above` is not right of all `boundary_points`.
        ArithmeticError : the roots found do not match the argument principle's count.
        """
        count = self.count(above)
        roots = np.array(self._roots(self._box(above), count), dtype=complex)
        real = np.abs(roots.imag) < 1e-10 * (1 + np.abs(roots))
        roots[real] = roots[real].real
        if len(np.unique(roots.round(9))) != count or not np.isclose(roots.imag.sum(), 0):
            raise ArithmeticError(f"m = {self.m}: {count} modes counted, found {roots}")
        return roots[np.lexsort((-roots.imag, -roots.real.round(9)))]

    def _box(self, above: float, factor: float = 1.0) -> tuple[float, float, float, float]:
        """(left, right, bottom, top) of a rectangle that holds every rate right of `above`.

        Force over the least viscosity that can resist it, twice; not symmetric, so that no cut through the
        middle meets the real axis.
        """
        p = self.model.parameters
        pressure = 1.5 * abs(p.p) if self.model.laws.pressure is None else self.model.strength
        force = abs(active_slope(self.model)) + 1 + p.nu_prime + pressure
        reach = factor * 2 * (force / (p.mu1 / 2) + 1 + abs(above))
        return above, reach, -reach, 1.0000003 * reach

    def moduli(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
        """s1, s2, K and rho."""
        p, one = self.model.parameters, np.ones_like(z)
        if self.model.rheology is Rheology.VISCOUS:
            return p.mu1 * one, p.mu2 * one, p.mu * one, one
        return p.mu1 * z + 1, p.mu2 * z + p.nu_prime, p.mu * z + stiffness(self.model), z

    def _count(self, box: tuple[float, float, float, float]) -> int:
        """Zeros in a rectangle (left, right, bottom, top) by the argument principle."""
        left, right, bottom, top = box
        corners = np.array([left + 1j * bottom, right + 1j * bottom, right + 1j * top, left + 1j * top])
        path = np.concatenate(
            [np.linspace(a, b, 8, endpoint=False) for a, b in zip(corners, np.roll(corners, -1), strict=True)]
        )
        path = np.append(path, path[0])
        values, steepness = self._with_steepness(path)
        confirmed = None
        for _ in range(80):
            length = np.abs(np.diff(path))
            # near either end of an interval no zero is closer than its length; zeros crowd near the origin
            coarse = length * np.maximum(steepness[1:], steepness[:-1]) > 1
            coarse |= length > 0.3 * (np.abs(path[1:]) + 0.05)
            if not coarse.any():
                turns = int(np.rint(np.angle(values[1:] / values[:-1]).sum() / (2 * np.pi)))
                if turns == confirmed:
                    return turns
                confirmed, coarse = turns, np.ones_like(coarse)  # halve everything: the count must stand
            at = np.flatnonzero(coarse)
            middle = (path[at] + path[at + 1]) / 2
            more, steeper = self._with_steepness(middle)
            path, values, steepness = (
                np.insert(old, at + 1, new)
                for old, new in ((path, middle), (values, more), (steepness, steeper))
            )
        raise ArithmeticError(f"m = {self.m}: a mode lies on the edge of {box}")

    def _with_steepness(self, z: ComplexArray) -> tuple[ComplexArray, NDArray[np.float64]]:
        """The determinant and |D'/D|, about the inverse distance to the nearest zero.

        In two directions: `jve`'s positive factor is no analytic function and hides a phase in one of them.
        """
        step, value = 1e-6 * (1 + np.abs(z)), self.determinant(z)
        slopes = [np.abs(self.determinant(z + way * step) - value) / step for way in (1, 1j)]
        return value, np.maximum(*slopes) / np.abs(value)

    def _roots(self, box: tuple[float, float, float, float], count: int) -> list[complex]:
        """Halve boxes until each holds one zero, then polish it."""
        if count == 0:
            return []
        left, right, bottom, top = box
        if count == 1 and (root := self._polished(box)) is not None:
            return [root]
        if max(right - left, top - bottom) < 1e-7:
            raise ArithmeticError(f"m = {self.m}: {count} modes within 1e-7 of {left + 1j * bottom}")
        if right - left >= top - bottom:
            middle = left + 0.4837 * (right - left)
            halves = (left, middle, bottom, top), (middle, right, bottom, top)
        else:
            middle = bottom + 0.4837 * (top - bottom)
            halves = (left, right, bottom, middle), (left, right, middle, top)
        first = self._count(halves[0])
        return self._roots(halves[0], first) + self._roots(halves[1], count - first)

    def _polished(self, box: tuple[float, float, float, float]) -> complex | None:
        """Secant iteration inside a box that holds one zero; None where it leaves the box."""
        left, right, bottom, top = box
        old = complex((left + right) / 2, (bottom + top) / 2)
        new = old + 1e-3 * complex(right - left, top - bottom)
        f_old, f_new = (complex(self.determinant(z, jv)) for z in (old, new))
        for _ in range(60):
            if f_new == f_old or not np.isfinite(f_new):
                return None
            step = -f_new * (new - old) / (f_new - f_old)
            old, f_old, new = new, f_new, new + step
            if not (left <= new.real <= right and bottom <= new.imag <= top):
                return None
            f_new = complex(self.determinant(new, jv))
            if abs(step) < 1e-14 * (1 + abs(new)) or f_new == 0:
                return new
        return None


def _regular(m: int, kappa: ComplexArray, bessel: Bessel) -> tuple[ComplexArray, ComplexArray]:
    """J_m(kappa r)/kappa^m at r = 1 and its derivative in r."""
    power = kappa**m
    value = bessel(m, kappa)
    return value / power, (m * value - kappa * bessel(m + 1, kappa)) / power


def _det(rows: list[list[ComplexArray]]) -> ComplexArray:
    """Determinant of a matrix of arrays, columns scaled by positive numbers to stay in range."""
    matrix = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    return np.asarray(np.linalg.det(matrix))


@dataclass(frozen=True)
class Threshold:
    """psi*(p, m): where some rate of angular number m first reaches Re lambda = 0.

    Attributes
    ----------
    m : angular number.
    psi : the threshold, None where there is none.
    omega : |Im lambda| there: 0 for a real crossing, > 0 for a pair; None where there is none.
    reason : why there is none, else empty.
    """

    m: int
    psi: float | None
    omega: float | None
    reason: str = ""

    @property
    def crossing(self) -> str:
        """How it crosses: as a "pair", a "real" rate, or "none"."""
        if self.psi is None or self.omega is None:
            return "none"
        return "pair" if self.omega > 1e-6 else "real"


def threshold(model: Model, m: int) -> Threshold:
    """Return psi* of angular number m for a model's other parameters (its own psi is ignored).

    psi is raised in steps of 10 % from 0 until a mode grows, and the step that did it bisected.
    """

    def modes(psi: float) -> DiskModes:
        return DiskModes(model.varied(psi=psi), m)

    blocking = {name: x for name, x in modes(0.0).boundary_points().items() if x >= 0}
    if blocking:
        named = ", ".join(f"{name} = {x:.6g}" for name, x in blocking.items())
        return Threshold(m, None, None, f"infinitely many modes grow for every psi: {named}")
    if modes(0.0).count(0.0):
        return Threshold(m, None, None, "a mode grows at psi = 0 already")
    low, high = 0.0, 1.0
    while not modes(high).count(0.0):
        low, high = high, 1.1 * high
        if high > LARGEST_PSI:
            return Threshold(m, None, None, f"no mode grows up to psi = {LARGEST_PSI:g}")
    while high - low > 1e-11 * high:
        middle = (low + high) / 2
        if modes(middle).count(0.0):
            high = middle
        else:
            low = middle
    critical = modes(high).rates(0.0)
    leading = critical[np.argmax(critical.real)]
    return Threshold(m, high, abs(float(leading.imag)))


def lowest(thresholds: Iterable[Threshold]) -> Threshold | None:
    """Return psi*(p), the least of psi*(p, m) over m, with its mode; None where no mode has a threshold."""
    found = [(one.psi, one) for one in thresholds if one.psi is not None]
    return min(found, key=lambda pair: pair[0])[1] if found else None
