"""What a result comes from: the code and its libraries, the machine, its speed and memory."""

import ctypes
import hashlib
import json
import os
import platform
import socket
import subprocess
import sys
import threading
import time
from functools import cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import Array
from actin_xcheck.runs.method import packages_of_methods

if TYPE_CHECKING:
    import scipy.sparse as sp

GRID = 128
"""Unknowns of the kernel's Laplacian along each side of its square."""

DENSE = 300
"""Rows of the kernel's dense matrix."""

TIMES = 3
"""How often the kernel is run for one timing."""

_STATUS, _RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


@cache
def _operands() -> tuple["sp.csc_matrix", Array]:
    """The five-point Laplacian of a square, and a dense matrix of fixed numbers."""
    import scipy.sparse as sp  # here: what reads results solves nothing

    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(GRID, GRID))
    dense = np.random.default_rng(0).standard_normal((DENSE, DENSE))
    return sp.csc_matrix(sp.kronsum(line, line)), dense


def reference_kernel() -> Array:
    """Seconds of wall and of processor time that the reference kernel takes, (2,): medians of `TIMES` runs.

    What the methods are made of in small: a sparse factorisation, solves and products with its matrix, dense
    products; one thread.
    """
    import scipy.sparse.linalg as spl

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


ONE_AT_A_TIME = threading.Lock()
"""A cluster's worker may have threads; solvers share caches, warnings and HDF5 in a process."""


SOURCES = "actin_xcheck", "fem", "fv"
"""The packages whose sources are the code."""


@cache
def code() -> str:
    """The version of the code: a digest of its sources and those of other packages' methods, and of
    the versions of the libraries under it.

    Of the sources, because a checkout with changes is a version too, and an installed copy has no commit.
    """
    digest = hashlib.sha256()
    versions = provenance()
    digest.update(json.dumps({name.lower(): versions[name.lower()] for name in PACKAGES}).encode())
    for package in (*SOURCES, *packages_of_methods()):
        spec = find_spec(package)
        if spec and spec.origin and not spec.submodule_search_locations:  # a single module
            digest.update(Path(spec.origin).read_bytes())
        for root in sorted(spec.submodule_search_locations or ()) if spec else ():
            sources = (path for pattern in ("*.py", "*.toml") for path in Path(root).rglob(pattern))
            for source in sorted(sources):  # shipped scenes are asked for by name
                digest.update(source.relative_to(root).as_posix().encode())
                digest.update(source.read_bytes())
    return digest.hexdigest()


def check_code(asked: str) -> None:
    """In a worker: UserError where its code is not `asked`, that of the process whose task it is given.

    An error for all tasks: one that failed so fast would take the others' place.
    """
    if code() != asked:
        here = socket.gethostname()
        raise UserError(
            f"the worker {os.getpid()} on {here} has another version of the code; valid: workers started "
            "after the last change to it, from the same sources and libraries"
        )


PACKAGES = ("actin-xcheck", "numpy", "scipy", "scikit-fem", "FiPy", "h5py")


def provenance() -> dict[str, str]:
    """Return versions of Python and of `PACKAGES`, the platform, and the commit of the package's checkout.

    The commit is "unknown" where the package does not lie in a git checkout, and ends in "-dirty" where the
    checkout has changes.
    """
    versions = {package.lower(): _version(package) for package in PACKAGES}
    return {
        "python": platform.python_version(),
        **versions,
        "platform": platform.platform(),
        "commit": _commit(),
    }


@cache
def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


@cache
def _commit() -> str:
    """The commit of the checkout that tracks this file; a copy installed inside another one has none."""
    folder, this = Path(__file__).parent, Path(__file__).name
    # without GIT_DIR and its kin: they name another checkout, whose hook we may be
    around = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}

    def git(*command: str) -> str:
        words = ("git", "-c", "safe.directory=*", *command)  # code that is run here is trusted anyway
        answer = subprocess.run(words, cwd=folder, env=around, capture_output=True, text=True, check=True)
        return answer.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", this)
        return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.CalledProcessError):  # no git, no checkout or not ours
        return "unknown"
