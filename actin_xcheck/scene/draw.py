"""Scenes drawn by a seed, over everything that a scene can say, and ever simpler versions of one.

Cells are mild: their data are smooth, and contraction has the time to deform them, not to end the model.
"""

import re
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import asdict
from typing import Any

import numpy as np
import tomli_w

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.parameters import Closure, Delta, DimensionalParameters, Parameters, Rheology
from actin_xcheck.scene.resolve import mode_field
from actin_xcheck.scene.scene import parse_scene

Scene = dict[str, Any]
"""The tables of a scene, as TOML has them."""

STRONGEST = 0.5
"""Of contraction and pressure over viscosity, what acts up to the end."""

SMALL = 1e-6
"""Amplitude of an eigenmode: what is quadratic in it is round-off."""

TRIES = 100
"""Draws until one is a valid scene."""

_CLOSURES = {
    Closure.REFERENCE_NORMAL: 0.5,
    Closure.TRACTION_FREE: 0.25,
    Closure.IRROTATIONAL_WALL: 0.2,
    Closure.CURRENT_NORMAL: 0.05,
}
_PROBES = [[0.02, 0.03], [0.31, 0.17], [-0.52, 0.36], [0.06, -0.83]]
"""On no side of a cell: volumes take the value of one of the cells there."""


def drawn(seed: int, number: int) -> Scene:
    """Return the valid scene of a number in the sequence of a seed."""
    random = np.random.default_rng((seed, number))
    for _ in range(TRIES):
        scene = _Draw(random).scene(f"random-{seed}-{number}")
        if _is_valid(scene):
            return scene
    raise RuntimeError(f"no valid scene in {TRIES} draws of seed {seed}, number {number}")


def read(text: str) -> Scene:
    """Return the tables of a scene's text."""
    return tomllib.loads(text)


def written(scene: Scene) -> str:
    """Return the text of a scene."""
    return tomli_w.dumps(scene)


def _is_valid(scene: Scene) -> bool:
    """Whether tables are those of a scene, with a mode that its cell has."""
    try:
        parsed = parse_scene(written(scene), "drawn")
        if parsed.mode is not None:
            mode_field(parsed, *parsed.mode)
    except UserError:
        return False
    return True


class _Draw:
    """One draw after another from a generator of random numbers."""

    def __init__(self, random: np.random.Generator) -> None:
        self.random = random

    def scene(self, name: str) -> Scene:
        """Draw a scene, which need not be valid."""
        kind = self.random.choice(["coupled", "mode", "prescribed"], p=[0.7, 0.15, 0.15])
        parameters, model = self.parameters(), self.model()
        if kind == "mode":  # the linear theory takes delta constant where p != 0
            model["delta"] = str(self.random.choice([Delta.NONE, Delta.FULL]))
        end = self.end(parameters)
        scene: Scene = {
            "name": name,
            **self.in_units(parameters),
            "model": model,
            "initial": {"a": "1"},
            "time": {"end": end, "outputs": [round(end / 2, 4), end]},
            "probes": {"points": _PROBES},
        }
        if kind == "mode":
            mode = {"m": int(self.random.integers(0, 4)), "n": 1}
            scene["initial"]["eigenmode"] = mode | {"amplitude": SMALL}
            scene["expect"] = {"growth_rate": mode | {"window": [0.0, end], "bound": {"h2": 1.0, "dt": 1.0}}}
            return scene
        scene["initial"]["a"] = self.concentration()
        if kind == "prescribed":
            scene["motion"] = self.motion()
        elif self.perhaps(0.25) and model["closure"] != Closure.IRROTATIONAL_WALL:  # whose rim stays a circle
            scene["initial"]["u"] = [self.wave(0.04), self.wave(0.04)]
        if self.perhaps(0.25):
            scene["source"] = {"a": f"{self.number(0.1, 0.6)}*cos({self.number(1, 5)}*t)*({self.wave(1.0)})"}
        if self.perhaps(0.3):
            scene["domain"] = {"rotation": self.number(-180, 180)}
        return scene

    def perhaps(self, chance: float) -> bool:
        """Draw yes or no."""
        return bool(self.random.random() < chance)

    def number(self, low: float, high: float) -> float:
        """Draw a number, of four digits."""
        return float(f"{self.random.uniform(low, high):.4g}")

    def of_any_size(self, low: float, high: float) -> float:
        """Draw a number whose logarithm is spread evenly."""
        return float(f"{np.exp(self.random.uniform(np.log(low), np.log(high))):.4g}")

    def parameters(self) -> dict[str, float]:
        """Draw every group off its default, or leave some at it."""
        every = {
            "psi": self.of_any_size(5, 400) if self.perhaps(0.9) else 0.0,
            "p": self.number(-2, 2) if self.perhaps(0.75) else 0.0,
            "d": self.of_any_size(0.1, 1),
            "a_sat": self.number(0.7, 3),
            "mu1": self.number(1, 5),
            "mu2": self.number(0, 10),
            "nu": self.number(-0.3, 0.45),
            "l0": self.number(0.5, 0.9),
        }
        kept = self.perhaps(0.3)
        return {key: value for key, value in every.items() if key in ("psi", "p") or not kept}

    def model(self) -> dict[str, Any]:
        """Draw the readings."""
        return {
            "rheology": str(self.random.choice(list(Rheology))),
            "closure": str(self.random.choice(list(_CLOSURES), p=list(_CLOSURES.values()))),
            "delta": str(self.random.choice(list(Delta))),
            "reaction": not self.perhaps(0.2),
        }

    def end(self, parameters: dict[str, float]) -> float:
        """Draw a time within which the forces at a = 1 deform the cell by `STRONGEST` at most."""
        p = Parameters(**parameters)
        slope = p.psi * abs(2 - 1 / p.a_sat) * np.exp(-1 / p.a_sat) + 2 * abs(p.p)
        longest = min(STRONGEST * p.mu / slope * 4, 0.5) if slope else 0.5
        return float(f"{self.random.uniform(0.4, 1.0) * longest:.3g}")

    def in_units(self, parameters: dict[str, float]) -> Scene:
        """The groups as they are, or the same cell in units that are drawn."""
        if self.perhaps(0.8):
            return {"parameters": parameters}
        return {
            "dimensional": _dimensional(parameters, self.of_any_size(1e-4, 1), self.of_any_size(1e-3, 1e2))
        }

    def concentration(self) -> str:
        """Draw a smooth one: even, with mirror lines, axisymmetric or with no symmetry at all."""
        lone = self.perhaps(0.5)
        return " + ".join(["1", *(f"({self.wave(0.15)})" for _ in range(1 if lone else 2))])

    def wave(self, amplitude: float) -> str:
        """Draw a smooth function of the disk with values up to about an amplitude."""
        size = self.number(0.3 * amplitude, amplitude)
        k, x, y = self.number(1, 4), self.number(-0.5, 0.5), self.number(-0.5, 0.5)
        return str(
            self.random.choice(
                [
                    f"{size}*cos({k}*x + {x})*cos({k}*y + {y})",
                    f"{size}*exp(-4*((x - {x})**2 + (y - {y})**2))",
                    f"{size}*(x**2 - y**2)",
                    f"{size}*sin({k}*x)*sin({k}*y)",
                    f"{size}*cos({k}*r**2)",
                    f"{size}*x*(3 - r**2)",
                ]
            )
        )

    def motion(self) -> dict[str, str]:
        """Draw a motion that stretches, shears and bends the disk, and starts where it lies or nearly so."""
        a, b, c = (self.number(-0.3, 0.3) for _ in range(3))
        return {"x": f"x0*(1 + {a}*t) + {b}*sin(2*t)*y0", "y": f"y0*exp({c}*t) + {b}*t*(x0**2 + y0)/2"}


def alike(scene: Scene) -> dict[str, Scene]:
    """Return scenes that differ from a scene by what must not matter, by what that is.

    They are turned by an angle, seen in a mirror on the x axis, and measured in other units.
    """
    random = _Draw(np.random.default_rng([*written(scene).encode()]))
    turned = deepcopy(scene)
    rotation = scene.get("domain", {}).get("rotation", 0.0)
    turned["domain"] = {"rotation": rotation + random.number(-170, 170)}
    same = {"a turn": turned, "a reflection": _reflected(scene)}
    if "parameters" in scene:
        units = _dimensional(scene["parameters"], random.of_any_size(1e-4, 1), random.of_any_size(1e-3, 1e2))
        other = {key: value for key, value in scene.items() if key != "parameters"}
        same["a change of units"] = other | {"dimensional": units}
    return same


def _reflected(scene: Scene) -> Scene:
    """The scene in a mirror on the x axis."""
    mirrored = deepcopy(scene)
    initial = mirrored["initial"]
    initial["a"] = _mirrored(initial["a"])
    if "u" in initial:
        initial["u"] = [_mirrored(initial["u"][0]), f"-({_mirrored(initial['u'][1])})"]
    if "source" in mirrored:
        mirrored["source"]["a"] = _mirrored(mirrored["source"]["a"])
    if "motion" in mirrored:
        motion = mirrored["motion"]
        mirrored["motion"] = {"x": _mirrored(motion["x"]), "y": f"-({_mirrored(motion['y'])})"}
    if "domain" in mirrored:
        mirrored["domain"]["rotation"] *= -1
    mirrored["probes"]["points"] = [[x, -y] for x, y in mirrored["probes"]["points"]]
    return mirrored


def _mirrored(formula: str) -> str:
    """A formula of y, y0 and theta as one of their opposites."""
    return re.sub(r"\b(y0?|theta)\b", r"(-\1)", formula)


def _dimensional(parameters: dict[str, float], length: float, rate: float) -> dict[str, float]:
    """`[dimensional]` of a cell of a length and a rate of polymerisation whose groups (3.1) are given."""
    group, default = Parameters(**parameters), DimensionalParameters(0, 0)
    stress = default.E / (1 + group.nu)
    return {
        "psi": group.psi * stress,
        "p": group.p * stress,
        "E": default.E,
        "nu": group.nu,
        "D_a": group.d * rate * length**2,
        "k_a": rate,
        "a_sat": group.a_sat,
        "mu1": group.mu1 * stress / rate,
        "mu2": group.mu2 * stress / rate,
        "l0": group.l0,
        "L": length,
    }


def until(scene: Scene, end: float) -> Scene:
    """Return the scene as far as an earlier end."""
    last = float(f"{end:.3g}")
    return scene | {"time": {"end": last, "outputs": [last]}}


def simpler(scene: Scene) -> Iterator[Scene]:
    """Return every valid scene that is one step simpler: a table or key left out, or a plainer value."""
    if "dimensional" in scene:
        groups = asdict(parse_scene(written(scene), "drawn").parameters)
        other = {key: value for key, value in scene.items() if key != "dimensional"}
        yield other | {"parameters": groups}
    for place, key, value in _plainer(scene):
        candidate = deepcopy(scene)
        table = candidate
        for name in place:
            table = table[name]
        if value is None:
            del table[key]
        else:
            table[key] = value
        if candidate != scene and _is_valid(candidate):
            yield candidate


def _plainer(scene: Scene) -> Iterator[tuple[tuple[str, ...], str, Any]]:
    """Yield where something can be plainer, and what it can be; None where it can be left out."""
    if "dimensional" in scene:
        yield (), "dimensional", None
    for table in ("source", "domain", "motion"):
        if table in scene:
            yield (), table, None
    if "u" in scene["initial"]:
        yield ("initial",), "u", None
    for key in scene["model"]:
        yield ("model",), key, None
    for key in scene.get("parameters", {}):
        yield ("parameters",), key, 0.0 if key in ("psi", "p") else None
    first, *others = scene["initial"]["a"].split(" + (")
    for kept in range(len(others)):
        yield ("initial",), "a", " + (".join([first, *others[:kept], *others[kept + 1 :]])
    yield ("probes",), "points", scene["probes"]["points"][:1]
    yield (), "time", until(scene, scene["time"]["end"] / 2)["time"]
