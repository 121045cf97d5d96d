"""Fig. 14 to an accuracy: processor seconds of the whole process, start included, and the true error.

    python -m benchmarks.time_to_accuracy [PYTHON SCRIPT]

Prints a line for each `run --accuracy`.  PYTHON SCRIPT is another code's ladder, timed right after ours: a
script that prints a line "...: SECONDS s, ... {'quantity': error, ...}" for each of its levels, without its
imports; those of the module `ngsolve` are timed apart and added.
"""

import ast
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.verdicts.judge import reference_errors

SCENE = "fig14-four-fronts"
ASKED = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)

_TIMED = (
    "import os, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); "
    "used = os.times(); print(used.children_user + used.children_system)"
)


def processor_seconds(*command: str) -> float:
    """Return user and system seconds of a command and of all processes that it starts and awaits."""
    answer = subprocess.run(
        [sys.executable, "-c", _TIMED, *command], stdout=subprocess.PIPE, text=True, check=True
    )
    return float(answer.stdout)


def ours(accuracy: float, folder: Path) -> tuple[float, float, str]:
    """Seconds, true error and level of one run to an accuracy."""
    file = folder / f"{accuracy:g}.vtkhdf"
    words = ("run", SCENE, "--method", "fem", "--accuracy", f"{accuracy:g}", "--out", str(file), "--quiet")
    seconds = processor_seconds(sys.executable, "-m", "actin_xcheck", *words)
    run = read_run(file)
    level = (
        f"{run.attributes['method_name']}, refine {run.attributes['refine']}, rtol {run.attributes['rtol']:g}"
    )
    return seconds, max(reference_errors(load_scene(SCENE), run).values()), level


def theirs(python: str, script: str) -> list[tuple[float, float, str]]:
    """The same of another code's levels, its imports added to each."""
    imports = processor_seconds(python, "-c", "import ngsolve, scipy")
    said = subprocess.run([python, script], stdout=subprocess.PIPE, text=True, check=True).stdout
    found = []
    for line in said.splitlines():
        level, _, rest = line.partition(": ")
        if (spent := re.match(r"([\d.]+) s", rest)) and "{" in rest:
            errors = ast.literal_eval(rest[rest.index("{") :])
            found.append((imports + float(spent[1]), max(map(float, errors.values())), level))
    return found


def main() -> None:
    """Print both ladders."""
    with tempfile.TemporaryDirectory() as folder:
        for accuracy in ASKED:
            seconds, error, level = ours(accuracy, Path(folder))
            print(f"--accuracy {accuracy:g}: {seconds:5.2f} s, true error {error:.1e} ({level})", flush=True)
    if sys.argv[1:]:
        for seconds, error, level in theirs(*sys.argv[1:]):
            print(f"{Path(sys.argv[2]).stem}: {seconds:5.2f} s, true error {error:.1e} ({level})", flush=True)


if __name__ == "__main__":
    main()
