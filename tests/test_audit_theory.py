"""The rows of the audit that need no simulation: complete, and with verdicts that follow the numbers."""

import re
from collections import Counter

import numpy as np
import pytest

from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Delta, Model
from actin_xcheck.studies.audit.row import Finding, Judgement
from actin_xcheck.studies.audit.theory import THEORY, equations_linear, stability_sentences, tables
from actin_xcheck.studies.audit.theory.measures import Triangles, disk_quadrature, found, rounds_to
from actin_xcheck.theory.dispersion import Version, sigma_prime
from actin_xcheck.theory.modes import Mode

ROWS = {row.key: row for row in THEORY}

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

FIGURES = [
    "01",
    "02",
    "03",
    "04",
    "05",
    "06a",
    "07a",
    "08a",
    "08d",
    "09a",
    "09d",
    "21",
    "22",
    "23a",
    "23b",
    "23c",
]
"""Figures and panels that show theory."""

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


@pytest.fixture(scope="module")
def findings() -> dict[str, Finding]:
    """Every row examined once; warnings are errors in this suite."""
    return {key: row.examine() for key, row in ROWS.items()}


def test_keys_are_unique_and_can_be_typed() -> None:
    assert [key for key, count in Counter(row.key for row in THEORY).items() if count > 1] == []
    assert all(re.fullmatch(r"[A-Za-z0-9.\-]+", key) for key in ROWS)
    assert not any(row.studies for row in THEORY)


def test_every_numbered_equation_table_remark_and_theory_figure_has_its_row() -> None:
    expected = [f"eq{n}" for n in EQUATIONS] + [f"fig{n}" for n in FIGURES] + REMARKS
    expected += [f"table{n}" for n in range(1, 7)]
    assert [key for key in expected if key not in ROWS] == []
    rest = {key for key in ROWS if key not in expected}
    assert {key for key in rest if not re.match(r"s(2|3|5|6|A|B)", key)} == {"eqB.2"}


def test_findings_say_what_was_computed_and_why(findings: dict[str, Finding]) -> None:
    evasive = re.compile(
        r"\bsee (the|text|above|below|also|section|fig|table)|\btbd\b|\bnan\b|\binf\b", re.IGNORECASE
    )
    for key, finding in findings.items():
        words = (ROWS[key].statement, ROWS[key].place, finding.computed, finding.reason)
        assert all(word.strip() for word in words), key
        assert not evasive.search(f"{finding.computed} {finding.reason}"), key
        assert finding.computed.endswith("."), key
        assert finding.reason.endswith("."), key
        assert "no longer give" not in finding.reason, key
        assert all(np.isfinite(value) for value in finding.numbers.values()), key


def test_most_findings_carry_numbers(findings: dict[str, Finding]) -> None:
    labels = {"s5.1.1-panels", "s5.3.2-mixed", "sB-reaction", "sB.3.1-solution"}
    assert {key for key, finding in findings.items() if not finding.numbers} == labels


def test_verdicts(findings: dict[str, Finding]) -> None:
    by_verdict = {
        judgement: {k for k, f in findings.items() if f.judgement is judgement} for judgement in Judgement
    }
    assert by_verdict[Judgement.MISPRINT] == MISPRINTS
    assert by_verdict[Judgement.NOT_REPRODUCED] == NOT_REPRODUCED
    assert by_verdict[Judgement.UNDECIDABLE] == {"s3.3-sufficient", "s5.4-condition", "s5.4-w01"}
    assert all(key.startswith(("fig", "remark")) for key in by_verdict[Judgement.IN_KIND])


def test_exhibits_have_keys_of_their_own(findings: dict[str, Finding]) -> None:
    for key, finding in findings.items():
        keys = [exhibit.key for exhibit in finding.exhibits]
        assert len(keys) == len(set(keys)), key
    assert {key for key in ROWS if key.startswith("fig")} <= {k for k, f in findings.items() if f.exhibits}


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
    return ROWS[key].examine().judgement


def test_a_wrong_slope_of_the_contractility_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(equations_linear, "sigma_prime", lambda par: 1.001 * sigma_prime(par))
    assert verdict("eq3.9") is Judgement.NOT_REPRODUCED


@pytest.mark.parametrize(
    ("method", "keys"),
    [("pressure", ("eq2.5", "eq3.1", "eqB.4")), ("contractility", ("eq2.2", "eq3.1", "eq3.9", "eqB.4"))],
)
def test_a_wrong_constitutive_law_is_seen(
    monkeypatch: pytest.MonkeyPatch, method: str, keys: tuple[str, ...]
) -> None:
    right = getattr(Model, method)
    monkeypatch.setattr(Model, method, lambda self, *args: 1.001 * right(self, *args))
    assert [verdict(key) for key in keys] == [Judgement.NOT_REPRODUCED] * len(keys)


@pytest.mark.parametrize("moduli", ["viscous_moduli", "elastic_moduli"])
def test_wrong_moduli_are_seen(monkeypatch: pytest.MonkeyPatch, moduli: str) -> None:
    right = getattr(Model, moduli)
    monkeypatch.setattr(Model, moduli, lambda self: (right(self)[0], 1.01 * right(self)[1]))
    assert verdict("eq2.3" if moduli == "viscous_moduli" else "eq2.4") is Judgement.NOT_REPRODUCED
    for key in ("eq2.1a", "eq3.2", "eqB.2", "eqB.20", "eqB.21", "eqB.23a"):
        assert verdict(key) is Judgement.NOT_REPRODUCED, key


def test_a_wrong_reaction_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Model, "reaction_rate", lambda self: 1.1)
    for key in ("eq2.1b", "eqB.15c", "eqB.22", "eqB.23b"):
        assert verdict(key) is Judgement.NOT_REPRODUCED, key


def test_a_ring_in_the_wrong_place_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    def ring(self: Model, xi: np.ndarray) -> np.ndarray:
        return (np.hypot(*xi) > 0.7).astype(float)

    monkeypatch.setattr(Model, "delta_on_cells", ring)
    assert verdict("eq2.6") is Judgement.NOT_REPRODUCED
    assert verdict("s5.1.2-ring") is Judgement.NOT_REPRODUCED


def test_rows_would_follow_the_article_if_it_were_right(monkeypatch: pytest.MonkeyPatch) -> None:
    """Table 6 with rounded entries and Table 4 with the corrected lists are reproduced."""
    rounded = tuple(tuple(round(float(z), 5) for z in row) for row in tables.table_6())
    monkeypatch.setattr(tables, "TABLE_6_PRINTED", rounded)
    assert verdict("table6") is Judgement.REPRODUCED
    lists = tuple(
        tables.replace(row, modes=tables.isolated_modes(row.model(Delta.NONE), Version.AS_PRINTED))
        for row in tables.TABLE_4_PRINTED
    )
    monkeypatch.setattr(tables, "TABLE_4_PRINTED", lists)
    assert verdict("table4") is Judgement.REPRODUCED


def test_a_changed_threshold_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stability_sentences, "_onset", lambda model, m: 36.0557)
    assert verdict("s3.3-points-free") is Judgement.REPRODUCED


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


def test_a_reason_that_no_longer_fits_says_so() -> None:
    finding = found(Judgement.MISPRINT, "Computed.", "Because.", holds=True)
    assert finding.judgement is Judgement.REPRODUCED
    assert finding.reason.startswith("The numbers no longer give 'misprint'")
    assert found(Judgement.IN_KIND, "", "", holds=True).judgement is Judgement.IN_KIND
    assert found(Judgement.REPRODUCED, "", "", holds=False, corrected=True).judgement is Judgement.MISPRINT


def test_quadrature_takes_the_kinks_of_the_bars() -> None:
    x, weights = disk_quadrature()
    assert weights @ np.abs(x[0] * x[1]) == pytest.approx(0.5, rel=1e-13)
    inner = disk_quadrature(0.2, 0.8)[1]
    assert inner.sum() == pytest.approx(np.pi * 0.6, rel=1e-13)


def test_components_find_modes_in_both_phases() -> None:
    w = "3*J(2, 3.0542369282271403*r)*cos(2*theta) - J(2, 3.0542369282271403*r)*sin(2*theta)"
    assert tables.components(w, Mode(2, 1)) == pytest.approx((3, -1), abs=1e-12)
    assert tables.components(w, Mode(4, 1)) == pytest.approx((0, 0), abs=1e-12)


def test_matrices_by_hand_integrate_linear_fields() -> None:
    mesh = disk(3, 0.8)
    grid = Triangles(mesh.xi, mesh.triangles)
    a, b = 1 + 2 * mesh.xi[0], 3 * mesh.xi[1] - mesh.xi[0]
    area = grid.areas.sum()
    assert a @ grid.stiffness() @ b == pytest.approx(-2 * area)
    assert grid.mass().sum() == pytest.approx(area)
    assert grid.load().sum() == pytest.approx(area)
    assert grid.divergence(np.array([a, b])) == pytest.approx(np.full(grid.areas.shape, 5.0))
