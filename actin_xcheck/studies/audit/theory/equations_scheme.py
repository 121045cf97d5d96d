"""Rows of the audit: the discrete scheme, (B.17) to (B.25), Remarks B.3 and B.4, Algorithm 7.1."""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.mesh import INTERIOR_POINTS, locate
from actin_xcheck.core.model import Array, Rheology
from actin_xcheck.runs.march import step_count
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.measures import ROUND_OFF, found
from actin_xcheck.studies.audit.theory.sample import Step, relative, second_step


def _nodal_basis() -> Finding:
    """Values of all basis functions at all nodes, from the barycentric coordinates of the nodes."""
    mesh = second_step().mesh
    count = mesh.xi.shape[1]
    cells, weights = locate(mesh, mesh.xi)
    values = np.zeros((count, count))
    np.add.at(values, (mesh.triangles[:, cells], np.arange(count)), weights)
    difference = float(np.abs(values - np.eye(count)).max())
    return found(
        Judgement.REPRODUCED,
        f"φ_i(x_j) - δ_ij on {count} nodes: at most {difference:.1e}.",
        "Piecewise linear nodal basis.",
        holds=difference < ROUND_OFF,
        numbers={"difference": difference},
    )


def _expansion() -> Finding:
    """a_h as the implementation hands it to the force balance, at the points of its quadrature."""
    step = second_step()
    corners = step.solver.corners(step.new)
    sums = step.after.at_points(step.new.a)
    difference = relative(INTERIOR_POINTS @ corners - sums, sums)
    linear = 2 + 3 * step.new.x[0] - step.new.x[1]
    exact = relative(step.after.divergence(np.array([linear, linear])) - 2, np.array(2.0))
    return found(
        Judgement.REPRODUCED,
        f"Corner values of a_h and Σ a_i φ_i differ by {difference:.1e}; a linear field's gradient is"
        f" returned to {exact:.1e} on the deformed mesh.",
        "a, u and v are expanded in one basis.",
        holds=max(difference, exact) < ROUND_OFF,
        numbers={"difference": difference, "gradient": exact},
    )


def _transport_property() -> Finding:
    """Barycentric coordinates of particles carried by the P1 velocity, before and after a step."""
    step = second_step()
    start, end = (x[:, step.mesh.triangles] for x in (step.old.x, step.new.x))
    velocity = (end - start) / step.dt
    weights = np.array([0.2, 0.3, 0.5])
    arrived = np.einsum("dcn,c->dn", start + step.dt * velocity, weights)
    sides = np.array([end[:, 1] - end[:, 0], end[:, 2] - end[:, 0]])  # (side, direction, cell)
    there = np.linalg.solve(sides.transpose(2, 1, 0), (arrived - end[:, 0]).T[:, :, None])[:, :, 0]
    drift = float(np.abs(there - weights[1:]).max())
    moved = float(np.abs(end - start).max())
    return found(
        Judgement.REPRODUCED,
        f"Nodes move by up to {moved:.4f}; the basis functions' values at a particle of each triangle change "
        f"by {drift:.1e}.",
        "With a mesh velocity in the same P1 space basis functions are carried along.",
        holds=drift < ROUND_OFF < moved,
        numbers={"drift": drift, "motion": moved},
    )


def _by_component(step: Step, matrix: sp.csr_matrix) -> Array:
    """The implementation's interleaved matrix with all u before all v."""
    count = step.old.x.shape[1]
    order = np.concatenate([2 * np.arange(count), 2 * np.arange(count) + 1])
    return np.asarray(matrix.toarray()[np.ix_(order, order)])


def _implemented(step: Step) -> tuple[Array, Array]:
    """A and B of the implementation on the old configuration, by component."""
    corners = step.old.a[step.mesh.triangles]
    at_rest, ahead = (step.balance.assemble(step.old.x, corners, dt).matrix for dt in (0.0, 1.0))
    return _by_component(step, at_rest), _by_component(step, ahead - at_rest)


def _block_system() -> Finding:
    step = second_step()
    (A, B), count = _implemented(step), step.old.x.shape[1]
    viscosity, elasticity = step.viscosity(), step.elasticity()
    one, other = relative(A - viscosity, viscosity), relative(B - elasticity, elasticity)
    mixed = A[:count, count:]
    swapped = relative(mixed - viscosity[:count, count:].T, mixed)
    return found(
        Judgement.REPRODUCED,
        f"Entries assembled as printed, i the row: A agrees with the implementation to {one:.1e}, B to"
        f" {other:.1e}. With j the row A12 would be off by {swapped:.2f}.",
        "The entries are right with i as the row. The text substitutes φ_j for the test function, which would"
        " make j the row and A12 its transpose.",
        holds=max(one, other) < 1e-10 < swapped,
        numbers={"A": one, "B": other, "A12 transposed": swapped},
    )


def _semi_discrete() -> Finding:
    step = second_step()
    rates = step.viscosity() @ step.velocity()
    residual = rates + step.elasticity() @ step.displacements()[0] - step.force()
    free, held = relative(step.free(residual), step.force()), relative(step.held(residual), step.force())
    return found(
        Judgement.REPRODUCED,
        f"The implementation's dU/dt leaves {free:.1e} of F along free directions, {held:.2f} across the rays"
        " of rim nodes.",
        "A dU/dt + B U = F in every free direction; the rest is the force of the constraint (2.1e).",
        holds=free < ROUND_OFF < held,
        numbers={"free": free, "held": held},
    )


def _symmetric() -> Finding:
    step = second_step()
    A, B = _implemented(step)
    count = step.old.x.shape[1]
    whole = max(relative(matrix - matrix.T, matrix) for matrix in (A, B))
    block = relative(A[:count, count:] - A[:count, count:].T, A[:count, count:])
    least = float(np.linalg.eigvalsh(A).min() / np.abs(A).max())
    return found(
        Judgement.MISPRINT,
        f"Largest |A - Aᵀ|, |B - Bᵀ| relative to the entries: {whole:.1e}; the block A12 alone has"
        f" {block:.2f}. Smallest eigenvalue of A: {least:.1e}.",
        "[A11 A12; A12ᵀ A22] with symmetric A11, A22 is symmetric whatever A12 is: [A] and [B] are symmetric "
        "and positive semi-definite, so that CG would do where the article takes GMRES.",
        holds=whole > 1e-6,
        corrected=whole < ROUND_OFF < block and least > -ROUND_OFF,
        numbers={"whole": whole, "block": block, "smallest eigenvalue": least},
    )


def _transport_matrices() -> Finding:
    """(B.22) at the start of a step too short for diffusion between neighbours to relax within it."""

    def residual(dt: float) -> float:
        step = second_step(dt=dt)
        rate = (step.after.mass() @ step.new.a - step.before.mass() @ step.old.a) / dt
        grid, d = step.before, step.model.parameters.d
        rest = grid.load() - (d * grid.stiffness() + grid.mass()) @ step.old.a
        return relative(rate - rest, grid.load())

    coarse, fine = residual(2e-5), residual(1e-5)
    return found(
        Judgement.REPRODUCED,
        f"With M, K, H assembled by hand the implementation's d(Ma)/dt + (dK + M)a - H at t^n is {coarse:.2e}"
        f" of H for Δt = 2e-5 and {fine:.2e} for 1e-5.",
        "The residual of the semi-discrete equation vanishes in proportion to Δt.",
        holds=fine < 0.01 and abs(coarse / fine - 2) < 0.1,
        numbers={"Δt = 2e-5": coarse, "Δt = 1e-5": fine},
    )


def _force_step() -> Finding:
    step = second_step()
    A, B, F = step.viscosity(), step.elasticity(), step.force()
    old, new = step.displacements()
    explicit = (A + step.dt * B) @ new - A @ old - step.dt * F
    free = relative(step.free(explicit), step.dt * F)
    purely = relative(step.free(A @ new - A @ old - step.dt * (F - B @ old)), step.dt * F)
    return found(
        Judgement.REPRODUCED,
        f"The implementation's U^(n+1) leaves {free:.1e} of ΔtF; with B explicit it would be {purely:.1e}.",
        "Elasticity is implicit, the active load explicit, all on the old configuration.",
        holds=free < ROUND_OFF < purely,
        numbers={"residual": free, "explicit elasticity": purely},
    )


def _transport_step() -> Finding:
    step, (before, after) = second_step(), (second_step().before, second_step().after)
    dt, d = step.dt, step.model.parameters.d
    right = before.mass() @ step.old.a
    left = ((1 + dt) * after.mass() + dt * d * after.stiffness()) @ step.new.a
    printed = relative(left - right - dt * before.load(), before.load())
    on_new = relative(left - right - dt * after.load(), before.load())
    return found(
        Judgement.REPRODUCED,
        f"The implementation's a^(n+1) leaves {printed:.1e} of H; with H on the new mesh it would be"
        f" {on_new:.1e}.",
        "M and K on the new mesh, M a and H on the old one, as printed. Total actin then obeys "
        "(1 + Δt)m^(n+1) = m^n + Δt|Ω^n|.",
        holds=printed < ROUND_OFF < on_new,
        numbers={"residual": printed, "H on the new mesh": on_new},
    )


def _mesh_velocity() -> Finding:
    """(B.24) exactly, and its first order as a derivative: against the velocities at the step's two ends."""

    def lag(dt: float) -> float:
        step = second_step(dt=dt)
        taken = (step.new.x - step.old.x).ravel() / dt
        return relative(taken - step.velocity(), taken)

    step = second_step()
    exact = relative((step.new.x - step.old.x) / step.dt - step.new.v, step.new.v)
    coarse, fine = lag(1e-2), lag(5e-3)
    return found(
        Judgement.REPRODUCED,
        f"(x^(n+1) - x^n)/Δt is the step's velocity to {exact:.1e}; it differs from dU/dt of (B.21) at t^n by"
        f" {coarse:.2e} for Δt = 1e-2 and {fine:.2e} for 5e-3.",
        "A first-order approximation, as stated: halving Δt halves the difference.",
        holds=exact < 1e-10 and abs(coarse / fine - 2) < 0.1,
        numbers={"exact": exact, "Δt = 1e-2": coarse, "Δt = 5e-3": fine},
    )


def _mesh_motion() -> Finding:
    step = second_step()
    old, new = step.displacements()
    moved = (step.new.x - step.old.x).ravel()
    increment = relative(moved - (new - old), moved)
    whole = relative(moved - new, moved)
    return found(
        Judgement.REPRODUCED,
        f"x^(n+1) - x^n is U^(n+1) - U^n to {increment:.1e}; adding U^(n+1) itself would be off by"
        f" {whole:.2f}.",
        "x^(n+1) = x^n + Δt ω_n with ω_n = (U^(n+1) - U^n)/Δt. The text substitutes (B.24) here instead,"
        " which says x^(n+1) = x^(n+1) and leaves ω_n open.",
        holds=increment < ROUND_OFF < whole,
        numbers={"increment": increment, "whole displacement": whole},
    )


def _other_displacement() -> Finding:
    """How far the two readings of the displacement move the cell apart in two steps."""
    kept, restarted = second_step(), second_step(Rheology.VISCOUS)
    apart = relative(kept.new.x - restarted.new.x, kept.new.x - kept.mesh.xi)
    return found(
        Judgement.IN_KIND,
        "After two steps of 0.02 at ψ = 150, p = 0.4, displacements counted from the start and from the"
        f" previous position differ by {apart:.1%} of the motion.",
        "The two definitions give different cells. 'Substantially' has no number, and the earlier article's"
        " own scheme is not stated here.",
        holds=apart > 1e-3,
        numbers={"difference": apart},
    )


def _algorithm() -> Finding:
    force, transport = _force_step(), _transport_step()
    steps = step_count(1.0228e-3, [0.1636])
    ordered = force.judgement is transport.judgement is Judgement.REPRODUCED
    return found(
        Judgement.MISPRINT,
        "Force balance on the old mesh, motion, transport on the new mesh: residuals"
        f" {force.numbers['residual']:.1e} and {transport.numbers['residual']:.1e}. To reach T = 0.1636 with"
        f" Δt = 1.0228e-3 takes {steps} steps; the loop 'n = 1, ..., T_F' is empty for T_F < 1.",
        "The order of operations is the implementation's. The loop must run over n = 0, ..., T_f/Δt - 1: as "
        "printed it counts steps with a time, and its first pass needs U^1, which nothing has computed.",
        holds=ordered and steps == 0,
        corrected=ordered and steps == 160,
        numbers={"steps": steps},
    )


SCHEME: tuple[Row, ...] = (
    Row("eqB.17", _nodal_basis),
    Row("eqB.18", _expansion),
    Row("eqB.19", _transport_property),
    Row("eqB.20", _block_system),
    Row("eqB.21", _semi_discrete),
    Row(
        "remarkB.3",
        _symmetric,
    ),
    Row("eqB.22", _transport_matrices),
    Row("eqB.23a", _force_step),
    Row(
        "eqB.23b",
        _transport_step,
    ),
    Row(
        "eqB.24",
        _mesh_velocity,
    ),
    Row(
        "eqB.25",
        _mesh_motion,
    ),
    Row(
        "remarkB.4",
        _other_displacement,
    ),
    Row(
        "algorithm7.1",
        _algorithm,
    ),
)
