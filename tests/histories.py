"""Series of numbers over nights, with noise and steps, for the tests of the history."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from actin_xcheck.nightly.history import Series
from actin_xcheck.nightly.record import Night, NumberKind

NIGHTS = 60
ROUND_OFF = 1e-9


def night(number: int, **other) -> Night:
    """The number-th night, from 1 on, each with a commit of its own."""
    date = datetime(2026, 3, 1, 2) + timedelta(number - 1)
    made = Night(f"{date:%Y-%m-%d}", f"{date.isoformat()}+00:00", f"{number:040d}", {"numpy": "2.4"}, "here")
    return replace(made, **other)


def series(key: str, kind: NumberKind, values, **other) -> Series:
    values = np.asarray(values, dtype=float)
    return Series(key, kind, "", tuple(night(i + 1, **other) for i in range(len(values))), values)


def noise(random: np.random.Generator, relative: float = 0.1, count: int = NIGHTS) -> np.ndarray:
    return relative * random.standard_normal(count)


def later(first: int, count: int = NIGHTS) -> np.ndarray:
    """1 from a night on, counted from 1, and 0 before."""
    return (np.arange(1, count + 1) >= first).astype(float)


def history(seed: int, others: int = 20) -> list[Series]:
    """60 nights: an order loses 0.2 in night 37, a time a fifth in night 45, and 10 % noise elsewhere."""
    random = np.random.default_rng(seed)
    found = [
        series("order/dropped", NumberKind.ORDER, 2 + noise(random, 0.02) - 0.2 * later(37)),
        series("time/slower", NumberKind.TIME, 3 * np.exp(noise(random)) * 1.2 ** later(45)),
    ]
    for number in range(others):
        kind = (NumberKind.TIME, NumberKind.ERROR, NumberKind.MEMORY, NumberKind.RATE)[number % 4]
        found.append(series(f"{kind}/{number}", kind, 5 * np.exp(noise(random))))
    return found
