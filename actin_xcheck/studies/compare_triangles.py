"""Triangles as small pictures: FEM, FV and theory on one line, each with its uncertainty."""

from collections.abc import Mapping
from dataclasses import dataclass

from matplotlib.figure import Figure

from actin_xcheck.report.svg import INK, Style, styled, svg
from actin_xcheck.verdicts.triangulate import Triangle

_THEORY = Style(INK, 1.5)


@dataclass(frozen=True)
class TrianglePicture:
    """A triangle and its picture, which is empty where there was nothing to compare."""

    triangle: Triangle
    svg: str


def triangle_picture(triangle: Triangle, styles: Mapping[str, Style], prefix: str) -> TrianglePicture:
    """Draw a triangle as distances from theory, or from FEM where there is none.

    Parameters
    ----------
    triangle : what to draw.
    styles : of the methods, by name.
    prefix : keeps ids apart from those of other drawings on the page.
    """
    corners = triangle.corners
    if not corners:
        return TrianglePicture(triangle, "")
    origin = corners[2 if len(corners) > 2 else 0]
    with styled():
        height = 0.62 + 0.22 * len(corners)
        figure = Figure(figsize=(4.2, height))
        axes = figure.add_subplot(ylim=(0.6 - len(corners), 0.6))
        axes.set_xlabel(f"distance from {origin.value:.6g} ({origin.name})")
        used = [styles.get(name, _THEORY) for name in triangle.methods]
        for row, (corner, style) in enumerate(zip(corners, [*used, _THEORY], strict=False)):
            place = corner.value - origin.value
            axes.errorbar(
                place, -row, xerr=corner.uncertainty, fmt="o", color=style.colour, markersize=4, capsize=3
            )
        axes.set_yticks([-row for row in range(len(corners))], [corner.name for corner in corners])
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", visible=False)
        return TrianglePicture(triangle, svg(figure, f"{triangle.words}, by both codes", prefix))
