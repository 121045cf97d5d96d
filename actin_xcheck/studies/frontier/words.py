"""What a map says, in a sentence or two."""

import math
from collections import Counter
from collections.abc import Mapping

import numpy as np

from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.frontier.answers import BOUND
from actin_xcheck.studies.frontier.bisection import Bisection
from actin_xcheck.studies.frontier.classes import Kind
from actin_xcheck.studies.frontier.planes import MOST_STEPS, Axis, Plane, end_at

_DECADES = (10.0, 100.0, 1e3, 1e4)

_RIGHT = (Kind.ACCURATE, Kind.ENDS)

_SAMPLES = 4
"""Looks between two places of an axis."""


def words_of(scene: Scene, plane: Plane, found: Bisection) -> str:
    """Up to which dt a method is right at which psi, and how much of the plane is of which class."""
    parts = _shares_in_words(shares(plane, found))
    if plane.name != "psi,dt":
        return f"{parts}."
    own = scene.parameters.psi
    inside = [own] if plane.x.values[0] < own < plane.x.values[-1] else []
    at = [f"{float(f'{psi:.3g}'):g}" for psi in sorted({*_DECADES, *inside})]
    reaches = [_reach(scene, plane, found, psi) for psi in sorted({*_DECADES, *inside})]
    alike: dict[str, list[str]] = {}
    for psi, reach in zip(at, reaches, strict=True):
        alike.setdefault(reach, []).append(psi)
    told = [f"{reach} at ψ = {_enumerated(psi)}" for reach, psi in alike.items()]
    return f"right within {BOUND:.0%} {', '.join(told)}. Over the whole map: {parts}."


def shares(plane: Plane, found: Bisection) -> Mapping[str, float]:
    """Parts of the plane by class, as cells are drawn: each corner stands for its quarter."""
    x, y = (np.log(axis.values) if axis.log else np.array(axis.values) for axis in (plane.x, plane.y))
    parts: Counter[str] = Counter()
    whole = (x[-1] - x[0]) * (y[-1] - y[0])
    for cell in found.cells:
        size = (x[cell.right] - x[cell.left]) * (y[cell.top] - y[cell.bottom]) / whole
        for node in cell.corners:
            parts[found.found[node] or str(Kind.NOT_RUN)] += size / 4
    return parts


def _reach(scene: Scene, plane: Plane, found: Bisection, psi: float) -> str:
    """Up to which dt runs at psi are right, from the smallest one that is made."""
    column = _place(plane.x, psi)
    rows = np.arange((len(plane.y.values) - 1) * _SAMPLES + 1) / _SAMPLES
    steps = np.exp(np.interp(rows, np.arange(len(plane.y.values)), np.log(plane.y.values)))
    made = steps >= end_at(scene, psi) / MOST_STEPS
    classes = [found.class_at(column, float(row)) for row in rows[made]]
    wrong = next((i for i, known in enumerate(classes) if known not in _RIGHT), None)
    if wrong is None:
        return "at every Δt"
    if wrong == 0:
        return f"nowhere (Δt ≥ {steps[made][0]:.2g})"
    return f"up to Δt = {steps[made][wrong - 1]:.2g}"


def _place(axis: Axis, value: float) -> float:
    """Where a value lies between the places of a logarithmic axis."""
    return float(np.interp(math.log(value), np.log(axis.values), np.arange(len(axis.values))))


def _shares_in_words(parts: Mapping[str, float]) -> str:
    first = [str(Kind.ACCURATE), str(Kind.SILENT)]
    names = [*first, *sorted(parts.keys() - set(first))]
    said = [f"{name} in {_percent(parts[name])}" for name in names if parts.get(name)]
    if not any(name.startswith(Kind.FAILED) for name in parts):
        said.append("never fails")
    return ", ".join(said)


def _enumerated(items: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(items[:-1]), items[-1])))


def _percent(part: float) -> str:
    return f"{part:.0%}" if part >= 0.005 else "under 1%"
