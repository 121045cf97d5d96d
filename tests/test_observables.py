import numpy as np
import pytest

from actin_xcheck.core.mesh import disk, locate
from actin_xcheck.core.observables import area, balance_residual, centroid, jacobian_min, polarity, probe

ANGLE = 2 * np.pi * np.arange(128) / 128
CIRCLE = np.array([np.cos(ANGLE), np.sin(ANGLE)])


@pytest.mark.parametrize("ratio", [1.0, 0.7, 0.05])
def test_polarity_of_an_ellipse_is_its_axis_ratio_wherever_it_lies(ratio):
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    points = 3 * turn @ (CIRCLE * np.array([[1], [ratio]])) + np.array([[5.0], [-2]])
    assert polarity(points) == pytest.approx(ratio, abs=1e-10)


def test_polarity_of_polygons_with_known_smallest_ellipses():
    triangle = np.array([[0, 1, 0], [0, 0, 1.0]])  # Steiner: ratio 1/sqrt 3
    rectangle = np.array([[0, 2, 2, 0], [0, 0, 1, 1.0]])
    assert polarity(triangle) == pytest.approx(1 / np.sqrt(3), abs=1e-9)
    assert polarity(rectangle) == pytest.approx(0.5, abs=1e-9)


def test_polarity_satisfies_the_optimality_conditions_of_the_smallest_ellipse():
    """John's theorem, through an independent multiplicative algorithm for the dual."""
    rng = np.random.default_rng(3)
    points = rng.normal(size=(2, 40)) * np.array([[1], [0.5]])
    lifted, weights = np.vstack([points, np.ones(40)]), np.full(40, 1 / 40)
    for _ in range(20000):
        weights *= np.einsum("ij,ij->j", lifted, np.linalg.solve(lifted * weights @ lifted.T, lifted)) / 3
    mean = points @ weights
    axes = np.linalg.eigvalsh((points * weights) @ points.T - np.outer(mean, mean))
    assert polarity(points) == pytest.approx(np.sqrt(axes[0] / axes[1]), abs=1e-5)


def test_area_centroid_and_jacobian_follow_an_affine_map():
    mesh = disk(3, 0.8)
    matrix, shift = np.array([[1.2, 0.3], [0.1, 0.9]]), np.array([2.0, -1])
    x = matrix @ mesh.xi + shift[:, None]
    det = np.linalg.det(matrix)
    assert area(x, mesh.triangles) == pytest.approx(det * area(mesh.xi, mesh.triangles), rel=1e-13)
    assert np.allclose(centroid(x, mesh.triangles), shift, atol=1e-13)
    assert jacobian_min(mesh, x) == pytest.approx(det, rel=1e-12)


def test_probes_ride_along():
    mesh = disk(3, 0.8)
    cells, weights = locate(mesh, np.array([[0.4, 0.1], [0, -0.7]]))
    x = 2 * mesh.xi + 1
    a, place = probe(mesh.triangles, cells, weights, x[0, mesh.triangles], x)
    assert np.allclose(place, [[1.8, 1], [1.2, -0.4]], atol=1e-13)
    assert np.allclose(a, [1.8, 1.2], atol=1e-13)


def test_balance_residual_is_the_schemes_own():
    before, dt, cell_area = 3.0, 0.1, 3.1
    after = (before + dt * cell_area) / (1 + dt)
    assert balance_residual(dt, 1.0, before, after, cell_area, 0.0) == pytest.approx(0, abs=1e-16)
    assert balance_residual(dt, 1.0, before, after * (1 + 1e-9), cell_area, 0.0) > 1e-10


def test_a_cell_all_but_three_points_of_whose_rim_have_come_together_ends_no_run():
    """Equations singular to the last bit: the polarity is a ratio, or not known."""
    for seed in range(60):
        random = np.random.default_rng(seed)
        points = 10.0 ** random.uniform(-9, -3) * CIRCLE.repeat(2, axis=1)
        points[:, :3] = random.normal(size=(2, 3)) * np.array([[1.0], [10.0 ** random.uniform(-2, 0)]])
        found = polarity(points)
        assert np.isnan(found) or 0 <= found <= 1
