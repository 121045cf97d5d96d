"""Everything that a scene can say of the model is said otherwise than by default: both codes answer alike."""

from dataclasses import fields
from functools import cache

import numpy as np
import pytest

from actin_xcheck.core.parameters import Closure, Delta, Parameters, Rheology
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.scene.tables import Switches
from actin_xcheck.studies.compare import DEFAULT_SCENES
from tests.lab import film_of

SCENE = """
name = "every-key"
[parameters]
psi = 20
p = 3.0
[initial]
a = "1.1 + 0.14*x*(3 - r**2) + 0.2*x*y*(2 - r**2)"
[time]
end = 0.2
"""
CHANGED = {
    "parameters.psi": 40,
    "parameters.p": 4.0,
    "parameters.d": 0.1,
    "parameters.a_sat": 2.1,
    "parameters.mu1": 1.5,
    "parameters.mu2": 4.0,
    "parameters.nu": -0.2,
    "parameters.l0": 0.6,
    "model.rheology": "viscous",
    "model.closure": ["traction-free", "irrotational-wall", "current-normal"],
    "model.delta": ["membrane", "none", "full"],
    "model.reaction": False,
}
"""What stands in place of each default."""

CASES = [
    (key, one) for key, given in CHANGED.items() for one in (given if isinstance(given, list) else [given])
]


@cache
def found(method, *changes):
    """Where rim points are at the end, and total actin, by a method on one mesh of the rim."""
    scene = parse_scene(SCENE, "every-key.toml").varied(dict(changes))
    dt = scene.time.end / 8
    film, outcome = film_of(bind(scene, Numerics(METHODS[method], 3, dt)), dt, [scene.time.end])
    assert outcome.ok, outcome
    seen = film.solver.measure(film.last)
    return np.append(seen.rim, seen.total_actin)


@pytest.mark.parametrize(("key", "value"), CASES)
def test_what_is_said_otherwise_changes_both_codes_alike(key, value):
    """What a change of the scene changes is the same for both, to a fifth."""
    one, other = (found(method, (key, value)) - found(method) for method in ("fem-p1-imex2", "fv"))
    size = np.linalg.norm(one)
    assert size > 1e-3
    assert np.linalg.norm(one - other) < 0.2 * size


def test_nothing_is_left_at_its_default():
    parameters = {f"parameters.{field.name}" for field in fields(Parameters)}
    assert set(CHANGED) == parameters | {f"model.{key}" for key in Switches.model_fields}
    for key, every, default in (
        ("model.closure", Closure, Closure.REFERENCE_NORMAL),
        ("model.delta", Delta, Delta.RING),
        ("model.rheology", Rheology, Rheology.VISCOELASTIC),
    ):
        assert {value for one, value in CASES if one == key} == set(every) - {default}
        table, name = key.split(".")
        assert getattr(getattr(parse_scene(SCENE, "every-key.toml"), table), name) == default


def test_the_default_comparison_has_scenes_with_nothing_of_table_2():
    table_2 = {field.name: field.default for field in fields(Parameters) if field.name not in ("psi", "p")}
    off = [
        scene
        for scene in map(load_scene, DEFAULT_SCENES)
        if all(getattr(scene.parameters, name) != value for name, value in table_2.items())
        and scene.parameters.psi
        and scene.parameters.p
    ]
    assert {scene.name for scene in off} == {"tense-cell", "lopsided-cell"}
    assert all(scene.expect.reference for scene in off)
