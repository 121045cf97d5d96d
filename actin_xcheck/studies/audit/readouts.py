"""What the audit reads off a stored run: numbers that say of a cell what the article's pictures say.

Every readout takes a run and one of its output times; all are non-dimensional.  Angles are those of the
material rim points at the start.
"""

from collections.abc import Callable

import numpy as np

from actin_xcheck.core.mesh import Indices, Mesh, signed_areas
from actin_xcheck.core.model import Array
from actin_xcheck.core.observables import centroid
from actin_xcheck.runs.store import Run
from actin_xcheck.theory.dispersion import Mode

Readout = Callable[[Run, float], float]


def frame_at(run: Run, t: float) -> int:
    """Number of the frame at output time t; ValueError where the run did not come that far."""
    nearest = int(np.argmin(np.abs(run.times - t)))
    if abs(run.times[nearest] - t) > 1e-9:
        raise ValueError(f"{run.path.name} has no frame at t = {t:g}: {run.attributes['message']}")
    return nearest


def area_change(run: Run, t: float) -> float:
    """Area at t over the area at the start, less 1."""
    x, start = run.points[frame_at(run, t)], run.points[0]
    return float(signed_areas(x, run.triangles).sum() / signed_areas(start, run.triangles).sum() - 1)


def half_width(axis: int) -> Readout:
    """Half the cell's extent along x (0) or y (1)."""

    def readout(run: Run, t: float) -> float:
        along = run.points[frame_at(run, t)][axis]
        return float(along.max() - along.min()) / 2

    return readout


def centroid_x(run: Run, t: float) -> float:
    """Where the cell's centroid is along x."""
    return float(centroid(run.points[frame_at(run, t)], run.triangles)[0])


def polarity(run: Run, t: float) -> float:
    """Index of polarity: short over long axis of the smallest ellipse around the rim."""
    row = int(np.argmin(np.abs(run.series["time"] - t)))
    return float(run.series["polarity"][row])


def unevenness(run: Run, t: float) -> float:
    """Largest deviation of the rim's distance from the centroid from its mean, relative."""
    radius = _rim_radius(run, frame_at(run, t))
    return float(np.abs(radius / radius.mean() - 1).max())


def waywardness(run: Run, t: float) -> float:
    """Largest deviation of the rim's radial motion from its mean motion, over that: small where uniform."""
    moved = _rim_radius(run, frame_at(run, t)) - _rim_radius(run, 0)
    return float(np.abs(moved - moved.mean()).max() / abs(moved.mean()))


def curvature_agreement(run: Run, t: float) -> float:
    """Correlation along the rim of the concentration with the rim's curvature, both up to harmonic 12."""
    frame, rim = frame_at(run, t), _rim(run)
    x, y = (_smooth(values) for values in run.points[frame][:, rim])
    (x1, x2), (y1, y2) = ((_derivative(v), _derivative(_derivative(v))) for v in (x, y))
    curvature = (x1 * y2 - y1 * x2) / np.hypot(x1, y1) ** 3
    return float(np.corrcoef(_smooth(run.a_points[frame][rim]), curvature)[0, 1])


def ripples_along_x(run: Run, t: float) -> float:
    """Number of local maxima of the displacement along the ray theta = 0: 1 where it does not oscillate."""
    on = np.flatnonzero((np.abs(run.xi[1]) < 1e-9) & (run.xi[0] > -1e-9))
    on = on[np.argsort(run.xi[0, on])]
    u = np.hypot(*(run.points[frame_at(run, t)] - run.xi))[on]
    higher = np.diff(np.concatenate([[-1.0], u, [-1.0]]))
    return float(((higher[:-1] > 0) & (higher[1:] <= 0)).sum())


def hot_share_since(start: float) -> Readout:
    """Share of the cell's area where a is above the middle of its range, over that at another time."""
    return lambda run, t: _hot_share(run, t) / _hot_share(run, start)


def _hot_share(run: Run, t: float) -> float:
    frame = frame_at(run, t)
    a, areas = run.a_cells[frame], signed_areas(run.points[frame], run.triangles)
    return float(areas[a > (a.min() + a.max()) / 2].sum() / areas.sum())


def fronts(run: Run, t: float) -> float:
    """How many protrusions the rim has: the strongest harmonic m >= 1 of its distance from the centroid."""
    return float(1 + np.argmax(_harmonics(_rim_radius(run, frame_at(run, t)))))


def front_height(m: int) -> Readout:
    """Amplitude of the m-th harmonic of the rim's distance from the centroid, over the mean distance."""

    def readout(run: Run, t: float) -> float:
        radius = _rim_radius(run, frame_at(run, t))
        return float(_harmonics(radius)[m - 1] / radius.mean())

    return readout


def rim_agreement(run: Run, t: float) -> float:
    """Correlation of the concentration on the rim with the rim's distance from the centroid."""
    frame = frame_at(run, t)
    return float(np.corrcoef(run.a_points[frame][_rim(run)], _rim_radius(run, frame))[0, 1])


def rim_excess(run: Run, t: float) -> float:
    """Mean concentration on the rim over that at the centre, less 1: > 0 with actin at the periphery."""
    a = run.a_points[frame_at(run, t)]
    return float(a[_rim(run)].mean() / a[np.argmin(np.hypot(*run.xi))] - 1)


def highest_at(run: Run, t: float) -> float:
    """Distance from the centre at which the point with the highest concentration started."""
    return float(np.hypot(*run.xi[:, np.argmax(run.a_points[frame_at(run, t)])]))


def nonuniformity(run: Run, t: float) -> float:
    """Highest less lowest nodal concentration, over their mean."""
    a = run.a_points[frame_at(run, t)]
    return float(np.ptp(a) / a.mean())


def displacement_peak(run: Run, t: float) -> float:
    """Distance from the centre at which the point with the largest displacement started."""
    u = run.points[frame_at(run, t)] - run.xi
    return float(np.hypot(*run.xi[:, np.argmax(np.hypot(*u))]))


Field = Callable[[Array], Array]
"""Values (n,) at points (2, n) of the disk."""


def pattern(parts: dict[str, float], turned: float = 0.0) -> Field:
    """A sum of the article's modes by name, {"w0,2": 1, "w2,1": 2}, all with theta_1 = `turned` pi."""
    angle = turned * np.pi
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])

    def field(x: Array) -> Array:
        modes = [(Mode.named(name), factor) for name, factor in parts.items()]
        return np.asarray(
            sum(factor * mode.value(turn @ x if turned and mode.m else x) for mode, factor in modes)
        )

    return field


def likeness(field: Field) -> Readout:
    """Correlation of the concentration with a field over the disk, both less their means: 1 is alike."""
    return lambda run, t: _correlation(run, run.a_cells[frame_at(run, t)], field)


def displacement_likeness(field: Field) -> Readout:
    """Correlation of the displacement's x component with a field over the disk."""

    def readout(run: Run, t: float) -> float:
        along = run.points[frame_at(run, t)][0] - run.xi[0]
        return _correlation(run, along[run.triangles].mean(axis=0), field)

    return readout


def growth_of(field: Field) -> Readout:
    """Amplitude of a field in the concentration over the reference disk, relative to the one at the start."""

    def amplitude(run: Run, frame: int) -> float:
        areas, w = signed_areas(run.xi, run.triangles), field(run.xi[:, run.triangles].mean(axis=1))
        return float(areas @ (run.a_cells[frame] * (w - areas @ w / areas.sum())))

    return lambda run, t: amplitude(run, frame_at(run, t)) / amplitude(run, 0)


def largest_displacement(run: Run, t: float) -> float:
    """Largest |u|, in radii."""
    return float(np.hypot(*(run.points[frame_at(run, t)] - run.xi)).max())


def displacement_over_contrast(run: Run, t: float) -> float:
    """Largest displacement over the spread of the concentration."""
    return largest_displacement(run, t) / float(np.ptp(run.a_points[frame_at(run, t)]))


def displacement_agreement(run: Run, t: float) -> float:
    """Correlation over the cell of the concentration with the size of the displacement: 1 is in phase."""
    frame = frame_at(run, t)
    moved = np.hypot(*(run.points[frame] - run.xi))
    return float(np.corrcoef(run.a_points[frame], moved)[0, 1])


def mode_share(field: Field, m: int) -> Readout:
    """Size of the correlation of a with w_m,n in its best phase: 0 where a has none of the mode."""

    def sine(x: Array) -> Array:
        c, s = np.cos(np.pi / 2 / m), np.sin(np.pi / 2 / m)
        return field(np.array([[c, s], [-s, c]]) @ x)

    return lambda run, t: float(np.hypot(likeness(field)(run, t), likeness(sine)(run, t)))


def smallest_angle(run: Run, t: float) -> float:
    """Smallest angle of any triangle, in degrees."""
    corners = run.points[frame_at(run, t)][:, run.triangles]  # (2, 3, n_cells)
    edges = np.roll(corners, -1, axis=1) - corners
    back = -np.roll(edges, 1, axis=1)
    across = np.abs(edges[0] * back[1] - edges[1] * back[0])
    return float(np.degrees(np.arctan2(across, (edges * back).sum(axis=0))).min())


def _correlation(run: Run, values: Array, field: Field) -> float:
    """Area-weighted over the reference disk, of cell values (n_cells,) with a field at the centroids."""
    areas = signed_areas(run.xi, run.triangles)
    pair = values, field(run.xi[:, run.triangles].mean(axis=1))
    a, w = (each - areas @ each / areas.sum() for each in pair)
    return float(areas @ (a * w) / np.sqrt((areas @ a**2) * (areas @ w**2)))


def _rim(run: Run) -> Indices:
    return Mesh(run.xi, run.triangles, h=np.nan).rim_nodes


def _rim_radius(run: Run, frame: int) -> Array:
    """Distance of the rim nodes from the centroid, counter-clockwise at equal angles of the start."""
    x = run.points[frame]
    return np.asarray(np.hypot(*(x[:, _rim(run)] - centroid(x, run.triangles)[:, None])))


def _smooth(values: Array) -> Array:
    """Values at equal angles without their harmonics above 12, which a triangulated rim does not have."""
    waves = np.fft.rfft(values)
    waves[13:] = 0
    return np.asarray(np.fft.irfft(waves, len(values)))


def _derivative(values: Array) -> Array:
    """Derivative by the angle of smooth values at equal angles."""
    waves = np.fft.rfft(values)
    return np.asarray(np.fft.irfft(1j * np.arange(len(waves)) * waves, len(values)))


def _harmonics(values: Array) -> Array:
    """Amplitudes of the harmonics 1 to 12 of values at equal angles."""
    return np.asarray(2 * np.abs(np.fft.rfft(values))[1:13] / len(values))
