"""Runs that are killed at random moments and taken up again.

`python -m tests.kills 200 [SEED]` kills at least so many runs with SIGKILL, in turn for each kind of run, and
prints a table.  What a kill leaves behind must be a run that reads and plays up to its last checkpoint; taken
up again, some of them killed once more, it must end in the bits of a run that nobody interrupted.
"""

import multiprocessing
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from pathlib import Path

from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.files import unfinished
from actin_xcheck.core.parameters import Fidelity
from actin_xcheck.runs import march
from actin_xcheck.runs import run as runs
from actin_xcheck.runs.fidelity import reduced
from actin_xcheck.runs.method import HAND_OVER, METHODS, MODAL, RADIAL, SECTOR
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.processes import stop_signals
from actin_xcheck.runs.store import read_run, reading
from actin_xcheck.scene.scene import Scene, load_scene, parse_scene

OFTEN = 2.0
"""For `march.REST`: a third of a run's time goes into checkpoints, so that many kills hit one."""

AGAIN = 0.3
"""Of the runs taken up, the part that is killed once more."""


@dataclass(frozen=True)
class Kind:
    """A kind of run: a shipped scene or the text of one, and how it is run."""

    scene: str
    method: str
    refine: int
    dt: float
    rtol: float | None = None
    fidelity: Fidelity = Fidelity.FULL

    @property
    def label(self) -> str:
        """What it is called in the table."""
        return (
            f"{self.method} {self.fidelity} {'equal' if self.rtol is None else 'adaptive'} {self.loaded.name}"
        )

    @property
    def loaded(self) -> Scene:
        """The scene."""
        return parse_scene(self.scene, "kills.toml") if "\n" in self.scene else load_scene(self.scene)

    @property
    def numerics(self) -> Numerics:
        """How it is run."""
        method = METHODS[self.method]
        reduction = reduced(self.loaded, method, self.fidelity, self.rtol)
        return Numerics(method, self.refine, self.dt, self.rtol, reduction)


def _scene(name: str, a: str, psi: float, end: float, more: str = "") -> str:
    outputs = [end / 4, end / 2, end]
    return (
        f'name = "{name}"\n[parameters]\npsi = {psi}\np = 0.26\n[initial]\na = "{a}"\n'
        f"[time]\nend = {end}\noutputs = {outputs}\n[probes]\npoints = [[0, 0], [0.4, 0.1]]\n{more}"
    )


FRONTS, STIRRED = "fig14-four-fronts", "stirred"
ROUND = _scene("round", "1 + 0.1*r**2*(1 - r**2/2)", 318.0, 0.2)
SMALL = _scene("small", "1 + 3e-5*cos(x)", 100.0, 0.4, '[model]\ndelta = "none"\n')
FREE = _scene("free", "1 + 0.1*x", 60.0, 0.1, '[model]\nclosure = "traction-free"\n')
STRONG = _scene("strong", "1 + 1e-3*cos(x)", 7800.0, 0.1)
MODE = "eigenmode = { m = 2, n = 1, amplitude = 1e-3 }"
TWIN = _scene("twin", f'1 + 0.01*r**2"\n{MODE} # "', 240.0, 0.1, '[model]\ndelta = "none"\n')

KINDS = (
    Kind(FRONTS, "fem-p1-paper", 4, 1e-3),
    Kind(FRONTS, "fem-p1-paper", 4, 1e-3, fidelity=Fidelity.SECTOR),
    Kind(FRONTS, "fem-p2-imex3", 3, 1.0, 3e-6),
    Kind(FRONTS, "fem-p4-imex4", 2, 1.0, 3e-8, Fidelity.SECTOR),
    Kind(ROUND, "fem-p4-imex4", 3, 1.0, 1e-10, Fidelity.RADIAL),
    Kind(SMALL, "fem-p2-imex3", 2, 0.02, 1e-6, Fidelity.MODAL),
    Kind(FREE, "fem-p1-imex2", 3, 1e-3),
    Kind(STRONG, "fem-p1-paper", 3, 1e-4),
    Kind(TWIN, "fem-p1-paper", 3, 1e-3),
    Kind(FRONTS, "fv-coupled", 3, 2e-3),
    Kind(FRONTS, "fv-order2", 3, 1.0, 1e-5),
    Kind(STIRRED, "fv-driven", 3, 2e-3),
)
"""Both codes, equal and adaptive steps, every reduced model, a run that fails, one that has a twin."""

QUICK = (
    Kind(FRONTS, "fem-p1-paper", 2, 5e-3),
    Kind(FRONTS, "fem-p1-paper", 3, 1e-2, fidelity=Fidelity.SECTOR),
    Kind(FRONTS, "fem-p2-imex3", 2, 1.0, 1e-4),
    Kind(FRONTS, "fem-p4-imex4", 2, 1.0, 1e-5, Fidelity.SECTOR),
    Kind(ROUND, "fem-p4-imex4", 3, 1.0, 1e-7, Fidelity.RADIAL),
    Kind(SMALL, "fem-p2-imex3", 2, 0.02, 1e-6, Fidelity.MODAL),
    Kind(FRONTS, "fv-coupled", 2, 1e-2),
    Kind(FRONTS, "fv-order2", 2, 1.0, 1e-4),
    Kind(STIRRED, "fv-driven", 2, 1e-2),
)
"""Small ones of most of them, which end within seconds."""


def go(kind: Kind, path: Path, stop_after: int | None = None, resume: bool = False) -> Outcome:
    """Run a kind of run in this process; Ctrl-C comes while it measures its state after so many steps."""
    steps = 0

    def progress(done: int, total: int) -> None:
        nonlocal steps
        if steps == stop_after:
            signal.raise_signal(signal.SIGINT)
        steps += 1

    with stop_signals() as stop:
        return runs.run(kind.loaded, kind.numerics, path, "", progress, resume, stop)


def work(kind: Kind, path: Path, resume: bool) -> None:
    """Run a kind of run, with many checkpoints; in a process of its own."""
    march.REST = OFTEN
    runs.run(kind.loaded, kind.numerics, path, resume=resume)


@dataclass
class Found:
    """What became of the kills of one kind of run, and how long one takes that is not killed."""

    kind: Kind
    seconds: float
    counts: Counter[str]
    wrong: list[str]


def bits(path: Path) -> dict[str, bytes]:
    """Everything a run has computed: all datasets of /VTKHDF and /run/series and how it ended, by name."""
    import h5py

    found: dict[str, bytes] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = str(item.shape).encode() + item[()].tobytes()

    with reading(path, "run") as file:
        for group in (file["VTKHDF"], file["run/series"]):
            group.visititems(lambda name, item, at=group.name: keep(f"{at}/{name}", item))
        found["steps"] = str(file["VTKHDF/Steps"].attrs["NSteps"]).encode()
        for name in ("outcome", "message"):
            found[name] = file["run"].attrs[name].encode()
    return found


class Lab:
    """Starts runs in processes: a fresh interpreter for what is expected, forks of a warm one else."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.random = folder, random.Random(seed)
        self.fresh = multiprocessing.get_context("spawn")
        self.warm = multiprocessing.get_context("forkserver")
        solvers = (*(method.solver for method in METHODS.values()), RADIAL, SECTOR, MODAL, HAND_OVER)
        modules = (target.split(":")[0] for target in solvers)
        self.warm.set_forkserver_preload(["actin_xcheck.runs.run", *modules])

    def start(self, kind: Kind, path: Path, resume: bool) -> BaseProcess:
        """Start one."""
        process = self.warm.Process(target=work, args=(kind, path, resume))
        process.start()
        return process

    def kinds(self, kinds: Sequence[Kind]) -> Iterator[tuple[Found, dict[str, bytes]]]:
        """Run every kind twice without a kill: for its bits, in a fresh interpreter, and for its time."""
        for number, kind in enumerate(kinds):
            path = self.folder / f"{number}.vtkhdf"
            process = self.fresh.Process(target=work, args=(kind, path, False))
            process.start()
            process.join()
            expected = bits(path)
            began = time.perf_counter()
            process = self.start(kind, path, False)
            process.join()
            found = Found(kind, time.perf_counter() - began, Counter(), [])
            if process.exitcode or bits(path) != expected:
                found.wrong.append("two runs differ that nobody interrupted")
            path.unlink()
            yield found, expected

    def trial(self, found: Found, expected: dict[str, bytes]) -> None:
        """Kill one run, once or twice, and take it up again."""
        path = self.folder / "run.vtkhdf"
        resume = False
        while True:
            process = self.start(found.kind, path, resume)
            process.join(self.random.uniform(0, found.seconds))
            process.kill()
            process.join()
            left = self.left(path, found)
            found.counts[left] += 1
            resume = True
            if self.random.random() > AGAIN:
                break
        process = self.start(found.kind, path, True)
        process.join()
        same = not process.exitcode and bits(path) == expected
        found.counts["same bits" if same else "other bits"] += 1
        if not same:
            now = bits(path)
            names = [name for name in expected if now.get(name) != expected[name]]
            found.wrong.append(f"after {left}: {', '.join(names)}")
        if unfinished(path).exists():
            found.wrong.append("a finished run leaves its checkpoint")
        path.unlink()

    def left(self, path: Path, found: Found) -> str:
        """What a kill has left behind: nothing yet, a whole file (finished or not), or something broken."""
        if path.exists():
            return "finished before"
        if not unfinished(path).exists():
            return "nothing yet"
        writing = any(one.name.endswith(".new") for one in self.folder.iterdir())
        try:
            run = read_run(unfinished(path))
            assert run.attributes["outcome"] == "interrupted"
            assert run.series["time"][0] == run.times[0] == 0
        except Exception as error:
            found.wrong.append(str(error))
            return "broken"
        return "readable, killed while it wrote" if writing else "readable"


def campaign(kills: int, seed: int, folder: Path, kinds: Sequence[Kind] = KINDS) -> list[Found]:
    """Kill runs in turn until so many readable files have been left behind."""
    lab = Lab(folder, seed)
    found = list(lab.kinds(kinds))
    while sum(count for one, _ in found for name, count in one.counts.items() if "readable" in name) < kills:
        for one, expected in found:
            lab.trial(one, expected)
    return [one for one, _ in found]


def main(kills: int, seed: int) -> int:
    """Print the table; the number of things that went wrong."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        results = campaign(kills, seed, Path(folder))
    names = ("readable", "readable, killed while it wrote", "nothing yet", "finished before", "broken")
    columns = (*names, "same bits", "other bits")
    print(f"{'':50}" + "".join(f"{name.replace('readable, ', ''):>26}" for name in columns))
    total: Counter[str] = Counter()
    for one in results:
        print(f"{one.kind.label:45}{one.seconds:4.1f} s" + "".join(f"{one.counts[n]:26}" for n in columns))
        total += one.counts
        for sentence in one.wrong:
            print(f"  WRONG {sentence}")
    print(f"{'all':50}" + "".join(f"{total[n]:26}" for n in columns))
    print(f"seed {seed}, {time.perf_counter() - began:.0f} s")
    return sum(len(one.wrong) for one in results)


if __name__ == "__main__":
    sys.exit(bool(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1)))
