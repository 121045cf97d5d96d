"""A check by a worker of a cluster: in a process of its own, with a main thread that can be stopped in time.

Workers do what they are given in threads, and may be daemons, which `multiprocessing` allows no children.
"""

import os
import pickle
import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import locked
from actin_xcheck.nightly.carry_out import Task, carry_out, ended
from actin_xcheck.nightly.record import FILE_NAME, Done, NotRun
from actin_xcheck.runs.executor import how_ended
from actin_xcheck.runs.version import check_code


def carry_out_elsewhere(task: Task) -> Done | NotRun:
    """Carry out a check for a night of another machine, in whose folder its files go.

    Times and memory are no numbers of that machine and are left out; `Done.seconds` stays, for the plan.

    UserError where this is not the night's code, or where the folder is not to be seen.
    """
    check_code(task.code)  # of what is imported here, and serves other commands later
    call = [sys.executable, "-c", f"from {__name__} import answer; answer()"]
    began = time.perf_counter()
    with subprocess.Popen(call, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(pickle.dumps(task))
        process.stdin.flush()  # and not closed: that tells the process that its worker has ended
        said = process.stdout.read()
    if not said:
        return ended(task.item.name, how_ended(process.returncode), time.perf_counter() - began)
    found: Done | NotRun | UserError = pickle.loads(said)
    if isinstance(found, UserError):
        raise found
    if isinstance(found, NotRun):
        return found
    numbers = tuple(one for one in found.numbers if not one.kind.of_machine)
    return replace(found, numbers=numbers, host=socket.gethostname())


def answer() -> None:
    """In the process: carry out the check that standard input holds; what else is printed is no answer."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    task: Task = pickle.load(sys.stdin.buffer)

    def follow() -> None:
        os.read(0, 1)  # its end, when the worker ends; sys.stdin would be locked when this process does
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    found: Done | NotRun | UserError
    try:
        check_code(task.code)
        if not (task.night / FILE_NAME).exists():
            raise UserError(
                f"the worker on {socket.gethostname()} does not see {task.night}; "
                "valid: --out names a folder that all machines share"
            )
        task.folder.parent.mkdir(parents=True, exist_ok=True)
        with locked(task.folder):  # a check that nobody waits for any more may still be at work there
            found = carry_out(task)
    except UserError as mistake:
        found = mistake
    with out:
        out.write(pickle.dumps(found))
