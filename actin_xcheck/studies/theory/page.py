"""The page of a theory report, from `predictions.h5` alone."""

from pathlib import Path

from actin_xcheck.report.draw import draw
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.studies.theory.predictions import FILE_NAME, read_predictions


def write_theory_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/predictions.h5` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    predictions = read_predictions(folder / FILE_NAME)
    chapters = [
        (
            chapter,
            [
                draw(exhibit, f"/exhibits/{chapter.key}/{exhibit.key}", f"c{i}-{j}")
                for j, exhibit in enumerate(chapter.exhibits)
            ],
        )
        for i, chapter in enumerate(predictions.chapters)
    ]
    html = environment(folder).get_template("theory.html")
    text = html.render(attributes=predictions.attributes, chapters=chapters, file=predictions.path)
    return put_page(folder, text)
