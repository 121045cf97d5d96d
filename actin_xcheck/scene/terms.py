"""The terms of (3.2) that a scene may have, and a problem without each of them.

A term is dropped by changing one entry of the scene; initial data stay those of the whole scene, also where
they are one of its modes.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from actin_xcheck.core.contract import Motion, Problem
from actin_xcheck.core.model import Delta, Rheology


@dataclass(frozen=True)
class Term:
    """A term of (3.2).

    Attributes
    ----------
    name, symbol : what a reader calls it, and how it is written.
    entry : the entry of the scene that drops it.
    there : whether a problem has it.
    idle : why it does nothing in a problem that has it; empty where it may do something.
    drop : the problem without it.
    """

    name: str
    symbol: str
    entry: str
    there: Callable[[Problem], bool]
    idle: Callable[[Problem], str]
    drop: Callable[[Problem], Problem]


def _model(**changes: Any) -> Callable[[Problem], Problem]:
    return lambda problem: replace(problem, model=problem.model.varied(**changes))


def _prescribed(problem: Problem) -> str:
    return "" if problem.motion is None else "the motion is prescribed"


def _at_rest(problem: Problem) -> str:
    """Why nothing moves, or nothing of its own; empty where something does."""
    return _prescribed(problem) or ("nothing moves: ψ = p = 0, u = 0" if not _moves(problem) else "")


def _moves(problem: Problem) -> bool:
    parameters = problem.model.parameters
    return problem.motion is not None or bool(parameters.psi or parameters.p) or _displaced(problem)


def _displaced(problem: Problem) -> bool:
    points = np.array([(0.0, 0.0), (0.4, 0.1), (-0.3, 0.6), (0.1, -0.9)]).T
    return bool(np.any(problem.u0(points)))


def _no_pressure(problem: Problem) -> str:
    return _prescribed(problem) or ("p = 0" if problem.model.parameters.p == 0 else "")


def _always(problem: Problem) -> str:
    return ""


TERMS = (
    Term(
        "contraction",
        "∇(ψ a² e^(−a/a_sat))",
        "[parameters] psi = 0",
        lambda problem: problem.model.parameters.psi != 0,
        _prescribed,
        _model(psi=0.0),
    ),
    Term(
        "pressure",
        "∇(p/(1 + φ) (1 + (2/π) δ arctan a))",
        "[parameters] p = 0",
        lambda problem: problem.model.parameters.p != 0,
        _prescribed,
        _model(p=0.0),
    ),
    Term(
        "the share of polymerisation in the pressure",
        "(2/π) δ arctan a",
        '[model] delta = "none"',
        lambda problem: problem.model.delta is not Delta.NONE,
        _no_pressure,
        _model(delta=Delta.NONE),
    ),
    Term(
        "the ring",
        "δ = 1 where |ξ| > ℓ₀ only",
        '[model] delta = "full"',
        lambda problem: problem.model.delta is Delta.RING,
        _no_pressure,
        _model(delta=Delta.FULL),
    ),
    Term(
        "elasticity and dilation",
        "∇·σ_e, φ",
        '[model] rheology = "viscous"',
        lambda problem: problem.model.rheology is Rheology.VISCOELASTIC,
        _at_rest,
        _model(rheology=Rheology.VISCOUS),
    ),
    Term(
        "motion and dilution",
        "∇·(a v)",
        '[motion] x = "x0", y = "y0"',
        lambda problem: True,
        lambda problem: "" if _moves(problem) else "nothing moves: ψ = p = 0, u = 0",
        lambda problem: replace(problem, motion=Motion(lambda xi, t: xi, lambda xi, t: np.zeros_like(xi))),
    ),
    Term(
        "diffusion",
        "d Δa",
        "[parameters] d = 0",
        lambda problem: problem.model.parameters.d != 0,
        _always,
        _model(d=0.0),
    ),
    Term(
        "reaction",
        "1 − a",
        "[model] reaction = false",
        lambda problem: problem.model.reaction,
        _always,
        _model(reaction=False),
    ),
    Term(
        "the source",
        "s",
        "no [source] a",
        lambda problem: problem.source is not None,
        _always,
        lambda problem: replace(problem, source=None),
    ),
    Term(
        "the initial displacement",
        "u(t = 0)",
        "no [initial] u",
        _displaced,
        _prescribed,
        lambda problem: replace(problem, u0=np.zeros_like),
    ),
)
