"""The page of a distortion report, from `distortion.h5` alone."""

from collections import Counter
from pathlib import Path

from actin_xcheck.report.draw import draw
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.studies.distort.record import FILE_NAME, read_distortion


def write_distortion_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/distortion.h5` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    stored = read_distortion(folder / FILE_NAME)
    chapters = [
        (
            chapter,
            [
                draw(one, f"/exhibits/{chapter.key}/{one.key}", f"c{i}-{j}")
                for j, one in enumerate(chapter.exhibits)
            ],
        )
        for i, chapter in enumerate(stored.chapters)
    ]
    told = {name: value for name, value in stored.attributes.items() if name not in ("sentences", "truths")}
    html = environment(folder).get_template("distortion.html")
    text = html.render(
        attributes=told,
        sentences=list(stored.attributes["sentences"]),
        truths=list(stored.attributes["truths"]),
        chapters=chapters,
        rows=stored.rows,
        endings=Counter(row.ending.replace("_", " ") for row in stored.rows),
        residual=max((row.residual for row in stored.rows if row.completed), default=float("nan")),
        file=stored.path,
    )
    return put_page(folder, text)
