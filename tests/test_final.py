"""What a scene comes to: values, agreement and the digits to believe, in words and in JSON."""

import json

import numpy as np
import pytest

from actin_xcheck.studies.compare import read_comparison
from actin_xcheck.studies.compare_page import differences
from actin_xcheck.verdicts.final import FinalValue, in_a_sentence, known_badly
from actin_xcheck.verdicts.judge import KnownTo
from actin_xcheck.verdicts.triangulate import Corner

FEM, FV = Corner("FEM", 3.2018, 0.0014, "", 1.98), Corner("FV", 3.2008, 0.0017, "", 2.1)
REFERENCE = Corner("reference", 3.2020, 1e-9, "")


def value(*corners: Corner, quantity: str = "area") -> FinalValue:
    methods = tuple(f"{one.name.lower()}-x" for one in corners if one.name != "reference")
    return FinalValue("s", methods, quantity, f"{quantity} at t = 1", corners)


@pytest.mark.parametrize(
    ("corners", "digits", "said"),
    [
        (
            (FEM, FV, REFERENCE),
            3,
            "area 3.2018 ± 0.0014 (0.044 %, FEM), the codes agree to 0.031 %, reference to 0.037 %",
        ),
        ((FEM, FV), 3, "area 3.2018 ± 0.0014 (0.044 %, FEM), the codes agree to 0.031 %"),
        ((FEM, Corner("FV", 3.3, 0.001, "")), 1, "area 3.3000 ± 0.0010 (0.03 %, FV), the codes part by 3 %"),
        ((FEM,), 3, "area 3.2018 ± 0.0014 (0.044 %)"),
        ((Corner("FEM", 3.2, np.nan, "none"),), 0, "area 3.200000 with an uncertainty that is not known"),
        (
            (Corner("FEM", np.nan, np.nan, "none"), REFERENCE),
            0,
            "area none with an uncertainty that is not known",
        ),
        (
            (Corner("FEM", 3.2, 2.0, ""), Corner("FV", 3.2, 2.0, "")),
            0,
            "area 3.2 ± 2.0 (62 %, FEM), the codes agree to round-off",
        ),
    ],
)
def test_digits_are_believed_as_far_as_codes_and_theory_agree(corners, digits, said):
    found = value(*corners)
    assert found.digits == digits
    assert found.sentence == said
    assert in_a_sentence([found]).startswith(f"s: {said}: believe {digits or 'no'} digit")


def test_of_a_mode_the_growth_is_said_and_of_nothing_nothing():
    assert "growth_rate" in in_a_sentence([value(FEM), value(FEM, quantity="growth_rate")])
    assert "area" not in in_a_sentence([value(FEM), value(FEM, quantity="growth_rate")])
    assert in_a_sentence([]) == ""


@pytest.mark.slow
def test_a_comparison_says_values_first_in_terminal_page_and_json(tmp_path, command):
    words = "compare static-decay --refine 2 --dt 0.1 --out c --quiet"
    said = [command(words).stdout, command(words, "--json").stdout]
    assert said[0].startswith("static-decay: area ")
    values = {one["quantity"]: one for one in json.loads(said[1])["values"]}
    area = values["area"]["by"]
    exact = area.pop("exact solution")
    assert exact["value"] == pytest.approx(np.pi)
    assert len(area) == 2
    for one in area.values():
        assert abs(one["value"] - np.pi) <= one["uncertainty"]
        assert 1.5 < one["observed_order"] < 2.5 if one["observed_order"] else True
    comparison = read_comparison(tmp_path / "c/compare.h5")
    far = {(one.quantity, one.name): one for one in comparison.apart if one.time == 0.5}
    by = {one.quantity: one for one in comparison.finals}
    assert len(far) == 4  # two integrals, by another code and by theory
    for (quantity, name), one in far.items():
        first, *others = by[quantity].corners
        other = others[name == "exact solution"]
        assert one.value == other.value - first.value
        assert one.uncertainty == other.uncertainty + first.uncertainty
    first = comparison.runs["static-decay/fem-p1-imex2"]
    assert len(first.times) >= 5  # a step every 0.1: a film has more than the output time
    shown = differences(comparison.apart, list(comparison.runs.values()))
    assert [one.title.split(",")[0] for one in shown] == ["Area", "Total actin"]
    for one in shown:
        line, points, exact, _ = one.figure["data"]
        assert len(line["x"]) == len(first.series["time"])
        assert (points["name"], exact["name"]) == ("fv", "exact solution")
        assert points["error_y"]["array"][-1] > 0
    page = (tmp_path / "c/index.html").read_text()
    assert "Area, less that of fem-p1-imex2" in page
    assert page.index("believe") < page.index("Verdict") < page.index("What it comes to")


@pytest.mark.parametrize(
    ("theory", "said"),
    [
        ((), "known to worse than 1 %: cell (area to 1.4 %)"),
        ((Corner("reference", 3.0, 1e-4, ""),), "known to worse than 1 %: cell (area to 1.4 %)"),
        ((Corner("exact solution", 3.0, 0.0, ""),), ""),
        ((Corner("exact solution", 3.3, 0.0, ""),), "known to worse than 1 %: cell (area to 9.1 %)"),
    ],
)
def test_what_the_runs_are_not_sure_of_is_said_beside_the_headline(theory, said):
    """Whatever a reference says, which is no merit of theirs; an exact solution knows their error itself."""
    value = FinalValue("cell", ("fem",), "area", "area", (Corner("fem", 3.0, 0.042, ""), *theory))
    assert known_badly([KnownTo("cell", 0.001, 0.001)], [value]) == said
    assert not known_badly([KnownTo("other", 0.001, 0.001)], [value])
