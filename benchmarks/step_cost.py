"""What one step of the article's scheme costs: ours, plain scikit-fem, and other libraries.

    python -m benchmarks.step_cost [--refine 4 5 6 7 8] [--steps 9] [--peer NAME=COMMAND]...

Fig. 14's cell, already displaced by a few per cent, on 545 to 131585 nodes; one thread.  Each contender has a
process of its own for each mesh: the median of its steps' processor time (wall time beside it, which load on
the machine lengthens), and its peak memory above what its imports take.  `current-normal` is the closure
other libraries' scripts have.  A peer's command may hold {refine} and {steps}; its last line of output is a
JSON record with `total_med` and `wall_med`, seconds.
"""

import actin_xcheck  # noqa: F401, I001 - pins BLAS to one thread, which must happen before numpy's import

import argparse
import json
import math
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.runs.method import FORCE_BALANCE, METHODS, load
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.core.contract import Problem

SCENE, DT = load_scene("fig14-four-fronts"), 1.0228e-3
OURS = {"fem-p1-paper": Closure.REFERENCE_NORMAL, "the same, current-normal": Closure.CURRENT_NORMAL}
PLAIN = "plain scikit-fem"
PLAIN_UP_TO = 7
"""Refinement above which the plain script takes tens of seconds a step."""


def displaced(xi: Array) -> Array:
    """A displacement (2, N) with strains up to 5 %."""
    return 0.03 * np.array(
        [np.sin(1.3 * xi[0] + 0.4 * xi[1]), np.cos(0.7 * xi[0]) * xi[1] - 0.3 * xi[0] * xi[1]]
    )


def concentration(xi: Array) -> Array:
    """Fig. 14's, (N,)."""
    return 1 + 0.1 * np.abs(np.sin(xi[0]) * np.sin(xi[1]))


def ours(closure: Closure, refine: int) -> Callable[[], None]:
    """Return what makes one more step of ours."""
    mesh, method = disk(refine, SCENE.parameters.l0), METHODS["fem-p1-paper"]
    problem = Problem(replace(SCENE.physics, closure=closure), concentration, displaced)
    solver = load(method.solver)(problem, mesh, load(FORCE_BALANCE)(problem.model, mesh, method.space))
    state = solver.init()

    def step() -> None:
        nonlocal state
        state, outcome = solver.step(state, DT)
        if not outcome.ok:
            raise RuntimeError(outcome.message)

    return step


def plain(refine: int) -> Callable[[], None]:
    """Return what makes one more step of the plain script."""
    from benchmarks import plain_skfem

    mesh = disk(refine, SCENE.parameters.l0)
    x, a = mesh.xi + displaced(mesh.xi), concentration(mesh.xi)

    def step() -> None:
        nonlocal x, a
        x, a = plain_skfem.step(mesh, x, a, DT)

    return step


def memory(kind: str) -> int:
    """Bytes resident now (`VmRSS`) or at most (`VmHWM`)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(kind))


def measure(name: str, refine: int, steps: int) -> dict[str, float]:
    """Run one contender in this process: seconds a step and bytes."""
    before = memory("VmRSS")
    step = plain(refine) if name == PLAIN else ours(OURS[name], refine)
    step()
    processor, wall = [], []
    for _ in range(steps):
        began = time.process_time(), time.perf_counter()
        step()
        processor.append(time.process_time() - began[0])
        wall.append(time.perf_counter() - began[1])
    median = {"total_med": float(np.median(processor)), "wall_med": float(np.median(wall))}
    return median | {"bytes": memory("VmHWM") - before}


def record(command: list[str]) -> dict[str, float]:
    """The last line a command prints."""
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(answer.stdout.splitlines()[-1])
    return found


def main(refines: list[int], steps: int, peers: dict[str, str]) -> None:
    """Print one table, and the exponents of ours."""
    print(f"{'nodes':>7} {'':26} {'ms':>8} {'wall ms':>8} {'plain over it':>14} {'kB a node':>10}")
    found: dict[str, list[tuple[int, float]]] = {name: [] for name in OURS}
    for refine in refines:
        nodes = 2 * 4**refine + 2 ** (refine + 1) + 1
        names = [*([PLAIN] if refine <= PLAIN_UP_TO else []), *OURS]
        commands = {
            name: [sys.executable, "-m", "benchmarks.step_cost", "--one", name, str(refine), str(steps)]
            for name in names
        } | {name: shlex.split(peer.format(refine=refine, steps=steps)) for name, peer in peers.items()}
        slowest = math.nan
        for name, command in commands.items():
            row = record(command)
            took = row["total_med"]
            slowest = took if name == PLAIN else slowest
            kilobytes = row.get("bytes", math.nan) / nodes / 1e3
            print(
                f"{nodes:7} {name:26} {1e3 * took:8.1f} {1e3 * row['wall_med']:8.1f} {slowest / took:14.1f} "
                f"{kilobytes:10.1f}",
                flush=True,
            )
            if name in found:
                found[name].append((nodes, took))
    for name, points in found.items():
        if len(points) > 1:
            exponent = np.polyfit(*np.log(np.array(points)).T, 1)[0]
            print(f"{name}: cost grows like nodes^{exponent:.2f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(measure(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))))
    else:
        parser = argparse.ArgumentParser(description="What one step costs.")
        parser.add_argument("--refine", type=int, nargs="+", default=[4, 5, 6, 7, 8])
        parser.add_argument("--steps", type=int, default=9)
        parser.add_argument("--peer", action="append", default=[], metavar="NAME=COMMAND")
        given = parser.parse_args()
        main(given.refine, given.steps, dict(peer.split("=", 1) for peer in given.peer))
