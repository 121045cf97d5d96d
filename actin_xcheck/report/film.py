"""Films of the deforming cell: strips, a row per method and per difference of codes, and a player's data.

What the player on a page is given are positions and values of every stored frame, packed for a script: as
16-bit integers between two stated ends, 65535 for what is no number; what is the same at several times or in
several runs is packed once.  All of them together are compressed.  `static/film.js` draws them.
"""

import gzip
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from actin_xcheck.core.model import Array
from actin_xcheck.report.draw import (
    DIVERGING,
    SEQUENTIAL,
    Brush,
    ColourBar,
    Colours,
    Panel,
    Window,
    closed_rim,
    scale_ends,
    span,
    window,
)
from actin_xcheck.runs.store import Run

MAX_COLUMNS = 5


@dataclass(frozen=True)
class FilmRow:
    """Pictures of one method (or of one difference) at the strip's times; None where there is no frame."""

    label: str
    is_difference: bool
    panels: tuple[Panel | None, ...]


@dataclass(frozen=True)
class FilmStrip:
    """Rows of pictures at common times, with one colour bar for a and one for the differences.

    Attributes
    ----------
    shown, scale : the window and the colours of a, over all output times and not those of the columns alone.
    clipped : whether a failed run goes beyond the colours.
    """

    times: tuple[float, ...]
    rows: tuple[FilmRow, ...]
    bars: tuple[ColourBar, ...]
    clipped: bool
    shown: Window
    scale: Colours


def film_strip(runs: Sequence[Run], most: int = MAX_COLUMNS) -> FilmStrip:
    """Draw the runs of one scene at most so many times; differences are the cell means of other codes less
    FEM's (the first one's without it), drawn where its cell is.

    The colours span what the completed runs reach: a run on its way to a singularity must not wash them out.
    """
    every = common_times(runs)
    columns = _columns(runs, every, most)
    named = {run.attributes["method_name"]: run for run in runs}
    shots = {name: _shots(run, every) for name, run in named.items()}
    shown = window([x for row in shots.values() for x, _ in filter(None, row)] + [runs[0].xi])
    brushes = {name: _brush(run, shown) for name, run in named.items()}

    def row(label: str, brush: str, what: str, shots: list[Shot], scale: Colours) -> FilmRow:
        times, chosen = [every[i] for i in columns], [shots[i] for i in columns]
        return FilmRow(label, what == label, _panels(brushes[brush], what, times, chosen, scale))

    completed = [name for name, run in named.items() if run.attributes["outcome"] == "completed"]
    reach = span(_values([shots[name] for name in completed or named]))
    scale = Colours(SEQUENTIAL, *scale_ends(*reach))
    rows = [row(name, name, f"a of {name}", own, scale) for name, own in shots.items()]
    bars = [scale.bar("a")]
    fem = next((name for name, run in named.items() if run.family == "fem"), next(iter(named)))
    if differences := _differences(named, every, fem):
        largest = max(map(abs, span(_values(list(differences.values()))))) or 1.0
        apart = Colours(DIVERGING, -largest, largest)
        rows += [row(name, fem, name, own, apart) for name, own in differences.items()]
        bars.append(apart.bar("difference of a"))
    clipped = span(_values(list(shots.values()))) != reach
    return FilmStrip(tuple(every[i] for i in columns), tuple(rows), tuple(bars), clipped, shown, scale)


Shot = tuple[Array, Array] | None
"""Positions (2, N) and values on triangles (n,) at one time, or None where the run has no such frame."""


def common_times(runs: Sequence[Run]) -> list[float]:
    """The times that all runs have which come that far, and the last one of each."""
    times = [run.times.round(9) for run in runs]
    every = np.unique(np.concatenate(times))
    last = {float(one[-1]) for one in times if len(one)}
    return [float(t) for t in every if t in last or all(t in one for one in times if one[-1:] >= t)]


def _columns(runs: Sequence[Run], times: Sequence[float], most: int) -> list[int]:
    """Numbers of at most `most` times, evenly through them and with each run's last one."""
    last = {int(np.argmin(np.abs(np.asarray(times) - run.times[-1]))) for run in runs if len(run.times)}
    free = max(most - len(last), 0)
    even = np.linspace(0, len(times) - 1, free + 1).round().astype(int)[:free]
    return sorted(last | {int(i) for i in even})


def _shots(run: Run, times: Sequence[float]) -> list[Shot]:
    frames = frames_at(run, times)
    return [None if i is None else (run.points[i], on_triangles(run, i)) for i in frames]


def frames_at(run: Run, times: Sequence[float]) -> list[int | None]:
    """Numbers of the run's frames at the times; None where it has none."""
    found = [np.flatnonzero(np.abs(run.times - t) < 1e-9) for t in times]
    return [int(i[0]) if len(i) else None for i in found]


def on_triangles(run: Run, frame: int) -> Array:
    """Concentration on the triangles that are drawn: a cell's mean, or what its nodes have around a piece."""
    if run.order == 1:
        return run.a_cells[frame]
    return np.asarray(run.a_points[frame][run.triangles].mean(axis=0))


def _differences(named: dict[str, Run], times: Sequence[float], fem: str) -> dict[str, list[Shot]]:
    """Cell means of other codes less FEM's, by the name of the row, for those of the same cells."""
    return {
        f"{name} − {fem}": _difference(run, named[fem], times)
        for name, run in named.items()
        if run.family != named[fem].family and np.array_equal(run.corners, named[fem].corners)
    }


def _difference(fv: Run, fem: Run, times: Sequence[float]) -> list[Shot]:
    return [
        None
        if i is None or j is None
        else (fem.points[i], np.repeat(fv.a_cells[j] - fem.a_cells[i], fem.order**2))
        for i, j in zip(frames_at(fem, times), frames_at(fv, times), strict=True)
    ]


def _values(rows: Sequence[Sequence[Shot]]) -> list[Array]:
    """The values of all shots in rows of shots."""
    return [shot[1] for row in rows for shot in row if shot]


def _brush(run: Run, shown: Window) -> Brush:
    """A brush that draws the run's cells over the outline of where the cell began."""
    return Brush(run.triangles, run.xi[:, closed_rim(run.triangles)], shown)


def _panels(
    brush: Brush, what: str, times: Sequence[float], shots: Sequence[Shot], scale: Colours
) -> tuple[Panel | None, ...]:
    """One row of a strip."""
    return tuple(
        brush.panel(f"{what} at t = {t:.4g}", *shot, scale) if shot else None
        for t, shot in zip(times, shots, strict=True)
    )


STEPS = 4094
"""Steps between the ends of a packed range."""

_STOPS = 33


class _Store:
    """Arrays by their contents."""

    def __init__(self) -> None:
        self.arrays: list[NDArray[np.uint16]] = []
        self._known: dict[bytes, int] = {}

    def keep(self, numbers: NDArray[np.integer[Any]]) -> int:
        """Return where an array of integers stands."""
        wide = "<u4" if numbers.size and numbers.max() > 65535 else "<u2"
        raw = np.ascontiguousarray(numbers, wide).tobytes()
        if raw not in self._known:
            self._known[raw] = len(self.arrays)
            self.arrays.append(np.frombuffer(raw, "<u2"))
        return self._known[raw]

    @property
    def packed(self) -> dict[str, Any]:
        """How many 16-bit words each array has, and all of them by gzip in base64.

        Words are differences to those of the last array as long, for frames differ little from one to the
        next; of each array all low bytes come before all high ones, which are mostly alike.
        """
        last: dict[int, NDArray[np.uint16]] = {}
        parts: list[NDArray[np.uint8]] = []
        for words in self.arrays:
            apart = words - last.get(len(words), np.zeros_like(words))
            last[len(words)] = words
            parts += [(apart & 255).astype(np.uint8), (apart >> 8).astype(np.uint8)]
        together = b"".join(part.tobytes() for part in parts)
        return {
            "words": [len(words) for words in self.arrays],
            "packed": b64encode(gzip.compress(together, mtime=0)).decode(),
        }

    def pack(self, values: Array, low: float, high: float) -> int:
        """Return where values stand that lie between two ends."""
        part = (values - low) / (high - low or 1.0)
        numbers = np.where(
            np.isfinite(part),
            np.clip(np.rint(np.nan_to_num(part, posinf=0.0, neginf=0.0) * STEPS), 0, STEPS),
            STEPS + 1,
        )
        return self.keep(numbers.astype(int))

    def field(self, values: Array) -> dict[str, Any]:
        """Values with the ends they were packed between, their own."""
        low, high = span([values])
        return {"at": self.pack(values, low, high), "low": low, "high": high}


def film_data(runs: Sequence[Run], strip: FilmStrip) -> dict[str, Any]:
    """Return what the player draws, for JSON.

    Parameters
    ----------
    runs : of one scene, finite elements first.
    strip : theirs; it says which window and which colours.

    Returns
    -------
    dict : `times`; `window` (left, bottom, right, top); `scale` and `colours`; `arrays`, see `_Store.packed`;
        and `runs`, each
        with `triangles` (3 n numbers of nodes, k^2 triangles a cell one after the other), `xi`, and `frames`,
        one for each time: `x` (2 N), `a` on triangles and `apart` on cells, cell means less those of the
        first run that has such cells and a frame then; None where a run has no frame.
    """
    store = _Store()
    times = common_times(runs)
    (left, bottom), (right, top) = strip.shown
    ends = np.array([[left], [bottom]]), np.array([[right], [top]])
    return {
        "times": times,
        "window": [left, bottom, right, top],
        "scale": [strip.scale.low, strip.scale.high],
        "colours": [
            [to_hex(colour) for colour in colormaps[name](np.linspace(0, 1, _STOPS))]
            for name in (SEQUENTIAL, DIVERGING)
        ],
        "runs": [_run(run, runs, times, store, ends) for run in runs],
        "arrays": store.packed,
    }


def _run(
    run: Run, runs: Sequence[Run], times: Sequence[float], store: _Store, ends: tuple[Array, Array]
) -> dict[str, Any]:
    alike = [other for other in runs if np.array_equal(other.corners, run.corners)]
    numbers = zip(*(frames_at(one, times) for one in (run, *alike)), strict=True)
    frames = [None if i is None else _frame(run, i, alike, others, store, ends) for i, *others in numbers]
    return {
        "name": run.attributes["method_name"],
        "outcome": run.attributes["outcome"],
        "order": run.order,
        "like": next(i for i, other in enumerate(runs) if other is alike[0]),
        "triangles": store.keep(run.triangles.T),
        "nodes": run.xi.shape[1],
        "xi": _positions(run.xi, store, ends),
        "frames": frames,
    }


def _frame(
    run: Run,
    i: int,
    alike: Sequence[Run],
    others: Sequence[int | None],
    store: _Store,
    ends: tuple[Array, Array],
) -> dict[str, Any]:
    base = next(one.a_cells[j] for one, j in zip(alike, others, strict=True) if j is not None)
    return {
        "x": _positions(run.points[i], store, ends),
        "a": store.field(on_triangles(run, i)),
        "apart": store.field(run.a_cells[i] - base),
    }


def _positions(x: Array, store: _Store, ends: tuple[Array, Array]) -> int:
    low, high = ends
    part = (x - low) / (high - low)
    return store.pack(part, 0.0, 1.0)
