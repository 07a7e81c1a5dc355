"use strict";
// What a script adds to report.html: tables sorted by a click, and nothing folded on paper.

function sortBy(table, column, ascending) {
  const kind = (text) => (text === "-" ? 2 : Number.isNaN(Number(text)) ? 1 : 0);
  const rows = [...table.tBodies[0].rows];
  rows.sort((a, b) => {
    const [x, y] = [a, b].map((row) => row.cells[column].textContent);
    if (kind(x) !== kind(y)) return kind(x) - kind(y);
    return (kind(x) ? x.localeCompare(y) : x - y) * (ascending ? 1 : -1);
  });
  table.tBodies[0].append(...rows);
}

for (const heading of document.querySelectorAll("thead th")) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = heading.textContent;
  heading.replaceChildren(button);
  button.addEventListener("click", () => {
    const ascending = heading.getAttribute("aria-sort") !== "ascending";
    for (const other of heading.parentNode.cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", ascending ? "ascending" : "descending");
    sortBy(heading.closest("table"), heading.cellIndex, ascending);
  });
}

// Paper cannot be unfolded.

addEventListener("beforeprint", () => {
  for (const folded of document.querySelectorAll("details")) folded.open = true;
});
