"""What the audit measures with: verdicts out of comparisons, quadrature on the disk, P1 matrices by hand.

The matrices are built here from the article's own entries, in plain numpy, so that they share nothing with
the finite elements they are held against.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import leggauss

from actin_xcheck.core.mesh import INTERIOR_POINTS, Indices, signed_areas
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Exhibit
from actin_xcheck.studies.audit.row import Finding, Judgement

ROUND_OFF = 1e-11
"""Relative difference below which two evaluations of one formula are the same."""


def found(
    expected: Judgement,
    computed: str,
    reason: str,
    *,
    holds: bool,
    corrected: bool = False,
    exhibits: tuple[Exhibit, ...] = (),
    numbers: Mapping[str, float] | None = None,
) -> Finding:
    """Return a finding whose verdict follows from what was computed.

    Parameters
    ----------
    expected : the verdict the reason was written for; where another comes out the reason says so.
    computed, reason, exhibits, numbers : as in `Finding`.
    holds : the article's statement agrees with what was computed.
    corrected : a corrected statement does, which makes a statement that does not hold a misprint.
    """
    if holds:
        judgement = Judgement.IN_KIND if expected is Judgement.IN_KIND else Judgement.REPRODUCED
    else:
        judgement = Judgement.MISPRINT if corrected else Judgement.NOT_REPRODUCED
    if judgement is not expected:
        reason = f"The numbers no longer give '{expected}', for which this was the reason: {reason}"
    return Finding(judgement, computed, reason, exhibits, {k: float(v) for k, v in (numbers or {}).items()})


def rounds_to(value: float, printed: str) -> bool:
    """Whether a value, rounded to the digits of a printed number ("3.83170", "3.1e2"), is that number."""
    decimal = Decimal(printed)
    exponent = decimal.as_tuple().exponent
    assert isinstance(exponent, int)
    # a value half-way between two numbers may be printed as either
    return abs(value - float(decimal)) <= 0.5 * 10.0**exponent * (1 + 1e-9)


def disk_quadrature(inner: float = 0.0, outer: float = 1.0) -> tuple[Array, Array]:
    """Points (2, n) and weights (n,) on an annulus: Gauss in r and, quadrant by quadrant, in theta.

    The quadrants let |sin x sin y| be integrated to round-off: its kinks lie on the axes.
    """
    s, ws = leggauss(32)
    r, wr = inner + (outer - inner) * (s + 1) / 2, (outer - inner) * ws / 2
    theta = np.concatenate([np.pi / 4 * (s + 1) + quadrant * np.pi / 2 for quadrant in range(4)])
    wt = np.tile(np.pi / 4 * ws, 4)
    R, T = np.meshgrid(r, theta, indexing="ij")
    return np.array([(R * np.cos(T)).ravel(), (R * np.sin(T)).ravel()]), np.outer(wr * r, wt).ravel()


def circle(radius: float = 1.0, count: int = 128) -> tuple[Array, Array, float]:
    """Points (2, count) on a circle, its outward normals (2, count) and the length each point stands for."""
    theta = 2 * np.pi * np.arange(count) / count
    n = np.array([np.cos(theta), np.sin(theta)])
    return radius * n, n, 2 * np.pi * radius / count


@dataclass(frozen=True, eq=False)
class Triangles:
    """P1 elements on node positions x (2, N): the article's matrix entries as dense arrays."""

    x: Array
    triangles: Indices

    @cached_property
    def areas(self) -> Array:
        """Areas (n_cells,)."""
        return signed_areas(self.x, self.triangles)

    @cached_property
    def gradients(self) -> Array:
        """Gradients of the three basis functions of each cell, (2, 3, n_cells)."""
        p = self.x[:, self.triangles]
        opposite = np.roll(p, -2, axis=1) - np.roll(p, -1, axis=1)
        return np.array([-opposite[1], opposite[0]]) / (2 * self.areas)

    def summed(self, local: Array) -> Array:
        """Sum cell entries (3, n_cells) or (3, 3, n_cells) into nodal ones, (N,) or (N, N)."""
        count, nodes = self.x.shape[1], self.triangles
        whole = np.zeros((count,) * (local.ndim - 1))
        np.add.at(whole, (nodes,) if local.ndim == 2 else (nodes[:, None], nodes[None, :]), local)
        return whole

    def pairs(self, k: int, m: int) -> Array:
        """Integrals of d_k phi_i d_m phi_j, (N, N)."""
        g = self.gradients
        return self.summed(self.areas * g[k][:, None] * g[m][None, :])

    def mass(self) -> Array:
        """M of (B.22)."""
        return self.summed(self.areas * (np.ones((3, 3)) + np.eye(3))[:, :, None] / 12)

    def stiffness(self) -> Array:
        """K of (B.22)."""
        return self.pairs(0, 0) + self.pairs(1, 1)

    def load(self) -> Array:
        """H of (B.22)."""
        return self.summed(np.broadcast_to(self.areas / 3, self.triangles.shape))

    def blocks(self, normal: float, coupling: float, shear: float) -> tuple[Array, Array, Array]:
        """Return A11, A12 and A22 of (B.20) for D11 = D22, D12 and D33, or B's for the C."""
        xx, yy, xy = self.pairs(0, 0), self.pairs(1, 1), self.pairs(0, 1)
        return normal * xx + shear * yy, coupling * xy + shear * xy.T, shear * xx + normal * yy

    def network(self, normal: float, coupling: float, shear: float) -> Array:
        """The block matrix of (B.20), all u before all v."""
        first, mixed, second = self.blocks(normal, coupling, shear)
        return np.block([[first, mixed], [mixed.T, second]])

    def at_points(self, nodal: Array) -> Array:
        """Values (3, n_cells) of a P1 field at the interior points of each cell."""
        return np.asarray(INTERIOR_POINTS @ nodal[self.triangles])

    def divergence(self, u: Array) -> Array:
        """Div of the P1 field with nodal values u (2, N), (n_cells,)."""
        return np.einsum("kan,kan->n", self.gradients, u[:, self.triangles])
