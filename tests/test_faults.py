"""Negative controls: what the harness calls right must turn red when the code is made wrong."""

import pytest

from actin_xcheck.registry import METHODS
from actin_xcheck.runs import run
from actin_xcheck.scene import load_scene
from actin_xcheck.store import read_run
from actin_xcheck.verdicts import judge
from tests.faults import FAULTS
from tests.lab import FEM, FV

STEPS = {"growing-disk": 50, "fig14-four-fronts": 80, "mode-11-wall": 50}


def verdicts(name, folder, methods=(FEM, FV)):
    """Claims about a scene's runs at a resolution of seconds."""
    scene, runs = load_scene(name), {}
    for method in methods:
        path = folder / f"{method}.vtkhdf"
        run(scene, METHODS[method], 4, scene.time.end / STEPS[name], path)
        runs[method] = read_run(path)
    return judge(scene, runs)


@pytest.mark.parametrize("name", list(STEPS))
def test_without_a_fault_every_claim_holds(name, tmp_path):
    claims = verdicts(name, tmp_path)
    assert len(claims) >= 7
    assert [claim for claim in claims if not claim.holds] == []


@pytest.mark.parametrize("method", [FEM, FV])
@pytest.mark.parametrize(
    ("fault", "name"),
    [
        ("drop the dilution", "growing-disk"),
        ("drop the dilution", "fig14-four-fronts"),
        ("drop the dilution", "mode-11-wall"),
        ("freeze the mesh", "growing-disk"),
        ("freeze the mesh", "fig14-four-fronts"),
        ("freeze the mesh", "mode-11-wall"),
        ("flip the boundary integral of f", "fig14-four-fronts"),
        ("use the old cell volumes", "growing-disk"),
        ("use the old cell volumes", "fig14-four-fronts"),
        ("use the old cell volumes", "mode-11-wall"),
    ],
)
def test_a_fault_turns_a_verdict_red(fault, name, method, tmp_path, monkeypatch):
    FAULTS[fault](monkeypatch)
    failed = [claim.statement for claim in verdicts(name, tmp_path, (method,)) if not claim.holds]
    assert failed, f"nothing caught: {fault}"
