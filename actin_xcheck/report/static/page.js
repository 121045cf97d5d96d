// What every page can do: copy commands, save numbers, filter and sort; without scripts everything is shown.
"use strict";
const added = (place, name, words, label, click) => {
  const button = Object.assign(document.createElement("button"), { type: "button", className: name, textContent: words, ariaLabel: label });
  button.addEventListener("click", click);
  place.after(button);
  return button;
};
for (const code of document.querySelectorAll("code.command")) {
  const button = added(code, "copy", "copy", "Copy the command", async () => {
    getSelection().selectAllChildren(code); // to be copied by hand where the browser forbids
    await navigator.clipboard?.writeText(code.textContent);
    button.textContent = navigator.clipboard ? "copied" : "selected";
    setTimeout(() => { button.textContent = "copy"; }, 2000);
  });
}

// A file, called after what is in it.
const download = (name, suffix, blob) => {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob),
    download: `${name.trim().toLowerCase().replace(/[^\p{L}\d]+/gu, "-")}.${suffix}` });
  link.click();
  URL.revokeObjectURL(link.href);
};
const save = (name, rows) => {
  const cell = value => /[",\n]/.test(value ?? "") ? `"${value.replaceAll('"', '""')}"` : value ?? "";
  const text = rows.map(row => row.map(cell).join(",") + "\r\n").join("");
  download(name, "csv", new Blob([text], { type: "text/csv" }));
};
const words = cell => {
  const shown = cell.cloneNode(true);
  for (const one of shown.querySelectorAll("button, summary, .anchor, [aria-hidden]")) one.remove();
  for (const one of shown.querySelectorAll("[aria-label]")) one.prepend(`${one.ariaLabel} `);
  return cell.dataset.value ?? shown.textContent.trim().replace(/\s+/g, " ");
};
const rows = table => {
  const group = table.querySelector(".group") && (body => words(body.querySelector(".group")));
  const cells = (row, first) => [...(group ? [first] : []), ...[...row.cells].map(words)];
  return [cells(table.tHead.rows[0], "about"), ...[...table.tBodies].flatMap(body =>
    [...body.rows].filter(row => !row.matches(".group")).map(row => cells(row, group?.(body))))];
};
for (const table of document.querySelectorAll("table:has(thead):not(.film *)")) {
  const frame = table.closest(".scroll") ?? table;
  const name = frame.ariaLabel ?? table.closest("section").querySelector("h2").textContent;
  added(frame, "save", "CSV", `${name} as CSV`, () => save(name, rows(table)));
}

// A page of what is under way is soon another one.
const again = document.getElementById("main")?.dataset.again;
if (again) setTimeout(() => location.reload(), 1000 * again);

const wide = new ResizeObserver(seen => seen.forEach(({ target }) => target.classList.toggle("more", target.scrollWidth > target.clientWidth + 1)));
for (const frame of document.querySelectorAll(".scroll")) wide.observe(frame);

// In the contents, what is being read.
const parts = [...document.querySelectorAll("nav a")].map(link => [link, document.getElementById(link.hash.slice(1))]);
const follow = () => {
  const [now] = parts.findLast(([, part]) => part.getBoundingClientRect().top < innerHeight / 3) ?? [];
  if (now?.ariaCurrent) return;
  for (const [link] of parts) link.ariaCurrent = link === now ? "true" : null;
  now?.closest("ul").scrollTo({ left: now.offsetLeft - 40 });
};
addEventListener("scroll", follow, { passive: true });

for (const form of document.querySelectorAll("form.filter")) {
  const table = document.getElementById(form.dataset.table);
  const rows = [...table.querySelectorAll("tr.claim")];
  const text = form.elements.text, state = form.elements.state, told = form.querySelector("output");
  const filter = () => {
    const words = text.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      const said = (row.closest("tbody").dataset.check + " " + row.textContent).toLowerCase();
      row.hidden = !(words.every(word => said.includes(word)) && (!state.value || state.value.split(" ").includes(row.dataset.state)));
      shown += !row.hidden;
    }
    for (const body of table.tBodies) body.hidden = ![...body.querySelectorAll("tr.claim")].some(row => !row.hidden);
    told.textContent = shown + " of " + rows.length + " shown";
  };
  form.hidden = false;
  form.addEventListener("input", filter);
  form.addEventListener("submit", event => event.preventDefault());
  filter();
}
for (const table of document.querySelectorAll("table.sortable")) {
  [...table.tHead.rows[0].cells].forEach((cell, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "sort";
    button.append(...cell.childNodes);
    cell.append(button);
    button.addEventListener("click", () => {
      const down = cell.getAttribute("aria-sort") !== "descending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      cell.setAttribute("aria-sort", down ? "descending" : "ascending");
      const key = row => row.cells[column].dataset.value ?? row.cells[column].textContent.trim();
      const order = (a, b) => key(a).localeCompare(key(b), "en", { numeric: true });
      const numbers = (a, b) => Number(key(a)) - Number(key(b));
      const body = table.tBodies[0], rows = [...body.rows];
      const compare = rows.every(row => !Number.isNaN(Number(key(row)))) ? numbers : order;
      body.append(...rows.sort((a, b) => (down ? -1 : 1) * compare(a, b)));
    });
  });
}
const open = () => {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!target) return;
  for (let place = target; place; place = place.parentElement) if (place.tagName === "DETAILS") place.open = true;
  if (target.matches("tr.claim")) target.querySelector("details").open = true;
  target.scrollIntoView();
};
addEventListener("hashchange", open);
open();

// Paper has all that folds.
const printed = matchMedia("print"), folded = [];
printed.addEventListener("change", () => {
  if (printed.matches) folded.push(...document.querySelectorAll("details:not([open])"));
  for (const one of printed.matches ? folded : folded.splice(0)) one.open = printed.matches;
});
