"""What is true of a scene: what is known without a run, else a run to an accuracy.

Such a run is kept in the user's cache, for who judges a code does so again and again: by what was asked and
by a digest of the code, as a study's answers are.
"""

import os
import time
from contextlib import suppress
from dataclasses import dataclass
from math import nan
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import Ending, UserError
from actin_xcheck.core.files import replace_file
from actin_xcheck.core.model import Array
from actin_xcheck.runs.numerics import command
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import Scene, parse_scene
from actin_xcheck.studies.journal import key_of, stated
from actin_xcheck.studies.judge.theirs import INTEGRALS, SAME_TIME, columns_of
from actin_xcheck.studies.stored import delivered_run
from actin_xcheck.verdicts.known import known

KEPT = 30
"""Days for which a run of the cache is kept after it was used last."""


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
    reused : whether it was run for a judgement before.
    """

    error: float
    times: tuple[float, ...]
    names: tuple[str, ...]
    values: tuple[float, ...]
    reused: bool = False

    @property
    def columns(self) -> dict[str, Array]:
        """Columns (n,) by name."""
        return dict(zip(self.names, np.array(self.values).reshape(len(self.names), -1), strict=True))


def truth(asked: TruthAsked, folder: Path) -> Truth:
    """Run a scene to an accuracy, or to the best there is, and leave the run in the folder.

    A run that the same code has made for the same question is taken from the cache.
    """
    path, kept = folder / asked.file, _kept(asked)
    if not (reused := _taken(kept, path)):
        made = command("run", asked.origin, method="fem", accuracy=asked.accuracy, out=asked.file)
        delivered_run(parse_scene(asked.scene, asked.origin), asked.accuracy, path, made)
        _keep(path, kept)
    run = read_run(path)
    completed = run.attributes["outcome"] == Ending.COMPLETED
    columns = columns_of(run, parse_scene(asked.scene, asked.origin))
    return Truth(
        error=float(run.attributes["error_estimate"]) if completed else nan,
        times=tuple(run.series["time"].tolist()),
        names=tuple(columns),
        values=tuple(np.concatenate(list(columns.values())).tolist()),
        reused=reused,
    )


def _kept(asked: TruthAsked) -> Path:
    """Where the cache has the answer to a question, by this code."""
    from platformdirs import user_cache_path

    folder = user_cache_path("actin_xcheck", appauthor=False) / "truths"
    return folder / f"{key_of(truth, stated(asked))}.vtkhdf"


def _taken(kept: Path, path: Path) -> bool:
    """Put a run of the cache into place, where it has one that is whole."""
    try:
        read_run(kept)
        replace_file(path, kept.read_bytes())
        os.utime(kept)
    except (UserError, OSError):
        return False
    return True


def _keep(path: Path, kept: Path) -> None:
    """Put a run into the cache, and leave out those that nobody used for long; one that cannot be is none."""
    with suppress(OSError, UserError):
        kept.parent.mkdir(parents=True, exist_ok=True)
        replace_file(kept, path.read_bytes())
        for old in kept.parent.glob("*.vtkhdf"):
            if time.time() - old.stat().st_mtime > KEPT * 86400:
                old.unlink()


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
