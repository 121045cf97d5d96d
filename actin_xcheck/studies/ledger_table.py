"""The term ledger as a table of a page, from what a file holds."""

from collections.abc import Sequence
from dataclasses import dataclass

from actin_xcheck.studies.ledger import MEASURES, Entry

NOTICEABLE = 0.1
"""Of a run's time: what a term must cost to be told from the scatter of clocks."""


@dataclass(frozen=True)
class LedgerRow:
    """One term: name, symbol and the entry that drops it, its verdict, four changes and its cost in words."""

    term: str
    symbol: str
    entry: str
    sentence: str
    changes: tuple[str, ...]
    cost: str


@dataclass(frozen=True)
class LedgerTable:
    """A ledger to be shown by `ledger.html`: what its columns are, its rows and what they were made with."""

    columns: tuple[str, ...]
    rows: tuple[LedgerRow, ...]
    note: str


def ledger_table(entries: Sequence[Entry]) -> LedgerTable:
    """Put a ledger, of one entry at least, into words."""
    first = entries[0]
    note = (
        "Largest changes over the output times, relative for area and total actin, absolute at probes; the "
        f"runs themselves are exact to {first.resolved:.1e}. With all terms a run takes {first.steps:.0f} "
        f"steps of {1e3 * first.step_seconds:.3g} ms (median, processor time)."
    )
    return LedgerTable(tuple(MEASURES.values()), tuple(map(_row, entries)), note)


def _row(entry: Entry) -> LedgerRow:
    changes = tuple(f"{getattr(entry, name):.1e}" if entry.largest else "0" for name in MEASURES)
    return LedgerRow(entry.term, entry.symbol, entry.entry, entry.sentence, changes, _cost(entry))


def _cost(entry: Entry) -> str:
    """What the term costs, and the step without it."""
    if entry.cost != entry.cost:  # nan: it was not dropped
        return "not measured"
    share = entry.cost / (entry.steps * entry.step_seconds)
    said = f"{share:.0%} of the run" if abs(share) > NOTICEABLE else "nothing noticeable"
    return f"{said}; without it {entry.steps_without:.0f} steps of {1e3 * entry.step_seconds_without:.3g} ms"
