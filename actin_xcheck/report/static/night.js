// Filters and sorts what is there already; without scripts everything is shown.
"use strict";
for (const form of document.querySelectorAll("form.filter")) {
  const table = document.getElementById(form.dataset.table);
  const rows = [...table.querySelectorAll("tr.claim")];
  const text = form.elements.text, state = form.elements.state, told = form.querySelector("output");
  const filter = () => {
    const words = text.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      const said = (row.closest("tbody").dataset.check + " " + row.textContent).toLowerCase();
      row.hidden = !(words.every(word => said.includes(word)) && (!state.value || row.dataset.state === state.value));
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
  const inside = target.querySelector("details");
  if (inside) inside.open = true;
  target.scrollIntoView();
};
addEventListener("hashchange", open);
open();
