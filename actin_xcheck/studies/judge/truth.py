"""What is true of a scene: what is known without a run, else a run to an accuracy."""

from dataclasses import dataclass
from math import nan
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import Array
from actin_xcheck.runs.accuracy import deliver
from actin_xcheck.runs.numerics import command
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import Scene, parse_scene
from actin_xcheck.studies.judge.theirs import INTEGRALS, SAME_TIME, columns_of
from actin_xcheck.verdicts.known import known


@dataclass(frozen=True)
class TruthAsked:
    """A scene and the accuracy to which it is to be run."""

    scene: str
    origin: str
    accuracy: float

    @property
    def file(self) -> str:
        """Where the run goes, in the study's folder."""
        return f"truth-{self.accuracy:.0e}.vtkhdf"


@dataclass(frozen=True)
class Truth:
    """What is true of a scene, by a run.

    Attributes
    ----------
    error : to what it is known; nan where the run ended before its time.
    times : of its rows, (n,).
    names, values : of its columns (k,), and these one after the other, (k n,).
    """

    error: float
    times: tuple[float, ...]
    names: tuple[str, ...]
    values: tuple[float, ...]

    @property
    def columns(self) -> dict[str, Array]:
        """Columns (n,) by name."""
        return dict(zip(self.names, np.array(self.values).reshape(len(self.names), -1), strict=True))


def truth(asked: TruthAsked, folder: Path) -> Truth:
    """Run a scene to an accuracy, or to the best there is, and leave the run in the folder."""
    scene, path = parse_scene(asked.scene, asked.origin), folder / asked.file
    made = command("run", asked.origin, method="fem", accuracy=asked.accuracy, out=asked.file)
    try:
        reached = deliver(scene, asked.accuracy, path, made)
        error = reached.estimate if reached.outcome.ok else nan
    except UserError:  # out of reach: the file has what was
        error = float(read_run(path).attributes["error_estimate"])
    run = read_run(path)
    columns = columns_of(run, scene)
    values = np.concatenate(list(columns.values())).tolist()
    return Truth(error, tuple(run.series["time"].tolist()), tuple(columns), tuple(values))


def known_alone(scene: Scene, name: str, t: float) -> tuple[float, float, str] | None:
    """What is known of a column without a run: value, uncertainty and origin."""
    quantity, part = name, 0
    if name.startswith("probe_"):
        k, what = name.split("_")[1:]
        quantity = "probe_a" if what == "a" else "probe_x"
        part = int(k) - 1 if what == "a" else 2 * (int(k) - 1) + "xy".index(what)
    if quantity not in (*INTEGRALS, "probe_a", "probe_x"):
        return None
    found = known(scene, quantity, t)
    if found is None or not np.isfinite(found.values[part]):
        return None
    return float(found.values[part]), found.uncertainty, found.origin


def true_value(scene: Scene, name: str, t: float, run: Truth) -> tuple[float, float, str] | None:
    """The truth of a column at an output time: what is known, else what the run says; None without either."""
    if found := known_alone(scene, name, t):
        return found
    times = np.array(run.times)
    at = int(np.argmin(np.abs(times - t)))
    if name not in run.columns or abs(times[at] - t) > SAME_TIME * scene.output_times[-1]:
        return None
    value = run.columns[name][at]
    return (
        float(value),
        run.error * (abs(float(value)) if name in INTEGRALS else 1.0),
        f"a run to {run.error:.0e}",
    )
