"""A library loaded without what nobody asked for: every run would wait for it."""

from functools import cache
from importlib import import_module


@cache
def load_scipy() -> None:
    """Load scipy's layer over arrays of other libraries, on which all of it rests, without numpy's lazy parts.

    It copies every name of numpy, and so loads numpy's tests, its compiler of Fortran and more: 0.1 s.  They
    are hidden from it meanwhile; whoever names one gets it as ever.
    """
    import numpy as np  # here: help needs none

    listed, offered = np.__dir__, np.__all__
    np.__dir__ = lambda: [name for name in listed() if name in vars(np)]
    np.__all__ = [name for name in offered if name in vars(np)]
    try:
        import_module("scipy.sparse")
    finally:
        np.__dir__, np.__all__ = listed, offered
