// Pictures to take away: exhibits as PNG or SVG, and what report/static/film.js draws as either or as a GIF.
"use strict";

const PAPER = "#fff", INK = "#1d2126", FONT = "16px system-ui, sans-serif";
const sheetOf = (width, height, factor) => {
  const canvas = Object.assign(document.createElement("canvas"), { width: Math.round(width * factor), height: Math.round(height * factor) });
  const pen = canvas.getContext("2d");
  pen.scale(factor, factor);
  pen.fillStyle = PAPER;
  pen.fillRect(0, 0, width, height);
  pen.font = FONT;
  pen.fillStyle = INK;
  return [canvas, pen];
};
const downloadPNG = (name, canvas) => canvas.toBlob(blob => download(name, "png", blob));
const downloadSVG = (name, width, height, drawn) => download(name, "svg", new Blob([`<svg xmlns="http://www.w3.org/2000/svg" ` +
  `width="${width}" height="${height}" viewBox="0 0 ${width} ${height}"><rect width="100%" height="100%" fill="${PAPER}"/>${drawn}</svg>`], { type: "image/svg+xml" }));

// A colour bar with its ends, by any pen.
const drawBar = (pen, x, y, label, low, high, colours) => {
  const words = `${label} ${low}`, start = x + 9 * words.length + 12, part = 160 / colours.length;
  pen.fillText(words, x, y);
  pen.fillText(high, start + 170, y);
  colours.forEach((colour, i) => {
    pen.fillStyle = colour;
    pen.fillRect(start + i * part, y - 12, part + .5, 14); // no seams
  });
  pen.fillStyle = INK;
};

// What a canvas's pen is told, as SVG.
class Pencil {
  constructor() { Object.assign(this, { shapes: [], d: "", dash: [], x: 0, y: 0, fillStyle: INK, font: FONT }); }
  translate(x, y) { this.x += x; this.y += y; }
  setLineDash(dash) { this.dash = dash; }
  at(x, y) { return `${+(this.x + x).toFixed(2)} ${+(this.y + y).toFixed(2)}`; }
  beginPath() { this.d = ""; }
  moveTo(x, y) { this.d += `M${this.at(x, y)}`; }
  lineTo(x, y) { this.d += `L${this.at(x, y)}`; }
  closePath() { this.d += "Z"; }
  arc(x, y, r) { this.d += `M${this.at(x - r, y)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`; }
  fill() { this.shapes.push({ d: this.d, fill: this.fillStyle, line: "" }); }
  stroke() {
    const line = `stroke="${this.strokeStyle}" stroke-width="${+this.lineWidth.toFixed(2)}" stroke-linejoin="round" stroke-dasharray="${this.dash}"`;
    const last = this.shapes.at(-1);
    if (last?.d === this.d && !last.line) last.line = line;
    else this.shapes.push({ d: this.d, fill: "none", line });
  }
  fillRect(x, y, width, height) { this.shapes.push({ d: `M${this.at(x, y)}h${+width.toFixed(2)}v${+height.toFixed(2)}h${-width.toFixed(2)}Z`, fill: this.fillStyle, line: "" }); }
  fillText(words, x, y) { this.shapes.push({ words, place: this.at(x, y).split(" "), fill: this.fillStyle, font: this.font }); }
  get svg() {
    const plain = words => words.replace(/[&<>]/g, letter => `&#${letter.charCodeAt(0)};`);
    return this.shapes.map(({ d, fill, line, words, place, font }) => d === undefined
      ? `<text x="${place[0]}" y="${place[1]}" fill="${fill}" style="font: ${font}">${plain(words)}</text>`
      : `<path d="${d}" fill="${fill}" ${line}/>`).join("");
  }
}

// A GIF that goes round, of frames by the data of their pixels, in the 256 colours (of five bits each) that are most there.
const gif = (frames, width, height, milliseconds) => {
  const key = (data, i) => data[i] >> 3 << 10 | data[i + 1] >> 3 << 5 | data[i + 2] >> 3, parts = one => [one >> 10, one >> 5 & 31, one & 31];
  const often = new Uint32Array(32768);
  for (const data of frames) for (let i = 0; i < data.length; i += 4) often[key(data, i)]++;
  const palette = [...often.keys()].filter(one => often[one]).sort((a, b) => often[b] - often[a]).slice(0, 256);
  const known = new Int16Array(32768).fill(-1);
  palette.forEach((one, number) => { known[one] = number; });
  const nearest = one => {
    const [r, g, b] = parts(one), far = palette.map(other => parts(other)).map(([x, y, z]) => (r - x) ** 2 + (g - y) ** 2 + (b - z) ** 2);
    return far.indexOf(Math.min(...far));
  };
  const CLEAR = 256, END = 257, table = new Int16Array(4096 * 256);
  const compressed = data => {
    const bytes = [];
    let held = 0, bits = 0, size = 9, next = 258, prefix = -1;
    const put = code => {
      held |= code << bits;
      for (bits += size; bits >= 8; bits -= 8, held >>>= 8) bytes.push(held & 255);
    };
    const begin = () => { put(CLEAR); [size, next] = [9, 258]; table.fill(-1); };
    begin();
    for (let i = 0; i < data.length; i += 4) {
      const one = key(data, i), colour = known[one] < 0 ? known[one] = nearest(one) : known[one];
      const place = prefix * 256 + colour;
      if (prefix < 0) prefix = colour;
      else if (table[place] >= 0) prefix = table[place];
      else {
        put(prefix);
        if (next === 4096) begin();
        else {
          if (next >= 1 << size) size++;
          table[place] = next++;
        }
        prefix = colour;
      }
    }
    put(prefix);
    put(END);
    if (bits) bytes.push(held & 255);
    return bytes;
  };
  const word = value => [value & 255, value >> 8], letters = text => [...text].map(letter => letter.charCodeAt(0));
  const colours = palette.flatMap(parts).map(part => Math.round(part * 255 / 31));
  const blocks = [[...letters("GIF89a"), ...word(width), ...word(height), 0xf7, 0, 0, ...colours, ...Array(768 - colours.length).fill(0),
    0x21, 0xff, 11, ...letters("NETSCAPE2.0"), 3, 1, 0, 0, 0]];
  for (const data of frames) {
    blocks.push([0x21, 0xf9, 4, 4, ...word(Math.round(milliseconds / 10)), 0, 0, 0x2c, 0, 0, 0, 0, ...word(width), ...word(height), 0, 8]);
    const bytes = compressed(data);
    for (let i = 0; i < bytes.length; i += 255) blocks.push([Math.min(255, bytes.length - i), ...bytes.slice(i, i + 255)]);
    blocks.push([0]);
  }
  return new Blob([...blocks, [0x3b]].map(block => new Uint8Array(block)), { type: "image/gif" });
};

// Cells side by side, six in a row, with what stands by them.
for (const figure of document.querySelectorAll("figure.exhibit:has(img)")) {
  const title = figure.querySelector("h3").textContent, images = [...figure.querySelectorAll("img")];
  added(figure.querySelector(".scroll") ?? images[0], "save", "PNG", `${title} as PNG`, () => {
    const [{ naturalWidth: wide, naturalHeight: high }] = images, edge = 24, bars = [...figure.querySelectorAll(".bar")];
    const across = Math.min(images.length, 6), down = Math.ceil(images.length / 6);
    const [canvas, pen] = sheetOf(edge + across * (wide + edge), edge + down * (high + 3 * edge) + 2 * edge * bars.length, 2);
    images.forEach((image, i) => {
      const x = edge + i % 6 * (wide + edge), y = edge + Math.floor(i / 6) * (high + 3 * edge), said = image.closest("li");
      pen.fillText(said?.querySelector(".title").textContent ?? title, x, y + 12, wide);
      pen.drawImage(image, x, y + edge, wide, high);
      pen.fillText(said?.querySelector(".extent").textContent ?? "", x, y + high + 1.8 * edge, wide);
    });
    bars.forEach((bar, i) => {
      const [low, high] = [...bar.querySelectorAll(".number")].map(one => one.textContent);
      const stops = bar.querySelector(".gradient").style.background.match(/rgb\([^)]*\)|#\w{6}/g);
      drawBar(pen, edge, canvas.height / 2 - 2 * edge * (bars.length - i) + edge, bar.querySelector(":scope > span:not(.number, .gradient)")?.textContent ?? "", low, high, stops);
    });
    downloadPNG(title, canvas);
  });
}
for (const figure of document.querySelectorAll("figure.outlines")) {
  const title = figure.querySelector("h3").textContent, drawings = [...figure.querySelectorAll("svg")];
  added(figure.querySelector(".scroll"), "save", "SVG", `${title} as SVG`, () => {
    const parts = drawings.map((drawing, i) => [...drawing.children].map(shape => {
      const { fill, stroke, strokeWidth, strokeDasharray } = getComputedStyle(shape), x = i % 6 * 120, y = Math.floor(i / 6) * 130;
      return `<polygon points="${shape.getAttribute("points")}" transform="translate(${x + 10} ${y + 24})" fill="${fill}" stroke="${stroke}" ` +
        `stroke-width="${strokeWidth}" stroke-dasharray="${strokeDasharray}"/>`;
    }).join("") + `<text x="${i % 6 * 120 + 10}" y="${Math.floor(i / 6) * 130 + 16}" style="font: 10px system-ui, sans-serif">${
      drawing.nextElementSibling.textContent.replace(/[&<>]/g, letter => `&#${letter.charCodeAt(0)};`)}</text>`);
    downloadSVG(title, 120 * Math.min(drawings.length, 6), 130 * Math.ceil(drawings.length / 6), parts.join(""));
  });
}
