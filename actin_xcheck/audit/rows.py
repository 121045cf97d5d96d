"""All rows of the audit: what theory alone examines, then what simulations do."""

from actin_xcheck.audit.row import Row
from actin_xcheck.audit.simulations.figures import FIGURES_SIMULATED
from actin_xcheck.audit.simulations.sentences import SENTENCES_SIMULATED
from actin_xcheck.audit.simulations.translation import TRANSLATION
from actin_xcheck.audit.theory import THEORY

ROWS: dict[str, Row] = {
    row.key: row for row in (*THEORY, *FIGURES_SIMULATED, TRANSLATION, *SENTENCES_SIMULATED)
}
"""By key."""
