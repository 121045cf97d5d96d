"""Two commands at once in one place, a reader who has gone, and Python that leaves assertions out."""

import subprocess
import sys

import pytest

from actin_xcheck.runs.store import reading
from tests.kills import bits
from tests.processes import started

COMPARE = "compare static-decay --refine 2 --dt 0.1 --out both --quiet"
NIGHT = "nightly --budget 1 --out nights --quiet --only"
RUN = "run static-decay --method fem-p1-imex2 --refine 2 --dt 0.1 --quiet --out"


@pytest.mark.slow
def test_two_comparisons_into_one_folder_are_one_report_and_one_line(tmp_path):
    both = [started(tmp_path, COMPARE) for _ in range(2)]
    said = [(*one.communicate(timeout=300), one.returncode) for one in both]
    (_, refused, _), *done = sorted(said, key=lambda one: -one[2])
    if refused:  # else the first was over before the second began
        assert refused.count("\n") == 1
        assert "another process is writing it; valid: another name, or to wait" in refused
    for out, error, code in done:
        assert code == 0
        assert error == ""
        assert "11 of 11 claims hold" in out
    with reading(tmp_path / "both" / "compare.h5", "report") as file:
        assert len(file["claims/kind"]) == 11


@pytest.mark.slow
def test_two_nights_into_one_folder_lose_nothing(tmp_path):
    """One is refused in a line or both are kept; the folder shows its nights."""
    check = "compare static-decay fem-p1-paper fv-coupled refine 3"
    both = [started(tmp_path, NIGHT, check) for _ in range(2)]
    said = [(*one.communicate(timeout=500), one.returncode) for one in both]
    kept = sum(code != 2 for *_, code in said)
    assert kept
    for _, error, code in said:
        assert "Traceback" not in error
        assert code != 2 or (error.startswith("actin_xcheck: ") and error.count("\n") == 1)
    history = started(tmp_path, "history --file nights/history.sqlite --json")
    out, error = history.communicate(timeout=100)
    assert (history.returncode, error) == (0, ""), (out, error)


@pytest.mark.parametrize("line", ["scenes", "predict modes --psi 270 --p 0 --m 0:2 --json"])
def test_a_reader_who_has_gone_is_no_traceback(line, tmp_path):
    with started(tmp_path, line) as process:
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode in (0, 1)


@pytest.mark.slow
def test_python_without_assertions_gives_the_same_bits(tmp_path):
    for options, name in (((), "a.vtkhdf"), (("-O",), "b.vtkhdf")):
        words = [sys.executable, *options, "-W", "error", "-m", "actin_xcheck", *RUN.split(), name]
        subprocess.run(words, cwd=tmp_path, capture_output=True, check=True)
    assert bits(tmp_path / "a.vtkhdf") == bits(tmp_path / "b.vtkhdf")
