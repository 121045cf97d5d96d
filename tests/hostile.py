"""Hostile inputs, drawn by a seed, and what the package makes of them.

`python -m tests.hostile 10000 [SEED]` runs a campaign: every input is loaded, an accepted scene is run on a
tiny mesh, and each must end in one line or in an Outcome, in bounded time and memory, with no file written
outside of the folder it was given.
"""

import contextlib
import functools
import io
import os
import random
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from actin_xcheck.cli import app as cli
from actin_xcheck.core.errors import LONGEST, UserError
from actin_xcheck.runs import run as runs
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.provenance import peak_memory
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import Scene, load_scene
from actin_xcheck.studies.compare import jobs_of
from tests.hostile_inputs import REPORTS, Input, a_report, a_run, draw_input

SECONDS = 5.0
"""Of processor time an input may take, a run of a few steps included; `HANG` end it."""

HANG = 20
TIMERS = (
    (signal.SIGPROF, signal.ITIMER_PROF, HANG),
    (signal.SIGALRM, signal.ITIMER_REAL, 20 * HANG),  # for what waits, on a machine that may be busy
)
MEGABYTES = 200.0
"""That inputs may add to the process's largest size."""

METHOD_NAMES = ("fem-p1-paper", "fem-p1-paper", "fem-p1-paper", "fv-coupled", "fem-p2-imex3")


@dataclass(frozen=True)
class Answer:
    """What became of an input: how it ended, what it cost and what should not have happened, if anything."""

    kind: str
    ending: str
    seconds: float
    problem: str = ""


class Sandbox:
    """A folder to put inputs into (`in`), one to write to (`out`), and an eye on everything else."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.out = folder.resolve(), folder.resolve() / "out"
        self.outside: list[str] = []
        self._watching = False
        (self.folder / "in").mkdir()
        self.out.mkdir()
        sys.addaudithook(self._audit)

    @contextlib.contextmanager
    def watching(self) -> Iterator[None]:
        """Note what is written outside of `out`, and empty it afterwards."""
        before, home = set(self._files()), Path.cwd()
        os.chdir(self.folder)
        self.outside, self._watching = [], True
        try:
            yield
        finally:
            self._watching = False
            os.chdir(home)
            self.outside += [path for path in set(self._files()) ^ before if Path(path).parts[0] != "out"]
            for path in [*self.out.rglob("*")][::-1]:
                path.rmdir() if path.is_dir() else path.unlink()

    def _files(self) -> list[str]:
        return [str(path.relative_to(self.folder)) for path in self.folder.rglob("*")]

    def _audit(self, event: str, arguments: tuple[object, ...]) -> None:
        if not self._watching:
            return
        match event, arguments:
            case "open", (str() | bytes() as path, mode, flags):
                writes = isinstance(flags, int) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
                if not (writes or (isinstance(mode, str) and set(mode) & set("wax+"))):
                    return
            case (
                ("os.mkdir" | "os.remove" | "os.rename" | "os.rmdir" | "os.symlink" | "os.chmod"),
                (path, *_),
            ):
                pass
            case (("os.system" | "os.exec" | "os.posix_spawn" | "socket.connect"), _):
                self.outside.append(event)
                return
            case _:
                return
        where = Path(os.path.abspath(os.fsdecode(path)))  # type: ignore[arg-type]
        if not where.is_relative_to(self.out) and not str(where).startswith("/dev/"):
            self.outside.append(f"{event} {where}")


class _Hang(BaseException):
    """An input that takes too long; no handler of errors may catch it."""


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    def stop(*_: object) -> None:
        raise _Hang

    for number, timer, limit in TIMERS:
        signal.signal(number, stop)
        signal.setitimer(timer, limit)
    try:
        yield
    finally:
        for number, timer, _ in TIMERS:
            signal.setitimer(timer, 0)
            signal.signal(number, signal.SIG_DFL)


def examine(given: Input, sandbox: Sandbox, draw: random.Random) -> Answer:
    """Hand an input to the package as a user would, and judge the answer."""
    began, problem, ending = time.process_time(), "", ""
    suffix = "vtkhdf" if given.kind == "stored run" else "toml"
    path = sandbox.folder / "in" / f"h.{suffix}"
    path.write_bytes(given.content)
    with sandbox.watching(), warnings.catch_warnings(), _limited_or_hang() as hung:
        warnings.simplefilter("error")
        try:
            match given.kind:
                case "command":
                    ending, problem = _told(given.words)
                case "stored report":
                    _lay_out(given.files, sandbox.out)
                    ending, problem = _told(("report", "out"))
                case "stored run":
                    read_run(path)
                    ending = "read"
                case _:
                    ending, problem = _tried(load_scene(path), sandbox.out, draw)
        except UserError as error:
            ending = "refused"
            line = str(error)
            if not line.isprintable() or len(line) > 10 * LONGEST:
                problem = f"not a printable line: {line[:200]!r}"
        except Exception as error:
            ending, problem = "exception", _where(error)
    path.unlink()
    seconds = time.process_time() - began
    if hung:
        ending, problem = "hang", f"more than {HANG} s"
    if not problem and seconds > SECONDS:
        problem = f"{seconds:.1f} s"
    if sandbox.outside:
        problem = f"written outside: {', '.join(sandbox.outside)[:300]}"
    return Answer(given.kind, ending, seconds, problem)


@contextlib.contextmanager
def _limited_or_hang() -> Iterator[list[bool]]:
    hung: list[bool] = []
    try:
        with _limited():
            yield hung
    except _Hang:
        hung.append(True)


def _where(error: BaseException) -> str:
    """An exception and the line of the package it came from."""
    trace, place = error.__traceback__, ""
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if "site-packages" not in file and "hostile" not in file:
            place = f"{Path(file).parent.name}/{Path(file).name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return f"{type(error).__name__}: {str(error)[:150]} at {place}"


def _tried(scene: Scene, out: Path, draw: random.Random) -> tuple[str, str]:
    """Run an accepted scene on a tiny mesh for a few steps; how it ended, and what is wrong with that."""
    for job in jobs_of([scene], list(METHODS.values())[:1], 1, None):
        if not (out / job.file).resolve().is_relative_to(out):
            return "accepted", f"would write {job.file}"
    if len(scene.output_times) > 6:
        return "accepted", ""
    method = METHODS[draw.choice(METHOD_NAMES)]
    outcome = runs.run(
        scene, Numerics(method, draw.randint(1, 2), scene.time.end / 2), out / f"{scene.name}.vtkhdf"
    )
    return str(outcome.ending), "" if outcome.message.isprintable() else f"message: {outcome.message!r}"


def _told(words: tuple[str, ...]) -> tuple[str, str]:
    """Say words to the command line: exit code 2 and a line, or a code below it."""
    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = ["actin_xcheck", *words]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            cli.main()
        code: object = 0
    except SystemExit as error:
        code = error.code or 0
    finally:
        sys.argv = before
    if code not in (0, 1, 2):
        return f"exit {code}", f"exit code {code} of {words}"
    if code == 2 and (not err.getvalue().strip() or "Traceback" in err.getvalue()):
        return "exit 2", f"nothing said of {words}: {err.getvalue()[:200]!r}"
    return f"exit {code}", ""


def _warm_up(out: Path) -> None:
    """Load what is imported and compiled on first use, which is no input's doing."""
    for name in METHODS:
        runs.run(load_scene("static-decay"), Numerics(METHODS[name], 2, 0.25), out / name)
    for kind in REPORTS:
        _lay_out(tuple(a_report(kind).items()), out / kind)
        _told(("report", str(out / kind)))


def _lay_out(files: tuple[tuple[str, bytes], ...], folder: Path) -> None:
    for name, content in files:
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        (folder / name).write_bytes(content)


def campaign(count: int, seed: int) -> tuple[list[Answer], float]:
    """Examine `count` inputs; the answers, and by how many megabytes they let the process grow."""
    draw = random.Random(seed)
    a_run()
    answers = []
    patched, runs.provenance = runs.provenance, functools.cache(runs.provenance)  # git, once
    try:
        with tempfile.TemporaryDirectory() as folder:
            sandbox = Sandbox(Path(folder))
            _warm_up(sandbox.out)
            before = peak_memory()
            for _ in range(count):
                answers.append(examine(draw_input(draw), sandbox, draw))
                if answers[-1].problem:
                    print(f"#{len(answers)} {answers[-1]}", flush=True)
            grown = (peak_memory() - before) / 2**20
    finally:
        runs.provenance = patched
    return answers, grown


def summary(answers: list[Answer], grown: float) -> str:
    """Counts by kind and ending, the slowest, and how many problems."""
    lines = []
    for kind, number in sorted(Counter(answer.kind for answer in answers).items()):
        endings = Counter(answer.ending for answer in answers if answer.kind == kind)
        slowest = max(answer.seconds for answer in answers if answer.kind == kind)
        found = ", ".join(f"{ending} {count}" for ending, count in endings.most_common())
        lines.append(f"{kind:11s} {number:6d}  slowest {slowest:.2f} s  {found}")
    problems = sum(bool(answer.problem) for answer in answers)
    return "\n".join([*lines, f"{len(answers)} inputs, {grown:.0f} MB grown, {problems} problems"])


if __name__ == "__main__":
    given, grown_by = campaign(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 20261125)
    print(summary(given, grown_by))
    sys.exit(any(answer.problem for answer in given))
