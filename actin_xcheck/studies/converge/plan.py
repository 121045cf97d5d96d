"""What is refined: one scene by one method on successive levels, one quantity, one truth, one declared order.

With h goes dt ~ h^(order_h/order_dt), so that both parts of the error fall together; dt alone is refined on
one mesh, against the next finer level (Richardson), which leaves the error in space out.  Levels are fixed
and consecutive: none can be picked for its slope.  Of which scenes a method's orders are claimed follows from
their data alone (`verdicts/orders.py`).
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from actin_xcheck.core.model import Delta
from actin_xcheck.runs.method import METHODS, Method
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.stored import Stored
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.verdicts.known import Quantity
from actin_xcheck.verdicts.orders import orders_lost_in_h, why_not

REFINES, FEW_REFINES = (1, 2, 3, 4, 5), (1, 2, 3, 4)
"""Meshes of 16 to 4096 cells; of elements above P4, which come to round-off on 1024."""

FIXED_REFINE = 3
"""The mesh on which dt is refined, above P2 the next coarser one: what it leaves out does not matter."""

FIXED_STEPS = (5, 10, 20, 40, 80, 160)
"""Steps of a dt study over the whole time; 2/5 of them for pairs of order 4 and 5: the rest is round-off."""

COARSEST_STEPS = {1: 1, 2: 8, 3: 8, 4: 2, 5: 2}
"""Steps on the coarsest mesh, by the order in time: a first-order scheme makes four times as many on the next
one, and 256 on the finest; the others are so many that the error in space leads."""

PRINTED = 1e-9
"""Reference values are printed to ten digits."""


CONVERGED = {
    "static-decay": 2,
    "growing-disk": 3,
    "growing-waves": 8,
    "stirred": 2,
    "stirred-static": 2,
    "manufactured-moving": 4,
    "manufactured-static": 4,
    "fitted-ring": 3,
    "fitted-ring-elastic": 2,
    "smooth-fronts": 1,
    "mode-0-cell": 2,
    "fig14-four-fronts": 1,
}
"""Scenes and the highest order of their elements: above it nothing is claimed, or one level takes minutes."""

EXHIBITED = "manufactured-moving"
"""Where the exhibits of what stalls are shown unless they are asked for."""


def moving_their_own(scene: str, named: bool) -> list[str]:
    """Methods that move their own nodes: driven ones repeat their scheme, or stall and are shown once."""
    return [
        one.name
        for one in METHODS.values()
        if (one.driven_by is None and (named or one.space <= CONVERGED[scene]))
        or (scene == EXHIBITED and not one.order_h)
    ]


class Refined(StrEnum):
    """What becomes smaller from level to level."""

    H = "h"
    """The mesh width, and dt with it."""
    DT = "dt"
    """The time step alone."""


class TruthKind(StrEnum):
    """What a number is held against."""

    EXACT = "the exact solution"
    MODE = "the exact mode"
    REFERENCE = "the scene's reference values"
    RICHARDSON = "the next finer level"


@dataclass(frozen=True)
class RefinedLevel:
    """A mesh of 2**refine layers and a number of equal steps."""

    refine: int
    steps: int


@dataclass(frozen=True)
class Refinement:
    """A sequence of levels and what is read off it.

    Attributes
    ----------
    scene : as it is run, see `final`.
    origin : what the user calls the scene.
    method, refined, quantity, truth : what is done.
    levels : coarsest first.
    no_claim : why no order is claimed; empty where one is.
    """

    scene: Scene
    origin: str
    method: Method
    refined: Refined
    quantity: Quantity
    truth: TruthKind
    levels: tuple[RefinedLevel, ...]
    no_claim: str

    @property
    def key(self) -> str:
        """A name of its own."""
        return f"{self.scene.name}--{self.method.name}--{self.refined}--{self.quantity}"

    @property
    def declared(self) -> float:
        """The order of the method, in h as far as the scene lets it come."""
        if self.refined is Refined.DT:
            return self.method.order_dt
        return max(self.method.order_h - orders_lost_in_h(self.scene, self.method.knows_rim), 0)

    @property
    def at_least(self) -> bool:
        """Whether more than the declared order in h holds too: P_k gives numbers of the whole cell to 2 k."""
        return self.refined is Refined.H and self.quantity.is_functional

    @property
    def floor(self) -> float:
        """Errors up to this say nothing."""
        return max(self.quantity.floor, PRINTED if self.truth is TruthKind.REFERENCE else 0.0)

    def steps_of(self, level: RefinedLevel) -> tuple[float, float]:
        """(h, dt) of a level."""
        return 2.0**-level.refine, self.scene.time.end / level.steps

    def run(self, level: RefinedLevel) -> Stored:
        """The run of a level."""
        scene, method = self.scene, self.method
        file = f"runs/{scene.name}--{method.name}--{level.refine}--{level.steps}.vtkhdf"
        _, dt = self.steps_of(level)
        return Stored(scene, Numerics(method, level.refine, dt), file, scene.origin)


def refinements_of(origin: Scene, methods: Sequence[Method]) -> list[Refinement]:
    """Return what is refined of a scene.

    A method that declares order 0 in space is kept to show that it stalls: it is refined in h only, where the
    exact solution is known.
    """
    scene = final(origin)
    return [
        Refinement(
            scene=scene,
            origin=origin.origin,
            method=method,
            refined=refined,
            quantity=quantity,
            truth=truth,
            levels=_levels(scene, method, refined),
            no_claim=why_not(scene, method, quantity),
        )
        for method in methods
        if method.order_h or scene.expect.exact
        for refined in (Refined if method.order_h else (Refined.H,))
        for quantity, truth in _measured(scene, refined)
    ]


def final(scene: Scene) -> Scene:
    """Return the scene without intermediate output times, so that all steps are equal.

    Its origin is where a study puts it, in its folder.  Only reference values at the last of their times are
    kept; where the scene goes on beyond, it ends there.
    Where delta does not jump at the ring, l0 is nothing but a line of nodes: on 1/2 every mesh has it without
    being bent, and is the next coarser one refined.  With another l0 local orders scatter by 0.2.
    """
    changes: dict[str, Any] = {"time.outputs": None}
    if scene.physics.delta is not Delta.RING:
        changes[f"{'dimensional' if scene.dimensional else 'parameters'}.l0"] = 0.5
    if reference := tomllib.loads(scene.text).get("expect", {}).get("reference"):
        last = max(reference["at"], key=lambda at: at["time"])
        changes["expect.reference.at"] = [last]
        changes["expect.reference.bound"] = {
            name: bound
            for name, bound in reference["bound"].items()
            if np.isfinite(last.get(name, np.nan)).any()
        }
        if scene.expect.growth_rate is None:
            changes["time.end"] = last["time"]
    return scene.varied(changes, f"scenes/{scene.name}.toml")


def _measured(scene: Scene, refined: Refined) -> list[tuple[Quantity, TruthKind]]:
    """What is measured, and held against what, for a scene that expects what this one does."""
    expect, found = scene.expect, []
    if refined is Refined.DT:
        if expect.growth_rate:
            return [(Quantity.AMPLITUDE, TruthKind.RICHARDSON)]
        moves = scene.motion is None and (scene.physics.contracts or scene.physics.pressed)
        quantities = (Quantity.CONCENTRATION, *((Quantity.AREA,) if moves else ()))
        return [(quantity, TruthKind.RICHARDSON) for quantity in quantities]
    if expect.exact:
        found.append((Quantity.CONCENTRATION, TruthKind.EXACT))
    if expect.growth_rate:
        found.append((Quantity.GROWTH_RATE, TruthKind.MODE))
    if expect.reference:
        known = expect.reference.bound
        names = [name for name in ("area", "total_actin", "probe_a") if getattr(known, name)]
        found += [(Quantity(name), TruthKind.REFERENCE) for name in names]
    return found or [(Quantity.AREA, TruthKind.RICHARDSON), (Quantity.TOTAL_ACTIN, TruthKind.RICHARDSON)]


def _levels(scene: Scene, method: Method, refined: Refined) -> tuple[RefinedLevel, ...]:
    """The levels of a study, from the method's declared orders alone."""
    if refined is Refined.DT:
        refine = FIXED_REFINE - (method.space > 2)
        return tuple(
            RefinedLevel(refine, steps * 2 // 5 if method.order_dt >= 4 else steps) for steps in FIXED_STEPS
        )
    # an exhibit that stalls takes the steps of the second-order method it would be
    ratio = (method.order_h or 2) / method.order_dt
    first, refines = COARSEST_STEPS[int(method.order_dt)], REFINES if method.space < 5 else FEW_REFINES
    if scene.expect.growth_rate:  # as many samples as its fit needs
        assert scene.mode is not None
        first = max(first, 5 if growth_rate(scene.physics, *scene.mode).imag else 2)
    return tuple(RefinedLevel(n, round(first * 2 ** (ratio * (n - REFINES[0])))) for n in refines)
