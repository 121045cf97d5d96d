"""A night on a real cluster: checks by its workers, costs here."""

import json
from pathlib import Path

import pytest

from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly import carry_out as work
from actin_xcheck.nightly.carry_out import Asked, carry_out
from actin_xcheck.nightly.plan import past
from actin_xcheck.nightly.record import FILE_NAME, Done, Kind
from tests.nights import Stub, only_night
from tests.processes import cluster
from tests.test_cli import cli

ONLY = ("compare static-decay*", "run smooth-fronts fv-order2 refine 2 rtol 1e-05", "cost * fem-p1-paper *")


@pytest.mark.slow
def test_checks_go_to_the_cluster_and_costs_are_measured_here(tmp_path: Path) -> None:
    """To workers as `dask worker` starts them: daemons of a nanny, with threads."""
    pytest.importorskip("distributed")
    words = [word for name in ONLY for word in ("--only", name)]
    (tmp_path / "away").mkdir()
    with cluster(tmp_path / "away", 1, ("--nthreads", "2", "--nworkers", "1")) as (address, _):
        done = cli("nightly", *words, "--scheduler", address, "--out", "out", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    kept = only_night(tmp_path / "out")
    there = {one.name: one for one in kept.done if one.host}
    here = {one.name: one for one in kept.done if not one.host}
    assert {name.split()[0] for name in there} == {"compare", "run"}
    assert [name.split()[0] for name in here] == ["cost"]
    assert not any(number.kind.of_machine for one in there.values() for number in one.numbers)
    assert {Kind.TIME, Kind.MEMORY} <= {number.kind for one in here.values() for number in one.numbers}
    assert all(one.reached and any(n.kind is Kind.COUNT for n in one.numbers) for one in there.values())
    assert all((kept.folder / file).is_file() for one in there.values() for file in one.files if file)
    assert json.loads(done.stdout)["checks"].keys() == there.keys() | here.keys()
    planned = past(tmp_path / "out" / "history.sqlite").seconds
    assert all(planned[name] == one.seconds > 0 for name, one in there.items())


@pytest.mark.slow
def test_a_workers_check_has_a_process_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / FILE_NAME).touch()
    done = carry_out(Asked(Stub("a stub"), away=True), tmp_path)
    assert isinstance(done, Done)
    assert (done.red, done.folder) == (0, "checks/a_stub")
    assert [number.key for number in done.numbers] == ["error/a stub"]
    assert done.seconds > 0
    done = carry_out(Asked(Stub("a stub", how="dies"), away=True), tmp_path)
    assert isinstance(done, Done)
    assert done.trouble == "broke down: its process ended with exit code 7"
    (tmp_path / FILE_NAME).unlink()
    with pytest.raises(UserError, match=f"does not see {tmp_path}; valid: --out names a folder"):
        carry_out(Asked(Stub("a stub"), away=True), tmp_path)
    monkeypatch.setattr(work, "code", lambda: "other")
    with pytest.raises(UserError, match="another version of the code"):
        carry_out(Asked(Stub("a stub"), away=True), tmp_path)
