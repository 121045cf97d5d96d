"""Calls into libraries that may hang, crash or end the process, made in a process of their own.

It is started afresh and not by multiprocessing, which would run the caller's script once more: one that draws
a picture has no reason to expect that.
"""

import faulthandler
import math
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ParamSpec, TypeVar

Given = ParamSpec("Given")
Result = TypeVar("Result")

_TASK, _ANSWER = "task.pickle", "answer.pickle"


class LostError(Exception):
    """The process ended, or was ended, without an answer; says how."""


def aside(seconds: float, work: Callable[Given, Result], *given: Given.args, **named: Given.kwargs) -> Result:
    """Return what a module's function returns, called in a process that ends after so many seconds.

    Whatever it prints is lost.  Raises whatever `work` raises; LostError where no answer comes.
    """
    with TemporaryDirectory() as folder:
        (Path(folder) / _TASK).write_bytes(pickle.dumps((work, given, named)))
        code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import _answer; _answer()"
        began, quiet = time.monotonic(), subprocess.DEVNULL
        words = [sys.executable, "-c", code, folder, str(seconds)]
        child = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet)
        try:
            ended = child.wait()
        finally:
            child.kill()  # an interrupt: nobody waits for it any more
            child.communicate()
        if ended:
            late = time.monotonic() - began > seconds
            raise LostError(f"no end within {seconds:g} s" if late else f"a crash, exit code {ended}")
        raised, answer = pickle.loads((Path(folder) / _ANSWER).read_bytes())
    if raised:
        raise answer
    result: Result = answer
    return result


def _answer() -> None:
    """In the process: call what is asked for and leave what comes of it in the folder."""
    folder, seconds = sys.argv[1], float(sys.argv[2])
    if seconds < math.inf:
        faulthandler.dump_traceback_later(seconds, exit=True)  # whatever the interpreter is busy with
    threading.Thread(target=_end_with_parent, daemon=True).start()
    work, given, named = pickle.loads((Path(folder) / _TASK).read_bytes())
    try:
        answer = False, work(*given, **named)
    except Exception as error:
        answer = True, error
    (Path(folder) / _ANSWER).write_bytes(pickle.dumps(answer))


def _end_with_parent() -> None:
    """The pipe is closed when the parent ends, however it does."""
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)
