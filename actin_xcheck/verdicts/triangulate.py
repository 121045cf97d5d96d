"""Triangulation: two codes and, where a scene has one, a third corner; which of them is off, said in words.

Every run has coarser companions, h doubled and dt ~ h^(order_h/order_dt), so that both parts of its error
fall together; from them, and from what it says of the errors of its own steps, comes its uncertainty.  Two
numbers agree where they are no further apart than the sum of their uncertainties.  Meshes are not similar
where the ring, on a layer of each, is so near the rim that h does not halve there.  At probes they never are:
under a material point none is the coarser one refined, and pointwise the declared orders are not claimed.
Cell averages are left out: triangles of two levels are nested in topology only, and carrying one to the other
would cost as much as what is measured.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.mesh import layer_widths
from actin_xcheck.core.model import Array
from actin_xcheck.core.parameters import Delta, Fidelity
from actin_xcheck.runs.growth import fitted_rate
from actin_xcheck.runs.method import Method
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.resolve import turn_matrix
from actin_xcheck.scene.scene import Scene
from actin_xcheck.verdicts.known import Known, known, rate_parts
from actin_xcheck.verdicts.orders import uncertainty

ROUND_OFF = {"growth_rate": 1e-8}
"""Relative; 1e-12 of what is not named.  Modes have an amplitude of 1e-6 on a = 1."""

SOLVED = 1e-2
"""Of the round-off above, what the linear systems of one step leave: they are solved to 1e-14."""

QUANTITIES = ("area", "total_actin", "probe_a", "probe_x", "growth_rate")

RELATIVE = ("area", "total_actin", "growth_rate")
"""Those whose errors are relative where an accuracy is asked for."""


@dataclass(frozen=True, eq=False)
class Levels:
    """A method's runs of a scene: as asked for, then its coarser companions as far as there are any.

    What linear modes leave out is `neglected` at most, relative, and not seen by any of them; growth rates
    are theirs.
    """

    method: Method
    runs: tuple[Run, ...]
    neglected: float = 0.0

    @property
    def family(self) -> str:
        """What a reader calls the code; that of another package has the name of its method."""
        ours = {"fem": "FEM", "fv": "FV"}
        return ours.get(self.method.family, self.method.name)


@dataclass(frozen=True)
class Corner:
    """One corner's number: its uncertainty (nan where there is none), how that came about, and the observed
    order (nan where there is none).
    """

    name: str
    value: float
    uncertainty: float
    how: str
    order: float = np.nan


@dataclass(frozen=True)
class Triangle:
    """One quantity of one scene by two methods, where and when its corners are furthest apart.

    Attributes
    ----------
    scene, methods, quantity : what was compared, `methods` finite elements first, then finite volumes.
    words : the quantity, place and time for a reader.
    corners : the two codes and, where it is known, theory; none where a run came to no output time.
    ratio : largest distance of two corners over the sum of their uncertainties; nan without them.
    sentence : the verdict.
    """

    scene: str
    methods: tuple[str, str]
    quantity: str
    words: str
    corners: tuple[Corner, ...]
    ratio: float
    sentence: str

    @property
    def key(self) -> str:
        """A name of its own."""
        return "--".join((self.scene, *self.methods, self.quantity))

    @property
    def verdict(self) -> str:
        """As of its claim."""
        return self.claim("").verdict

    @property
    def apart(self) -> float:
        """Distance between the codes' numbers."""
        return abs(self.corners[0].value - self.corners[1].value) if self.corners else np.nan

    def claim(self, command: str) -> Claim:
        """The corners agree within the sum of their uncertainties; not judged where one of them has none."""
        judged = bool(np.isfinite(self.ratio)) or not self.corners
        how = "; ".join(f"{corner.name}: {corner.how}" for corner in self.corners)
        measure = "largest distance over the sum of uncertainties" if judged else "the codes' difference"
        note = f"value: {measure}. {how}" if how else "value: none, for there is nothing to compare"
        return Claim(
            kind=ClaimKind.TRIANGLE,
            quantity=self.quantity,
            scene=self.scene,
            methods=self.methods,
            statement=f"{self.words}: {self.sentence}",
            value=self.ratio if judged else self.apart,
            bound=1.0 if judged else np.nan,
            command=command,
            path="/tables/triangles",
            note=note,
        )


def triangulate(scene: Scene, levels: Sequence[Levels]) -> list[Triangle]:
    """Every quantity that two codes give, for every pair of methods of different codes."""
    ranked = sorted(levels, key=lambda one: {"fem": 0, "fv": 1}.get(one.method.family, 2))
    pairs = [pair for pair in combinations(ranked, 2) if len({one.method.family for one in pair}) > 1]
    return [triangle for one, other in pairs for triangle in _of_pair(scene, one, other)]


def _of_pair(scene: Scene, *pair: Levels) -> Iterator[Triangle]:
    both = pair[0].method.name, pair[1].method.name
    times, ended = times_of(scene, pair)
    if not (times or scene.times_before_it_ends):
        return  # there is no time to compare at, as is expected
    if not times:
        sentence = f"no output time was reached by both{ended}"
        yield Triangle(scene.name, both, "area", "nothing to compare", (), np.nan, sentence)
        return
    for quantity in QUANTITIES:
        found = [
            Triangle(scene.name, both, quantity, words, corners, *verdict(corners, ended))
            for words, corners in corners_of(scene, pair, quantity, times)
        ]
        if found:
            yield max(found, key=_tells)


def _tells(triangle: Triangle) -> tuple[bool, float, float]:
    """How much it tells: first where a third corner can say which one is off, then the furthest apart."""
    judged = bool(np.isfinite(triangle.ratio))
    blames = triangle.ratio > 1 and len(triangle.corners) > 2
    return blames, triangle.ratio if judged else -1.0, 0.0 if judged else triangle.apart


def _names(scene: Scene, quantity: str) -> list[str]:
    """What a reader calls the parts of a quantity; none where the scene does not have it."""
    where = [f"({x:.4g}, {y:.4g})" for x, y in scene.probes.points]
    match quantity:
        case "probe_a":
            return [f"a at the probe {place}" for place in where]
        case "probe_x":
            return [f"{axis} of the probe {place}" for place in where for axis in "xy"]
        case "growth_rate":
            mode = scene.expect.growth_rate
            parts = ("growth rate", "frequency")
            return [f"{part} of mode ({mode.m}, {mode.n})" for part in parts] if mode else []
        case "centroid":
            return ["x of the centroid", "y of the centroid"]
        case _:
            return [quantity.replace("_", " ")]


def times_of(scene: Scene, levels: Sequence[Levels]) -> tuple[list[float], str]:
    """The output times that all runs reach, and how those ended that did not reach the last one, in words."""
    runs = [one.runs[0] for one in levels]
    missing = [_ending(run) for run in runs if not reaches(run, scene.output_times[-1])]
    times = [t for t in scene.output_times if all(reaches(run, t) for run in runs)]
    return times, f" ({'; '.join(missing)})" if missing else ""


def corners_of(
    scene: Scene, levels: Sequence[Levels], quantity: str, times: Sequence[float]
) -> Iterator[tuple[str, tuple[Corner, ...]]]:
    """Words and corners, theory last, of every part of a quantity at every time, of a rate at the end."""
    names = _names(scene, quantity)
    for t in times if names else ():
        if quantity == "growth_rate" and t != scene.output_times[-1]:
            continue
        theory = known(scene, quantity, t)
        codes = [(one.family, *estimate(scene, one, quantity, t)) for one in levels]
        for i, name in enumerate(names[: len(codes[0][1])]):  # a mode need have no frequency
            corners = [
                Corner(code, float(values[i]), spread, how, order)
                for code, values, spread, how, order in codes
            ]
            if theory is not None and np.isfinite(theory.values[i]):
                corners.append(_third(theory, i))
            yield name if quantity == "growth_rate" else f"{name} at t = {t:.4g}", tuple(corners)


def _third(theory: Known, i: int) -> Corner:
    known_to = "linear" if theory.origin == "exact mode" else "printed"
    how = f"{known_to} to {theory.uncertainty:.0e}" if theory.uncertainty else "no uncertainty"
    return Corner(theory.origin, float(theory.values[i]), theory.uncertainty, how)


def estimate(scene: Scene, levels: Levels, quantity: str, t: float) -> tuple[Array, float, str, float]:
    """Values (k,) of the run as asked for, their one uncertainty, how it came about, and the observed order.

    Uncertainty and order are nan where there is none.
    """
    run = levels.runs[0]
    asked = run.attributes
    if "error_estimate" in asked and quantity in (*QUANTITIES, "centroid"):
        found, error = _measure(scene, run, quantity, t), float(asked["error_estimate"])
        size = float(np.abs(found).max(initial=0.0)) if quantity in RELATIVE else 1.0
        return found, error * size, f"estimated by levels for an accuracy of {asked['accuracy']:g}", np.nan
    values: list[Array] = []
    why = "it has no coarser run" if levels.method.order_h else "the method declares no order"
    for level in levels.runs:
        if not reaches(level, t):
            why = f"a coarser run ended early, {_ending(level)}"
            break
        found = _measure(scene, level, quantity, t)
        if not np.isfinite(found).all():
            why = "no such exponentials fit the run" if not values else "none fit a coarser run"
            break
        values.append(found)
    if len(values) < 2:
        return _measure(scene, run, quantity, t), np.nan, f"no uncertainty, for {why}", np.nan
    ratio = _error_ratio(levels, t)
    if ratio <= 1:
        why = f"a coarser run makes no longer steps up to t = {t:.4g}"
        return values[0], np.nan, f"no uncertainty, for {why}", np.nan
    similar = not quantity.startswith("probe") and _similar(scene, levels.runs[: len(values)])
    size = max(1.0, float(np.abs(values[0]).max()))
    solved = SOLVED * (run.series["time"] <= t).sum()
    rate = scene.expect.growth_rate if quantity == "growth_rate" else None
    per_time = 1 / np.ptp(rate.window) if rate else 0.0  # round-off is a logarithm's, over a window
    floor = ROUND_OFF.get(quantity, 1e-12) * (1 + solved) * max(size, per_time)
    steps = _of_steps(scene, run, quantity, t) * size
    if quantity != "growth_rate":
        floor += levels.neglected * size * (2 if quantity == "area" else 1)
    lacks, order = len(values) < len(levels.runs), levels.method.order_h
    return values[0], *uncertainty(values, order, ratio, similar, floor, steps, lacks)


def _similar(scene: Scene, runs: Sequence[Run]) -> bool:
    """Whether h halves from level to level on both sides of the ring, a layer of every mesh, within sqrt 2.

    Layers are whole numbers: where the ring is near the rim one may stay one, or become three.
    """
    stated = [run.attributes for run in runs]
    whole = scene.physics.delta is Delta.RING or stated[0]["fidelity"] == Fidelity.FULL
    if stated[0]["mesh"] or not whole:  # cells are divided; the ring is on 1/2
        return True
    fine_to_coarse = np.array([layer_widths(int(one["refine"]), scene.parameters.l0) for one in stated])
    halvings = np.log2(fine_to_coarse[1:] / fine_to_coarse[:-1])
    return bool((np.abs(halvings - 1) <= 0.5).all())


def _of_steps(scene: Scene, run: Run, quantity: str, t: float) -> float:
    """What the errors of all steps up to t amount to, by the method's own estimates; 0 where it makes none.

    They are relative, in radii and in L2; that of an area is twice that of its radius.  Of a mode they count
    in amplitudes: their sum is what its logarithm is off by over the window of the fit.
    """
    errors = np.nan_to_num(run.series.get("local_error", np.zeros(1)))
    time = run.series["time"]
    if quantity != "growth_rate":
        return float(errors[time <= t * (1 + 1e-9)].sum()) * (2 if quantity == "area" else 1)
    assert scene.expect.growth_rate is not None
    start, end = scene.expect.growth_rate.window
    inside = (start < time) & (time <= end)
    return float((errors[inside] / np.abs(run.series["mode_amplitude"][inside])).sum()) / (end - start)


def _error_ratio(levels: Levels, t: float) -> float:
    """What the error up to t grows by from the run to its companion, if it has the declared orders.

    Steps land on output times, so that short intervals hold more of them than the companion's dt asks for.
    """
    method, (fine, coarse, *_) = levels.method, levels.runs
    in_space = 2.0**method.order_h
    if np.isfinite(fine.attributes["rtol"]):
        return in_space
    steps = [int((run.series["time"] <= t * (1 + 1e-9)).sum()) - 1 for run in (fine, coarse)]
    return float(min(in_space, (steps[0] / steps[1]) ** method.order_dt))


def _measure(scene: Scene, run: Run, quantity: str, t: float) -> Array:
    """The quantity's values (k,) in the scene's frame."""
    if quantity == "growth_rate":
        return _rate(scene, run)
    value = np.asarray(run.row_at(t)[quantity], dtype=float)
    return np.ravel(value @ turn_matrix(scene) if quantity in ("probe_x", "centroid") else value)


def _rate(scene: Scene, run: Run) -> Array:
    """The fitted growth rate, and frequency where theory has one; nan where no such exponentials fit.

    In a window in which a pair hardly turns two real ones may: 0 is then no estimate of a frequency.
    """
    theory = known(scene, "growth_rate", 0.0)
    assert theory is not None
    rate, oscillates = fitted_rate(scene, run), len(theory.values) > 1
    return rate_parts(complex(np.nan, np.nan) if oscillates and rate.imag == 0 else rate, oscillates)


def reaches(run: Run, t: float) -> bool:
    """Whether a run came as far as t."""
    return bool(run.series["time"][-1] >= t * (1 - 1e-9))


def _ending(run: Run) -> str:
    stated, t = run.attributes, run.series["time"][-1]
    return f"{stated['method_name']} at refine {stated['refine']} ended at t = {t:.4g}: {stated['outcome']}"


def verdict(corners: Sequence[Corner], ended: str = "") -> tuple[float, str]:
    """The largest distance over the sum of uncertainties, and which corner is off, in words.

    Parameters
    ----------
    corners : of the two codes, and perhaps a third.
    ended : how a run ended before its time, where one did.
    """
    one, other = corners[:2]
    finest = 1e-2 * np.fmin(one.uncertainty, other.uncertainty)  # theory two digits further than the codes
    known_to = one.uncertainty, other.uncertainty, finest
    stated = ", ".join(map(in_words, corners, known_to)) + ended
    if unsure := [f"{corner.name} has {corner.how}" for corner in corners if np.isnan(corner.uncertainty)]:
        return np.nan, f"{stated}: not judged, {' and '.join(unsure)}"
    codes = distance(one, other)
    if len(corners) == 2:
        if codes <= 1:
            return codes, f"{stated}: the two agree; there is no theory here"
        return codes, (
            f"{stated}: they differ by {codes:.2g} times the sum of their uncertainties; there is no theory "
            "here: one of them is off and this scene cannot say which"
        )
    third = corners[2]
    off = [distance(code, third) for code in (one, other)]
    return max(codes, *off), f"{stated}: {_which(corners, codes, off)}"


def _which(corners: Sequence[Corner], codes: float, off: Sequence[float]) -> str:
    """Which of three corners is off, given the distances of the codes and of each to the third."""
    third, (one, other) = f"the {corners[2].name}", (corner.name for corner in corners[:2])
    if max(codes, *off) <= 1:
        return "all three agree"
    if min(off) > 1 and codes <= 1:
        return (
            f"{one} and {other} agree, both differ from {third}, by {_times(off[0])} and {_times(off[1])}: "
            "it does not describe this scene, a fault is common to both (as of a force balance that is lent) "
            "or their uncertainties are too small"
        )
    if min(off) > 1:
        return (
            f"no two corners agree: {one} is off {third} by {_times(off[0])}, {other} by {_times(off[1])}, "
            f"and they differ by {_times(codes)}"
        )
    if max(off) <= 1:
        return f"each agrees with {third}, on either side of it"
    good, bad = (corners[i].name for i in np.argsort(off))
    if codes <= 1:
        return (
            f"{one} and {other} agree, and {good} with {third}, which {bad} misses by {_times(max(off))}: "
            f"{bad} is off, or its uncertainty is too small"
        )
    return f"{good} and {third} agree; {bad} is off by {_times(max(off))}: {bad} is the corner that is off"


def _times(ratio: float) -> str:
    return f"{ratio:.2g} times the uncertainty"


def distance(one: Corner, other: Corner) -> float:
    """Of two corners, over the sum of their uncertainties; nan without them."""
    return abs(one.value - other.value) / (one.uncertainty + other.uncertainty)


def in_words(corner: Corner, known_to: float) -> str:
    """Name and number, see `in_digits`."""
    return f"{corner.name} {in_digits(corner, known_to)}"


def in_digits(corner: Corner, known_to: float) -> str:
    """Value and uncertainty, as far as two digits go of what it is known to; six where that is nan."""
    digits = 6 if np.isnan(known_to) else min(max(1 - int(np.floor(np.log10(known_to))), 0), 10)
    there = np.isfinite(corner.value)
    said = f"{round(corner.value, digits) + 0.0:.{digits}f}" if there else "none"  # + 0.0: no minus zero
    return f"{said} ± {corner.uncertainty:.{digits}f}" if 0.5 * 10**-digits < corner.uncertainty else said
