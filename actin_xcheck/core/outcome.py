"""How a run ends: an Outcome is a value with a sentence, and a failed run is data."""

from dataclasses import dataclass
from enum import StrEnum


class Ending(StrEnum):
    """The ways a run can end."""

    COMPLETED = "completed"
    TANGLED = "tangled"
    """A triangle lost its orientation."""
    SINGULAR_DILATION = "singular_dilation"
    """1 + phi <= 0, where the pressure (2.5) has no value."""
    NEGATIVE_CONCENTRATION = "negative_concentration"
    STEP_TOO_SMALL = "step_too_small"
    NOT_CONVERGED = "not_converged"
    """A linear solve left more than its tolerance."""
    NON_FINITE = "non_finite"
    INTERRUPTED = "interrupted"
    """Stopped from outside; its file holds a checkpoint from which it goes on."""


@dataclass(frozen=True)
class Outcome:
    """How a run (or a step) ended and one sentence that says where and when."""

    ending: Ending = Ending.COMPLETED
    message: str = ""

    @property
    def ok(self) -> bool:
        """True where the run may go on or has reached its end."""
        return self.ending is Ending.COMPLETED


COMPLETED = Outcome()
"""Nothing went wrong."""
