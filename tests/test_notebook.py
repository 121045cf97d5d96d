"""Results in notebooks: what they show is what they are, and an example runs from end to end."""

import base64
import io
import re
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from PIL import Image

import actin_xcheck
from actin_xcheck.core.errors import UserError
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.theory.eigenfields import growth_rate

ROOT = Path(__file__).parents[1]
SCENE = {
    "name": "mine",
    "parameters": {"psi": 0, "p": 0},
    "initial": {"a": "1 + 0.1*x"},
    "time": {"end": 0.2, "outputs": [0.1]},
    "probes": {"points": [[0, 0], [0.5, 0]]},
}


@pytest.fixture(scope="module")
def run():
    return actin_xcheck.run(SCENE, "fem-p2-imex3", refine=1, dt=0.1)


def test_a_run_shows_its_end_its_numbers_and_its_film(run):
    assert repr(run) == "<Run mine by fem-p2-imex3, refine 1: completed at t = 0.2, 3 frames>"
    shown = run._repr_html_()
    assert f"<td>area</td><td>{run.series['area'][-1]:.6g}</td>" in shown
    film = re.search(r'src="data:image/gif;base64,([^"]+)"', shown)
    assert Image.open(io.BytesIO(base64.b64decode(film[1]))).n_frames == 3


def test_a_run_is_handed_on_whole(run):
    series, film = run.to_pandas(), run.to_xarray()
    assert np.array_equal(series["area"], run.series["area"])
    assert np.array_equal(series.index, run.series["time"])
    assert np.array_equal(series["probe_x_1_0"], run.series["probe_x"][:, 1, 0])
    assert film["x"].dims == ("time", "axis", "node")
    assert np.array_equal(film["a"].sel(time=0.1), run.a_points[1])
    assert film.attrs["method_name"] == "fem-p2-imex3"


def test_a_dict_is_checked_like_a_file():
    with pytest.raises(UserError, match=r"^mine: time.end = -1"):
        actin_xcheck.run(SCENE | {"time": {"end": -1}}, "fv")


def test_predict_gives_the_exact_rates():
    scene = load_scene("mode-11-wall")
    found = actin_xcheck.predict("mode-11-wall", m=[1])
    assert found[0]["m"] == 1
    assert found[0]["rate"].real == pytest.approx(growth_rate(scene.physics, 1, 1).real, rel=1e-9)
    with pytest.raises(UserError, match=r"^predict: linear theory takes delta constant"):
        actin_xcheck.predict("fig14-four-fronts")


@pytest.mark.slow
def test_a_comparison_and_a_report_show_what_they_come_to(tmp_path):
    found = actin_xcheck.cross_check("static-decay", ["fem-p1-imex2", "fv"], refine=2, out=tmp_path, jobs=1)
    assert repr(found).startswith("<Comparison of 2 runs: ")
    assert "static-decay: area " in found._repr_html_()
    table = found.to_pandas()
    assert list(table["verdict"]) == [one.verdict for one in found.claims]
    again = actin_xcheck.cross_check(
        "static-decay", ["fem-p1-imex2", "fv"], refine=2, out=tmp_path, jobs=1, force=True
    )
    assert [one.value for one in again.claims] == [one.value for one in found.claims]


@pytest.mark.slow
def test_converge_returns_its_report(tmp_path):
    report = actin_xcheck.converge("static-decay", ["fem-p1-imex2"], out=tmp_path, jobs=1)
    assert repr(report) == f"<Report: {report.title}>"
    assert report.title in report._repr_html_()
    assert (tmp_path / "index.html").exists()


@pytest.mark.slow
def test_the_example_runs_as_it_stands():
    notebook = nbformat.read(ROOT / "examples" / "notebook.ipynb", as_version=4)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(ROOT)}}).execute()
    outputs = [cell.outputs[-1].data for cell in notebook.cells if cell.cell_type == "code"]
    assert "data:image/gif" in outputs[0]["text/html"]
    assert "total_actin" in outputs[1]["text/html"]
    assert "time: 3" in outputs[2]["text/plain"]
    assert "(11." in outputs[3]["text/plain"] or "rate" in outputs[3]["text/plain"]
