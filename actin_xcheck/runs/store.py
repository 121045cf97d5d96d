"""Results on disk (HDF5): one run is one `.vtkhdf` film with its time series.

A run file holds two groups.  `/VTKHDF` is the film of its output times (`vtkhdf.py`), which ParaView opens.
`/run`, which VTK ignores, holds the scene, the method and the provenance as attributes and one row per time
step in the datasets of `/run/series`.

Files are made in memory and renamed into place when they are whole, so that a destination is untouched or
whole whoever kills the process: HDF5 itself never writes to a disk.  Until a run is finished its last
checkpoint stands in `unfinished(path)`: a run like any other up to there, with `/run/checkpoint` beside its
series, from which it goes on.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from actin_xcheck.core.contract import Frame
from actin_xcheck.core.errors import Ending, Outcome, UserError
from actin_xcheck.core.files import replace_file, unfinished
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from actin_xcheck.runs import vtkhdf

SCHEMA = 1
"""Version of the layout under `/run` and of reports; a reader refuses any other."""

Attributes = Mapping[str, str | int | float | tuple[str, ...]]

RUN_ATTRIBUTES = (
    *("scene", "scene_name", "method", "method_name", "command"),
    *("refine", "dt", "seed", "versions", "commit"),
)
"""What the caller of `RunWriter` states about a run; the writer adds `schema` and, in the end, `_ENDING`."""

_ENDING = ("outcome", "message", "wall_seconds")

_CHECKPOINT = "checkpoint"


_ROWS_PER_CHUNK, _NUMBERS_KEPT = 256, 2**16
"""Rows, and coordinates of frames, that are gathered before they are written: each access takes its time."""

_SPARE = 2**26
"""Bytes that are kept free for HDF5, which crashes where a file in memory cannot grow, be it to be closed."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Run(vtkhdf.Film):
    """A run, completed, failed or interrupted, as it was stored: its film, its series and how it came about.

    Attributes
    ----------
    path : the file.
    attributes : everything stated about the run, see `RUN_ATTRIBUTES`.
    series : one row per time step, row 0 is t = 0: arrays (n,), (n, 2), (n, k) or (n, k, 2).
    """

    path: Path
    attributes: dict[str, Any]
    series: dict[str, Array]

    def __repr__(self) -> str:
        said, end = self.attributes, float(self.series["time"][-1])
        made = f"{said['scene_name']} by {said['method_name']}, refine {said['refine']}"
        return f"<Run {made}: {said['outcome']} at t = {end:.6g}, {len(self.times)} frames>"

    @property
    def family(self) -> str:
        """The code that made it, see `Method.family`; earlier files state the solver alone."""
        solver = re.search(r'"solver": "(\w+)', str(self.attributes["method"]))
        return str(self.attributes.get("family", solver[1] if solver else ""))

    def row_at(self, t: float) -> dict[str, Any]:
        """The row of the series at time t; ValueError where the run did not come that far."""
        row = int(np.argmin(np.abs(self.series["time"] - t)))
        if abs(self.series["time"][row] - t) > 1e-9:
            raise ValueError(f"{self.path.name} has no row at t = {t:g}: {self.attributes['message']}")
        return {name: values[row] for name, values in self.series.items()}


class RunWriter:
    """Writes one run, row by row and frame by frame; a context manager.

    Nothing appears at `path` before `finish`, which replaces an existing file atomically.  Left without
    `finish` (an exception is on its way) the writer leaves the last checkpoint where it is.

    Parameters
    ----------
    path : destination, by custom ending in `.vtkhdf`.
    xi : material positions of the nodes, (2, N).
    cells : nodes of each cell in the order of `lagrange.nodes`, (n_local, n_cells).
    delta : delta(xi) of (2.5) on cells, (n_cells,).
    attributes : at least `RUN_ATTRIBUTES`.
    goes_on : whether to take up the run whose checkpoint stands in `unfinished(path)`.

    Raises
    ------
    UserError : the checkpoint is that of a run on another mesh; what is said of `checkpoint` and `finish`.
    ValueError : an attribute is missing.
    """

    def __init__(
        self,
        path: Path,
        xi: Array,
        cells: Indices,
        delta: Array,
        attributes: Attributes,
        goes_on: bool = False,
    ) -> None:
        if missing := [name for name in RUN_ATTRIBUTES if name not in attributes]:
            raise ValueError(f"attributes of a run lack {', '.join(missing)}")
        self._path = Path(path)
        self._rows: list[dict[str, Array]] = []
        self._frames: list[tuple[float, Frame]] = []
        self._shapes: dict[str, tuple[int, ...]] = {}
        self._spare: NDArray[np.uint8] | None = None
        self._file = _in_memory(unfinished(self._path), "r+" if goes_on else "w")
        if goes_on:
            self._series = self._file["run/series"]
            self._shapes = {name: self._series[name].shape[1:] for name in self._series}
            film = vtkhdf.read(self._file)
            if not (np.array_equal(film.xi, xi) and np.array_equal(film.cells, cells)):
                raise UserError(f"{unfinished(self._path)}: that run is on another mesh; valid: the same one")
        else:
            run = self._file.create_group("run")
            state(run, {"schema": SCHEMA, **attributes})
            self._series = run.create_group("series")
            with self._room(xi.nbytes + cells.nbytes):
                vtkhdf.create(self._file, xi, cells, delta)

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return len(self._rows) + (len(self._series["time"]) if self._shapes else 0)

    def record(self, row: Mapping[str, float | ArrayLike]) -> None:
        """Append one row to `/run/series`; the first row fixes names and shapes, others raise ValueError."""
        arrays = {name: np.asarray(value, dtype=float) for name, value in row.items()}
        shapes = {name: value.shape for name, value in arrays.items()}
        if not self._shapes:
            self._shapes = shapes
            for name, shape in shapes.items():
                vtkhdf.growing(self._series, name, shape, rows=_ROWS_PER_CHUNK)
        if shapes != self._shapes:
            raise ValueError(f"a row must have the names and shapes of the first, {self._shapes}")
        self._rows.append(arrays)
        if len(self._rows) == _ROWS_PER_CHUNK:
            self._write_rows()

    def frame(self, t: float, frame: Frame) -> None:
        """Append one output time."""
        self._frames.append((t, frame))
        if len(self._frames) * frame.x.size > _NUMBERS_KEPT:
            self._write_frames()

    def checkpoint(self, arrays: Mapping[str, NDArray[Any]], outcome: Outcome, wall_seconds: float) -> None:
        """Put the run as it is on disk, and with it what it goes on from, see `last_checkpoint`.

        Arrays are contiguous; their order in memory is kept, for sums depend on it.  The outcome is how the
        run ended if nothing comes after.  UserError where it cannot be written: the last one is kept then.
        """
        run = self._file["run"]
        if _CHECKPOINT in run:
            del run[_CHECKPOINT]
        stored = run.create_group(_CHECKPOINT)
        with self._room(sum(array.nbytes for array in arrays.values())):
            for name, array in arrays.items():
                if not array.flags.forc:
                    raise ValueError(f"{name} of a checkpoint is not contiguous")
                transposed = not array.flags.c_contiguous
                stored[name] = array.T if transposed else array
                stored[name].attrs["transposed"] = transposed
        self._put(unfinished(self._path), outcome, wall_seconds)

    def last_checkpoint(self) -> dict[str, NDArray[Any]]:
        """The arrays of the checkpoint that the run was taken up from."""
        stored = self._file["run"][_CHECKPOINT]
        arrays = {name: vtkhdf.whole(stored, name) for name in stored}
        return {
            name: array.T if stored[name].attrs["transposed"] else array for name, array in arrays.items()
        }

    def finish(self, outcome: Outcome, wall_seconds: float) -> None:
        """State how the run ended and put it at its destination; UserError as for `checkpoint`."""
        if _CHECKPOINT in self._file["run"]:
            del self._file["run"][_CHECKPOINT]
        self._put(self._path, outcome, wall_seconds)
        with suppress(OSError):  # the run is there; what is left of it does no harm
            unfinished(self._path).unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._spare = None
        self._file.close()

    @contextmanager
    def _room(self, more: int = 0) -> Iterator[None]:
        """Let HDF5 have room for so many bytes more; MemoryError before it begins where there is none."""
        self._spare = None
        np.empty(_SPARE + 4 * more, dtype=np.uint8)  # asked for, and given back
        yield
        self._spare = np.empty(_SPARE, dtype=np.uint8)  # what is not touched takes no memory, but an address

    def _put(self, path: Path, outcome: Outcome, wall_seconds: float) -> None:
        self._write_rows()
        self._write_frames()
        ending = (str(outcome.ending), outcome.message, wall_seconds)
        with self._room():
            state(self._file["run"], dict(zip(_ENDING, ending, strict=True)))
            image = _image(self._file)
        try:
            replace_file(path, image)
        except UserError as error:
            if not (kept := unfinished(self._path)).exists():
                raise
            raise UserError(f"{error}; {kept.name} holds the last checkpoint, --resume goes on") from error

    def _write_rows(self) -> None:
        with self._room():
            for name in self._rows[0] if self._rows else ():
                vtkhdf.append(self._series[name], np.stack([row[name] for row in self._rows]))
        self._rows.clear()

    def _write_frames(self) -> None:
        if self._frames:
            with self._room(sum(3 * frame.x.nbytes + frame.a_cells.nbytes for _, frame in self._frames)):
                vtkhdf.append_frames(self._file, *zip(*self._frames, strict=True))
        self._frames.clear()


def read_run(path: Path) -> Run:
    """Return the run stored in `path`.

    Raises
    ------
    UserError : the file is missing, not HDF5, truncated, not a run or of another schema.
    """
    with reading(path, "run") as file:
        attributes = dict(file["run"].attrs)
        if missing := [name for name in (*RUN_ATTRIBUTES, *_ENDING) if name not in attributes]:
            raise KeyError(f"/run lacks {', '.join(missing)}")
        _check(attributes)
        series = {name: vtkhdf.whole(file["run/series"], name) for name in file["run/series"]}
        rows = len(vtkhdf.numbers(file["run/series"], "time", 1)) if series else 0
        if wrong := [
            name for name, one in series.items() if one.dtype.kind != "f" or one.shape[:1] != (rows,)
        ]:
            raise ValueError(f"/run/series/{wrong[0]} does not have a row per step")
        film = vtkhdf.read(file)
        return Run(path=Path(path), attributes=attributes, series=series, **vars(film))


def _check(attributes: Mapping[str, Any]) -> None:
    """Raise ValueError unless what is stated about a run is text and numbers where they should be."""
    for name in (*RUN_ATTRIBUTES, *_ENDING):
        value = attributes[name]
        number = isinstance(value, np.number)
        printable = isinstance(value, str) and (value.isprintable() or name == "scene")
        if not (number if name in ("refine", "dt", "seed", "wall_seconds") else printable):
            raise ValueError(f"/run states {name} = {value!r:.40}")
    Ending(attributes["outcome"])


def annotate(path: Path, attributes: Attributes) -> None:
    """State more about a finished run: what is known only when it is compared with others."""
    with changing(path) as file:
        state(file["run"], attributes)


def _in_memory(path: Path, mode: str) -> h5py.File:
    """Open a file that is read, if at all, from a path and never written to it.

    The library cannot be trusted with a disk that fills up: a file that it fails to close, it never lets go.
    """
    # this format guards its structure by checksums; the library can crash on a damaged file of older ones
    return h5py.File(path, mode, libver=("v108", "v110"), driver="core", backing_store=False, locking=False)


def _image(file: h5py.File) -> bytes:
    """The bytes of a file in memory."""
    file.flush()
    image: bytes = file.id.get_file_image()
    return image


@contextmanager
def writing(path: Path, attributes: Attributes) -> Iterator[h5py.File]:
    """Write a file other than a run, which appears at `path` when all is well and not at all otherwise.

    Its attributes are `date` (UTC), `schema` and what is given.  UserError where it cannot be written.
    """
    with _in_memory(path, "w") as file:
        now = datetime.now(UTC).isoformat(timespec="seconds")
        state(file, {"schema": SCHEMA, "date": now, **attributes})
        yield file
        replace_file(Path(path), _image(file))


@contextmanager
def changing(path: Path) -> Iterator[h5py.File]:
    """Change a stored file, all at once: a process killed on the way leaves it as it was."""
    with _in_memory(path, "r+") as file:
        yield file
        replace_file(Path(path), _image(file))


@contextmanager
def reading(path: Path, kind: str) -> Iterator[h5py.File]:
    """Open a file of this schema; whatever proves it to be none becomes one line."""
    if not Path(path).is_file():
        raise UserError(f"{path}: no such file; expected a {kind} written by actin_xcheck")
    try:
        with h5py.File(path, locking=False) as file:  # replaced, never changed: nobody has to be kept out
            schema = (file["run"] if kind == "run" else file).attrs["schema"]
            if schema != SCHEMA:
                raise UserError(f"{path}: schema {schema}, but this version reads schema {SCHEMA}")
            yield file
    except UserError:
        raise
    except Exception as error:  # the library has its own for every way in which a file can be damaged
        reason = str(error).strip("'\"")
        raise UserError(f"{path}: not a whole {kind} written by actin_xcheck ({reason})") from error


def state(group: h5py.Group, attributes: Mapping[str, Any]) -> None:
    """Write attributes; text (and tuples of it) as variable-length UTF-8."""
    for name, value in attributes.items():
        text = isinstance(value, str | tuple)
        group.attrs.create(name, value, dtype=h5py.string_dtype() if text else None)
