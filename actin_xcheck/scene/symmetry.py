"""The symmetry of a problem about its centre: found in the angular harmonics of its data, then verified.

delta, the closures and the reference disk are the same in every direction, so the solution keeps whatever
symmetry the initial data, a prescribed motion and a source have.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.contract import Problem
from actin_xcheck.core.mesh import Symmetry
from actin_xcheck.core.model import Array

ANGLES = 5040
"""Points on a circle: divisible by every k up to 10, so that sampling keeps a k-fold symmetry."""

RADII = np.array([0.23, 0.51, 0.77, 0.9, 1.0])
NOTHING = 1e-11
"""Harmonics smaller than this, relative to the data, are round-off."""

EXACT = 1e-12
"""Largest relative departure from a symmetry that is round-off."""


@dataclass(frozen=True)
class Symmetries:
    """What the data are symmetric under.

    Attributes
    ----------
    axisymmetric : any rotation and any mirror line through the origin.
    mirrors : all mirror lines there are, or None.
    """

    axisymmetric: bool
    mirrors: Symmetry | None


def symmetry_of(problem: Problem, end: float) -> Symmetries:
    """Find the symmetry of a problem that runs to t = end (non-dimensional)."""
    even, odd = (np.array(list(signals)) for signals in _signals(problem, end))
    scale = max(np.abs(even).max(), 1.0)
    harmonics = np.fft.rfft(even, axis=-1) / ANGLES
    there = np.abs(harmonics).max(axis=(0, 1)) > NOTHING * scale
    swirls = np.abs(np.fft.rfft(odd, axis=-1) / ANGLES).max(axis=(0, 1)) > NOTHING * scale
    if swirls[0]:  # the same swirl at every angle has no mirror line
        return Symmetries(False, None)
    active = np.flatnonzero(there | swirls)
    active = active[active > 0]
    if not active.size:
        return Symmetries(departure(problem, Symmetry(1, 0.37), end) <= EXACT, None)
    mirrors = gcd(*active.tolist())
    for start in _starts(harmonics, there, mirrors):
        symmetry = Symmetry(mirrors, start)
        if departure(problem, symmetry, end) <= EXACT:
            return Symmetries(False, symmetry)
    return Symmetries(False, None)


def departure(problem: Problem, symmetry: Symmetry, end: float) -> float:
    """Largest departure of the data from a symmetry, relative to their size, at points drawn by a seed."""
    random = np.random.default_rng(20261125)
    r, theta = np.sqrt(random.random(500)), 2 * np.pi * random.random(500)
    points = r * np.array([np.cos(theta), np.sin(theta)])
    largest = 0.0
    for angle in (symmetry.start, symmetry.start + np.pi / symmetry.mirrors):  # two lines generate them all
        cos, sin = np.cos(2 * angle), np.sin(2 * angle)
        mirror = np.array([[cos, sin], [sin, -cos]])
        here, there = _data(problem, points, end), _data(problem, mirror @ points, end)
        for one, other in zip(here, there, strict=True):
            expected = mirror @ one if one.ndim == 2 else one
            largest = max(largest, float(np.abs(other - expected).max() / max(np.abs(one).max(), 1.0)))
    return largest


def _data(problem: Problem, points: Array, end: float) -> list[Array]:
    """Scalars (n,) and vectors (2, n) given at material points (2, n)."""
    found = [problem.a0(points), problem.u0(points)]
    for t in (0.0, 0.37 * end, end):
        if problem.motion is not None:
            found.append(problem.motion(points, t))
        if problem.source is not None:
            where = points if problem.motion is None else problem.motion(points, t)
            found.append(np.broadcast_to(problem.source(where, points, t), points.shape[1:]))
    return found


def _signals(problem: Problem, end: float) -> tuple[list[Array], list[Array]]:
    """What mirror images keep and what they turn round, on circles, (radii, angles) each."""
    theta = 2 * np.pi * np.arange(ANGLES) / ANGLES
    outward = np.array([np.cos(theta), np.sin(theta)])
    points = (RADII[:, None] * outward[:, None]).reshape(2, -1)
    even, odd = [], []
    for values in _data(problem, points, end):
        on_circles = values.reshape(*values.shape[:-1], RADII.size, ANGLES)
        if values.ndim == 1:
            even.append(on_circles)
        else:
            even.append((on_circles * outward[:, None]).sum(axis=0))
            odd.append(outward[0] * on_circles[1] - outward[1] * on_circles[0])
    return even, odd


def _starts(harmonics: NDArray[np.complex128], there: NDArray[np.bool_], mirrors: int) -> Iterator[float]:
    """Angles in [0, pi/mirrors) at which the strongest harmonic has a mirror line."""
    sizes = np.where(there[None, None], np.abs(harmonics), 0.0)
    sizes[..., 0] = 0
    if not sizes.any():  # nothing but swirls
        return
    signal, radius, m = np.unravel_index(int(sizes.argmax()), sizes.shape)
    phase = np.angle(harmonics[signal, radius, m])
    for j in range(int(m) // mirrors):
        start = (j * np.pi - phase) / m % (np.pi / mirrors)
        # cos(0) is round-off away from 0 or from the next line
        yield 0.0 if min(start, np.pi / mirrors - start) < 1e-9 else float(start)
