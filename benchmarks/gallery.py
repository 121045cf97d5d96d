"""The docs' gallery, every shipped scene as `run SCENE` makes it: `python -m benchmarks.gallery [SCENE]...`.

Runs and answers stay in reports/gallery, where it goes on; docs/gallery gets a picture of each cell at its
end and what it comes to.  About two minutes.
"""

import hashlib
import json
import sys
import time
from base64 import b64decode
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from actin_xcheck.cli.conduct import carry_out
from actin_xcheck.core.files import replace_file
from actin_xcheck.report.draw import Brush, closed_rim, colours, window
from actin_xcheck.report.film import on_triangles
from actin_xcheck.runs.accuracy import OutOfReach, deliver
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.numerics import Wanted, command
from actin_xcheck.runs.run import run as make
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.scene.shelf import scene_text, shipped_scenes
from actin_xcheck.studies.study import Report, Study, Table, Task
from actin_xcheck.verdicts.final import final_values, in_a_sentence
from actin_xcheck.verdicts.judge import asked_as, judge
from actin_xcheck.verdicts.triangulate import Levels

ACCURACY = 1e-3

BEYOND = ("sec54-failure", "sec54-not-shown")
"""Scenes of which no level has that accuracy within an hour: they hang as the article has run them."""

AS_PUBLISHED = "fem-p1-paper"

FOLDER = Path(__file__).parents[1] / "docs" / "gallery"
"""Its pictures, and `scenes.json` with a `Hung` for each scene."""


@dataclass(frozen=True)
class Hung:
    """A scene on the wall.

    Attributes
    ----------
    scene, digest : its name, and of its text.
    verdict, comes_to : of its claims those that hold, and its numbers at the end.
    seconds : of the processor, for all levels of the climb.
    made_by : the last level.
    picture, extent : WebP in base64, and the range of a in it.
    """

    scene: str
    digest: str
    verdict: str
    comes_to: str
    seconds: float
    made_by: str
    picture: str
    extent: str


def digest_of(name: str) -> str:
    """Of the text of a shipped scene, to see whether the gallery shows it as it is."""
    return hashlib.sha256(scene_text(name).encode()).hexdigest()[:16]


def hung(name: str, folder: Path) -> Hung:
    """Run a scene to `ACCURACY` where that can be, judge it and take its picture."""
    scene, path, began = load_scene(name), folder / f"{name}.vtkhdf", time.process_time()
    if name in BEYOND:
        numerics = Wanted(AS_PUBLISHED).on(scene)
        make(scene, numerics, path, numerics.command(name, path.name))
    else:
        with suppress(OutOfReach):  # its file says so, and so does the uncertainty
            deliver(scene, ACCURACY, path, command("run", name))
    seconds = time.process_time() - began
    run = read_run(path)
    said = run.attributes
    judged = [one for one in judge(scene, {asked_as(run): run}) if one.judged]
    failing = [f"fails: {one.statement} ({one.note})" for one in judged if not one.holds]
    levels = Levels(find_method(str(said["method_name"])), (run,))
    comes_to = in_a_sentence(final_values(scene, [levels])).removeprefix(f"{name}: ")
    extent, picture = _picture(run)
    return Hung(
        scene=name,
        digest=digest_of(name),
        verdict="; ".join([f"{len(judged) - len(failing)} of {len(judged)} claims hold", *failing]),
        comes_to=comes_to or f"{said['outcome']}: {said['message']}",
        seconds=round(seconds, 1),
        made_by=f"{said['method_name']}, refine {said['refine']}, {said['fidelity']}",
        picture=picture,
        extent=extent,
    )


def _picture(run: Run) -> tuple[str, str]:
    """The range of a in the last frame, and the frame."""
    x, values, rim = run.points[-1], on_triangles(run, -1), closed_rim(run.triangles)
    shown = window([x, run.xi])
    panel = Brush(run.triangles, run.xi[:, rim], shown).panel("", x, values, colours([values]))
    return panel.extent, panel.webp


def gallery(names: Sequence[str]) -> Study:
    """Ask for every scene."""
    rows = yield [Task(hung, name, files=(f"{name}.vtkhdf",)) for name in names]
    shown = ("scene", "verdict", "comes_to", "seconds", "made_by", "extent")
    return Report("The shipped scenes", "", {"scenes": Table("Scenes", rows, shown=shown)})


def hang(rows: Sequence[Hung], folder: Path = FOLDER) -> None:
    """Write pictures and `scenes.json`; scenes that are not among the rows stay as they are."""
    folder.mkdir(exist_ok=True)
    path = folder / "scenes.json"
    scenes = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for row in rows:
        said = asdict(row)
        replace_file(folder / f"{row.scene}.webp", b64decode(said.pop("picture")))
        scenes[said.pop("scene")] = said
    kept = {name: scenes[name] for name in shipped_scenes() if name in scenes}
    for left in {one.stem for one in folder.glob("*.webp")} - kept.keys():
        (folder / f"{left}.webp").unlink()
    replace_file(path, f"{json.dumps(kept, indent=1, ensure_ascii=False)}\n".encode())


if __name__ == "__main__":
    out = Path("reports") / "gallery"
    report, page = carry_out(
        "gallery", gallery(sys.argv[1:] or shipped_scenes()), out, False, None, None, quiet=False
    )
    hang(report.tables["scenes"].rows)
    print(f"{FOLDER}; report: {page}")
