"""Fig. 14 to an error of 1e-4 in area, total actin and probes: the article's scheme against `--accuracy`.

    python -m benchmarks.fig14_to_accuracy

Steps are timed in one run, each scheme's right after the other's; what the article's scheme would need is
extrapolated from errors measured at affordable resolutions, error = C_h h^2 + C_t dt, and said to be.
"""

import actin_xcheck  # noqa: F401, I001 - pins BLAS to one thread, which must happen before numpy's import

import tempfile
import time
from pathlib import Path

import numpy as np

from actin_xcheck.runs.accuracy import deliver
from actin_xcheck.runs.method import METHODS
from actin_xcheck.scene.resolve import mesh_of
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind, run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.runs.store import read_run
from actin_xcheck.verdicts.known import reference_errors
from benchmarks import plain_skfem

SCENE, PAPER = load_scene("fig14-four-fronts"), METHODS["fem-p1-paper"]
ASKED = 1e-4


def seconds(step, times=7):
    """Median time of a call."""
    spent = []
    for _ in range(times):
        began = time.perf_counter()
        step()
        spent.append(time.perf_counter() - began)
    return float(np.median(spent))


def error(refine, dt, path):
    """Largest error of the article's scheme over quantities and output times."""
    run(SCENE, Numerics(PAPER, refine, dt), path)
    return max(reference_errors(SCENE, read_run(path)).values())


def main():
    """Measure, extrapolate, print ratios."""
    with tempfile.TemporaryDirectory() as folder:
        path, end = Path(folder) / "run.vtkhdf", SCENE.time.end
        levels = [(4, end / 160), (4, end / 320), (5, end / 320)]
        errors = [error(refine, dt, path) for refine, dt in levels]
        c_dt = (errors[0] - errors[1]) / (end / 320)
        c_h = max(errors[1] - errors[2], 0.0) / (2.0**-8 - 2.0**-10)
        h2 = ASKED / 2 / c_h
        refine = int(np.ceil(-np.log2(np.sqrt(h2))))
        steps = int(np.ceil(end / (ASKED / 2 / c_dt)))
        print(f"article's scheme: error = {c_h:.2f} h^2 + {c_dt:.2f} dt (measured at 545 and 2113 nodes)")
        print(f"for {ASKED:g}: refine {refine}, {steps} steps (extrapolated)")
        began = time.perf_counter()
        reached = deliver(SCENE, ASKED, path, "")
        high = time.perf_counter() - began
        true = max(reference_errors(SCENE, read_run(path)).values())
        print(f"--accuracy {ASKED:g}: {high:.2f} s, estimate {reached.estimate:.1e}, true error {true:.1e}")
    for level in (5, 6, min(refine, 7)):
        mesh, solver = mesh_of(SCENE, level), bind(SCENE, Numerics(PAPER, level, 1e-3))
        state, (x, a) = solver.init(), plain_skfem.start(mesh)
        new, _ = solver.step(state, 1e-3)
        plain_x, plain_a = plain_skfem.step(mesh, x, a, 1e-3)
        assert np.abs(new.x - plain_x).max() < 1e-11
        assert np.abs(new.a - plain_a).max() < 1e-11
        ours = seconds(lambda solver=solver, state=state: solver.step(state, 1e-3))
        plain = seconds(lambda mesh=mesh, x=x, a=a: plain_skfem.step(mesh, x, a, 1e-3), 3)
        print(
            f"{mesh.xi.shape[1]} nodes: step {ours:.4f} s, plain scikit-fem {plain:.3f} s "
            f"({plain / ours:.1f}x); {steps} steps against --accuracy: "
            f"{steps * ours / high:.0f}x, plain {steps * plain / high:.0f}x"
        )


if __name__ == "__main__":
    main()
