"""The one exception a user's mistake raises; everything else that goes wrong in a run is an Outcome."""

import errno

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
