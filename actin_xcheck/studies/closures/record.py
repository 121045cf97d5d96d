"""The closures report as a file: the ripples of every method and the rims of every run.

`/ripples/<key>` holds a spectrum: what was asked for in attributes, `modes`, `measured` and `predicted` in
datasets.  `/runs/<key>` holds a run: how it ended in attributes, `times` (n,) and `rims` (n, 2, nodes) in
datasets.  The files under `parts/` hold one of them each, and are taken up again by a report that goes on.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from actin_xcheck.core.model import Closure
from actin_xcheck.runs.store import Attributes, provenance, reading, state, writing
from actin_xcheck.studies.closures.growth import Ripples, Spectrum
from actin_xcheck.studies.closures.refinement import Course, Rim

FILE_NAME = "closures.h5"

Asked = Ripples | Course
Found = Spectrum | Rim

_GROUPS = {Spectrum: "ripples", Rim: "runs"}


@dataclass(frozen=True, eq=False)
class Closures:
    """A stored report: what was found, in order, and what was stated about the whole."""

    path: Path
    attributes: dict[str, Any]
    spectra: tuple[Spectrum, ...]
    rims: tuple[Rim, ...]


def write_closures(path: Path, found: Iterable[Found], attributes: Attributes) -> None:
    """Write what was found, replacing `path` atomically; UserError where it cannot be written."""
    with writing(path, {**attributes, **provenance()}) as file:
        groups = {kind: file.create_group(name, track_order=True) for kind, name in _GROUPS.items()}
        for one in found:
            _write(groups[type(one)], one)


def read_closures(path: Path) -> Closures:
    """Return the report stored in `path`; UserError where it is missing, not whole or something else."""
    with reading(path, "closures report") as file:
        spectra = tuple(_spectrum(group) for group in file["ripples"].values())
        rims = tuple(_rim(group) for group in file["runs"].values())
        return Closures(Path(path), dict(file.attrs), spectra, rims)


def found_before(folder: Path, asked: Asked, versions: dict[str, str]) -> Found | None:
    """What the same code found before, in the folder; None where it has not, or which code is not known."""
    path, commit = _part(folder, asked), versions["commit"]
    if not path.exists() or commit.endswith("-dirty") or commit == "unknown":
        return None
    stored = read_closures(path)
    one: Found = stored.spectra[0] if stored.spectra else stored.rims[0]
    known = one.asked if isinstance(one, Spectrum) else one.course
    stated = {name: str(stored.attributes[name]) for name in versions}
    return one if known == asked and stated == versions else None


def keep(folder: Path, asked: Asked, found: Found) -> None:
    """Write one finding into a file of its own."""
    path = _part(folder, asked)
    path.parent.mkdir(exist_ok=True)
    write_closures(path, [found], {})


def _part(folder: Path, asked: Asked) -> Path:
    return folder / "parts" / f"{asked.key}.h5"


def _write(within: h5py.Group, found: Found) -> None:
    if isinstance(found, Spectrum):
        asked = found.asked
        group = within.create_group(asked.key)
        state(group, {"method": asked.method, "refine": asked.refine, "closure": str(asked.closure)})
        state(group, {"advancing": asked.advancing, "nodes": found.nodes, "speed": found.speed})
        group["asked"] = asked.modes
        for name in "modes", "measured", "predicted":
            group[name] = getattr(found, name)
    else:
        course = found.course
        group = within.create_group(course.key)
        state(group, {"scene": course.scene, "method": course.method, "closure": str(course.closure)})
        state(group, {"level": course.level, "refine": course.refine, "steps": course.steps})
        state(group, {"outcome": found.outcome, "message": found.message, "command": course.command})
        group["times"] = found.times
        group.create_dataset("rims", data=found.rims, compression="gzip")


def _spectrum(group: h5py.Group) -> Spectrum:
    said = group.attrs
    asked = Ripples(
        str(said["method"]),
        int(said["refine"]),
        Closure(said["closure"]),
        bool(said["advancing"]),
        tuple(group["asked"][()].tolist()),
    )
    numbers = (group[name][()] for name in ("modes", "measured", "predicted"))
    return Spectrum(asked, int(said["nodes"]), float(said["speed"]), *numbers)


def _rim(group: h5py.Group) -> Rim:
    said = group.attrs
    course = Course(str(said["scene"]), str(said["method"]), Closure(said["closure"]), int(said["level"]))
    return Rim(course, group["times"][()], group["rims"][()], str(said["outcome"]), str(said["message"]))
