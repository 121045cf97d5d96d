"""Turning the scene turns the result; FEM and FV part by an amount that falls with h."""

import numpy as np
import pytest

from actin_xcheck.core.mesh import signed_areas
from actin_xcheck.scene.scene import load_scene, parse_scene
from tests.lab import FEM, FV, local_orders, play


@pytest.mark.parametrize("method", [FEM, FV])
def test_fig14_turned_by_37_degrees_turns_its_result(method):
    """Data and mesh turned together: the same concentration, positions turned, to 1e-9 at t = 0.05."""
    scene = load_scene("fig14-four-fronts")
    turned = parse_scene(f"{scene.text}\n[domain]\nrotation = 37\n", "turned.toml")
    dt = 1.0228e-3
    one, other = (play(s, method, 4, dt, [0.05]).last for s in (scene, turned))
    angle = np.deg2rad(37)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert np.abs(other.a - one.a).max() < 1e-9
    assert np.abs(other.x - turn @ one.x).max() < 1e-9
    assert np.abs(one.a - 1).max() > 0.01


@pytest.mark.slow
def test_fem_and_fv_part_on_fig14_by_an_amount_of_second_order_in_h():
    """Both march with (B.23b) in time, so the time step drops out of their difference."""
    scene, differences = load_scene("fig14-four-fronts"), []
    for refine in (3, 4, 5):
        fem, fv = (play(scene, method, refine, 0.1636 / 40, [0.1636]) for method in (FEM, FV))
        areas = signed_areas(fem.last.x, fem.solver.mesh.triangles)
        gap = (fem.solver.corners(fem.last) - fv.solver.corners(fv.last)).mean(axis=0)
        differences.append(np.sqrt(areas @ gap**2))
    assert local_orders(differences) == pytest.approx([2, 2], abs=0.2), differences
