"""Codes of others in `examples/outside/`: what they compute is judged, and what the docs say of it is so."""

import csv
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DEBIAN = "/usr/bin/python3"
CODES = {
    "skfem": (sys.executable, "skfem"),
    "ngsolve": (sys.executable, "ngsolve"),
    "fenicsx": (DEBIAN, "dolfinx"),
}
"""What runs each, and the module it needs."""

ROW = re.compile(r"\| `(\w+)_cell\.py (\S+) (\S+)` \| ([\d.]+) \| ([\d.]+) \|")


def rows():
    """Of the docs' table: code, mesh, step, area and total actin at the end."""
    return ROW.findall((ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8"))


def run(code, mesh, dt, path):
    python, module = CODES[code]
    if (
        not shutil.which(python)
        or subprocess.run([python, "-c", f"import {module}"], check=False, capture_output=True).returncode
    ):
        pytest.skip(f"needs {module}")
    script = ROOT / "examples" / "outside" / f"{code}_cell.py"
    subprocess.run(
        [python, str(script), mesh, dt, str(path)], check=True, cwd=path.parent, capture_output=True
    )
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_every_code_has_three_rows():
    assert [one[0] for one in rows()] == [code for code in CODES for _ in range(3)]


def test_the_coarsest_run_of_plain_scikit_fem_is_what_the_docs_say_and_is_judged(tmp_path, command):
    _, mesh, dt, area, actin = rows()[0]
    last = run("skfem", mesh, dt, tmp_path / "theirs.csv")[-1]
    assert float(last["area"]) == pytest.approx(float(area), abs=1e-4)
    assert float(last["total_actin"]) == pytest.approx(float(actin), abs=1e-4)


@pytest.mark.nightly
@pytest.mark.parametrize("row", range(9))
def test_what_others_compute_is_what_the_docs_say(row, tmp_path):
    code, mesh, dt, area, actin = rows()[row]
    last = run(code, mesh, dt, tmp_path / "theirs.csv")[-1]
    near = 2e-3 if code == "ngsolve" else 1e-4  # its mesher is its own, and changes
    assert float(last["area"]) == pytest.approx(float(area), abs=near)
    assert float(last["total_actin"]) == pytest.approx(float(actin), abs=near)
