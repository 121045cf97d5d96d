"""What is measured of the machine: a fixed computation as its unit of time, and the memory of a process."""

import ctypes
import sys
import time
from functools import cache
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from actin_xcheck.core.model import Array

GRID = 128
"""Unknowns of the kernel's Laplacian along each side of its square."""

DENSE = 300
"""Rows of the kernel's dense matrix."""

TIMES = 3
"""How often the kernel is run for one timing."""

_STATUS, _RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


@cache
def _operands() -> tuple[sp.csc_matrix, Array]:
    """The five-point Laplacian of a square, and a dense matrix of fixed numbers."""
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(GRID, GRID))
    dense = np.random.default_rng(0).standard_normal((DENSE, DENSE))
    return sp.csc_matrix(sp.kronsum(line, line)), dense


def reference_kernel() -> Array:
    """Seconds of wall and of processor time that the reference kernel takes, (2,): medians of `TIMES` runs.

    What the methods are made of in small: a sparse factorisation, solves and products with its matrix, dense
    products; one thread.
    """
    matrix, dense = _operands()
    seconds = []
    for _ in range(TIMES):
        began = np.array([time.perf_counter(), time.process_time()])
        factor = spl.splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        x = np.ones(matrix.shape[0])
        for _ in range(10):
            x = factor.solve(matrix @ x)
        product = dense
        for _ in range(5):
            product = product @ dense / DENSE
        seconds.append(np.array([time.perf_counter(), time.process_time()]) - began)
    middle: Array = np.median(seconds, axis=0)
    return middle


def forget_peak() -> None:
    """Let the peak of memory begin anew at what is in use now, where the system can (Linux)."""
    if _RESET.exists() and hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)  # what was freed counts as in use until the system has it back
    try:
        _RESET.write_text("5", encoding="ascii")
    except OSError:
        return  # the peak since the process began then hides what stays below it


def peak_memory() -> int:
    """Largest resident memory of this process, in bytes.

    Linux's `ru_maxrss` begins with that of the process it was forked from, `VmHWM` does not.
    """
    if sys.platform == "win32":
        import psutil

        return int(psutil.Process().memory_info().peak_wset)
    try:
        status = _STATUS.read_text(encoding="ascii")
    except OSError:
        import resource  # POSIX's

        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    line = next(line for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(line.split()[1]) * 1024
