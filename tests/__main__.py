"""`python -m tests`: everything that must be green before code lands, one after the other.

What takes many minutes is run every night: `pytest -m nightly`.
"""

import subprocess
import sys

CHECKS = (
    ("ruff", "check", "."),
    ("ruff", "format", "--check", "."),
    ("mypy",),
    ("importlinter",),
    ("pytest", "-q", "-n", "auto", "--dist", "worksteal", "-m", "not nightly"),
)

for module, *arguments in CHECKS:
    print(f"== {module} {' '.join(arguments)}", flush=True)
    command = [sys.executable, "-m", module, *arguments]
    if module == "importlinter":  # has no __main__
        command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()"]
    if subprocess.run(command, check=False).returncode:
        sys.exit(f"failed: {module}")
print("everything holds")
