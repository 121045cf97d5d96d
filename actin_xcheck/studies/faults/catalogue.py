"""All faults by name, with those of what judges: observables, and the theory that runs are held against."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import signed_areas
from actin_xcheck.core.model import Array, Model
from actin_xcheck.studies.faults import mechanics, schemes, transport
from actin_xcheck.studies.faults.fault import Fault, Function


def _polygonal(right: Function, space: Any, x: Array, a: Array) -> Any:
    polygon = float((space.orientation * signed_areas(x, space.cells[:3])).sum())
    return replace(right(space, x, a), area=polygon)


def _next_cell(right: Function, held: Any, points: Array) -> Any:
    cells, weights = right(held, points)
    count = (held.triangles if hasattr(held, "triangles") else held.cells).shape[1]
    return (cells + 1) % count, weights


def _next_root(right: Function, model: Model, m: int, n: int) -> complex:
    return complex(right(model, m, n + 1))


def _a_percent_more(right: Function, x: Array) -> Array:
    return np.asarray(1.01 * right(x))


def _overconfident(right: Function, *arguments: Any) -> tuple[float, str]:
    size, how = right(*arguments)
    return size / 10, how


OF_JUDGES = (
    Fault(
        "area-polygonal",
        "The area of a cell with a curved rim is that of the polygon through its vertices.",
        "harness",
        "fem.imex:measure",
        _polygonal,
    ),
    Fault(
        "probes-off-curved",
        "Probes in curved cells read the next cell.",
        "harness",
        "fem.imex:locate",
        _next_cell,
    ),
    Fault(
        "probes-off",
        "Probes in straight cells read the next cell.",
        "harness",
        "actin_xcheck.core.contract:locate",
        _next_cell,
    ),
    Fault(
        "theory-wrong-root",
        "Growth rates are held against the next root of the dispersion relation.",
        "harness",
        "actin_xcheck.verdicts.judge:growth_rate",
        _next_root,
    ),
    Fault(
        "theory-wrong-area",
        "The third corner, the exact area and total actin, is a hundredth too large.",
        "harness",
        "actin_xcheck.verdicts.known:_jacobian",
        _a_percent_more,
    ),
    Fault(
        "uncertainty-too-small",
        "Uncertainties from coarser runs are ten times too small.",
        "harness",
        "actin_xcheck.verdicts.triangulate:uncertainty",
        _overconfident,
    ),
)


FAULTS = {fault.name: fault for fault in (*mechanics.FAULTS, *transport.FAULTS, *schemes.FAULTS, *OF_JUDGES)}


def find_faults(names: Sequence[str] | None) -> list[Fault]:
    """Return the faults with these names, all without any; UserError lists the valid ones."""
    if unknown := [name for name in names or () if name not in FAULTS]:
        raise UserError(f"--only: {unknown[0]!r} is not a fault; valid: {', '.join(FAULTS)}")
    return [FAULTS[name] for name in dict.fromkeys(names or FAULTS)]
