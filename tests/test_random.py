"""Scenes drawn by a seed: valid, of every kind, and a miss is made as simple as it can be."""

from collections import Counter
from dataclasses import asdict
from pathlib import Path

import pytest

from actin_xcheck.core.claim import ClaimKind
from actin_xcheck.core.parameters import Closure, Delta, Rheology
from actin_xcheck.scene import draw
from actin_xcheck.scene.scene import parse_scene
from actin_xcheck.studies import random_scenes as random_module
from actin_xcheck.studies.faults import find_faults
from actin_xcheck.studies.faults.fault import replaced
from actin_xcheck.studies.random_scenes import DrawnScene, OfTheDate, check, random_scenes
from actin_xcheck.studies.study import answered
from tests.small import checked

SEED = 3


def question(number: int) -> DrawnScene:
    return DrawnScene(draw.written(draw.drawn(SEED, number)), f"random-{SEED}-{number}")


def test_a_seed_draws_every_kind_of_scene_again():
    seen: Counter[str] = Counter()
    for number in range(60):
        tables = draw.drawn(SEED, number)
        assert tables == draw.drawn(SEED, number)
        scene = parse_scene(draw.written(tables), "drawn")
        seen.update(map(str, (scene.model.rheology, scene.model.closure, f"delta {scene.model.delta}")))
        seen.update(key for key in ("dimensional", "source", "motion", "domain") if key in tables)
        seen.update(key for key in ("u", "eigenmode") if key in tables["initial"])
        seen.update(["no reaction"] * (not scene.model.reaction))
    kinds = {*Rheology, *Closure, *(f"delta {one}" for one in Delta)}
    kinds |= {"dimensional", "source", "motion", "domain", "u", "eigenmode", "no reaction"}
    assert kinds <= set(seen)


def test_what_is_alike_is_the_same_cell():
    tables = draw.drawn(SEED, 0) | {"parameters": {"psi": 30.0, "p": 1.5, "nu": -0.2, "l0": 0.6}}
    tables.pop("dimensional", None)
    scenes = {what: parse_scene(draw.written(one), what) for what, one in draw.alike(tables).items()}
    assert set(scenes) == {"a turn", "a reflection", "a change of units"}
    groups = parse_scene(draw.written(tables), "drawn").parameters
    assert asdict(scenes["a change of units"].parameters) == pytest.approx(asdict(groups), rel=1e-14)
    x, y = 0.3, -0.4
    own = parse_scene(draw.written(tables), "drawn").initial.a
    mirrored = scenes["a reflection"].initial.a
    at = {"x": x, "y": y, "r": 0.5, "theta": 0.0}
    assert mirrored(**at) == pytest.approx(own(**(at | {"y": -y})), rel=1e-14)


def test_simpler_scenes_are_valid_and_come_to_an_end():
    scene = draw.drawn(SEED, 1)
    for _ in range(40):
        shorter = scene["time"]["end"]
        scene = next(one for one in draw.simpler(scene))
        parse_scene(draw.written(scene), "simpler")
        if scene["time"]["end"] < shorter:  # nothing else is left
            break
    assert set(scene) <= {"name", "parameters", "model", "initial", "time", "probes", "expect"}
    assert scene["model"] == {}
    assert scene["initial"]["a"] == "1"


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1, 2])
def test_the_codes_agree_on_scenes_that_nobody_chose(number: int, tmp_path: Path):
    found = check(question(number), tmp_path)
    assert not found.misses, found.worst.sentence
    kinds = {claim.kind for claim in found.claims}
    assert kinds >= {ClaimKind.ENDS, ClaimKind.CONSERVATION, ClaimKind.TRIANGLE, ClaimKind.INVARIANCE}


@pytest.mark.slow
def test_a_cell_is_left_before_its_pressure_all_but_breaks_down():
    """From t = 0.0466 on it is a few 1e-4 from 1 + phi = 0 by elements, on either side by volumes."""
    text = draw.written(draw.drawn(20411203, 169))
    ends = [parse_scene(one, "drawn").time.end for one in (text, random_module._lasting(text))]
    assert ends[0] == 0.0485
    assert 0.04 < 2 * ends[1] < 0.047


@pytest.mark.slow
def test_a_fault_of_one_code_is_a_miss(tmp_path: Path):
    (fault,) = find_faults(["fv-diffusivity-wrong"])
    with replaced(fault.target, fault.wrong):
        assert check(question(0), tmp_path).misses


@pytest.mark.slow
def test_a_miss_is_made_as_simple_as_it_can_be():
    asked: list[DrawnScene] = []

    def answers(tasks):
        asked.extend(task.ask for task in tasks)
        return [checked(task.ask, Path()) for task in tasks]

    report = answered(random_scenes(SEED, 6), answers)
    missed = [row.name for row in report.tables["scenes"].rows if row.misses]
    assert 0 < len(missed) < 6
    assert [claim.holds for claim in report.claims] == [
        row.name not in missed for row in report.tables["scenes"].rows
    ]
    assert len(report.findings) == len(missed)
    assert report.command == f"python -m actin_xcheck random --seed {SEED} --count 6 --first 0"
    last = parse_scene(asked[-1].scene, "the simplest")
    assert last.parameters.p > 0
    assert last.parameters.psi == 0
    assert not last.source_term
    assert asked[-1].coarser == 1


def test_a_night_draws_by_its_date_and_its_claims_have_the_same_keys_every_night(monkeypatch, tmp_path):
    monkeypatch.setattr(random_module, "check", checked)
    nights = []
    for day in (3, 4):
        monkeypatch.setattr(random_module, "seed_of_today", lambda day=day: day)
        nights.append(OfTheDate(40, 6).claims(tmp_path))
    assert [one.key for one in nights[0]] == [one.key for one in nights[1]]
    assert len({one.key for one in nights[0]}) == 6
    assert nights[0][2].command == "python -m actin_xcheck random --seed 3 --count 1 --first 42"
    study = answered(random_scenes(3, 6, 40), lambda tasks: [checked(task.ask, Path()) for task in tasks])
    assert [one.value for one in nights[0]] == [one.value for one in study.claims]
    assert {one.holds for one in nights[0]} == {True, False}
