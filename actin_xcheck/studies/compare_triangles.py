"""Triangles as exhibits: FEM, FV and theory one below the other, each with its uncertainty."""

from collections.abc import Mapping

import numpy as np

from actin_xcheck.report.exhibits import Intervals
from actin_xcheck.verdicts.triangulate import Triangle

_INK = -1


def intervals(triangle: Triangle, styles: Mapping[str, int]) -> Intervals | None:
    """Return a triangle as distances from theory, or from FEM without one; None where nothing was compared.

    `styles` are the numbers of the methods' colours, by name.
    """
    corners = triangle.corners
    if not corners:
        return None
    origin = corners[2 if len(corners) > 2 else 0]
    used = [*(styles.get(name, _INK) for name in triangle.methods), _INK]
    return Intervals(
        key=triangle.key,
        title=triangle.words,
        note=triangle.sentence,
        xlabel=f"distance from {origin.value:.6g} ({origin.name})",
        names=tuple(corner.name for corner in corners),
        values=np.array([corner.value - origin.value for corner in corners]),
        uncertainties=np.array([corner.uncertainty for corner in corners]),
        styles=tuple(used[: len(corners)]),
    )
