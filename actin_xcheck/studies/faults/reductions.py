"""Faults of the smaller models: a sector, one ray, linear modes."""

from dataclasses import replace
from typing import Any

import numpy as np

from actin_xcheck.core.model import Array, Closure
from actin_xcheck.studies.faults.fault import Fault, Function


def _sides_left_free(right: Function, closure: Closure, space: Any) -> tuple[Any, Array]:
    return np.zeros(0, dtype=np.int64), np.zeros((2, 0))


def _more_mirrors(right: Function, problem: Any, end: float) -> Any:
    found = right(problem, end)
    return replace(found, mirrors=found.mirrors and replace(found.mirrors, mirrors=2 * found.mirrors.mirrors))


def _counted_once_less(right: Function, self: Any, state: Any) -> Any:
    found, copies = right(self, state), len(self.images)
    return replace(found, total_actin=found.total_actin * (copies - 1) / copies)


def _without_r(right: Function, self: Any, r: Array) -> Any:
    shape, values = right(self, r), self.ray.values
    dx = shape.dx / shape.r
    return replace(shape, dx=dx, mass=(values.T * dx) @ values)


def _without_hoop(right: Function, self: Any, *arguments: Any) -> None:
    right(self, *arguments)
    self._hoop = 0 * self._hoop


def _a_little_longer(right: Function, self: Any, values: Any, dt: float) -> Any:
    return right(self, values, (1 + 1e-4) * dt)


FAULTS = (
    Fault(
        "sector-sides-free",
        "Nodes on the mirror lines of a sector move as they like.",
        "fem",
        "fem.boundary:along_sides",
        _sides_left_free,
    ),
    Fault(
        "sector-too-narrow",
        "A cell is taken for twice as symmetric as it is: a quarter of it is solved in place of a half.",
        "fem",
        "actin_xcheck.runs.fidelity:symmetry_of",
        _more_mirrors,
    ),
    Fault(
        "sector-multiplicity",
        "Total actin is summed over one image of the sector too few.",
        "fem",
        "fem.reduced.sector:Unfolded.measure",
        _counted_once_less,
    ),
    Fault(
        "radial-metric-dropped",
        "The area element of the ray is 2π dr in place of 2π r dr.",
        "fem",
        "fem.reduced.radial:Radial._shape",
        _without_r,
    ),
    Fault(
        "radial-hoop-dropped",
        "μ₂ does not couple the strains along the ray and across it.",
        "fem",
        "fem.reduced.radial:Radial.__init__",
        _without_hoop,
    ),
    Fault(
        "modal-rate-off",
        "All linear modes evolve faster by 1e-4 of their rates.",
        "fem",
        "fem.reduced.radial_modes:AngularMode.carried",
        _a_little_longer,
    ),
)
