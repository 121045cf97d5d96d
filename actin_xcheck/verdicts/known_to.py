"""To what the integrals of a scene are known: how many claims hold says nothing of how much that is worth.

A bound is as wide as the resolution of its run, so that all claims of a coarse run can hold while its cell is
far too large.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from actin_xcheck.runs.store import changing, reading, state
from actin_xcheck.scene.scene import Scene
from actin_xcheck.verdicts.known import known
from actin_xcheck.verdicts.triangulate import Levels, estimate, reaches

INTEGRALS = ("area", "total_actin")

WELL = 0.01
"""Relative: integrals that are known less well are no success, whatever holds of them."""

KnownTo = Mapping[str, float]
"""By the names of `INTEGRALS` the largest relative error over runs and output times; nan where not known."""


def known_to(scene: Scene, levels: Sequence[Levels]) -> KnownTo:
    """To what a scene's integrals are known by the worst of its runs, see `KnownTo`.

    An error is the distance to theory where that knows the number, else the uncertainty from coarser runs.
    """
    return {
        name: max(
            (_error(scene, one, name, t) for one in levels for t in scene.output_times),
            key=lambda error: np.inf if np.isnan(error) else error,
        )
        for name in INTEGRALS
    }


def _error(scene: Scene, levels: Levels, quantity: str, t: float) -> float:
    if not reaches(levels.runs[0], t):
        return np.nan
    values, error, _ = estimate(scene, levels, quantity, t)
    theory = known(scene, quantity, t)
    if theory is not None and np.isfinite(theory.values[0]):
        error = float(abs(values[0] - theory.values[0])) + theory.uncertainty
    return error / abs(float(values[0]))


def is_well(found: KnownTo) -> bool:
    """Whether all integrals are known to 1 % or better."""
    return all(error <= WELL for error in found.values())


def in_words(found: KnownTo) -> str:
    """In percent, for a reader."""
    return ", ".join(
        f"{name.replace('_', ' ')} " + ("not known" if np.isnan(error) else f"known to {100 * error:.2g} %")
        for name, error in found.items()
    )


# files


def keep(path: Path, found: Mapping[str, KnownTo]) -> None:
    """Add to a stored comparison what is known of each scene: attributes of `/known_to/<scene>`."""
    with changing(path) as file:
        kept = file.create_group("known_to", track_order=True)
        for scene, errors in found.items():
            state(kept.create_group(scene), errors)


def read_known_to(path: Path) -> dict[str, KnownTo]:
    """What is known of each scene of a stored comparison, if anything; UserError as for `read_run`."""
    with reading(path, "comparison") as file:
        return {
            scene: {name: float(group.attrs[name]) for name in INTEGRALS}
            for scene, group in file.get("known_to", {}).items()
        }
