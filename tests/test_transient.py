"""Growth before decay: against theory's rates, itself on finer rays, the schemes' orders, and both codes."""

import numpy as np
import pytest
from scipy.linalg import expm

from actin_xcheck.core.model import Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Fidelity, Parameters
from actin_xcheck.runs.fidelity import Reduction
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.scene.shelf import scene_text
from actin_xcheck.studies import transient as study
from actin_xcheck.studies.study import answered
from actin_xcheck.studies.transient import TransientCase, start_scene
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.verdicts.judge import judge
from fem.linearised import Perturbations, powers
from tests.lab import FEM

WALL, CELL, FREE = Closure.IRROTATIONAL_WALL, Closure.REFERENCE_NORMAL, Closure.TRACTION_FREE


def at(psi, closure=CELL, rheology=Rheology.VISCOELASTIC, p=0.0):
    return Model(Parameters(psi, p), rheology, closure, Delta.NONE)


STABLE = [
    (1, CELL, Rheology.VISCOELASTIC),
    (2, WALL, Rheology.VISCOELASTIC),
    (0, CELL, Rheology.VISCOUS),
]
SCENES = [f"transient-{m}-{closure}-{rheology}" for m, closure, rheology in STABLE]


@pytest.mark.parametrize("closure", [CELL, WALL, FREE])
@pytest.mark.parametrize("rheology", Rheology)
def test_growth_begins_with_its_slope_and_ends_with_theorys_rate(closure, rheology):
    """Between them no energy grows less than the leading mode nor more than the slope allows."""
    model = at(270.0, closure, rheology)
    found = Perturbations(model, 1, 2, 10)
    rate = growth_rate(model, 1, 1).real
    assert found.leading_rate == pytest.approx(rate, rel=1e-6)
    t = np.array([1e-5, 0.05, 0.5, 3.0])
    growth = np.array([found.growth(one) for one in t])
    assert np.all(np.log(growth) >= 2 * rate * t - 1e-8)
    assert np.all(np.log(growth) <= found.initial_slope * t + 1e-8)
    assert np.log(growth[0]) / t[0] == pytest.approx(found.initial_slope, rel=0.01)
    assert np.log(found.growth(3.5) / growth[-1]) / 0.5 == pytest.approx(2 * rate, rel=1e-4)


def test_a_cell_all_of_whose_modes_decay_grows_seventeen_times_first():
    growth = [Perturbations(at(62.4), 1, *ray).growth(0.64) for ray in ((2, 8), (4, 16))]
    assert growth == pytest.approx([17.0383] * 2, rel=1e-5)
    assert Perturbations(at(62.4), 1).leading_rate < 0


def test_no_energy_bounds_what_the_pressure_makes_of_a_free_rim():
    """Each finer ray finds more growth; beside a wall and without pressure there is a limit."""

    def largest(model):
        return np.array([Perturbations(model, 1, 2, degree).growth(3.0) for degree in (8, 16, 24)])

    assert np.all(np.diff(largest(at(62.4, p=0.26))) > 0.2)
    assert at(62.4, p=0.26).rim_sees_dilation
    for model in (at(62.4), at(62.4, WALL, p=0.26), at(62.4, rheology=Rheology.VISCOUS, p=0.26)):
        assert np.ptp(largest(model)) < 1e-4 * largest(model)[0]
        assert not model.rim_sees_dilation


@pytest.mark.parametrize("rheology", Rheology)
@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
def test_steps_have_the_order_of_their_schemes(order, rheology):
    """Of the optimal start after a while, when it is smooth: rough ones are damped, not followed."""
    found = Perturbations(at(62.4, WALL, rheology), 1, 2, 6)
    y = expm(found.generator) @ np.ones(len(found.generator))

    def error(steps):
        dt = 1.0 / steps
        step = found.paper_step(dt) if order == 1 else found.pair_step(dt, order)
        exact = expm(found.generator) @ y
        return np.linalg.norm(np.linalg.matrix_power(step, steps) @ y - exact) / np.linalg.norm(exact)

    steps = {1: 128, 2: 64, 3: 32, 4: 24, 5: 16}[order]
    assert np.log2(error(steps) / error(2 * steps)) == pytest.approx(order, abs=0.3)


def test_powers_of_a_jordan_block_grow_as_far_as_they_do():
    """n 0.9^(n - 1) is largest at n = 9 and 10."""
    step = np.array([[0.9, 1.0], [0.0, 0.9]])
    exact = max(np.linalg.norm(np.linalg.matrix_power(step, n), 2) ** 2 for n in range(1, 40))
    assert powers(step) == pytest.approx((exact, 0.9), rel=1e-6)
    assert powers(1.01 * np.eye(2))[0] == np.inf


def test_a_step_of_one_half_amplifies_what_the_model_damps():
    """With what diffusion takes in a step the number does not depend on the ray."""
    model = at(62.4)
    steps = {ray: Perturbations(model, 1, *ray, over=1.0) for ray in ((2, 6), (2, 10))}
    radii = [powers(found.paper_step(1.0))[1] for found in steps.values()]
    assert radii == pytest.approx([1.7848] * 2, rel=1e-3)
    assert powers(steps[2, 6].pair_step(0.02, 2))[0] < 17.1
    sizes = [np.linalg.norm(found.paper_step(0.2), 2) for found in steps.values()]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-3)


@pytest.mark.parametrize("name", SCENES)
def test_a_shipped_start_is_the_one_that_grows_most(name):
    scene, (m, *_) = load_scene(name), STABLE[SCENES.index(name)]
    end = scene.time.end
    assert (
        start_scene(TransientCase(scene.physics, m), end).split("[initial]")[0]
        == scene_text(name).split("[initial]")[0]
    )
    growth = Perturbations(scene.physics, m).growth
    assert growth(end) >= max(growth(end - 0.02), growth(end + 0.02))


@pytest.mark.parametrize("name", SCENES)
def test_linear_modes_grow_as_far_as_any_can(name, tmp_path):
    """Carried exactly, they leave what frames of quadratic cells make of the energy, a tenth of the bound."""
    scene, path = load_scene(name), tmp_path / "run.vtkhdf"
    run(
        scene, Numerics(METHODS["fem-p2-imex3"], 4, 0.2, reduction=Reduction(Fidelity.MODAL, bound=1.0)), path
    )
    (claim,) = (one for one in judge(scene, {FEM: read_run(path)}) if one.quantity == "energy")
    assert claim.value < 1e-3
    assert claim.verdict == "PASS"


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("method", ["fem-p1-imex2", "fv"])
def test_both_codes_reach_it_within_a_percent(name, method, tmp_path):
    scene, path = load_scene(name), tmp_path / "run.vtkhdf"
    run(scene, Numerics(METHODS[method], 5, 0.02), path)
    (claim,) = (one for one in judge(scene, {method: read_run(path)}) if one.quantity == "energy")
    assert claim.value < 0.01


def test_the_study_says_what_grows_and_what_cannot_be_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "STEPS", np.array([0.01, 1.0]))
    models = [at(62.4), at(62.4, p=0.26)]
    report = answered(
        study.transient(models, [1]), lambda tasks: [task.work(task.ask, tmp_path) for task in tasks]
    )
    assert [path.name for path in tmp_path.iterdir()] == [f"{SCENES[0]}.toml"]
    said = " ".join(report.findings)
    assert "grows 17.04 times" in said
    assert "G is infinite" in said
    assert "article's (B.23) grows for ever from dt = 1 on" in said
    assert [row.psi for row in report.tables["schemes"].rows][::12] == [15.6, 31.2, 46.8, 62.4]
