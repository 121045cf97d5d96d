"""What has been run, kept as it comes: a small file each, written by whichever process ran it.

A process that is killed loses the run it was in.  Files are found by what was run and by which code: those of
a checkout with changes, or of none, are not taken up again.
"""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from actin_xcheck.core.files import replace_file
from actin_xcheck.runs.workers import Report
from actin_xcheck.studies.distort.cases import Case
from actin_xcheck.studies.distort.measure import Answer, Truth, answer_of, truth_of


@dataclass(frozen=True)
class Task:
    """A case, or a scene (TOML) whose truth is wanted; the folder its answer is kept in; the code (JSON)."""

    what: Case | str
    folder: Path
    code: str

    @property
    def path(self) -> Path:
        """Where the answer is kept."""
        stated = self.what if isinstance(self.what, str) else asdict(self.what)
        key = hashlib.sha256(json.dumps([stated, self.code]).encode()).hexdigest()
        return self.folder / f"{key}.json"

    def known(self) -> Answer | Truth | None:
        """The answer, if this code has found it before."""
        commit = json.loads(self.code)["commit"]
        if commit == "unknown" or commit.endswith("-dirty") or not self.path.exists():
            return None
        found: dict[str, Any] = json.loads(self.path.read_text())
        return _answer(found) if "a" in found else Truth(**found | {"answer": _answer(found["answer"])})


def work(task: Task, report: Report) -> Answer | Truth:
    """Do a task, keep what was found and say so."""
    found = truth_of(task.what) if isinstance(task.what, str) else answer_of(task.what)
    replace_file(task.path, json.dumps(asdict(found)).encode())
    report("", 1, 1)
    return found


def _answer(found: dict[str, Any]) -> Answer:
    return Answer(**found | {"a": tuple(found["a"])})
