"""What a reader cannot read on a page that a browser shows: clipped, one over another, or no scale at all."""

from playwright.sync_api import Page

from tests.browser import drawn

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


def unreadable(tab: Page) -> list[str]:
    """Return what cannot be read on the page that is open, everything that opens opened; a sentence each."""
    tab.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
    drawn(tab)
    return [*tab.evaluate(_MEASURE), *pale(tab)]


def pale(tab: Page) -> list[str]:
    """The text that is least of all told from its ground, where that is too little."""
    contrast, _, where = tab.evaluate(_CONTRAST).partition(" ")
    return [f"contrast {contrast}: {where}"] if float(contrast) < _LEAST_CONTRAST else []
