"use strict";
// A click on a heading sorts the rows by its column: numbers by their value, other texts alphabetically.
document.querySelectorAll("th[aria-sort] button").forEach((button) => button.addEventListener("click", () => {
  const head = button.closest("th"), place = head.cellIndex, body = head.closest("table").tBodies[0];
  const isUp = head.getAttribute("aria-sort") !== "ascending";
  head.parentElement.querySelectorAll("th[aria-sort]").forEach((other) => other.setAttribute("aria-sort", "none"));
  head.setAttribute("aria-sort", isUp ? "ascending" : "descending");
  const value = (row) => row.cells[place].dataset.order ?? row.cells[place].textContent.trim();
  const compare = (one, other) => {
    const [a, b] = [one, other].map(value), [p, q] = [a, b].map(Number);
    const areNumbers = a !== "" && b !== "" && !Number.isNaN(p) && !Number.isNaN(q);
    return (isUp ? 1 : -1) * (areNumbers ? p - q : a.localeCompare(b, "en", { numeric: true }));
  };
  body.append(...[...body.rows].sort(compare));
}));
