"""What another code computed of a scene, held against the truth: errors, orders, lag, and what is claimed.

The truth is what is known without a run (a reference, an exact solution), else a run to an accuracy: first to
`FIRST`, and where the others are better than that, to a hundredth of their apparent error.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Chapter, Line, Plot
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.judge.theirs import INTEGRALS, SAME_TIME, Theirs
from actin_xcheck.studies.judge.truths import Truth, TruthAsked, known_alone, true_value, truth
from actin_xcheck.studies.study import Report, Study, Table, Task, counted
from actin_xcheck.theory.growth import fit_growth
from actin_xcheck.verdicts.final import FinalValue, in_a_sentence, percent
from actin_xcheck.verdicts.known import ROUND_OFF, known
from actin_xcheck.verdicts.orders import local_orders
from actin_xcheck.verdicts.triangulate import Corner

FIRST, FINEST = 1e-4, 1e-8
"""Accuracies of the first truth and of the last that is asked for."""

SHARE = 0.01
"""Of an apparent error, the error that a truth may have."""

RIGHT = 0.15
"""How far an observed order may be from the one that is claimed, as elsewhere."""

DENSE = 10
"""Rows of a series from which lag, amplitude, balance and growth are read off."""

TRUTH_SECONDS = 10.0


@dataclass(frozen=True)
class JudgedValue:
    """A number of one file at the end beside the truth.

    Attributes
    ----------
    file, h, dt : whose; nan where that is not said.
    quantity, time : what, and when.
    theirs, truth, known_to : their number, the true one and its uncertainty.
    error : the largest over the output times, relative for integrals.
    order : by which the error fell from the file before; nan where it is larger than the true number, which
        then is nothing, as by symmetry, or smaller than what that is known to.
    lag, amplitude : of a series, by how much it is late, and times what it departs from its start; nan where
        nothing tells.
    """

    file: str
    h: float
    dt: float
    quantity: str
    time: float
    theirs: float
    truth: float
    known_to: float
    error: float
    order: float
    lag: float
    amplitude: float


def judge(scene: Scene, files: Sequence[Theirs], within: float, order: float, typed: str) -> Study:
    """Hold files, the coarsest first, against the truth.

    Parameters
    ----------
    within : the error up to which a claim holds.
    order : that the files' code declares; nan without.
    typed : the command.
    """
    best = files[-1]
    (found,) = yield [_truth(scene, FIRST)]
    if (accuracy := max(SHARE * _apparent(scene, best, found), FINEST)) < FIRST:
        (found,) = yield [_truth(scene, float(f"1e{math.floor(math.log10(accuracy))}"))]
    rows = _rows(scene, files, found)
    finals = _finals(scene, best, found, rows)
    claims = tuple(_claims(scene, files, found, rows, within, order, typed))
    return Report(
        counted(claims, "claims hold"),
        f"{scene.name} by another code, held against {_origin(scene, best)}.",
        {"answers": Table("Answers", rows, _ANSWERS)},
        claims,
        (in_a_sentence(finals), *_orders_said(rows), *(_REUSED for _ in range(found.reused))),
        (
            Chapter(
                "errors",
                "Errors",
                "Theirs less the truth, at the output times.",
                tuple(_plots(scene, files, found)),
            ),
        ),
        values=finals,
    )


def _apparent(scene: Scene, best: Theirs, run: Truth) -> float:
    """The middle one of the errors that only a run tells, those aside that are round-off; inf without any."""
    end = scene.output_times[-1]
    errors = [_error(scene, best, name, run) for name in best.columns if not known_alone(scene, name, end)]
    return float(np.median([one for one in errors if one > ROUND_OFF] or [np.inf]))


def _truth(scene: Scene, accuracy: float) -> Task:
    asked = TruthAsked(scene.text, scene.origin, accuracy)
    return Task(truth, asked, TRUTH_SECONDS, (asked.file,))


_ANSWERS = (
    "At the end, beside the truth and its uncertainty; errors are the largest over output times, relative "
    "for area and total actin. Lag and amplitude are those of the whole series, where it has rows enough."
)


_REUSED = "the run that they are held against was not made again: this code made it for a judgement before"


def _origin(scene: Scene, best: Theirs) -> str:
    origins = (known_alone(scene, name, scene.output_times[-1]) for name in best.columns)
    return " and ".join(dict.fromkeys([*(f"the {one[2]}" for one in origins if one), "a run of ours"]))


def _differences(scene: Scene, one: Theirs, name: str, run: Truth) -> tuple[Array, Array]:
    """Output times (n,) and theirs less the truth there (n,), relative for integrals."""
    end, times, found = scene.output_times[-1], [], []
    for t in scene.output_times:
        true, row = true_value(scene, name, t, run), one.at(t)
        if true and abs(one.times[row] - t) <= SAME_TIME * end:
            times.append(t)
            found.append((one.columns[name][row] - true[0]) / (abs(true[0]) if name in INTEGRALS else 1.0))
    return np.array(times), np.array(found)


def _error(scene: Scene, one: Theirs, name: str, run: Truth) -> float:
    """The largest over the output times; nan without any."""
    found = np.abs(_differences(scene, one, name, run)[1])
    return float(found.max()) if len(found) else nan


def _rows(scene: Scene, files: Sequence[Theirs], run: Truth) -> list[JudgedValue]:
    rows, end = [], scene.output_times[-1]
    for name in files[-1].columns:
        having = [one for one in files if name in one.columns]
        errors = [_error(scene, one, name, run) for one in having]
        steps = [one.step for one in having]
        told = len(having) > 1 and np.isfinite(steps).all()
        orders = [nan, *(local_orders(steps, errors).tolist() if told else [nan] * (len(having) - 1))]
        for one, error, order in zip(having, errors, orders, strict=True):
            true, row = true_value(scene, name, end, run), one.at(end)
            reached = abs(one.times[row] - end) <= SAME_TIME * end
            lag, amplitude = _lag(one, name, run)
            if not (
                true and abs(true[0]) > error > true[1]
            ):  # else it is an error of nothing, or of the truth
                order = nan
            rows.append(
                JudgedValue(
                    file=one.name,
                    h=one.h,
                    dt=one.dt,
                    quantity=name,
                    time=end,
                    theirs=one.columns[name][row] if reached else nan,
                    truth=true[0] if true else nan,
                    known_to=true[1] if true else nan,
                    error=error,
                    order=order,
                    lag=lag,
                    amplitude=amplitude,
                )
            )
    return rows


def _lag(one: Theirs, name: str, run: Truth) -> tuple[float, float]:
    """How late a series is, and times what it departs from its start: to first order, by least squares."""
    t, y = np.array(one.times), np.array(one.columns[name])
    times = np.array(run.times)
    inside = (t >= times[0]) & (t <= times[-1])
    if inside.sum() < DENSE or name not in run.columns:
        return nan, nan
    from scipy.interpolate import CubicSpline

    true = CubicSpline(times, run.columns[name])
    t, y = t[inside], y[inside]
    parts = np.stack([-true(t, 1), true(t) - true(times[0])], axis=1)
    sizes = np.linalg.norm(parts, axis=0)
    if not (sizes > 1e-9 * np.linalg.norm(true(t))).all() or np.linalg.cond(parts / sizes) > 1e3:
        return nan, nan  # constant, or an exponential, whose delay is a factor
    lag, more = np.linalg.lstsq(parts, y - true(t), rcond=None)[0]
    return float(lag / (1 + more)), float(1 + more)  # what is late is what it is times


def _finals(scene: Scene, best: Theirs, run: Truth, rows: Sequence[JudgedValue]) -> list[FinalValue]:
    """The answers of the finest file in the words of all answers."""
    found = []
    for row in (one for one in rows if one.file == best.name):
        if true := true_value(scene, row.quantity, row.time, run):
            change = [other.theirs for other in rows if other.quantity == row.quantity][-2:]
            spread = abs(change[1] - change[0]) if len(change) > 1 and np.isfinite(row.order) else nan
            mine = Corner(best.name, row.theirs, spread, "the change from the file before", row.order)
            words = f"{row.quantity.replace('_', ' ')} at t = {row.time:.4g}"
            corners = mine, Corner(true[2], true[0], true[1], true[2])
            found.append(FinalValue(scene.name, (best.name,), row.quantity, words, corners))
    return found


def _orders_said(rows: Sequence[JudgedValue]) -> Iterator[str]:
    for row in rows:
        if np.isfinite(row.order):
            words = row.quantity.replace("_", " ")
            yield f"{words}: the error falls with order {row.order:.2f} to {row.file}"


def _claims(
    scene: Scene,
    files: Sequence[Theirs],
    run: Truth,
    rows: Sequence[JudgedValue],
    within: float,
    order: float,
    typed: str,
) -> Iterator[Claim]:
    """That errors, the balance, growth and orders are as they should be."""
    best = files[-1]

    def claim(kind: ClaimKind, quantity: str, statement: str, value: float, bound: float, note: str) -> Claim:
        return Claim(
            kind=kind,
            quantity=quantity,
            scene=scene.name,
            methods=(best.name,),
            statement=statement,
            value=value,
            bound=bound,
            command=typed,
            path="/tables/answers",
            note=note,
        )

    for row in (one for one in rows if one.file == best.name):
        relative = "relative error" if row.quantity in INTEGRALS else "error"
        words = f"{row.quantity.replace('_', ' ')} is true to {percent(within)} at all output times"
        note = f"the truth is known to {row.known_to:.1e}"
        quantity, statement = row.quantity, f"{words} ({relative}, largest)"
        yield claim(ClaimKind.REFERENCE, quantity, statement, row.error, within, note)
        if np.isfinite(row.order):
            words = f"{quantity.replace('_', ' ')}: its error falls with order {order:g} ({row.order:.2f})"
            value, bound, note = abs(row.order - order), RIGHT, "from the two finest files"
            if np.isnan(order):
                words, value, bound = f"{quantity.replace('_', ' ')}: the order of its error", row.order, nan
                note = "no order is declared: --order"
            yield claim(
                ClaimKind.ORDER_DT if np.isnan(best.h) else ClaimKind.ORDER_H,
                quantity,
                words,
                value,
                bound,
                note,
            )
    yield from (claim(*one) for one in _of_series(scene, best, within))


def _of_series(
    scene: Scene, best: Theirs, within: float
) -> Iterator[tuple[ClaimKind, str, str, float, float, str]]:
    """What is claimed of a whole series: balance and growth."""
    if len(best.times) < DENSE:
        return
    if {*INTEGRALS} <= best.columns.keys() and not scene.source_term:
        gained = "obeys its balance, d/dt = area less total actin"
        made = gained if scene.physics.reaction_rate() else "is conserved"
        note = "relative, by the trapezoidal rule over the rows"
        value = _balance(scene, best)
        yield ClaimKind.CONSERVATION, "total_actin", f"total actin {made}", value, within, note
    if scene.expect.growth_rate and "mode_amplitude" in best.columns:
        yield ClaimKind.GROWTH_RATE, "growth_rate", *_growth(scene, best), within, "relative"


def _balance(scene: Scene, one: Theirs) -> float:
    """The largest relative departure of total actin from what polymerisation makes of it."""
    t, area, actin = (
        np.array(values) for values in (one.times, one.columns["area"], one.columns["total_actin"])
    )
    made = np.zeros_like(t)
    if scene.model.reaction:
        rate = scene.physics.reaction_rate() * (area - actin)
        made[1:] = np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t))
    return float(np.abs((actin - actin[0] - made) / actin).max())


def _growth(scene: Scene, one: Theirs) -> tuple[str, float]:
    """What is claimed of the mode's growth, and by how much it is off, relative; nan where nothing fits."""
    expected, true = scene.expect.growth_rate, known(scene, "growth_rate", 0.0)
    assert expected is not None
    assert true is not None
    rate, single = float(true.values[0]), scene.initial.eigenmode and len(true.values) == 1
    words = f"mode ({expected.m}, {expected.n}) grows at the predicted rate {rate:.4f}"
    try:
        amplitude = np.array(one.columns["mode_amplitude"])
        fit = fit_growth(np.array(one.times), amplitude, expected.window, 1 if single else 2)
    except ValueError:
        return words, nan
    return words, abs(fit.rate.real - rate) / (abs(rate) or 1.0)


def _plots(scene: Scene, files: Sequence[Theirs], run: Truth) -> Iterator[Plot]:
    """Errors over time, a chart a column, and at the end over the step of each file."""
    for name in files[-1].columns:
        lines = []
        for one in files:
            if name in one.columns:
                t, off = _differences(scene, one, name, run)
                lines.append(Line(one.name, t, off, points=True))
        what = "relative" if name in INTEGRALS else ""
        yield Plot(name, name.replace("_", " "), what, "t", tuple(lines), levels=(("", 0.0),))
    steps = np.array([one.step for one in files])
    if len(files) > 1 and np.isfinite(steps).all():
        lines = []
        for name in files[-1].columns:
            errors = [_error(scene, one, name, run) if name in one.columns else nan for one in files]
            lines.append(Line(name.replace("_", " "), steps, np.array(errors)))
        label = "dt" if np.isnan(files[-1].h) else "h"
        yield Plot(
            "orders", f"Errors over {label}", "largest over the output times", label, tuple(lines), log=True
        )
