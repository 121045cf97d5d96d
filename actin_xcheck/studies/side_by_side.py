"""Two runs, or two reports, side by side: what differs in what was asked, and what in what came of it."""

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Chapter, Exhibit, Line, Plot, Shot, Shots
from actin_xcheck.report.page import read_claims
from actin_xcheck.runs.store import Run, read_run, reading
from actin_xcheck.studies.study import Report, Study, Table, study_file

COLUMNS = 6
"""Pictures of a film, at most."""

TINY = 1e-9
"""A number of no more is 0, and nothing is relative to it."""

INTEGRALS = ("area", "total_actin", "centroid", "polarity")

_LEAD = "{first} beside {second}. Differences are the second less the first; nothing was computed again."


@dataclass(frozen=True)
class Differs:
    """What is stated of both and is not the same; empty where one has none."""

    what: str
    first: str
    second: str


@dataclass(frozen=True)
class ComparedNumber:
    """A number of both at one time, and how far the second is from the first, in its own size too."""

    quantity: str
    time: float
    first: float
    second: float
    difference: float
    relative: float


@dataclass(frozen=True)
class ComparedClaim:
    """A claim that both have, or one alone: verdicts and numbers."""

    scene: str
    methods: str
    statement: str
    first: str
    second: str
    first_value: float
    second_value: float


def side_by_side(given: Sequence[str]) -> Study:
    """Of two runs (.vtkhdf) or two folders with a report; UserError where they are not two of one kind."""
    paths = [Path(one) for one in given]
    runs = [path.suffix == ".vtkhdf" for path in paths]
    if len(paths) != 2 or runs[0] != runs[1]:
        raise UserError(
            f"{', '.join(given)}: valid are scenes, two runs (.vtkhdf), or two folders of reports"
        )
    return _runs(*map(read_run, paths)) if runs[0] else _reports(*paths)


def _runs(first: Run, second: Run) -> Study:
    yield []
    common = [float(t) for t in first.times if np.abs(second.times - t).min(initial=np.inf) < 1e-9]
    if not common:
        raise UserError(f"{first.path}, {second.path}: have no output time in common; valid: runs with one")
    apart = list(_integrals(first, second, common[-1]))
    differ = list(_differing(_stated(first), _stated(second)))
    area = apart[0]
    names = {"first": str(first.path), "second": str(second.path)}
    return Report(
        f"{area.quantity} at t = {area.time:g}: {area.first:.6g} and {area.second:.6g}, "
        f"{area.difference:+.2g} ({area.relative:+.2g} of it)",
        _LEAD.format(**names),
        {
            "apart": Table("At the last common output time", apart),
            "differs": Table("What differs", differ, "In scene, method, versions and how they ended."),
        },
        chapters=(Chapter("both", "Both", "", (*_film(first, second, common), *_charts(first, second))),),
    )


def _reports(first: Path, second: Path) -> Study:
    yield []
    (said, before), (told, after) = (_report(folder) for folder in (first, second))
    turned = list(_turned(before, after))
    verdicts = sum(one.first != one.second for one in turned)
    return Report(
        f"{verdicts} verdicts differ, {len(turned) - verdicts} numbers, of {len(before)} and {len(after)}",
        _LEAD.format(first=first, second=second),
        {
            "turned": Table("Claims that differ", turned, "Other verdicts first, then the largest changes."),
            "differs": Table(
                "What differs", list(_differing(said, told)), "In command, versions and machine."
            ),
        },
    )


def _report(folder: Path) -> tuple[dict[str, Any], list[Claim]]:
    """What the report in a folder states about itself, and its claims."""
    if not folder.is_dir() or (path := study_file(folder)) is None:
        raise UserError(
            f"{folder}: no report of a study; valid: a folder with one, a run (.vtkhdf) or a scene"
        )
    with reading(path, "report of a study") as file:
        kept = {key: value for key, value in file.attrs.items() if key not in ("lead", "findings")}
        return _flat(kept), read_claims(file)


def _turned(before: Sequence[Claim], after: Sequence[Claim]) -> Iterator[ComparedClaim]:
    """Claims that differ by verdict, then those by value, the largest change first."""
    old, new = ({one.key: one for one in claims} for claims in (before, after))
    rows = []
    for key in dict.fromkeys([*old, *new]):
        one, other = old.get(key), new.get(key)
        shown = one or other
        assert shown is not None
        values = [nan if claim is None else claim.value for claim in (one, other)]
        words = ["" if claim is None else claim.verdict for claim in (one, other)]
        if words[0] != words[1] or not np.array_equal(values[:1], values[1:], equal_nan=True):
            rows.append(
                ComparedClaim(
                    shown.scene, ", ".join(shown.methods), shown.statement, words[0], words[1], *values
                )
            )
    yield from sorted(rows, key=lambda row: (row.first == row.second, -_change(row)))


def _change(row: ComparedClaim) -> float:
    """By how much a value changed, relative; infinite where it had none."""
    size = max(abs(row.first_value), abs(row.second_value))
    return abs(row.second_value - row.first_value) / size if size > 0 else 0.0 if size == 0 else np.inf


def _integrals(first: Run, second: Run, t: float) -> Iterator[ComparedNumber]:
    """What both have measured at one time, component by component."""
    rows = [one.row_at(t) for one in (first, second)]
    for name in INTEGRALS:
        if all(name in row for row in rows):
            for i, (one, other) in enumerate(zip(*(np.ravel(row[name]) for row in rows), strict=True)):
                what = name.replace("_", " ") + (f" {'xy'[i]}" if name == "centroid" else "")
                off = float(other - one)
                yield ComparedNumber(
                    what, t, float(one), float(other), off, off / float(one) if abs(one) > TINY else nan
                )


def _stated(run: Run) -> dict[str, Any]:
    """What a run says of its scene, method, versions and end, by dotted keys."""
    kept = dict(run.attributes) | {"cells": run.cells.shape[1], "rows": len(run.series["time"])}
    kept |= {"scene": tomllib.loads(str(kept["scene"]))}
    return _flat({key: value for key, value in kept.items() if key not in ("wall_seconds", "created")})


def _flat(given: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Tables, and JSON in strings, by dotted keys."""
    flat: dict[str, Any] = {}
    for key, value in given.items():
        if isinstance(value, str) and value.startswith("{"):
            value = json.loads(value)
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{above}{key}.")
        else:
            flat[f"{above}{key}"] = value
    return flat


def _differing(first: Mapping[str, Any], second: Mapping[str, Any]) -> Iterator[Differs]:
    for key in dict.fromkeys([*first, *second]):
        one, other = (str(given.get(key, "")) for given in (first, second))
        if one != other:
            yield Differs(key, one, other)


def _film(first: Run, second: Run, times: Sequence[float]) -> Iterator[Exhibit]:
    """Both cells at common times, and their difference at the same material points, on the first one's."""
    chosen = [times[i] for i in np.unique(np.linspace(0, len(times) - 1, COLUMNS).round().astype(int))]
    apart = []
    for run, name in (first, "first"), (second, "second"):
        shots = [_shot(run, t) for t in chosen]
        yield Shots(f"film-{name}", f"The {name}", str(run.path), tuple(shots))
    for t in chosen:
        shown, frame = _shot(first, t), _frame(first, t)
        off = _between_nodes(second, _frame(second, t), first.xi) - first.a_points[frame]
        values = off[first.triangles].mean(axis=0)
        apart.append(
            Shot(f"t = {t:.4g}, at most {np.abs(values).max():.2g}", shown.x, shown.triangles, values)
        )
    note = "At the same material points, linearly between the second one's nodes; where the first one's are."
    yield Shots("film-difference", "The second less the first", note, tuple(apart))


def _frame(run: Run, t: float) -> int:
    return int(np.argmin(np.abs(run.times - t)))


def _shot(run: Run, t: float) -> Shot:
    frame = _frame(run, t)
    values = run.a_points[frame][run.triangles].mean(axis=0)
    return Shot(f"t = {t:.4g}", run.points[frame], run.triangles, values)


def _between_nodes(run: Run, frame: int, xi: Array) -> Array:
    """Concentrations of a run at material points (2, n), (n,); of the nearest node beyond its rim."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    values = LinearNDInterpolator(run.xi.T, run.a_points[frame])(xi.T)
    beyond = np.isnan(values)
    values[beyond] = NearestNDInterpolator(run.xi.T, run.a_points[frame])(xi.T[beyond])
    return np.asarray(values)


def _charts(first: Run, second: Run) -> Iterator[Exhibit]:
    """Integrals over time by both, and their difference where both have a row."""
    t, other = first.series["time"], second.series["time"]
    within = t <= other[-1] + 1e-9
    for name in ("area", "total_actin"):
        one, two = first.series[name], second.series[name]
        title, both = name.replace("_", " "), (Line("first", t, one), Line("second", other, two))
        yield Plot(name, title, "non-dimensional", "t", both)
        off = Line("second − first", t[within], np.interp(t[within], other, two) - one[within])
        note = "non-dimensional; linearly between the second one's steps"
        yield Plot(f"{name}-difference", f"difference of {title}", note, "t", (off,), levels=(("", 0.0),))
