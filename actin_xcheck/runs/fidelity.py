"""No more model than a scene needs: the smallest one that is exact for it, and what that leaves out.

The symmetry of a problem about its centre is found in the angular harmonics of its data, then verified.
delta, the closures and the reference disk are the same in every direction, so the solution keeps whatever
symmetry the initial data, a prescribed motion and a source have.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import gcd

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.contract import Motion, Problem
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import Symmetry, disk, sector, unfold
from actin_xcheck.core.model import Array, Delta, Rheology
from actin_xcheck.core.parameters import Fidelity
from actin_xcheck.runs.method import Method
from actin_xcheck.scene.resolve import resolve, starts_from_steady_state
from actin_xcheck.scene.scene import Scene

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


@dataclass(frozen=True)
class Reduction:
    """What is solved of a scene.

    Attributes
    ----------
    fidelity : any but AUTO.
    symmetry : mirror lines, for SECTOR and for what MODAL hands over to.
    bound : largest error that MODAL may make.
    still : whether the force balance is left out, for nothing moves.
    ring_free : whether the mesh has no line of nodes on the ring, for delta does not jump there.
    left_out : what is not solved and why, a sentence each.
    """

    fidelity: Fidelity = Fidelity.FULL
    symmetry: Symmetry | None = None
    bound: float = 0.0
    still: bool = False
    ring_free: bool = False
    left_out: tuple[str, ...] = ()

    def applied(self, problem: Problem) -> Problem:
        """Return the problem without what is left out of it."""
        if self.still:
            start = problem.u0
            still = Motion(lambda xi, t: xi + start(xi), lambda xi, t: np.zeros_like(xi))
            problem = replace(problem, motion=still)
        if self.ring_free:  # on 1/2 every mesh has a layer without being bent
            problem = replace(problem, model=problem.model.varied(l0=0.5))
        return problem


FULL = Reduction()
"""Nothing is left out."""


def reduced(
    scene: Scene, method: Method, wanted: Fidelity = Fidelity.AUTO, tolerance: float | None = None
) -> Reduction:
    """Return what has to be solved of a scene by a method.

    Parameters
    ----------
    scene, method : physics and numerics.
    wanted : AUTO, or what must be solved.
    tolerance : the error that MODAL may make; without one it is not chosen.

    Raises
    ------
    UserError : what is wanted is not exact for the scene, or not made for the method.
    """
    if wanted is Fidelity.FULL:
        return FULL
    problem = resolve(scene)
    found = symmetry_of(problem, scene.time.end)
    why_not = {
        Fidelity.RADIAL: _not_radial(method, found),
        Fidelity.MODAL: _not_modal(scene, problem, method, tolerance),
        Fidelity.SECTOR: _not_a_sector(scene, method, found),
    }
    if wanted is Fidelity.AUTO:
        chosen = next((one for one, reason in why_not.items() if not reason), Fidelity.FULL)
    else:
        chosen = wanted
        if reason := why_not[wanted]:
            valid = [str(one) for one, other in why_not.items() if not other]
            raise UserError(
                f"--fidelity: {wanted} is not for {scene.origin} with {method.name}: {reason}; "
                f"valid: {', '.join(['auto', 'full', *valid])}"
            )
    in_sector = chosen is Fidelity.SECTOR or (chosen is Fidelity.MODAL and not why_not[Fidelity.SECTOR])
    reduction = Reduction(
        chosen,
        found.mirrors if in_sector else None,
        tolerance or 0.0,
        _nothing_moves(scene),
        scene.physics.delta is not Delta.RING,
    )
    return replace(reduction, left_out=_left_out(scene, reduction))


def _not_radial(method: Method, found: Symmetries) -> str:
    if not _by_stages(method):
        return "it is integrated by the pairs fem-p*-imex* alone"
    return "" if found.axisymmetric else "its data depend on the angle"


def _not_a_sector(scene: Scene, method: Method, found: Symmetries) -> str:
    if method.family != "fem":
        return "symmetry sides are made for finite elements alone"
    if found.axisymmetric:
        return "its data are axisymmetric, which needs no sides"
    if found.mirrors is None:
        return "its data have no mirror line"
    if not method.adaptive and not _is_part_of_the_mesh(found.mirrors, scene):
        return "its mirror lines are no axes of the article's mesh"
    return ""


def _is_part_of_the_mesh(symmetry: Symmetry, scene: Scene) -> bool:
    """Whether the images of the sector's mesh are the scene's own."""
    rotation = np.deg2rad(scene.domain.rotation)
    tiled, own = unfold(sector(1, 0.5, symmetry, rotation)), disk(1, 0.5, rotation)
    gaps = np.abs(tiled.xi[:, :, None] - own.xi[:, None]).max(axis=0)
    return tiled.xi.shape == own.xi.shape and bool(gaps.min(axis=0).max() < 1e-9)


def _not_modal(scene: Scene, problem: Problem, method: Method, tolerance: float | None) -> str:
    if not _by_stages(method):
        return "it hands over to the pairs fem-p*-imex* alone"
    if not starts_from_steady_state(scene):
        return "it has no steady state a = 1 to be near to"
    if tolerance is None:
        return "without --rtol or --accuracy nothing says how small is small"
    if (neglected := 2 * _amplitude(problem) ** 2) > tolerance:
        return f"it starts so far from a = 1 that linear theory would be wrong by {neglected:.0e}"
    return ""


def _amplitude(problem: Problem) -> float:
    """The larger of |a - 1| and |u| at t = 0, on a few circles."""
    theta = np.linspace(0, 2 * np.pi, 64)
    circles = np.array([np.cos(theta), np.sin(theta)])[:, None] * np.linspace(0, 1, 9)[:, None]
    points = circles.reshape(2, -1)
    return float(max(np.abs(problem.a0(points) - 1).max(), np.abs(problem.u0(points)).max()))


def _by_stages(method: Method) -> bool:
    return method.family == "fem" and method.adaptive


def _nothing_moves(scene: Scene) -> bool:
    """Whether the load of the force balance is zero for ever: nothing active or displaced that counts."""
    if scene.motion is not None or scene.physics.contracts or scene.physics.pressed:
        return False
    undisplaced = scene.initial.u is None and scene.initial.eigenmode is None
    return undisplaced or scene.physics.rheology is Rheology.VISCOUS


def _left_out(scene: Scene, reduction: Reduction) -> tuple[str, ...]:
    said = []
    if reduction.fidelity is Fidelity.RADIAL:
        said.append("all angles but one: the data are axisymmetric")
    if reduction.fidelity is Fidelity.MODAL:
        small = f"as long as it changes nothing by more than {reduction.bound:.0e}"
        said.append(f"what is quadratic in the distance to a = 1, u = 0, {small}")
    if reduction.symmetry is not None:
        lines = ", ".join(f"{angle:.4g}" for angle in np.rad2deg(_lines(reduction.symmetry)))
        said.append(f"the mirror images of a sector: the data have mirror lines at {lines} degrees")
    if reduction.still:
        said.append("the force balance: psi = p = 0 and nothing pushes back, so that nothing moves")
    elif scene.motion is None and scene.physics.rheology is Rheology.VISCOUS:
        said.append("elastic stress and dilation: a viscous network forgets its displacement")
    if reduction.ring_free:
        said.append(f"the line of nodes on the ring: delta is {scene.physics.delta} and does not jump there")
    return tuple(said)


def _lines(symmetry: Symmetry) -> Array:
    return symmetry.start + np.pi * np.arange(symmetry.mirrors) / symmetry.mirrors
