"""The README's picture from the report of a comparison: `python -m tests.picture reports/compare-<date>`."""

import sys
from base64 import b64decode
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from tests.chromium import Browser

PICTURE = Path(__file__).parents[1] / "reports" / "example.png"
SCENE = "fig14-four-fronts"
WIDTH = 960

_LEAVE = """((scene) => {
  const section = [...document.querySelectorAll("section.scene")]
    .find(one => one.querySelector("h2").textContent === scene);
  for (const one of document.querySelectorAll("nav, main > section")) if (one !== section) one.remove();
  const film = section.querySelector(".film"), time = film.querySelector("input");
  while (film.nextElementSibling) film.nextElementSibling.remove();
  time.value = time.max;
  time.dispatchEvent(new Event("input"));
  document.body.style.padding = "1.5rem 2rem";
  section.style.marginTop = "1.5rem";
})"""


def take(report: Path, picture: Path) -> None:
    """Write a PNG of the verdict and of the last film frame of Fig. 14 from the page in a folder."""
    with TemporaryDirectory() as profile, Browser(Path(profile)) as browser:
        screen = {"width": WIDTH, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        browser.ask("Emulation.setDeviceMetricsOverride", **screen)
        browser.ask(
            "Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "light"}]
        )
        browser.complaints((report / "index.html").resolve())
        browser.evaluate(f"{_LEAVE}({SCENE!r})")
        browser.evaluate("new Promise(resolve => setTimeout(resolve, 500))")
        height = browser.evaluate("document.body.getBoundingClientRect().height")
        clip = {"x": 0, "y": 0, "width": WIDTH, "height": height, "scale": 1}
        shot = browser.ask("Page.captureScreenshot", captureBeyondViewport=True, clip=clip)
    Image.open(BytesIO(b64decode(shot["data"]))).convert("RGB").save(picture, optimize=True)


if __name__ == "__main__":
    take(Path(sys.argv[1]), PICTURE)
