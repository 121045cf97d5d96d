"""Signals that ask this process to end, and how a run hears of them."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


def ending_signals() -> list[signal.Signals]:
    """Those that ask this process to end, Ctrl-C's among them; none that is ignored, as under `nohup`."""
    asked = (getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGHUP"))
    return [number for number in asked if number and signal.getsignal(number) is not signal.SIG_IGN]


@contextmanager
def stop_signals() -> Iterator[Callable[[], int]]:
    """Within it `ending_signals` are only noted; a second one does what it did before.

    The value gives the number of the one that came, 0 where none did.
    """
    noted: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        if noted and callable(handler := before[signal.Signals(number)]):
            handler(number, frame)
        noted.append(number)

    before = {number: signal.signal(number, note) for number in ending_signals()}
    try:
        yield lambda: noted[0] if noted else 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
