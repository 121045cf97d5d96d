"""What claims and observed orders say of runs, and how much it says that they hold."""

from dataclasses import replace

import numpy as np
import pytest
import typer

from actin_xcheck.cli.studies import compare
from actin_xcheck.core.claim import ClaimKind
from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.scene.shelf import scene_text
from actin_xcheck.studies.compare import FILE_NAME, read_comparison
from actin_xcheck.studies.compare_page import write_comparison_page
from actin_xcheck.studies.converge.plan import final
from actin_xcheck.verdicts.judge import WELL, judge
from actin_xcheck.verdicts.known import known, reference_errors
from actin_xcheck.verdicts.orders import Verdict, local_orders, observe
from actin_xcheck.verdicts.triangulate import Levels, triangulate
from tests.claims import claim
from tests.lab import FEM, FV
from tests.tags import Tags

H = 2.0 ** -np.arange(1, 6)


def test_a_pure_power_passes_with_a_narrow_interval():
    found = observe(H, 3 * H**2, 2)
    assert found.verdict is Verdict.PASS
    assert found.local == pytest.approx([2] * 4)
    assert found.low == pytest.approx(found.slope) == found.high == pytest.approx(2)


@pytest.mark.parametrize(
    ("errors", "order", "verdict"),
    [
        *((3 * H**2, declared, Verdict.FAIL) for declared in (1, 1.5, 2.5, 3)),
        # h^2 + c h^3: orders fall towards 2 from 3, half of the distance a level once h^2 leads
        (H**2 * (1 + 0.3 * H), 2, Verdict.PASS),
        (H**2 * (1 - 0.3 * H), 2, Verdict.PASS),
        (H**2 * (1 + 1e3 * H), 2, Verdict.FAIL),
        (H**2 * (1 + 15 * H), 2, Verdict.NOT_YET_ASYMPTOTIC),
        (H**2 * (1 - H**0.5), 2, Verdict.NOT_YET_ASYMPTOTIC),  # so is half an order above
        (H**1.5 * (1 - 0.6 * H), 2, Verdict.FAIL),  # settles elsewhere, although it came from far
        (H**2 + 0.01, 2, Verdict.FAIL),  # stalls
        # a sign excuses nothing that does not converge
        ([1e-3, -1e-3, 1e-3, -1e-3, 1e-3], 2, Verdict.FAIL),
        ([1e-3, -2e-3, 4e-3, -8e-3, 16e-3], 2, Verdict.FAIL),
        ([1e-2, 2e-4, -4e-4, -2e-4, -1e-4], 2, Verdict.FAIL),  # settled at 1
        ([1e-1, 1e-2, 1e-3, 1e-13, 1e-1], 2, Verdict.FAIL),  # in round-off for one level only
    ],
)
def test_a_higher_order_term_is_told_from_a_wrong_order(errors, order, verdict):
    assert observe(H, errors, order).verdict is verdict


def test_a_functional_may_converge_faster_than_declared_but_not_more_slowly():
    assert observe(H, 3 * H**4, 2, at_least=True).verdict is Verdict.PASS
    assert observe(H, 3 * H**1.5, 2, at_least=True).verdict is Verdict.FAIL


@pytest.mark.parametrize(
    ("orders", "verdict"),
    [
        ((8.44, 8.88), Verdict.NOT_YET_ASYMPTOTIC),
        ((8.44, 8.8), Verdict.FAIL),  # too far
        ((8.82, 8.86), Verdict.FAIL),  # too slow to come to 9
        ((8.9, 8.95), Verdict.PASS),
    ],
)
def test_orders_that_round_off_ends_next_to_the_declared_one_are_no_failure(orders, verdict):
    errors = 1e-6 / 2.0 ** np.cumsum([0, *orders, 20, 20])
    assert observe(H, errors, 9).verdict is verdict


def test_a_number_whose_error_changes_its_sign_shows_no_order_yet():
    """h^2 - 6 h^3: with its sign it is not settled, without it would have to be called a failure."""
    errors = H**2 * (1 - 6 * H)
    found = observe(H, errors, 2)
    assert (found.verdict, "changes its sign" in found.reason) == (Verdict.NOT_YET_ASYMPTOTIC, True)
    assert found.local == observe(H, np.abs(errors), 2).local
    assert observe(H, -(H**2), 2).verdict is Verdict.PASS
    assert observe(H, -(H**1.5), 2).verdict is Verdict.FAIL


def test_a_floor_is_told_from_an_order():
    found = observe(H, 1e-11 * H**4 + 1e-15, 4)
    assert found.verdict is Verdict.IN_ROUND_OFF
    assert np.isnan(found.local).all()
    above = observe(H, 5e-7 * H**4 + 1e-13 * np.array([1, 1, 1, -1, 1]), 4)
    assert above.verdict is Verdict.PASS  # four levels stand above 1e-12, and they show the order
    found = observe(H, np.zeros(5), 2)
    assert found.verdict is Verdict.IN_ROUND_OFF
    assert np.isnan(found.slope)


def test_noise_fails():
    random = np.random.default_rng(3)
    errors = 10.0 ** random.uniform(-3, -2, (200, 5))
    passed = [observe(H, one, 2).verdict is Verdict.PASS for one in errors]
    assert np.mean(passed) < 0.02


def test_a_level_without_a_number_fails_and_is_left_out_of_the_fit():
    errors = 3 * H**2
    errors[0] = np.nan
    found = observe(H, errors, 2)
    assert found.verdict is Verdict.FAIL
    assert "1 of 5" in found.reason
    assert found.slope == pytest.approx(2)
    assert observe(H, errors, None).verdict is Verdict.MEASURED


def test_the_interval_is_that_of_the_students_t():
    """Five errors with a known scatter, against the closed form."""
    scatter = np.exp(np.array([0.02, -0.03, 0.01, 0.03, -0.03]))
    found = observe(H, H**2 * scatter, 2)
    x, y = np.log(H) - np.log(H).mean(), np.log(H**2 * scatter)
    slope = x @ y / (x @ x)
    residual = y - y.mean() - slope * x
    half = 3.182446305 * np.sqrt(residual @ residual / 3 / (x @ x))
    assert (found.slope, found.low, found.high) == pytest.approx((slope, slope - half, slope + half))


@pytest.mark.parametrize(("steps", "errors"), [([1, 2, 3], [1, 1, 1]), ([2, 1], [1, 1]), ([3, 2, 1], [1, 1])])
def test_levels_that_are_no_sequence_are_refused(steps, errors):
    with pytest.raises(ValueError, match="must decrease"):
        observe(steps, errors, 2)


def test_local_orders_take_any_ratio():
    assert local_orders([1, 0.5, 0.1], [1, 0.25, 0.01]) == pytest.approx([2, 2])


SCENE = """
name = "still"
[parameters]
psi = 0
p = 0
[initial]
a = "1"
[time]
end = 0.1
outputs = [0.05, 0.1]
[probes]
points = [[0, 0], [0.5, 0]]
[expect.reference]
origin = "by hand"
bound = {{ area = {{ h2 = 1, dt = 1 }}, probe_a = {{ h2 = 1, dt = 1 }} }}
[[expect.reference.at]]
time = 0.05
area = 3.14159
probe_a = [nan, nan]
[[expect.reference.at]]
time = 0.1
area = 3.14159
probe_a = {}
"""


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    """A run of a cell at rest, which is 1 everywhere."""
    path = tmp_path_factory.mktemp("still") / "still.vtkhdf"
    run(parse_scene(SCENE.format("[1.0, 1.0]"), "still.toml"), Numerics(METHODS[FEM], 2, 0.01), path)
    return read_run(path)


def of_probes(text, run):
    claims = judge(parse_scene(SCENE.format(text), "still.toml"), {FEM: run})
    assert {one.verdict for one in claims if one.quantity != "probe_a"} == {"PASS"}
    return [one for one in claims if one.quantity == "probe_a"]


def test_what_is_judged_is_judged_where_other_probes_and_times_are_not(still):
    """At the first of the two times none is."""
    (holds,) = of_probes("[nan, 1.0]", still)
    assert (holds.verdict, holds.value) == ("PASS", pytest.approx(0, abs=1e-12))
    (fails,) = of_probes("[1.0, 1.5]", still)
    assert (fails.verdict, fails.value) == ("FAIL", pytest.approx(0.5))


def test_a_run_that_has_no_number_where_the_reference_has_one_fails(still):
    """Before, what was nan in the run was left out like what is nan in the reference."""
    gone = still.series["probe_a"].copy()
    gone[-1, 0] = np.nan
    (claim,) = of_probes("[1.0, 1.0]", replace(still, series={**still.series, "probe_a": gone}))
    assert np.isnan(claim.value)
    assert (claim.verdict, claim.excess) == ("FAIL", "there is no number")


def test_a_run_is_not_missed_at_a_time_where_nothing_is_judged(still):
    """Nothing has to be reached for it, and a study of the last time alone has no bound for it."""
    text = SCENE.format("[nan, 1.0]").replace("[nan, nan]", "[1.0, nan]").replace("[nan, 1.0]", "[nan, nan]")
    scene = parse_scene(text, "still.toml")
    early = replace(still, series={name: values[:6] for name, values in still.series.items()})
    assert early.series["time"][-1] == 0.05
    errors = reference_errors(scene, early)
    assert errors["probe_a"] == pytest.approx(0, abs=1e-12)
    assert np.isnan(errors["area"])


def test_a_study_of_the_last_time_has_no_bound_for_what_is_not_judged_then():
    text = SCENE.format("[nan, nan]").replace("probe_a = [nan, nan]", "probe_a = [1.0, nan]", 1)
    scene = final(parse_scene(text, "still.toml"))
    assert scene.expect.reference.bound.probe_a is None
    assert scene.expect.reference.bound.area is not None


@pytest.mark.parametrize(
    ("value", "verdict", "said"),
    [
        (0.05, "PASS", ""),
        (0.1, "PASS", ""),
        (0.100001, "FAIL", "0.1 > 0.1"),
        (0.25, "FAIL", "0.25 > 0.1"),
        (np.inf, "FAIL", "inf > 0.1"),
        (-np.inf, "FAIL", "-inf > 0.1"),
        (np.nan, "FAIL", "there is no number"),
    ],
)
def test_a_claim_holds_if_its_value_is_finite_and_within_the_bound(value, verdict, said):
    made = claim("holds", value, 0.1)
    assert made.verdict == verdict
    assert not said or made.excess == said


def test_where_there_is_nothing_to_compare_that_is_what_is_said(still):
    """Both ended before the first output time."""
    early = replace(still, series={name: values[:2] for name, values in still.series.items()})
    levels = [Levels(METHODS[name], (early,)) for name in (FEM, FV)]
    (found,) = triangulate(parse_scene(SCENE.format("[1.0, 1.0]"), "still.toml"), levels)
    claim = found.claim("")
    assert (claim.verdict, claim.excess) == ("FAIL", "there is no number")
    assert claim.note == "value: none, for there is nothing to compare"


def test_a_run_that_must_end_holds_where_it_ends_so_and_then(still):
    must = '\n[expect]\nends = "tangled"\nat = 0.05\nwithin = 0.01'
    scene = parse_scene(SCENE.format("[1.0, 1.0]") + must, "still.toml")
    t = still.series["time"]

    def ends(outcome, last):
        series = {name: values[t <= last] for name, values in still.series.items()}
        attributes = still.attributes | {"outcome": outcome, "message": "because"}
        claims = judge(scene, {FEM: replace(still, series=series, attributes=attributes)})
        return next(one for one in claims if one.kind is ClaimKind.ENDS)

    held = ends("tangled", 0.05)
    assert (held.verdict, held.value) == ("PASS", pytest.approx(0, abs=1e-12))
    assert held.statement == "ends at t = 0.05 ± 0.01 as tangled"
    assert ends("tangled", 0.08).value == pytest.approx(0.03)
    assert [ends(*one).verdict for one in (("tangled", 0.08), ("non_finite", 0.05), ("completed", 1.0))] == [
        "FAIL"
    ] * 3
    assert scene.times_before_it_ends == ()


@pytest.mark.parametrize(
    ("lines", "key"),
    [
        ('ends = "tangled"', "expect.at = None"),
        ("at = 0.1\nwithin = 0.1", "expect.ends = None"),
        ('ends = "completed"\nat = 0.1\nwithin = 0.1', "should be a way to fail"),
    ],
)
def test_how_a_run_must_end_is_said_whole(lines, key):
    with pytest.raises(UserError, match=key):
        parse_scene(SCENE.format("[1.0, 1.0]") + f"\n[expect]\n{lines}", "still.toml")


@pytest.mark.parametrize(
    ("area", "unit"), [("3.14", 1e-2), ("3.1400", 1e-4), ("3", 1), ("3.14159265358979", 1e-9)]
)
def test_a_reference_is_known_to_the_digits_it_is_printed_with(area, unit):
    scene = parse_scene(SCENE.format("[1.0, nan]").replace("3.14159", area), "still.toml")
    assert known(scene, "area", 0.1).uncertainty == unit
    assert known(scene, "probe_a", 0.1).uncertainty == 0.1


# what is known without a run


@pytest.mark.parametrize(
    ("name", "quantity", "exact", "within"),
    [
        ("growing-disk", "area", np.pi * np.exp(0.5), 1e-13),
        ("growing-disk", "total_actin", np.pi * np.cosh(0.5), 1e-13),
        ("manufactured-moving", "area", 1.5 * 0.75 * np.pi, 1e-13),  # a shear keeps it
        ("stirred", "area", np.pi, 1e-8),  # and a swirl
    ],
)
def test_exact_integrals_are_exact(name, quantity, exact, within):
    assert known(load_scene(name), quantity, 0.5).values == pytest.approx(exact, abs=within)


def test_exact_probes_are_in_the_scenes_frame_however_it_is_turned():
    text = scene_text("stirred") + "\n[domain]\nrotation = 37.0\n"
    straight, turned = load_scene("stirred"), parse_scene(text, "turned.toml")
    for quantity in ("probe_a", "probe_x"):
        assert np.array_equal(
            known(straight, quantity, 0.25).values, known(turned, quantity, 0.25).values
        )  # stated in the scene's frame


def test_nothing_is_known_where_the_motion_is_not():
    scene = load_scene("smooth-fronts")
    assert all(known(scene, quantity, 0.125) is None for quantity in ("area", "probe_a", "growth_rate"))
    assert known(load_scene("fig16-uniform-expansion"), "area", 1.2046e-3) is None


# how much it says that all claims hold


def compared(folder, capsys, *words, **options):
    with pytest.raises(typer.Exit) as ended:
        compare(scenes=list(words), out_dir=folder, quiet=True, **options)
    assert ended.value.exit_code == 0
    return capsys.readouterr().out, Tags(folder / "index.html")


def test_a_run_that_is_far_off_is_no_success_though_all_its_claims_hold(tmp_path, capsys):
    said, page = compared(tmp_path, capsys, "fig14-four-fronts", methods=[FEM], refine=2, dt=0.01)
    (found,) = read_comparison(tmp_path / FILE_NAME).known
    area = read_run(tmp_path / f"fig14-four-fronts--{FEM}.vtkhdf").series["area"][-1]
    assert found.area == pytest.approx(abs(area - 3.6451677458) / area, rel=1e-6)
    assert found.area > 0.05
    off = 100 * abs(area / 3.6451677458 - 1)
    words = (
        f"fig14-four-fronts: area {area:.6f} with an uncertainty that is not known, reference to {off:.2g} %"
    )
    assert words in said
    assert (
        "2.8 %: believe 1 digit\n6 of 6 claims hold at this resolution; known to worse than 1 %: fig14"
        in said
    )
    assert f"area to {100 * found.area:.2g} %" in said
    assert f"Known to worse than 1 %: fig14-four-fronts (area to {100 * found.area:.2g} %" in page.words
    assert words in " ".join(page.text.split())
    assert page.attributes("h1", "class") == ["unsure"]


@pytest.mark.slow
def test_two_codes_that_know_it_well_are_one(tmp_path, capsys):
    said, page = compared(tmp_path, capsys, "static-decay", refine=4, dt=0.05)
    (found,) = read_comparison(tmp_path / FILE_NAME).known
    assert max(found.errors.values()) <= WELL
    assert "the codes agree to round-off, exact solution to" in said
    assert page.attributes("h1", "class") == ["pass"]
    assert "known to worse" not in f"{said} {page.words}"


def test_one_code_without_theory_knows_nothing(tmp_path, capsys):
    said, page = compared(tmp_path, capsys, "smooth-fronts", methods=[FEM], refine=2, dt=0.02)
    assert "with an uncertainty that is not known: believe no digits\n" in said
    assert page.attributes("h1", "class") == ["unsure"]
    again = write_comparison_page(tmp_path / FILE_NAME)  # from the files alone
    assert again == tmp_path / "index.html"


@pytest.mark.slow
def test_a_scene_that_must_end_is_green_where_both_codes_end_there(tmp_path, capsys):
    said, page = compared(tmp_path, capsys, "fig18-nonuniform-contraction-viscoelastic", refine=3)
    assert said.startswith(
        "4 of 4 claims hold; report: "
    )  # two ends, two balances; nothing is compared at no time
    assert page.attributes("h1", "class") == ["pass"]
    badges = [one or "" for one in page.attributes("span", "class") if one and "badge" in one]
    assert not [one for one in badges if "fail" in one]
    assert page.text.count("singular_dilation") >= 4  # claims and runs
