"""Rows of the audit: the model (2.1) to (2.6), (5.1), scaling (3.1), (3.2), sentences of Section 2, 3."""

import math
from dataclasses import fields, replace

import numpy as np

from actin_xcheck.core.contract import Motion, Problem
from actin_xcheck.core.mesh import Mesh, disk
from actin_xcheck.core.model import Array, Closure, Delta, Model, Rheology
from actin_xcheck.core.motion import PrescribedMotion
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.runs.method import FORCE_BALANCE, METHODS, load
from actin_xcheck.studies.audit import RowAnswer, answer, examines
from actin_xcheck.studies.audit.linear import CONSTANT, VERSIONS, linear_model
from actin_xcheck.studies.audit.sample import (
    ROUND_OFF,
    Triangles,
    circle,
    lumpy,
    relative,
    rounds_to,
    second_step,
)
from actin_xcheck.theory.dispersion import Mode, isolated_modes

_A, _PHI = np.array([0.2, 0.9, 1.0, 2.8, 5.0]), np.array([-0.4, -0.1, 0.0, 0.3, 1.2])
"""Concentrations and dilations at which constitutive laws are evaluated."""


@examines("eq2.1a")
def _force_balance() -> RowAnswer:
    step = second_step()
    viscous = step.viscosity() @ step.velocity()
    elastic, active = step.elasticity() @ step.displacements()[0], step.force()
    defect = relative(step.free(viscous + elastic - active), active)
    return answer(defect < ROUND_OFF, defect=defect)


@examines("eq2.1b")
def _transport() -> RowAnswer:
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
    return answer(fine < 0.01 and abs(coarse / fine - 2) < 0.1, exact=exact, coarse=coarse, fine=fine)


@examines("eq2.1c")
def _starts_unstrained() -> RowAnswer:
    mesh, balance = disk(2, 0.8), load(FORCE_BALANCE)
    models = (Model(Parameters(62.4, 0.26), closure=closure) for closure in Closure)
    moved = [float(np.abs(balance(model, mesh).start(mesh.xi) - mesh.xi).max()) for model in models]
    return answer(max(moved) < ROUND_OFF, count=len(moved), worst=max(moved))


@examines("eq2.1d")
def _starts_from_a0() -> RowAnswer:
    step = second_step()
    difference = float(np.abs(step.solver.init().a - lumpy(step.mesh.xi)).max())
    return answer(difference < ROUND_OFF, difference=difference)


@examines("eq2.1e")
def _rim_moves_along_normal() -> RowAnswer:
    step = second_step()
    rim, xi = step.mesh.rim_nodes, step.mesh.xi[:, step.mesh.rim_nodes]
    v = step.velocity().reshape(2, -1)[:, rim]
    along = (v * xi).sum(axis=0)
    across = float(np.abs(v[1] * xi[0] - v[0] * xi[1]).max() / np.abs(along).max())
    p = step.model.parameters
    kappa = p.mu1 / 2 / (p.mu1 + p.mu2)
    return answer(across < ROUND_OFF, across=across, kappa=kappa)


@examines("eq2.1f")
def _stress_free() -> RowAnswer:
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
    return answer(
        abs(net) < ROUND_OFF,
        corrected=free < ROUND_OFF < held and resistance < ROUND_OFF,
        net=net,
        resistance=resistance,
        free=free,
        held=held,
    )


@examines("eq2.2")
def _contractility() -> RowAnswer:
    model = Model(Parameters(62.4, 0.26))
    by_hand = np.array([62.4 * a * a * math.exp(-a / 1.4) for a in _A])
    difference = relative(model.contractility(_A) - by_hand, by_hand)
    return answer(difference < ROUND_OFF, by_hand=by_hand, difference=difference)


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


@examines("eq2.3")
def _viscous_stress() -> RowAnswer:
    difference = _quadratic_form((2.5, 6.5), elastic=False)
    return answer(difference < ROUND_OFF, difference=difference)


@examines("eq2.4")
def _elastic_stress() -> RowAnswer:
    E, nu = 1.5, 0.3
    difference = _quadratic_form((1.0, nu / (1 - 2 * nu)), elastic=True)
    lame, shear = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    hooke = max(abs(E / (1 + nu) - 2 * shear), abs(E / (1 + nu) * nu / (1 - 2 * nu) - lame))
    return answer(max(difference, hooke) < ROUND_OFF, hooke=hooke, difference=difference)


@examines("eq2.5")
def _pressure() -> RowAnswer:
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
    return answer(worst < ROUND_OFF, worst=worst, jump=jump)


@examines("eq2.6")
def _ring() -> RowAnswer:
    radius = np.array([0.0, 0.5, 0.8 - 1e-9, 0.8 + 1e-9, 0.9, 1.0])
    model, mesh = Model(Parameters(62.4, 0.26)), disk(3, 0.8)
    delta = model.delta_on_cells(np.array([radius, 0 * radius]))
    misfits = float(np.abs(delta - (radius > 0.8)).sum())
    r = np.hypot(*mesh.xi)[mesh.triangles]
    cut = int(((r.min(axis=0) < 0.8 - 1e-12) & (r.max(axis=0) > 0.8 + 1e-12)).sum())
    return answer(misfits == 0 and cut == 0, misfits=misfits, cut=cut)


@examines("s5.1.2-ring")
def _where_delta_jumps() -> RowAnswer:
    radius = np.sqrt(np.array([0.64 - 1e-9, 0.64 + 1e-9, 0.8 - 1e-9, 0.8 + 1e-9]))
    delta = Model(Parameters(38.24, 1.646)).delta_on_cells(np.array([radius, 0 * radius]))
    at_64, at_80 = delta[1] - delta[0], delta[3] - delta[2]
    return answer(at_80 != 0, corrected=at_64 != 0, delta=delta, at_64=at_64, at_80=at_80)


@examines("eq3.1")
def _scaling() -> RowAnswer:
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
    return answer(max(one, groups_differ) < ROUND_OFF, groups_differ=groups_differ, one=one, other=other)


@examines("eq3.2")
def _scaled_system() -> RowAnswer:
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
    return answer(
        max(one, other) < ROUND_OFF and rounds_to(nu_prime, "0.75"),
        nu_prime=nu_prime,
        d=d,
        one=one,
        other=other,
    )


@examines("eq5.1")
def _membrane() -> RowAnswer:
    mesh, model = disk(3, 0.8), Model(Parameters(38.24, 1.646), delta=Delta.MEMBRANE)
    inside, rim = float(model.delta_on_cells(mesh.centroids).max()), model.delta_on_rim()
    corners, balance, outward = np.ones(mesh.triangles.shape), load(FORCE_BALANCE), []
    for delta in (Delta.MEMBRANE, Delta.RING, Delta.NONE):
        system = balance(replace(model, delta=delta), mesh).assemble(mesh.xi, corners, 0.0)
        outward.append(float(system.load.reshape(-1, 2).T.ravel() @ mesh.xi.ravel()))
    perimeter = float(np.hypot(*(mesh.xi[:, mesh.rim[1]] - mesh.xi[:, mesh.rim[0]])).sum())
    return answer(
        inside == 0 and rim == 1 and outward[0] > outward[1] > abs(outward[2]) + 0.1,
        inside=inside,
        rim=rim,
        outward=outward,
        area=Triangles(mesh.xi, mesh.triangles).areas.sum(),
        perimeter=perimeter,
    )


@examines("remark2.1")
def _remark_2_1() -> RowAnswer:
    """Elastic over viscous force of one step when the displacement restarts at every step."""

    def share(dt: float) -> float:
        step = second_step(Rheology.VISCOUS, dt)
        v = step.velocity()
        return relative(dt * step.elasticity() @ v, step.viscosity() @ v)

    coarse, fine = share(1e-2), share(1e-3)
    step = second_step()
    kept = relative(step.elasticity() @ step.displacements()[0], step.viscosity() @ step.velocity())
    return answer(fine < 0.001 and abs(coarse / fine - 10) < 1, coarse=coarse, fine=fine, kept=kept)


@examines("s2-motion-ceases")
def _motion_ceases() -> RowAnswer:
    """Velocities without active stress: from rest, strained and viscous, strained and viscoelastic."""
    mesh, off = disk(3, 0.8), Parameters(0.0, 0.0)
    corners, strained = np.ones(mesh.triangles.shape), 1.1 * mesh.xi

    def speed(rheology: Rheology, x: Array) -> float:
        balance = load(FORCE_BALANCE)(Model(off, rheology, delta=Delta.NONE), mesh)
        return float(np.abs(balance.velocity(0.0, x, corners)).max())

    rest = speed(Rheology.VISCOELASTIC, mesh.xi)
    viscous, recoil = speed(Rheology.VISCOUS, strained), speed(Rheology.VISCOELASTIC, strained)
    return answer(max(rest, viscous) < ROUND_OFF, rest=rest, viscous=viscous, recoil=recoil)


@examines("s2-saturation")
def _saturation() -> RowAnswer:
    model = Model(Parameters(1.0, 0.0))
    a = np.linspace(0.01, 10, 99901)
    peak = float(a[np.argmax(model.contractility(a))])
    return answer(abs(peak - 2 * model.parameters.a_sat) < 0.001, peak=peak, model=model)


@examines("s2-far")
def _far_from_membrane() -> RowAnswer:
    model = Model(Parameters(62.4, 0.26))
    a, phi = np.linspace(0, 9, 10), np.linspace(-0.5, 1, 10)
    difference = float(np.abs(model.pressure(a, phi, 0.0) * (1 + phi) - 0.26).max())
    return answer(difference < ROUND_OFF, difference=difference)


def _at_rest(model: Model, mesh: Mesh) -> Array:
    """Velocities (2, N) at a = 1, u = 0."""
    return np.asarray(load(FORCE_BALANCE)(model, mesh).velocity(0.0, mesh.xi, np.ones(mesh.triangles.shape)))


@examines("s2-pushes")
def _pushes_membrane() -> RowAnswer:
    mesh = disk(4, 0.8)
    v, rim = _at_rest(Model(Parameters(62.4, 0.26)), mesh), mesh.rim_nodes
    outward = float((v[:, rim] * mesh.xi[:, rim]).sum(axis=0).min())
    return answer(outward > 0, outward=outward)


@examines("s2-equilibrium")
def _equilibrium() -> RowAnswer:
    """Sign of k_a (a_c - a) in the implementation, read off one step of a uniform concentration at rest."""

    def change(a0: float) -> float:
        model = Model(Parameters(0.0, 0.0), delta=Delta.NONE)
        mesh = disk(1, 0.8)
        balance = load(FORCE_BALANCE)(model, mesh)
        problem = Problem(model, lambda xi: np.full(xi.shape[1], a0), np.zeros_like)
        solver = load(METHODS["fem-p1-paper"].solver)(problem, mesh, balance)
        state, _ = solver.step(solver.init(), 0.01)
        return float(state.a.mean() - a0)

    below, at, above = (change(a0) for a0 in (0.5, 1.0, 1.5))
    return answer(below > 0 > above and abs(at) < ROUND_OFF, below=below, at=at, above=above)


@examines("s3-parameters")
def _fewer_parameters() -> RowAnswer:
    before, after = (len(fields(kind)) for kind in (DimensionalParameters, Parameters))
    return answer(after == before - 4, before=before, after=after)


@examines("s3.2-finite")
def _finite_range() -> RowAnswer:
    sets = [isolated_modes(linear_model(62.4, 0.26, delta), version) for delta, version in VERSIONS]
    growing = {len([mode for mode in modes if mode.k > 0]) for modes in sets}
    return answer(growing == {1}, which=str(sorted(growing)), most=max(growing))


@examines("s3.2-literature")
def _literature() -> RowAnswer:
    units = DimensionalParameters(psi=72.0, p=0.3)
    inside, ratio = 0.00962 <= units.D_a <= 0.134, units.a_sat / 1.1
    return answer(inside and abs(ratio - 1) < 0.5, units=units, above=ratio - 1, ratio=ratio)


@examines("s3.2-units")
def _units() -> RowAnswer:
    """Exponents of (dyn, cm, s) of mu_i k_a (1 + nu)/E, which must vanish."""
    modulus, rate = np.array([1, -2, 0]), np.array([0, 0, -1])
    readings = {"dyn/cm²": [1, -2, 0], "dyn s cm²": [1, 2, 1], "dyn s/cm²": [1, -2, 1]}
    left = {unit: np.array(powers) + rate - modulus for unit, powers in readings.items()}
    units = DimensionalParameters(psi=72.0, p=0.3)
    return answer(
        not left["dyn/cm²"].any() and not left["dyn s cm²"].any(),
        corrected=not left["dyn s/cm²"].any() and units.mu2 > units.mu1,
        left={unit: powers.tolist() for unit, powers in left.items()},
        ratio=units.mu2 / units.mu1,
    )


@examines("s2.1-conditions")
def _zero_flux() -> RowAnswer:
    """Which condition keeps actin in the cell: total actin of one step, with (2.1f) natural."""
    step = second_step()
    before, after = step.before, step.after
    balance = float((1 + step.dt) * (after.load() @ step.new.a) - before.load() @ step.old.a)
    gain = step.dt * float(before.areas.sum())
    defect = abs(balance / gain - 1)
    return answer(False, corrected=defect < ROUND_OFF, defect=defect)


@examines("s3.3-steady")
def _steady_state() -> RowAnswer:
    mesh = disk(4, 0.8)
    models = {str(delta): Model(Parameters(62.4, 0.26), delta=delta) for delta in Delta}
    speeds = {delta: float(np.abs(_at_rest(model, mesh)).max()) for delta, model in models.items()}
    ring, constant = speeds[Delta.RING], max(speeds[delta] for delta in CONSTANT)
    return answer(ring < 1e-9, corrected=constant < 1e-9 < ring, speeds=speeds, constant=constant)
