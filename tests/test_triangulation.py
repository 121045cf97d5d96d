"""Triangulation: uncertainties cover known errors, and the corner that was broken is the one named."""

from dataclasses import replace

import numpy as np
import pytest

from actin_xcheck.core.claim import ClaimKind
from actin_xcheck.runs.fidelity import Fidelity, reduced
from actin_xcheck.runs.growth import fitted_rate
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.draw import drawn, written
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.scene.shelf import scene_text
from actin_xcheck.studies.compare import companions, jobs_of, read_comparison
from actin_xcheck.studies.stored import Stored
from actin_xcheck.verdicts.judge import judge
from actin_xcheck.verdicts.known import known
from actin_xcheck.verdicts.orders import uncertainty
from actin_xcheck.verdicts.triangulate import Corner, Levels, estimate, triangulate, verdict
from tests.faults import FAULTS
from tests.lab import FEM, FV

AT = {
    "growing-disk": (3, 32),
    "mode-11-wall": (4, 64),
    "fig14-four-fronts": (4, 80),
    "fig17-uniform-contraction": (4, 64),
}
"""Refinement and steps of seconds."""

SLOW = pytest.mark.slow
SCENES = ["growing-disk", *(pytest.param(name, marks=SLOW) for name in list(AT)[1:])]


def levels_of(scene, method, folder, refine, steps):
    """A method's runs of a scene, finest first."""
    numerics = Numerics(METHODS[method], refine, scene.time.end / steps)
    job = Stored(scene, numerics, f"{method}.vtkhdf")
    of_other = replace(numerics, method=METHODS[FV if method == FEM else FEM])
    beside = companions([job, replace(job, numerics=of_other, file="other.vtkhdf")])
    levels = [job, *(one for one in beside if one.numerics.method is numerics.method)]
    for one in levels:
        run(scene, one.numerics, folder / one.file)
    return Levels(numerics.method, tuple(read_run(folder / one.file) for one in levels))


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Runs without a fault, by scene and method, made when asked for."""
    made = {}

    def get(name, method):
        if (name, method) not in made:
            folder = tmp_path_factory.mktemp("sound")
            made[name, method] = levels_of(load_scene(name), method, folder, *AT[name])
        return made[name, method]

    return get


# uncertainties


def sequence(exact, c, order, wrong=0.0):
    """Values on three levels with error c h^order + wrong h^(order + 1), h = 1, 2, 4."""
    h = 2.0 ** np.arange(3)
    return [np.array([exact + c * s**order + wrong * s ** (order + 1)]) for s in h]


def test_a_pure_power_gives_a_quarter_more_than_its_error():
    found, how, _ = uncertainty(sequence(3.0, 1e-3, 2), 2, 4, similar=True, floor=0)
    assert found == pytest.approx(1.25e-3)
    assert "observed order 2.00 of 2" in how


@pytest.mark.parametrize("order", [1, 1.15, 1.5, 2, 3, 4])
@pytest.mark.parametrize("wrong", [-0.1, -0.02, 0, 0.02, 0.1])
def test_whatever_the_order_the_error_is_covered(order, wrong):
    """Errors of a method of order 2 may fall more slowly or faster; the next term is a tenth."""
    values = sequence(3.0, 1e-3, order, wrong * 1e-3)
    found, *_ = uncertainty(values, 2, 4, similar=True, floor=0)
    assert abs(values[0][0] - 3.0) <= found


def test_two_levels_and_probes_are_trusted_less():
    values = sequence(3.0, 1e-3, 2)
    assert uncertainty(values[:2], 2, 4, True, 0)[0] == pytest.approx(3e-3)
    assert uncertainty(values, 2, 4, False, 0)[0] == pytest.approx(3e-3)
    # twice the step, not four times, where an output interval held two steps: the error doubled only
    assert uncertainty([values[0], values[0] + 1e-3], 2, 2, True, 0)[0] == pytest.approx(3e-3)


def test_two_levels_have_no_order_where_a_third_one_gave_no_number():
    """A cell that grows fast, by volumes at refine 4 and 3: at 2 it came to no end, and -0.0356 is true."""
    values = [np.array([one]) for one in (-0.0202, -0.0322)]
    assert uncertainty(values, 2, 4, False, 0)[0] < 0.0356 - 0.0202
    found, how, _ = uncertainty(values, 2, 4, False, 0, lacks=True)
    assert found == pytest.approx(3 * 0.012)
    assert "a third one failed" in how


def test_errors_that_change_sign_are_no_small_errors():
    """Fine and coarser agree by accident, +e and +e, the coarsest has -4 e."""
    values = [np.array([3 + 1e-3]), np.array([3 + 1.001e-3]), np.array([3 - 4e-3])]
    assert uncertainty(values, 2, 4, True, 0)[0] > 1e-3


def test_changes_that_go_up_and_down_confirm_no_order():
    """A strongly contracted cell by volumes at refine 2, 3 and 4: four times smaller, the other way."""
    values = [np.array([one]) for one in (2.2604, 2.2393, 2.3237)]
    up_and_down, how, order = uncertainty(values, 2, 4, True, 0)
    assert order == pytest.approx(2, abs=0.1)
    assert "Fs = 3" in how
    values[2] = 2 * values[1] - values[2]
    assert up_and_down == pytest.approx(3 / 1.25 * uncertainty(values, 2, 4, True, 0)[0])


def test_errors_of_steps_that_all_levels_share_are_not_extrapolated_away():
    """Fig. 14 by fem-p3-imex4 at refine 5, 4 and 3: what changes is smaller than what is wrong."""
    values = [np.array([total]) for total in (3.205341809146, 3.205341815964, 3.205341960090)]
    wrong = abs(values[0][0] - TRUE[0.1636]["total_actin"][0])
    assert uncertainty(values, 4, 16, True, 3e-12)[0] < wrong / 2
    found, how, _ = uncertainty(values, 4, 16, True, 3e-12, steps=7e-6)
    assert found == pytest.approx(7e-6, rel=1e-2)
    assert "errors of the steps 7.0e-06" in how


TRUE = {
    0.05: {"area": (3.2018457968453333, 3e-9), "total_actin": (3.185457236519055, 2e-9)},
    0.1: {"area": (3.3162582657687207, 6.4e-9), "total_actin": (3.1887503004811433, 2.3e-9)},
    0.1636: {"area": (3.64516774579029, 2.1e-8), "total_actin": (3.205341814113214, 3.2e-9)},
}
"""Fig. 14 by P6 and P7 elements, each with its uncertainty."""


def adaptive_levels(method, refine, rtol, folder):
    """Fig. 14 by a tolerance and its companions, all as a sector: the same numbers, sooner."""
    scene, chosen = load_scene("fig14-four-fronts"), METHODS[method]
    (job,) = jobs_of([scene], [chosen], refine, None, rtol)
    other = replace(job, numerics=replace(job.numerics, method=METHODS[FV]), file="other.vtkhdf")
    part = reduced(scene, chosen, Fidelity.SECTOR)
    levels = [job, *(one for one in companions([job, other]) if one.numerics.method is chosen)]
    for one in levels:
        run(scene, replace(one.numerics, reduction=part), folder / one.file)
    return scene, Levels(chosen, tuple(read_run(folder / one.file) for one in levels))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "refine", "rtol"),
    [
        ("fem-p2-imex3", 2, 1e-3),
        ("fem-p3-imex4", 2, 1e-3),
        ("fem-p1-imex2", 3, 1e-4),
        # where errors in time are what is left
        pytest.param("fem-p3-imex4", 5, 1e-5, marks=[SLOW, pytest.mark.nightly]),
        pytest.param("fem-p4-imex4", 4, 1e-4, marks=[SLOW, pytest.mark.nightly]),
    ],
)
def test_uncertainties_cover_what_is_wrong_when_steps_are_chosen(method, refine, rtol, tmp_path):
    scene, levels = adaptive_levels(method, refine, rtol, tmp_path)
    run = levels.runs[0]
    still = replace(run, series=run.series | {"local_error": np.zeros(len(run.series["time"]))})
    silent = replace(levels, runs=(still, *levels.runs[1:]))
    for t, quantities in TRUE.items():
        made = run.series["local_error"][1:][run.series["time"][1:] <= t].sum()
        for quantity, (true, known_to) in quantities.items():
            (value,), found, *_ = estimate(scene, levels, quantity, t)
            assert abs(value - true) <= found + known_to
            without = estimate(scene, silent, quantity, t)[1]
            share = made * value * (2 if quantity == "area" else 1)  # of radii
            assert found - without == pytest.approx(share, rel=1e-6)


def test_what_linear_systems_leave_is_part_of_it(tmp_path):
    """10^4 steps solved to 1e-14 each."""
    levels = levels_of(load_scene("growing-disk"), FEM, tmp_path, 2, 8)
    run = levels.runs[0]
    longer = {name: np.repeat(values, 1250, axis=0) for name, values in run.series.items()}
    steps = Levels(levels.method, (replace(run, series=longer), *levels.runs[1:]))
    few, many = (estimate(load_scene("growing-disk"), one, "area", 0.5)[1] for one in (levels, steps))
    assert many - few == pytest.approx(5.2 * 1e-14 * 1e4, rel=0.2)


# verdicts


def corners(fem, fv, third=None, spread=0.01):
    found = [Corner("FEM", fem, spread, ""), Corner("FV", fv, spread, "")]
    return [*found, *([Corner("reference", third, 0.0, "")] if third is not None else [])]


@pytest.mark.parametrize(
    ("values", "ratio", "said"),
    [
        ((1.0, 1.002), 0.1, "the two agree; there is no theory here"),
        ((1.0, 1.08), 4, "differ by 4 times the sum of their uncertainties; there is no theory here"),
        ((1.0, 1.002, 0.998), 0.4, "all three agree"),
        ((1.05, 1.05, 1.0), 5, "both differ from the reference, by 5 times the uncertainty"),
        ((1.05, 1.05, 1.0), 5, "a fault is common to both"),
        ((1.0, 1.07, 1.0), 7, "FV is the corner that is off"),
        ((1.07, 1.0, 1.0), 7, "FEM is the corner that is off"),
        ((1.05, 0.95, 1.0), 5, "no two corners agree"),
        ((1.005, 1.013, 1.0), 1.3, "FV is off, or its uncertainty is too small"),
        ((np.nan, 1.0), np.nan, None),
    ],
)
def test_the_sentence_names_the_corner(values, ratio, said):
    found, sentence = verdict(corners(*values))
    assert found == pytest.approx(ratio, nan_ok=True)
    assert said is None or said in sentence


def test_without_an_uncertainty_nothing_is_judged():
    why = "no uncertainty, for a coarser run ended early"
    ratio, sentence = verdict([Corner("FEM", 1.0, 0.01, ""), Corner("FV", 1.5, np.nan, why)])
    assert np.isnan(ratio)
    assert f"FV has {why}" in sentence


# sound codes, and broken ones


@pytest.mark.parametrize("name", SCENES)
def test_sound_codes_agree_with_each_other_and_with_theory(name, sound):
    triangles = triangulate(load_scene(name), [sound(name, FEM), sound(name, FV)])
    assert {"area", "total_actin", "probe_a", "probe_x"} <= {one.quantity for one in triangles}
    assert ("growth_rate" in {one.quantity for one in triangles}) == (name == "mode-11-wall")
    doubted = [one for one in triangles if one.verdict != "PASS"]
    if name == "fig14-four-fronts":
        # a true FAIL of this mesh: what the rim's trace of div u costs (an order near 1) and the h^2 of the
        # rest have opposite signs there, so that the error of 1.1e-3 hardly changes between the levels
        assert [one.quantity for one in doubted] == ["probe_x"]
        # the two points are mirror images: round-off decides which comes first
        assert doubted[0].words in (
            "x of the probe (1, 0) at t = 0.05",
            "y of the probe (0, 1) at t = 0.05",
        )
        assert "or their uncertainties are too small" in doubted[0].sentence
    else:
        assert [one.sentence for one in doubted] == []


GONE = ("drop the dilution", "freeze the mesh")
CASES = [
    *(("growing-disk", fault, broken) for fault in GONE for broken in (FEM, FV)),
    ("growing-disk", "use the old cell volumes", FV),
    *(
        pytest.param(name, fault, broken, marks=SLOW)
        for name, codes in (("mode-11-wall", (FV, FEM)), ("fig14-four-fronts", (FEM, FV)))
        for fault, broken in zip(GONE, codes, strict=True)
    ),
    pytest.param("mode-11-wall", "use the old cell volumes", FV, marks=SLOW),
    pytest.param("fig14-four-fronts", "use the old cell volumes", FV, marks=SLOW),
    pytest.param("fig17-uniform-contraction", "flip the boundary integral of f", FEM, marks=SLOW),
    pytest.param("fig17-uniform-contraction", "flip the boundary integral of f", FV, marks=SLOW),
]


@pytest.mark.parametrize(("name", "fault", "broken"), CASES)
def test_a_fault_in_one_code_is_seen_and_laid_at_its_door(name, fault, broken, sound, tmp_path, monkeypatch):
    whole = sound(name, FV if broken == FEM else FEM)
    FAULTS[fault](monkeypatch)
    scene = load_scene(name)
    found = triangulate(scene, [levels_of(scene, broken, tmp_path, *AT[name]), whole])
    red = [one.sentence for one in found if one.verdict == "FAIL"]
    named, innocent = ("FEM", "FV") if broken == FEM else ("FV", "FEM")
    assert any(f"{named} is the corner that is off" in sentence for sentence in red), red
    assert not any(f"{innocent} is the corner that is off" in sentence for sentence in red), red


def test_a_fault_that_vanishes_with_the_step_is_none_to_extrapolation(sound, tmp_path, monkeypatch):
    """Finite elements with the mass matrix of one step before still converge: the balance alone sees it."""
    whole = sound("growing-disk", FV)
    FAULTS["use the old cell volumes"](monkeypatch)
    scene = load_scene("growing-disk")
    late = levels_of(scene, FEM, tmp_path, *AT["growing-disk"])
    assert {one.verdict for one in triangulate(scene, [late, whole])} == {"PASS"}
    assert any(claim.verdict == "FAIL" for claim in judge(scene, {FEM: late.runs[0]}))


@pytest.mark.slow
def test_a_fault_that_ends_a_run_is_named_by_its_end(sound, tmp_path, monkeypatch):
    whole = sound("fig14-four-fronts", FEM)
    FAULTS["flip the boundary integral of f"](monkeypatch)
    scene = load_scene("fig14-four-fronts")
    broken = levels_of(scene, FV, tmp_path, *AT["fig14-four-fronts"])
    (found,) = triangulate(scene, [whole, broken])
    assert found.verdict == "FAIL"
    assert "fv-coupled at refine 4 ended at t = 0.014: singular_dilation" in found.sentence


@pytest.mark.slow
def test_a_fault_in_both_codes_is_called_common(tmp_path, monkeypatch):
    """The force balance is one code: its fault is FEM's and FV's at once."""
    FAULTS["flip the boundary integral of f"](monkeypatch)
    name = "fig17-uniform-contraction"
    scene = load_scene(name)
    both = [levels_of(scene, method, tmp_path, *AT[name]) for method in (FEM, FV)]
    red = [one.sentence for one in triangulate(scene, both) if one.verdict == "FAIL"]
    assert any("a fault is common to both" in sentence for sentence in red), red


# runs that fail, and files


def test_a_method_that_declares_no_order_is_not_judged(tmp_path):
    scene = load_scene("growing-disk")
    path = tmp_path / "t.vtkhdf"
    run(scene, Numerics(METHODS["fv-tpfa"], 3, 0.05), path)
    stalls = Levels(METHODS["fv-tpfa"], (read_run(path),))
    found = triangulate(scene, [levels_of(scene, FEM, tmp_path, 3, 16), stalls])
    assert {one.verdict for one in found} == {"NOT JUDGED"}
    assert "the method declares no order" in found[0].corners[1].how


STRONG = (
    'name = "strong"\n[parameters]\npsi = 7800.0\np = 0.026\n[initial]\na = "1 + 1e-3*cos(x)"\n'
    "[time]\nend = 0.1\noutputs = {}\n"
)


@pytest.mark.parametrize(("outputs", "verdicts"), [("[]", {"FAIL"}), ("[0.002]", {"PASS"})])
def test_runs_that_fail_are_compared_as_far_as_both_came(outputs, verdicts, tmp_path):
    scene = parse_scene(STRONG.format(outputs), "strong.toml")
    found = triangulate(scene, [levels_of(scene, method, tmp_path, 2, 100) for method in (FEM, FV)])
    assert {one.verdict for one in found} == verdicts
    assert all("singular_dilation" in one.sentence for one in found)


def test_a_comparison_keeps_its_triangles_and_shows_them(carried):
    whole = carried("compare")
    kept, claims = read_comparison(whole.file), whole.report.claims
    assert kept.claims == claims
    assert [one.quantity for one in kept.triangles] == ["area", "total_actin", "probe_a", "probe_x"]
    of_triangles = [claim for claim in claims if claim.kind is ClaimKind.TRIANGLE]
    again = [one.claim(claim.command) for one, claim in zip(kept.triangles, of_triangles, strict=True)]
    assert again == of_triangles
    assert kept.runs.keys() == {f"static-decay/{m}" for m in (FEM, FV)}
    page = (whole.folder / "index.html").read_text(encoding="utf-8")
    assert page.count("all three agree") == 2 * len(of_triangles)  # as a claim and beside its picture
    assert page.count('figure class="exhibit intervals"') == len(of_triangles)


@pytest.mark.parametrize(("l0", "factor"), [(0.8, 1.25), (0.8422, 3)])
def test_an_order_confirms_nothing_where_the_ring_is_too_near_the_rim_for_layers_to_halve(
    l0, factor, tmp_path
):
    """Outside of 0.8422 there are one, one and three layers; of 0.8 one, two and three."""
    scene = load_scene("static-decay").varied({"parameters.l0": l0})
    levels = levels_of(scene, FV, tmp_path, 4, 16)
    _, _, how, order = estimate(scene, levels, "area", scene.time.end)
    assert order == pytest.approx(2, abs=0.1)
    assert f"Fs = {factor:g}," in how


def rate_error(scene, m, amplitude, folder):
    """What a mode's fitted rate is off by and may be off by, in a run whose own errors are smaller."""
    text = scene.text.replace("amplitude = 1e-6", f"amplitude = {amplitude}")
    larger, method = parse_scene(text, "larger.toml"), METHODS["fem-p5-imex5"]
    part = reduced(larger, method, Fidelity.SECTOR if m else Fidelity.RADIAL)
    run(larger, Numerics(method, 3, larger.time.end / 64, 1e-8, part), folder / "mode.vtkhdf")
    theory = known(larger, "growth_rate", 0.0)
    assert theory is not None
    levels = Levels(method, (read_run(folder / "mode.vtkhdf"),))
    (value,), *_ = estimate(larger, levels, "growth_rate", larger.time.end)
    return abs(value - theory.values[0]), theory.uncertainty


def test_the_rate_of_an_exact_mode_is_linear_to_its_amplitude(tmp_path):
    """Terms of second order feed an axisymmetric mode: its rate is off by its amplitude, and said to be."""
    scene = load_scene("mode-0-cell")
    errors, known_to = np.transpose([rate_error(scene, 0, size, tmp_path) for size in ("1e-4", "1e-3")])
    assert np.all(errors < known_to)
    assert np.all(errors > known_to / 100)
    assert errors[1] / errors[0] == pytest.approx(10, rel=0.1)


def test_a_pair_that_hardly_turns_has_no_frequency(tmp_path):
    """Coarse runs of 0.16 radians fit two real rates: 0 is no frequency, however often found."""
    scene, runs = parse_scene(written(drawn(20290117, 307)), "pair.toml"), []
    assert known(scene, "growth_rate", 0.0).values[1] * scene.time.end < 0.2
    for refine in (3, 2):
        run(scene, Numerics(METHODS["fv"], refine, scene.time.end / 8), path := tmp_path / f"{refine}.vtkhdf")
        runs.append(read_run(path))
        assert fitted_rate(scene, runs[-1]).imag == 0
    levels = Levels(METHODS["fv"], tuple(runs))
    values, spread, how, _ = estimate(scene, levels, "growth_rate", scene.time.end)
    assert np.isnan([*values, spread]).all()
    assert how == "no uncertainty, for no such exponentials fit the run"
    ratio, sentence = verdict([Corner("FEM", 3.8, 0.1, ""), Corner("FV", values[1], spread, how)])
    assert np.isnan(ratio)
    assert "FV none: not judged, FV has no uncertainty" in sentence


def test_what_linear_modes_leave_out_is_part_of_their_uncertainty(tmp_path):
    """Of a disk on a static wall they miss the area by the square of an amplitude: no level shows that."""
    text = scene_text("mode-11-wall").replace("amplitude = 1e-6", "amplitude = 1e-5")
    scene, method, bound = parse_scene(text, "modes.toml"), METHODS["fem-p3-imex4"], 1e-7
    modes = reduced(scene, method, Fidelity.MODAL, bound)
    for refine in (3, 2):
        numerics = Numerics(method, refine, scene.time.end / 16, 1e-4, modes)
        run(scene, numerics, tmp_path / f"{refine}.vtkhdf", passing=True)
    runs = tuple(read_run(tmp_path / f"{refine}.vtkhdf") for refine in (3, 2))
    t = scene.output_times[-1]
    (area,), blind, *_ = estimate(scene, Levels(method, runs), "area", t)
    seeing = estimate(scene, Levels(method, runs, bound), "area", t)[1]
    assert blind < abs(area - np.pi) < seeing
    assert seeing - blind == pytest.approx(2 * bound * area, rel=1e-6)


def test_round_off_of_a_growth_rate_is_that_of_a_logarithm_over_its_window(tmp_path):
    """Two levels of one value know it to what 1e-14 in a is of an amplitude of 1e-6, the sooner the worse."""
    text, method = scene_text("mode-11-wall"), METHODS["fem-p3-imex4"]
    whole = parse_scene(text, "modes.toml")
    run(whole, Numerics(method, 2, whole.time.end / 16, 1e-4), tmp_path / "run.vtkhdf", passing=True)
    twice = Levels(method, (read_run(tmp_path / "run.vtkhdf"),) * 2)
    ended = replace(twice.runs[0], series={name: rows[:2] for name, rows in twice.runs[0].series.items()})
    third = Levels(method, (*twice.runs, ended))
    assert "a third one failed" in estimate(whole, third, "area", whole.output_times[-1])[2]
    window = next(line for line in text.splitlines() if line.startswith("window"))
    found = []
    for length in 0.2, 0.4:
        scene = parse_scene(text.replace(window, f"window = [0.0, {length}]"), "modes.toml")
        how = estimate(scene, twice, "growth_rate", scene.output_times[-1])[1:3]
        steps = float(how[1].rpartition(" ")[2])
        found.append((how[0] - steps) * length)
    assert found[0] == pytest.approx(found[1], rel=0.2)
    assert 1e-8 < found[0] < 2e-8
