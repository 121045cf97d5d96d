"""What is run: scenes, methods and levels."""

from dataclasses import dataclass

from actin_xcheck.runs.commands import command
from actin_xcheck.runs.method import METHODS, Method
from actin_xcheck.scene.scene import Scene, load_scene

EPSILON, SEED = 1e-14, 1
"""Relative size of the perturbation that makes a twin, and the seed of its noise."""


@dataclass(frozen=True)
class Level:
    """One mesh of a method, and the largest local error of its steps."""

    method: str
    refine: int
    rtol: float

    @property
    def of(self) -> Method:
        """The method."""
        return METHODS[self.method]


@dataclass(frozen=True)
class Trial:
    """One run.

    Attributes
    ----------
    scene : a shipped name.
    level : how it is run.
    remesh : whether the mesh is replaced when it is about to fold.
    epsilon : of the twin that runs beside it; 0 without one.
    """

    scene: str
    level: Level
    remesh: bool = False
    epsilon: float = 0.0

    @property
    def loaded(self) -> Scene:
        """The scene."""
        return load_scene(self.scene)

    @property
    def command(self) -> str:
        """What makes its numbers again; `run` tells neither the breakdown nor how twins part."""
        return command("extremes", only=self.scene)


def _ladder(method: str, rtol: float, *refines: int) -> tuple[Level, ...]:
    """Meshes, coarsest first, and the coarsest one again with a tolerance ten times as large."""
    return (*(Level(method, refine, rtol) for refine in refines), Level(method, refines[0], 10 * rtol))


LINEAR, CUBIC = _ladder("fem-p1-imex2", 1e-7, 4, 5, 6), _ladder("fem-p3-imex4", 1e-8, 2, 3, 4)
VOLUMES = _ladder("fv-order2", 1e-7, 3, 4, 5)

BREAKDOWNS = {
    "fig18-nonuniform-contraction-viscoelastic": (LINEAR, CUBIC, VOLUMES),
    "sec54-not-shown-viscoelastic": (LINEAR, CUBIC),
    "sec54-failure-viscoelastic": (LINEAR, CUBIC),
    "fig19-protrusions-viscoelastic": (LINEAR, CUBIC),
    "sec6-long-viscoelastic": (_ladder("fem-p2-imex3", 1e-5, 3, 4, 5),),
}
"""Scenes whose model ends, and the ladders of methods that say when; see `_ladder`."""

CARRIED = {
    "sec54-failure": (Level("fem-p2-imex3", 4, 1e-5), Level("fem-p3-imex4", 4, 1e-6)),
    "sec54-not-shown": (Level("fem-p2-imex3", 4, 1e-5), Level("fem-p3-imex4", 3, 1e-6)),
    "fig18-nonuniform-contraction": (Level("fem-p2-imex3", 4, 1e-5), Level("fem-p3-imex4", 3, 1e-6)),
    "fig19-protrusions": (Level("fem-p2-imex3", 4, 1e-5), Level("fem-p3-imex4", 3, 1e-6)),
    "sec6-long-viscous": (Level("fem-p2-imex3", 3, 1e-4),),
}
"""Scenes that the model carries through, each run as it is and with remeshing."""

TWINS = (Level("fem-p2-imex3", 4, 1e-5), Level("fem-p3-imex4", 4, 1e-6))
"""How the scene of the article's failure is run beside a twin."""


def trials() -> list[Trial]:
    """Every run, the longest first."""
    twins = [Trial("sec54-failure", level, epsilon=EPSILON) for level in TWINS]
    carried = [
        Trial(scene, level, remesh)
        for scene, levels in CARRIED.items()
        for level in levels
        for remesh in (True, False)
    ]
    ended = [
        Trial(scene, level) for scene, ladders in BREAKDOWNS.items() for ladder in ladders for level in ladder
    ]
    return twins + carried + ended
