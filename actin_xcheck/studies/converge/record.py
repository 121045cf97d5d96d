"""The convergence report as a file: every study with its levels, errors, orders, verdict and runs.

`/studies/<key>` holds a study: what it is in attributes, one row per error in datasets.  An error against the
next finer level stands in the row of the coarser one, so that such a study has one row fewer than runs.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py

from actin_xcheck.core.model import Array
from actin_xcheck.runs.store import provenance, reading, state, writing
from actin_xcheck.verdicts.orders import ObservedOrder, Verdict

FILE_NAME = "convergence.h5"

_WORDS = ("scene", "citation", "method", "refined", "quantity", "truth", "command", "runs")
_SAID = ("declared", "claimed", "at_least", "floor")
_ROWS = ("refine", "steps", "h", "dt", "errors")


@dataclass(frozen=True, eq=False)
class Result:
    """A study as it came out.

    Attributes
    ----------
    key, scene, citation, method, refined, quantity, truth : of the study, in words.
    declared : the order of the method.
    claimed : whether it is claimed here.
    at_least : whether a higher order holds too.
    floor : errors up to this are round-off.
    refine, steps, h, dt, errors : one row per error, (n,).
    endings : how the runs of a row ended, n sentences; empty where they completed.
    observed : orders and verdict.
    command : what makes the study again.
    runs : files of the runs, relative to the report's folder, coarsest first.
    """

    key: str
    scene: str
    citation: str
    method: str
    refined: str
    quantity: str
    truth: str
    declared: float
    claimed: bool
    at_least: bool
    floor: float
    refine: Array
    steps: Array
    h: Array
    dt: Array
    errors: Array
    endings: tuple[str, ...]
    observed: ObservedOrder
    command: str
    runs: tuple[str, ...]

    @property
    def width(self) -> Array:
        """What the orders are in, (n,): h or dt."""
        return self.h if self.refined == "h" else self.dt


@dataclass(frozen=True)
class Convergence:
    """A stored report: its studies in order and what was stated about the whole."""

    path: Path
    attributes: dict[str, Any]
    results: tuple[Result, ...]


def write_convergence(path: Path, results: Iterable[Result], command: str) -> None:
    """Write a report, replacing `path` atomically: group `/studies/<key>` each, links `/runs/<file>`.

    UserError where the file cannot be written.
    """
    with writing(path, {"command": command, **provenance()}) as file:
        studies = file.create_group("studies", track_order=True)
        linked = file.create_group("runs")
        for result in results:
            group, found = studies.create_group(result.key), result.observed
            state(group, {name: getattr(result, name) for name in (*_WORDS, *_SAID)})
            numbers = {name: getattr(found, name) for name in ("slope", "low", "high")}
            state(group, numbers | {"verdict": str(found.verdict), "reason": found.reason})
            for name in _ROWS:
                group[name] = getattr(result, name)
            group["local_orders"] = found.local
            group.create_dataset("endings", data=list(result.endings), dtype=h5py.string_dtype())
            for run in result.runs:
                if os.path.basename(run) not in linked:
                    linked[os.path.basename(run)] = h5py.ExternalLink(run, "/")


def read_convergence(path: Path) -> Convergence:
    """Return the report stored in `path`; UserError where it is missing, not whole or something else."""
    with reading(path, "convergence report") as file:
        results = tuple(_result(key, group) for key, group in file["studies"].items())
        return Convergence(Path(path), dict(file.attrs), results)


def _result(key: str, group: h5py.Group) -> Result:
    said = group.attrs
    observed = ObservedOrder(
        float(said["slope"]),
        float(said["low"]),
        float(said["high"]),
        tuple(group["local_orders"][()].tolist()),
        Verdict(said["verdict"]),
        said["reason"],
    )
    values = {name: said[name] for name in (*_WORDS, *_SAID)} | {
        "key": key,
        "runs": tuple(said["runs"]),
        "endings": tuple(group["endings"].asstr()[()]),
        "observed": observed,
        **{name: group[name][()] for name in _ROWS},
    }
    return Result(**{field.name: values[field.name] for field in fields(Result)})
