"""Solvers start without what they must not know: import-linter does not see imports by name, this does."""

import subprocess
import sys

import pytest

from actin_xcheck.runs.method import FORCE_BALANCE, METHODS

BEYOND_A_SOLVER = {
    "actin_xcheck.scene.scene",
    "actin_xcheck.theory",
    "actin_xcheck.runs.store",
    "actin_xcheck.cli.app",
}


def loaded_by(statement, *arguments):
    """Modules in a fresh interpreter after a statement; our own ones by full name, others by package."""
    report = "print('\\n'.join(m if m.startswith('actin_xcheck') else m.split('.')[0] for m in sys.modules))"
    command = [sys.executable, "-W", "error", "-c", f"import sys\n{statement}\n{report}", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


@pytest.mark.parametrize("target", sorted({m.solver for m in METHODS.values()} | {FORCE_BALANCE}))
def test_a_solver_loads_no_parser_no_theory_no_store_and_not_the_other_code(target):
    loaded = loaded_by(f"from actin_xcheck.runs.method import load\nload({target!r})")
    assert not loaded & BEYOND_A_SOLVER
    mine, other = ("fem", "fv") if target.startswith("fem") else ("fv", "fem")
    assert mine in loaded
    assert other not in loaded
    assert ("fipy" in loaded) == (mine == "fv")
    assert mine == "fem" or "skfem" not in loaded


def test_the_command_line_imports_no_solver_until_it_needs_one():
    assert not loaded_by("import actin_xcheck.cli.app") & {"fem", "fv", "fipy", "skfem"}


@pytest.mark.parametrize("flag", ["--petsc", "--inline", "--trilinos", "--pyamgx"])
def test_fipy_does_not_read_our_command_line(flag):
    statement = (
        "import numpy as np\nfrom fv.mesh import fipy\nfrom actin_xcheck.scene.scene import load_scene\n"
        "from actin_xcheck.runs.run import bind\nfrom actin_xcheck.runs.method import METHODS\n"
        "solver = bind(load_scene('growing-disk'), METHODS['fv-coupled'], 2, 0.1)\n"
        "assert solver.step(solver.init(), 0.1)[1].ok\nassert fipy.solvers.solver_suite == 'scipy'\n"
        f"assert sys.argv[1] == {flag!r}"
    )
    assert "fipy" in loaded_by(statement, flag)
