"""Interrupted runs: whatever stops one, its last checkpoint is whole, and it goes on to the same bits."""

import json
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from actin_xcheck.core.contract import State
from actin_xcheck.core.errors import Ending, UserError
from actin_xcheck.core.files import unfinished
from actin_xcheck.core.parameters import Fidelity
from actin_xcheck.runs import march
from actin_xcheck.runs.march import Keeper, March, Moment
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind, run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from fem.remeshing import Remeshing
from tests.kills import FRONTS, QUICK, ROUND, Kind, bits, go


def label(kind: Kind) -> str:
    return kind.label.replace(" ", "-")


@pytest.mark.parametrize("kind", QUICK, ids=label)
def test_a_step_from_what_is_remembered_gives_the_same_bits(kind: Kind) -> None:
    """At every state of a run; arrays are contiguous, so that a file can hold them as they are."""
    scene, numerics = kind.loaded, replace(kind.numerics, rtol=None)
    solver = bind(scene, numerics)
    state = solver.init()
    step = kind.dt if kind.rtol is None else scene.output_times[0] / 20
    for _ in range(4):
        memento = solver.memento(state)
        assert all(array.flags.forc for array in memento.values())
        other = bind(scene, numerics)
        again = other.restored({name: array.copy(order="K") for name, array in memento.items()})
        new, outcome = solver.step(state, step)
        assert outcome.ok
        expected = solver.memento(new)
        found = other.memento(other.step(again, step)[0])
        assert {name: array.tobytes() for name, array in found.items()} == {
            name: array.tobytes() for name, array in expected.items()
        }
        state = new


@pytest.mark.parametrize("kind", QUICK, ids=label)
def test_an_interrupted_run_goes_on_to_the_same_bits(kind: Kind, tmp_path: Path) -> None:
    """Interrupted again and again: at t = 0, then after a few steps each."""
    outcome = go(kind, tmp_path / "whole.vtkhdf")
    assert outcome.ok
    whole = read_run(tmp_path / "whole.vtkhdf")
    draw, path, seen = random.Random(3), tmp_path / "run.vtkhdf", 0
    for stop in (0, *(draw.randint(0, len(whole.series["time"]) // 4) for _ in range(3))):
        outcome = go(kind, path, stop, resume=True)
        assert outcome.ending is Ending.INTERRUPTED
        assert not path.exists()
        part = read_run(unfinished(path))
        seen += stop + 1
        assert len(part.series["time"]) == seen
        assert set(part.times) <= set(whole.times)
        np.testing.assert_array_equal(part.series["area"], whole.series["area"][:seen])
    assert go(kind, path, resume=True).ok
    assert bits(path) == bits(tmp_path / "whole.vtkhdf")
    assert {one.name for one in tmp_path.iterdir()} == {"whole.vtkhdf", "run.vtkhdf"}


def test_steps_depend_on_all_that_a_checkpoint_holds(tmp_path: Path) -> None:
    """Without its pace, or with another anchor, a run goes on to other bits: the tests above can fail."""
    scene, method = load_scene(FRONTS), METHODS["fem-p2-imex3"]
    numerics = Numerics(method, 2, 1.0, 1e-4)
    solver = bind(scene, numerics)

    def after(begin: Moment | None) -> list[bytes]:
        march = March(solver, numerics, scene.output_times, begin)
        positions = [moment.state.x.tobytes() for moment in march]
        assert march.outcome.ok
        return positions

    moments = list(March(solver, numerics, scene.output_times))
    whole, count = [moment.state.x.tobytes() for moment in moments], len(moments) // 2 + 1
    middle = moments[count - 1]
    memento = solver.memento(middle.state)
    assert after(replace(middle, state=solver.restored(memento))) == whole[count:]
    assert after(replace(middle, pace=None)) != whole[count:]
    for name in ("anchor", "content"):
        changed = memento[name] * (1 + 1e-9)
        assert after(replace(middle, state=solver.restored({**memento, name: changed}))) != whole[count:]


def test_checkpoints_cost_a_fiftieth_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a clock that a step moves by 1 and a checkpoint by 10, and one that is slow by 100."""
    clock, written = [1000.0], []

    class Writer:
        def checkpoint(self, arrays, outcome, wall_seconds):
            written.append(clock[0])
            clock[0] += 100 if len(written) == 3 else 10

    class Solver:
        def memento(self, state):
            return {}

    monkeypatch.setattr(march.time, "perf_counter", lambda: clock[0])
    moment = Moment(State(0.0, np.zeros((2, 1)), np.ones(1), np.zeros((2, 1))))
    keep = Keeper(Solver(), Writer(), began=1000.0)
    for _ in range(7010):
        assert keep(moment).ok
        clock[0] += 1
    assert [round(t - 1000) for t in written] == [0, 510, 1020, 6120, 6630, 7140]
    stopped = Keeper(Solver(), Writer(), 0.0, stop=lambda: True)(moment)
    assert stopped.ending is Ending.INTERRUPTED


def test_another_run_is_not_gone_on_with(tmp_path: Path) -> None:
    kind, path = QUICK[0], tmp_path / "run.vtkhdf"
    assert go(kind, path, 3).ending is Ending.INTERRUPTED
    before = unfinished(path).read_bytes()
    others = {
        "dt is 0.005, not 0.01": replace(kind, dt=0.01),
        "refine is 2, not 3": replace(kind, refine=3),
        "method is": replace(kind, method="fv-coupled"),
        "scene is": replace(kind, scene=ROUND),
        "rtol is nan, not 0.1": replace(kind, method="fem-p1-imex2", rtol=0.1),
        "fidelity is full, not sector": replace(kind, fidelity=Fidelity.SECTOR),
    }
    for reason, other in others.items():
        with pytest.raises(UserError, match=r"--resume.*another run") as caught:
            go(other, path, resume=True)
        assert reason in str(caught.value) or "method is" in str(caught.value)
        assert "\n" not in str(caught.value)
    assert unfinished(path).read_bytes() == before
    assert go(kind, path, resume=True).ok
    finished = path.read_bytes()
    said = go(kind, path, resume=True)
    assert (said.ending, path.read_bytes()) == (Ending.COMPLETED, finished)
    assert "finished before" in said.message
    with pytest.raises(UserError, match=r"dt is 0\.005, not 0\.01"):
        go(replace(kind, dt=0.01), path, resume=True)


def test_a_checkpoint_that_is_not_whole_is_one_line(tmp_path: Path) -> None:
    import h5py

    path = tmp_path / "run.vtkhdf"
    for spoil in ("run/checkpoint/anchor", "run/checkpoint"):
        assert go(QUICK[0], path, 3).ending is Ending.INTERRUPTED
        with h5py.File(unfinished(path), "r+") as file:
            del file[spoil]
        with pytest.raises(UserError, match="--resume: the checkpoint is not whole"):
            go(QUICK[0], path, resume=True)
    unfinished(path).write_bytes(unfinished(path).read_bytes()[:5000])
    with pytest.raises(UserError, match="not a whole run"):
        go(QUICK[0], path, resume=True)


def test_the_versions_that_differ_are_named_and_a_new_kernel_is_none():
    old = {"python": "3.11.7", "numpy": "2.0", "platform": "Linux-5"}
    now = {"python": "3.11.7", "numpy": "2.1", "platform": "Linux-6"}
    assert march._unlike(json.dumps(old), json.dumps(now)) == ("numpy 2.0", "numpy 2.1")
    assert march._unlike(json.dumps(old), json.dumps(old | {"platform": "Linux-6"})) == ("", "")
    assert march._unlike("damaged", json.dumps(now)) == ("damaged", json.dumps(now))


def test_a_run_goes_on_over_a_new_mesh_to_the_same_bits(tmp_path, monkeypatch):
    """Remeshed in its first step, because that is asked of it, and interrupted in its third."""
    begin = Remeshing.init
    monkeypatch.setattr(Remeshing, "init", lambda solver: replace(begin(solver), limit=0.999))
    monkeypatch.setattr(march, "REST", 0.0)
    scene, method, steps = load_scene("growing-disk"), METHODS["fem-p2-imex3"], []

    def interrupt(done, total):
        steps.append(done)
        if len(steps) == 4:
            raise KeyboardInterrupt

    def go(name, progress=lambda done, total: None, resume=False, remesh=True):
        path, dt = tmp_path / name, scene.time.end / 5
        return run(scene, Numerics(method, 2, dt, remesh=remesh), path, progress=progress, resume=resume)

    assert go("whole.vtkhdf").ok
    with pytest.raises(KeyboardInterrupt):
        go("parts.vtkhdf", interrupt)
    with pytest.raises(UserError, match="its remesh is 1, not 0"):
        go("parts.vtkhdf", resume=True, remesh=False)
    assert go("parts.vtkhdf", resume=True).ok
    assert read_run(tmp_path / "whole.vtkhdf").series["remeshings"][[0, 1, -1]].tolist() == [0, 1, 1]
    assert bits(tmp_path / "whole.vtkhdf") == bits(tmp_path / "parts.vtkhdf")
