"""The equations, meshes and contracts that everything else stands on; nothing here knows a method."""

from functools import cache
from importlib import import_module


@cache
def load_scipy() -> None:
    """Load what all of scipy rests on, without the parts of numpy that are loaded when they are named.

    Its layer over arrays of other libraries copies every name of numpy, and so loads numpy's tests, its
    compiler of Fortran and more: 0.1 s.  They are hidden from it meanwhile.
    """
    import numpy as np  # here: help needs none

    names, kept = vars(np), {"__dir__": np.__dir__, "__all__": np.__all__}
    loaded = [name for name in np.__all__ if name in names]
    names.update({"__dir__": lambda: loaded, "__all__": loaded})
    try:
        import_module("scipy.sparse")
    finally:
        names.update(kept)
