"""Accuracy on demand: what is delivered is as good as asked, and the estimate never flatters."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.lagrange import nodes, quadrature, sizes_by_degree
from actin_xcheck.runs import accuracy as accurately
from actin_xcheck.runs.accuracy import LEVELS, change, deliver, estimated
from actin_xcheck.runs.fidelity import Fidelity, Reduction
from actin_xcheck.runs.growth import energy_growth, fitted_rate
from actin_xcheck.runs.method import METHODS, PERTURBATIONS, load
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.accurate import Climbed, StatedError, accurate
from actin_xcheck.studies.compare import compare_to, read_comparison
from actin_xcheck.studies.coverage import drawn
from actin_xcheck.studies.stored import Ran
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.verdicts.known import known, reference_errors
from tests.lab import scene_of
from tests.studies import carry
from tests.test_cli import one_line

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


def probed(steps, value):
    """A run of so many steps that ends with a value."""
    row = dict.fromkeys(("area", "total_actin"), np.ones(steps + 1)) | {"centroid": np.zeros((steps + 1, 2))}
    values = np.full((steps + 1, 1), value)
    series = row | {"time": np.linspace(0, 1, steps + 1), "probe_a": values, "probe_x": values}
    return SimpleNamespace(series=series, row_at=lambda t: {name: one[-1] for name, one in series.items()})


def climb_of(runs, accuracy):
    """A climb whose runs on its first level are given, by their tolerances."""
    scene = SimpleNamespace(
        expect=SimpleNamespace(growth_rate=None, transient=None), initial=SimpleNamespace(eigenmode=None)
    )
    scene.output_times = [1.0]
    return accurately._Climb(
        scene, accuracy, None, Reduction(), lambda level, rtol, name, longest: (COMPLETED, runs[rtol])
    )


@pytest.mark.parametrize(("accuracy", "rtol"), [(1e-2, 1e-2), (1e-3, 3e-4), (1e-5, 9e-8)])
def test_errors_in_time_are_measured_by_steps_that_become_more(accuracy, rtol):
    """Errors of N^-4: two runs know both, and the first tolerance with little enough is taken."""
    first = min(1e-2, 10 * accuracy)
    tolerances = [float(f"{first * 0.03**n:.3g}") for n in range(8)]
    steps = {one: round(4 * (first / one) ** 0.25) - 1 for one in tolerances}
    runs = {one: probed(n, 0.2 * (n + 1) ** -4) for one, n in steps.items()}
    climb = climb_of(runs, accuracy)
    now = climb._with_tolerance(LEVELS[0], runs[first])
    error = 0.2 * len(now.series["time"]) ** -4
    assert climb.rtol == pytest.approx(rtol)
    assert now is runs[climb.rtol]
    assert 1.99 * error < climb.in_time < 4.01 * error
    assert climb.in_time <= 0.5 * accuracy


def test_where_little_is_missing_no_run_is_made_to_measure_it():
    """Steps may use up 0.75 of 1e-4, and 0.94 follows: they become shorter, until 0.5 does."""
    runs = {1e-3: probed(3, 0.2 * 4.0**-4), 3e-5: probed(9, 0.2 * (4 * 0.03**-0.25) ** -4)}
    climb = climb_of(runs, 1e-4)
    fall = (4 / 10) ** 4
    missed = 4 * fall * 0.2 * (4.0**-4) * (1 - 0.03) / (1 - fall) / 0.5e-4
    assert climb._with_tolerance(LEVELS[0], runs[1e-3]) is runs[3e-5]
    assert 1.5 < missed < 3
    assert climb.in_time == pytest.approx(0.5e-4)
    assert climb.rtol == pytest.approx(3e-5 * missed**-1.25, rel=1e-2)
    assert climb.shorter == pytest.approx(missed**-0.25)


def test_steps_that_output_times_cut_short_do_not_flatter():
    """Two runs of the same steps change by nothing, whatever their error is."""
    runs = {1e-2: probed(3, 1e-5), 3e-4: probed(3, 1e-5), 9e-6: probed(7, 1e-7)}
    climb = climb_of(runs, 1e-3)
    assert climb._with_tolerance(LEVELS[0], runs[1e-2]) is runs[1e-2]
    assert climb.in_time == pytest.approx(2 * (1e-5 - 1e-7) / (1 - 2**-4))


def test_parts_of_a_polynomial_are_told_apart_by_their_degree():
    x, y = nodes(7)[1:, :, None]
    sizes = sizes_by_degree(7, np.stack([1 + 0 * x, x**3 - 2 * x * y, 1e-3 * y**7]))
    assert (sizes[0, 1:] < 1e-14).all()
    assert (sizes[1, 4:] < 1e-14).all()
    assert sizes[1, 3] > 1e-2
    assert 1e-8 < sizes[2, 7] < sizes[2, 5] < 1e-3
    # the mean of squares over the triangle is theirs together
    points, weights = quadrature(14)
    assert (sizes[1] ** 2).sum() == pytest.approx(
        (weights * (points[0] ** 3 - 2 * points[0] * points[1]) ** 2).sum() * 2
    )


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
    # what a smooth scene leaves far behind need not be known as well
    assert reached.estimate < max(30 * error, accuracy / 5)
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


@pytest.mark.slow
def test_an_estimate_keeps_above_the_error_where_waves_are_hardly_resolved(tmp_path):
    waves = (
        "0.0293*cos(-7.537*x - 3.071*y + 3.451) + 0.0265*cos(-5.896*x + 3.164*y + 4.951)"
        " + 0.0291*cos(-4.545*x - 1.074*y + 1.278) + 0.0320*cos(-3.719*x + 3.918*y + 6.159)"
        " + 0.0247*cos(6.029*x + 2.936*y + 1.009)"
    )
    points = "[[0, 0], [0.4, 0.1], [-0.3, 0.5], [0.6, -0.6], [0, 1]]"
    growing = scene_of(
        "psi = 804.7\np = 0.575",
        a=f"1 + {waves}",
        end=0.06681,
        more=f'outputs = [0.0334]\n[model]\nrheology = "viscous"\n[probes]\npoints = {points}',
    )
    reached = deliver(growing, 3e-2, tmp_path / "run.vtkhdf", "")
    fine = tmp_path / "fine.vtkhdf"
    assert run(growing, Numerics(METHODS["fem-p4-imex4"], 3, 1.0, 1e-5), fine).ok  # good to 6e-4
    error = change(read_run(tmp_path / "run.vtkhdf"), read_run(fine), growing.output_times)
    assert error <= reached.estimate <= 3e-2


@pytest.mark.slow
def test_a_lower_degree_on_half_the_width_need_be_no_better(tmp_path):
    """P7, and P6 on cells of half the width, err by 1.8e-6 both where data start against (2.1f)."""
    scene = drawn(5551212, 4)[3]
    better = tmp_path / "better.vtkhdf"
    assert run(scene, Numerics(METHODS["fem-p8-imex5"], 2, scene.time.end, 1e-6), better).ok  # good to 4e-8
    for asked in (1e-5, 1e-6):
        reached = deliver(scene, asked, tmp_path / "run.vtkhdf", "")
        error = change(read_run(tmp_path / "run.vtkhdf"), read_run(better), scene.output_times)
        assert error < reached.estimate <= asked


@pytest.mark.slow
def test_no_level_makes_longer_steps_than_those_whose_error_was_measured(tmp_path):
    """P7 would take 5 steps where P5 takes 6, and lose a digit in time of which P5 knows nothing."""
    scene, better = drawn(777003, 4)[3], tmp_path / "better.vtkhdf"
    assert run(scene, Numerics(METHODS["fem-p8-imex5"], 2, scene.time.end, 1e-6), better).ok
    reached = deliver(scene, 1e-4, tmp_path / "run.vtkhdf", "")
    assert change(read_run(tmp_path / "run.vtkhdf"), read_run(better), scene.output_times) < reached.estimate


def test_no_level_is_much_larger_than_the_one_before():
    """An accuracy that is missed by a little must not cost a multiple of what was run already."""
    nodes = [4**level.refine * level.method.space**2 for level in LEVELS]
    assert all(1 < larger / smaller < 3 for smaller, larger in pairwise(nodes))


@pytest.mark.slow
def test_steps_are_no_finer_than_the_accuracy_needs(tmp_path):
    """What short waves leave in space is a hundred times what steps leave: levels must not refine both."""
    waves = "0.03*cos(7.5*x + 3.1*y - 3.5) + 0.03*cos(5.9*x - 3.2*y - 5) + 0.03*cos(6*x + 2.9*y + 1)"
    lopsided = scene_of(
        "psi = 804.7\np = 0.575",
        a=f"1 + {waves}",
        end=0.02,
        more='[model]\nrheology = "viscous"\n[probes]\npoints = [[0, 0], [-0.3, 0.5], [0, 1]]',
    )
    reached = deliver(lopsided, 1e-3, tmp_path / "run.vtkhdf", "")
    assert reached.level.rtol >= 3e-5
    assert reached.level.refine == 2
    fine = tmp_path / "fine.vtkhdf"
    assert run(lopsided, Numerics(reached.level.method, 3, 1.0, 1e-6), fine).ok
    error = change(read_run(tmp_path / "run.vtkhdf"), read_run(fine), lopsided.output_times)
    assert error <= reached.estimate <= 1e-3


def test_a_mesh_too_coarse_to_stand_is_no_breakdown_of_the_model(tmp_path, monkeypatch):
    """Coarse levels fold where finer ones do not: that is what the next level is for."""
    failures = iter([Outcome(Ending.TANGLED, "folds")])

    def folding(*given, **more):
        outcome = run(*given, **more)
        return next(failures, outcome)

    monkeypatch.setattr("actin_xcheck.runs.accuracy.run", folding)
    reached = deliver(load_scene("static-decay"), 1e-3, tmp_path / "run.vtkhdf", "")
    assert reached.outcome.ok
    assert reached.estimate <= 1e-3


def test_a_breakdown_is_delivered_as_such(tmp_path):
    scene = scene_of("psi = 7.8e3\np = 0.026", a="1 + 1e-3*cos(x)", end=0.05)
    reached = deliver(scene, 1e-3, tmp_path / "run.vtkhdf", "")
    assert reached.outcome.ending == "singular_dilation"
    assert math.isnan(reached.estimate)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "end"),
    [("fig18-nonuniform-contraction-viscoelastic", 0.01485), ("fig19-protrusions-viscoelastic", 0.09558)],
)
def test_when_a_model_breaks_down_is_known_to_a_thousandth(name, end, tmp_path):
    """Two levels on the same cells, with the same long steps, break down alike 7 and 14 % too late."""
    deliver(load_scene(name), 1e-3, tmp_path / "run.vtkhdf", "")
    assert read_run(tmp_path / "run.vtkhdf").series["time"][-1] == pytest.approx(end, rel=1e-3)


def test_a_growth_rate_is_seen_however_long_steps_could_be(tmp_path):
    """Linear modes are exact in time: of four samples no pair of exponentials is fitted."""
    scene = load_scene("mode-2-cell")
    reached = deliver(scene, 1e-3, tmp_path / "run.vtkhdf", "")
    assert reached.reduction.fidelity is Fidelity.MODAL
    exact = growth_rate(scene.physics, 2, 1)
    assert abs(fitted_rate(scene, read_run(tmp_path / "run.vtkhdf")) - exact) < 1e-3 * abs(exact)


@pytest.mark.parametrize(
    "name", ["transient-0-reference-normal-viscous", "transient-2-irrotational-wall-viscoelastic"]
)
def test_the_growth_of_a_transient_is_delivered_as_accurate_as_asked(name, tmp_path):
    """Its perturbation is a millionth too, and no point of it is looked at."""
    scene = load_scene(name).varied({"probes.points": []})
    reached = deliver(scene, 1e-3, tmp_path / "run.vtkhdf", "")
    most = load(PERTURBATIONS)(scene.physics, scene.expect.transient.m).growth(scene.time.end)
    grown = energy_growth(scene, read_run(tmp_path / "run.vtkhdf"))
    assert abs(grown / most - 1) <= reached.estimate <= 1e-3


def test_a_growth_rate_is_delivered_as_accurate_as_asked(tmp_path):
    """Its mode is a millionth of what steps have a tolerance of."""
    scene = load_scene("mode-11-wall")
    reached = deliver(scene, 1e-3, tmp_path / "run.vtkhdf", "", wanted=Fidelity.FULL)
    rate = fitted_rate(scene, read_run(tmp_path / "run.vtkhdf"))
    exact = growth_rate(scene.physics, 1, 1)
    assert abs(rate - exact) / abs(exact) <= reached.estimate <= 1e-3


def test_volumes_are_refined_until_what_they_state_is_small_enough():
    study = accurate([load_scene("static-decay")], ["fem", "fv"], 1e-3, 0)
    climb, *levels = [task.ask for task in next(study)]
    assert climb.accuracy == 1e-3
    assert [one.numerics.refine for one in levels] == [4, 3, 2]
    ran = Ran("completed", "", 1.0)
    (asked,) = study.send([Climbed("fem-p7-imex5", 1, 3e-5, "completed", "", 1.0), ran, ran, ran])
    assert asked.ask.levels == tuple(levels)
    (finer,) = study.send([StatedError(4e-3, False)])
    assert finer.ask.numerics.refine == 5
    assert finer.ask.numerics.dt == levels[0].numerics.dt / 2
    (asked,) = study.send([ran])
    assert [one.numerics.refine for one in asked.ask.levels] == [5, 4, 3]
    with pytest.raises(StopIteration) as end:
        study.send([StatedError(0.9e-3, False)])
    elements, volumes = end.value.value
    assert [job.numerics.method.name for job, _ in elements] == ["fem-p7-imex5"]
    assert [job for job, _ in volumes] == [finer.ask, *levels[:2]]


def test_volumes_whose_model_ends_are_not_refined_for_ever():
    study = accurate([load_scene("static-decay")], ["fv"], 1e-3, 0)
    ran = Ran("singular_dilation", "", 1.0)
    next(study)
    study.send([ran, ran, ran])
    with pytest.raises(StopIteration):
        study.send([StatedError(math.nan, True)])


@pytest.mark.slow
def test_codes_are_compared_to_an_accuracy(tmp_path):
    """What both state covers the truth, and all that is claimed of theory is held to the accuracy."""
    scene = load_scene("growing-disk")
    report = carry(tmp_path, compare_to(5e-3, [scene], ["fem", "fv"]), name="compare")
    comparison = read_comparison(tmp_path / "compare.h5")
    assert {run.family for run in comparison.runs.values()} == {"fem", "fv"}
    for value in report.values:
        assert value.quantity == "polarity" or value.unsure <= 5e-3
        for code in value.codes if value.theory else ():
            assert abs(code.value - value.theory.value) <= code.uncertainty <= 5e-3 * value.size
    assert all(claim.holds for claim in report.claims if claim.judged)
    exact = [claim for claim in report.claims if claim.kind == "exact" and claim.methods[0].startswith("fem")]
    assert [claim.bound for claim in exact] == [5e-3]
    assert exact[0].command.endswith("compare growing-disk --method fem --accuracy 0.005")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("run static-decay --method fem --accuracy 2", "between 0 and 1"),
        ("run static-decay --method fv-coupled --accuracy 1e-3", "--method fem"),
        ("run static-decay --method fem --accuracy 1e-3 --dt 0.1", "chooses --dt itself"),
        ("run static-decay --method fem-p1-paper --rtol 1e-3", "takes equal steps"),
        ("compare --accuracy 1e-3 --refine 3", "chooses --refine itself"),
        ("compare --accuracy 1e-3 --method fem-p1-imex2", "elements are chosen"),
        ("compare --accuracy 1e-3 --method fv-tpfa", "it declares no order in space"),
        ("compare --accuracy 2", "between 0 and 1"),
    ],
)
def test_mistakes_are_one_line(words, said, tmp_path, command):
    one_line(command(f"{words} --out out.vtkhdf"), said)
    assert not (tmp_path / "out.vtkhdf").exists()
