"""Deliberate faults: each breaks one thing a moving-cell code must get right."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from actin_xcheck.core.contract import Move
from actin_xcheck.core.motion import PrescribedMotion
from fem.force_balance import ForceBalance
from fem.kernels import CellSample, RimSample
from fem.solver import FemP1Paper
from fv.equations import TransportEquation

Fault = Callable[[pytest.MonkeyPatch], None]


def drop_dilution(patch: pytest.MonkeyPatch) -> None:
    """a div v is lost: the old concentration is carried over without the change of area."""
    transport, system = FemP1Paper._transport, TransportEquation.system

    def fem(self, old, new, dt):
        return transport(self, replace(old, mass=self._mass(new.x)), new, dt)

    def fv(self, dt, a, old_volumes, volumes, two_point, source):
        return system(self, dt, a * volumes / old_volumes, old_volumes, volumes, two_point, source)

    patch.setattr(FemP1Paper, "_transport", fem)
    patch.setattr(TransportEquation, "system", fv)


def freeze_mesh(patch: pytest.MonkeyPatch) -> None:
    """Nodes stay where they are, whatever their velocity."""
    for mechanics in (ForceBalance, PrescribedMotion):
        advance = mechanics.advance

        def frozen(self, t, dt, x, *arguments, advance=advance):
            move = advance(self, t, dt, x, *arguments)
            return Move(x, move.v, move.outcome)

        patch.setattr(mechanics, "advance", frozen)


def flip_rim_integral(patch: pytest.MonkeyPatch) -> None:
    """The boundary integral of f w.n enters with the wrong sign."""
    right = RimSample.normal_load
    patch.setattr(RimSample, "normal_load", lambda sample, f: -right(sample, f))


def use_old_volumes(patch: pytest.MonkeyPatch) -> None:
    """The new balance is struck with the old cell volumes (finite volumes) or the old mass matrix."""
    system, mass = TransportEquation.system, CellSample.mass
    transport = FemP1Paper._transport

    def fv(self, dt, a, old_volumes, volumes, two_point, source):
        return system(self, dt, a, old_volumes, old_volumes, two_point, source)

    def fem(self, old, new, dt):
        stale = self.space.inside.at(old.x)
        with pytest.MonkeyPatch.context() as inner:
            inner.setattr(CellSample, "mass", lambda sample: mass(stale))
            return transport(self, old, new, dt)

    patch.setattr(TransportEquation, "system", fv)
    patch.setattr(FemP1Paper, "_transport", fem)


FAULTS: dict[str, Fault] = {
    "drop the dilution": drop_dilution,
    "freeze the mesh": freeze_mesh,
    "flip the boundary integral of f": flip_rim_integral,
    "use the old cell volumes": use_old_volumes,
}
