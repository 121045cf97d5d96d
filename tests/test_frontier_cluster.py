"""A study by processes of its own and by those of a cluster: the same, whoever is lost."""

from dataclasses import replace

import pytest

from actin_xcheck.runs.executor import executor
from tests.frontiers import small
from tests.processes import cluster
from tests.studies import carry
from tests.test_cli import one_line
from tests.test_tools import command  # noqa: F401  a fixture


def rows_of(report):
    """What was found, but for what it took."""
    return [repr(replace(row, seconds=0.0)) for row in report.tables["points"].rows]


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_finds_what_one_process_finds(tmp_path):
    pytest.importorskip("distributed")
    alone, together = tmp_path / "alone", tmp_path / "together"
    alone.mkdir(), together.mkdir()
    expected, came = carry(alone, small(), name="frontier"), []
    with cluster(tmp_path, 2) as (address, (_, *workers)):

        def count(label, done, total):
            came.append(label)
            if len(came) == 3:
                workers[0].kill()  # SIGKILL, in the middle of what it does

        with executor(1, address) as processes:
            found = carry(together, small(), processes, "frontier", count)
        assert workers[0].wait(10) < 0
        assert workers[1].poll() is None
    assert rows_of(found) == rows_of(expected)
    assert len(rows_of(found)) > 10


def test_jobs_and_scheduler_are_one_or_the_other(tmp_path, command):  # noqa: F811
    for name in ("frontier", "nightly", "sweep x.toml --method fem-p1-paper"):
        done = command(*name.split(), "--out", "out", "--jobs", 2, "--scheduler", "tcp://here:1")
        one_line(done, "--jobs", "--scheduler", "one of the two")
    for name in ("frontier", "nightly"):
        done = command(name, "--out", "out", "--quiet", "--scheduler", "nonsense://here")
        one_line(done, "--scheduler", "nonsense")
    assert not list(tmp_path.glob("out/2*"))  # no night was begun
