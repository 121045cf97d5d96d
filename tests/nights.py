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

from actin_xcheck.cli.nightly import spend
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly import carry_out as work
from actin_xcheck.nightly.items import NotDecided
from actin_xcheck.nightly.plan import KERNEL, Wish
from actin_xcheck.nightly.record import FILE_NAME, Done, Kept, Number, NumberKind, read_night
from actin_xcheck.runs.executor import in_turn as in_this_process
from tests.claims import claim
from tests.processes import in_turn
from tests.studies import here

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
    timed = False

    def find(self, folder: Path) -> Done:
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
        return Done(
            self.name, (made,), ("kept.txt",), (Number(f"error/{self.name}", NumberKind.ERROR, self.value),)
        )


@pytest.fixture
def night(monkeypatch, tmp_path):
    """Spend a night on these checks in this process, on a machine that is not busy; its exit code."""
    monkeypatch.setattr(work, "work_alone", here)

    def run(*stubs, controls=(), as_json=False, **wish):
        how = {name: wish.pop(name) for name in ("patience", "markdown", "open_page") if name in wish}
        with in_this_process():
            how |= {"as_json": as_json, "kernel": KERNEL, "alone": here}
            return spend(Wish(tmp_path, **wish), (*stubs, *controls), in_turn(1), **how)

    return run


def only_night(folder: Path) -> Kept:
    (found,) = folder.glob(f"*/{FILE_NAME}")
    return read_night(found.parent)


def drive(out: str, log: str, *options: str) -> None:
    """In a process of its own: a night of slow stubs."""
    plan = [Stub(f"check {i}", 0.1 * i, lasts=0.3, log=log) for i in range(5)]
    work.work_alone = here
    sys.exit(spend(Wish(Path(out), resume="--resume" in options), plan, in_turn(1), alone=here))


def start(out: Path, log: Path, *options: str) -> subprocess.Popen:
    call = f"import tests.nights as t; t.drive({str(out)!r}, {str(log)!r}, *{options!r})"
    return subprocess.Popen(
        [sys.executable, "-c", call], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
