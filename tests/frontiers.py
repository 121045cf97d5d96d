"""A frontier small enough for a test, and what its tests share."""

from actin_xcheck.runs.method import METHODS
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.frontier import frontier
from actin_xcheck.studies.frontier.answers import Answer
from actin_xcheck.studies.frontier.planes import Axis, Bisection, Plane
from tests.lab import FEM

FIG14 = load_scene("fig14-four-fronts")
METHODS_SHOWN = (METHODS[FEM], METHODS["fem-p2-imex3"])

TINY = Plane(
    Axis("psi", (40.0, 160.0, 640.0), 2, log=True),
    Axis("dt", (0.008, 0.032), 1, log=True),
)
"""A few places: psi from where all is well to where first order is wrong."""


def small(methods=METHODS_SHOWN):
    """The study of a few places on coarse meshes, held against quick truths."""
    return frontier(FIG14, [(method, TINY) for method in methods], 3, (1, 4), (0, 2))


def searched(classify, columns=65, rows=65, across=8, up=8):
    search, rounds = Bisection(columns, rows, across, up), 0
    while wanted := search.wanted():
        search.tell({node: classify(node) for node in wanted})
        rounds += 1
    return search, rounds


def answer(ending="completed", t=1.0, area=3.0, a=(1.0, 1.0)):
    return Answer(ending, f"{ending} there", t, area, 3.0, a, (0.0, 0.0, 1.0, 0.0), 0.1)
