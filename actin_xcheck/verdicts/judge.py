"""Claims about the stored runs of one scene: each compares numbers from files with a bound.

Single-mesh bounds are C_h h^2 + C_dt dt with slope constants stored in the scene's `[expect]`; orders
themselves are the business of convergence studies.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.runs.accuracy import change
from actin_xcheck.runs.fidelity import Fidelity
from actin_xcheck.runs.growth import energy_growth
from actin_xcheck.runs.method import PERTURBATIONS, load
from actin_xcheck.runs.numerics import CHOSEN, command
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.scene import Scene
from actin_xcheck.scene.tables import Bound
from actin_xcheck.theory.dispersion import rate_in_words
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.theory.growth import fit_growth
from actin_xcheck.verdicts.known import (
    cell_difference,
    known,
    l2_error,
    reference_errors,
)
from actin_xcheck.verdicts.triangulate import Levels, estimate, reaches

CONSERVATION_BOUND = 1e-12

LINEAR_BOUND = 1e-8
"""Of the rate of one linear mode, relative: round-off of 1e-16 over an amplitude of 1e-6, and a fit of it."""

TOLERANCES = 10.0
"""The errors of all steps, in tolerances of one: they add up, and grow with the cell."""

SAME = 1e-10
"""Relative difference of two runs that differ in round-off."""


def judge(scene: Scene, runs: Mapping[str, Run]) -> list[Claim]:
    """Return every claim that can be made about a scene's runs, given by method name."""
    claims = [claim for name, run in runs.items() for claim in _Judge(scene, name, run).claims()]
    for (one, first), (other, second) in combinations(runs.items(), 2):
        if first.family != second.family and not scene.expect.ends:  # one code against the other, at the end
            claims += _agreement(scene, (one, first), (other, second))
    return claims


def keeps_tolerance(scene: Scene, method: str, run: Run, tighter: Run) -> Claim:
    """Whether a run that chose its steps is as accurate as it was asked to be.

    Parameters
    ----------
    scene, method : of both runs, on one mesh.
    run, tighter : by a tolerance, and by one so much smaller that its own error does not count.
    """
    rtol = float(run.attributes["rtol"])
    return _difference(
        ClaimKind.TOLERANCE,
        scene,
        method,
        (run, tighter),
        f"steps chosen by the tolerance {rtol:g} keep it (largest change of area, total actin and probes "
        f"with a tolerance {rtol / tighter.attributes['rtol']:.0f} times smaller)",
        TOLERANCES * rtol,
        f"bound = {TOLERANCES:g} tolerances",
    )


def same_as_whole(scene: Scene, method: str, part: Run, whole: Run) -> Claim:
    """Whether a sector of the cell gives what the whole cell gives, on the same mesh with the same steps."""
    statement = (
        "a sector and the whole cell are the same (largest difference of area, total actin and probes)"
    )
    note = "one differs from the other in round-off"
    return _difference(ClaimKind.REDUCTION, scene, method, (part, whole), statement, SAME, note)


def _difference(
    kind: ClaimKind,
    scene: Scene,
    method: str,
    runs: tuple[Run, Run],
    statement: str,
    bound: float,
    note: str,
) -> Claim:
    """What two runs by one method must not differ by at the output times; no number where one failed."""
    completed = all(run.attributes["outcome"] == "completed" for run in runs)
    return Claim(
        kind=kind,
        scene=scene.name,
        methods=(method,),
        statement=statement,
        value=change(*runs, scene.output_times) if completed else np.nan,
        bound=bound,
        command=str(runs[0].attributes["command"]),
        path=_path(scene, method, "run/series"),
        note=note,
    )


def _path(scene: Scene, method: str, what: str) -> str:
    return f"/runs/{scene.name}/{method}/{what}"


def again(scene: Scene, *runs: Run) -> str:
    """What computes a number of these runs again: the comparison of one scene with the same numerics.

    A comparison solves the whole model on the disk; of any other run it is what made that.
    """
    first = runs[0].attributes
    if "accuracy" in first:
        names = (asked_as(run) for run in runs)
        return command("compare", scene.origin, method=tuple(names), accuracy=float(first["accuracy"]))
    whole = first.get("fidelity", Fidelity.FULL) == Fidelity.FULL
    if not whole or first.get("mesh") or first.get("remesh"):
        return str(first["command"])
    return command(
        "compare",
        scene.origin,
        method=tuple(str(run.attributes["method_name"]) for run in runs),
        refine=int(first["refine"]),
        dt=float(first["dt"]),
        rtol=max(map(_rtol, runs)) or None,  # one of them may take equal steps
    )


def _rtol(run: Run) -> float:
    """The tolerance by which a run chose its steps; 0 where they are equal."""
    return float(np.nan_to_num(run.attributes.get("rtol", np.nan)))


def asked_as(run: Run) -> str:
    """The method by which a run was asked for: one of an accuracy's levels was chosen."""
    return CHOSEN if "error_estimate" in run.attributes else str(run.attributes["method_name"])


def _bound(bound: Bound, run: Run, of_field: bool = False) -> tuple[float, str]:
    """The bound at the run's resolution and how it is made up; the accuracy where one was asked for.

    Of a whole field that is for runs that were chosen: levels of a mesh tell of single numbers.

    dt is the largest step that was taken: of a run that chose its steps, the one asked for is a limit only.
    """
    accuracy = float(run.attributes.get("accuracy", 0.0))
    if accuracy and (not of_field or "error_estimate" in run.attributes):
        return accuracy, "bound: the accuracy that was asked for"
    h, dt = 2.0 ** -int(run.attributes["refine"]), float(np.diff(run.series["time"]).max(initial=0.0))
    chosen = f", the largest step chosen by the tolerance {_rtol(run):g}" if _rtol(run) else ""
    return (
        bound.h2 * h**2 + bound.dt * dt,
        f"bound = {bound.h2:g} h^2 + {bound.dt:g} dt, h = {h:g}, dt = {dt:g}{chosen}",
    )


class _Judge:
    """The claims about one run."""

    def __init__(self, scene: Scene, method: str, run: Run) -> None:
        self.scene, self.method, self.run = scene, method, run

    def claims(self) -> Iterator[Claim]:
        """Yield completion, conservation and whatever the scene's `[expect]` names."""
        series = self.run.series
        yield self._ends()
        yield self._claim(
            kind=ClaimKind.CONSERVATION,
            quantity="total_actin",
            statement="total actin obeys the scheme's balance at every step",
            value=float(np.abs(series["balance_residual"]).max()),
            bound=CONSERVATION_BOUND,
            path="run/series/balance_residual",
            note="largest |balance_residual|, relative to total actin",
        )
        expect = self.scene.expect
        if expect.exact is not None:
            yield self._exact()
        if expect.growth_rate is not None:
            yield self._growth()
        if expect.transient is not None:
            yield self._transient()
        if expect.reference is not None:
            yield from self._reference()

    def _ends(self) -> Claim:
        """That it comes to the end of its time, or ends before as and when that is expected."""
        expected, end = self.scene.expect, self.scene.output_times[-1]
        last, said = float(self.run.series["time"][-1]), str(self.run.attributes["message"])
        statement, value, bound = f"runs to its end t = {end:g}", end - last, 0.0
        if expected.ends and expected.at and expected.within:
            statement = f"ends at t = {expected.at:g} ± {expected.within:g} as {expected.ends}"
            value = abs(last - expected.at) if self.run.attributes["outcome"] == expected.ends else np.nan
            bound = expected.within
        note = said or f"value: the time {'to where it must end' if expected.ends else 'missing at the end'}"
        return self._claim(
            kind=ClaimKind.ENDS,
            statement=statement,
            value=value,
            bound=bound,
            path="run/series/time",
            note=note,
        )

    def _claim(
        self,
        *,
        kind: ClaimKind,
        quantity: str = "",
        statement: str,
        value: float,
        bound: float,
        path: str,
        note: str,
    ) -> Claim:
        """A claim about the run, in whose file `path` is."""
        return Claim(
            kind=kind,
            quantity=quantity,
            scene=self.scene.name,
            methods=(self.method,),
            statement=statement,
            value=value,
            bound=bound,
            command=again(self.scene, self.run),
            path=_path(self.scene, self.method, path),
            note=note,
        )

    def _completed(self) -> bool:
        return bool(self.run.attributes["outcome"] == "completed")

    def _exact(self) -> Claim:
        expected = self.scene.expect.exact
        assert expected is not None
        bound, note = _bound(expected.bound, self.run, of_field=True)
        return self._claim(
            kind=ClaimKind.EXACT,
            quantity="concentration",
            statement="concentration equals the exact solution at the end (relative L2 error)",
            value=l2_error(self.scene, self.run) if self._completed() else np.nan,
            bound=bound,
            path="VTKHDF/CellData/a",
            note=note,
        )

    def _growth(self) -> Claim:
        expected = self.scene.expect.growth_rate
        assert expected is not None
        bound, note = _bound(expected.bound, self.run)
        rate, measured = growth_rate(self.scene.physics, expected.m, expected.n), complex("nan")
        # a start at rest excites both roots of (3.6), an eigenmode one, or a conjugate pair
        exponentials: Literal[1, 2] = 1 if self.scene.initial.eigenmode and not rate.imag else 2
        if exponentials == 1 and self.run.attributes.get("fidelity") == Fidelity.MODAL:
            bound, note = LINEAR_BOUND, "linear modes are carried exactly"
        if self._completed():
            time, amplitude = self.run.series["time"], self.run.series["mode_amplitude"]
            try:
                measured = fit_growth(time, amplitude, expected.window, exponentials).rate
            except ValueError as error:  # too few samples, or no such exponentials: no number, no proof
                note = f"{error}; {note}"
        return self._claim(
            kind=ClaimKind.GROWTH_RATE,
            quantity="growth_rate",
            statement=f"mode ({expected.m}, {expected.n}) grows at the predicted rate {rate_in_words(rate)} "
            f"({'relative error' if rate else 'error'}; measured {rate_in_words(measured)})",
            value=abs(measured - rate) / (abs(rate) or 1.0),
            bound=bound,
            path="run/series/mode_amplitude",
            note=note,
        )

    def _transient(self) -> Claim:
        expected, end = self.scene.expect.transient, self.scene.time.end
        assert expected is not None
        most = load(PERTURBATIONS)(self.scene.physics, expected.m).growth(end)
        bound, note = _bound(expected.bound, self.run)
        grown = energy_growth(self.scene, self.run)
        return self._claim(
            kind=ClaimKind.TRANSIENT,
            quantity="energy",
            statement=f"the perturbation grows until t = {end:g} as far as any of m = {expected.m} can, "
            f"{most:.4f} times in energy (relative error; measured {grown:.4f})",
            value=abs(grown / most - 1) if self._completed() else np.nan,
            bound=bound,
            path="VTKHDF/PointData/a",
            note=note,
        )

    def _reference(self) -> Iterator[Claim]:
        expected = self.scene.expect.reference
        assert expected is not None
        errors = reference_errors(self.scene, self.run)
        what = {
            "area": "area equals the reference value (relative error",
            "total_actin": "total actin equals the reference value (relative error",
            "probe_a": "concentration at the probes equals the reference values (error",
            "probe_x": "positions of the probes equal the reference values (error",
        }
        for quantity, words in what.items():
            judged = getattr(expected.bound, quantity)
            if judged is not None and quantity in errors:
                bound, note = _bound(judged, self.run)
                yield self._claim(
                    kind=ClaimKind.REFERENCE,
                    quantity=quantity,
                    statement=f"{words}, largest over the output times)",
                    value=errors[quantity],
                    bound=bound,
                    path=f"run/series/{quantity}",
                    note=f"{note}; {expected.origin}",
                )


def _agreement(scene: Scene, one: tuple[str, Run], other: tuple[str, Run]) -> Iterator[Claim]:
    """Whether two codes give the same concentration in the same material cells at the end, on one mesh."""
    (name, first), (other_name, second) = one, other
    if not np.array_equal(first.corners, second.corners):
        return
    bound, note = np.nan, "the scene states no bound: [expect.agreement] bound = { h2 = ... }"
    orders = [json.loads(run.attributes["method"])["order_dt"] for run in (first, second)]
    if orders[0] != orders[1]:
        note = "their errors in time are of different order: what is left between them is not space alone"
    elif scene.expect.agreement is not None:
        bound, note = _bound(scene.expect.agreement.bound, first)
    difference = np.nan
    if first.attributes["outcome"] == second.attributes["outcome"] == "completed":
        difference = cell_difference(first, second)
    yield Claim(
        kind=ClaimKind.AGREEMENT,
        quantity="concentration",
        scene=scene.name,
        methods=(name, other_name),
        statement=f"{other_name} agrees with {name} at the end (relative L2 difference of cell averages)",
        value=difference,
        bound=bound,
        command=again(scene, first, second),
        path=_path(scene, name, "VTKHDF/CellData/a"),
        note=note,
    )


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


def known_to(scene: Scene, levels: Sequence[Levels]) -> KnownTo:
    """To what a scene's integrals are known by its runs.

    An error is the distance to theory where that knows the number, else the uncertainty from coarser runs.
    """

    def worst(quantity: str) -> float:
        times = scene.times_before_it_ends
        errors = (_integral_error(scene, one, quantity, t) for one in levels for t in times)
        return max(errors, key=lambda error: np.inf if np.isnan(error) else error, default=np.nan)

    return KnownTo(scene.name, worst("area"), worst("total_actin"))


def _integral_error(scene: Scene, levels: Levels, quantity: str, t: float) -> float:
    if not reaches(levels.runs[0], t):
        return np.nan
    values, error, *_ = estimate(scene, levels, quantity, t)
    theory = known(scene, quantity, t)
    if theory is not None and np.isfinite(theory.values[0]):
        error = float(abs(values[0] - theory.values[0])) + theory.uncertainty
    return error / abs(float(values[0]))
