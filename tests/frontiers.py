"""A frontier small enough for a test, and what its tests share."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from actin_xcheck.runs.accuracy import LEVELS
from actin_xcheck.runs.executor import Lost
from actin_xcheck.runs.method import METHODS
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.frontier import answers
from actin_xcheck.studies.frontier import examine as examination
from actin_xcheck.studies.frontier import planes as planning
from actin_xcheck.studies.frontier.answers import Answer
from actin_xcheck.studies.frontier.bisection import Bisection
from actin_xcheck.studies.frontier.planes import Axis, Plane
from tests.lab import FEM

FIG14 = load_scene("fig14-four-fronts")
VERSIONS = {"python": "3", "commit": "0123"}
METHODS_SHOWN = (METHODS[FEM], METHODS["fem-p2-imex3"])


def searched(classify, columns=65, rows=65, across=8, up=8):
    search, rounds = Bisection(columns, rows, across, up), 0
    while wanted := search.wanted():
        search.tell({node: classify(node) for node in wanted})
        rounds += 1
    return search, rounds


def answer(ending="completed", t=1.0, area=3.0, a=(1.0, 1.0)):
    return Answer(ending, f"{ending} there", t, area, 3.0, a, (0.0, 0.0, 1.0, 0.0), 0.1)


def tiny(name, method):
    """A few places: psi from where all is well to where first order is wrong."""
    return Plane(
        Axis("psi", (40.0, 160.0, 640.0), 2, log=True),
        Axis("dt", (0.008, 0.032), 1, log=True),
    )


def shrink(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarse meshes, a tiny plane, a code that knows its commit."""
    monkeypatch.setattr(examination, "plane_of", tiny)
    monkeypatch.setattr(planning, "REFINE", 3)
    monkeypatch.setattr(examination, "LADDER", (1, 4))
    monkeypatch.setattr(examination, "provenance", lambda: VERSIONS)


def in_process(monkeypatch: pytest.MonkeyPatch, lost: Callable = lambda what: False) -> list:
    """No processes and quick truths; returns what is worked off.  Some of it may be lost."""
    done = []

    class Here:
        def results(self, work, tasks):
            for number, task in enumerate(tasks):
                done.append(task.what)
                yield number, Lost("the process ended") if lost(task.what) else work(task)

    @contextmanager
    def executor(jobs: int, scheduler: str | None) -> Iterator[Here]:
        yield Here()

    monkeypatch.setattr(answers, "TRUTH_LEVELS", LEVELS[:2])
    monkeypatch.setattr(examination, "executor", executor)
    return done
