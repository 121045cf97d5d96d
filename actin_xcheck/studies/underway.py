"""What a page says of a study while it is under way."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

LAST = 200
"""Answers of a kind on the page, the last ones."""

LONG = 10.0
"""Seconds of work that are worth a page of what is under way."""

_DEAREST = 0.02
"""Part of the time in which the page may be written."""


@dataclass
class Underway:
    """The page of a study in a folder, written when it begins and then now and then."""

    folder: Path
    name: str
    _began: float = field(default_factory=lambda: time.monotonic())
    _first: float = math.nan
    _next: float = -math.inf

    def show(self, answers: Sequence[tuple[str, Any]], over: float, whole: float) -> None:
        """Write the page, unless that was done just now or is not worth while.

        Parameters
        ----------
        answers : so far, each with the file it left; records of several classes.
        over, whole : seconds of work that are over, and in all, as they were expected.
        """
        began = time.monotonic()
        if math.isnan(self._first):
            self._first = over
            if whole - over < LONG:
                self._next = math.inf
        if began < self._next:
            return
        from actin_xcheck.report.page import AGAIN, write_underway  # here: a worker draws no page

        pace = (began - self._began) / (over - self._first) if over > self._first else math.inf
        kinds: dict[str, list[tuple[str, Any]]] = {}
        for file, one in answers:
            kinds.setdefault(type(one).__name__, []).append((file, one))
        tables = {kind: _columns(rows[-LAST:]) for kind, rows in kinds.items()}
        claims = [claim for _, one in answers for claim in getattr(one, "claims", ())]
        write_underway(self.folder, self.name, over / (whole or 1), pace * (whole - over), claims, tables)
        now = time.monotonic()
        self._next = now + max(AGAIN, (now - began) / _DEAREST)


def _columns(rows: Sequence[tuple[str, Any]]) -> dict[str, list[Any]]:
    """Files, and what of their answers is a number or words."""
    from actin_xcheck.studies.study import Table

    files = [file for file, _ in rows]
    return ({"file": files} if any(files) else {}) | Table("", [one for _, one in rows]).columns
