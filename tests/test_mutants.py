"""Faults that are drawn: each is one place of one file, still Python, and judged by tests that import it."""

import ast

import pytest

from benchmarks import mutants as drawn
from benchmarks.mutants import JUDGED, ROOT, mutants, mutated, nearest_tests, table


def of(tmp_path, monkeypatch, text):
    (tmp_path / "x.py").write_text(text)
    monkeypatch.setattr(drawn, "ROOT", tmp_path)
    return {(one.kind, one.before, one.after): mutated(one) for one, _ in mutants("x.py")}


def test_every_kind_of_fault_is_made(tmp_path, monkeypatch):
    found = of(tmp_path, monkeypatch, "y = -f(a, b[0]) + 2.0 if a < 3 and b else 0")
    assert {kind for kind, *_ in found} == {
        "operator", "dropped term", "sign", "constant", "comparison", "swapped arguments",
    }  # fmt: skip
    assert (
        found["dropped term", "-f(a, b[0]) + 2.0", "-f(a, b[0])"] == "y = -f(a, b[0]) if a < 3 and b else 0"
    )
    assert found["sign", "-f(a, b[0])", "f(a, b[0])"].startswith("y = f(a, b[0]) + 2.0")
    assert found["swapped arguments", "f(a, b[0])", "f(b[0], a)"].startswith("y = -f(b[0], a)")
    assert "b[1]" in found["constant", "0", "1"]


def test_what_computes_nothing_is_left_alone(tmp_path, monkeypatch):
    text = '"""1 + 2"""\n\n@cache\ndef f(x: int = 1) -> "a + b":\n    raise E(f"{x + 1}")\n'
    assert set(of(tmp_path, monkeypatch, text)) == {("constant", "1", "2")}


@pytest.mark.parametrize("file", ["fv/rim.py", "actin_xcheck/core/model.py"])
def test_mutants_of_the_code_are_python_and_have_tests(file):
    text = ast.unparse(ast.parse((ROOT / file).read_text()))
    some = [one for one, _ in mutants(file)]
    assert len(some) > 30
    for one in some[:: len(some) // 10]:
        assert mutated(one) != text
        ast.parse(mutated(one))
    assert all((ROOT / test).exists() for test in nearest_tests(file))
    assert nearest_tests(file)


def test_every_part_that_is_judged_is_there():
    assert all((ROOT / part).is_dir() for part in JUDGED)


def test_the_table_counts_what_is_found_and_names_what_survives():
    line = {"file": "fem/boundary.py", "line": 3, "kind": "sign", "before": "-a", "after": "a"}
    said = table([line | {"tests": True, "product": False}, line | {"tests": False, "product": True}])
    assert ["fem", "2", "50%", "50%"] in [row.split() for row in said.splitlines()]
    assert said.count("survives the tests: fem/boundary.py:3 sign: -a -> a") == 1
