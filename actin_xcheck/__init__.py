"""actin_xcheck: a verification laboratory for a moving-cell model.

For notebooks and scripts the package has eight names, which do what the commands do: `run`, `load`,
`predict`, `cross_check`, `converge`, `chart`, `sweep` and `render`, see `actin_xcheck.api`.  They are
loaded when they are first used.

Importing this package pins BLAS and OpenMP to one thread unless the user has chosen otherwise: the
matrices here are sparse, and threaded BLAS on a shared machine only makes timings meaningless.  It must
happen before numpy's first import, hence here.
"""

import os

TYPE_CHECKING = False  # `typing` itself would be looked for in the working directory, see `__main__`
if TYPE_CHECKING:
    from actin_xcheck.api import chart, converge, cross_check, load, predict, render, run, sweep

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

__version__ = "0.1.0"

__all__ = ["chart", "converge", "cross_check", "load", "predict", "render", "run", "sweep"]


def __getattr__(name: str) -> object:
    """Load a name of the interface when it is first used: the import of the package alone stays light."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module("actin_xcheck.api"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
