"""The commands of the studies: what each is asked, and what it is asked by default.

Options that all of them have stand in `conduct.py`.
"""

from typing import TYPE_CHECKING

from actin_xcheck.cli.conduct import Methods, Scenes, study_command

if TYPE_CHECKING:
    from actin_xcheck.studies.study import Study

DISTORTED = {
    "smooth-fronts": ("perturbed", "stretched", "slivers"),
    "fitted-ring": ("off-ring",),
}
"""Scenes whose data cost no order, and what their meshes suffer."""

DISTORTED_METHODS = ("fem-p1-paper", "fem-p2-imex3", "fem-p4-imex4", "fv-coupled", "fv-order2")


@study_command("distort")
def distort(scenes: Scenes = None, methods: Methods = None) -> "Study":
    """Chart each method's error on the disk's mesh perturbed, stretched, flattened and off the ring.

    SCENE is a shipped name or the path of a TOML file; default: the coupled model from smooth data, and one
    whose ring's pressure expands the cell.  Every distortion is run on two mesh widths, which gives an order,
    and counted in iterations; scenes that are named suffer all that apply (about four minutes on two cores).
    Runs that fail are part of the report.
    """
    from actin_xcheck.runs.method import find_methods
    from actin_xcheck.scene.scene import load_scenes
    from actin_xcheck.studies.distort.cases import FAMILIES, check, families_of
    from actin_xcheck.studies.distort.study import distort as study

    loaded, chosen = load_scenes(scenes or DISTORTED), find_methods(methods or DISTORTED_METHODS)
    for scene in loaded:
        check(scene, chosen)
    suffered = [
        families_of(scene) if scenes else [FAMILIES[key] for key in DISTORTED[scene.name]] for scene in loaded
    ]
    return study(list(zip(loaded, suffered, strict=True)), chosen)
