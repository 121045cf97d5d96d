"""`python -m actin_xcheck`: a process in which what surrounds it cannot change a run, then the command."""

import atexit
import gc
import os
import sys

_PLACE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
"""The folder in which actin_xcheck, fem and fv lie."""


def settle() -> None:
    """Set this process and those it will start apart from what surrounds them.

    Nothing may have been imported: `python -m` looks for modules in the working directory first, where any
    file may be called `fem.py` or `queue.py`.  It comes last, behind the folder of this package (which is no
    path of its own where an editable install finds it), unless it is that folder.
    """
    here = os.getcwd() if os.path.exists(".") else ""
    if here != _PLACE:
        sys.path.append(_PLACE)
        sys.path.sort(key=lambda entry: 2 if entry in ("", here) else entry == _PLACE)
        os.environ["PYTHONSAFEPATH"] = "1"
        named = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, named))  # an empty name is this directory
    os.environ["MPLBACKEND"] = "agg"  # Jupyter's is none where its packages are not installed
    for name in ("HDF5_DRIVER", "HDF5_USE_FILE_LOCKING"):  # for other files than ours
        os.environ.pop(name, None)
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # closed: print() would take the other, the next file its number
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode, encoding="utf-8"))
    sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr] # a locale may lack psi


def main() -> None:
    """Entry point."""
    settle()
    gc.disable()  # of what is imported nothing is garbage, before the end or there
    try:
        from actin_xcheck.cli.app import main as run_command
    except KeyboardInterrupt:  # within the seconds of imports nothing has begun
        sys.exit(130)
    gc.freeze()
    gc.enable()
    atexit.register(gc.freeze)
    run_command()


if __name__ == "__main__":
    main()
