"""Accuracy on demand: what is delivered is as good as asked, and the estimate never flatters."""

import math

import numpy as np
import pytest

from actin_xcheck.cli.app import main
from actin_xcheck.runs.accuracy import deliver, estimated
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.verdicts.judge import reference_errors
from actin_xcheck.verdicts.known import known
from tests.lab import scene_of

REFERENCED = (
    "fig12-mixed-31-02-21",
    "fig14-four-fronts",
    "fig16-uniform-expansion",
    "fig17-uniform-contraction",
)


def test_an_estimate_is_the_share_of_the_last_change_unless_the_one_before_was_too_small():
    assert math.isnan(estimated([], []))
    assert estimated([1e-3], [0.2]) == 0.2e-3
    assert estimated([1e-3, 1e-4], [0.2, 0.5]) == pytest.approx(0.5e-4)
    # the second level was 2e-3 off where 1e-3 had been promised
    assert estimated([1e-2, 2e-3], [0.1, 0.25]) == pytest.approx(2 * 0.25 * 2e-3)
    assert estimated([1e-3, 0.9e-3], [0.2, 0.5]) == 0.9e-3


@pytest.mark.parametrize("name", REFERENCED)
@pytest.mark.parametrize(
    "accuracy", [1e-3, pytest.param(1e-4, marks=pytest.mark.slow), pytest.param(1e-5, marks=pytest.mark.slow)]
)
def test_reference_scenes_are_delivered_as_accurate_as_asked(name, accuracy, tmp_path):
    scene = load_scene(name)
    reached = deliver(scene, accuracy, tmp_path / "run.vtkhdf", "")
    run = read_run(tmp_path / "run.vtkhdf")
    error = max(reference_errors(scene, run).values())
    assert error <= reached.estimate <= accuracy
    assert reached.estimate < 30 * error
    assert run.attributes["error_estimate"] == reached.estimate


@pytest.mark.parametrize(
    "name",
    [
        "static-decay",
        pytest.param("growing-disk", marks=pytest.mark.slow),
        pytest.param("manufactured-static", marks=pytest.mark.slow),
        pytest.param("manufactured-moving", marks=pytest.mark.slow),
        pytest.param("stirred", marks=pytest.mark.slow),
    ],
)
def test_exact_solutions_are_delivered_as_accurate_as_asked(name, tmp_path):
    """Area and total actin by quadrature of the exact solution, a and x at the probes by its formulas."""
    scene = load_scene(name)
    reached = deliver(scene, 1e-4, tmp_path / "run.vtkhdf", "")
    run = read_run(tmp_path / "run.vtkhdf")
    largest = 0.0
    for t in scene.output_times:
        row = run.row_at(t)
        for quantity in ("area", "total_actin", "probe_a", "probe_x"):
            exact = known(scene, quantity, t).values
            scale = exact if quantity in ("area", "total_actin") else 1.0
            largest = max(largest, np.abs((np.ravel(row[quantity]) - exact) / scale).max())
    assert largest <= reached.estimate <= 1e-4


def test_an_interrupted_level_is_no_answer(tmp_path):
    before = tmp_path / "run.vtkhdf"
    before.write_bytes(b"an earlier answer")
    levels = []

    def stop_in_the_second(done, total):
        levels.append(done == total)
        if sum(levels) and not levels[-1]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        deliver(load_scene("static-decay"), 1e-9, before, "", stop_in_the_second)
    assert before.read_bytes() == b"an earlier answer"
    assert [path.name for path in tmp_path.iterdir()] == [before.name]


def test_a_breakdown_is_delivered_as_such(tmp_path):
    scene = scene_of("psi = 7.8e3\np = 0.026", a="1 + 1e-3*cos(x)", end=0.05)
    reached = deliver(scene, 1e-3, tmp_path / "run.vtkhdf", "")
    assert reached.outcome.ending == "singular_dilation"
    assert math.isnan(reached.estimate)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--method", "fem", "--accuracy", "2"], "between 0 and 1"),
        (["--method", "fv-coupled", "--accuracy", "1e-3"], "--method fem"),
        (["--method", "fem", "--accuracy", "1e-3", "--dt", "0.1"], "chooses --dt itself"),
        (["--method", "fem-p1-paper", "--rtol", "1e-3"], "takes equal steps"),
    ],
)
def test_mistakes_are_one_line(words, said, tmp_path, monkeypatch, capsys):
    out = ["--out", str(tmp_path / "a.vtkhdf")]
    monkeypatch.setattr("sys.argv", ["actin_xcheck", "run", "static-decay", *words, *out])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
