"""The term ledger: what dropping a term changes is known exactly where the solution is."""

import numpy as np
import pytest
from scipy.special import jv

from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.chart.ledger import LedgerEntry, in_words, ledger, ledger_sheet, ledger_tasks


def of(name, tmp_path, accuracy=1e-4, **levels):
    """The ledger of a scene by the entry that drops each term."""
    scene = load_scene(name)
    traces = [task.work(task.ask, tmp_path) for task in ledger_tasks(scene, **levels)]
    return {entry.entry: entry for entry in ledger(scene, accuracy, traces)}


def test_dropping_diffusion_or_reaction_from_a_bessel_mode(tmp_path):
    """1 + 0.1 J_1(k r) cos theta decays with exp(-(k_a + d k^2) t): d and k_a drop out one at a time."""
    found, k, t = of("static-decay", tmp_path), 1.8411837813406593, np.array([0.25, 0.5])
    rate = 0.4 * k**2
    whole, top = np.exp(-(1 + rate) * t), 0.1 * jv(1, k)  # at the probe (1, 0)
    diffusion, reaction = found["[parameters] d = 0"], found["[model] reaction = false"]
    assert diffusion.probe_a == pytest.approx(top * np.max(np.exp(-t) - whole), abs=2 * diffusion.resolved)
    assert reaction.probe_a == pytest.approx(
        top * np.max(np.exp(-rate * t) - whole), abs=2 * diffusion.resolved
    )
    assert diffusion.resolved < 1e-5
    assert diffusion.area == diffusion.probe_x == 0
    assert diffusion.total_actin < 1e-13
    assert diffusion.largest == diffusion.probe_a
    assert "the scene needs it" in diffusion.sentence
    assert diffusion.steps > 3
    assert diffusion.step_seconds_without > 0
    for idle in ('[model] rheology = "viscous"', '[motion] x = "x0", y = "y0"'):
        assert found[idle].largest == 0
        assert found[idle].sentence.startswith("exact: ")
        assert "ψ = p = 0" in found[idle].sentence
        assert np.isnan(found[idle].cost)
    assert "[parameters] psi = 0" not in found  # there is no contraction to drop


def test_dropping_the_growth_of_a_growing_disk(tmp_path):
    """Area pi e^t, total actin pi cosh t; without motion pi and pi."""
    found = of("growing-disk", tmp_path)
    motion = found['[motion] x = "x0", y = "y0"']
    assert motion.area == pytest.approx(1 - np.exp(-0.5), abs=1e-6)
    assert motion.total_actin == pytest.approx(1 - 1 / np.cosh(0.5), abs=1e-5)
    assert motion.probe_x == pytest.approx(np.exp(0.25) - 1, abs=1e-6)
    assert "the motion is prescribed" in found['[model] rheology = "viscous"'].sentence


@pytest.mark.slow
def test_fig14_needs_all_it_has_and_the_force_balance_costs_most(tmp_path):
    found = of("fig14-four-fronts", tmp_path)
    assert len(found) == 8
    assert all("the scene needs it" in entry.sentence for entry in found.values())
    costs = {entry: one.cost for entry, one in found.items() if one.steps_without}
    assert max(costs, key=costs.get) == '[motion] x = "x0", y = "y0"'
    whole = next(iter(found.values()))
    assert costs['[motion] x = "x0", y = "y0"'] > 0.3 * whole.steps * whole.step_seconds
    for same_code in ('[model] delta = "none"', '[model] delta = "full"'):
        assert found[same_code].step_seconds_without == pytest.approx(found[same_code].step_seconds, rel=0.2)
    # contraction does what the fronts do: without it the reference's growth of 16 % is pressure's share only
    assert found["[parameters] psi = 0"].area > 0.1


@pytest.mark.slow
def test_an_eigenmode_stays_the_whole_scenes_when_its_model_is_changed(tmp_path):
    """Without ψ there is no such mode; the run starts on it all the same, and leaves it by its amplitude."""
    found = of("mode-11-wall", tmp_path, 1e-8, refine=1)["[parameters] psi = 0"]
    assert 1e-7 < found.probe_a < 1e-5


@pytest.mark.parametrize(
    ("changes", "ending", "resolved", "said"),
    [
        ({"area": 3e-7, "probe_a": 1e-8}, "", 1e-9, "changes the area by 3.0e-07: less than the 1e-05"),
        (
            {"area": 3e-7, "probe_a": 1e-3},
            "",
            1e-9,
            "changes a at the probes by 1.0e-03: more than the 1e-05",
        ),
        ({"area": 3e-7, "probe_a": 1e-8}, "", 1e-4, "exact to 1.0e-04 only: not decided"),
        ({"area": 5e-5, "probe_a": 1e-8}, "", 1e-4, "exact to 1.0e-04 only: not decided"),
        ({"area": 5e-3, "probe_a": 1e-8}, "", 1e-4, "the scene needs it"),
        ({"area": np.nan, "probe_a": np.nan}, "", 1e-4, "not known"),
        ({"area": 1e-9, "probe_a": 1e-9}, "singular_dilation", 1e-9, "ends early (singular dilation)"),
    ],
)
def test_the_sentence_weighs_the_change_against_what_is_asked_and_what_is_known(
    changes, ending, resolved, said
):
    assert said in in_words("diffusion", changes, ending, resolved, 1e-5)


ENTRY = LedgerEntry(
    "diffusion", "d Δa", "[parameters] d = 0", 1e-3, 2e-3, 3e-3, 4e-3, 1e-6, 1e-4, 22.0, 0.04, 11.0, 0.02, "",
    "dropping <b>diffusion</b> changes …",
)  # fmt: skip
IDLE = LedgerEntry(
    "motion and dilution", "∇·(a v)", "[motion]", 0.0, 0.0, 0.0, 0.0, 1e-6, 1e-4, 22.0, 0.04, np.nan, np.nan,
    "", "exact",
)  # fmt: skip


def test_a_ledger_is_shown_in_words():
    sheet = ledger_sheet([ENTRY, IDLE])
    text = "; ".join([sheet.note, *(cell for row in sheet.rows for cell in row)])
    for part in ("75% of the run", "11 steps of 20 ms", "3.0e-03", "not measured", "1.0e-06"):
        assert part in text
