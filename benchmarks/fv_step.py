"""What one step costs: FiPy as a plain script would use it, ours, and the finite elements.

    python -m benchmarks.fv_step [STEPS]

Fig. 14's cell at 1024, 4096 and 16384 triangles; processor time of one thread, medians of STEPS steps (9 if
not given), the contenders taking turns.  A step of ours that loads the force balance is split: the mechanics
is the finite elements', transport is the rest.
"""

import actin_xcheck  # noqa: F401, I001 - pins BLAS to one thread, which must happen before numpy's import

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from actin_xcheck.core.mesh import signed_areas
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.core.contract import Move, State
from fv.mesh import Faces, fipy

SCENE, DT = load_scene("fig14-four-fronts"), 1.0228e-3
METHOD_NAMES = ("fv-coupled", "fv-order2", "fem-p1-paper")
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


@dataclass
class Contender:
    """A method under the clock."""

    name: str
    refine: int
    whole: list[float] = field(default_factory=list)
    mechanics: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.solver = bind(SCENE, Numerics(METHODS[self.name], self.refine, DT))
        self._spent = 0.0
        mechanics = self.solver.mechanics  # type: ignore[attr-defined]
        for name in ("advance", "flow"):
            setattr(mechanics, name, self._timed(getattr(mechanics, name)))
        self.state = self.step(self.solver.init())
        self.whole, self.mechanics = [], []

    def _timed(self, move: Callable[..., Move]) -> Callable[..., Move]:
        def timed(*arguments: Any) -> Move:
            began = time.process_time()
            moved = move(*arguments)
            self._spent += time.process_time() - began
            return moved

        return timed

    def step(self, state: State) -> State:
        """One step, timed."""
        self._spent, began = 0.0, time.process_time()
        new, outcome = self.solver.step(state, DT)
        self.whole.append(time.process_time() - began)
        self.mechanics.append(self._spent)
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


def main(steps: int) -> None:
    """Print one table: milliseconds, and ratios to the plain script's step."""
    print(f"{'cells':>6} {'':14} {'step ms':>8} {'transport':>10} ms  step and transport over plain")
    for refine in (4, 5, 6):
        found = measure(refine, steps)
        _, plain = found[PLAIN]
        for name, (whole, transport) in found.items():
            ratios = f"{whole / plain:17.2f} {transport / plain:10.2f}"
            print(f"{4 ** (refine + 1):6} {name:14} {whole:8.1f} {transport:13.1f} {ratios}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 9)
