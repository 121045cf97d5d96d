"""One code's mechanics made wrong: the other one shows it, without theory, exact values or references."""

from functools import cache
from weakref import WeakKeyDictionary

import numpy as np
import pytest

from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.studies.faults import mechanics
from actin_xcheck.studies.faults.fault import Fault, replaced, unchanged
from fem.force_balance import ForceBalance
from fv.mechanics import FvForceBalance
from tests.test_fv_mechanics import concentration, stirred, turned, uniform

MESH = disk(4, 0.75)
VISCOUS, ELASTIC = Rheology.VISCOUS, Rheology.VISCOELASTIC


def case(psi, p, rheology, moved=stirred, closure=Closure.REFERENCE_NORMAL, **given):
    """A model, where its nodes are, and under what actin it moves after it has moved under another."""
    return Model(Parameters(psi, p, l0=0.75), rheology, closure, **given), moved(MESH.xi, 0.1)


CASES = {
    "pressure": case(0, 1, VISCOUS),
    "contraction": case(100, 0, VISCOUS),
    "elasticity": case(0, 0, ELASTIC),
    "dilution": case(0, 0.7, ELASTIC),
    "a free cell": case(100, 0.3, VISCOUS, closure=Closure.TRACTION_FREE),
    "a wall": case(0, 0, ELASTIC, turned, Closure.IRROTATIONAL_WALL),
    "a membrane": case(0, 1, VISCOUS, delta=Delta.MEMBRANE),
}


def in_the_reference(right, gradient):
    """Of H = (I - G)^-1 - I, the gradient with respect to xi of a displacement with gradient G."""
    stretch = np.linalg.inv(np.eye(2) - np.moveaxis(gradient, -1, 0))
    return right(np.moveaxis(stretch - np.eye(2), 0, -1))


BEFORE = WeakKeyDictionary()


def lagged(right, self, area, a, *arguments):
    before = BEFORE.get(self.faces, a)
    BEFORE[self.faces] = a
    return right(self, area, before, *arguments)


def per_cell(right, cls, ties, diamonds, volumes):
    return right(cls, ties, diamonds, np.full_like(volumes, volumes.mean()))


SLIGHT = (
    Fault(
        "fv-gauge-per-cell",
        "The load of a free cell is balanced by a force per finite volume in place of a force per area.",
        "fv",
        "fv.system:Gauge.of",
        per_cell,
    ),
    Fault(
        "fv-rim-load-lagged",
        "The load on the rim's faces is that of the concentration of the call before.",
        "fv",
        "fv.mechanics:FvForceBalance._on_rim",
        lagged,
    ),
    Fault(
        "fv-dilation-in-reference",
        "The dilation is the divergence of u with respect to ξ in place of x.",
        "fv",
        "fv.mechanics:divergence",
        in_the_reference,
    ),
)
"""Runs of a second, with the uncertainties that `compare` finds for them, do not show these."""

FEM_ONLY = [fault for fault in mechanics.OF_ELEMENTS if fault.target.startswith("fem.")]
SHARED = {"motion-frozen", *(fault.name for fault in mechanics.OF_ELEMENTS if ":Model." in fault.target)}


def velocities(code, model, x):
    """What nodes do in the second of two steps; infinite where a step fails, which is seen too."""
    balance, dt = code(model, MESH), 0.02
    balance.advance(0.0, dt, x, uniform(MESH.xi)[MESH.triangles])
    move = balance.advance(0.0, dt, x, concentration(MESH.xi)[MESH.triangles])
    return (move.x - x) / dt if move.outcome.ok else np.full_like(x, np.inf)


@cache
def right(code, name):
    return velocities(code, *CASES[name])


def apart(name, code, v):
    """Relative difference of velocities to the other code's."""
    other = right(ForceBalance if code is FvForceBalance else FvForceBalance, name)
    return np.linalg.norm(v - other) / np.linalg.norm(other)


@pytest.mark.parametrize("name", CASES)
def test_both_codes_say_the_same(name):
    assert apart(name, FvForceBalance, right(FvForceBalance, name)) < 0.03


@pytest.mark.parametrize("fault", [*mechanics.OF_VOLUMES, *SLIGHT, *FEM_ONLY], ids=lambda fault: fault.name)
def test_a_fault_of_one_code_is_seen_by_the_other(fault):
    """By three times what they differ without it, and by a twentieth at least."""
    code = FvForceBalance if fault.code == "fv" else ForceBalance
    called, found = 0, {}
    for name, (model, x) in CASES.items():
        with replaced(fault.target, fault.wrong) as calls:
            wrong = velocities(code, model, x)
        called += calls.count
        found[name] = apart(name, code, wrong) / max(apart(name, code, right(code, name)), 0.05 / 3)
    assert called
    assert max(found.values()) > 3, found


def test_what_is_no_fault_is_none():
    name = "dilution"
    with replaced("fv.stress:Diamonds.cross", unchanged):
        assert np.array_equal(velocities(FvForceBalance, *CASES[name]), right(FvForceBalance, name))


def test_every_other_fault_of_the_mechanics_is_of_what_both_share():
    assert {fault.name for fault in mechanics.OF_ELEMENTS} == SHARED | {fault.name for fault in FEM_ONLY}
