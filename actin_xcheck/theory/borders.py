"""Where in the (psi, p) plane the character of each mode changes: its borders psi(p), for every closure.

A mode of a stiff cell (e = 1 + nu' - p_e > 0) passes three borders as psi rises at constant p:

    damped    its two rates meet on lambda < 0 and part as a pair: damped oscillation, the article's "Hopf";
    neutral   the pair crosses Re lambda = 0: oscillatory instability;
    real      the pair meets on lambda > 0 and parts as two real rates: the article's "Turing".

With q = k_a + d k^2 the roots of (3.6) give them in closed form (`irrotational-wall`, and m = 0 for every
closure): f' = (sqrt(mu q) - sqrt(e))^2, e + mu q and (sqrt(mu q) + sqrt(e))^2.  For m > 0 they are zeros of
the determinant D of `prediction.exact`: D(i omega) = 0 on the neutral border, D = dD/dlambda = 0 where two
real rates meet.  Both are followed in sqrt(e), in which they are smooth up to e = 0, where all three meet.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import jv

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array, Model
from actin_xcheck.theory.dispersion import (
    Mode,
    Version,
    active_slope,
    k2_crit,
    modes_below,
    sigma_prime,
    stiffness,
)
from actin_xcheck.theory.exact import DiskModes

_BEYOND = 1.3
"""A border is followed up to this multiple of the largest psi asked for, so that it may come back."""

_REAL = np.geomspace(1e-6, 100, 1000)
"""Real rates at which signs are compared."""

_RING = np.exp(2j * np.pi * np.arange(16) / 16)


@dataclass(frozen=True, eq=False)
class Branch:
    """One mode over p: psi (n_p,) on each of its borders, nan where it has none that was looked for.

    `damped` is known where it has a closed form only; elsewhere it lies where no list of rates is complete.
    """

    name: str
    m: int
    damped: Array
    neutral: Array
    real: Array


def stiffnesses(model: Model, p: Array, version: Version = Version.CORRECTED) -> Array:
    """Return e (n_p,) at pressures p; where it is not positive, infinitely many modes grow for every psi."""
    return np.array([stiffness(model.varied(psi=0.0, p=float(x)), version) for x in p])


def wall_branches(
    model: Model, p: Array, psi_max: float, version: Version = Version.CORRECTED
) -> list[Branch]:
    """Return the modes of (3.6) that grow somewhere below psi_max with p among p (n_p,), by wave number."""
    crit = max(k2_crit(model.varied(psi=psi_max, p=float(x)), version) for x in p)
    modes = [mode for mode in modes_below(float(np.sqrt(max(crit, 0.0)))) if mode.k > 0]
    return [_closed_form(str(mode), mode, model, p, version) for mode in modes]


def cell_branches(model: Model, p: Array, psi_max: float) -> list[Branch]:
    """Return the modes of the moving cell that grow somewhere with psi < psi_max, by angular number.

    Parameters
    ----------
    model : closure and delta; its psi and p are ignored.
    p : pressures (n_p,), increasing.
    psi_max : largest psi of interest.

    Raises
    ------
    ArithmeticError : what was found is not what the argument principle counts at psi_max.
    """
    stiff = stiffnesses(model, p) > 0
    found = []
    for m in _angular_numbers(model, p[stiff], psi_max):
        branches = _breathing(model, p, psi_max) if m == 0 else _Tracer(model, m, p, psi_max).branches()
        found += [replace(one, name=_name(m, n)) for n, one in enumerate(branches)]
    prove(found, model, p, psi_max)
    return found


def prove(branches: list[Branch], model: Model, p: Array, psi_max: float) -> None:
    """Hold the branches against the argument principle's count at psi_max, every 20th stiff p and the last.

    Also the real rates against the determinant's sign changes.  Angular numbers up to two beyond the largest
    that was found are counted.  ArithmeticError where they differ.
    """
    stiff = np.flatnonzero(stiffnesses(model, p) > 0)
    for row in {*stiff[::20].tolist(), int(stiff[-1])}:
        for m in range(max((one.m for one in branches), default=0) + 3):
            modes = DiskModes(model.varied(psi=psi_max, p=float(p[row])), m)
            mine = [one for one in branches if one.m == m]
            grow = 2 * sum(one.neutral[row] < psi_max for one in mine)
            real = 2 * sum(one.real[row] < psi_max for one in mine)
            if (grow, real) != (counted := (modes.count(0.0), len(_sign_changes(modes)))):
                raise ArithmeticError(
                    f"{model.closure}, m = {m}, p = {p[row]:.4g}: the borders say that {grow} modes grow at "
                    f"psi = {psi_max:g}, {real} without oscillation; there are {counted[0]} and {counted[1]}"
                )


def _name(m: int, before: int) -> str:
    return f"m = {m}" + (f", no. {before + 1}" if before else "")


def _closed_form(name: str, mode: Mode, model: Model, p: Array, version: Version) -> Branch:
    """The borders of (3.6) for one wave number."""
    par = model.parameters
    e = stiffnesses(model, p, version)
    root = np.sqrt(np.where(e > 0, e, np.nan))
    pressure = np.array([active_slope(model.varied(psi=0.0, p=float(x)), version) for x in p])
    viscous = np.sqrt(par.mu * (model.reaction_rate() + par.d * mode.k**2))
    slopes = (viscous - root) ** 2, root**2 + viscous**2, (viscous + root) ** 2
    per_psi = sigma_prime(replace(par, psi=1.0))
    return Branch(name, mode.m, *((slope - pressure) / per_psi for slope in slopes))


def _breathing(model: Model, p: Array, psi_max: float) -> list[Branch]:
    """The modes m = 0 of any closure: those of (3.6)."""
    return [one for one in wall_branches(model, p, psi_max) if one.m == 0]


def _angular_numbers(model: Model, p: Array, psi_max: float) -> Iterator[int]:
    """The m with a growing mode at psi_max for the first, middle or last of p, until two have none."""
    three = p[[0, len(p) // 2, -1]]
    idle = m = 0
    while idle < 2:
        grows = any(DiskModes(model.varied(psi=psi_max, p=float(x)), m).count(0.0) for x in three)
        idle = 0 if grows else idle + 1
        if grows:
            yield m
        m += 1


def _sign_changes(modes: DiskModes) -> Indices:
    """Where among `_REAL` the determinant, real there, changes its sign: the real growing rates."""
    return np.flatnonzero(np.diff(np.sign(modes.determinant(_REAL).real)))


class _Tracer:
    """Finds and follows the borders of the modes with one angular number m > 0."""

    def __init__(self, model: Model, m: int, p: Array, psi_max: float) -> None:
        self._model, self._m, self._p, self._psi_max = model, m, p, psi_max
        self._root = np.sqrt(np.maximum(stiffnesses(model, p), 0.0))  # sqrt(e); 0 where the cell is not stiff
        stiff = np.flatnonzero(self._root > 0)
        self._first, self._last = int(stiff[0]), int(stiff[-1])
        e = stiffnesses(model, np.array([0.0, 1.0]))
        self._e0, self._share = float(e[0]), float(e[0] - e[1])

    def branches(self) -> list[Branch]:
        """All modes that grow below psi_max at the first, middle or last stiff p, by psi at the last."""
        found: list[Branch] = []
        for row in (self._last, (self._first + self._last) // 2, self._first):
            for number in range(self._at(self._psi_max, row).count(0.0) // 2):
                psi = self._onset(row, number)
                if not any(abs(one.neutral[row] / psi - 1) < 1e-3 for one in found):
                    found.append(self._branch(row, psi, number))
        return sorted(found, key=lambda one: float(np.nanmin(one.neutral)))

    def _branch(self, row: int, psi: float, number: int) -> Branch:
        above = 1.002 * psi
        crossing = self._at(above, row).rates(0.0)
        omega = float(abs(crossing[np.argmin(crossing.real)].imag))
        neutral = self._follow(_neutral, row, np.array([omega, psi]))
        real = np.full_like(self._p, np.nan)
        for start in (row, self._last, self._first):  # wherever it becomes real in the window
            if (double := self._double(start, number)) is not None:
                real = self._follow(_double_root, start, double)
                break
        return Branch("", self._m, np.full_like(real, np.nan), neutral, real)

    def _at(self, psi: float, row: int) -> DiskModes:
        return DiskModes(self._model.varied(psi=psi, p=float(self._p[row])), self._m)

    def _onset(self, row: int, number: int) -> float:
        """The psi at which more than `number` pairs grow at one p, to a thousandth."""
        low, high = 0.0, self._psi_max
        while high - low > 5e-4 * high:
            middle = (low + high) / 2
            low, high = (low, middle) if self._at(middle, row).count(0.0) > 2 * number else (middle, high)
        return high

    def _double(self, row: int, number: int) -> Array | None:
        """(lambda, psi) near where more than `number` pairs turn real at one p; None where they do not."""
        low, high = 0.0, _BEYOND * self._psi_max
        if len(_sign_changes(self._at(high, row))) <= 2 * number:
            return None
        while high - low > 1e-3 * high:
            middle = (low + high) / 2
            more = len(_sign_changes(self._at(middle, row))) > 2 * number
            low, high = (low, middle) if more else (middle, high)
        changes = _sign_changes(self._at(high, row))
        closest = np.argmin(np.diff(changes))
        return np.array([_REAL[(changes[closest] + changes[closest + 1] + 1) // 2], high])

    def _follow(self, equations: "Equations", row: int, start: Array) -> Array:
        """Psi (n_p,) on a border that passes `start` in one row, nan where it is not followed."""
        psi = np.full_like(self._p, np.nan)
        here = self._solve(equations, self._root[row], start)
        for step, end in ((1, self._last + 1), (-1, self._first - 1)):
            s, point, slope = self._root[row], here, np.zeros(2)
            for i in range(row, end, step):
                if i != row:
                    before, s_before = point, s
                    point, s = self._walk(equations, s, point, slope, self._root[i]), self._root[i]
                    slope = (point - before) / (s - s_before)
                psi[i] = point[1]
                if point[1] > _BEYOND * self._psi_max:
                    break
        return psi

    def _walk(
        self, equations: "Equations", s: float, point: Array, slope: Array, goal: float, halvings: int = 0
    ) -> Array:
        """The border's point at sqrt(e) = goal from that at s, in halves where the prediction is poor."""
        guess = point + slope * (goal - s)
        trusted = (0.02 if slope.any() else 0.1) * np.abs(guess)
        try:
            found = self._solve(equations, goal, guess)
        except ArithmeticError:
            found = np.full(2, np.nan)
        if np.all(np.abs(found - guess) < trusted):
            return found
        if halvings == 8:
            raise ArithmeticError(
                f"{self._model.closure}, m = {self._m}: the border at psi = {point[1]:.4g} was lost on the "
                f"way to sqrt(e) = {goal:.4g}"
            )
        middle = (s + goal) / 2
        between = self._walk(equations, s, point, slope, middle, halvings + 1)
        return self._walk(equations, middle, between, (between - point) / (middle - s), goal, halvings + 1)

    def _solve(self, equations: "Equations", s: float, guess: Array) -> Array:
        """Newton's method for a border's two unknowns at sqrt(e) = s."""
        p, point = (self._e0 - s**2) / self._share, guess
        pole = s**2 / self._model.parameters.mu

        def modes(psi: float) -> DiskModes:
            return DiskModes(self._model.varied(psi=psi, p=p), self._m)

        for _ in range(12):
            values, slopes = equations(point, modes, pole)
            step = np.linalg.solve(slopes, values)
            point = point - step
            if np.all(np.abs(step) < 1e-9 * np.abs(point)):
                return point
            if not np.all(np.abs(point - guess) < 0.5 * np.abs(guess)):
                break
        raise ArithmeticError(f"no border near psi = {guess[1]:.4g}")


Equations = Callable[[Array, Callable[[float], DiskModes], float], tuple[Array, Array]]
"""Two equations and their derivatives in the two unknowns; the last argument is |K's zero|, e/mu."""


def _neutral(point: Array, modes: Callable[[float], DiskModes], pole: float) -> tuple[Array, Array]:
    """D(i omega) = 0 in (omega, psi)."""
    omega, psi = point
    small = 1e-5 * point
    there = 1j * np.array([omega - small[0], omega, omega + small[0]])
    before, value, after = modes(psi).determinant(there, jv)
    lower, upper = (complex(modes(x).determinant(there[1], jv)) for x in (psi - small[1], psi + small[1]))
    slopes = np.array([after - before, upper - lower]) / (2 * small)
    return np.array([value.real, value.imag]), np.array([slopes.real, slopes.imag])


def _double_root(point: Array, modes: Callable[[float], DiskModes], pole: float) -> tuple[Array, Array]:
    """D = D' = 0 in (lambda, psi), by Cauchy's formula on a ring that leaves out D's singularity -e/mu."""
    rate, psi = point
    radius, small = 0.2 * (rate + pole), 1e-5 * psi
    taylor = [
        (np.fft.fft(modes(x).determinant(rate + radius * _RING, jv)) / len(_RING)).real[:3]
        / radius ** np.arange(3)
        for x in (psi - small, psi, psi + small)
    ]
    in_psi = (taylor[2] - taylor[0]) / (2 * small)
    value, slope, curvature = taylor[1]
    return np.array([value, slope]), np.array([[slope, in_psi[0]], [2 * curvature, in_psi[1]]])
