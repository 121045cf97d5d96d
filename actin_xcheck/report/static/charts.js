// Draws the figures of report/figure.py with plotly.js: those that come into sight, and before it is printed all.
// Zoom, reset and saving are plotly's; here are steps between labels, keys, wheel and what is read out.
// Colours that follow the reader's theme are set by style.css.
"use strict";
{
  const INK = "#0d0e0f", GRID = "#d0d1d2", DIGITS = ".9~g", PAPER = 340, MOST = 8, MOST_ON_LOG = 5;
  const touched = matchMedia("(pointer: coarse)").matches;
  const plain = html => new DOMParser().parseFromString(html, "text/html").body.textContent;
  const each = (gd, update) => Object.fromEntries(["xaxis", "yaxis"].filter(name => gd.layout[name].type !== "category")
    .map((name, i) => [`${name}.range`, update(gd.layout[name].range, i)]));

  // What is drawn, a row a point; of planes their classes.
  const numbers = gd => {
    const [x, y] = ["xaxis", "yaxis"].map(name => plain(gd.layout[name].title?.text ?? ""));
    const points = gd.data.filter(trace => trace.hoverinfo !== "skip" || trace.name).flatMap(trace => trace.z
      ? trace.z.flatMap((row, j) => row.map((code, i) => [trace.names?.[code] ?? code, trace.x[i], trace.y[j]]))
      : trace.x.map((at, i) => [trace.name, at, trace.y[i], trace.error_x?.array?.[i], trace.error_y?.array?.[i], trace.text?.[i]]));
    return [["what", x || "x", y || "y", "± x", "± y", "said"], ...points.map(row => row.map(value => plain(String(value ?? "")).replaceAll("<br>", ", ")))];
  };

  const AXIS = { automargin: true, ticks: "outside", ticklen: 4, tickcolor: "rgba(0,0,0,0)", gridcolor: GRID, zeroline: false, exponentformat: "e", hoverformat: DIGITS, tick0: 0 };
  const LAYOUT = {
    autosize: true, minreducedheight: 30, separators: ".", dragmode: touched ? false : "zoom", paper_bgcolor: "#fff", plot_bgcolor: "rgba(0,0,0,0)",
    font: { size: 11, color: INK, family: getComputedStyle(document.body).fontFamily },
    hoverlabel: { align: "left", namelength: -1 }, modebar: { bgcolor: "rgba(0,0,0,0)", color: INK },
  };
  const TABLE = { width: 24, height: 24, path: "M3 4h18v4H3zM3 10h8v4H3zM13 10h8v4h-8zM3 16h8v4H3zM13 16h8v4h-8z" };
  const CONFIG = {
    responsive: true, displaylogo: false, doubleClick: "reset", toImageButtonOptions: { scale: 3 },
    modeBarButtons: [["toImage", { name: "Download plot as an svg", icon: null, click: gd => Plotly.downloadImage(gd, { format: "svg" }) },
      { name: "Download its numbers as CSV", icon: TABLE, click: gd => save(gd.closest("figure").querySelector("h3").textContent, numbers(gd)) }],
      ["zoomIn2d", "zoomOut2d", "resetScale2d"]],
  };

  // Between labels, so that there are three at least: plotly's own (up to MOST of them, three at least) but across
  // decades.  A step in values would be kept for a while when all is shown again, which takes thousands of labels.
  const step = ({ type, range: [one, other] }) => {
    const span = Math.abs(other - one);
    return type !== "log" || !(span >= 1) ? null : span >= 3 ? Math.floor(span / 3) : "D2";
  };
  // Whole numbers between decades too, where plotly would write the digit alone.
  const format = ({ type, range }) => {
    const [low, high] = [Math.min(...range), Math.max(...range)];
    return type !== "log" || high - low >= 3 ? "" : low < -3 || high > 5 ? ".12~e" : ".12~g";
  };
  const label = gd => {
    const update = {};
    for (const name of ["xaxis", "yaxis"]) {
      const axis = gd.layout[name], dtick = step(axis), tickformat = format(axis);
      if (axis.tickvals || axis.type === "category" || ((axis.dtick ?? null) === dtick && axis.tickformat === tickformat)) continue;
      Object.assign(update, { [`${name}.dtick`]: dtick, [`${name}.tickformat`]: tickformat, [`${name}.tickmode`]: dtick ? "linear" : "auto" });
    }
    const drag = Object.entries(each(gd, range => range)).some(([name, range]) => String(range) !== String(gd.home[name]));
    if (touched && gd.layout.dragmode !== (drag && "pan")) update.dragmode = drag && "pan";
    if (Object.keys(update).length) Plotly.relayout(gd, update);
  };

  // Entries of a legend stand below the axes, in columns as wide as the longest.
  const rows = (names, width) => {
    const lines = names.map(name => name.split("<br>").map(plain)), wide = 44 + 6.2 * Math.max(...lines.flat().map(line => line.length), 0);
    return Math.ceil(lines.flat().length / Math.max(Math.floor(width / wide), 1));
  };

  const draw = gd => {
    if (gd.layout || !gd.checkVisibility()) return;
    const { data, layout } = JSON.parse(gd.querySelector("script").textContent);
    for (const trace of data)
      if (trace.names) trace.text = trace.z.map(row => row.map(code => trace.names[code] ?? ""));
    const named = data.filter(trace => trace.showlegend !== false && trace.name && trace.type === "scatter").map(trace => trace.name);
    const legend = (layout.showlegend ?? named.length > 1) ? 6 + 19 * rows(named, gd.clientWidth) : 0;
    for (const name of ["xaxis", "yaxis"])
      layout[name] = { ...AXIS, nticks: layout[name]?.type === "log" ? MOST_ON_LOG : MOST, ...layout[name], title: { standoff: 8, ...layout[name].title } };
    gd.style.height = `${layout.height + legend}px`;
    Plotly.newPlot(gd, data, { ...LAYOUT, ...layout, showlegend: legend > 0, height: undefined,
      margin: { l: 8, r: 12, t: 8, b: 8 + legend, ...layout.margin },
      legend: { orientation: "h", x: 0, y: 0, xref: "container", yref: "container", yanchor: "bottom", ...layout.legend } }, CONFIG);
    gd.home = each(gd, range => [...range]);
    label(gd);
    gd.on("plotly_relayout", () => label(gd));
    enhance(gd);
  };

  const zoom = (gd, factor, at = [.5, .5]) => Plotly.relayout(gd, each(gd, ([low, high], i) => {
    const middle = low + at[i] * (high - low);
    return [low, high].map(end => middle + (end - middle) / factor);
  }));
  const pan = (gd, ...by) => Plotly.relayout(gd, each(gd, ([low, high], i) => [low, high].map(end => end + by[i] * (high - low))));
  const read = (gd, by) => {
    const points = gd.data.flatMap((trace, curveNumber) => trace.type !== "scatter" || trace.hoverinfo === "skip" ? []
      : trace.y.flatMap((y, pointNumber) => y === null ? [] : [{ curveNumber, pointNumber }]));
    if (!points.length) return;
    gd.reading = Math.min(Math.max((gd.reading ?? -by) + by, 0), points.length - 1);
    const point = points[gd.reading], trace = gd.data[point.curveNumber], i = point.pointNumber;
    gd.link = trace.customdata?.[i];
    Plotly.Fx.hover(gd, [point], trace.yaxis === "y2" ? ["xy2"] : ["xy"]);
    const [x, y] = ["xaxis", "yaxis"].map(name => gd.layout[name].title?.text || "");
    gd.told.textContent = plain(trace.text ? trace.text[i].replaceAll("<br>", ", ")
      : `${x || "x"} = ${trace.x[i]} · ${trace.name} ${y ? `${y} = ` : ""}${trace.y[i]}`);
  };

  const enhance = gd => {
    for (const svg of document.querySelectorAll(".main-svg, svg.icon, #js-plotly-tester")) svg.setAttribute("aria-hidden", true); // keys read charts
    gd.told = document.createElement("output");
    gd.append(gd.told);
    const keys = {
      "+": () => zoom(gd, 1.5), "=": () => zoom(gd, 1.5), "-": () => zoom(gd, 1 / 1.5), "0": () => Plotly.relayout(gd, gd.home),
      ArrowLeft: () => pan(gd, -.2, 0), ArrowRight: () => pan(gd, .2, 0), ArrowUp: () => pan(gd, 0, .2), ArrowDown: () => pan(gd, 0, -.2),
      ",": () => read(gd, -1), ".": () => read(gd, 1), Enter: () => open(gd.link),
    };
    const open = link => { if (link) location.href = link; };
    gd.on("plotly_click", ({ points: [point] }) => open(point.customdata));
    gd.classList.toggle("linked", gd.data.some(trace => trace.customdata));
    gd.addEventListener("keydown", event => {
      if (event.target !== gd || event.ctrlKey || event.altKey || event.metaKey || !keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
    gd.addEventListener("wheel", event => {
      if (!event.ctrlKey && !gd.contains(document.activeElement)) return;
      event.preventDefault();
      const { left, bottom, width, height } = gd.querySelector(".nsewdrag").getBoundingClientRect();
      zoom(gd, 2 ** (-event.deltaY / 240), [(event.clientX - left) / width, (bottom - event.clientY) / height]);
    }, { passive: false });
  };

  const start = async () => {
    const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), letter => letter.charCodeAt(0));
    const script = document.createElement("script");
    script.textContent = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
    document.head.append(script);
    CONFIG.modeBarButtons[0][1].icon = Plotly.Icons.disk;
    const all = [...document.querySelectorAll(".chart")];
    const sight = new IntersectionObserver(seen => seen.filter(one => one.isIntersecting).forEach(one => draw(one.target)), { rootMargin: "400px" });
    for (const gd of all) sight.observe(gd);
    const paper = matchMedia("print");
    paper.addEventListener("change", () => {
      all.forEach(draw);
      for (const gd of all.filter(gd => gd.layout))
        Plotly.relayout(gd, paper.matches ? { width: Math.min(gd.clientWidth, PAPER) } : { width: null, autosize: true });
    });
  };
  if (document.querySelector(".chart")) start();
}
