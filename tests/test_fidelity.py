"""No more model than a scene needs: what is chosen, that it is exact, and what is refused."""

import numpy as np
import pytest

from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.accuracy import change
from actin_xcheck.runs.fidelity import Fidelity, reduced, symmetry_of
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import Scene, load_scene, parse_scene
from tests.lab import scene_of

P3, PAPER, FV = METHODS["fem-p3-imex4"], METHODS["fem-p1-paper"], METHODS["fv-coupled"]
ACTIVE = "psi = 100.0\np = 0.2"
PROBES = "[probes]\npoints = [[0, 0], [0.4, 0.1], [-0.3, 0.6], [0.8, 0], [1, 0], [0.6, -0.8]]\n"


@pytest.mark.parametrize(
    ("a", "mirrors", "start"),
    [
        ("1 + 0.1*x", 1, 0),
        ("1 + 0.1*y", 1, 90),
        ("1 + 0.1*cos(x)", 2, 0),
        ("1 + 0.1*abs(sin(x)*sin(y))", 4, 0),
        ("1 + 0.1*x*y", 2, 45),
        ("1 + 0.1*r**3*cos(3*theta - 0.6)", 3, np.rad2deg(0.2)),
        ("1 + 0.1*r**3*cos(3*theta) + 0.1*r**6*cos(6*theta)", 3, 0),
        ("1 + 0.1*r**2*cos(2*theta) + 0.1*r**3*cos(3*theta)", 1, 0),
    ],
)
@pytest.mark.parametrize("turn", [0, 20, 50])
def test_mirror_lines_are_found(a, mirrors, start, turn):
    scene = scene_of(a=a, more=f"[domain]\nrotation = {turn}\n")
    found = symmetry_of(resolve(scene), scene.time.end)
    assert not found.axisymmetric
    assert found.mirrors is not None
    assert found.mirrors.mirrors == mirrors
    apart = (np.rad2deg(found.mirrors.start) - start - turn) / (180 / mirrors)
    assert apart == pytest.approx(round(apart), abs=1e-9)


@pytest.mark.parametrize("u", ['"0", "0"', '"0.1*x", "0.1*y"'])
def test_an_axisymmetric_scene_is_seen_as_such(u):
    scene = _with_initial(f'[initial]\na = "1 + 0.1*exp(-r**2)"\nu = [{u}]\n')
    assert symmetry_of(resolve(scene), 0.1).axisymmetric


@pytest.mark.parametrize(
    "initial",
    [
        '[initial]\na = "1 + 0.1*r**2*cos(2*theta) + 0.1*r**3*cos(3*theta - 0.4)"\n',
        '[initial]\na = "1"\nu = ["-0.1*y", "0.1*x"]\n',  # a swirl has no mirror image of itself
        '[initial]\na = "1 + 0.1*x"\nu = ["0", "0.1*x"]\n',
        '[initial]\na = "1"\n[source]\na = "x*t + y*t**2"\n',  # a mirror line at each moment, another one
        '[initial]\na = "1"\n[motion]\nx = "x0 + t*y0"\ny = "y0"\n',
    ],
)
def test_what_is_lopsided_is_not_called_symmetric(initial):
    found = symmetry_of(resolve(_with_initial(initial)), 0.1)
    assert not found.axisymmetric
    assert found.mirrors is None


def test_an_asymmetry_of_1e_11_counts():
    assert symmetry_of(resolve(scene_of(a="1 + 0.1*x + 1e-11*y")), 0.1).mirrors is None


def _with_initial(initial: str) -> Scene:
    return parse_scene(
        f'name = "test"\n[parameters]\npsi = 0.0\np = 0.0\n{initial}[time]\nend = 0.1\n', "test.toml"
    )


@pytest.mark.parametrize(
    ("name", "method", "chosen"),
    [
        ("fig14-four-fronts", P3, "sector"),
        ("fig14-four-fronts", PAPER, "sector"),
        ("fig14-four-fronts", FV, "full"),
        ("stirred", P3, "full"),
        ("mode-0-cell", P3, "radial"),
        ("mode-0-cell", PAPER, "full"),
    ],
)
def test_auto_takes_the_smallest_that_is_exact(name, method, chosen):
    assert reduced(load_scene(name), method).fidelity == chosen


def test_what_does_nothing_is_left_out_in_words():
    said = " ".join(reduced(load_scene("static-decay"), FV).left_out)
    assert "force balance" in said
    assert "ring" in said
    viscous = scene_of(ACTIVE, more='[model]\nrheology = "viscous"\n')
    assert "elastic stress" in " ".join(reduced(viscous, FV).left_out)
    assert reduced(load_scene("fig14-four-fronts"), FV).left_out == ()
    assert reduced(load_scene("static-decay"), P3, Fidelity.FULL).left_out == ()


@pytest.mark.parametrize(
    ("a", "model", "method", "within"),
    [
        ("1 + 0.1*cos(x)", "", P3, 1e-10),
        ("1 + 0.1*cos(x)", "", PAPER, 1e-10),
        ("1 + 0.1*x + 0.05*x**2", 'delta = "none"', P3, 1e-4),  # another mesh: no line on the ring
        ("1 + 0.1*cos(x)*cos(y)", 'rheology = "viscous"', P3, 1e-10),
        ("1 + 0.1*cos(x)", 'closure = "traction-free"', P3, 1e-9),
        ("1 + 0.1*exp(-2*r**2)", "", P3, 1e-4),
    ],
)
def test_auto_agrees_with_full(a, model, method, within, tmp_path):
    scene = scene_of(ACTIVE, a=a, end=0.05, more=f"[model]\n{model}\n{PROBES}")
    rtol = 1e-6 if method.adaptive else None
    runs = []
    for wanted in (Fidelity.FULL, Fidelity.AUTO):
        reduction = reduced(scene, method, wanted)
        assert (reduction.fidelity is Fidelity.FULL) == (wanted is Fidelity.FULL)
        file = tmp_path / f"{wanted}.vtkhdf"
        assert run(scene, Numerics(method, 2, 0.01, rtol, reduction), file).ok
        runs.append(read_run(file))
    assert change(*runs, scene.output_times) < within
    assert runs[0].attributes["fidelity"] == "full"
    assert runs[1].attributes["fidelity"] in ("sector", "radial")


@pytest.mark.parametrize("method", [P3, PAPER, FV])
def test_a_cell_that_nothing_moves_needs_no_force_balance(method, tmp_path):
    scene = load_scene("static-decay")
    runs = []
    for wanted in (Fidelity.FULL, Fidelity.AUTO):
        file = tmp_path / f"{wanted}.vtkhdf"
        assert run(scene, Numerics(method, 3, 0.125, reduction=reduced(scene, method, wanted)), file).ok
        runs.append(read_run(file))
    assert np.abs(runs[1].points[-1] - runs[1].xi).max() < 1e-15
    assert change(*runs, scene.output_times) < 8e-3  # P1 and finite volumes on two meshes


@pytest.mark.parametrize(
    ("name", "method", "wanted", "said"),
    [
        ("fig14-four-fronts", P3, "radial", "depend on the angle"),
        ("fig14-four-fronts", FV, "sector", "finite elements alone"),
        ("stirred", P3, "sector", "no mirror line"),
        ("fig14-four-fronts", P3, "modal", "no steady state"),
        ("mode-0-cell", PAPER, "radial", "fem-p*-imex*"),
    ],
)
def test_what_is_not_exact_is_refused(name, method, wanted, said):
    with pytest.raises(UserError, match=said.replace("*", r"\*")) as refused:
        reduced(load_scene(name), method, Fidelity(wanted))
    assert "valid: auto, full" in str(refused.value)


def test_the_command_says_what_it_left_out(command):
    run = "run fig14-four-fronts --method fem-p1-paper --refine 3 --dt 0.05 --quiet --out a.vtkhdf"
    done = command(run)
    assert done.returncode == 0
    assert "sector: left out" in done.stdout


def test_modes_of_a_cell_whose_sectors_tile_another_mesh_are_shown_on_that(tmp_path):
    """Three mirror lines: the sector's images are not the cells of the disk."""
    scene, rates = load_scene("mode-31-wall-270"), []
    for fidelity in (Fidelity.MODAL, Fidelity.SECTOR):
        file = tmp_path / f"{fidelity}.vtkhdf"
        assert run(scene, Numerics(P3, 2, 1.0, 1e-5, reduced(scene, P3, fidelity, 1e-5)), file).ok
        amplitude = read_run(file).series["mode_amplitude"]
        rates.append(np.log(amplitude[-1] / amplitude[0]) / scene.time.end)
    assert rates[0] == pytest.approx(10.4783, rel=1e-3)
    assert rates[1] == pytest.approx(rates[0], rel=2e-2)
