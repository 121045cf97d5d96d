"""All rows of the audit, in the order of the article."""

import re

from actin_xcheck.studies.audit.row import Row
from actin_xcheck.studies.audit.simulations.figures import FIGURES_OF_CELLS
from actin_xcheck.studies.audit.simulations.figures_modes import FIGURES_OF_MODES
from actin_xcheck.studies.audit.simulations.sentences import SENTENCES_SIMULATED
from actin_xcheck.studies.audit.simulations.translation import TRANSLATION
from actin_xcheck.studies.audit.theory import THEORY


def _place(row: Row) -> list[tuple[bool, int, str]]:
    """Sorts keys as the article counts: (2.1b) before (3.3) before (A.1), Fig. 6 before Fig. 21."""
    parts = re.findall(r"\d+|[^\d.-]+", row.key)
    return [(not part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts]


_ALL = (*THEORY, *FIGURES_OF_MODES, *FIGURES_OF_CELLS, TRANSLATION, *SENTENCES_SIMULATED)

ROWS: dict[str, Row] = {row.key: row for row in sorted(_ALL, key=_place)}
"""By key."""
