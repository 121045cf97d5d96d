"""Where elements and finite volumes part: in transport or in the force balance, told by a loan.

Finite volumes that have a force balance of their own are run again with that of the elements.  This run has
its force balance in common with the elements and its transport in common with the volumes: it can be apart
from the former by transport alone, from the latter by mechanics alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isnan, nan

from actin_xcheck.scene.scene import Scene
from actin_xcheck.verdicts.triangulate import (
    QUANTITIES,
    Corner,
    Levels,
    Triangle,
    corners_of,
    distance,
    in_words,
    reaches,
    times_of,
)

LENT = "FV by FEM's balance"
"""What a reader calls the volumes with a lent force balance."""


@dataclass(frozen=True)
class Parting:
    """A quantity of which FEM and FV part, where and when they are furthest apart.

    Attributes
    ----------
    scene, methods, quantity : what was compared: elements, volumes with a lent force balance and with theirs.
    words : the quantity, place and time for a reader.
    corners : of these three; none where a run came to no number.
    apart : distance of FEM and FV over the sum of their uncertainties; infinite where one alone came to the
        end, nan where the run with the lent force balance tells nothing.
    transport, mechanics : the same of FEM and of FV to the volumes with FEM's force balance.
    sentence : where they part, and by how much.
    """

    scene: str
    methods: tuple[str, str, str]
    quantity: str
    words: str
    corners: tuple[Corner, ...]
    apart: float
    transport: float
    mechanics: float
    sentence: str

    @property
    def key(self) -> str:
        """A name of its own."""
        return "--".join((self.scene, *self.methods, self.quantity))


def parted(triangles: Sequence[Triangle]) -> list[tuple[str, str]]:
    """The pairs of methods, elements first, whose numbers part, or one of which came to none."""
    apart = (one.methods for one in triangles if not one.corners or distance(*one.corners[:2]) > 1)
    return list(dict.fromkeys(apart))


def localise(scene: Scene, elements: Levels, lent: Levels, own: Levels) -> list[Parting]:
    """Every quantity of which elements and volumes part, that of which they part most first.

    Parameters
    ----------
    scene : of all runs.
    elements, own : two codes that part.
    lent : the volumes of `own` with the force balance of the elements.
    """
    three = elements, lent, own
    times, ended = times_of(scene, three)
    found = [_of_ending(scene, three, ended)] if ended else []
    for quantity in QUANTITIES:
        every = [
            _of_numbers(scene, three, quantity, words, corners[:3])
            for words, corners in corners_of(scene, three, quantity, times)
        ]
        found += sorted((one for one in every if one.apart > 1), key=_apart)[-1:]
    return sorted(found, key=_apart, reverse=True)


def _apart(parting: Parting) -> float:
    return -1.0 if isnan(parting.apart) else parting.apart


def _of_numbers(
    scene: Scene, levels: Sequence[Levels], quantity: str, words: str, corners: Sequence[Corner]
) -> Parting:
    elements, lent, own = corners
    lent = replace(lent, name=LENT)
    distances = distance(elements, own), distance(elements, lent), distance(lent, own)
    said = ", ".join(in_words(one, one.uncertainty) for one in (elements, lent, own))
    by = "by {:.2g} times the sum of their uncertainties, transport by {:.2g}, mechanics by {:.2g}"
    return _parting(
        scene, levels, quantity, words, (elements, lent, own), distances, f"{by.format(*distances)}: {said}"
    )


def _of_ending(scene: Scene, levels: Sequence[Levels], ended: str) -> Parting:
    """Of runs that do not all come to the scene's end."""
    elements, lent, own = (reaches(one.runs[0], scene.output_times[-1]) for one in levels)
    apart = inf if elements != own else nan
    distances = apart, inf if elements != lent else 0.0, inf if lent != own else 0.0
    return _parting(scene, levels, "end", "the end", (), distances, f"is not reached by all{ended}")


def _parting(
    scene: Scene,
    levels: Sequence[Levels],
    quantity: str,
    words: str,
    corners: tuple[Corner, ...],
    distances: tuple[float, float, float],
    how: str,
) -> Parting:
    apart, transport, mechanics = distances
    elements, lent, own = (one.method.name for one in levels)
    return Parting(
        scene=scene.name,
        methods=(elements, lent, own),
        quantity=quantity,
        words=words,
        corners=corners,
        apart=apart,
        transport=transport,
        mechanics=mechanics,
        sentence=f"{elements} and {own} part {_where(*distances)}: {words} {how}",
    )


def _where(apart: float, transport: float, mechanics: float) -> str:
    """In what the codes part, in words."""
    if isnan(apart + transport + mechanics):
        return "somewhere, it is not known where"
    off = " and ".join(name for name, by in (("transport", transport), ("mechanics", mechanics)) if by > 1)
    return f"in {off or 'transport and mechanics together, in neither alone'}"
