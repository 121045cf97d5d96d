// Charts that are zoomed and read in place: the SVG says with data-axes, data-zoom and data-name what it shows
// (report/svg.py), and stays as it is for print and without scripts. Ticks and scales are d3-scale's.
"use strict";
{
  const DEEPEST = 500;
  const veil = (one, hidden) => hidden ? one.setAttribute("visibility", "hidden") : one.removeAttribute("visibility");
  const within = (value, low, high) => Math.min(Math.max(value, low), high);
  const at = (text, coordinate) => text + " = " + coordinate;

  // Commands and numbers of a path's d, which an empty line has none of; matplotlib writes absolute ones alone.
  const parse = d => [...(d ?? "").matchAll(/([MLHVQCZz])([^MLHVQCZz]*)/g)]
    .map(([, letter, rest]) => [letter, (rest.match(/-?[\d.]+(?:e[-+]?\d+)?/g) || []).map(Number)]);
  const upright = (letter, i) => letter === "V" || (letter !== "H" && i % 2 === 1);
  const pairs = text => parse("M" + text);

  const written = ["d", "points", "x", "y", "cx", "cy", "width", "height", "transform"];

  // What has to be written anew, each as a function of the maps x and y of the drawing's coordinates.
  const movers = {
    path(one) {
      const d = parse(one.getAttribute("d"));
      return (x, y) => one.setAttribute("d", d.map(([letter, numbers]) =>
        letter + numbers.map((n, i) => (upright(letter, i) ? y : x)(n).toFixed(3)).join(" ")).join(""));
    },
    polyline(one) {
      const [[, numbers]] = pairs(one.getAttribute("points"));
      return (x, y) => one.setAttribute("points", numbers.map((n, i) => (i % 2 ? y : x)(n).toFixed(3)).join(" "));
    },
    rect(one) {
      const [left, top, width, height] = ["x", "y", "width", "height"].map(name => Number(one.getAttribute(name)));
      return (x, y) => {
        one.setAttribute("x", x(left));
        one.setAttribute("y", y(top));
        one.setAttribute("width", x(left + width) - x(left));
        one.setAttribute("height", y(top + height) - y(top));
      };
    },
    image(one) {
      const before = one.getAttribute("transform") || "";
      return (x, y) => one.setAttribute("transform",
        `matrix(${x(1) - x(0)} 0 0 ${y(1) - y(0)} ${x(0)} ${y(0)}) ${before}`);
    },
    use: one => point(one, "x", "y"),
    circle: one => point(one, "cx", "cy"),
    text(one) {
      const box = one.getBBox(), before = one.getAttribute("transform") || "";
      const [px, py] = one.hasAttribute("x") ? [Number(one.getAttribute("x")), Number(one.getAttribute("y"))]
        : [box.x, box.y + box.height];
      return (x, y, inside) => {
        one.setAttribute("transform", `translate(${x(px) - px} ${y(py) - py}) ${before}`);
        veil(one, !inside(x(px), y(py)));
      };
    },
  };
  const point = (one, nameX, nameY) => {
    const [px, py] = [Number(one.getAttribute(nameX)), Number(one.getAttribute(nameY))];
    return (x, y, inside) => {
      one.setAttribute(nameX, x(px));
      one.setAttribute(nameY, y(py));
      veil(one, !inside(x(px), y(py)));
    };
  };

  const svgElement = (name, attributes, parent) => {
    const one = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
    parent.append(one);
    return one;
  };
  const plain = value => {
    const short = Number(value.toPrecision(15)), size = Math.abs(short);
    return size && (size < 1e-3 || size >= 1e5) ? short.toExponential().replace("e+", "e") : String(short);
  };
  const labels = (values, log) => {
    const largest = Math.max(...values.map(Math.abs)), digits = Math.ceil(-Math.log10(values[1] - values[0]) - 1e-6);
    const even = !log && largest >= 1e-3 && largest < 1e5;
    return values.map(value => (even ? value.toFixed(within(digits, 0, 15)) : plain(value)).replaceAll("-", "−"));
  };

  class Chart {
    constructor(svg, tell) {
      const said = JSON.parse(svg.dataset.axes);
      this.svg = svg;
      this.tell = tell;
      this.box = said.box;
      this.names = [said.names[0] || "x", said.names[1] || ""];
      const [left, top, right, bottom] = said.box;
      const scale = ([kind, ...ends], range) => (kind === "log" ? d3.scaleLog : d3.scaleLinear)(ends, range);
      this.home = [scale(said.x, [left, right]), scale(said.y, [bottom, top])];
      this.logs = [said.x[0] === "log", said.y[0] === "log"];
      this.moved = [...svg.querySelectorAll("[data-zoom]")].flatMap(group => this.movedBy(group));
      this.series = this.seriesOf(svg);
      this.old = [...svg.querySelectorAll('g[id*="xtick_"], g[id*="ytick_"], .tick')];
      const first = svg.querySelector("[data-zoom]");
      this.ticks = document.createElementNS(svg.namespaceURI, "g");
      this.ticks.setAttribute("class", "ticks");
      const base = first.closest("g[clip-path]") || first;
      base.before(this.ticks);
      this.over = svgElement("g", { "pointer-events": "none" }, svg);
      this.view = [...said.box];
    }

    movedBy(group) {
      const found = [...group.querySelectorAll(Object.keys(movers).join()), ...(group.matches("path, polyline") ? [group] : [])];
      return found.filter(one => !one.closest("defs")).map(one => {
        const names = written.filter(name => one.hasAttribute(name));
        const before = names.map(name => [name, one.getAttribute(name)]);
        return { along: group.dataset.zoom, move: movers[one.tagName](one), restore: () => {
          for (const name of written.filter(name => !names.includes(name))) one.removeAttribute(name);
          for (const [name, value] of before) one.setAttribute(name, value);
          veil(one, false);
        } };
      });
    }

    // What can be read: lines by name, points by their title or name, in the drawing's first coordinates.
    seriesOf(svg) {
      const found = [];
      for (const group of svg.querySelectorAll("[data-name], [data-zoom]")) {
        const name = group.dataset.name || "", line = group.matches("path, polyline") ? group
          : group.querySelector(":scope > path, :scope > polyline");
        if (name && line) {
          const points = parse(line.tagName === "path" ? line.getAttribute("d") : "M" + line.getAttribute("points"))
            .flatMap(([letter, numbers]) => numbers.reduce((all, n, i) => (i % 2 ? all.at(-1).push(n)
              : all.push(Object.assign([n], { begins: letter === "M" && !i })), all), []));
          found.push({ name, points, rising: points.every((p, i) => !i || p[0] >= points[i - 1][0]) });
          continue;
        }
        for (const one of group.querySelectorAll("use, circle")) {
          const title = (one.querySelector("title") || one.closest("g").parentElement.querySelector(":scope > title")
            || group.querySelector(":scope > title"))?.textContent.replaceAll("\n", ", ");
          if (!title && !name) continue;
          const [x, y] = one.tagName === "use" ? ["x", "y"] : ["cx", "cy"];
          found.push({ name, title, points: [[Number(one.getAttribute(x)), Number(one.getAttribute(y))]], rising: false });
        }
      }
      return found;
    }

    get zoomed() { return this.view.some((edge, i) => Math.abs(edge - this.box[i]) > 1e-6); }

    // Maps from the drawing's first coordinates to those of the view.
    maps() {
      const [left, top, right, bottom] = this.box, [l, t, r, b] = this.view;
      return [x => left + (x - l) * (right - left) / (r - l), y => top + (y - t) * (bottom - top) / (b - t)];
    }

    back(px, py) {
      const [left, top, right, bottom] = this.box, [l, t, r, b] = this.view;
      return [l + (px - left) * (r - l) / (right - left), t + (py - top) * (b - t) / (bottom - top)];
    }

    ends() {
      const [l, t, r, b] = this.view, [x, y] = this.home;
      return [[x.invert(l), x.invert(r)], [y.invert(b), y.invert(t)]];
    }

    show(view) {
      const [left, top, right, bottom] = this.box;
      const side = (from, to, low, high) => {
        const width = within(to - from, (high - low) / DEEPEST, high - low);
        const start = within((from + to - width) / 2, low, high - width);
        return [start, start + width];
      };
      const [l, r] = side(view[0], view[2], left, right), [t, b] = side(view[1], view[3], top, bottom);
      this.view = [l, t, r, b];
      this.over.replaceChildren();
      const ends = this.ends();
      this.svg.dataset.view = ends.flat().join(" ");
      this.svg.classList.toggle("zoomed", this.zoomed);
      for (const one of this.old) one.style.display = this.zoomed ? "none" : "";
      this.ticks.replaceChildren();
      if (!this.zoomed) {
        for (const one of this.moved) one.restore();
        return this.tell("", this.zoomed);
      }
      const [x, y] = this.maps(), same = n => n;
      const inside = (px, py) => px > left - 1 && px < right + 1 && py > top - 1 && py < bottom + 1;
      for (const { along, move } of this.moved)
        move(along.includes("x") ? x : same, along.includes("y") ? y : same, inside);
      this.drawTicks(ends);
      const named = this.names.map((name, i) => `${name ? name + " " : ""}${this.number(ends[i][0], i)} to ${this.number(ends[i][1], i)}`);
      return this.tell(named.join(", "), this.zoomed);
    }

    // Whole numbers, as report/ticks.py writes them: where they are long, fewer have room below, and stand within.
    drawTicks(ends) {
      const [left, top, right, bottom] = this.box, letter = 5.8;
      ends.forEach((domain, up) => {
        const range = up ? [bottom, top] : [left, right], scale = this.home[up].copy().domain(domain).range(range);
        const edge = this.svg.viewBox.baseVal[up ? "height" : "width"];
        const counted = count => {
          const even = d3.scaleLinear(domain, range).ticks(count);
          const decades = this.logs[up] ? scale.ticks(count).filter(scale.tickFormat(count, plain)) : [];
          const values = decades.length < 3 ? even : decades, said = labels(values, this.logs[up] && values === decades);
          const half = said.map(one => up ? 6 : one.length * letter / 2);
          return values.map((value, i) => ({ place: scale(value), said: said[i], half: half[i] }))
            .filter(({ place, half }) => place > half && place < edge - half);
        };
        const apart = all => all.length > 2 && all.every((one, i) => !i
          || Math.abs(one.place - all[i - 1].place) > one.half + all[i - 1].half + (up ? 0 : letter));
        const shown = [5, 4, 3, 2, 6, 8].map(counted).find(apart) ?? counted(2);
        const inside = up && Math.max(...shown.map(one => one.said.length)) * letter > left - 5;
        for (const { place, said } of shown) {
          svgElement("line", up ? { x1: left, x2: right, y1: place, y2: place }
            : { x1: place, x2: place, y1: top, y2: bottom }, this.ticks);
          svgElement("text", up ? { class: "y", x: inside ? left + 3 : left - 5, y: place + 3, "text-anchor": inside ? "start" : "end" }
            : { class: "x", x: place, y: bottom + 12, "text-anchor": "middle" }, this.ticks).textContent = said;
        }
      });
    }

    number(value, axis) {
      const [low, high] = this.ends()[axis], span = Math.abs(high - low);
      if (this.logs[axis] || !span) return plain(Number(value.toPrecision(4)));
      const unit = 10 ** (Math.floor(Math.log10(span)) - 4); // finer than can be seen, coarser than the drawing
      return plain(Number((Math.round(value / unit) * unit).toPrecision(12)));
    }

    zoom(factor, px = (this.box[0] + this.box[2]) / 2, py = (this.box[1] + this.box[3]) / 2) {
      const [cx, cy] = this.back(px, py), [l, t, r, b] = this.view;
      this.show([cx + (l - cx) / factor, cy + (t - cy) / factor, cx + (r - cx) / factor, cy + (b - cy) / factor]);
    }

    // By parts of what is shown, to the right and downwards.
    pan(dx, dy) {
      const [l, t, r, b] = this.view, sx = dx * (r - l), sy = dy * (b - t);
      this.show([l + sx, t + sy, r + sx, b + sy]);
    }

    seen([x, y]) {
      const [l, t, r, b] = this.view;
      return x >= l - .1 && x <= r + .1 && y >= t - .1 && y <= b + .1;
    }

    nearest(px, py) {
      const [x, y] = this.maps(), curves = this.series.every(one => one.rising);
      let best = Infinity, found = null;
      for (const one of this.series) {
        for (const [i, place] of one.points.entries()) {
          if (!this.seen(place)) continue;
          const far = Math.hypot(x(place[0]) - px, (y(place[1]) - py) * (curves ? .15 : 1));
          if (far < best) [best, found] = [far, { one, i }];
        }
      }
      return found && (curves || best < 30) ? found : null;
    }

    read({ one, i }) {
      const place = one.points[i], [x, y] = this.maps(), [valueX, valueY] = [0, 1].map(axis => this.home[axis].invert(place[axis]));
      this.last = { one, i };
      const marks = [place], words = [];
      if (one.title) words.push(one.title);
      else {
        words.push(at(this.names[0], this.number(valueX, 0)));
        for (const other of this.series) {
          const same = other === one ? place : one.rising && other.rising ? between(other.points, place[0]) : null;
          if (!same) continue;
          words.push(`${other.name} ${this.number(other === one ? valueY : this.home[1].invert(same[1]), 1)}`);
          if (other !== one) marks.push(same);
        }
      }
      this.over.replaceChildren();
      for (const mark of marks.filter(mark => this.seen(mark)))
        svgElement("circle", { cx: x(mark[0]), cy: y(mark[1]), r: 4, class: "mark" }, this.over);
      this.tell(words.join(" · "), this.zoomed);
    }

    // The next point to be read, of all in their order.
    step(by) {
      const all = this.series.flatMap(one => one.points.map((place, i) => ({ one, i })))
        .filter(({ one, i }) => this.seen(one.points[i]));
      if (!all.length) return;
      const now = all.findIndex(({ one, i }) => this.last && one === this.last.one && i === this.last.i);
      this.read(all[now < 0 ? 0 : within(now + by, 0, all.length - 1)]);
    }
  }

  // A line's place at an abscissa, straight between its vertices.
  const between = (points, x) => {
    const after = points.findIndex(point => point[0] >= x - 1e-6);
    if (after < 0) return null;
    const [x1, y1] = points[after], [x0, y0] = points[Math.max(after - 1, 0)];
    if (points[after].begins && x < x1 - .5) return null; // a gap
    return [x, x1 > x0 ? y0 + (y1 - y0) * within((x - x0) / (x1 - x0), 0, 1) : y1];
  };

  const enhance = svg => {
    const frame = document.createElement("div"), told = document.createElement("output"), bar = document.createElement("div");
    const what = svg.getAttribute("aria-label");
    frame.className = "zoomable";
    frame.tabIndex = 0;
    frame.setAttribute("role", "group");
    frame.setAttribute("aria-label", `${what}. Plus and minus zoom, arrows move, 0 shows all, comma and full stop read points.`);
    svg.replaceWith(frame);
    bar.className = "zoombar";
    told.className = "reading";
    frame.append(svg, bar, told);
    const make = (sign, name, action) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = sign;
      button.title = name;
      button.setAttribute("aria-label", `${name}: ${what}`);
      button.addEventListener("click", action);
      bar.append(button);
      return button;
    };
    let chart = null;
    const tell = (text, zoomed) => {
      told.textContent = text;
      out.disabled = all.disabled = !zoomed;
    };
    const live = () => chart ??= new Chart(svg, tell);
    make("+", "Zoom in", () => live().zoom(2));
    const out = make("−", "Zoom out", () => live().zoom(.5));
    const all = make("⤢", "Show all", () => live().show([...live().box]));
    out.disabled = all.disabled = true;
    const place = event => {
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      return [x, y];
    };
    let drag = null;
    svg.addEventListener("pointerdown", event => {
      const [x, y] = place(event), [left, top, right, bottom] = live().box;
      if (event.button || x < left || x > right || y < top || y > bottom) return;
      const pans = event.shiftKey || event.pointerType === "touch";
      if (pans && !chart.zoomed) return;
      drag = { from: [x, y], view: [...chart.view], pans };
      svg.setPointerCapture(event.pointerId);
    });
    svg.addEventListener("pointermove", event => {
      const [x, y] = place(event), { box } = live();
      if (!drag) {
        const found = chart.nearest(x, y);
        told.setAttribute("aria-live", "off");
        if (found) chart.read(found);
        return;
      }
      if (drag.pans) {
        chart.view = [...drag.view];
        chart.pan((drag.from[0] - x) / (box[2] - box[0]), (drag.from[1] - y) / (box[3] - box[1]));
        return;
      }
      drag.to = [within(x, box[0], box[2]), within(y, box[1], box[3])];
      chart.over.replaceChildren();
      svgElement("rect", { class: "pick", x: Math.min(drag.from[0], drag.to[0]), y: Math.min(drag.from[1], drag.to[1]),
        width: Math.abs(drag.to[0] - drag.from[0]), height: Math.abs(drag.to[1] - drag.from[1]) }, chart.over);
    });
    svg.addEventListener("pointerup", () => {
      const done = drag;
      drag = null;
      if (!done || done.pans || !done.to) return;
      const [x0, x1] = [done.from[0], done.to[0]].sort((a, b) => a - b), [y0, y1] = [done.from[1], done.to[1]].sort((a, b) => a - b);
      chart.over.replaceChildren();
      if (x1 - x0 > 4 && y1 - y0 > 4) chart.show([...chart.back(x0, y0), ...chart.back(x1, y1)]);
    });
    svg.addEventListener("pointercancel", () => { drag = null; });
    const quiet = () => {
      chart?.over.replaceChildren();
      told.textContent = "";
    };
    svg.addEventListener("pointerleave", () => { if (!drag) quiet(); });
    frame.addEventListener("focusout", quiet);
    svg.addEventListener("dblclick", () => live().show([...live().box]));
    svg.addEventListener("wheel", event => {
      if (!event.ctrlKey && !frame.contains(document.activeElement)) return;
      event.preventDefault();
      live().zoom(2 ** (-event.deltaY / 240), ...place(event));
    }, { passive: false });
    frame.addEventListener("keydown", event => {
      if (event.target !== frame || event.ctrlKey || event.altKey || event.metaKey) return;
      const keys = {
        "+": () => live().zoom(1.5), "=": () => live().zoom(1.5), "-": () => live().zoom(1 / 1.5), "0": () => live().show([...live().box]),
        ArrowLeft: () => live().pan(-.2, 0), ArrowRight: () => live().pan(.2, 0),
        ArrowUp: () => live().pan(0, -.2), ArrowDown: () => live().pan(0, .2),
        ",": () => live().step(-1), ".": () => live().step(1),
      };
      const moves = event.key.startsWith("Arrow");
      if (!keys[event.key] || (moves && !live().zoomed)) return;
      event.preventDefault();
      told.setAttribute("aria-live", "polite");
      keys[event.key]();
    });
  };
  for (const svg of document.querySelectorAll("svg[data-axes]")) enhance(svg);
}
