"""Ticks of the axes of every drawing: at least three, each with a label that is its whole number.

No factor or offset stands beside an axis, and labels have as many digits as tell their values apart.
"""

import numpy as np
from matplotlib.ticker import MaxNLocator

_LETTER, _LINE = 5.8, 20.0
"""Width of a digit and height that a label is given, in units of a drawing whose letters are 9 high."""

_LEAST = 3
_SMALL, _LARGE = 1e-3, 1e5
"""Sizes from which on numbers are written with an exponent."""

_MOST_DIGITS = 15
_SLACK = 1e-6  # of an axis, by which round-off may put a value beyond its end


def ticks(scale: str, low: float, high: float, room: float, across: bool) -> list[tuple[float, str]]:
    """Return values between the ends of an axis, each with its label.

    Parameters
    ----------
    scale : "linear" or "log".
    low, high : values at the ends; low < high.
    room : length of the axis, in units of the drawing.
    across : whether labels stand beside each other, else above.
    """
    measure = np.log if scale == "log" else np.asarray
    for most in range(8, _LEAST - 1, -1):
        found = _decades(low, high, most) if scale == "log" else _even(low, high, most)
        start, *places, end = measure([low, *(value for value, _ in found), high])
        apart = room * np.diff(places) / (end - start)
        sizes = np.array([_LETTER * (len(label) + 2) if across else _LINE for _, label in found])
        if (apart >= (sizes[1:] + sizes[:-1]) / 2).all():
            break
    return found


def _even(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Even steps; all labels with the same digits, the fewest that show each value."""
    slack = _SLACK * (high - low)
    values = MaxNLocator(most - 1, steps=(1, 2, 2.5, 5, 10), min_n_ticks=_LEAST).tick_values(
        low - slack, high + slack
    )
    values = [float(one) for one in values if low - slack <= one <= high + slack]
    step = values[1] - values[0]
    values = [0.0 if abs(value) < 1e-6 * step else value for value in values]
    kind = "f" if _SMALL <= max(map(abs, values)) < _LARGE else "e"
    for digits in range(_MOST_DIGITS):
        said = [f"{value:.{digits}{kind}}" for value in values]
        if all(abs(float(one) - value) < 1e-3 * step for one, value in zip(said, values, strict=True)):
            break
    return list(zip(values, map(_short, said), strict=True))


def _decades(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Decades, parts of them where they are few, and even steps within one."""
    slack = (high / low) ** _SLACK
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    for parts in ((1,), (1, 3), (1, 2, 5)):
        values = [float(one) for one in np.outer(powers, parts).flat if low / slack <= one <= high * slack]
        if len(values) >= _LEAST:
            shown = values[:: max((len(values) - 1) // (most - 1), 1)] if parts == (1,) else values
            return [(one, _short(f"{one:g}" if _SMALL <= one < _LARGE else f"{one:e}")) for one in shown]
    return _even(low, high, most)


def _short(said: str) -> str:
    """A number without idle signs, its minus as it is printed."""
    mantissa, e, exponent = said.partition("e")
    if e:
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        said = f"{mantissa}e{int(exponent)}" if float(mantissa) else "0"
    return said.replace("-", "−")
