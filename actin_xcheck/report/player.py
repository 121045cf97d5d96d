"""What the film player on a page is given: positions and values of every stored frame, packed for a script.

Numbers are packed as 16-bit integers between two stated ends, 65535 for what is no number, little-endian and
in base64; what is the same at several times or in several runs is packed once.  `static/film.js` draws them.
"""

from base64 import b64encode
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from actin_xcheck.core.model import Array
from actin_xcheck.report.cells import DIVERGING, SEQUENTIAL, span
from actin_xcheck.report.film import FilmStrip, common_times, frames_at, on_triangles
from actin_xcheck.runs.store import Run

STEPS = 65534
"""Steps between the ends of a packed range."""

_STOPS = 33


class _Store:
    """Arrays by their contents."""

    def __init__(self) -> None:
        self.packed: list[str] = []
        self._known: dict[bytes, int] = {}

    def keep(self, numbers: NDArray[np.integer[Any]]) -> int:
        """Return where an array of integers stands."""
        wide = "<u4" if numbers.size and numbers.max() > STEPS + 1 else "<u2"
        raw = np.ascontiguousarray(numbers, wide).tobytes()
        if raw not in self._known:
            self._known[raw] = len(self.packed)
            self.packed.append(b64encode(raw).decode())
        return self._known[raw]

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
    dict : `times`; `window` (left, bottom, right, top); `scale` and `colours`; `arrays`; and `runs`, each
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
