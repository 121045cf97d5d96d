"""Neumann eigenmodes of the unit disk: (A.1), Remark A.1 and Table 6, with the article's numbering."""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
from scipy.special import j0, jnp_zeros, jv, jvp, yvp

from actin_xcheck.core.model import Array, Closure
from actin_xcheck.core.parameters import Parameters


@lru_cache(maxsize=4096)
def wavenumber(m: int, n: int) -> float:
    """Return j'_{m,n}, the n-th zero of J_m', counted as the article does: j'_{0,1} = 0, j'_{0,2} = 3.83171.

    Raises ValueError unless m >= 0 and n >= 1.
    """
    if m < 0 or n < 1:
        raise ValueError(f"no mode ({m}, {n}): m starts at 0 and n at 1")
    if m > 0:
        return float(jnp_zeros(m, n)[-1])
    return float(jnp_zeros(0, n - 1)[-1]) if n > 1 else 0.0


@dataclass(frozen=True)
class Mode:
    """The eigenmode w_{m,n} = J_m(k r) cos(m theta) of Remark A.1, with k = j'_{m,n}.

    Delta w = -k^2 w in the unit disk and n.grad w = 0 on its rim.  Points are arrays x of shape (2, n) in
    units of the cell's radius.  Raises ValueError for a mode that does not exist.
    """

    m: int
    n: int

    def __post_init__(self) -> None:
        wavenumber(self.m, self.n)

    def __str__(self) -> str:
        return f"w{self.m},{self.n}"

    @classmethod
    def named(cls, name: str) -> Self:
        """Return the mode that is called so: "w2,1"."""
        m, n = name.removeprefix("w").split(",")
        return cls(int(m), int(n))

    @property
    def k(self) -> float:
        """Wavenumber j'_{m,n} of (A.1)."""
        return wavenumber(self.m, self.n)

    @cached_property
    def norm2(self) -> float:
        """Integral of w^2 over the unit disk."""
        if self.m == 0:
            return float(np.pi * j0(self.k) ** 2)
        return float(np.pi / 2 * (1 - (self.m / self.k) ** 2) * jv(self.m, self.k) ** 2)

    def value(self, x: Array) -> Array:
        """Return w at the points x (2, n): shape (n,)."""
        r, theta = np.hypot(*x), np.arctan2(x[1], x[0])
        return np.asarray(jv(self.m, self.k * r) * np.cos(self.m * theta))

    def gradient(self, x: Array) -> Array:
        """Return grad w at the points x (2, n): shape (2, n), exact at the origin too.

        (d_x -+ i d_y) lowers and raises the order of J_m(k r) e^{i m theta}, which leaves no division by r.
        """
        r, theta = np.hypot(*x), np.arctan2(x[1], x[0])
        below, above = jv(self.m - 1, self.k * r), jv(self.m + 1, self.k * r)
        down, up = (self.m - 1) * theta, (self.m + 1) * theta
        return (
            self.k
            / 2
            * np.stack(
                [
                    below * np.cos(down) - above * np.cos(up),
                    -below * np.sin(down) - above * np.sin(up),
                ]
            )
        )


def table_6(orders: int = 6, zeros: int = 4) -> Array:
    """Return Table 6, shape (zeros, orders): row n - 1, column m holds j'_{m,n}."""
    return np.array([[wavenumber(m, n) for m in range(orders)] for n in range(1, zeros + 1)])


def count_below(k: float) -> Array:
    """Return, for m = 0, 1, ... < k, how many of the j'_{m,n} lie below k > 0 (j'_{0,1} = 0 is not counted).

    J_m' = N cos(phi) and Y_m' = N sin(phi) with phi = (n - 1/2) pi at the n-th positive zero of J_m', m > 0.
    The phase's whole turns come from Debye's expansion, its rest from the functions themselves: no search
    that could miss a zero.
    """
    m = np.arange(np.ceil(k))  # j'_{m,1} > m, so higher orders have no zero below k
    debye = np.sqrt(k**2 - m**2) - m * np.arccos(m / k) + np.pi / 4
    rest = np.arctan2(yvp(m, k), jvp(m, k))
    phase = rest + 2 * np.pi * np.round((debye - rest) / (2 * np.pi))
    count = np.floor(phase / np.pi + 0.5).astype(int)
    count[0] -= 1  # the phase of order 0 starts at pi/2: its first passage is j'_{0,1} = 0
    return count


def modes_below(k: float) -> tuple[Mode, ...]:
    """Return all modes with wavenumber below k by increasing wavenumber, the uniform one (0, 1) first."""
    if k <= 0:
        return ()
    count = count_below(k)
    count[0] += 1  # the uniform mode
    modes = (Mode(m, n) for m, zeros in enumerate(count) for n in range(1, zeros + 1))
    return tuple(sorted(modes, key=lambda mode: mode.k))


def contrast(parameters: Parameters) -> float:
    """Return kappa = (mu1/2)/(mu1 + mu2), 0.139 for Table 2."""
    return parameters.mu1 / 2 / parameters.mu


def half_plane_rate(closure: Closure, parameters: Parameters, speed: float, wavenumber: float) -> float:
    """Growth rate of a ripple on a rim that advances with `speed`, to leading order in |k|.

    ValueError for `irrotational-wall`, whose rim does not move.
    """
    return contrast(parameters) * speed * abs(wavenumber) if _follows_the_rim(closure) else 0.0


def ripple_exponent(closure: Closure, parameters: Parameters, m: int) -> float:
    """Return gamma: the amplitude of cos m theta, m >= 1, on a uniformly swelling disk goes like R^gamma.

    ValueError for m < 1 and for `irrotational-wall`, whose rim does not move.
    """
    if m < 1:
        raise ValueError(f"m = {m} is no ripple; valid: 1, 2, ...")
    if not _follows_the_rim(closure):
        return 0.0 if closure is Closure.TRACTION_FREE and m == 1 else 1.0
    kappa = contrast(parameters)
    return kappa * (m**2 - 1) / (m - kappa)


def advance_per_fold(parameters: Parameters) -> float:
    """How far, in wavelengths, a rim advances under `current-normal` while its ripples grow by e."""
    return 1 / (2 * math.pi * contrast(parameters))


def _follows_the_rim(closure: Closure) -> bool:
    if closure is Closure.IRROTATIONAL_WALL:
        raise ValueError(f"'{closure}' holds the rim still: there is no ripple to follow")
    return closure is Closure.CURRENT_NORMAL
