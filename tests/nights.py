"""Nights of checks that do nothing, or nothing but harm, and what their tests share."""

import errno
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
import typer

from actin_xcheck.cli import nightly as commands
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly import carry_out as work
from actin_xcheck.nightly import plan as plans
from actin_xcheck.nightly.checks import Found, NotDecided
from actin_xcheck.nightly.history.record import Kind, Number
from actin_xcheck.nightly.plan import Plan
from actin_xcheck.nightly.record import FILE_NAME, Kept, read_night
from actin_xcheck.runs import executor, machine
from actin_xcheck.runs.workers import in_turn as in_this_process
from tests.claims import claim
from tests.processes import in_turn

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Stub:
    """A check that takes as long as it is told, and then gives a value against the bound 1."""

    name: str
    guess: float = 0.0
    value: float = 0.5
    lasts: float = 0.0
    how: str = ""
    log: str = ""

    def find(self, folder: Path) -> Found:
        if self.log:
            with open(self.log, "a", encoding="utf-8") as log:
                log.write(f"{self.name}\n")
        time.sleep(self.lasts)
        if self.how == "raises":
            raise ValueError("no such \x01 mesh")
        if self.how == "dies":
            os._exit(7)
        if self.how == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.how == "no memory":
            raise MemoryError
        if self.how == "no disk":
            raise UserError("run.vtkhdf: cannot be written") from OSError(errno.ENOSPC, "No space left")
        if self.how == "undecided":
            raise NotDecided("nothing to decide it by")
        (folder / "kept.txt").write_text("a file")
        made = claim(f"claim of {self.name}", self.value, command="again", path="/run/x", note="why")
        return Found((made,), ("kept.txt",), (Number(f"error/{self.name}", Kind.ERROR, self.value),))


@pytest.fixture
def here(monkeypatch):
    """All work is done in this process, which saves seconds of imports, and no machine is busy."""
    monkeypatch.setattr(machine, "reference_kernel", lambda: (plans.KERNEL, plans.KERNEL))
    for module in (executor, work):
        monkeypatch.setattr(module, "executor", in_turn)
    monkeypatch.setattr(work, "work_alone", lambda find, task, report: find(task, report))


@pytest.fixture
def night(here, monkeypatch, tmp_path):
    """Run `nightly` with these checks; its exit code."""

    def run(*stubs, controls=(), **options):
        plan = Plan(stubs, tuple(controls))
        monkeypatch.setattr(plans, "suite", lambda: plan)
        with pytest.raises(typer.Exit) as left, in_this_process():
            commands.nightly_command(**{"out_dir": tmp_path, "quiet": True, "jobs": 1, **options})
        return left.value.exit_code

    return run


def only_night(folder: Path) -> Kept:
    (found,) = folder.glob(f"*/{FILE_NAME}")
    return read_night(found.parent)


def drive(out: str, log: str, *options: str) -> None:
    """In a process of its own: `nightly` with slow stubs, as the command line calls it."""
    plan = Plan(tuple(Stub(f"check {i}", 0.1 * i, lasts=0.3, log=log) for i in range(5)))
    plans.suite = lambda: plan
    executor.executor = work.executor = in_turn
    work.work_alone = lambda find, task, report: find(task, report)
    try:
        commands.nightly_command(out_dir=Path(out), quiet=True, jobs=1, resume="--resume" in options)
    except typer.Exit as left:
        sys.exit(left.exit_code)


def start(out: Path, log: Path, *options: str) -> subprocess.Popen:
    call = f"import tests.nights as t; t.drive({str(out)!r}, {str(log)!r}, *{options!r})"
    return subprocess.Popen(
        [sys.executable, "-c", call], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
