"""Claims about nothing in particular."""

from typing import Any

from actin_xcheck.core.claim import Claim, ClaimKind
from tests.lab import FEM


def claim(statement: str = "holds", value: float = 0.0, bound: float = 1.0, **said: Any) -> Claim:
    """A claim of no kind about a finite-element run, in what is not said."""
    usual = {
        "kind": ClaimKind.OTHER,
        "scene": "scene",
        "methods": (FEM,),
        "command": "command",
        "path": "/runs",
    }
    return Claim(statement=statement, value=value, bound=bound, **usual | said)
