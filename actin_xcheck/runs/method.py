"""Methods by name, loaded on demand: nothing here imports a solver until it is asked for.

Those of installed packages are found by their entry points, looked up when a name is not one of `METHODS`
and imported when it is theirs.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from actin_xcheck.core import load_scipy
from actin_xcheck.core.errors import UserError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ENTRY_POINTS = "actin_xcheck.methods"
"""The group of entry points, NAME = "module:attribute": the attribute is a `Method` of that name."""

FORCE_BALANCE = "fem.force_balance:ForceBalance"
"""The finite elements' force balance; finite volumes may borrow it."""

FV_FORCE_BALANCE = "fv.mechanics:FvForceBalance"
"""The finite volumes' own."""

RADIAL = "fem.radial:Radial"
"""One ray of an axisymmetric cell."""

SECTOR = "fem.sector:Unfolded"
"""A sector between mirror lines, seen as the whole cell."""

MODAL = "fem.modal:Modal"
"""The linear modes of the rest state."""

HAND_OVER = "fem.modal:HandOver"
"""These, then a solver of the whole model."""

SPECTRUM = "fem.spectrum:Spectrum"
"""Eigenvalues of the finite elements about the steady state."""

PERTURBATIONS, POWERS = "fem.linearised:Perturbations", "fem.linearised:powers"
"""Amplification of perturbations of it, and by powers of a step."""

REMESHING = {"fem": "fem.remeshing:Remeshing", "fv": "fv.remeshing:FvRemeshing"}
"""Solvers whose mesh is replaced when it is about to fold, by the code of the method."""

SHAPES, SOUNDNESS = "fem.remeshing:shapes", "fem.remeshing:soundness"
"""The shape of a mesh's cells, and whether it is about to fold."""


@dataclass(frozen=True)
class Method:
    """A method: everything numerical and nothing physical.

    Attributes
    ----------
    name : what the user types.
    solver : "module:Class" of the solver.
    driven_by : the method whose node paths this one follows, or None where its own values load the force
        balance.
    order_h, order_dt : declared orders of accuracy; 0 where the method does not converge.
    description : one line for lists and reports.
    options : further arguments of the solver by name, among them `space` where elements are not P1.
    adaptive : whether it estimates its error in time, so that it can choose its steps.
    mechanics : "module:Class" of the force balance that moves its nodes: the finite elements', or one's own.
    knows_rim : whether it knows the dilation of a free rim to the order of positions, see `fem/boundary.py`.
    """

    name: str
    solver: str
    driven_by: str | None
    order_h: float
    order_dt: float
    description: str
    options: tuple[tuple[str, int], ...] = ()
    adaptive: bool = False
    mechanics: str = FORCE_BALANCE
    knows_rim: bool = False

    @property
    def space(self) -> int:
        """Polynomial order of the elements."""
        return dict(self.options).get("space", 1)

    @property
    def family(self) -> str:
        """The code it belongs to, which is the package of its solver: "fem", "fv" or another's."""
        return self.solver.split(".")[0]


def _imex(space: int, time: int) -> Method:
    return Method(
        f"fem-p{space}-imex{time}",
        "fem.imex:FemImex",
        None,
        space + 1,
        time,
        f"P{space} elements on curved cells, additive Runge-Kutta pair of order {time} with step control",
        (("space", space), ("time", time)),
        adaptive=True,
        knows_rim=True,
    )


METHODS = {
    method.name: method
    for method in (
        Method(
            "fem-p1-paper",
            "fem.solver:FemP1Paper",
            None,
            2,
            1,
            "the article's scheme (B.23): P1 elements on moving triangles, first order in time",
        ),
        Method(
            "fv",
            "fv.solver:FvSecondOrder",
            None,
            2,
            2,
            "finite volumes throughout: a force balance of their own, FiPy's transport, second order in time",
            adaptive=True,
            mechanics=FV_FORCE_BALANCE,
            knows_rim=True,
        ),
        Method(
            "fv-paper",
            "fv.solver:FvDiamond",
            None,
            2,
            1,
            "the same force balance and transport in steps like the article's (B.23), first order in time",
            mechanics=FV_FORCE_BALANCE,
        ),
        Method(
            "fv-coupled",
            "fv.solver:FvDiamond",
            None,
            2,
            1,
            "FiPy finite volumes with the linear-exact cross flux; they load the elements' force balance",
        ),
        Method(
            "fv-order2",
            "fv.solver:FvSecondOrder",
            None,
            2,
            2,
            "the same finite volumes in two implicit stages of second order, with an error estimate",
            adaptive=True,
            knows_rim=True,
        ),
        Method(
            "fv-driven",
            "fv.solver:FvDiamond",
            "fem-p1-paper",
            2,
            1,
            "the same finite volumes on the node paths of a finite-element run: transport alone",
        ),
        Method(
            "fv-tpfa",
            "fv.solver:FvTwoPoint",
            "fem-p1-paper",
            0,
            1,
            "FiPy's own diffusion term alone, driven: the exhibit of what does not converge on triangles",
        ),
        _imex(1, 2),
        _imex(2, 3),
        _imex(3, 4),
        _imex(4, 4),
        *(_imex(space, 5) for space in (5, 6, 7, 8)),
    )
}


def find_method(name: str) -> Method:
    """Return the method called `name`, from here or from an installed package.

    Raises
    ------
    UserError : there is none, or more than one; or its package cannot be loaded, or holds something else.
    """
    found = _entry_points(name)
    places = [f"this package's {name}"] * (name in METHODS) + [
        f"{one.value} {_package(one)}" for one in found
    ]
    if len(places) > 1:
        raise UserError(
            f"--method: {name!r} is {' and '.join(places)}; valid: one of them, uninstall the others"
        )
    if found:
        return _loaded(found[0])
    if name not in METHODS:
        others = sorted({one.name for one in _entry_points()} - METHODS.keys())
        raise UserError(f"--method: {name!r} is not a method; valid: {', '.join([*METHODS, *others])}")
    return METHODS[name]


def find_methods(names: Iterable[str]) -> list[Method]:
    """Return the methods of these names, each once; UserError as `find_method`."""
    return [find_method(name) for name in dict.fromkeys(names)]


def with_lent_balance(method: Method) -> Method | None:
    """The method that differs from a finite-volume one by a force balance that the elements lend it, or None
    where there is no such.
    """
    lent = replace(method, name="", description="", mechanics=FORCE_BALANCE)
    others = (one for one in METHODS.values() if replace(one, name="", description="") == lent)
    return next(others, None) if method.mechanics == FV_FORCE_BALANCE else None


def packages_of_methods() -> list[str]:
    """The top-level modules of other packages' methods, which are not imported for it."""
    return sorted({one.module.split(".")[0] for one in _entry_points()})


def _entry_points(name: str | None = None) -> "list[EntryPoint]":
    """Those of our group, or of a name in it, one for each place: an editable install is found twice."""
    from importlib.metadata import entry_points  # takes a while, which help need not wait for

    every = [one for one in entry_points(group=ENTRY_POINTS) if name in (None, one.name)]
    return list({(one.name, one.value, _package(one)): one for one in every}.values())


def _package(point: "EntryPoint") -> str:
    """The package an entry point belongs to, in words."""
    return f"of {point.dist.name} {point.dist.version}" if point.dist else "of an unknown package"


def _loaded(point: "EntryPoint") -> Method:
    """The method of an entry point; whatever its package raises when it is imported becomes one line."""
    what = f"--method: {point.name!r} ({point.value} {_package(point)})"
    try:
        method = point.load()
    except Exception as error:
        raise UserError(f"{what} cannot be loaded: {type(error).__name__}: {error}") from error
    if not isinstance(method, Method) or method.name != point.name:
        named = f"a Method named {method.name!r}" if isinstance(method, Method) else type(method).__name__
        raise UserError(f"{what} is {named}; valid: a Method named {point.name!r}")
    return method


def load(target: str) -> Callable[..., Any]:
    """Import "module:attribute" and return the attribute."""
    module, attribute = target.split(":")
    load_scipy()
    loaded: Callable[..., Any] = getattr(import_module(module), attribute)
    return loaded
