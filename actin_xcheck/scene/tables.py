"""The tables of a scene file: keys, types, defaults and ranges.

A scene is stated in its own frame; `[domain] rotation` turns all of it about the origin afterwards.  All
quantities are non-dimensional unless they stand under `[dimensional]`.
"""

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from actin_xcheck.core.errors import Ending
from actin_xcheck.core.model import Array, Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.scene.expression import Expression, coordinates

MOST = 1000
"""Output times, probes and reference times a scene may have: each is a frame, a column or a row of a file."""

RESOLVED = 1e-6
"""Times nearer to each other are one: files and steps find them by less."""

LATEST = 1e6
"""The last time that steps of `RESOLVED` still reach in double precision."""

LARGEST = 1e6
"""Of concentrations, lengths and velocities, and of what a source adds to a concentration."""

EARLIEST = 1e-100
"""Where the velocity at t = 0 is taken: products of 0 and infinity have found their limit there."""

NEAR = 1e-7
"""How close to the centre and to the rim a formula is tried that is never taken right there."""

T = TypeVar("T")
Many = Annotated[tuple[T, ...], Field(strict=False, fail_fast=True)]  # a TOML array
Two = Annotated[tuple[T, T], Field(strict=False)]
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]


def _within(low: float, high: float) -> AfterValidator:
    """Keep a number where products and squares of it are far from the ends of double precision."""

    def check(value: float) -> float:
        if not low <= value <= high:
            raise ValueError(f"should lie between {low:g} and {high:g}")
        return value

    return AfterValidator(check)


Group = Annotated[float, _within(-1e9, 1e9)]
PositiveGroup = Annotated[Positive, _within(1e-9, 1e9)]
NonNegativeGroup = Annotated[NonNegative, _within(0, 1e9)]
Poisson = Annotated[float, Field(gt=-1, lt=0.5), _within(-0.9999, 0.4999)]
Fraction = Annotated[float, Field(gt=0, lt=1), _within(1e-3, 0.999)]


def _expression_in(*variables: str) -> BeforeValidator:
    """Read a string as an Expression in these variables."""

    def read(given: object) -> Expression:
        if not isinstance(given, str):
            raise ValueError('should be an expression in quotes, e.g. "1 + 0.1*x"')
        return Expression(given, variables)

    return BeforeValidator(read)


def _in_disk(point: tuple[float, float]) -> tuple[float, float]:
    if np.hypot(*point) > 1 + 1e-12:  # 1e-12: a rim point written with its digits
        raise ValueError("should lie in the unit disk, |xi| <= 1")
    return point


def _not_infinite(value: float) -> float:
    if np.isinf(value):
        raise ValueError("should be a number, or nan where it is not judged")
    return value


OrNan = Annotated[float, Field(allow_inf_nan=True), AfterValidator(_not_infinite)]
Initially = Annotated[Expression, _expression_in("x", "y", "r", "theta")]
Following = Annotated[Expression, _expression_in("x0", "y0", "t")]
Anywhere = Annotated[Expression, _expression_in("x", "y", "r", "theta", "x0", "y0", "t")]
InDisk = Annotated[Two[float], AfterValidator(_in_disk)]


def mistake(key: str, given: object, valid: str) -> PydanticCustomError:
    """A mistake that concerns several keys: the dotted key to name, what was given and what is valid."""
    return PydanticCustomError("scene", "{valid}", {"key": key, "given": given, "valid": valid})


def _disk(margin: float = 0.0) -> Array:
    """Points (2, n) fine enough to find where a formula fails on the unit disk: centre, rim and between."""
    radii = np.linspace(margin, 1 - margin, 101)
    r, theta = np.meshgrid(radii, np.linspace(0, 2 * np.pi, 360, endpoint=False))
    return np.stack([r * np.cos(theta), r * np.sin(theta)]).reshape(2, -1)


def _few(margin: float = 0.0) -> Array:
    """Some of `_disk`: every 97th of 101 on each radius, centre and rim among them."""
    return _disk(margin)[:, ::97]


def _require(
    key: str,
    given: Expression,
    good: NDArray[np.bool_],
    values: Array,
    what: str,
    points: Array | None = None,
    t: float = 0.0,
) -> None:
    """Raise unless the values of an expression are good at all points, those of `_disk` if none are given."""
    if not good.all():
        worst = int(np.argmin(good))
        x, y = (_disk() if points is None else points)[:, worst].round(6) + 0.0  # + 0.0: no minus zero
        where = f"is {values[worst]:.6g} at (x, y) = ({x:.6g}, {y:.6g})"
        raise mistake(key, str(given), f"should be {what} on the unit disk at t = {t:.6g}, but {where}")


def require_motion(motion: "MotionTable", time: "Time") -> None:
    """Raise unless a motion has positions and velocities from t = 0 to the end."""
    few = _few()
    for key, component in ("motion.x", motion.x), ("motion.y", motion.y):
        for t in time.instants:
            at = {"x0": few[0], "y0": few[1]}
            position, velocity = component(**at, t=t), component.rate(**at, t=time.within(t))
            finite = f"finite and at most {LARGEST:g}"
            _require(key, component, np.abs(position) <= LARGEST, position, finite, few, t)
            slow = f"moving no faster than {LARGEST:g}"
            _require(key, component, np.abs(velocity) <= LARGEST, velocity, slow, few, t)


def require_term(
    key: str, term: Expression, motion: "MotionTable | None", rests_until: float, times: Iterable[float]
) -> None:
    """Raise unless a term of current position, material point and time has values at all times.

    Points are where the motion takes them, or at rest.  Later the force balance may have taken them anywhere:
    then it is enough that there is a value somewhere on the disk.
    """
    origin = _few(NEAR)
    at = {"x0": origin[0], "y0": origin[1]}
    for t in times:
        x = origin if motion is None else np.array([one(**at, t=t) for one in (motion.x, motion.y)])
        values = term(**coordinates(x), **at, t=t)
        good = np.abs(values) <= LARGEST
        if motion is None and t > rests_until:
            good = np.full_like(good, good.any())
        _require(key, term, good, values, f"finite and at most {LARGEST:g}", origin, t)


class TomlTable(BaseModel):
    """A TOML table: no unknown keys, no conversions, no infinities, immutable; built when one is read."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        allow_inf_nan=False,
        arbitrary_types_allowed=True,
        defer_build=True,
    )


class SourceTable(TomlTable):
    """Where the scene comes from, and the source term of the transport equation (current position, t)."""

    citation: str = ""
    a: Anywhere | None = None


class ParametersTable(TomlTable):
    """`[parameters]`: non-dimensional, defaults of Table 2."""

    psi: NonNegativeGroup
    p: Group
    d: NonNegativeGroup = Parameters.d
    a_sat: PositiveGroup = Parameters.a_sat
    mu1: PositiveGroup = Parameters.mu1
    mu2: NonNegativeGroup = Parameters.mu2
    nu: Poisson = Parameters.nu
    l0: Fraction = Parameters.l0


class Switches(TomlTable):
    """`[model]`: the readings the article leaves open."""

    rheology: Annotated[Rheology, Field(strict=False)] = Model.rheology
    closure: Annotated[Closure, Field(strict=False)] = Model.closure
    delta: Annotated[Delta, Field(strict=False)] = Model.delta
    reaction: bool = Model.reaction


class ModeTable(TomlTable):
    """A linear mode of the unit disk.

    For `irrotational-wall` w_mn, numbered as in A.1; for the moving cell the n-th rate of angular number m by
    decreasing real part, a conjugate pair counting once.
    """

    m: int = Field(ge=0, le=100)
    n: int = Field(ge=1, le=100)


class Eigenmode(ModeTable):
    """A linear mode added to a and u at t = 0."""

    amplitude: float


class Initial(TomlTable):
    """`[initial]`: a and u at the material points."""

    a: Initially
    u: Two[Initially] | None = None
    eigenmode: Eigenmode | None = None

    @model_validator(mode="after")
    def _is_physical(self) -> Self:
        at = coordinates(_disk())
        a, least, positive = self.a(**at), 0.0, "positive"
        if self.eigenmode:  # |J_m| <= 1: whatever its sign, the mode takes at most its amplitude from a
            least, positive = abs(self.eigenmode.amplitude), "above the eigenmode's amplitude"
        _require("a", self.a, np.isfinite(a) & (a > least), a, positive)
        _require("a", self.a, a <= LARGEST, a, f"at most {LARGEST:g}")
        for i, component in enumerate(self.u or ()):
            u = component(**at)
            _require(f"u[{i}]", component, np.isfinite(u), u, "finite")
            _require(f"u[{i}]", component, np.abs(u) <= LARGEST, u, f"at most {LARGEST:g}")
        return self


class Time(TomlTable):
    """`[time]`: the end, and the times to keep."""

    end: float = Field(gt=0, le=LATEST)
    outputs: Many[float] = Field(default=(), max_length=MOST)

    @model_validator(mode="after")
    def _is_ordered(self) -> Self:
        if any(a >= b for a, b in pairwise((0.0, *self.outputs))):
            raise mistake("outputs", list(self.outputs), "should increase strictly from above 0")
        if self.outputs and self.outputs[-1] > self.end:
            raise mistake("outputs", list(self.outputs), f"should not go beyond time.end = {self.end:g}")
        for before, after in pairwise((0.0, *self.outputs, self.end)):
            if before != after and after - before < RESOLVED:
                valid = f"should keep {RESOLVED:g} apart from 0 and from each other, the end among them"
                raise mistake("end" if after == self.end else "outputs", after, valid)
        return self

    @property
    def instants(self) -> Array:
        """Times (n,) at which formulas are tried."""
        return np.unique(np.concatenate([np.linspace(0.0, self.end, 33), self.outputs[:100]]))

    def within(self, t: float) -> float:
        """A time between 0 and the end and not at them, for derivatives that are one-sided there."""
        return float(min(max(t, EARLIEST), np.nextafter(self.end, 0.0)))


class ProbesTable(TomlTable):
    """`[probes]`: material points to follow, by where they start."""

    points: Many[InDisk] = Field(default=(), max_length=MOST)


class MotionTable(TomlTable):
    """`[motion]`: prescribed positions of the material points (x0, y0) at t."""

    x: Following
    y: Following

    @model_validator(mode="after")
    def _starts(self) -> Self:
        x0, y0 = _disk()
        for key, component in ("x", self.x), ("y", self.y):
            position = component(x0=x0, y0=y0, t=0.0)
            _require(key, component, np.isfinite(position), position, "finite")
            _require(key, component, np.abs(position) <= LARGEST, position, f"at most {LARGEST:g}")
        return self


class Domain(TomlTable):
    """`[domain]`: degrees by which the whole scene is turned about the origin, anticlockwise."""

    rotation: float = 0.0


class AsPublished(TomlTable):
    """`[as_published]`: mesh and step the article printed (refine 5 has 2113 nodes, 6 has 8321)."""

    refine: int | None = Field(default=None, ge=1, le=10)
    dt: Positive | None = None


class Bound(TomlTable):
    """What an error is held to: h2 h^2 + dt dt."""

    h2: NonNegative = 0.0
    dt: NonNegative = 0.0

    @model_validator(mode="after")
    def _is_positive(self) -> Self:
        if self.h2 == self.dt == 0:
            raise ValueError("should give h2 or dt above 0")
        return self


class Exact(TomlTable):
    """`[expect.exact]`: the concentration at current position, material point and time; L2, relative."""

    a: Anywhere
    bound: Bound


class GrowthRate(ModeTable):
    """`[expect.growth_rate]`: a mode that grows as theory says, fitted over a window of time."""

    window: Two[NonNegative]
    bound: Bound


class Transient(TomlTable):
    """`[expect.transient]`: from t = 0 to the end energy grows as far as that of any perturbation can."""

    m: int = Field(ge=0, le=100)
    bound: Bound


class ReferenceValues(TomlTable):
    """`[[expect.reference.at]]`: values at one output time; nan is not judged.

    `probe_a` and `probe_x` hold one entry per probe.
    """

    time: Positive
    area: OrNan | None = None
    total_actin: OrNan | None = None
    probe_a: Many[OrNan] | None = None
    probe_x: Many[Two[OrNan]] | None = None


class ReferenceBounds(TomlTable):
    """`[expect.reference.bound]`: per quantity; relative for area and total actin, absolute for probes."""

    area: Bound | None = None
    total_actin: Bound | None = None
    probe_a: Bound | None = None
    probe_x: Bound | None = None


class References(TomlTable):
    """`[expect.reference]`: values somebody else computed, and how closely they are to be met."""

    origin: str
    bound: ReferenceBounds
    at: Many[ReferenceValues] = Field(min_length=1, max_length=MOST)


class Agreement(TomlTable):
    """`[expect.agreement]`: FEM against FV, relative L2 of cell means at the end."""

    bound: Bound


class Expect(TomlTable):
    """`[expect]`: what the scene is checked against.

    `ends` is how every run must end, `at` when, and `within` by how much that may be off.
    """

    exact: Exact | None = None
    growth_rate: GrowthRate | None = None
    transient: Transient | None = None
    reference: References | None = None
    agreement: Agreement | None = None
    ends: Annotated[Ending | None, Field(strict=False)] = None
    at: Positive | None = None
    within: Positive | None = None

    @model_validator(mode="after")
    def _says_how_it_ends(self) -> Self:
        if len({self.ends is None, self.at is None, self.within is None}) > 1:
            missing = next(name for name in ("ends", "at", "within") if getattr(self, name) is None)
            raise mistake(missing, None, "should stand where one of ends, at and within does")
        if self.ends in (Ending.COMPLETED, Ending.INTERRUPTED):
            raise mistake("ends", str(self.ends), "should be a way to fail, as singular_dilation")
        return self
