"""Force balances of two codes held against each other alone: on a moved cell, at one moment, under one load.

No theory, exact solution or reference value has a part in it, and no run: what one code gets wrong, the other
shows.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.contract import Move
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Array, Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.runs.method import FORCE_BALANCE, FV_FORCE_BALANCE
from actin_xcheck.runs.method import load as loaded
from actin_xcheck.runs.numerics import command

METHODS = "fem-p1-imex2", "fv"
"""Of which these are the force balances, among others."""


def stirred(xi: Array, amount: float = 0.1) -> Array:
    """Positions after a smooth displacement that keeps rim points on their rays, (2, N)."""
    x, y = xi
    inner = (1 - x**2 - y**2) * np.array([np.sin(2 * y), np.cos(x)])
    return np.asarray(xi + amount * (xi * (1 + x * y / 2) + inner))


def turned(xi: Array, amount: float = 0.1) -> Array:
    """The same with rim points that slide along the wall, (2, N)."""
    x, y = xi
    inner = (1 - x**2 - y**2) * np.array([np.sin(2 * y), np.cos(x)])
    angle = amount * (1 + x * y / 2)
    return np.asarray(np.cos(angle) * xi + np.sin(angle) * np.array([-y, x]) + amount * inner)


def elsewhere(xi: Array) -> Array:
    """Positions of a stirred and sheared cell that lies off the origin, (2, N)."""
    return np.array([[1.3, 0.35], [-0.1, 0.8]]) @ stirred(xi) + np.array([[0.4], [-0.3]])


def swollen(xi: Array) -> Array:
    """Positions in a disk that has swollen, (2, N)."""
    return 1.2 * xi


def lopsided(xi: Array) -> Array:
    """A concentration without any symmetry, (N,)."""
    return np.asarray(1 + 0.3 * np.sin(2 * xi[0] + 0.5) * np.cos(1.5 * xi[1]))


def uniform(xi: Array) -> Array:
    """A concentration that is the same everywhere, (N,)."""
    return np.full(xi.shape[1], 1.3)


@dataclass(frozen=True, kw_only=True)
class Load:
    """What acts on a moved cell, and how far both codes may be apart.

    Attributes
    ----------
    model : what acts.
    bound : relative, of velocities at refine 4: 1.3 times what is found, which falls with h^2.
    moved : where nodes are.
    a : under what actin.
    carried : whether what the balances carry has a part in it, and its rate.
    """

    model: Model
    bound: float
    moved: Callable[..., Array] = stirred
    a: Callable[[Array], Array] = lopsided
    carried: bool = False


def _loaded(psi: float, p: float, rheology: Rheology, **given: Any) -> Model:
    """A model with no parameter at its value in Table 2."""
    parameters = Parameters(psi, p, d=0.3, a_sat=2.2, mu1=1.8, mu2=4.5, nu=0.15, l0=0.75)
    return Model(parameters, rheology, **given)


_VISCOUS, _ELASTIC = Rheology.VISCOUS, Rheology.VISCOELASTIC
_FREE, _WALL = Closure.TRACTION_FREE, Closure.IRROTATIONAL_WALL

LOADS = {
    "pressure": Load(model=_loaded(0, 1, _VISCOUS), bound=6e-3),
    "contraction": Load(model=_loaded(100, 0, _VISCOUS), bound=7e-3),
    "elasticity": Load(model=_loaded(0, 0, _ELASTIC), bound=1.35e-2),
    "dilation": Load(model=_loaded(0, 0.7, _ELASTIC), bound=1e-2),
    "everything": Load(model=_loaded(50, 1, _ELASTIC), bound=7e-3),
    "the ring": Load(model=_loaded(0, 1, _VISCOUS), bound=4.8e-3, a=uniform),
    "a free cell": Load(model=_loaded(100, 0.3, _VISCOUS, closure=_FREE), bound=1.35e-2, moved=elsewhere),
    "a wall": Load(model=_loaded(0, 0, _ELASTIC, closure=_WALL), bound=1.2e-2, moved=turned),
    "a membrane": Load(model=_loaded(0, 1, _VISCOUS, delta=Delta.MEMBRANE), bound=5.5e-3),
    "a free rim": Load(model=_loaded(0, 4, _ELASTIC, delta=Delta.MEMBRANE), bound=4.8e-3, carried=True),
    # velocities are linear in x, exactly, for both codes and on any mesh
    "a tension": Load(
        model=_loaded(50, 1, _ELASTIC, delta=Delta.MEMBRANE), bound=1e-8, moved=swollen, a=uniform
    ),
}

TORQUE = 7.5e-3
"""The same of the torque on a free cell."""


@dataclass(frozen=True)
class Balanced:
    """The force balances of both codes on one moved cell, with nothing else to hold them.

    Attributes
    ----------
    load : one of `LOADS`.
    refine : of the disk's mesh, at which its bound holds.
    """

    load: str
    refine: int = 4
    bounded: ClassVar[bool] = True  # there are no steps

    @property
    def name(self) -> str:
        """What acts."""
        return f"force balances under {self.load} refine {self.refine}"

    def claims(self, folder: Path) -> list[Claim]:
        """That velocities are the same, and the torque on a free cell."""
        return self.held(self.flow(FORCE_BALANCE), self.flow(FV_FORCE_BALANCE))

    def flow(self, balance: str) -> Move:
        """The second of two steps of a force balance, "module:Class"; the first at rest, with other actin.

        Where what is carried has a part, both are explicit, from the moved cell, under its actin.
        """
        load, dt = LOADS[self.load], 0.02
        mesh = disk(self.refine, load.model.parameters.l0)
        code, x, a = loaded(balance)(load.model, mesh), load.moved(mesh.xi), load.a(mesh.xi)
        if load.carried:
            carried, dt = code.carried(lambda xi: load.moved(xi) - xi), 0.2  # long enough for rates to tell
            for _ in range(2):
                move: Move = code.flow(0.0, x, a[mesh.triangles], carried)
                x, carried = x + dt * move.v, carried + dt * move.carried
            return replace(move, x=move.v)
        for nodes, actin in ((mesh.xi, 0.7 + 0 * a), (x, a)):
            move = code.advance(0.0, dt, nodes, actin[mesh.triangles])
        return replace(move, x=(move.x - x) / dt if move.outcome.ok else np.full_like(x, np.nan))

    def held(self, elements: Move, volumes: Move) -> list[Claim]:
        """The claims of what both came to: `x` is the velocity with which nodes were moved, (2, N)."""
        speed = np.linalg.norm(elements.x) or np.nan  # what does not move is known to nobody
        apart = np.linalg.norm(volumes.x - elements.x) / speed
        claims = [self._claim("velocity", float(apart), LOADS[self.load].bound)]
        if elements.net_torque:
            torque = abs(volumes.net_torque / elements.net_torque - 1)
            claims.append(self._claim("net_torque", torque, TORQUE))
        return claims

    def _claim(self, quantity: str, value: float, bound: float) -> Claim:
        return Claim(
            kind=ClaimKind.AGREEMENT,
            quantity=quantity,
            scene=self.load,
            methods=METHODS,
            statement=f"both force balances give the same {quantity.replace('_', ' ')} (relative)",
            value=value,
            bound=bound,
            command=command("nightly", only=self.name),
            path="",
            note="no run: the second of two steps on a moved cell",
        )
