"""Ripples measured one by one: how each amplitude grows with the radius of a swelling disk."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.model import Array, Closure
from actin_xcheck.runs.march import integrate
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import Scene, load_scene
from actin_xcheck.studies.closures.rims import Rims, mean_radius
from actin_xcheck.theory.ripples import ripple_exponent

BASE = "swelling-disk"

AMPLITUDE = 1e-5
"""Of a ripple: first order to 1e-6 for the largest m, and 1e11 times round-off."""

STEPS, DT = 2, 1e-3
"""So short a time that concentration, which theory leaves out, has none to answer: R changes by 1e-4."""

MODES = (2, 3, 4, 6, 8, 12, 16, 20, 24, 32, 40, 48)
"""Wave numbers; those a rim has nodes for are measured."""


@dataclass(frozen=True)
class Ripples:
    """A measurement that is asked for: every ripple of one method on one mesh.

    Attributes
    ----------
    method, refine : numerics.
    closure : the reading of the rim.
    advancing : whether the rim advances; it retracts where p has the other sign.
    modes : wave numbers.
    """

    method: str
    refine: int
    closure: Closure
    advancing: bool = True
    modes: tuple[int, ...] = MODES

    @property
    def seconds(self) -> float:
        """About what it takes."""
        method = find_method(self.method)
        nodes = 4.0**self.refine * method.space**2
        return len(self.modes) * nodes / 8e3 * method.order_dt * (3 if method.family == "fv" else 1)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """What was measured.

    Attributes
    ----------
    asked : what was asked for.
    nodes : of the rim.
    speed : of the rim, mean over the time.
    modes : wave numbers (n,), each below half the nodes.
    measured, predicted : gamma (n,): the amplitude goes like R^gamma; measured is nan where the run failed.
    messages : why, of each mode; empty where it did not.
    """

    asked: Ripples
    nodes: int
    speed: float
    modes: Array
    measured: Array
    predicted: Array
    messages: tuple[str, ...]

    @property
    def known(self) -> Array:
        """Which rates were measured, (n,) of truth values."""
        return np.isfinite(self.measured)


def rippled(closure: Closure, advancing: bool, m: int) -> Scene:
    """Return the swelling (or shrinking) disk, its rim displaced by a ripple; m = 0 is the disk itself."""
    base, ripple = load_scene(BASE), f"{AMPLITUDE}*r**{m}*cos({m}*theta)"
    changes = {
        "name": f"{BASE}-{m}",
        "model.closure": str(closure),
        "parameters.p": base.parameters.p * (1 if advancing else -1),
        "time": {"end": STEPS * DT},
    }
    if m:
        changes["initial.u"] = [f"{ripple}*cos(theta)", f"{ripple}*sin(theta)"]
    return base.varied(changes, f"{BASE}-{m}")


def measure(asked: Ripples, folder: Path = Path()) -> Spectrum:
    """Run every ripple beside the disk without one and read off how its amplitude grew."""
    bare, trouble = _rims(asked, 0)
    nodes = bare.shape[-1]
    modes = [m for m in asked.modes if m < nodes / 2]
    radius = mean_radius(bare)
    angles = 2 * np.pi * np.arange(nodes) / nodes
    measured, messages = [], []
    for m in modes:
        rim, message = (bare, f"without a ripple: {trouble}") if trouble else _rims(asked, m)
        messages.append(message)
        if message:
            measured.append(np.nan)
            continue
        ripple = np.hypot(*rim.swapaxes(0, 1)) - np.hypot(*bare.swapaxes(0, 1))
        amplitude = ripple @ np.cos(m * angles) * 2 / nodes
        measured.append(np.log(np.abs(amplitude[-1] / amplitude[0])) / np.log(radius[-1] / radius[0]))
    parameters = load_scene(BASE).parameters
    return Spectrum(
        asked=asked,
        nodes=nodes,
        speed=np.nan if trouble else float((radius[-1] - radius[0]) / (STEPS * DT)),
        modes=np.array(modes),
        measured=np.array(measured),
        predicted=np.array([ripple_exponent(asked.closure, parameters, m) for m in modes]),
        messages=tuple(messages),
    )


def _rims(asked: Ripples, m: int) -> tuple[Array, str]:
    """The rim (n_states, 2, n) of a run with the ripple m, and why the run failed; empty where it did not."""
    scene = rippled(asked.closure, asked.advancing, m)
    solver = bind(scene, Numerics(find_method(asked.method), asked.refine, DT))
    rims = Rims(solver)
    with np.errstate(all="ignore"):  # what overflows in a run ends as its Outcome
        outcome = integrate(solver, DT, scene.output_times, rims)
    return np.array(rims.rims), "" if outcome.ok else f"{outcome.ending.replace('_', ' ')}, {outcome.message}"
