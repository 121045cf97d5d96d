"""What a reader cannot read on a page that a browser shows: clipped, one over another, or no scale at all."""

import json
from math import isfinite, log10
from typing import Any

from tests.chromium import Browser

_MEASURE = r"""(() => {
  const faults = [], axes = [], width = document.documentElement.clientWidth;
  const beyond = (box, frame) => box.left < frame.left - 1 || box.right > frame.right + 1
    || box.top < frame.top - 1 || box.bottom > frame.bottom + 1;
  const short = text => text.trim().replace(/\s+/g, " ").slice(0, 60);
  if (document.documentElement.scrollWidth > width)
    faults.push(`the page is ${document.documentElement.scrollWidth} wide in a window of ${width}`);

  const drawings = [...document.querySelectorAll("svg")].filter(svg => svg.getBoundingClientRect().width);
  for (const svg of drawings) {
    const name = svg.ariaLabel || svg.getAttribute("class"), frame = svg.getBoundingClientRect();
    const texts = [...svg.querySelectorAll("text")].map(one => ({ said: short(one.textContent), one,
      box: one.getBoundingClientRect() })).filter(({ said, box }) => said && box.width);
    for (const { said, box } of texts)
      if (beyond(box, frame)) faults.push(`clipped: "${said}" in ${name}`);
    texts.forEach((a, i) => texts.slice(i + 1).forEach(b => {
      const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
      const down = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
      if (across > .5 && down > .25 * Math.min(a.box.height, b.box.height))
        faults.push(`one over another: "${a.said}" and "${b.said}" in ${name}`);
    }));
    if (!svg.dataset.axes) continue;
    const said = JSON.parse(svg.dataset.axes), back = svg.getScreenCTM().inverse();
    const middle = one => {
      const box = one.getBoundingClientRect();
      return new DOMPoint(box.left + box.width / 2, box.top + box.height / 2).matrixTransform(back);
    };
    for (const [i, axis] of ["x", "y"].entries()) {
      const zoomed = svg.matches(".zoomed"), drawn = `g[id*="${axis}tick_"] text, .tick.${axis}`;
      const ends = zoomed ? svg.dataset.view.split(" ").slice(2 * i, 2 * i + 2) : said[axis].slice(1);
      const ticks = svg.querySelectorAll(zoomed ? `.ticks .${axis}` : drawn);
      const labels = [...ticks].map(one => [short(one.textContent), middle(one)[axis]]);
      const [left, top, right, bottom] = said.box, range = i ? [bottom, top] : [left, right];
      axes.push({ name: `${axis} of ${name}`, scale: [said[axis][0], ...ends.map(Number)], range, labels });
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
      hidden ||= style.clipPath !== "none" || place.matches(".skip, .reading");
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
  return JSON.stringify({ faults, axes });
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
    + ", svg text:not([data-zoom] *)";
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

_OFF = 4.0
"""How far a label may stand from where its number belongs, in units of a drawing of some 300."""


def unreadable(browser: Browser) -> list[str]:
    """Return what cannot be read on the page that is open, everything that opens opened; a sentence each."""
    browser.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
    found = json.loads(browser.evaluate(_MEASURE))
    contrast, _, where = browser.evaluate(_CONTRAST).partition(" ")
    pale = [f"contrast {contrast}: {where}"] if float(contrast) < _LEAST_CONTRAST else []
    return [*found["faults"], *pale, *(fault for axis in found["axes"] for fault in _of_axis(**axis))]


def _of_axis(name: str, scale: list[Any], range: list[float], labels: list[list[Any]]) -> list[str]:
    """What is wrong with the labels of one axis; those of names, which are no numbers, have no scale."""
    said = [label for label, _ in labels if label]
    numbers = [_number(label) for label in said]
    if said and all(number is None for number in numbers):
        return []
    faults = [
        f'no number: "{label}" on {name}'
        for label, number in zip(said, numbers, strict=True)
        if number is None
    ]
    if len(set(said)) < 3:
        faults.append(f"fewer than three labels, {said}, on {name}")
    if len(set(said)) < len(said):
        faults.append(f"equal labels, {said}, on {name}")
    for (label, place), number in zip([one for one in labels if one[0]], numbers, strict=True):
        if number is not None and abs(_place(scale, range, number) - place) > _OFF:
            faults.append(f'"{label}" stands where another number belongs on {name}')
    return faults


def _number(label: str) -> float | None:
    top, _, bottom = label.replace("−", "-").partition("/")
    try:
        return float(top) / float(bottom or 1)
    except ValueError:
        return None


def _place(scale: list[Any], range: list[float], number: float) -> float:
    """Where a number belongs on an axis, in the drawing's units."""
    kind, low, high = scale
    if kind == "log":
        number, low, high = (log10(one) if one > 0 else float("nan") for one in (number, low, high))
    place = range[0] + (number - low) / (high - low) * (range[1] - range[0])
    return place if isfinite(place) else float("inf")
