"""The term ledger: each term of (3.2) that a scene has, what it costs, and the error made by dropping it.

The runs with and without a term are made by one accurate method whose own error is measured with them, by a
finer run: what a term changes is known no better than that.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Problem, Solver
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Sheet
from actin_xcheck.runs.march import March
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics, chosen_steps, seconds_of
from actin_xcheck.runs.records import gathered
from actin_xcheck.runs.run import solver_for
from actin_xcheck.scene.resolve import TERMS, Term, mesh_of, resolve
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.chart.measure import Trace, outputs_of, trace_of
from actin_xcheck.studies.study import Task

METHOD, REFINE, RTOL = METHODS["fem-p3-imex4"], 2, 1e-6
"""Fig. 14 in a second, its area to 5e-6; the error is measured by a run on the next finer mesh."""

TIMED = 7
"""Steps whose time is taken, after one to warm up."""

NOTICEABLE = 0.1
"""Of a run's time: what a term must cost to be told from the scatter of clocks."""

_OF = {term.name: term for term in TERMS}

MEASURES = {
    "area": "the area",
    "total_actin": "total actin",
    "probe_a": "a at the probes",
    "probe_x": "positions of the probes",
}
"""What is compared over the output times: relative for the first two, absolute at probes."""


@dataclass(frozen=True)
class LedgerEntry:
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


@dataclass(frozen=True)
class LedgerRun:
    """A run that is asked for: a scene without a term (by name, or with all of them), and how much finer."""

    scene: Scene
    without: str = ""
    finer: int = 0
    refine: int = REFINE

    def __str__(self) -> str:
        part = f"without {self.without}" if self.without else "whole"
        return f"{self.scene.name}, {part}{', finer' if self.finer else ''}"


@dataclass(frozen=True, eq=False)
class LedgerTrace(Trace):
    """What is kept of a run: how many steps it took, and the seconds of one of the whole scene's and of its
    own, (2,).
    """

    steps: int
    seconds: Array


def ledger_tasks(scene: Scene, refine: int = REFINE) -> list[Task]:
    """What is run for a scene's ledger: finer, whole, and without each term that does something."""
    problem = resolve(scene)
    tested = [term.name for term in TERMS if term.there(problem) and not term.idle(problem)]
    runs = [LedgerRun(scene, finer=1, refine=refine), LedgerRun(scene, refine=refine)]
    runs += [LedgerRun(scene, name, refine=refine) for name in tested]
    return [
        Task(traced, one, 2 * seconds_of(METHOD, refine + one.finer, chosen_steps(METHOD, RTOL)))
        for one in runs
    ]


def ledger(scene: Scene, accuracy: float, traces: Sequence[LedgerTrace]) -> tuple[LedgerEntry, ...]:
    """What each term of a scene costs and what dropping it would change.

    Parameters
    ----------
    scene : what was run; where it breaks down, changes are known up to there.
    accuracy : the largest error that matters, relative for area and total actin, absolute at probes.
    traces : answers to `ledger_tasks`.
    """
    problem = resolve(scene)
    there = [term for term in TERMS if term.there(problem)]
    tested = [term.name for term in there if not term.idle(problem)]
    finer, whole, *others = traces
    without = dict(zip(tested, others, strict=True))
    resolved = max(_changes(finer, whole).values())
    return tuple(_entry(term, problem, whole, without.get(term.name), resolved, accuracy) for term in there)


def traced(asked: LedgerRun, folder: Path) -> LedgerTrace:
    """Run a scene without a term on a mesh so many times finer."""
    scene, finer = asked.scene, asked.finer
    problem = resolve(scene)
    mesh = mesh_of(scene, asked.refine + finer)
    solvers = [solver_for(problem, METHOD, mesh)]
    if asked.without:
        solvers.append(solver_for(_OF[asked.without].drop(problem), METHOD, mesh))
    solver = solvers[-1]
    end = scene.output_times[-1]
    numerics = Numerics(METHOD, asked.refine + finer, end, RTOL / 10**finer)
    march = March(solver, numerics, scene.output_times)
    said = trace_of(scene, solver, march, outputs_of(march))
    seconds = _step_seconds(solvers, end / 100)
    return gathered(LedgerTrace, said, steps=march.steps, seconds=np.array([seconds[0], seconds[-1]]))


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


def _changes(one: Trace, other: Trace) -> dict[str, float]:
    """Largest changes over the output times both reached, by measure; nan where there is none."""
    pairs = [(i, j) for i, t in enumerate(one.times) for j, other_t in enumerate(other.times) if t == other_t]
    if not pairs:
        return dict.fromkeys(MEASURES, np.nan)
    relative = {"area", "total_actin"}
    changes = {}
    for name in MEASURES:
        ours, theirs = getattr(one, name), getattr(other, name)
        changes[name] = max(
            float(np.max(np.abs(ours[i] - theirs[j]) / (ours[i] if name in relative else 1), initial=0))
            for i, j in pairs
        )
    return changes


def _entry(
    term: Term,
    problem: Problem,
    whole: LedgerTrace,
    without: LedgerTrace | None,
    resolved: float,
    accuracy: float,
) -> LedgerEntry:
    """The entry of a term from the runs with and without it; without a run it is idle."""
    if without is None:
        changes, ending = dict.fromkeys(MEASURES, 0.0), ""
        sentence = f"exact: without {term.name} nothing changes here ({term.idle(problem)})"
    else:
        changes = _changes(whole, without)
        early = without.ending != Ending.COMPLETED and whole.ending == Ending.COMPLETED
        ending = without.ending if early else ""
        sentence = in_words(term.name, changes, ending, resolved, accuracy)
    trace, idle = (whole, True) if without is None else (without, False)
    return LedgerEntry(
        term=term.name,
        symbol=term.symbol,
        entry=term.entry,
        **changes,
        resolved=resolved,
        accuracy=accuracy,
        steps=float(whole.steps),
        step_seconds=float(trace.seconds[0]),
        steps_without=np.nan if idle else float(trace.steps),
        step_seconds_without=np.nan if idle else float(trace.seconds[1]),
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


def ledger_sheet(entries: Sequence[LedgerEntry]) -> Sheet:
    """A ledger, of one entry at least, in words."""
    first = entries[0]
    note = (
        "Largest changes over the output times, relative for area and total actin, absolute at probes; the "
        f"runs themselves are exact to {first.resolved:.1e}. With all terms a run takes {first.steps:.0f} "
        f"steps of {1e3 * first.step_seconds:.3g} ms (median, processor time)."
    )
    head = ("Term of (3.2)", "", "Dropped by", *MEASURES.values(), "Cost", "Needed?")
    rows = [(one.term, one.symbol, one.entry, *_changed(one), _cost(one), one.sentence) for one in entries]
    return Sheet("terms", "What the scene needs: its terms, one dropped at a time", note, (head, *rows))


def _changed(entry: LedgerEntry) -> list[str]:
    return [f"{getattr(entry, name):.1e}" if entry.largest else "0" for name in MEASURES]


def _cost(entry: LedgerEntry) -> str:
    """What the term costs, and the step without it."""
    if entry.cost != entry.cost:  # nan: it was not dropped
        return "not measured"
    share = entry.cost / (entry.steps * entry.step_seconds)
    said = f"{share:.0%} of the run" if abs(share) > NOTICEABLE else "nothing noticeable"
    return f"{said}; without it {entry.steps_without:.0f} steps of {1e3 * entry.step_seconds_without:.3g} ms"
