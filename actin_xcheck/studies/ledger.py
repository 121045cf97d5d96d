"""The term ledger: each term of (3.2) that a scene has, what it costs, and the error made by dropping it.

The runs with and without a term are made by one accurate method whose own error is measured with them, by a
finer run: what a term changes is known no better than that.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import h5py
import numpy as np

from actin_xcheck.core.contract import Problem, Solver, State
from actin_xcheck.core.model import Array
from actin_xcheck.core.outcome import Outcome
from actin_xcheck.runs.march import Tolerance, integrate
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.run import solver_for
from actin_xcheck.runs.store import state
from actin_xcheck.runs.workers import Report, work_off
from actin_xcheck.scene.resolve import mesh_of, resolve, turn_matrix
from actin_xcheck.scene.scene import Scene
from actin_xcheck.scene.terms import TERMS, Term

METHOD, REFINE, RTOL = METHODS["fem-p3-imex4"], 2, 1e-6
"""Fig. 14 in a second, its area to 5e-6; the error is measured by a run on the next finer mesh."""

TIMED = 7
"""Steps whose time is taken, after one to warm up."""

MEASURES = {
    "area": "the area",
    "total_actin": "total actin",
    "probe_a": "a at the probes",
    "probe_x": "positions of the probes",
}
"""What is compared over the output times: relative for the first two, absolute at probes."""


@dataclass(frozen=True)
class Entry:
    """What a term of a scene is worth.

    Attributes
    ----------
    term, symbol, entry : of the `Term`.
    area, total_actin, probe_a, probe_x : the largest change by dropping it, see `MEASURES`; nan where the run
        without it reached no output time, and 0 where there are no probes.
    resolved : the error of the runs themselves in the worst of these.
    accuracy : what was asked for.
    steps, step_seconds : of the scene as it is; processor time, median of steps from the initial state.
    steps_without, step_seconds_without : of the run without the term, timed step by step beside the whole
        scene's; nan where none was needed.
    ending : how the run without it ended early; empty where it did not.
    sentence : what that means.
    """

    term: str
    symbol: str
    entry: str
    area: float
    total_actin: float
    probe_a: float
    probe_x: float
    resolved: float
    accuracy: float
    steps: float
    step_seconds: float
    steps_without: float
    step_seconds_without: float
    ending: str
    sentence: str

    @property
    def largest(self) -> float:
        """The largest of the four changes."""
        return max(getattr(self, name) for name in MEASURES)

    @property
    def cost(self) -> float:
        """Seconds the term adds to a run, by its steps and the median time of one; may be negative."""
        return self.steps * self.step_seconds - self.steps_without * self.step_seconds_without


def ledger(scene: Scene, accuracy: float, report: Report) -> tuple[Entry, ...]:
    """What each term of a scene costs and what dropping it would change.

    Parameters
    ----------
    scene : what is run; where it breaks down, changes are known up to there.
    accuracy : the largest error that matters, relative for area and total actin, absolute at probes.
    report : told of progress; runs are made on all cores.
    """
    problem = resolve(scene)
    there = [i for i, term in enumerate(TERMS) if term.there(problem)]
    tested = [i for i in there if not TERMS[i].idle(problem)]
    tasks = [(scene, None, 1), (scene, None, 0), *((scene, i, 0) for i in tested)]
    runs = work_off(_run, tasks, report, _named)
    finer, whole, without = runs[0], runs[1], dict(zip(tested, runs[2:], strict=True))
    resolved = max(_changes(finer.rows, whole.rows).values())
    return tuple(_entry(TERMS[i], problem, whole, without.get(i), resolved, accuracy) for i in there)


def _named(task: tuple[Scene, int | None, int]) -> str:
    """What a run is called."""
    scene, dropped, finer = task
    part = "whole" if dropped is None else f"without {TERMS[dropped].name}"
    return f"{scene.name}, {part}{', finer' if finer else ''}"


Row = dict[str, Array]


@dataclass(frozen=True, eq=False)
class _Trace:
    """What is kept of a run.

    Attributes
    ----------
    rows : its measures at output times.
    steps : how many it took.
    seconds : of a step of the whole scene, and of one of this run.
    outcome : how it ended.
    """

    rows: list[Row]
    steps: int
    seconds: tuple[float, float]
    outcome: Outcome


class _Watch:
    """Observes a run: measures at output times, and counts steps."""

    def __init__(self, solver: Solver, probes: Array, told: Callable[[float], None]) -> None:
        self.solver, self.probes, self.told = solver, solver.probes(probes), told
        self.rows: list[Row] = []
        self.steps = -1  # the initial state is none

    def record(self, dt: float, state: State) -> None:
        """Count."""
        self.steps += 1
        self.told(state.t)

    def frame(self, state: State) -> None:
        """Measure."""
        measured, (a, x) = self.solver.measure(state), self.probes(state)
        integrals = {name: np.array(getattr(measured, name)) for name in ("area", "total_actin")}
        self.rows.append(integrals | {"probe_a": a, "probe_x": x, "time": np.array(state.t)})


def _run(task: tuple[Scene, int | None, int], report: Report) -> _Trace:
    """Run a scene without a term (None: with all) on a mesh so many times finer."""
    scene, without, finer = task
    problem = resolve(scene)
    mesh, label = mesh_of(scene, REFINE + finer), scene.name
    solvers = [solver_for(problem, METHOD, mesh)]
    if without is not None:
        label = f"{label} without {TERMS[without].name}"
        solvers.append(solver_for(TERMS[without].drop(problem), METHOD, mesh))
    solver = solvers[-1]
    points = turn_matrix(scene) @ np.array(scene.probes.points, dtype=float).reshape(-1, 2).T
    end = scene.output_times[-1]
    watch = _Watch(solver, points, lambda t: report(label, round(1000 * t / end), 1000))
    tolerance = Tolerance(RTOL / 10**finer, METHOD.order_dt)
    outcome = integrate(solver, end, scene.output_times, watch, tolerance)
    seconds = _step_seconds(solvers, end / 100)
    return _Trace(watch.rows, watch.steps, (seconds[0], seconds[-1]), outcome)


def _step_seconds(solvers: Sequence[Solver], dt: float) -> list[float]:
    """Median processor time of a step from the initial state, the solvers taking turns."""
    states = [solver.init() for solver in solvers]
    spent = np.empty((TIMED + 1, len(solvers)))
    for row in spent:
        for i, solver in enumerate(solvers):
            began = time.process_time()
            solver.step(states[i], dt)
            row[i] = time.process_time() - began
    return [float(median) for median in np.median(spent[1:], axis=0)]


def _changes(with_it: Sequence[Row], without: Sequence[Row]) -> dict[str, float]:
    """Largest changes over the output times both reached, by measure; nan where there is none."""
    pairs = [(one, other) for one in with_it for other in without if 0 < one["time"] == other["time"]]
    if not pairs:
        return dict.fromkeys(MEASURES, np.nan)
    relative = {"area", "total_actin"}
    return {
        name: max(
            float(np.max(np.abs(one[name] - other[name]) / (one[name] if name in relative else 1), initial=0))
            for one, other in pairs
        )
        for name in MEASURES
    }


def _entry(
    term: Term, problem: Problem, whole: _Trace, without: _Trace | None, resolved: float, accuracy: float
) -> Entry:
    """The entry of a term from the runs with and without it; without a run it is idle."""
    if without is None:
        changes, ending = dict.fromkeys(MEASURES, 0.0), ""
        sentence = f"exact: without {term.name} nothing changes here ({term.idle(problem)})"
    else:
        changes = _changes(whole.rows, without.rows)
        early = not without.outcome.ok and whole.outcome.ok
        ending = str(without.outcome.ending) if early else ""
        sentence = in_words(term.name, changes, ending, resolved, accuracy)
    trace, idle = (whole, True) if without is None else (without, False)
    return Entry(
        term.name,
        term.symbol,
        term.entry,
        **changes,
        resolved=resolved,
        accuracy=accuracy,
        steps=float(whole.steps),
        step_seconds=trace.seconds[0],
        steps_without=np.nan if idle else float(trace.steps),
        step_seconds_without=np.nan if idle else trace.seconds[1],
        ending=ending,
        sentence=sentence,
    )


def in_words(name: str, changes: dict[str, float], ending: str, resolved: float, accuracy: float) -> str:
    """Whether a scene needs a term, given what dropping it changes and what the runs themselves are worth."""
    if ending:
        return f"without {name} the run ends early ({ending.replace('_', ' ')}): the scene needs it"
    if np.isnan(largest := max(changes.values())):
        return f"no output time was reached with and without {name}: not known"
    worst = max(changes, key=lambda measure: changes[measure])
    dropped = f"dropping {name} changes {MEASURES[worst]} by {largest:.1e}"
    if largest > max(accuracy, resolved):
        return f"{dropped}: more than the {accuracy:g} asked for, the scene needs it"
    if resolved > accuracy:
        return f"{dropped}, and the runs are exact to {resolved:.1e} only: not decided at {accuracy:g}"
    return f"{dropped}: less than the {accuracy:g} asked for, the scene does not need it"


# files


def write(group: h5py.Group, entries: Sequence[Entry]) -> None:
    """Write a ledger into an open group: a group `<number>` an entry."""
    for number, entry in enumerate(entries):
        state(group.create_group(f"{number:02d}"), asdict(entry))


def read(group: h5py.Group) -> tuple[Entry, ...]:
    """Return the ledger in a group; KeyError where it is not whole."""
    return tuple(_stored(stored.attrs) for stored in group.values())


def _stored(said: h5py.AttributeManager) -> Entry:
    values: dict[str, Any] = {field.name: said[field.name] for field in fields(Entry)}
    numbers = {name: float(value) for name, value in values.items() if not isinstance(value, str)}
    return Entry(**values | numbers)
