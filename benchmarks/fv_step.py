"""What one step costs: FiPy as a plain script would use it, ours, and the finite elements.

    python -m benchmarks.fv_step [--refine 4 5 6] [--steps 9]

Fig. 14's cell at 4^(refine + 1) triangles; processor time of one thread, medians of the steps, the contenders
taking turns.  A step is split into its force balance, which is the finite elements' but for `fv`, and
transport, the rest.  Behind the table: how the cost of each grows with the number of cells.
"""

import actin_xcheck  # noqa: F401, I001 - pins BLAS to one thread, which must happen before numpy's import

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import wraps
from typing import Any

import numpy as np

from actin_xcheck.core.mesh import signed_areas
from actin_xcheck.runs.method import FORCE_BALANCE, FV_FORCE_BALANCE, METHODS, load
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.core.contract import Move, State
from fv.mesh import Faces, fipy

SCENE, DT = load_scene("fig14-four-fronts"), 1.0228e-3
METHOD_NAMES = ("fv-coupled", "fv-order2", "fv", "fem-p1-paper", "fem-p1-imex2")
PLAIN = "plain FiPy"


class PlainScript:
    """A new `Mesh2D` where the nodes are now, a new equation, the default solver.

    The two-point flux is inconsistent on triangles, so this buys no accuracy.
    """

    def __init__(self, faces: Faces) -> None:
        self.faces = faces

    def step(self, old: State, new: State) -> None:
        """Transport from one configuration to the next."""
        from fipy.meshes.mesh2D import Mesh2D

        triangles = self.faces.mesh.triangles
        mesh = Mesh2D(new.x, self.faces.nodes, self.faces.of_cell)
        diluted = old.a * signed_areas(old.x, triangles) / signed_areas(new.x, triangles)
        a = fipy.CellVariable(mesh=mesh, value=diluted, hasOld=True)
        d = SCENE.parameters.d
        equation = fipy.TransientTerm() == fipy.DiffusionTerm(d) - fipy.ImplicitSourceTerm(1.0) + 1.0
        equation.solve(a, dt=DT)
        if np.array_equal(a.value, diluted):  # its solver may find the old value good enough
            raise RuntimeError("FiPy did not solve")


SPENT = {"mechanics": 0.0}
"""Seconds in force balances."""


def timed(move: Callable[..., Move]) -> Callable[..., Move]:
    """What adds its time to `SPENT`."""

    @wraps(move)
    def moved(*arguments: Any) -> Move:
        began = time.process_time()
        found = move(*arguments)
        SPENT["mechanics"] += time.process_time() - began
        return found

    return moved


@dataclass
class Contender:
    """A method under the clock."""

    name: str
    refine: int
    whole: list[float] = field(default_factory=list)
    mechanics: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.solver = bind(SCENE, Numerics(METHODS[self.name], self.refine, DT))
        self.state = self.step(self.solver.init())
        self.whole, self.mechanics = [], []

    def step(self, state: State) -> State:
        """One step, timed."""
        before, began = SPENT["mechanics"], time.process_time()
        new, outcome = self.solver.step(state, DT)
        self.whole.append(time.process_time() - began)
        self.mechanics.append(SPENT["mechanics"] - before)
        if not outcome.ok:
            raise RuntimeError(outcome.message)
        return new


def measure(refine: int, steps: int) -> dict[str, tuple[float, float]]:
    """Milliseconds of (a whole step, its transport) by contender."""
    contenders = [Contender(name, refine) for name in METHOD_NAMES]
    plain, seconds = PlainScript(contenders[0].solver.faces), []  # type: ignore[attr-defined]
    for _ in range(steps):
        for contender in contenders:
            old, contender.state = contender.state, contender.step(contender.state)
            if contender.name == "fv-coupled":
                began = time.process_time()
                plain.step(old, contender.state)
                seconds.append(time.process_time() - began)
    found = {PLAIN: (np.nan, 1e3 * float(np.median(seconds)))}
    for contender in contenders:
        whole, mechanics = np.array(contender.whole), np.array(contender.mechanics)
        found[contender.name] = (1e3 * float(np.median(whole)), 1e3 * float(np.median(whole - mechanics)))
    return found


def main(refines: Sequence[int], steps: int) -> None:
    """Print one table: milliseconds, and ratios of the whole step to others'; then exponents."""
    for target in (FORCE_BALANCE, FV_FORCE_BALANCE):
        balance = load(target)
        for name in ("advance", "flow"):
            setattr(balance, name, timed(getattr(balance, name)))
    others = ("fv-order2", "fem-p1-imex2")
    print(f"{'cells':>6} {'':14} {'step ms':>8} {'transport':>13}  over {', '.join(others)}; plain transport")
    took: dict[str, list[float]] = {}
    for refine in refines:
        found = measure(refine, steps)
        _, plain = found[PLAIN]
        for name, (whole, transport) in found.items():
            over = [whole / found[other][0] for other in others] + [transport / plain]
            ratios = " ".join(f"{ratio:10.2f}" for ratio in over)
            print(f"{4 ** (refine + 1):6} {name:14} {whole:8.1f} {transport:13.1f} {ratios}", flush=True)
            took.setdefault(name, []).append(whole)
    if len(refines) > 1:
        for name in METHOD_NAMES:
            exponent = np.polyfit(np.log(4.0) * np.array(refines), np.log(took[name]), 1)[0]
            print(f"{name}: cost grows like cells^{exponent:.2f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="What one step costs.")
    parser.add_argument("--refine", type=int, nargs="+", default=[4, 5, 6])
    parser.add_argument("--steps", type=int, default=9)
    given = parser.parse_args()
    main(given.refine, given.steps)
