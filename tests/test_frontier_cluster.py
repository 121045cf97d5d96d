"""A frontier by processes of its own and by those of a cluster: the same, whoever is lost."""

import sqlite3
from dataclasses import replace

import pytest

from actin_xcheck.studies.frontier import examine as examination
from actin_xcheck.studies.frontier.record import FILE_NAME, read_frontier
from tests.frontiers import FIG14, METHODS_SHOWN, shrink
from tests.processes import cluster
from tests.test_cli import one_line
from tests.test_tools import command  # noqa: F401  a fixture


def rows_of(folder):
    """What was found, but for what it took."""
    maps = read_frontier(folder / FILE_NAME).maps
    return [[repr(replace(row, seconds=0.0)) for row in one.points] for one in maps]


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_finds_what_one_process_finds(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    shrink(monkeypatch)
    alone, together = tmp_path / "alone", tmp_path / "together"
    alone.mkdir(), together.mkdir()
    examination.examine(FIG14, METHODS_SHOWN, ["psi,dt"], alone, "", 1)
    came = []
    with cluster(tmp_path, 2) as (address, (_, *workers)):

        def count(label, done, total):
            came.append(label)
            if len(came) == 3:
                workers[0].kill()  # SIGKILL, in the middle of what it does

        examination.examine(FIG14, METHODS_SHOWN, ["psi,dt"], together, "", 1, address, count)
        assert workers[0].wait(10) < 0
        assert workers[1].poll() is None
    assert rows_of(together) == rows_of(alone)
    assert sum(map(len, rows_of(alone))) > 10
    with sqlite3.connect(together / "points.sqlite") as rows:
        assert rows.execute("SELECT count(*) FROM runs").fetchone() == (len(came),)  # each came in once
    rows.close()


def test_jobs_and_scheduler_are_one_or_the_other(tmp_path, command):  # noqa: F811
    for name in ("frontier", "nightly", "sweep x.toml --method fem-p1-paper"):
        done = command(*name.split(), "--out", "out", "--jobs", 2, "--scheduler", "tcp://here:1")
        one_line(done, "--jobs", "--scheduler", "one of the two")
    for name in ("frontier", "nightly"):
        done = command(name, "--out", "out", "--quiet", "--scheduler", "nonsense://here")
        one_line(done, "--scheduler", "nonsense")
    assert not list(tmp_path.glob("out/2*"))  # no night was begun
