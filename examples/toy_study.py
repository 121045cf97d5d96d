"""How the error of a decaying cell falls with the time step: `python toy_study.py FOLDER [SCHEDULER]`."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import actin_xcheck
from actin_xcheck.cli.conduct import carry_out
from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.report.exhibits import Chapter, Line, Plot
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.study import Report, Study, Table, Task, counted
from actin_xcheck.verdicts.known import l2_error

SCENE, METHOD = "static-decay", "fem-p1-paper"


@dataclass(frozen=True)
class Decay:
    """A run in steps of dt, and its relative error at the end."""

    dt: float
    error: float


def decay(dt: float, folder: Path) -> Decay:
    """What a process does: one run."""
    run = actin_xcheck.run(SCENE, METHOD, refine=4, dt=dt)
    return Decay(dt, l2_error(load_scene(SCENE), run))


def decays(steps: Sequence[float]) -> Study:
    """Ask for the runs; say what their errors mean."""
    rows = yield [Task(decay, dt, seconds=1 / dt) for dt in steps]
    dt, error = np.array([(row.dt, row.error) for row in rows]).T
    order = np.log2(error[-2] / error[-1])
    claim = Claim(
        kind=ClaimKind.ORDER_DT,
        quantity="concentration",
        scene=SCENE,
        methods=(METHOD,),
        statement="the error falls with the first power of dt (distance of the last order from 1)",
        value=abs(order - 1),
        bound=0.1,
        command=" ".join(["python", *sys.argv]),
        path="/tables/runs/error",
    )
    plot = Plot("error", "Error at the end", "", "Δt", (Line(METHOD, dt, error),), log=True)
    chapters = (Chapter("errors", "Errors", "Against the exact solution.", (plot,)),)
    return Report(counted([claim], "orders hold"), "", {"runs": Table("Runs", rows)}, (claim,), (), chapters)


if __name__ == "__main__":
    out, scheduler = Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else None
    study = decays([0.25, 0.125, 0.0625, 0.03125])
    report, page = carry_out("toy", study, out, False, None, scheduler, quiet=False)
    print(f"{report.title}; report: {page}")
