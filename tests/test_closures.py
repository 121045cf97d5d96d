"""Each closure does what its name says, and the force balance what the weak form says."""

import numpy as np
import pytest

from actin_xcheck.core.mesh import Symmetry, disk, sector
from actin_xcheck.core.model import Closure, Delta, Model, Rheology
from actin_xcheck.core.observables import area, centroid
from actin_xcheck.core.parameters import Parameters
from fem.force_balance import ForceBalance

MESH = disk(4, 0.8)
LOPSIDED = 1 + 0.2 * MESH.xi[0] + 0.1 * MESH.xi[1] ** 2


def force_balance(closure, delta=Delta.RING, rheology=Rheology.VISCOELASTIC, p=0.26):
    return ForceBalance(Model(Parameters(62.4, p), rheology, closure, delta), MESH)


def mass_of(balance, x):
    return balance.space.scalars.matrix(balance.space.inside.at(x).mass())


def stretched():
    return MESH.xi * np.array([[1.05], [0.97]]) + 0.02 * MESH.xi[0] * MESH.xi[1]


def test_reference_normal_keeps_rim_points_on_their_rays():
    move = force_balance(Closure.REFERENCE_NORMAL).advance(0, 0.01, MESH.xi, LOPSIDED[MESH.triangles])
    rim = MESH.rim_nodes
    across = MESH.xi[0, rim] * move.v[1, rim] - MESH.xi[1, rim] * move.v[0, rim]
    assert np.abs(across).max() < 1e-14
    assert np.abs(move.v[:, rim]).max() > 1e-3


def test_both_normal_closures_agree_on_the_disk_and_part_on_a_deformed_cell():
    corners = LOPSIDED[MESH.triangles]
    first, second = (force_balance(c) for c in (Closure.REFERENCE_NORMAL, Closure.CURRENT_NORMAL))
    assert np.allclose(first.velocity(0, MESH.xi, corners), second.velocity(0, MESH.xi, corners), atol=1e-13)
    x = stretched()
    difference = first.velocity(0, x, corners) - second.velocity(0, x, corners)
    assert np.abs(difference).max() > 1e-3


def test_traction_free_moves_without_mean_translation_or_rotation_and_reports_its_loads():
    x, corners = stretched(), LOPSIDED[MESH.triangles]
    balance = force_balance(Closure.TRACTION_FREE)
    move = balance.advance(0, 0.01, x, corners)
    mass = mass_of(balance, x)
    arm = x - centroid(x, MESH.triangles)[:, None]
    weights = mass @ np.ones(x.shape[1])
    scale = np.abs(move.v).max() * weights.sum()
    assert np.abs(move.v @ weights).max() < 1e-12 * scale
    assert abs(arm[0] @ mass @ move.v[1] - arm[1] @ mass @ move.v[0]) < 1e-12 * scale
    # the loads are those of the active stress on the rim: the closed integral of f n ds
    load = balance.assemble(x, corners, 0.0).load
    assert move.net_force == pytest.approx((load[0::2].sum(), load[1::2].sum()), rel=1e-12)
    assert abs(move.net_force[0]) > 0.1
    assert abs(move.net_torque) > 1e-4


def test_traction_free_residual_is_the_gauge_load_and_nothing_else():
    """(A + dt B) v = F - (uniform force and torque per area), in every unknown, the pinned ones too."""
    x, corners = stretched(), LOPSIDED[MESH.triangles]
    balance = force_balance(Closure.TRACTION_FREE)
    move = balance.advance(0, 0.01, x, corners)
    system = balance.assemble(x, corners, 0.01)
    load = system.load
    mass = mass_of(balance, x)
    arm = x - centroid(x, MESH.triangles)[:, None]
    gauge = np.zeros((load.size, 3))
    gauge[0::2, 0] = gauge[1::2, 1] = mass @ np.ones(x.shape[1])
    gauge[0::2, 2], gauge[1::2, 2] = -(mass @ arm[1]), mass @ arm[0]
    rest = load - system.matrix @ move.v.T.ravel()
    unexplained = rest - gauge @ np.linalg.lstsq(gauge, rest, rcond=None)[0]
    assert np.abs(unexplained).max() < 1e-11 * np.abs(load).max()


def test_the_wall_holds_and_the_flow_along_it_is_irrotational():
    """v is a gradient for any load here, so its curl tends to zero with h everywhere."""

    def rim_curl(refine):
        mesh = disk(refine, 0.8)
        model = Model(Parameters(62.4, 0.0), closure=Closure.IRROTATIONAL_WALL, delta=Delta.NONE)
        balance = ForceBalance(model, mesh)
        a = 1 + 0.1 * mesh.xi[0] * mesh.xi[1]
        v = balance.velocity(0, mesh.xi, a[mesh.triangles])
        slopes = balance.space.gradients.at(mesh.xi).gradients[:, :, 0]
        gradient = np.einsum("iae,aje->ije", v[:, balance.space.cells], slopes)
        curl = gradient[1, 0] - gradient[0, 1]
        return np.sqrt(np.mean(curl**2)) / np.sqrt(np.mean(gradient**2))

    coarse, fine = rim_curl(3), rim_curl(5)
    assert fine < 0.3 * coarse
    move = force_balance(Closure.IRROTATIONAL_WALL, p=0.0).advance(0, 0.01, MESH.xi, LOPSIDED[MESH.triangles])
    assert np.allclose(np.hypot(*move.x[:, MESH.rim_nodes]), 1, atol=1e-15)


@pytest.mark.parametrize("rheology", list(Rheology))
@pytest.mark.parametrize(("p", "sign"), [(0.433, 1), (-0.433, -1)])
def test_the_ring_expands_for_positive_pressure_and_contracts_for_negative(rheology, p, sign):
    """f jumps at |xi| = l0: the traction there drives the article's uniform expansion and contraction."""
    ones = np.ones((3, MESH.triangles.shape[1]))
    v = force_balance(Closure.REFERENCE_NORMAL, rheology=rheology, p=p).velocity(0, MESH.xi, ones)
    grown = area(MESH.xi + 1e-3 * v, MESH.triangles) - area(MESH.xi, MESH.triangles)
    assert sign * grown > 1e-6


@pytest.mark.parametrize("delta", [Delta.NONE, Delta.FULL])
@pytest.mark.parametrize("closure", list(Closure))
def test_uniform_actin_at_rest_stays_at_rest_where_delta_is_constant(closure, delta):
    """A constant f loads nothing: the volume and the boundary integral must cancel exactly."""
    ones = np.ones((3, MESH.triangles.shape[1]))
    assert np.abs(force_balance(closure, delta).velocity(0, MESH.xi, ones)).max() < 1e-12


def test_membrane_loads_the_rim_alone():
    """Its f differs from `none` by (2/pi) p arctan a on the boundary integral only (5.1)."""
    corners = LOPSIDED[MESH.triangles]
    none, membrane = (
        force_balance(Closure.REFERENCE_NORMAL, delta).assemble(MESH.xi, corners, 0.0).load
        for delta in (Delta.NONE, Delta.MEMBRANE)
    )
    touched = np.flatnonzero(np.abs(membrane - none).reshape(-1, 2).max(axis=1) > 1e-14)
    assert set(touched) == set(MESH.rim_nodes)


def test_a_translated_and_turned_cell_moves_the_same_way():
    """Frame invariance of the instantaneous viscous balance."""
    angle = 0.6
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    balance = force_balance(Closure.TRACTION_FREE, rheology=Rheology.VISCOUS)
    x, corners = stretched(), LOPSIDED[MESH.triangles]
    moved = turn @ x + np.array([[3.0], [-1]])
    assert np.allclose(
        balance.velocity(0, moved, corners), turn @ balance.velocity(0, x, corners), atol=1e-11
    )


def test_a_uniform_contraction_to_two_thirds_is_singular():
    """phi = 2 - tr F^-1 = -1 at F = (2/3) I: reported with its place and time."""
    balance = force_balance(Closure.REFERENCE_NORMAL)
    ones = np.ones((3, MESH.triangles.shape[1]))
    assert balance.advance(0.0, 0.01, 0.67 * MESH.xi, ones).outcome.ok
    outcome = balance.advance(0.5, 0.01, 0.66 * MESH.xi, ones).outcome
    assert outcome.ending == "singular_dilation"
    assert "t = 0.5" in outcome.message


HALF, QUARTER, SIXTH = (Symmetry(mirrors, 0.3) for mirrors in (1, 2, 3))
SECTORS = pytest.mark.parametrize("symmetry", [HALF, QUARTER, SIXTH], ids=["half", "quarter", "sixth"])


@SECTORS
@pytest.mark.parametrize("closure", list(Closure))
def test_nodes_on_a_sectors_sides_slide_along_them(symmetry, closure):
    mesh = sector(3, 0.8, symmetry)
    balance = ForceBalance(Model(Parameters(62.4, 0.26), closure=closure), mesh, 2)
    xi = balance.space.xi
    lopsided = 1 + 0.2 * xi[0] + 0.1 * xi[1] ** 2
    v = balance.velocity(0, xi, lopsided[balance.space.cells])
    tip = np.hypot(*xi) < 1e-12
    for side, on in zip(symmetry.sides.T, symmetry.on_sides(xi), strict=True):
        assert on.sum() == 17
        assert np.abs(side[0] * v[1, on] - side[1] * v[0, on]).max() < 1e-14
        assert np.abs(side @ v[:, on & ~tip]).max() > 1e-3
    inner = ~symmetry.on_sides(xi).any(axis=0)
    across = symmetry.sides[0, 0] * v[1, inner] - symmetry.sides[1, 0] * v[0, inner]
    assert np.abs(across).max() > 1e-3
    assert (np.abs(v[:, tip]).max() == 0) == (symmetry is not HALF)
    if closure is Closure.IRROTATIONAL_WALL:
        assert np.abs(v[:, balance.space.rim_nodes[[0, -1]]]).max() == 0


@SECTORS
@pytest.mark.parametrize("closure", list(Closure))
def test_a_sectors_system_is_definite_and_that_of_its_free_unknowns(symmetry, closure):
    """No rigid motion is left, and a node that stays has no row."""
    balance = ForceBalance(Model(Parameters(62.4, 0.26), closure=closure), sector(2, 0.8, symmetry), 3)
    constraint, x = balance.constraint, balance.space.xi * np.array([[1.05], [1.05]])
    a = 1 + 0.2 * balance.space.xi[0]
    system, weights = balance.assemble(x, a[balance.space.cells], 0.01), constraint.weights(x)
    P, reduced = constraint.prolongation(x), constraint.reduce(weights, system.matrix).toarray()
    scale = np.abs(reduced).max()
    assert np.abs(reduced - P.T @ system.matrix @ P).max() < 1e-13 * scale
    assert constraint.restrict(weights, system.load) == pytest.approx(P.T @ system.load, abs=1e-13 * scale)
    assert np.linalg.eigvalsh(reduced).min() > 1e-3
    assert constraint.parts.shape == (len(reduced),)


def test_a_free_half_carries_half_the_load_along_its_mirror_line():
    """The one rigid motion that is left to a half; a quarter has none and no load to balance."""
    along = 0.2 * (MESH.xi[0] * np.cos(0.3) + MESH.xi[1] * np.sin(0.3))
    whole = force_balance(Closure.TRACTION_FREE).flow(0, MESH.xi, (1 + along)[MESH.triangles])
    for symmetry, share in ((HALF, 0.5), (QUARTER, 0.0)):
        mesh = sector(4, 0.8, symmetry)
        a = 1 + 0.2 * symmetry.sides[:, 0] @ mesh.xi
        balance = ForceBalance(Model(Parameters(62.4, 0.26), closure=Closure.TRACTION_FREE), mesh)
        move = balance.flow(0, mesh.xi, a[mesh.triangles])
        # the meshes are turned against each other by 0.3
        assert move.net_force == pytest.approx(share * np.array(whole.net_force), rel=0.01)
        assert move.net_torque == 0
        rigid, weighted = balance.rigid(mesh.xi)
        assert rigid.shape[1] == 2 * share
        assert np.abs(weighted.T @ move.v.T.ravel()).max(initial=0) < 1e-12
