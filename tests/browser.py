"""Chromium as it is installed, driven by playwright: what it complains of on a page that opens from file://."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SCREEN = {"width": 1280, "height": 900}


@contextmanager
def chromium() -> Iterator[Browser]:
    with sync_playwright() as playwright, playwright.chromium.launch(executable_path=CHROMIUM) as browser:
        yield browser


def complaints(tab: Page, page: Path) -> list[str]:
    """Open a page and show all of it; what it printed, what broke down, what it asked the network for."""
    found: list[str] = []
    hear = {
        "console": lambda said: found.append(f"{said.type} {said.text}"),
        "pageerror": lambda error: found.append(f"exception {error}"),
        "request": lambda request: asked(request.url),
    }

    def asked(url: str) -> None:
        if url != page.as_uri() and not url.startswith("data:"):
            found.append(f"request {url}")

    for event, listener in hear.items():
        tab.on(event, listener)
    tab.goto(page.as_uri(), timeout=1e5)  # ms, on a machine that does other things too
    drawn(tab)
    for event, listener in hear.items():
        tab.remove_listener(event, listener)
    return found


_DRAW = """async () => {
  if (!document.getElementById("plotly")) return; // a page without scripts
  for (const chart of document.querySelectorAll(".chart")) {
    if (!chart.checkVisibility()) continue;
    chart.scrollIntoView({ block: "center" });
    for (const begun = Date.now(); !chart.told;) {
      if (Date.now() - begun > 6e4) throw Error(`not drawn: ${chart.ariaLabel}`);
      await new Promise(resolve => setTimeout(resolve, 10));
    }
  }
  scrollTo(0, 0);
}"""


def drawn(tab: Page) -> None:
    """Bring every chart that is shown into sight, and wait until it is drawn with its labels."""
    tab.evaluate(_DRAW)
