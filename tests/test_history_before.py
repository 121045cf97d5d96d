"""What was kept before claims had keys: it goes on under them, once, whole or not at all."""

import json
import math
import sqlite3
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import h5py
import pytest

from actin_xcheck.cli.app import report_command
from actin_xcheck.core.claim import ClaimKind, claim_of
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly.history import FILE_NAME as HISTORY
from actin_xcheck.nightly.history import (
    JudgedNumber,
    append,
    judged_in,
    read_claims,
    read_nights,
    read_series,
)
from actin_xcheck.nightly.items import Group, group_of
from actin_xcheck.nightly.plan import past
from actin_xcheck.nightly.record import FILE_NAME, Done, read_night
from actin_xcheck.report.page import read_claims as claims_in
from actin_xcheck.runs.records import write_table
from actin_xcheck.runs.store import writing
from actin_xcheck.studies.checks import Compared
from actin_xcheck.studies.journal import Journal
from actin_xcheck.studies.study import begin_anew
from tests import nights
from tests.claims import claim
from tests.histories import night
from tests.lab import FEM, FV
from tests.nights import Stub, only_night

a_night = nights.night  # a fixture

OLD = (Path(__file__).parent / "history_before.sql").read_text(encoding="utf-8")
STATIC = f"compare static-decay {FEM} {FV} refine 3"

KEYS = {
    "runs to its end t = 0.5": f"ends/static-decay/{FEM}",
    "total actin obeys the scheme's balance at every step": f"conservation/total_actin/static-decay/{FEM}",
    "concentration equals the exact solution at the end": f"exact/concentration/static-decay/{FEM}",
    "both codes and theory agree on probe a": f"triangle/probe_a/static-decay/{FEM}+{FV}",
    f"{FV} agrees with {FEM} at the end": f"agreement/concentration/static-decay/{FEM}+{FV}",
    "mode (1, 1) grows at": f"growth rate/growth_rate/mode-11-wall/{FEM}",
    "area equals the reference": f"reference/area/fig14-four-fronts/{FEM}",
    "total actin equals the reference": f"reference/total_actin/fig14-four-fronts/{FEM}",
    "concentration at the probes equals": f"reference/probe_a/fig14-four-fronts/{FEM}",
    "positions of the probes equal": f"reference/probe_x/fig14-four-fronts/{FEM}",
    "the order in h of area (relative) is 2": "order in h/area/fitted-ring/fem-p1-imex2",
    "the order in dt of area (relative) is 2": "order in dt/area/smooth-fronts/fem-p1-imex2",
    "a sector and the whole cell": f"reduction/smooth-fronts/{FEM}",
    "steps chosen by the tolerance": "tolerance/smooth-fronts/fv-order2",
    "is caught": "control/fem-leak/fem",
    "completes, and is measured": "cost/fig14-four-fronts/fv-order2",
    "no claim's value is twice": "baseline/claim/baseline",
}
"""Of sentences of the old history, how they begin."""


@pytest.fixture
def old(tmp_path):
    """A history that the version before wrote, and its claims: rows by name."""
    path = tmp_path / HISTORY
    with sqlite3.connect(path) as rows:
        rows.executescript(OLD)
        rows.row_factory = sqlite3.Row
        found = [dict(row) for row in rows.execute("SELECT * FROM claims ORDER BY night")]
    rows.close()
    return path, found


def test_every_series_goes_on_under_its_new_key(old):
    path, rows = old
    before = defaultdict(list)
    for row in rows:
        value = math.nan if row["value"] is None else row["value"]
        before[row["key"]].append((row["night"], value))
    order = {one.night.name: number for number, one in enumerate(read_nights(path), 1)}
    after = {
        one.key: [(order[at.name], value) for at, value in zip(one.nights, one.values.tolist(), strict=True)]
        for one in read_series(path, "claim/*")
    }
    assert len(before) == len(after) > 30
    assert sorted(map(str, before.values())) == sorted(map(str, after.values()))
    static = after[f"claim/exact/concentration/static-decay/{FEM} · {STATIC}"]
    assert [number for number, _ in static] == [1, 2, 3]


def test_claims_keep_all_they_had(old):
    path, rows = old
    nights = [one.night.name for one in read_nights(path)]
    found = {(name, key): one for name in nights for key, one in read_claims(path, name).items()}
    assert len(found) == len(rows)
    told = {(nights[row["night"] - 1], row["statement"], row["scene"], row["methods"]): row for row in rows}
    for (at, key), one in found.items():
        said = one.claim
        row = told.pop((at, f"{said.statement} · {one.check}", said.scene, " ".join(said.methods)))
        assert key == one.key
        assert (said.verdict, said.command, said.path, said.note, one.source, one.seconds) == tuple(
            row[name] for name in ("verdict", "command", "path", "note", "source", "seconds")
        )
        assert [None if number != number else number for number in (said.value, said.bound)] == [
            row[name] for name in ("value", "bound")
        ]
        assert group_of(said) is not Group.OTHER


def test_keys_are_those_that_claims_have_now(old, tmp_path):
    path, _ = old
    judged = [one for at in read_nights(path) for one in read_claims(path, at.night.name).values()]
    for words, key in KEYS.items():
        assert key in {one.claim.key for one in judged if one.claim.statement.startswith(words)}, words
    broken = {
        one.claim.key: group_of(one.claim) for one in judged if one.claim.statement == "comes to a verdict"
    }
    assert broken == {
        f"ends/{STATIC}": Group.ENDS,
        "control/fem-leak": Group.CONTROLS,
        "cost/cost fig14-four-fronts fv-order2 refine 3": Group.COST,
    }
    diluted = [one.claim for one in judged if one.claim.kind is ClaimKind.GEOMETRY]
    assert {one.scene for one in diluted} == {"uniform-dilution"}
    now = Compared("static-decay", (FEM, FV), 3, 5).claims(tmp_path)
    assert {one.key for one in now} == {
        one.claim.key for one in judged if one.check == STATIC and one.claim.methods
    }
    done = Done(STATIC, tuple(now), ("",) * len(now), (), 1.0)
    append(path, night(300), (), judged_in((done,)))
    assert {
        len(one.nights) for one in read_series(path, f"claim/*· {STATIC}") if "/ends/compare" not in one.key
    } == {4}


def test_the_plan_knows_what_the_old_nights_knew(old):
    path, _ = old
    assert past(path).seconds[STATIC] > 0


AT_ONCE = """
import sys
import actin_xcheck
from actin_xcheck.nightly.history import append, read_series
from actin_xcheck.nightly.record import Night
print("ready", flush=True)
sys.stdin.readline()
found = len(read_series(sys.argv[1]))
append(sys.argv[1], Night("new", "2027-01-01", "c", {}, "m"), ())
print(found)
"""


def test_two_that_open_it_at_once_bring_it_forward_once(old):
    path, rows = old
    call, pipes = (
        [sys.executable, "-c", AT_ONCE, str(path)],
        {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE},
    )
    started = [subprocess.Popen(call, text=True, **pipes) for _ in "abc"]
    assert [one.stdout.readline() for one in started] == ["ready\n"] * 3
    for one in started:
        one.stdin.write("\n")
        one.stdin.flush()
    said = [one.communicate()[0] for one in started]
    assert [one.returncode for one in started] == [0] * 3
    assert len(set(said)) == 1
    assert len(read_nights(path)) == 4 + len(started)
    with sqlite3.connect(path) as now:
        counts = [now.execute(f"SELECT count(*) FROM {table}").fetchone() for table in ("claims", "claims_1")]
        assert counts == [(len(rows),)] * 2
        assert now.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    now.close()


def test_a_history_that_cannot_be_brought_forward_stays_as_it_was(old):
    path, _ = old
    with sqlite3.connect(path) as damaged:
        damaged.execute("UPDATE claims SET statement = x'ff' WHERE night = 4")
    damaged.close()
    whole = path.read_bytes()
    for asked in (read_nights, lambda path: append(path, night(1), ())):
        with pytest.raises(UserError, match=r"history\.sqlite: not a whole history"):
            asked(path)
        assert path.read_bytes() == whole


# other files


AREA = claim(
    "area equals the reference value (relative error)", 0.1, kind=ClaimKind.REFERENCE, quantity="area"
)


def test_a_comparison_of_before_is_refused_with_what_makes_it_again(tmp_path):
    with writing(tmp_path / "comparison.h5", {"command": "python -m actin_xcheck compare stirred"}):
        pass
    said = r"of an earlier version; valid: python -m actin_xcheck compare stirred, with --force"
    with pytest.raises(UserError, match=said):
        report_command(tmp_path)
    with pytest.raises(UserError, match=r"holds comparison\.h5 already; valid: another folder, or --force"):
        Journal(tmp_path, "compare")
    begin_anew(tmp_path)
    Journal(tmp_path, "compare")


def test_a_chart_of_before_is_refused_with_what_makes_it_again(tmp_path):
    with writing(tmp_path / "chart.h5", {"command": "python -m actin_xcheck chart stirred"}):
        pass
    with pytest.raises(UserError, match=r"earlier version; valid: python -m actin_xcheck chart stirred, w"):
        report_command(tmp_path)


def test_the_report_of_a_study_of_before_has_its_claims(tmp_path):
    with h5py.File(tmp_path / "study.h5", "w") as file:
        write_table(file.create_group("claims"), [AREA, claim("all is well")])
        del file["claims/kind"], file["claims/quantity"]
        named, unknown = claims_in(file)
    assert named == AREA
    assert (unknown.kind, unknown.quantity) == (ClaimKind.OTHER, "all is well")  # apart from others


def test_a_night_of_before_is_read(a_night, tmp_path):
    assert a_night(Stub("one")) == 0
    path = only_night(tmp_path).folder / FILE_NAME
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    for line in lines:
        for found in line.get("done", {}).get("claims", ()):
            del found["kind"], found["quantity"]
            found["statement"] = AREA.statement
    path.write_text("\n".join(map(json.dumps, lines)))
    (found,) = read_night(path.parent).claims
    assert (found.kind, found.quantity) == (AREA.kind, AREA.quantity)


def test_a_kind_that_is_none_is_no_claim_and_a_claim_of_two_checks_has_two_keys():
    with pytest.raises(ValueError, match="colour"):
        claim_of({**vars(AREA), "kind": "colour"})
    assert JudgedNumber(AREA, "one").key != JudgedNumber(AREA, "two").key
