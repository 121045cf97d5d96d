"""Tasks that go to other processes and machines: by the code that asked for them, one at a time in each."""

import hashlib
import json
import os
import socket
import threading
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.method import packages_of_methods
from actin_xcheck.runs.store import PACKAGES, provenance

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
