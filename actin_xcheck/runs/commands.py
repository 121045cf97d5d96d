"""The commands that are printed, to be typed again: written here and nowhere else."""

import shlex
from collections.abc import Sequence


def typed(words: Sequence[str]) -> str:
    """Return words as a shell takes them, with the program in front."""
    return "python -m actin_xcheck " + shlex.join(words)


def command(name: str, *what: str, **options: object) -> str:
    """Return the command that makes something again.

    Parameters
    ----------
    name, what : the command and what it is given without an option, as scenes.
    options : by name.  None, False and nan leave one out, True is one without a value, a tuple stands for one
        with each of its values; numbers are written to the last digit, so that the same bits come out.
    """
    words = [name, *what]
    for option, given in options.items():
        for value in given if isinstance(given, tuple) else (given,):
            if value is None or value is False or value != value:
                continue
            words.append(f"--{option}")
            if value is not True:
                # a float of numpy says its type in its repr
                words.append(repr(float(value)) if isinstance(value, float) else str(value))
    return typed(words)
