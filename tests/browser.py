"""Chromium, driven by playwright: what it complains of on a page from file://, and what nobody can read."""

import shutil
import subprocess
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
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


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
SEEN = {
    "as they are": np.eye(3),
    "without red": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "without green": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "without blue": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
"""Linear light as it is seen with and without each kind of cone: Machado, Oliveira and Fernandes (2009)."""


def linear(colour: str) -> np.ndarray:
    """Linear sRGB (3,) of a colour as #rrggbb."""
    part = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)


def lab(light: np.ndarray) -> np.ndarray:
    """CIELAB (3,) of linear sRGB; white is D65."""
    xyz = np.array([[0.4124564, 0.3575761, 0.1804375], LUMINANCE, [0.0193339, 0.1191920, 0.9503041]])
    part = xyz @ np.clip(light, 0, 1) / xyz.sum(axis=1)
    f = np.where(part > (6 / 29) ** 3, np.cbrt(part), part / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


_MEASURE = r"""(() => {
  const faults = [], width = document.documentElement.clientWidth;
  const beyond = (box, frame) => box.left < frame.left - 1 || box.right > frame.right + 1
    || box.top < frame.top - 1 || box.bottom > frame.bottom + 1;
  const short = text => text.trim().replace(/\s+/g, " ").slice(0, 60);
  if (document.documentElement.scrollWidth > width)
    faults.push(`the page is ${document.documentElement.scrollWidth} wide in a window of ${width}`);

  const rotated = one => /rotate\((?!0[, )])/.test(one.getAttribute("transform"));
  for (const chart of document.querySelectorAll(".js-plotly-plot")) {
    const name = chart.ariaLabel, frame = chart.getBoundingClientRect();
    if (!frame.width) continue;
    const texts = [...chart.querySelectorAll("text")].map(one => ({ said: short(one.textContent), one,
      box: one.getBoundingClientRect() })).filter(({ said, box }) => said && box.width);
    for (const { said, box } of texts)
      if (beyond(box, frame)) faults.push(`clipped: "${said}" in ${name}`);
    texts.forEach((a, i) => texts.slice(i + 1).forEach(b => {
      const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
      const down = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
      const slanted = rotated(a.one) && rotated(b.one); // boxes of labels that lean meet, the labels do not
      if (across > .5 && down > .25 * Math.min(a.box.height, b.box.height) && !slanted)
        faults.push(`one over another: "${a.said}" and "${b.said}" in ${name}`);
    }));
    const axes = chart.querySelector(".nsewdrag").getBoundingClientRect();
    for (const axis of ["x", "y"]) {
      const scale = chart._fullLayout[`${axis}axis`];
      const shown = one => one.getBoundingClientRect().width;
      const ticks = [...chart.querySelectorAll(`.${axis}tick text`)].filter(shown);
      if (scale.type === "category") continue;
      const said = ticks.map(one => short(one.textContent)), where = `, ${said}, on ${axis} of ${name}`;
      if (new Set(said).size < 3) faults.push(`fewer than three labels${where}`);
      if (new Set(said).size < said.length) faults.push(`equal labels${where}`);
      ticks.forEach((one, i) => {
        const [top, bottom = 1] = said[i].replaceAll("−", "-").split("/").map(Number), number = top / bottom;
        const box = one.getBoundingClientRect(), middle = rotated(one) ? null
          : axis === "x" ? box.left + box.width / 2 - axes.left : box.top + box.height / 2 - axes.top;
        if (Number.isNaN(number)) faults.push(`no number: "${said[i]}"${where}`);
        else if (middle !== null && Math.abs(scale.c2p(number) - middle) > 4)
          faults.push(`"${said[i]}" stands where another number belongs${where}`);
      });
    }
  }

  // Text of the page itself, line by line: within what cuts it off, and none over another.
  const lines = [], range = document.createRange();
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const parent = node.parentElement;
    const shown = parent.checkVisibility({ opacityProperty: true });
    if (!node.data.trim() || parent.closest("svg, script, style, option") || !shown) continue;
    let cuts = [], hidden = false, scroller = null;
    for (let place = parent; place !== document.body; place = place.parentElement) {
      const style = getComputedStyle(place);
      hidden ||= style.clipPath !== "none" || place.matches(".skip, .modebar");
      if (/auto|scroll/.test(style.overflowX)) { scroller = place.getBoundingClientRect(); break; }
      if (/hidden|clip/.test(style.overflowX)) cuts.push(place.getBoundingClientRect());
    }
    if (hidden) continue;
    range.selectNodeContents(node);
    for (const { left, top, right, bottom } of range.getClientRects()) {
      const box = { left: Math.max(left, scroller?.left ?? left), top, bottom, height: bottom - top,
        right: Math.min(right, scroller?.right ?? right) };
      if (box.right - box.left < 1) continue;
      if (cuts.some(cut => beyond(box, cut))) faults.push(`clipped: "${short(node.data)}"`);
      if (box.left < -1 || box.right > width + 1) faults.push(`outside: "${short(node.data)}"`);
      lines.push({ said: short(node.data), box, node });
    }
  }
  lines.sort((a, b) => a.box.top - b.box.top);
  lines.forEach((a, i) => {
    for (let j = i + 1; j < lines.length && lines[j].box.top < a.box.bottom; j++) {
      const b = lines[j], across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
      const down = Math.min(a.box.bottom, b.box.bottom) - b.box.top;
      if (a.node !== b.node && across > 2 && down > .5 * Math.min(a.box.height, b.box.height))
        faults.push(`one over another: "${a.said}" and "${b.said}"`);
    }
  });
  for (const row of document.querySelectorAll("tr")) {
    const cells = [...row.cells].map(cell => {
      range.selectNodeContents(cell);
      return { said: short(cell.textContent), box: range.getBoundingClientRect() };
    }).filter(({ said, box }) => said && box.width);
    cells.slice(1).forEach((b, i) => {
      const a = cells[i], beside = Math.min(a.box.bottom, b.box.bottom) > Math.max(a.box.top, b.box.top);
      if (beside && b.box.left - a.box.right < 4) faults.push(`run together: "${a.said}" and "${b.said}"`);
    });
  }
  return faults;
})()"""

_CONTRAST = """(() => {
  const rgba = text => {
    const n = text.match(/[\\d.]+/g).map(Number);
    return [n[0], n[1], n[2], n[3] ?? 1];
  };
  const light = c => c.slice(0, 3).map(v => v / 255)
    .map(v => v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [.2126, .7152, .0722][i], 0);
  const paper = place => {
    for (; place; place = place.parentElement) {
      const c = rgba(getComputedStyle(place).backgroundColor);
      if (c[3] > 0) return c;
    }
    return [255, 255, 255, 1];
  };
  let least = 99, where = "";
  const texts = "p, a, td, th, summary, code, .badge, label, input, select, output, li, h1, h2"
    + ", .chart text:not(.regions .annotation *)";
  for (const place of document.querySelectorAll(texts)) {
    if (!place.checkVisibility({ opacityProperty: true }) || !place.textContent.trim()) continue;
    const style = getComputedStyle(place), ink = place.matches("text") ? style.fill : style.color;
    const a = light(rgba(ink)), b = light(paper(place));
    const ratio = (Math.max(a, b) + .05) / (Math.min(a, b) + .05);
    if (ratio < least) { least = ratio; where = place.outerHTML.slice(0, 80); }
  }
  return least.toFixed(2) + " " + where;
})()"""

_LEAST_CONTRAST = 4.5
"""WCAG AA."""


AXE = "axe-core@4.11.1"

_VIOLATIONS = """async () => (await axe.run(document, { resultTypes: ["violations"] })).violations
  .flatMap(({ id, nodes }) => nodes.map(one => `${id}: ${one.html.slice(0, 120)} ${one.failureSummary}`))"""


def fetch_axe(folder: Path) -> str:
    """The text of axe-core, the checks of accessibility; OSError or CalledProcessError where npm has none."""
    subprocess.run(["npm", "pack", AXE, "--silent"], cwd=folder, check=True, capture_output=True, timeout=120)
    with tarfile.open(next(folder.glob("axe-core-*.tgz"))) as packed:
        file = packed.extractfile("package/axe.min.js")
        assert file is not None
        return file.read().decode()


def violations(tab: Page, axe: str) -> list[str]:
    """What of the page that is open shuts somebody out; a sentence each."""
    if not tab.evaluate("'axe' in window"):
        tab.evaluate(axe)
    found: list[str] = tab.evaluate(_VIOLATIONS)
    return found


def unreadable(tab: Page) -> list[str]:
    """Return what cannot be read on the page that is open, everything that opens opened; a sentence each."""
    tab.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
    drawn(tab)
    return [*tab.evaluate(_MEASURE), *pale(tab)]


def pale(tab: Page) -> list[str]:
    """The text that is least of all told from its ground, where that is too little."""
    contrast, _, where = tab.evaluate(_CONTRAST).partition(" ")
    return [f"contrast {contrast}: {where}"] if float(contrast) < _LEAST_CONTRAST else []
