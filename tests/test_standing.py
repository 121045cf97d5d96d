"""What a night comes to: physics told from flaky claims, code that broke down, machines that stopped."""

from dataclasses import replace

import pytest

from actin_xcheck.nightly.carry_out import ended
from actin_xcheck.nightly.differences import differences, turned
from actin_xcheck.nightly.history import JudgedNumber, append, judged_in, read_claims, read_series
from actin_xcheck.nightly.items import NO_VERDICT
from actin_xcheck.nightly.record import Begun, Done, Kept, NotRun, Number, NumberKind
from actin_xcheck.nightly.standing import flaky, markdown, standing, state_of, summary
from actin_xcheck.runs.processes import Lost
from tests.claims import claim
from tests.histories import night

CODE = {"commit": "c" * 40}


def judged(value: float, scene: str = "scene") -> JudgedNumber:
    return JudgedNumber(claim("area", value, 1.0, quantity="area", scene=scene), "check")


def written(path, *nights):
    """Nights of values, each with what is not as in others."""
    for number, (values, other) in enumerate(nights, 1):
        append(path, night(number, **other), [], [judged(value, f"s{i}") for i, value in enumerate(values)])
    return path


def test_flaky_is_what_the_same_code_has_seen_hold_and_fail(tmp_path):
    changed = CODE | {"versions": {"numpy": "2.5"}}
    history = written(
        tmp_path / "h", ((0.5, 0.5, 2.0), CODE), ((2.0, 0.5, 2.0), CODE), ((0.5, 2.0, 2.0), changed)
    )
    (key,) = flaky(history, "2026-03-02")
    assert key == judged(1, "s0").key
    assert flaky(history, "2026-03-01") == {key}  # it holds there
    assert flaky(history, "2026-03-03") == frozenset()  # of other libraries
    assert flaky(history, "no such night") == flaky(tmp_path / "none", "2026-03-01") == frozenset()


@pytest.mark.parametrize("commit", ["unknown", "c" * 40 + "-dirty"])
def test_code_that_nobody_can_name_is_not_the_same(tmp_path, commit):
    other = {"commit": commit}
    assert not flaky(written(tmp_path / "h", ((0.5,), other), ((2.0,), other)), "2026-03-02")


def test_physics_stands_before_what_broke_down_and_what_is_flaky():
    fails, unsteady, holds = judged(2.0), judged(3.0, "other"), judged(0.5)
    (broke,) = judged_in([ended("check", Lost("ValueError", False), 1.0)])
    assert broke.claim.statement == NO_VERDICT
    known = {unsteady.key}
    told = [state_of(one, known) for one in (fails, unsteady, holds, broke, judged(float("nan")))]
    assert told == ["fail", "flaky", "pass", "broken", "fail"]
    left = (
        NotRun("a", "stopped after 3 s", 3.0),
        NotRun("b", "the machine has no memory"),
        NotRun("c", "late"),
    )
    whole = standing([fails, unsteady, holds, broke], known, left)
    assert (
        whole.score + whole.apart
        == "1 of 4, 1 is flaky, 1 check broke down, 2 checks stopped, 1 check not run"
    )
    states = [
        (whole, "fail"),
        (standing([unsteady, holds, broke], known), "broken"),
        (standing([unsteady, holds], known), "flaky"),
        (standing([holds]), "pass"),
        (standing([], (), left), "none"),
    ]
    assert [one.state for one, _ in states] == [state for _, state in states]


def numbers(error: float, seconds: float) -> list[Number]:
    return [
        Number("error/a|b", NumberKind.ERROR, error),
        Number("seconds/x", NumberKind.TIME, seconds, "s"),
        Number("order/y", NumberKind.ORDER, 2.0 - (seconds > 2)),
    ]


@pytest.mark.parametrize("machine", ["here", "elsewhere"])
def test_a_pull_request_is_told_what_got_worse_and_how_sure_that_is(tmp_path, machine):
    history = tmp_path / "h"
    for at, error in enumerate((1.0, 1.1, 0.9, 1.0, 3.0), 1):
        last = at == 5
        made = numbers(error, 3.0 if last else 1.0)
        append(history, night(at, machine=machine if last else "here"), made, [judged(2.0 if last else 0.5)])
    before, after = night(4), night(5, machine=machine)
    claims = turned(*(read_claims(history, one.name) for one in (before, after)))
    found = differences(numbers(1.0, 1.0), numbers(3.0, 3.0))
    text = markdown(before, after, claims, found, {one.key: one for one in read_series(history)})
    here = machine == "here"
    assert text.startswith(f"### 1 claims fail that did not, {3 if here else 2} numbers are worse\n")
    assert f"| {judged(1).key} | 0.5 -> 2 | 1 |\n" in text
    assert "| error/a\\|b | 1 -> 3 (x 3) | ± 7.3 % in 4 nights |\n" in text
    assert "| order/y | 2 -> 1 (-1) | ± 0 in 4 nights |\n" in text
    assert ("seconds/x" in text) is here
    same = markdown(before, replace(after, commit=before.commit, machine="here"), [], [], {})
    assert same.startswith("### 0 claims fail that did not, 0 numbers are worse")
    assert "same commit, versions and machine" in same
    assert "|" not in same


def test_a_night_comes_to_a_summary_with_what_is_worse_than_before(tmp_path):
    history = written(tmp_path / "h", ((0.5, 0.5), CODE), ((0.5, 2.0), CODE))
    last = night(2, **CODE)

    def kept(name, fault="", baseline=""):
        begun = Begun(
            name, last.date, {"commit": last.commit}, last.machine, "nightly", 9.0, fault, baseline, (), 0.03
        )
        ours = [judged(0.5, "s0"), judged(2.0, "s1")]
        claims, files = tuple(one.claim for one in ours), tuple(one.source for one in ours)
        return Kept(tmp_path / name, begun, (Done("check", claims, files),), closed=True)

    text = summary(kept(last.name), history, {judged(1, "s1").key})
    assert text.startswith(
        "## 1 of 2 claims hold, 1 is flaky\n\n|  | claim | value |\n| --- | --- | --- |\n| flaky | s1 ["
    )
    assert "### 1 claims fail that did not, 0 numbers are worse\n" in text
    assert f"against `{night(1).name}`" in text
    wrong = summary(kept("of-a-fault", fault="fv-leak"), history, ())  # which no history keeps
    assert "A deliberate fault was on: fv-leak." in wrong
    assert "| fail | s1 [" in wrong
    assert "###" not in wrong
    assert "###" not in summary(kept(last.name), tmp_path / "none", ())
