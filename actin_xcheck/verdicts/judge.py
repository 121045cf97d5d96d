"""Claims about the stored runs of one scene: each compares numbers from files with a bound.

Single-mesh bounds are C_h h^2 + C_dt dt with slope constants stored in the scene's `[expect]`; orders
themselves are the business of convergence studies.
"""

import json
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Literal

import numpy as np

from actin_xcheck.core import lagrange
from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.model import Array
from actin_xcheck.runs.accuracy import change
from actin_xcheck.runs.fidelity import Fidelity
from actin_xcheck.runs.numerics import command
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.resolve import in_scene_frame, turn_matrix
from actin_xcheck.scene.scene import Scene
from actin_xcheck.scene.tables import Bound
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.theory.growth import fit_growth

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
        if first.family != second.family:  # one code against the other
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


def _bound(bound: Bound, run: Run) -> tuple[float, str]:
    """The bound at the run's resolution and how it is made up.

    dt is the largest step that was taken: of a run that chose its steps, the one asked for is a limit only.
    """
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
        series, end = self.run.series, self.scene.output_times[-1]
        yield self._claim(
            kind=ClaimKind.ENDS,
            statement=f"runs to its end t = {end:g}",
            value=end - float(series["time"][-1]),
            bound=0.0,
            path="run/series/time",
            note=str(self.run.attributes["message"]) or "value: the time missing at the end",
        )
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
        if expect.reference is not None:
            yield from self._reference()

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
        bound, note = _bound(expected.bound, self.run)
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
            statement=f"mode ({expected.m}, {expected.n}) grows at the predicted rate {_complex(rate)} "
            f"({'relative error' if rate else 'error'}; measured {_complex(measured)})",
            value=abs(measured - rate) / (abs(rate) or 1.0),
            bound=bound,
            path="run/series/mode_amplitude",
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


def _complex(rate: complex) -> str:
    """A growth rate, with its frequency where it has one."""
    return f"{rate.real:.4f}" + (f" ± {rate.imag:.4f}i" if rate.imag else "")


def l2_error(scene: Scene, run: Run) -> float:
    """Relative L2 error at the end against `[expect.exact]`.

    Of the P_k field on its curved cells for finite elements, of cell averages for finite volumes.
    """
    assert scene.expect.exact is not None
    rule = lagrange.rule(run.order, 4 * run.order - 2)  # exact for the square of the field
    x, xi, a = (rule.blend(nodal, run.cells) for nodal in (run.points[-1], run.xi, run.a_points[-1]))
    exact = in_scene_frame(scene, scene.expect.exact.a, x, xi, float(run.times[-1]))
    dx = rule.dx(run.points[-1], run.cells)
    if run.family == "fv":
        areas = dx.sum(axis=0)
        exact = (exact * dx).sum(axis=0) / areas
        return float(np.sqrt(areas @ (run.a_cells[-1] - exact) ** 2 / (areas @ exact**2)))
    return float(np.sqrt(((a - exact) ** 2 * dx).sum() / (exact**2 * dx).sum()))


def reference_errors(scene: Scene, run: Run) -> dict[str, float]:
    """Largest error over the reference times: relative for area and total actin, absolute for probes.

    nan where the run did not reach a reference time that is judged; a quantity none of whose values is judged
    (they are nan in the scene) has none.
    """
    assert scene.expect.reference is not None
    errors: dict[str, list[float]] = {}
    for at in scene.expect.reference.at:
        row = int(np.argmin(np.abs(run.series["time"] - at.time)))
        reached = abs(run.series["time"][row] - at.time) < 1e-9
        for quantity in ("area", "total_actin", "probe_a", "probe_x"):
            expected = getattr(at, quantity)
            if expected is None:
                continue
            got: Array = run.series[quantity][row]
            if quantity == "probe_x":
                got = got @ turn_matrix(scene)
            scale = expected if quantity in {"area", "total_actin"} else 1.0
            difference = np.abs(np.asarray(got) - np.asarray(expected, dtype=float)) / scale
            judged = np.isfinite(np.asarray(expected, dtype=float))
            errors.setdefault(quantity, []).extend(difference[judged] if reached else judged[judged] * np.nan)
    return {quantity: float(np.max(values)) for quantity, values in errors.items() if values}


def _agreement(scene: Scene, one: tuple[str, Run], other: tuple[str, Run]) -> Iterator[Claim]:
    """Whether two codes give the same concentration in the same material cells at the end."""
    (name, first), (other_name, second) = one, other
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


def cell_difference(first: Run, second: Run) -> float:
    """Relative L2 difference of the cell averages of two runs at their last frames, in `first`'s areas."""
    areas = lagrange.areas(first.points[-1], first.cells)
    difference = first.a_cells[-1] - second.a_cells[-1]
    return float(np.sqrt(areas @ difference**2 / (areas @ first.a_cells[-1] ** 2)))
