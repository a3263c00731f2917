"use strict";
(() => {
  // Fills the map of a sweep with a quantity of each run, and shows the curves of the run that the reader chooses.
  const source = document.getElementById("sweep");
  if (!source) return;
  const data = JSON.parse(source.textContent);
  const cells = [...document.querySelectorAll(".heat td[data-run]")], quantity = document.getElementById("quantity");
  const chosen = document.getElementById("run"), said = document.getElementById("picked"), shades = document.getElementById("shades");
  const SPAN = 30;    // between smallest and largest value, beyond which shades are logarithmic
  const FAINTEST = 4; // percent

  const raised = (exponent) => String(exponent).replace(/[-\d]/g, (sign) => (sign === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[sign]));
  const short = (value) => {
    if (value === null) return "–";
    const size = Math.abs(value);
    if (size >= 1e4 || (value !== 0 && size < 0.01)) {
      const [digits, exponent] = value.toExponential(0).split("e");
      return `${digits}·10${raised(Number(exponent))}`.replace(/^-/, "−");
    }
    return (size >= 100 ? value.toFixed(0) : String(Number(value.toPrecision(2)))).replace(/^-/, "−");
  };

  const shade = () => {
    const values = data.values[quantity.value];
    const known = cells.map((cell) => values[cell.dataset.run]).filter((value) => value !== null);
    const low = Math.min(...known), high = Math.max(...known), isLog = low > 0 && high > SPAN * low;
    const f = isLog ? Math.log : (value) => value;
    cells.forEach((cell) => {
      const value = values[cell.dataset.run], label = data.labels[cell.dataset.run];
      const share = high > low && value !== null ? (f(value) - f(low)) / (f(high) - f(low)) : 0;
      cell.style.setProperty("--p", (FAINTEST + (100 - FAINTEST) * share).toFixed(0));
      const written = document.createElement("span");
      written.textContent = cell.classList.contains("failed") ? "✗" : short(value);
      written.className = written.textContent.length > 4 ? "long" : "";
      cell.replaceChildren(written);
      cell.title = `${label}: ${value === null ? "no value" : value} (${data.statuses[cell.dataset.run]})`;
    });
    if (known.length) shades.textContent = `${short(low)} to ${short(high)}, shaded ${isLog ? "logarithmically" : "linearly"}.`;
  };

  const pick = (run) => {
    cells.forEach((cell) => {
      const isOn = Number(cell.dataset.run) === run;
      cell.setAttribute("aria-selected", isOn);
      cell.tabIndex = isOn ? 0 : -1;
    });
    if (chosen) chosen.value = run;
    const state = data.statuses[run] === "ok" ? "" : ` (${data.statuses[run]})`;
    const hasCurves = data.places[run] >= 0;
    if (said) said.textContent = `Run ${data.numbers[run]}: ${data.labels[run]}${state}${hasCurves ? "" : "; its curves are in the file alone"}`;
    if (hasCurves) document.dispatchEvent(new CustomEvent("shown-run", { detail: data.places[run] }));
  };

  const width = document.querySelectorAll(".heat thead th").length;
  cells.forEach((cell, place) => {
    cell.addEventListener("click", () => pick(Number(cell.dataset.run)));
    cell.addEventListener("keydown", (event) => {
      const ways = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -width, ArrowDown: width };
      const next = cells[place + ways[event.key]];
      if (!next) return;
      pick(Number(next.dataset.run));
      next.focus();
      event.preventDefault();
    });
  });
  document.querySelectorAll("a[href^='#run-']").forEach((link) => link.addEventListener("click", (event) => {
    pick(Number(link.getAttribute("href").slice(5)));
    (document.getElementById("map") ?? link).scrollIntoView();
    event.preventDefault();
  }));
  chosen?.addEventListener("change", () => pick(Number(chosen.value)));
  if (quantity) {
    quantity.addEventListener("change", shade);
    shade();
  }
  pick(data.start);
})();
