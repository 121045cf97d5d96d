"""What every study owes: the same bits when it goes on, a page of its file alone, a folder and an answer."""

import re
import shutil
from collections import Counter
from contextlib import nullcontext
from dataclasses import fields, is_dataclass, replace
from functools import partial

import h5py
import numpy as np
import pytest
import typer

from actin_xcheck.cli.conduct import page_of, study_command
from actin_xcheck.cli.output import ReportAnswer
from actin_xcheck.core.errors import UserError
from actin_xcheck.report.page import read_claims
from actin_xcheck.runs import executor as executors
from actin_xcheck.studies import study as studies
from actin_xcheck.studies.journal import FILE_NAME as JOURNAL
from tests.small import SMALL
from tests.studies import numbers
from tests.tags import SCRIPT, whole_in_itself

EVERY = pytest.mark.parametrize("name", SMALL)
OWN_PAGE = {"compare", "paper"}
"""Whose pages do not show tables as those of others do."""


@pytest.fixture
def whole(name, carried):
    return carried(name)


@EVERY
def test_what_was_interrupted_goes_on_and_comes_to_the_same_bits(whole, tmp_path):
    first, rest = whole.played(len(whole.answers) // 2), whole.played()
    with pytest.raises(KeyboardInterrupt):
        whole.again(tmp_path, first)
    assert not (tmp_path / whole.file.name).exists()
    whole.again(tmp_path, rest)
    assert sorted(first.asked + rest.asked) == sorted(whole.answers)  # each once
    assert numbers(tmp_path / whole.file.name) == numbers(whole.file)
    with h5py.File(whole.file) as one, h5py.File(tmp_path / whole.file.name) as other:
        for said in ("study", "title", "lead", "findings"):
            assert np.array_equal(one.attrs[said], other.attrs[said])


@EVERY
def test_what_has_lost_its_file_is_asked_for_again_and_nothing_else(whole, tmp_path):
    whole.again(tmp_path, whole.played())
    lost = next((file for files in whole.files.values() for file in files), "")
    (tmp_path / lost).unlink() if lost else None
    whole.again(tmp_path, again := whole.played())
    assert sorted(again.asked) == sorted(key for key, files in whole.files.items() if lost in files)
    assert (tmp_path / lost).exists()


@EVERY
def test_a_command_says_the_cost_then_what_came_out_and_has_its_folder(whole, tmp_path, monkeypatch, capsys):
    def said(name=whole.name, **options):
        """Exit code, what was printed, and what was asked of processes."""
        processes = whole.played()
        monkeypatch.setattr(executors, "executor", lambda *asked: nullcontext(processes))
        monkeypatch.setattr(studies, "carry_out", partial(carry_out, alone=processes.alone))
        words = {"predict": "predict report"}.get(name, "")
        with pytest.raises(typer.Exit) as end:
            study_command(name, words)(whole.study)(out_dir=tmp_path, **options)
        return end.value.exit_code, *capsys.readouterr(), processes.asked

    carry_out, report = studies.carry_out, whole.report
    failed = [claim.sentence for claim in report.claims if claim.verdict == "FAIL"]
    code, printed, told, asked = said()
    assert re.fullmatch(rf"{whole.name}: about \d+ (s|min)", told.splitlines()[0])
    assert code == bool(failed)
    for sentence in (*(f"FAIL {one}\n" for one in failed), *report.findings, f"{report.title}; report: "):
        assert sentence in printed
    assert sorted(asked) == sorted(whole.answers)
    code, printed, told, asked = said(json=True)
    answer = ReportAnswer.model_validate_json(printed)
    assert (code, "about" in told, asked) == (bool(failed), False, [])  # all is known
    assert answer.page == str(tmp_path / "index.html")
    assert answer.verdicts == (report.verdicts or Counter(claim.verdict for claim in report.claims))
    assert len(answer.findings) == len(failed) + len(report.findings)
    (tmp_path / "mine.txt").touch()
    *_, asked = said(force=True, quiet=True)
    assert sorted(asked) == sorted(whole.answers)
    assert (tmp_path / "mine.txt").exists()
    with pytest.raises(UserError, match=f"is the folder of `{whole.name}`; valid: another one, or --force"):
        study_command("other")(whole.study)(out_dir=tmp_path)


@EVERY
def test_a_page_is_made_of_the_file_alone_and_says_all_that_it_holds(whole, tmp_path):
    shutil.copytree(whole.folder, tmp_path / "moved")
    for name in ("index.html", JOURNAL):
        (tmp_path / "moved" / name).unlink()
    page = page_of(tmp_path / "moved" / whole.file.name)
    assert page.read_text(encoding="utf-8") == (whole.folder / "index.html").read_text(encoding="utf-8")
    words, report = whole_in_itself(page).words, whole.report
    with h5py.File(whole.file) as file:
        for read, given in zip(read_claims(file), report.claims, strict=True):
            assert (read.key, read.sentence, read.command) == (given.key, given.sentence, given.command)
    shown = [part for one in report.claims for part in (one.statement, one.command, one.note)]
    for one in report.chapters:
        shown += [
            one.title,
            *(part for each in one.exhibits for part in (each.title, f"/exhibits/{one.key}/{each.key}")),
        ]
    if whole.name not in OWN_PAGE:
        shown += [report.title, *report.findings, *(table.title for table in report.tables.values())]
        for table in report.tables.values():
            rows = [] if isinstance(table.rows, dict) else table.rows
            columns = table.shown or [one.name for row in rows[:1] for one in fields(row)]
            cells = [str(getattr(row, column)) for row in rows for column in columns if column != "file"]
            shown += [cell for cell in cells if re.search("[a-z] [a-z]", cell)]  # sentences and commands
    assert [one for one in shown if " ".join(one.split()) not in words] == []


@pytest.mark.parametrize(
    "name", [name for name in SMALL if name != "compare"]
)  # whose page shows runs, see test_hostile
def test_what_a_file_says_is_text_and_never_markup(whole, tmp_path):
    report = whole.report
    hurt = replace(
        report,
        title=SCRIPT,
        lead=SCRIPT,
        findings=(SCRIPT,),
        claims=tuple(
            replace(one, statement=SCRIPT, note=SCRIPT, command=SCRIPT, path=SCRIPT) for one in report.claims
        ),
        tables={
            key: replace(one, title=SCRIPT, note=SCRIPT, rows=hurtful(one.rows))
            for key, one in report.tables.items()
        },
        chapters=hurtful(report.chapters),
    )
    studies.write_report(tmp_path / whole.file.name, whole.name, hurt, SCRIPT)
    tags = whole_in_itself(page_of(tmp_path / whole.file.name))
    assert tags.text.count(SCRIPT) > 3


NAMES = {"key", "file", "finer_file", "shape", "verdict", "classes"}


def hurtful(value):
    """Rows and exhibits with a script in place of all words that are no names."""
    if is_dataclass(value):
        return replace(
            value,
            **{one.name: hurtful(getattr(value, one.name)) for one in fields(value) if one.name not in NAMES},
        )
    if isinstance(value, tuple | list):
        return type(value)(map(hurtful, value))
    return SCRIPT if type(value) is str and value else value
