"""The chart as a file: every run with its timings, counts, values and errors, and what it was held against.

`/points/<key>` holds a run, `/reference/<key>` those that the others are held against: what they are in
attributes, timings and values in datasets.  `/truth/<quantity>` says how a quantity is known, and
`/ledger/<number>` what a term of the scene is worth.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from actin_xcheck.runs.fidelity import Fidelity
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.store import reading, state, writing
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies import ledger
from actin_xcheck.studies.chart.measure import Sample
from actin_xcheck.studies.chart.points import Point
from actin_xcheck.studies.chart.truth import Known, Quantity, Standing, standing

FILE_NAME = "chart.h5"

_SAID = (
    *("ending", "message", "steps", "rejected", "cells", "factorisations", "solves", "memory", "baseline"),
)
_ARRAYS = ("wall", "cpu", "kernel", "times", "area", "probe_a", "probe_x", "cloud_a", "cloud_x")


@dataclass(frozen=True, eq=False)
class Charted:
    """A run of a chart: the sample, its errors by quantity, and the command that makes it again."""

    sample: Sample
    errors: dict[Quantity, float]
    command: str


@dataclass(frozen=True, eq=False)
class Chart:
    """A stored chart.

    Attributes
    ----------
    path, attributes : the file and what it states about the whole.
    reference : the runs that others are held against, coarse and fine.
    known : how each quantity is known; empty where the reference has not been run yet.
    points : the runs, method by method, from little work to much.
    entries : the term ledger; empty where it has not been made yet.
    """

    path: Path
    attributes: dict[str, Any]
    reference: tuple[Sample, ...]
    known: dict[Quantity, Known]
    points: tuple[Charted, ...]
    entries: tuple[ledger.Entry, ...]

    @property
    def quantities(self) -> list[Quantity]:
        """Those of which anything is known."""
        return [quantity for quantity, known in self.known.items() if np.isfinite(known.floor)]

    def standing(self, point: Charted, quantity: Quantity) -> Standing:
        """What a point is in the chart of a quantity."""
        return standing(point.sample, point.errors, quantity, self.known)

    def judged(self, quantity: Quantity) -> list[float]:
        """The errors that mean something, in the order of the points; nan for the others."""
        return [
            point.errors[quantity] if self.standing(point, quantity) is Standing.JUDGED else np.nan
            for point in self.points
        ]


def write_chart(
    path: Path,
    scene: Scene,
    attributes: dict[str, Any],
    reference: Sequence[Sample],
    known: dict[Quantity, Known],
    points: Iterable[Charted],
    entries: Sequence[ledger.Entry] = (),
) -> None:
    """Write a chart, replacing `path` atomically; UserError where the file cannot be written."""
    about = {
        "scene": scene.text,
        "scene_name": scene.name,
        "citation": scene.citation,
        "origin": scene.origin,
    }
    with writing(path, about | attributes) as file:
        for quantity, one in known.items():
            state(file.create_group(f"truth/{quantity}"), {"source": one.source, "floor": one.floor})
        for name in ("reference", "points"):
            file.create_group(name, track_order=True)
        for sample in reference:
            _write(file["reference"].create_group(sample.point.key), sample)
        for point in points:
            group = file["points"].create_group(point.sample.point.key)
            _write(group, point.sample)
            state(group, {f"error_{name}": error for name, error in point.errors.items()})
            state(group, {"command": point.command})
        ledger.write(file.create_group("ledger"), entries)


def read_chart(path: Path) -> Chart:
    """Return the chart stored in `path`; UserError where it is missing, not whole or something else."""
    with reading(path, "chart") as file:
        reference = tuple(_read(group) for group in file["reference"].values())
        truth = file.get("truth", {})
        known = {
            Quantity(name): Known(group.attrs["source"], float(group.attrs["floor"]))
            for name, group in truth.items()
        }
        points = tuple(
            Charted(
                _read(group),
                {quantity: float(group.attrs[f"error_{quantity}"]) for quantity in Quantity},
                group.attrs["command"],
            )
            for group in file["points"].values()
        )
        entries = ledger.read(file["ledger"])
        return Chart(Path(path), dict(file.attrs), reference, known, points, entries)


def _write(group: h5py.Group, sample: Sample) -> None:
    point = sample.point
    said = {"method": point.method.name, "fidelity": str(point.fidelity), "refine": point.refine}
    said |= {"dt": point.dt, "rtol": np.nan if point.rtol is None else point.rtol}
    state(group, said | {name: getattr(sample, name) for name in _SAID})
    for name in _ARRAYS:
        group[name] = getattr(sample, name)


def _read(group: h5py.Group) -> Sample:
    said = group.attrs
    rtol = float(said["rtol"])
    point = Point(
        find_method(said["method"]),
        int(said["refine"]),
        float(said["dt"]),
        None if np.isnan(rtol) else rtol,
        Fidelity(said["fidelity"]),
    )
    values: dict[str, Any] = {name: said[name] for name in ("ending", "message")}
    values |= {name: int(said[name]) for name in _SAID if name not in values}
    values |= {name: group[name][()] for name in _ARRAYS}
    return Sample(point, **{one.name: values[one.name] for one in fields(Sample) if one.name != "point"})
