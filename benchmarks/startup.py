"""Processor seconds from a word typed to its answer: `python -m benchmarks.startup`.

Help, mistakes and lists should be there at once: 0.3 s each on a quiet machine, medians of five.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

TIMES = 5

RUN = ("run", "static-decay", "--method", "fem-p1-paper", "--refine", "1", "--quiet", "--force", "--out")


def processor_seconds(*words: str) -> float:
    """Return user and system seconds of a command and of all processes that it starts and awaits."""
    call = (
        "import os, subprocess, sys; subprocess.run(sys.argv[1:], capture_output=True); "
        "used = os.times(); print(used.children_user + used.children_system)"
    )
    command = [sys.executable, "-c", call, sys.executable, "-m", "actin_xcheck", *words]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def main() -> None:
    """Print a line for each command."""
    with tempfile.TemporaryDirectory() as folder:
        for words in (
            ("--help",),
            ("run", "--help"),
            ("chrat",),
            ("run", "static-decay", "--metod", "fem"),
            ("scenes",),
            ("scenes", "show", "fig14-four-fronts"),
            (*RUN, str(Path(folder) / "run.vtkhdf")),
        ):
            seconds = median(processor_seconds(*words) for _ in range(TIMES))
            print(f"{seconds:5.2f} s  {' '.join(words[:5])}")


if __name__ == "__main__":
    main()
