"""Solvers start without what they must not know: import-linter does not see imports by name, this does."""

import subprocess
import sys

import pytest

from actin_xcheck.runs.method import METHODS

BEYOND_A_SOLVER = {
    "actin_xcheck.scene.scene",
    "actin_xcheck.theory",
    "actin_xcheck.runs.store",
    "actin_xcheck.cli.app",
}


COMMAND = "sys.argv[0] = 'actin_xcheck'\nfrom actin_xcheck.__main__ import main\nmain()"


def modules_after(statement, *arguments, code=0):
    """Names of all modules in a fresh interpreter after a statement, which ends with the code."""
    report = "atexit.register(lambda: print('modules', *sys.modules))"
    command = [sys.executable, "-W", "error", "-c", f"import atexit, sys\n{report}\n{statement}", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == code, done.stderr
    return done.stdout.splitlines()[-1].split()[1:]


def loaded_by(statement, *arguments, code=0):
    """The same; our own ones by full name, others by package."""
    every = modules_after(statement, *arguments, code=code)
    return {name if name.startswith("actin_xcheck") else name.split(".")[0] for name in every}


def ours(modules):
    return [name for name in modules if name.split(".")[0] in ("actin_xcheck", "fem", "fv")]


@pytest.mark.parametrize(("mine", "other"), [("fem", "fv"), ("fv", "fem")])
def test_solvers_load_no_parser_no_theory_no_store_and_not_the_other_code(mine, other):
    every = {target for m in METHODS.values() for target in (m.solver, m.mechanics)}
    targets = sorted(target for target in every if target.startswith(f"{mine}."))
    loaded = loaded_by(f"from actin_xcheck.runs.method import load\nfor one in {targets}:\n load(one)")
    assert not loaded & BEYOND_A_SOLVER
    assert mine in loaded
    assert other not in loaded
    assert ("fipy" in loaded) == (mine == "fv")
    assert mine == "fem" or "skfem" not in loaded


HEAVY = {"numpy", "scipy", "h5py", "matplotlib", "jinja2", "rich", "sqlite3", "fem", "fv", "fipy", "skfem"}
"""Packages that nobody waits for who has mistyped a word."""


@pytest.mark.parametrize(
    ("words", "code", "may"),
    [
        (["--help"], 0, set()),
        (["run", "--help"], 0, set()),
        (["chrat"], 2, set()),
        (["run", "static-decay", "--metod", "fem-p1-paper"], 2, set()),
        (["scenes"], 0, {"rich"}),  # it prints a table
        (["scenes", "show", "static-decay"], 0, set()),
    ],
)
def test_help_mistakes_and_scenes_load_next_to_nothing(words, code, may):
    loaded = modules_after(COMMAND, *words, code=code)
    assert not {name.split(".")[0] for name in loaded} & (HEAVY - may)
    assert len(ours(loaded)) < 35


@pytest.mark.parametrize(("method", "other"), [("fem-p1-paper", "fv"), ("fv-coupled", None)])
def test_a_run_loads_its_solver_and_what_stores_it(method, other, tmp_path):
    words = ["run", "static-decay", "--method", method, "--refine", "1", "--quiet"]
    loaded = modules_after(COMMAND, *words, "--out", str(tmp_path / "a.vtkhdf"))
    packages = {name.split(".")[0] for name in loaded}
    assert not packages & {"jinja2", "distributed", "pyvista", "ruptures", "sympy"}
    if method == "fem-p1-paper":
        assert not set(loaded) & {"numpy.f2py", "numpy.testing", "scipy.spatial", "scipy.sparse.linalg"}
        assert len(loaded) < 700
    assert other is None or not packages & {other, "fipy", "matplotlib"}
    waited_for = {
        "skfem",
        "rich",
        "meshio",
        "scipy.spatial",
        "scipy.optimize",
        "scipy.sparse.linalg",
        "fem.modal",
    }
    assert other is None or not set(loaded) & waited_for
    assert len(ours(loaded)) < 100
    studies = {name for name in loaded if name.startswith(("actin_xcheck.studies.", "actin_xcheck.verdicts"))}
    assert not studies


def test_a_worker_loads_no_solver_before_its_task_names_one():
    works = ("distort.cases", "extremes.attempt", "closures.measure", "frontier.answers", "sweep", "study")
    loaded = loaded_by(f"import {', '.join(f'actin_xcheck.studies.{one}' for one in works)}")
    assert not loaded & {"fem", "fv", "fipy", "skfem", "matplotlib", "jinja2", "typer", "rich"}


def test_nothing_is_computed_when_modules_are_imported():
    """Scenes are read, growth rates found and processes prepared where they are asked for."""
    statement = """
import importlib, pkgutil
import actin_xcheck.scene.scene as scene, actin_xcheck.theory.growth as growth
import actin_xcheck.runs.processes as alone

def refuse(*arguments):
    raise AssertionError("computed at import")

scene.load_scene = scene.parse_scene = growth.amplitude_at_rest = alone.prepare = refuse
for name in ("actin_xcheck", "fem"):
    package = importlib.import_module(name)
    for found in pkgutil.walk_packages(package.__path__, f"{name}."):
        if not found.name.endswith(("__main__", "forking")):
            importlib.import_module(found.name)
"""
    assert "actin_xcheck.nightly.plan" in loaded_by(statement)


@pytest.mark.parametrize("flag", ["--petsc", "--inline", "--trilinos", "--pyamgx"])
def test_fipy_does_not_read_our_command_line(flag):
    statement = (
        "import numpy as np\nfrom fv.mesh import fipy\nfrom actin_xcheck.scene.scene import load_scene\n"
        "from actin_xcheck.runs.run import bind\nfrom actin_xcheck.runs.method import METHODS\n"
        "from actin_xcheck.runs.numerics import Numerics\n"
        "solver = bind(load_scene('growing-disk'), Numerics(METHODS['fv-coupled'], 2, 0.1))\n"
        "assert solver.step(solver.init(), 0.1)[1].ok\nassert fipy.solvers.solver_suite == 'scipy'\n"
        f"assert sys.argv[1] == {flag!r}"
    )
    assert "fipy" in loaded_by(statement, flag)
