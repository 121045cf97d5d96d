"""Rows of the audit: quantitative sentences of Sections 2, 3.1 and 3.2, and the steady state."""

from dataclasses import fields

import numpy as np

from actin_xcheck.core.contract import Problem
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Array, Delta, Model, Rheology
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.runs.method import FORCE_BALANCE, METHODS, load
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.figures import linear_model
from actin_xcheck.studies.audit.theory.measures import ROUND_OFF, found
from actin_xcheck.studies.audit.theory.sample import second_step
from actin_xcheck.theory.dispersion import Version, isolated_modes

_CONSTANT = (Delta.NONE, Delta.FULL)


def _motion_ceases() -> Finding:
    """Velocities without active stress: from rest, strained and viscous, strained and viscoelastic."""
    mesh, off = disk(3, 0.8), Parameters(0.0, 0.0)
    corners, strained = np.ones(mesh.triangles.shape), 1.1 * mesh.xi

    def speed(rheology: Rheology, x: Array) -> float:
        balance = load(FORCE_BALANCE)(Model(off, rheology, delta=Delta.NONE), mesh)
        return float(np.abs(balance.velocity(0.0, x, corners)).max())

    rest = speed(Rheology.VISCOELASTIC, mesh.xi)
    viscous, recoil = speed(Rheology.VISCOUS, strained), speed(Rheology.VISCOELASTIC, strained)
    return found(
        Judgement.REPRODUCED,
        f"With ψ = p = 0: |v| = {rest:.1e} from the unstrained disk, {viscous:.1e} from a disk swollen by 10"
        f" % with the displacement restarted, {recoil:.3f} with the displacement kept.",
        "There is no inertia: v is zero as soon as all stresses are. Where the displacement is kept the "
        "elastic force is still on, and the cell recoils.",
        holds=max(rest, viscous) < ROUND_OFF,
        numbers={"rest": rest, "viscous": viscous, "recoil": recoil},
    )


def _saturation() -> Finding:
    model = Model(Parameters(1.0, 0.0))
    a = np.linspace(0.01, 10, 99901)
    peak = float(a[np.argmax(model.contractility(a))])
    return found(
        Judgement.REPRODUCED,
        f"σ(a) is largest at a = {peak:.4f} for a_sat = {model.parameters.a_sat:g}.",
        "σ' = 0 at 2 a_sat. Table 1, Section 3.2 and Remark 5.1 call a_sat itself the saturation"
        " concentration.",
        holds=abs(peak - 2 * model.parameters.a_sat) < 1e-3,
        numbers={"peak": peak},
    )


def _far_from_membrane() -> Finding:
    model = Model(Parameters(62.4, 0.26))
    a, phi = np.linspace(0, 9, 10), np.linspace(-0.5, 1, 10)
    difference = float(np.abs(model.pressure(a, phi, 0.0) * (1 + phi) - 0.26).max())
    return found(
        Judgement.REPRODUCED,
        f"(1 + φ) p(a) differs from p by {difference:.1e} at ten (a, φ) with δ = 0.",
        "Only p/(1 + φ) is left, whatever a is.",
        holds=difference < ROUND_OFF,
        numbers={"difference": difference},
    )


def _pushes_membrane() -> Finding:
    mesh, model = disk(4, 0.8), Model(Parameters(62.4, 0.26))
    corners = np.ones(mesh.triangles.shape)
    v = load(FORCE_BALANCE)(model, mesh).velocity(0.0, mesh.xi, corners)
    rim = mesh.rim_nodes
    outward = float((v[:, rim] * mesh.xi[:, rim]).sum(axis=0).min())
    return found(
        Judgement.REPRODUCED,
        f"At a = 1, u = 0, p = 0.26 the rim moves outwards at {outward:.4f} or more.",
        "The part with arctan a adds to p/(1 + φ) beyond |ξ| = 0.8 and pushes the rim out.",
        holds=outward > 0,
        numbers={"rim speed": outward},
    )


def _equilibrium() -> Finding:
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
    return found(
        Judgement.REPRODUCED,
        f"In one step of 0.01 a uniform a changes by {below:+.5f} from 0.5, {at:+.1e} from 1, {above:+.5f}"
        " from 1.5.",
        "Polymerisation below a_c, depolymerisation above.",
        holds=below > 0 > above and abs(at) < ROUND_OFF,
        numbers={"from 0.5": below, "from 1": at, "from 1.5": above},
    )


def _fewer_parameters() -> Finding:
    before, after = (len(fields(kind)) for kind in (DimensionalParameters, Parameters))
    return found(
        Judgement.REPRODUCED,
        f"{before} dimensional parameters (l0 and L among them) become {after}.",
        "E, k_a, a_c and L are scaled away.",
        holds=after == before - 4,
        numbers={"before": before, "after": after},
    )


def _finite_range() -> Finding:
    sets = [
        isolated_modes(linear_model(62.4, 0.26, delta), version) for delta in _CONSTANT for version in Version
    ]
    growing = {len([mode for mode in modes if mode.k > 0]) for modes in sets}
    return found(
        Judgement.REPRODUCED,
        f"At ψ = 62.4, p = 0.26 the number of non-zero wave numbers with b < 0 is {sorted(growing)} for both"
        " δ, printed and corrected.",
        "Finitely many, since c > 0 there and b grows with k².",
        holds=growing == {1},
        numbers={"modes": max(growing)},
    )


def _literature() -> Finding:
    units = DimensionalParameters(psi=72.0, p=0.3)
    inside = 0.00962 <= units.D_a <= 0.134
    return found(
        Judgement.REPRODUCED,
        f"D_a = {units.D_a:g} cm²/s lies in the range quoted; a_sat = {units.a_sat:g} is "
        f"{units.a_sat / 1.1 - 1:.0%} above the 1.1 quoted.",
        "'Close to those available' for D_a. Table 1 gives the same article as the source of a_sat = 1.4.",
        holds=inside and abs(units.a_sat / 1.1 - 1) < 0.5,
        numbers={"D_a": units.D_a, "a_sat ratio": units.a_sat / 1.1},
    )


def _units() -> Finding:
    """Exponents of (dyn, cm, s) of mu_i k_a (1 + nu)/E, which must vanish."""
    modulus, rate = np.array([1, -2, 0]), np.array([0, 0, -1])
    readings = {"dyn/cm²": [1, -2, 0], "dyn s cm²": [1, 2, 1], "dyn s/cm²": [1, -2, 1]}
    left = {unit: np.array(powers) + rate - modulus for unit, powers in readings.items()}
    text = ", ".join(f"{unit}: {powers.tolist()}" for unit, powers in left.items())
    units = DimensionalParameters(psi=72.0, p=0.3)
    return found(
        Judgement.MISPRINT,
        f"Powers of (dyn, cm, s) left in μ k_a (1 + ν)/E: {text}. μ2/μ1 = {units.mu2 / units.mu1:.2f}.",
        "Only dyn s/cm², as in Table 1, leaves a number. Section 3.2 prints 200 dyn/cm² for a viscosity, "
        "96.15 dyn s cm² for μ1, and 'shear modulus' for the shear viscosity that μ2 exceeds.",
        holds=not left["dyn/cm²"].any() and not left["dyn s cm²"].any(),
        corrected=not left["dyn s/cm²"].any() and units.mu2 > units.mu1,
        numbers={"mu2/mu1": units.mu2 / units.mu1},
    )


def _zero_flux() -> Finding:
    """Which condition keeps actin in the cell: total actin of one step, with (2.1f) natural."""
    step = second_step()
    before, after = step.before, step.after
    balance = float((1 + step.dt) * (after.load() @ step.new.a) - before.load() @ step.old.a)
    gain = step.dt * float(before.areas.sum())
    defect = abs(balance / gain - 1)
    return found(
        Judgement.MISPRINT,
        f"Total actin of a step changes by polymerisation alone (defect {defect:.1e}) although the rim moves:"
        " the flux through it is zero by n·∇a = 0.",
        "The conditions named, zero flux and no stress, are (2.1f); (2.1e) sets the velocity of the rim.",
        holds=False,
        corrected=defect < ROUND_OFF,
        numbers={"defect": defect},
    )


def _steady_state() -> Finding:
    mesh = disk(4, 0.8)
    corners = np.ones(mesh.triangles.shape)
    speeds = {
        delta: float(
            np.abs(
                load(FORCE_BALANCE)(Model(Parameters(62.4, 0.26), delta=delta), mesh).velocity(
                    0.0, mesh.xi, corners
                )
            ).max()
        )
        for delta in Delta
    }
    ring, constant = speeds[Delta.RING], max(speeds[delta] for delta in _CONSTANT)
    return found(
        Judgement.MISPRINT,
        f"At a = 1, u = 0, ψ = 62.4, p = 0.26 the largest |v| is {ring:.4f} with δ of (2.6),"
        f" {speeds[Delta.MEMBRANE]:.4f} with (5.1), {constant:.1e} with δ constant.",
        "With (2.6) the pressure jumps by p/2 at |ξ| = 0.8, an unbalanced traction. a = 1, u = 0 is steady"
        " only where δ is constant or p = 0.",
        holds=ring < 1e-9,
        corrected=constant < 1e-9 < ring,
        numbers={str(delta): speed for delta, speed in speeds.items()},
    )


THEORY_SENTENCES: tuple[Row, ...] = (
    Row(
        "s2-motion-ceases",
        _motion_ceases,
    ),
    Row(
        "s2-saturation",
        _saturation,
    ),
    Row(
        "s2-far",
        _far_from_membrane,
    ),
    Row(
        "s2-pushes",
        _pushes_membrane,
    ),
    Row(
        "s2-equilibrium",
        _equilibrium,
    ),
    Row(
        "s2.1-conditions",
        _zero_flux,
    ),
    Row(
        "s3-parameters",
        _fewer_parameters,
    ),
    Row(
        "s3.2-finite",
        _finite_range,
    ),
    Row(
        "s3.2-literature",
        _literature,
    ),
    Row(
        "s3.2-units",
        _units,
    ),
    Row("s3.3-steady", _steady_state),
)
