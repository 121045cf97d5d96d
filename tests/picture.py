"""The README's picture from the report of a comparison: `python -m tests.picture reports/compare-<date>`."""

import sys
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page

from tests.browser import chromium, complaints

PICTURE = Path(__file__).parents[1] / "reports" / "example.png"
SCENE = "fig14-four-fronts"
WIDTH = 900

_LEAVE = """((scene) => {
  const section = [...document.querySelectorAll("section.scene")]
    .find(one => one.querySelector("h2").textContent === scene);
  for (const one of document.querySelectorAll("nav, main > section")) if (one !== section) one.remove();
  const film = section.querySelector(".film"), time = film.querySelector("input");
  for (const one of document.querySelectorAll("header .lead, .citation, main details")) one.remove();
  while (film.nextElementSibling) film.nextElementSibling.remove();
  time.value = time.max;
  time.dispatchEvent(new Event("input"));
  document.body.style.padding = "1.5rem 2rem";
  section.style.marginTop = "1.5rem";
})"""


def take(tab: Page, report: Path, picture: Path) -> None:
    """Write a PNG of the verdict and of the last film frame of Fig. 14 from the page in a folder."""
    tab.set_viewport_size({"width": WIDTH, "height": 900})
    tab.emulate_media(color_scheme="light")
    complaints(tab, (report / "index.html").resolve())
    tab.evaluate(f"{_LEAVE}({SCENE!r})")
    tab.wait_for_timeout(500)
    shot = tab.locator("body").screenshot()
    Image.open(BytesIO(shot)).convert("RGB").save(picture, optimize=True)


if __name__ == "__main__":
    with chromium() as browser:
        take(browser.new_page(), Path(sys.argv[1]), PICTURE)
