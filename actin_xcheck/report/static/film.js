// The film of a scene: two runs and their difference on canvases, from what report/film.py packed.
"use strict";
{
  const STEPS = 4094, INTERVAL = 900, WHOLE = 8000, LEVELS = 256, OUTLINE = "#8a8f98";
  const calm = matchMedia("(prefers-reduced-motion: reduce)");
  const short = value => String(Number(value.toPrecision(4))).replaceAll("-", "−");
  const close = (low, high) => high - low < 1e-2 * Math.abs(high) ? 9 : 4;
  const range = (low, high) => (low === high ? [low] : [low, high]).map(v => String(Number(v.toPrecision(close(low, high)))).replaceAll("-", "−")).join(" … ");
  const mix = (one, other, part) => one.map((value, i) => value + (other[i] - value) * part);

  const palette = stops => Array.from({ length: LEVELS }, (_, level) => {
    const place = level / (LEVELS - 1) * (stops.length - 1), i = Math.min(Math.floor(place), stops.length - 2);
    const rgb = [1, 3, 5].map(at => {
      const [one, other] = [stops[i], stops[i + 1]].map(stop => parseInt(stop.slice(at, at + 2), 16));
      return Math.round(one + (other - one) * (place - i));
    });
    return `rgb(${rgb})`;
  });

  class Film {
    constructor(data) {
      Object.assign(this, { times: data.times, window: data.window, scale: data.scale, runs: data.runs, arrays: data.arrays });
      this.palettes = data.colours.map(palette);
      this.gradients = data.colours.map(stops => `linear-gradient(to right, ${stops.join(", ")})`);
      this.known = new Map();
    }

    once(key, make) {
      if (!this.known.has(key)) this.known.set(key, make());
      return this.known.get(key);
    }

    integers(at, wide = false) {
      return wide ? new Uint32Array(this.arrays[at].slice().buffer) : this.arrays[at];
    }

    values({ at, low, high }) {
      return this.once(`a${at} ${low} ${high}`, () => Float64Array.from(this.integers(at),
        n => n > STEPS ? NaN : low + (high - low) * n / STEPS));
    }

    // First all x, then all y.
    positions(at) {
      const [left, bottom, right, top] = this.window;
      return this.once(`x${at}`, () => {
        const packed = this.integers(at), n = packed.length / 2;
        return Float64Array.from(packed, (value, i) => value > STEPS ? NaN
          : i < n ? left + (right - left) * value / STEPS : bottom + (top - bottom) * value / STEPS);
      });
    }

    // Triangles, the sides of cells among their edges, and the rim.
    mesh(run) {
      return this.once(`m${run.triangles} ${run.order}`, () => {
        const triangles = this.integers(run.triangles, run.nodes > 65536), edges = new Map(), pieces = run.order ** 2;
        for (let i = 0; i < triangles.length; i++) {
          const a = triangles[i], b = triangles[i % 3 === 2 ? i - 2 : i + 1], key = Math.min(a, b) * run.nodes + Math.max(a, b);
          const cell = Math.floor(i / 3 / pieces), seen = edges.get(key);
          if (seen) Object.assign(seen, { count: 2, side: seen.cell !== cell });
          else edges.set(key, { a, b, cell, count: 1, side: true });
        }
        const all = [...edges.values()];
        return { triangles, sides: all.filter(one => one.side), rim: all.filter(one => one.count === 1) };
      });
    }

    // What a run has at a place of the film, which lies between two output times where it is no whole number.
    shot(run, place) {
      const i = Math.floor(place), one = run.frames[i], other = run.frames[Math.ceil(place)];
      if (!one || !other) return null;
      const part = place - i;
      const blend = (read, from, to) => part && from !== undefined && to !== undefined
        ? mix(read(from), read(to), part) : from === undefined ? null : read(from);
      return { x: blend(at => this.positions(at), one.x, other.x), a: blend(field => this.values(field), one.a, other.a),
        apart: blend(field => this.values(field), one.apart, other.apart) };
    }

    // Right less left, by cells, on the triangles and where the cell of the left is.
    difference(left, right, place) {
      const one = this.shot(left, place), other = this.shot(right, place);
      if (left.like !== right.like || !one?.apart || !other?.apart) return null;
      const pieces = left.order ** 2, n = this.mesh(left).triangles.length / 3;
      return { x: one.x, a: Float64Array.from({ length: n }, (_, i) => other.apart[Math.floor(i / pieces)] - one.apart[Math.floor(i / pieces)]) };
    }

    furthest(left, right) {
      let most = 0;
      for (const i of this.times.keys())
        for (const value of this.difference(left, right, i)?.a ?? []) if (Math.abs(value) > most) most = Math.abs(value);
      return most;
    }
  }

  class Pane {
    constructor(place, film, colours) {
      Object.assign(this, { film, canvas: place.querySelector("canvas"), extent: place.querySelector(".extent"), colours });
      this.pen = this.canvas.getContext("2d");
      const [left, bottom, right, top] = film.window;
      this.canvas.style.aspectRatio = `${right - left} / ${top - bottom}`;
    }

    // World to canvas: factor, then offset.
    get frame() {
      const [left, , right, top] = this.film.window;
      return [this.canvas.width / (right - left), left, top];
    }

    world(event) {
      const box = this.canvas.getBoundingClientRect(), [left, bottom, right, top] = this.film.window;
      return [left + (event.clientX - box.left) / box.width * (right - left), top - (event.clientY - box.top) / box.height * (top - bottom)];
    }

    draw({ run, shot, ends, mesh, probe, stored, label, none }) {
      const { pen, canvas } = this, [factor, left, top] = this.frame, dpr = canvas.width / (canvas.clientWidth || canvas.width);
      const at = (x, n) => [(x[n] - left) * factor, (top - x[n + x.length / 2]) * factor];
      const trace = (edges, x) => {
        pen.beginPath();
        for (const { a, b } of edges) {
          pen.moveTo(...at(x, a));
          pen.lineTo(...at(x, b));
        }
        pen.stroke();
      };
      const net = this.film.mesh(run);
      pen.lineJoin = "round";
      if (shot) {
        const [low, high] = ends, levels = Array.from({ length: LEVELS }, () => []);
        let least = Infinity, most = -Infinity, sum = 0;
        shot.a.forEach((value, i) => {
          if (!Number.isFinite(value)) return;
          least = Math.min(least, value);
          most = Math.max(most, value);
          const part = Math.min(Math.max(high > low ? (value - low) / (high - low) : .5, 0), 1);
          sum += part;
          levels[Math.round(part * (LEVELS - 1))].push(i);
        });
        pen.lineWidth = .8 * dpr; // covers the seams between neighbours
        levels.forEach((triangles, level) => {
          if (!triangles.length) return;
          pen.beginPath();
          for (const i of triangles) {
            pen.moveTo(...at(shot.x, net.triangles[3 * i]));
            pen.lineTo(...at(shot.x, net.triangles[3 * i + 1]));
            pen.lineTo(...at(shot.x, net.triangles[3 * i + 2]));
            pen.closePath();
          }
          pen.fillStyle = pen.strokeStyle = this.colours[level];
          pen.fill();
          pen.stroke();
        });
        if (mesh) {
          pen.lineWidth = .6 * dpr;
          pen.strokeStyle = sum / shot.a.length > .45 ? "rgb(0 0 0 / .5)" : "rgb(255 255 255 / .55)";
          trace(net.sides, shot.x);
        }
        pen.lineWidth = 1.4 * dpr;
        pen.strokeStyle = OUTLINE;
        trace(net.rim, shot.x);
        this.shot = { ...shot, triangles: net.triangles };
        this.words = ends[0] === -ends[1] ? `|·| ≤ ${short(Math.max(-least, most))}` : range(least, most);
      } else this.words = none;
      pen.lineWidth = dpr;
      pen.strokeStyle = OUTLINE;
      pen.setLineDash([4 * dpr, 4 * dpr]);
      trace(net.rim, this.film.positions(run.xi));
      pen.setLineDash([]);
      canvas.setAttribute("aria-label", shot ? `${label}, values ${this.words}` : `${label}: ${none}`);
      let here = "";
      if (probe && shot) {
        const value = this.under(probe);
        here = value === null ? " · outside" : ` · ${String(Number(value.toPrecision(close(...ends) === 9 ? 9 : 5))).replaceAll("-", "−")} at the mark`;
        pen.strokeStyle = "#fff";
        for (const [colour, width] of [["#000", 3], ["#fff", 1.4]]) {
          pen.strokeStyle = colour;
          pen.lineWidth = width * dpr;
          pen.beginPath();
          pen.arc((probe[0] - left) * factor, (top - probe[1]) * factor, 4.5 * dpr, 0, 7);
          pen.stroke();
        }
      }
      this.extent.textContent = stored ? this.words + here : "\u00a0"; // a blend has no numbers
    }

    // The value of the triangle under a point.
    under([px, py]) {
      const { x, a, triangles } = this.shot, n = x.length / 2;
      const side = (i, j) => (x[j] - x[i]) * (py - x[i + n]) - (x[j + n] - x[i + n]) * (px - x[i]);
      for (let i = 0; i < triangles.length; i += 3) {
        const [p, q, r] = triangles.slice(i, i + 3);
        if (side(p, q) >= 0 && side(q, r) >= 0 && side(r, p) >= 0) return a[i / 3];
      }
      return null;
    }
  }

  // Words of arrays, from differences to the last one as long: all low bytes of each, then all high ones.
  const unpacked = async ({ words, packed }) => {
    const raw = Uint8Array.from(atob(packed), letter => letter.charCodeAt(0)), last = new Map();
    const bytes = new Uint8Array(await new Response(new Blob([raw]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer());
    let at = 0;
    return words.map(n => {
      const before = last.get(n), found = Uint16Array.from({ length: n }, (_, i) => (before?.[i] ?? 0) + bytes[at + i] + 256 * bytes[at + n + i]);
      at += 2 * n;
      last.set(n, found);
      return found;
    });
  };

  const start = async player => {
    const data = JSON.parse(document.getElementById(player.dataset.film).textContent);
    const film = new Film({ ...data, arrays: await unpacked(data.arrays) });
    const find = name => player.querySelector(name);
    const [play, slider, told, mesh] = [".play", "input[type=range]", ".time", "input[type=checkbox]"].map(find);
    const selects = [...player.querySelectorAll("select")];
    const panes = [...player.querySelectorAll(".pane")].map((place, i) => new Pane(place, film, film.palettes[i === 2 ? 1 : 0]));
    const bars = [...player.querySelectorAll(".bar")];
    let place = film.times.findLastIndex((_, i) => film.runs.every(run => run.frames[i])), probe = null, since = null, most = 0;
    const chosen = () => selects.length ? selects.map(one => film.runs[one.value]) : panes.length > 1
      ? [film.runs[0], film.runs[player.dataset.right]] : [film.runs[0]];

    const words = place => {
      const i = Math.floor(place);
      return Number.isInteger(place) ? `t = ${short(film.times[i])}` : `t between ${short(film.times[i])} and ${short(film.times[i + 1])}`;
    };
    const paint = (panes, place, probe) => {
      const [left, right] = chosen(), time = words(place), none = run => `no frame, the run is ${run.outcome}`;
      const stored = Number.isInteger(place);
      const common = { mesh: mesh.checked && stored, probe: stored ? probe : null, stored };
      [left, right].slice(0, panes.length).forEach((run, i) => panes[i].draw({ ...common, run, shot: film.shot(run, place),
        ends: film.scale, label: `a of ${run.name} at ${time}`, none: none(run) }));
      if (panes[2]) panes[2].draw({ ...common, run: left, shot: film.difference(left, right, place), ends: [-(most || 1), most || 1],
        label: `${right.name} − ${left.name} at ${time}`,
        none: left.like === right.like ? "no difference: a run has no frame" : "no difference: other cells" });
    };
    const draw = () => {
      const time = words(place);
      for (const { pen, canvas } of panes) pen.clearRect(0, 0, canvas.width, canvas.height);
      paint(panes, place, probe);
      told.textContent = time;
      slider.value = Math.round(place);
      slider.setAttribute("aria-valuetext", time);
    };

    // All that is shown, drawn at a place of the film by any pen, with names, ranges and colour bars.
    const WIDE = 480, EDGE = 24, name = player.ariaLabel.replace("Film of ", "");
    const high = WIDE * (film.window[3] - film.window[1]) / (film.window[2] - film.window[0]);
    const size = [EDGE + panes.length * (WIDE + EDGE), high + EDGE * (6 + Math.min(panes.length, 2))];
    const sheet = (pen, place) => {
      const [left, right] = chosen();
      pen.fillText(`${name}, ${words(place)}`, EDGE, 1.5 * EDGE);
      const copies = panes.map((pane, i) => Object.assign(Object.create(pane), { pen, extent: {}, canvas: { width: WIDE, clientWidth: WIDE, setAttribute() {} },
        draw(what) {
          const x = EDGE + i * (WIDE + EDGE), y = 3 * EDGE;
          pen.translate(x, y);
          Pane.prototype.draw.call(this, what);
          pen.translate(-x, -y);
          pen.fillStyle = INK;
          pen.fillText(i === 2 ? `${right.name} − ${left.name}` : what.run.name, x, y - EDGE / 2, WIDE);
          pen.fillText(this.words, x, y + high + .8 * EDGE, WIDE);
        } }));
      paint(copies, place, null);
      [["a", ...film.scale], ["difference of a", -most, most]].slice(0, copies.length > 1 ? 2 : 1).forEach(([label, one, other], i) =>
        drawBar(pen, EDGE, high + EDGE * (5.2 + i), label, short(one), short(other), film.palettes[i].filter((_, level) => level % 4 === 0)));
    };
    const painted = (place, factor) => {
      const [canvas, pen] = sheetOf(...size, factor);
      sheet(pen, place);
      return canvas;
    };
    const GIF = .75; // of the size of a picture
    const take = {
      PNG: () => downloadPNG(`${name} ${words(place)}`, painted(place, 2)),
      SVG: () => {
        const pencil = new Pencil();
        sheet(pencil, place);
        downloadSVG(`${name} ${words(place)}`, ...size, pencil.svg);
      },
      GIF: () => {
        const frames = film.times.map((_, i) => painted(i, GIF)), [{ width, height }] = frames;
        const data = frames.map(one => one.getContext("2d").getImageData(0, 0, width, height).data);
        download(name, "gif", gif(data, width, height, Math.min(250, WHOLE / frames.length)));
      },
    };
    for (const [kind, act] of Object.entries(take)) {
      const button = added(mesh.closest(".controls").lastElementChild, "take", kind, `${kind === "GIF" ? "The film" : "What is shown"} as ${kind}`, () => { if (since) stop(); act(); });
      button.title = button.ariaLabel;
    }

    const choose = () => {
      const [left, right] = chosen();
      most = right ? film.furthest(left, right) : 0;
      if (bars[1]) {
        const [low, high] = bars[1].querySelectorAll(".number");
        low.textContent = short(-most);
        high.textContent = short(most);
        find(".apart").textContent = `${right.name} − ${left.name}`;
      }
      draw();
    };
    const stop = () => {
      if (since) cancelAnimationFrame(since.request);
      since = null;
      place = Math.round(place);
      play.textContent = "Play";
      told.setAttribute("aria-live", "polite");
      draw();
    };
    const tick = now => {
      since.begun ??= now;
      const last = film.times.length - 1;
      const passed = since.from + (now - since.begun) / Math.min(INTERVAL, WHOLE / last);
      place = Math.min(calm.matches ? Math.floor(passed) : passed, last);
      if (place >= last) return stop();
      draw();
      since.request = requestAnimationFrame(tick);
    };
    play.addEventListener("click", () => {
      if (since) return stop();
      since = { from: place >= film.times.length - 1 ? 0 : place };
      play.textContent = "Pause";
      told.setAttribute("aria-live", "off");
      since.request = requestAnimationFrame(tick);
    });
    place = Math.max(place, 0);
    slider.max = film.times.length - 1;
    slider.addEventListener("input", () => {
      const wanted = Number(slider.value);
      if (since) stop();
      place = wanted;
      draw();
    });
    mesh.addEventListener("change", draw);
    for (const one of selects) one.addEventListener("change", choose);
    for (const pane of panes) {
      pane.canvas.addEventListener("focus", () => pane.extent.setAttribute("aria-live", "polite"));
      pane.canvas.addEventListener("blur", () => pane.extent.removeAttribute("aria-live"));
      pane.canvas.addEventListener("pointermove", event => { probe = pane.world(event); draw(); });
      pane.canvas.addEventListener("pointerleave", () => { probe = null; draw(); });
      pane.canvas.addEventListener("keydown", event => {
        const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
        if (event.key === "Escape") probe = null;
        else if (!by) return;
        else {
          const [left, bottom, right, top] = film.window, step = (right - left) / 40;
          const from = probe ?? [(left + right) / 2, (bottom + top) / 2];
          probe = [from[0] + by[0] * step, from[1] + by[1] * step];
        }
        event.preventDefault();
        draw();
      });
      new ResizeObserver(() => {
        const [left, bottom, right, top] = film.window, width = Math.round(pane.canvas.clientWidth * devicePixelRatio);
        if (!width || width === pane.canvas.width) return;
        pane.canvas.width = width;
        pane.canvas.height = Math.round(width * (top - bottom) / (right - left));
        draw();
      }).observe(pane.canvas);
    }
    bars.forEach((bar, i) => { bar.querySelector(".gradient").style.background = film.gradients[i]; });
    choose();
  };
  for (const player of document.querySelectorAll(".player")) {
    player.hidden = false;
    start(player).then(() => player.closest("figure").classList.add("live")); // in place of its strip
  }
}
