"""What goes wrong: a user's mistake raises the one exception, whatever happens in a run is an Outcome.

An Outcome is a value with a sentence: a failed run is data.
"""

import errno
from dataclasses import dataclass
from enum import StrEnum

LONGEST = 2000
"""Characters of a mistake's line, and of what it repeats of a file."""


class UserError(Exception):
    """A mistake in what the user gave: one line that names the place, what was given and what is valid.

    The command line prints the message and exits with code 2.  Whatever a file or a path puts into it, the
    message stays one printable line of bounded length.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(brief(sentence, LONGEST))


def starved(error: BaseException | None) -> bool:
    """Whether an error, or what it came from, is memory, disk, files or processes that the machine lacks."""
    lacking = errno.ENOMEM, errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.EAGAIN
    while error is not None:
        if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno in lacking):
            return True
        error = error.__cause__
    return False


def brief(text: str, most: int = 80) -> str:
    """Return text without its middle where it is longer than `most` characters, and fit to be printed.

    What does not print (line ends, terminal sequences, reversals of direction, surrogates) is escaped.
    """
    half = most // 2
    kept = text if len(text) <= most else f"{text[:half]}...{text[-half:]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in kept)


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
