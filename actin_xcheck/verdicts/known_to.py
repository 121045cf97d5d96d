"""To what the integrals of a scene are known: how many claims hold says nothing of how much that is worth.

A bound is as wide as the resolution of its run, so that all claims of a coarse run can hold while its cell is
far too large.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from actin_xcheck.scene.scene import Scene
from actin_xcheck.verdicts.known import known
from actin_xcheck.verdicts.triangulate import Levels, estimate, reaches

WELL = 0.01
"""Relative: integrals that are known less well are no success, whatever holds of them."""


@dataclass(frozen=True)
class KnownTo:
    """To what a scene's integrals are known by the worst of its runs.

    Attributes
    ----------
    scene : its name.
    area, total_actin : the largest relative error over runs and output times; nan where not known.
    """

    scene: str
    area: float
    total_actin: float

    @property
    def errors(self) -> dict[str, float]:
        """By quantity."""
        return {"area": self.area, "total_actin": self.total_actin}

    @property
    def is_well(self) -> bool:
        """Whether all integrals are known to 1 % or better."""
        return all(error <= WELL for error in self.errors.values())

    @property
    def sentence(self) -> str:
        """In percent, for a reader."""
        said = (
            f"{name.replace('_', ' ')} {'not known' if np.isnan(error) else f'known to {100 * error:.2g} %'}"
            for name, error in self.errors.items()
        )
        return f"{self.scene}: {', '.join(said)}"


def known_to(scene: Scene, levels: Sequence[Levels]) -> KnownTo:
    """To what a scene's integrals are known by its runs.

    An error is the distance to theory where that knows the number, else the uncertainty from coarser runs.
    """

    def worst(quantity: str) -> float:
        errors = (_error(scene, one, quantity, t) for one in levels for t in scene.output_times)
        return max(errors, key=lambda error: np.inf if np.isnan(error) else error)

    return KnownTo(scene.name, worst("area"), worst("total_actin"))


def _error(scene: Scene, levels: Levels, quantity: str, t: float) -> float:
    if not reaches(levels.runs[0], t):
        return np.nan
    values, error, _ = estimate(scene, levels, quantity, t)
    theory = known(scene, quantity, t)
    if theory is not None and np.isfinite(theory.values[0]):
        error = float(abs(values[0] - theory.values[0])) + theory.uncertainty
    return error / abs(float(values[0]))
