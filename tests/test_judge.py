"""Another code's numbers held against the truth: errors and orders that were put in, files that are wrong."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import disk
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies import stored
from actin_xcheck.studies.judge import judge, truths
from actin_xcheck.studies.judge.theirs import Theirs, read_theirs
from actin_xcheck.studies.judge.truths import Truth, TruthAsked
from actin_xcheck.studies.study import answered
from actin_xcheck.verdicts.known import known

SCENE = load_scene("growing-disk")
END = SCENE.output_times[-1]
TIMES = np.unique([*np.linspace(0, END, 21), *SCENE.output_times])
AREA = {t: float(known(SCENE, "area", t).values[0]) for t in SCENE.output_times}


def exact(t):
    """Area and total actin of the growing disk (n,), through what is known at its output times."""
    scale = np.log(AREA[END] / np.pi) / END
    return np.pi * np.exp(scale * t)


def series(h=0.0, lag=0.0, start=0.0):
    area = exact(TIMES - lag) * (1 + h**2)
    return {"time": TIMES, "area": area + start}


def write(path: Path, columns: dict) -> Path:
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(columns)
        rows.writerows(zip(*columns.values(), strict=True))
    return path


def truth(error: float = 1e-7) -> Truth:
    """A run as it might come out, its area exact and its polarity 1."""
    return Truth(error, tuple(TIMES), ("area", "polarity"), (*exact(TIMES), *np.ones_like(TIMES)))


def judged(files, order=2.0, within=0.01, runs=()):
    """The report, and what was asked for; runs are answered in turn, and as they are exact."""
    asked, runs = [], iter(runs)

    def answers(tasks):
        asked.extend(task.ask.accuracy for task in tasks)
        return [next(runs, None) or truth() for _ in tasks]

    return answered(judge(SCENE, files, within, order, "a command"), answers), asked


def files(tmp_path, *steps):
    found = []
    for h in steps:
        columns = series(h) | {"polarity": 1 - 0.1 * h**2 + 0 * TIMES}
        read = read_theirs(write(tmp_path / f"theirs-{h:g}.csv", columns), SCENE, "a", "")
        found.append(Theirs(read.name, read.times, read.columns, h=h))
    return found


def test_errors_and_orders_that_were_put_in_are_found(tmp_path):
    report, asked = judged(files(tmp_path, 0.1, 0.05))
    rows = {(one.file, one.quantity): one for one in report.tables["answers"].rows}
    fine = rows["theirs-0.05", "area"]
    assert fine.error == pytest.approx(0.0025, rel=1e-6)
    assert fine.order == pytest.approx(2, abs=1e-6)
    assert fine.truth == pytest.approx(AREA[END])  # what is known, not the run
    assert rows["theirs-0.1", "polarity"].error == pytest.approx(1e-3)
    assert asked == [1e-4, 1e-6]  # a hundredth of 2.5e-4, which only a run tells
    verdicts = {(claim.kind, claim.quantity): claim.verdict for claim in report.claims}
    assert verdicts == {
        ("reference", "area"): "PASS",
        ("order in h", "area"): "PASS",
        ("reference", "polarity"): "PASS",
        ("order in h", "polarity"): "PASS",
    }
    assert report.values[0].digits == 2
    assert "exact solution to 0.25 %" in report.findings[0]


def test_what_is_off_fails_and_an_order_that_nobody_declares_is_not_judged(tmp_path):
    report, _ = judged(files(tmp_path, 0.1, 0.05), order=3.0, within=1e-3)
    fails = [f"{one.kind} {one.quantity}" for one in report.claims if one.verdict == "FAIL"]
    assert fails == ["reference area", "order in h area", "order in h polarity"]
    report, _ = judged(files(tmp_path, 0.1, 0.05), order=np.nan)
    assert [one.verdict for one in report.claims if one.kind == "order in h"] == ["NOT JUDGED"] * 2


def test_of_a_number_that_is_nothing_there_is_no_order(tmp_path):
    found = [
        Theirs(
            f"h{h}",
            tuple(TIMES),
            {"area": tuple(exact(TIMES) * (1 + h)), "centroid_x": tuple(h + 0 * TIMES)},
            h=h,
        )
        for h in (0.02, 0.01)
    ]
    run = Truth(1e-7, tuple(TIMES), ("area", "centroid_x"), (*exact(TIMES), *np.zeros_like(TIMES)))
    report, asked = judged(found, 1.0, 0.1, [run])
    assert len(asked) == 1
    orders = {one.quantity: one.order for one in report.tables["answers"].rows}
    assert orders["area"] == pytest.approx(1)
    assert np.isnan(orders["centroid_x"])
    assert [one.quantity for one in report.claims if one.kind == "order in h"] == ["area"]


def test_a_series_that_is_late_or_departs_too_far_is_told_so(tmp_path):
    late = read_theirs(write(tmp_path / "late.csv", series(lag=0.01)), SCENE, "a", "")
    (found,) = judged([late])[0].tables["answers"].rows
    assert found.lag == pytest.approx(0.01, rel=0.01)
    assert found.amplitude == pytest.approx(1, abs=1e-4)
    wave = np.sin(6 * TIMES)
    run = Truth(1e-7, tuple(TIMES), ("polarity",), tuple(1 + 0.1 * wave))
    late = Theirs("late", tuple(TIMES), {"polarity": tuple(1 + 0.12 * np.sin(6 * (TIMES - 0.002)))})
    report, asked = judged([late], np.nan, 0.01, [run])
    assert len(asked) == 1  # it is off by so much that no better truth is asked for
    (found,) = report.tables["answers"].rows
    assert found.lag == pytest.approx(0.002, rel=0.01)
    assert found.amplitude == pytest.approx(1.2, rel=0.01)


def test_total_actin_that_is_lost_is_noticed(tmp_path):
    actin = 3 * np.exp(-TIMES)  # nothing is made: d/dt = - total actin
    columns = {"time": TIMES, "area": 0 * TIMES + np.pi, "total_actin": actin}
    balance = next(
        one
        for one in judged(
            [Theirs("x", tuple(TIMES), {k: tuple(v) for k, v in columns.items() if k != "time"})]
        )[0].claims
        if one.kind == "conservation"
    )
    made = np.trapezoid(np.pi - actin, TIMES)
    assert balance.value == pytest.approx(abs(actin[-1] - actin[0] - made) / actin[-1], rel=1e-6)
    assert balance.verdict == "FAIL"


# the truth


def test_a_truth_is_run_once_and_said_to_be_of_before(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = []
    deliver = stored.deliver
    monkeypatch.setattr(stored, "deliver", lambda *given: made.append(given) or deliver(*given))

    def found(name, accuracy=1e-2):
        (tmp_path / name).mkdir()
        return truths.truth(TruthAsked(SCENE.text, SCENE.origin, accuracy), tmp_path / name)

    first, again = found("one"), found("two")
    assert (len(made), first.reused, again.reused) == (1, False, True)
    assert (again.values, again.error) == (first.values, first.error)
    runs = [next((tmp_path / name).iterdir()).read_bytes() for name in ("one", "two")]
    assert runs[0] == runs[1]
    assert not found("finer", 1e-3).reused  # another question
    for kept in (tmp_path / "cache").rglob("*.vtkhdf"):
        kept.write_bytes(kept.read_bytes()[:1000])
    assert not found("three").reused  # what is not whole is none
    assert len(made) == 3
    monkeypatch.setattr(truths, "key_of", lambda *asked: "other-code")
    assert not found("four").reused


def test_a_cache_that_cannot_be_is_none_and_what_is_not_used_goes(tmp_path, monkeypatch):
    kept = tmp_path / "truths" / "kept.vtkhdf"
    (run := tmp_path / "run.vtkhdf").write_bytes(b"a run")
    monkeypatch.setattr(truths, "KEPT", -1)
    truths._keep(run, kept)
    assert list(kept.parent.iterdir()) == []
    truths._keep(run, run / "truths" / "kept.vtkhdf")  # a file where a folder should be
    assert run.read_bytes() == b"a run"


def test_a_truth_of_before_is_said(tmp_path):
    runs = [truth(), replace(truth(), reused=True)]
    report, asked = judged(files(tmp_path, 0.1), np.nan, 0.1, runs)
    assert len(asked) == 2
    assert "was not made again" in report.findings[-1]


# meshes


def meshed(path, refine=4, scale=1.0, z=0.0, field="c", spoil=None):
    import pyvista

    mesh = disk(refine, 0.8)
    points = np.column_stack([scale * mesh.xi.T, z * mesh.xi[0]])
    if spoil is not None:
        points[spoil] = -points[spoil]
    grid = pyvista.UnstructuredGrid({pyvista.CellType.TRIANGLE: mesh.triangles.T}, points)
    grid.point_data[field] = 1 + points[:, 0] ** 2
    grid.save(path)
    return path


def test_a_mesh_is_measured_by_its_own_elements(tmp_path):
    found = read_theirs(meshed(tmp_path / "cell.vtu"), SCENE, "c", "")
    assert found.times == (END,)
    assert found.columns["area"][0] == pytest.approx(np.pi, rel=2e-3)
    assert found.columns["total_actin"][0] == pytest.approx(1.25 * np.pi, rel=5e-3)
    assert found.columns["polarity"][0] == pytest.approx(1, abs=1e-6)
    assert abs(found.columns["centroid_x"][0]) < 1e-12


@pytest.mark.usefixtures("read_here")
def test_a_series_of_meshes_is_read_at_its_times(tmp_path):
    meshed(tmp_path / "0.vtu")
    meshed(tmp_path / "1.vtu", scale=1.1)
    sets = "".join(f'<DataSet timestep="{t}" part="0" file="{i}.vtu"/>' for i, t in enumerate((0.0, END)))
    path = tmp_path / "film.pvd"
    path.write_text(f'<VTKFile type="Collection" version="0.1"><Collection>{sets}</Collection></VTKFile>')
    found = read_theirs(path, SCENE, "c", "")
    assert found.times == (0.0, END)
    assert found.columns["area"][1] / found.columns["area"][0] == pytest.approx(1.21)


WRONG = {
    "names": ({"time": [0.0, END], "aera": [1, 1]}, "did you mean area"),
    "no times": ({"area": [1, 1], "polarity": [1, 1]}, "valid: time and others"),
    "missing": ({"time": [0.0, END / 2], "area": [np.pi] * 2}, "no row at t = "),
    "units": (series(start=300 * np.pi), "units of its radius"),
    "nan": ({"time": TIMES, "area": [np.nan] * len(TIMES)}, "area of row 1 is nan"),
    "words": ({"time": ["soon"], "area": [1]}, "row 1 is soon,1; valid: 2 numbers"),
    "order": ({"time": TIMES[::-1], "area": exact(TIMES[::-1])}, "times do not increase"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_a_table_that_is_wrong_is_one_line(tmp_path, command, kind):
    columns, said = WRONG[kind]
    done = command("judge growing-disk", write(tmp_path / "wrong.csv", columns))
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert said in done.stderr
    assert not (tmp_path / "reports").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"z": 0.3}, "valid: a plane mesh"),
        ({"spoil": 5}, "valid: a conforming triangulation"),
        ({"field": "density"}, "no field 'c' in it; valid: --field with one of density"),
        ({"scale": 1e-3}, "the unit of length"),
    ],
)
@pytest.mark.usefixtures("read_here")
def test_a_mesh_that_is_wrong_is_one_line(tmp_path, command, options, said):
    done = command("judge growing-disk", meshed(tmp_path / "cell.vtu", **options), "--field", "c")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert said in done.stderr


def test_numbers_with_units_are_converted(tmp_path):
    values = {"psi": 20.0, "p": 0.0, "L": 1e-3, "k_a": 0.1}
    scene = load_scene("smooth-fronts").varied({"parameters": None, "dimensional": values, "expect": None})
    t = np.array([0.0, *scene.output_times])
    columns = {"time": 10 * t, "area": 100 * np.pi + 0 * t, "centroid_x": 5 + 0 * t, "polarity": 1 + 0 * t}
    found = read_theirs(write(tmp_path / "si.csv", columns), scene, "a", "um, s")
    assert found.times == pytest.approx(t)
    assert [found.columns[name][0] for name in ("area", "centroid_x", "polarity")] == pytest.approx(
        [np.pi, 0.5, 1]
    )
    with pytest.raises(UserError, match="no row at t"):  # seconds taken for what has no dimension
        read_theirs(tmp_path / "si.csv", scene, "a", "")
    with pytest.raises(UserError, match="states no"):
        read_theirs(tmp_path / "si.csv", SCENE, "a", "um, s")
    with pytest.raises(UserError, match="valid: one of cm, mm"):
        read_theirs(tmp_path / "si.csv", scene, "a", "parsec")


@pytest.mark.slow
def test_a_run_of_ours_is_judged_as_any_other(tmp_path, command, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert command("run static-decay --method fv --refine 3 --dt 0.02 --out r.vtkhdf --quiet").returncode == 0
    done = command("judge static-decay r.vtkhdf --within 0.02 --out j --json --quiet")
    said = json.loads(done.stdout)
    assert (done.returncode, said["command"], said["verdicts"].get("FAIL")) == (0, "judge", None)
    values = {one["quantity"]: one for one in said["values"]}
    assert values["area"]["by"]["static disk" if "static disk" in values["area"]["by"] else "exact solution"][
        "value"
    ] == pytest.approx(np.pi)
    with h5py.File(tmp_path / "j/judge.h5") as file:
        assert file["tables/answers/error"][:].max() < 0.02
    assert "claims hold" in (tmp_path / "j/index.html").read_text()
    again = json.loads(command("judge static-decay r.vtkhdf --within 0.02 --out k --json --quiet").stdout)
    assert "was not made again" in again["findings"][-1]
    assert again["values"] == said["values"]
