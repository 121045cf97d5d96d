"""Rows of the audit: the model (2.1) to (2.6), its scaling (3.1), (3.2), and (5.1)."""

import math
from dataclasses import replace

import numpy as np

from actin_xcheck.core.contract import Motion, Problem
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Closure, Delta, Model, Rheology
from actin_xcheck.core.motion import PrescribedMotion
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.runs.method import FORCE_BALANCE, METHODS, load
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.measures import ROUND_OFF, Triangles, circle, found, rounds_to
from actin_xcheck.studies.audit.theory.sample import lumpy, relative, second_step
from actin_xcheck.theory.modes import Mode

_A, _PHI = np.array([0.2, 0.9, 1.0, 2.8, 5.0]), np.array([-0.4, -0.1, 0.0, 0.3, 1.2])
"""Concentrations and dilations at which constitutive laws are evaluated."""


def _force_balance() -> Finding:
    step = second_step()
    viscous = step.viscosity() @ step.velocity()
    elastic, active = step.elasticity() @ step.displacements()[0], step.force()
    defect = relative(step.free(viscous + elastic - active), active)
    return found(
        Judgement.REPRODUCED,
        f"On a deformed cell of 145 nodes the implementation's velocities leave nodal forces of {defect:.1e} "
        "of the active load, summed from stresses assembled separately in plain numpy.",
        "The four stresses balance at every node in every direction left free; there is no inertia.",
        holds=defect < ROUND_OFF,
        numbers={"unbalanced force": defect},
    )


def _transport() -> Finding:
    """A disk that grows as x = xi (1 + t/2), J = (1 + t/2)^2: (a J)' = J (1 - a) has a closed solution."""
    mesh, end = disk(2, 0.8), 0.5
    stretch = 1 + end / 2
    exact = (stretch**2 - stretch + 0.5 + 0.5 * math.exp(-end)) / stretch**2

    def error(steps: int) -> float:
        motion = PrescribedMotion(mesh.xi, Motion(lambda xi, t: xi * (1 + t / 2), lambda xi, t: xi / 2))
        problem = Problem(Model(Parameters(0.0, 0.0)), lambda xi: np.ones(xi.shape[1]), np.zeros_like)
        solver = load(METHODS["fem-p1-paper"].solver)(problem, mesh, motion)
        state = solver.init()
        for _ in range(steps):
            state, _ = solver.step(state, end / steps)
        return float(np.abs(state.a - exact).max())

    coarse, fine = error(20), error(40)
    return found(
        Judgement.REPRODUCED,
        f"Growing disk x = ξ(1 + t/2), exact a(0.5) = {exact:.6f}: the implementation is off by {coarse:.2e} "
        f"with 20 steps and {fine:.2e} with 40.",
        "The error halves with Δt: dilution by ∇·(aβ) and polymerisation k_a(a_c - a) are those of (2.1b).",
        holds=fine < 0.01 and abs(coarse / fine - 2) < 0.1,
        numbers={"error, 20 steps": coarse, "error, 40 steps": fine},
    )


def _starts_unstrained() -> Finding:
    mesh = disk(2, 0.8)
    moved = {
        closure: float(np.abs(load(FORCE_BALANCE)(Model(Parameters(62.4, 0.26), closure=closure), mesh)
                              .start(mesh.xi) - mesh.xi).max())
        for closure in Closure
    }  # fmt: skip
    worst = max(moved.values())
    return found(
        Judgement.REPRODUCED,
        f"Largest initial displacement over all {len(moved)} closures: {worst:.1e}.",
        "Every run without an initial displacement of its own starts on the unit disk.",
        holds=worst < ROUND_OFF,
        numbers={"largest |u(0)|": worst},
    )


def _starts_from_a0() -> Finding:
    step = second_step()
    state = step.solver.init()
    difference = float(np.abs(state.a - lumpy(step.mesh.xi)).max())
    return found(
        Judgement.REPRODUCED,
        f"Nodal concentrations at t = 0 differ from a0 by {difference:.1e}.",
        "a0 is interpolated on the initial mesh.",
        holds=difference < ROUND_OFF,
        numbers={"difference": difference},
    )


def _rim_moves_along_normal() -> Finding:
    step = second_step()
    rim, xi = step.mesh.rim_nodes, step.mesh.xi[:, step.mesh.rim_nodes]
    v = step.velocity().reshape(2, -1)[:, rim]
    along = (v * xi).sum(axis=0)
    across = float(np.abs(v[1] * xi[0] - v[0] * xi[1]).max() / np.abs(along).max())
    p = step.model.parameters
    kappa = p.mu1 / 2 / (p.mu1 + p.mu2)
    return found(
        Judgement.REPRODUCED,
        f"Rim velocity across the normals of the non-deformed circle: {across:.1e} of that along them. "
        f"Taken along the current normals instead, rim ripples of wave number k grow like {kappa:.3f} V|k|.",
        "β = ω_n is a vector set equal to a normal velocity. Read as B.7 says, normal 'to its non-deformed "
        "position', it is satisfied; the other reading is ill-posed where the rim advances.",
        holds=across < ROUND_OFF,
        numbers={"tangential over normal": across, "ripple growth factor": kappa},
    )


def _stress_free() -> Finding:
    """Net load of f on the rim for a lopsided a, and what the closure makes of the condition."""
    model, (x, n, ds) = Model(Parameters(62.4, 0.26)), circle()
    f = model.active_stress(1 + 0.1 * Mode(1, 1).value(x), np.zeros(x.shape[1]), 1.0)
    net = float((f * n[0]).sum() * ds)
    step = second_step()
    defect = step.viscosity() @ step.velocity() + step.elasticity() @ step.displacements()[0] - step.force()
    free, held = relative(step.free(defect), step.force()), relative(step.held(defect), step.force())
    ones, zeros = np.ones(step.old.x.shape[1]), np.zeros(step.old.x.shape[1])
    rigid = np.array([[*ones, *zeros], [*zeros, *ones], [*-step.old.x[1], *step.old.x[0]]])
    resistance = relative(rigid @ step.viscosity(), step.viscosity())
    return found(
        Judgement.MISPRINT,
        f"For a = 1 + 0.1 w1,1 at ψ = 62.4 the boundary load ∮ f n ds is {net:.3f}, while three rigid motions"
        f" meet no resistance ({resistance:.1e}). With (2.1e) in force the traction along the free direction"
        f" is {free:.1e} of the load, across it {held:.2f}.",
        "σ_v·n = σ_e·n = 0 in both directions would need ∮ f n ds = 0, so (2.1f) alone is singular and"
        " inconsistent, and with (2.1e) it is one condition too many. It holds along the direction (2.1e)"
        " leaves free; n·∇a = 0 stands.",
        holds=abs(net) < ROUND_OFF,
        corrected=free < ROUND_OFF < held and resistance < ROUND_OFF,
        numbers={"net force": net, "free": free, "held": held},
    )


def _contractility() -> Finding:
    model = Model(Parameters(62.4, 0.26))
    by_hand = np.array([62.4 * a * a * math.exp(-a / 1.4) for a in _A])
    difference = relative(model.contractility(_A) - by_hand, by_hand)
    return found(
        Judgement.REPRODUCED,
        f"σ(1) = {by_hand[2]:.6f} at ψ = 62.4; the implementation differs by {difference:.1e} at five a.",
        "The same function to round-off.",
        holds=difference < ROUND_OFF,
        numbers={"relative difference": difference},
    )


def _quadratic_form(moduli: tuple[float, float], elastic: bool) -> float:
    """Relative difference of w^T A v (or B) for linear v, w from |Omega| (first eps:eps + second div div)."""
    step = second_step()
    v, w = np.array([[0.3, -0.2], [0.7, 0.1]]), np.array([[-0.4, 0.9], [0.2, 0.5]])
    corners = step.old.a[step.mesh.triangles]
    at_rest, ahead = (step.balance.assemble(step.old.x, corners, dt).matrix for dt in (0.0, 1.0))
    matrix = ahead - at_rest if elastic else at_rest
    found_power = (w @ step.old.x).T.ravel() @ (matrix @ (v @ step.old.x).T.ravel())
    strains = ((v + v.T) / 2 * (w + w.T) / 2).sum()
    power = step.before.areas.sum() * (moduli[0] * strains + moduli[1] * np.trace(v) * np.trace(w))
    return float(abs(found_power / power - 1))


def _viscous_stress() -> Finding:
    difference = _quadratic_form((2.5, 6.5), elastic=False)
    return found(
        Judgement.REPRODUCED,
        f"The power of σ_v in two linear velocity fields is |Ω|(μ1 ε:ε + μ2 tr tr) to {difference:.1e}.",
        "Shear and bulk viscosity enter as printed.",
        holds=difference < ROUND_OFF,
        numbers={"relative difference": difference},
    )


def _elastic_stress() -> Finding:
    nu = 0.3
    difference = _quadratic_form((1.0, nu / (1 - 2 * nu)), elastic=True)
    E = 1.5
    lame, shear = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    hooke = max(abs(E / (1 + nu) - 2 * shear), abs(E / (1 + nu) * nu / (1 - 2 * nu) - lame))
    return found(
        Judgement.REPRODUCED,
        f"Its two moduli are Hooke's 2G and λ to {hooke:.1e}; the implementation's elastic power agrees to "
        f"{difference:.1e}.",
        "Plane strain, in units of E/(1 + ν) with ν' = ν/(1 - 2ν) = 0.75.",
        holds=max(difference, hooke) < ROUND_OFF,
        numbers={"relative difference": difference},
    )


def _pressure() -> Finding:
    model, worst = Model(Parameters(62.4, 0.26)), 0.0
    for delta in (0.0, 1.0):
        by_hand = [
            0.26 / (1 + phi) * (1 + 2 / math.pi * delta * math.atan(a))
            for a, phi in zip(_A, _PHI, strict=True)
        ]
        worst = max(worst, relative(model.pressure(_A, _PHI, delta) - by_hand, np.array(by_hand)))
    jump = float(
        model.pressure(np.array(1.0), np.array(0.0), 1.0) - model.pressure(np.array(1.0), np.array(0.0), 0)
    )
    return found(
        Judgement.REPRODUCED,
        f"The implementation differs by {worst:.1e} at five (a, φ), δ = 0 and 1; at a = 1, φ = 0, p = 0.26 "
        f"δ adds {jump:.4f}.",
        "The same function to round-off; it is singular where 1 + φ = 0.",
        holds=worst < ROUND_OFF,
        numbers={"relative difference": worst, "jump": jump},
    )


def _ring() -> Finding:
    radius = np.array([0.0, 0.5, 0.8 - 1e-9, 0.8 + 1e-9, 0.9, 1.0])
    model, mesh = Model(Parameters(62.4, 0.26)), disk(3, 0.8)
    delta = model.delta_on_cells(np.array([radius, 0 * radius]))
    misfits = float(np.abs(delta - (radius > 0.8)).sum())
    r = np.hypot(*mesh.xi)[mesh.triangles]
    cut = int(((r.min(axis=0) < 0.8 - 1e-12) & (r.max(axis=0) > 0.8 + 1e-12)).sum())
    return found(
        Judgement.REPRODUCED,
        f"δ at six radii from 0 to 1: {misfits:g} differ from (2.6); triangles cut by |ξ| = 0.8: {cut}.",
        "δ is a function of the initial position, and a line of nodes lies on its jump.",
        holds=misfits == 0 and cut == 0,
        numbers={"differences": misfits, "cut triangles": cut},
    )


def _scaling() -> Finding:
    """Dimensional stresses of (2.2), (2.5) against (3.2) times E/(1 + nu), for a_c = 1 and another."""

    def defect(a_c: float) -> float:
        units = DimensionalParameters(psi=72.0, p=0.3, a_c=a_c)
        scaled = Model(units.non_dimensional()).active_stress(_A, _PHI, 1.0) * units.E / (1 + units.nu)
        a = units.a_c * _A
        sigma = units.psi * a**2 * np.exp(-a / units.a_sat)
        pressure = units.p / (1 + _PHI) * (1 + 2 / np.pi * np.arctan(a))
        return relative(scaled - sigma - pressure, sigma)

    groups = DimensionalParameters(psi=72.0, p=0.3).non_dimensional()
    by_hand = Parameters(
        72.0 * 1.3 / 1.5, 0.3 * 1.3 / 1.5, 0.012 / 0.03, 1.4, 96.15 * 0.03 * 1.3 / 1.5, 250 * 0.03 * 1.3 / 1.5
    )
    names = ("psi", "p", "d", "a_sat", "mu1", "mu2")
    groups_differ = max(abs(getattr(groups, name) / getattr(by_hand, name) - 1) for name in names)
    one, other = defect(1.0), defect(2.0)
    return found(
        Judgement.REPRODUCED,
        f"The six groups agree to {groups_differ:.1e}. Stresses scaled back to dyn/cm² agree to {one:.1e} for"
        f" a_c = 1, and differ by {other:.1e} for a_c = 2.",
        "Exact with Table 1's a_c = 1. For another a_c (3.2) would need arctan(a_c a): the argument of arctan"
        " in (2.5) is not scaled.",
        holds=max(one, groups_differ) < ROUND_OFF,
        numbers={"a_c = 1": one, "a_c = 2": other},
    )


def _scaled_system() -> Finding:
    step = second_step()
    u_old, u_new = step.displacements()
    mechanics = (step.viscosity() + step.dt * step.elasticity()) @ u_new - step.viscosity() @ u_old
    mechanics -= step.dt * step.force()
    d, rate = step.model.parameters.d, step.model.reaction_rate()
    before, after = step.before, step.after
    transport = ((1 + step.dt * rate) * after.mass() + step.dt * d * after.stiffness()) @ step.new.a
    transport -= before.mass() @ step.old.a + step.dt * rate * before.load()
    one = relative(step.free(mechanics), step.dt * step.force())
    other = relative(transport, before.load())
    nu_prime = step.model.parameters.nu_prime
    return found(
        Judgement.REPRODUCED,
        f"One step with ν' = {nu_prime:g}, d = {d:g} and source 1 - a: residuals {one:.1e} (force balance)"
        f" and {other:.1e} (transport) against matrices assembled by hand.",
        "Both equations are solved with these coefficients and no other term.",
        holds=max(one, other) < ROUND_OFF and rounds_to(nu_prime, "0.75"),
        numbers={"force balance": one, "transport": other},
    )


def _membrane() -> Finding:
    mesh, model = disk(3, 0.8), Model(Parameters(38.24, 1.646), delta=Delta.MEMBRANE)
    inside, rim = float(model.delta_on_cells(mesh.centroids).max()), model.delta_on_rim()
    ring = replace(model, delta=Delta.RING)
    none = replace(model, delta=Delta.NONE)
    corners = np.ones(mesh.triangles.shape)
    loads = [
        load(FORCE_BALANCE)(one, mesh).assemble(mesh.xi, corners, 0.0).load for one in (model, ring, none)
    ]
    outward = [float(one.reshape(-1, 2).T.ravel() @ mesh.xi.ravel()) for one in loads]
    grid = Triangles(mesh.xi, mesh.triangles)
    perimeter = float(np.hypot(*(mesh.xi[:, mesh.rim[1]] - mesh.xi[:, mesh.rim[0]])).sum())
    return found(
        Judgement.REPRODUCED,
        f"δ is {inside:g} in all cells and {rim:g} on the rim. The load along ξ at a = 1, p = 1.646 is "
        f"{outward[0]:.3f} (membrane), {outward[1]:.3f} (ring), {outward[2]:.3f} (δ = 0) on a cell of area "
        f"{grid.areas.sum():.3f} and rim {perimeter:.3f}.",
        "As a function (5.1) is zero almost everywhere, so only the boundary integral of f can see it; there "
        "it adds a rim load (p/2) n.",
        holds=inside == 0 and rim == 1 and outward[0] > outward[1] > abs(outward[2]) + 0.1,
        numbers={"membrane": outward[0], "ring": outward[1], "none": outward[2]},
    )


def _remark_2_1() -> Finding:
    """Elastic over viscous force of one step when the displacement restarts at every step."""

    def share(dt: float) -> float:
        step = second_step(Rheology.VISCOUS, dt)
        v = step.velocity()
        return relative(dt * step.elasticity() @ v, step.viscosity() @ v)

    coarse, fine = share(1e-2), share(1e-3)
    step = second_step()
    kept = relative(step.elasticity() @ step.displacements()[0], step.viscosity() @ step.velocity())
    return found(
        Judgement.REPRODUCED,
        "With the displacement counted from the previous position, elastic over viscous force is"
        f" {coarse:.2e} for Δt = 1e-2 and {fine:.2e} for 1e-3; counted from the start it is already"
        f" {kept:.2e} at t = 0.02.",
        "Restarted every step, elasticity vanishes in proportion to Δt, as the remark says. It then vanishes"
        " from (3.3) too, which keeps it: the article analyses the other reading.",
        holds=fine < 1e-3 and abs(coarse / fine - 10) < 1,
        numbers={"Δt = 1e-2": coarse, "Δt = 1e-3": fine, "accumulated": kept},
    )


EQUATIONS: tuple[Row, ...] = (
    Row("eq2.1a", _force_balance),
    Row("eq2.1b", _transport),
    Row("eq2.1c", _starts_unstrained),
    Row("eq2.1d", _starts_from_a0),
    Row(
        "eq2.1e",
        _rim_moves_along_normal,
    ),
    Row("eq2.1f", _stress_free),
    Row("eq2.2", _contractility),
    Row("eq2.3", _viscous_stress),
    Row("eq2.4", _elastic_stress),
    Row("eq2.5", _pressure),
    Row("eq2.6", _ring),
    Row(
        "remark2.1",
        _remark_2_1,
    ),
    Row(
        "eq3.1",
        _scaling,
    ),
    Row(
        "eq3.2",
        _scaled_system,
    ),
    Row("eq5.1", _membrane),
)
