"""The term ledger: what dropping a term changes is known exactly where the solution is."""

import h5py
import numpy as np
import pytest
from scipy.special import jv

from actin_xcheck.report.environment import environment
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies import ledger as module
from actin_xcheck.studies.ledger import Entry, in_words, ledger, read, write
from actin_xcheck.studies.ledger_table import ledger_table


def here(work, tasks, report, name):
    """What `work_off` does, in this process."""
    return [work(task, report) for task in tasks]


def of(name, monkeypatch, accuracy=1e-4):
    """The ledger of a scene by the entry that drops each term."""
    monkeypatch.setattr(module, "work_off", here)
    found = ledger(load_scene(name), accuracy, lambda label, done, total: None)
    return {entry.entry: entry for entry in found}


def test_dropping_diffusion_or_reaction_from_a_bessel_mode(monkeypatch):
    """1 + 0.1 J_1(k r) cos theta decays with exp(-(k_a + d k^2) t): d and k_a drop out one at a time."""
    found, k, t = of("static-decay", monkeypatch), 1.8411837813406593, np.array([0.25, 0.5])
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


def test_dropping_the_growth_of_a_growing_disk(monkeypatch):
    """Area pi e^t, total actin pi cosh t; without motion pi and pi."""
    found = of("growing-disk", monkeypatch)
    motion = found['[motion] x = "x0", y = "y0"']
    assert motion.area == pytest.approx(1 - np.exp(-0.5), abs=1e-6)
    assert motion.total_actin == pytest.approx(1 - 1 / np.cosh(0.5), abs=1e-5)
    assert motion.probe_x == pytest.approx(np.exp(0.25) - 1, abs=1e-6)
    assert "the motion is prescribed" in found['[model] rheology = "viscous"'].sentence


@pytest.mark.slow
def test_fig14_needs_all_it_has_and_the_force_balance_costs_most(monkeypatch):
    found = of("fig14-four-fronts", monkeypatch)
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
def test_an_eigenmode_stays_the_whole_scenes_when_its_model_is_changed(monkeypatch):
    """Without ψ there is no such mode; the run starts on it all the same, and leaves it by its amplitude."""
    monkeypatch.setattr(module, "REFINE", 1)
    found = of("mode-11-wall", monkeypatch, 1e-8)["[parameters] psi = 0"]
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


ENTRY = Entry(
    "diffusion", "d Δa", "[parameters] d = 0", 1e-3, 2e-3, 3e-3, 4e-3, 1e-6, 1e-4, 22.0, 0.04, 11.0, 0.02, "",
    "dropping <b>diffusion</b> changes …",
)  # fmt: skip
IDLE = Entry(
    "motion and dilution", "∇·(a v)", "[motion]", 0.0, 0.0, 0.0, 0.0, 1e-6, 1e-4, 22.0, 0.04, np.nan, np.nan,
    "", "exact",
)  # fmt: skip


def test_a_ledger_survives_its_file_and_is_shown_from_it(tmp_path):
    with h5py.File(tmp_path / "l.h5", "w") as file:
        write(file.create_group("ledger"), [ENTRY, IDLE])
    with h5py.File(tmp_path / "l.h5") as file:
        stored = read(file["ledger"])
    assert repr(stored) == repr((ENTRY, IDLE))  # nan differs from itself
    text = '{% from "ledger.html" import ledger %}{{ ledger(table) }}'
    page = environment(tmp_path).from_string(text).render(table=ledger_table(stored))
    for part in (
        "75% of the run",
        "11 steps of 20 ms",
        "3.0e-03",
        "not measured",
        "&lt;b&gt;diffusion",
        "1.0e-06",
    ):
        assert part in page
