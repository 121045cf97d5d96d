"""The rows of the audit: complete, with verdicts that follow the numbers; those without runs, examined."""

import re

import numpy as np
import pytest

from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Delta, Model
from actin_xcheck.studies import audit
from actin_xcheck.studies.audit import Finding, Judgement, answer, examined, figures, linear, rows, stability
from actin_xcheck.studies.audit.sample import Triangles, disk_quadrature, rounds_to
from actin_xcheck.theory.dispersion import Mode, Version, isolated_modes, sigma_prime

EQUATIONS = [
    *(f"2.1{letter}" for letter in "abcdef"),
    *(f"2.{n}" for n in range(2, 7)),
    *(f"3.{n}" for n in range(1, 10)),
    "5.1",
    *("A.1", "A.2", "B.1"),
    *("B.2a", "B.2b", "B.3a", "B.3b", "B.4", "B.5", "B.6", "B.7a", "B.7b"),
    *(f"B.{n}" for n in range(8, 15)),
    *("B.15a", "B.15b", "B.15c", "B.16a", "B.16b", "B.16c"),
    *(f"B.{n}" for n in range(17, 23)),
    *("B.23a", "B.23b", "B.24", "B.25"),
]
"""Every numbered equation of the article; (B.19) is Lemma B.2."""

REMARKS = ["remark2.1", "remarkA.1", "remarkB.3", "remarkB.4", "algorithm7.1"]

MISPRINTS = {
    *("eq3.3", "eq3.4", "eq3.5", "eq3.6", "eq3.7", "eq3.8", "eqA.2", "remarkA.1", "remarkB.3"),
    *("eq2.1f", "eqB.6", "eqB.12", "eqB.13", "eqB.15b", "eqB.16b", "algorithm7.1"),
    *("table4", "table5", "table6", "fig21", "fig22"),
    *("s2.1-conditions", "s3.2-units", "s3.3-steady"),
    *("sA.1.1-c", "sA.1.1-k3", "sA.1.1-superposition", "sA.1.2-hopf"),
    *("s5.1.1-panels", "s5.1.2-isolates", "s5.1.2-ring", "s5.3.2-mixed", "s5-times"),
    *("sB-reaction", "sB.3.1-solution", "sB.7-displacement"),
}

NOT_REPRODUCED = {
    *("s3.3-points-normal", "s3.3-points-free", "sA.1-steady", "sA.1.1-identical", "sA.1.2-identical"),
    *("sA.1.2-along-psi", "s5.1.2-encouraged"),
}


UNDECIDABLE = {"s3.3-sufficient", "s5.4-condition", "s5.4-w01", "fig20a", "s7-experiment"}

UNCOMPUTED = {"s5.1.1-panels", "s5.3.2-mixed", "sB-reaction", "sB.3.1-solution", "fig20a", "s7-experiment"}
"""Wrong labels, and what nothing can be held against."""

SLOW = {"s5.3.1-translation", "s5-remark5.1", "s5-remark5.1-others"}


@pytest.fixture(scope="module")
def findings() -> dict[str, Finding]:
    """Every row that needs no run examined once; warnings are errors in this suite.

    Fig. 23a's maps, which take as long as all else and decide nothing, are those of `test_atlas`.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "maps", list)
        return {key: one.examine() for key, one in rows().items() if not one.families and key not in SLOW}


def test_every_equation_table_figure_and_remark_has_its_row() -> None:
    expected = [f"eq{n}" for n in EQUATIONS] + REMARKS + [f"table{n}" for n in range(1, 7)]
    assert [key for key in expected if key not in rows()] == []
    assert all(any(re.match(rf"fig{n:02d}(?!\d)", key) for key in rows()) for n in range(1, 24))
    rest = {key for key in rows() if key not in expected}
    assert {key for key in rest if not re.match(r"fig\d\d|s(2|3|5|6|7|A|B)", key)} == {"eqB.2"}
    assert all(re.fullmatch(r"[A-Za-z0-9.-]+", key) for key in rows())


def test_every_row_is_said_whole_and_what_computes_belongs_to_one() -> None:
    said = audit.article()
    assert set(audit._EXAMINERS) <= set(said)
    assert all({"place", "statement"} <= set(one) for one in said.values())
    assert all("checks" in one or {"verdict", "computed", "reason"} <= set(one) for one in said.values())
    assert {key for key, one in said.items() if "checks" not in one} - set(audit._EXAMINERS) == UNCOMPUTED


@pytest.mark.slow
def test_findings_say_what_was_computed_and_why(findings: dict[str, Finding]) -> None:
    evasive = re.compile(
        r"\bsee (the|text|above|below|also|section|fig|table)|\btbd\b|\bnan\b|\binf\b", re.IGNORECASE
    )
    for key, finding in findings.items():
        assert finding.computed.endswith("."), key
        assert finding.reason.endswith("."), key
        assert not evasive.search(f"{finding.computed} {finding.reason}"), key
        assert "no longer give" not in finding.reason, key
        assert all(np.isfinite(value) for value in finding.numbers.values()), key
        keys = [exhibit.key for exhibit in finding.exhibits]
        assert len(keys) == len(set(keys)), key
        assert keys or not key.startswith("fig") or key == "fig20a", key
    assert {key for key, finding in findings.items() if not finding.numbers} == UNCOMPUTED


def test_verdicts(findings: dict[str, Finding]) -> None:
    of = {judgement: {k for k, f in findings.items() if f.judgement is judgement} for judgement in Judgement}
    assert of[Judgement.MISPRINT] == MISPRINTS
    assert of[Judgement.NOT_REPRODUCED] == NOT_REPRODUCED
    assert of[Judgement.UNDECIDABLE] == UNDECIDABLE
    assert all(key.startswith(("fig", "remark")) for key in of[Judgement.IN_KIND])


@pytest.mark.parametrize(
    ("key", "digits"),
    [
        ("s3.3-points-normal", {"m = 0": 100.6419, "m = 1": 158.5665, "wall, m = 1": 36.0557}),
        ("s3.3-points-free", {"m = 0": 100.6419, "m = 1": 119.6427}),
        ("fig21", {"k2 of w1,1": 3.3899577}),
        ("fig22", {"k2 of w2,1": 9.3283632}),
        ("sA.1.1-identical", {"b, printed": 0.26 * 2 / np.pi}),
        ("eqA.2", {"bound, δ = 1": 1.75 / 1.5}),
    ],
)
def test_numbers_that_are_quoted_elsewhere(
    findings: dict[str, Finding], key: str, digits: dict[str, float]
) -> None:
    for name, value in digits.items():
        assert findings[key].numbers[name] == pytest.approx(value, rel=2e-6)


# mutations: a wrong implementation must change the verdict of the row that is about it


def verdict(key: str) -> Judgement:
    return rows()[key].examine().judgement


@pytest.mark.parametrize(
    ("method", "factor", "keys"),
    [
        ("pressure", 1.001, ("eq2.5", "eq3.1", "eqB.4")),
        ("contractility", 1.001, ("eq2.2", "eq3.1", "eq3.9", "eqB.4")),
        ("reaction_rate", 1.1, ("eq2.1b", "eqB.15c", "eqB.22", "eqB.23b")),
    ],
)
def test_a_wrong_law_is_seen(
    monkeypatch: pytest.MonkeyPatch, method: str, factor: float, keys: tuple[str, ...]
) -> None:
    right = getattr(Model, method)
    monkeypatch.setattr(Model, method, lambda self, *args: factor * right(self, *args))
    assert [verdict(key) for key in keys] == [Judgement.NOT_REPRODUCED] * len(keys)


@pytest.mark.parametrize(("moduli", "key"), [("viscous_moduli", "eq2.3"), ("elastic_moduli", "eq2.4")])
def test_wrong_moduli_are_seen(monkeypatch: pytest.MonkeyPatch, moduli: str, key: str) -> None:
    right = getattr(Model, moduli)
    monkeypatch.setattr(Model, moduli, lambda self: (right(self)[0], 1.01 * right(self)[1]))
    for one in (key, "eq2.1a", "eq3.2", "eqB.2", "eqB.20", "eqB.21", "eqB.23a"):
        assert verdict(one) is Judgement.NOT_REPRODUCED, one


def test_a_wrong_slope_a_wrong_ring_and_another_threshold_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as wrong:
        wrong.setattr(linear, "sigma_prime", lambda par: 1.001 * sigma_prime(par))
        assert verdict("eq3.9") is Judgement.NOT_REPRODUCED
    monkeypatch.setattr(Model, "delta_on_cells", lambda self, xi: (np.hypot(*xi) > 0.7).astype(float))
    assert verdict("eq2.6") is verdict("s5.1.2-ring") is Judgement.NOT_REPRODUCED
    monkeypatch.setattr(stability, "_onset", lambda model, m: 36.0557)
    assert verdict("s3.3-points-free") is Judgement.REPRODUCED


def test_rows_would_follow_the_article_if_it_were_right(monkeypatch: pytest.MonkeyPatch) -> None:
    """Table 6 with rounded entries and Table 4 with the corrected lists are reproduced."""
    rounded = tuple(tuple(round(float(z), 5) for z in zeros) for zeros in figures.table_6())
    monkeypatch.setattr(figures, "TABLE_6_PRINTED", rounded)
    assert verdict("table6") is Judgement.REPRODUCED
    lists = tuple(
        figures.replace(one, modes=isolated_modes(one.model(Delta.NONE), Version.AS_PRINTED))
        for one in figures.TABLE_4_PRINTED
    )
    monkeypatch.setattr(figures, "TABLE_4_PRINTED", lists)
    assert verdict("table4") is Judgement.REPRODUCED


# what the rows are measured with


@pytest.mark.parametrize(
    ("value", "printed", "agrees"),
    [
        (3.8317059, "3.83170", False),
        (3.8317059, "3.83171", True),
        (311.647, "3.1e2", True),
        (316.0, "3.1e2", False),
        (2.4999, "2.5", True),
        (0.0725, "0.072", True),
        (0.0725, "0.073", True),
    ],
)
def test_rounding_as_printed(value: float, printed: str, agrees: bool) -> None:
    assert rounds_to(value, printed) is agrees


@pytest.mark.parametrize(
    ("written", "holds", "corrected", "follows"),
    [
        ("misprint", True, False, Judgement.REPRODUCED),
        ("reproduced in kind", True, False, Judgement.IN_KIND),
        ("cannot be decided", True, False, Judgement.UNDECIDABLE),
        ("reproduced", False, True, Judgement.MISPRINT),
        ("reproduced", False, False, Judgement.NOT_REPRODUCED),
    ],
)
def test_a_verdict_follows_the_answer_and_a_reason_that_no_longer_fits_says_so(
    monkeypatch: pytest.MonkeyPatch, written: str, holds: bool, corrected: bool, follows: Judgement
) -> None:
    said = {"verdict": written, "computed": "{some:.1f}: {parts}.", "reason": "Because."}
    said |= {"numbers": {"sum": "parts[a]", "part {}": "parts"}, "each": {"parts": "{0} is {1:g}"}}
    got = answer(holds, corrected=corrected, some=[1.0, 2.0], parts={"a": 3, "b": 4})
    monkeypatch.setitem(audit.article(), "eq2.2", said)
    monkeypatch.setitem(audit._EXAMINERS, "eq2.2", lambda: got)
    finding = examined("eq2.2")
    assert (finding.judgement, finding.computed) == (follows, "1.0, 2.0: a is 3, b is 4.")
    assert finding.numbers == {"sum": 3, "part a": 3, "part b": 4}
    assert finding.reason.startswith(f"The numbers no longer give '{written}'") is (follows != written)


def test_quadrature_takes_the_kinks_of_the_bars() -> None:
    x, weights = disk_quadrature()
    assert weights @ np.abs(x[0] * x[1]) == pytest.approx(0.5, rel=1e-13)
    inner = disk_quadrature(0.2, 0.8)[1]
    assert inner.sum() == pytest.approx(np.pi * 0.6, rel=1e-13)


def test_components_find_modes_in_both_phases() -> None:
    w = "3*J(2, 3.0542369282271403*r)*cos(2*theta) - J(2, 3.0542369282271403*r)*sin(2*theta)"
    assert figures.components(w, Mode(2, 1)) == pytest.approx((3, -1), abs=1e-12)
    assert figures.components(w, Mode(4, 1)) == pytest.approx((0, 0), abs=1e-12)


def test_matrices_by_hand_integrate_linear_fields() -> None:
    mesh = disk(3, 0.8)
    grid = Triangles(mesh.xi, mesh.triangles)
    a, b = 1 + 2 * mesh.xi[0], 3 * mesh.xi[1] - mesh.xi[0]
    area = grid.areas.sum()
    assert a @ grid.stiffness() @ b == pytest.approx(-2 * area)
    assert grid.mass().sum() == pytest.approx(area)
    assert grid.load().sum() == pytest.approx(area)
    assert grid.divergence(np.array([a, b])) == pytest.approx(np.full(grid.areas.shape, 5.0))
