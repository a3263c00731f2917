"use strict";
(() => {
  // Draws every element .plot of the page with the numbers in #curves. Plots over the same quantity, usually time, are
  // zoomed together, and their values are read together. The legend of a section switches curves in all plots of the
  // section.
  const store = document.getElementById("curves");
  const bytes = store ? Uint8Array.from(atob(store.textContent), (letter) => letter.charCodeAt(0)) : new Uint8Array(0);
  const numbers = new Float32Array(bytes.buffer);
  const TOP = 6, RIGHT = 12, BOTTOM = 24;  // px around the curves
  const LETTER = 7.3;                      // px, the width of a digit of 12 px
  const LINE = 13;                         // px from a line of text to the next
  const DRAG = 6;                          // px: a shorter way of the pointer is a click
  const DENSE = 4;                         // samples a pixel, beyond which smallest and largest are drawn
  const FAR = 1e4;                         // px: curves do not go farther beyond the edge
  const PRINTED = 860;                     // px: a printed page has the plots of a screen of this width, scaled
  const TIME = "time";
  const zooms = {};                        // by the name of the horizontal axis: what is shown of it
  const hidden = new Set();                // groups and keys of the curves that are switched off
  const plots = [];
  let isPrinting = false;
  let run = 0;                             // of a table of runs, the row that is shown

  // ---- Numbers as text

  const raised = (exponent) => String(exponent).replace(/[-\d]/g, (sign) => (sign === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[sign]));
  const text = (value, digits = 4) => {
    if (!Number.isFinite(value)) return "–";
    const exponent = value ? Math.floor(Math.log10(Math.abs(value))) : 0;
    const isPlain = exponent >= -3 && exponent < 6;
    const written = isPlain
      ? String(Number(value.toPrecision(digits)))
      : `${(value / 10 ** exponent).toFixed(digits - 1)}×10${raised(exponent)}`;
    return written.replace(/^-/, "−");
  };
  // The shortest text of a number, such as 5×10⁻⁴.
  const brief = (value) => text(value, 9).replace(/(\.\d*?)0+×/, "$1×").replace(".×", "×");

  // ---- Axes

  const scale = (from, to, start, end, isLog) => {
    const f = isLog ? Math.log10 : (value) => value;
    const a = f(from), factor = (end - start) / (f(to) - a);
    return {
      at: (value) => start + factor * (f(value) - a),
      value: (pixel) => (isLog ? 10 ** ((pixel - start) / factor + a) : (pixel - start) / factor + a),
    };
  };

  // The ticks at round numbers, about `most` of them: value and text of each. A logarithmic axis with fewer than two
  // powers of ten has the ticks of a linear axis.
  const ticks = (from, to, most, isLog) => {
    if (isLog) {
      const step = Math.max(1, Math.ceil((Math.log10(to) - Math.log10(from)) / most));
      const exponents = [];
      for (let e = Math.ceil(Math.log10(from) - 1e-9); e <= Math.log10(to) + 1e-9; e += step) exponents.push(e);
      const isPlain = exponents.every((e) => e >= -2 && e < 4);
      if (exponents.length > 1) return exponents.map((e) => [10 ** e, isPlain ? String(Number(`1e${e}`)) : `10${raised(e)}`]);
    }
    const rough = (to - from) / most, ten = 10 ** Math.floor(Math.log10(rough));
    const steps = [1, 2, 5, 10].map((factor) => factor * ten);
    const count = (step) => Math.floor(to / step + 1e-9) - Math.ceil(from / step - 1e-9) + 1;
    let place = steps.findIndex((step) => step >= rough * (1 - 1e-9));
    if (place > 0 && count(steps[place]) < 2) place -= 1;  // one number tells nothing of the scale
    const step = steps[place], values = [];
    for (let i = Math.ceil(from / step - 1e-9); i <= to / step + 1e-9; i++) {
      const value = Number((i * step).toPrecision(9));
      if (value > 0 || !isLog) values.push(value);
    }
    // All texts have as many decimals as the longest one, such as 1.270 beside 1.268. Zero has none. Texts with powers
    // of ten keep their own decimals.
    const labels = values.map(brief), isPlain = !labels.some((label) => label.includes("×"));
    const decimals = Math.max(0, ...labels.map((label) => label.split(".")[1]?.length ?? 0));
    return values.map((value, i) => [value, isPlain && value ? value.toFixed(decimals).replace("-", "−") : labels[i]]);
  };

  // ---- Columns

  const column = ({ at: [first, count, stride = 0], from = 0 }) => {
    const start = first + run * stride, values = numbers.subarray(start, start + count);
    return from ? Float64Array.from(values, (value) => value + from) : values;
  };

  // The index of the sample nearest to a value of x; -1 if the curve does not extend to this value, or has a gap there.
  const nearest = (xs, ys, value) => {
    let low = 0, high = xs.length - 1;
    if (high < 0) return -1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (xs[middle] > value) high = middle;
      else low = middle;
    }
    const place = Math.abs(xs[low] - value) <= Math.abs(xs[high] - value) ? low : high;
    const room = xs.length > 1 ? Math.abs(xs[high] - xs[low]) : Infinity;
    return Math.abs(xs[place] - value) <= room && Number.isFinite(ys[place]) ? place : -1;
  };

  // Whether a sample, or the line to one of its neighbours, lies in the shown range of x.
  const isNear = (xs, i, from, to) => !(xs[i + 1] < from || xs[i - 1] > to);

  // ---- Elements

  const draw = (parent, name, attributes, content = "") => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
    made.textContent = content;
    parent.append(made);
    return made;
  };
  const make = (parent, name, className, content = "") => {
    const made = document.createElement(name);
    made.className = className;
    made.textContent = content;
    parent.append(made);
    return made;
  };

  const unzoom = make(document.body, "button", "unzoom");
  unzoom.type = "button";
  unzoom.hidden = true;

  const start = (box) => {
    const plot = JSON.parse(box.dataset.plot), axis = plot.x, bottom = plot.height - BOTTOM;
    const group = box.closest("[data-group]")?.dataset.group ?? "";
    const svg = draw(box, "svg", { tabindex: 0, role: "slider", "aria-label": `${plot.name} over ${axis.name}`,
      "aria-valuemin": axis.range[0], "aria-valuemax": axis.range[1], "aria-valuenow": axis.range[0] });
    const tip = make(box, "div", "tip"), output = box.querySelector("output"), full = box.querySelector(".full");
    tip.hidden = true;
    let sx, sy, left = 0, right = 0, width = 0, shown = [], here = null, cursor = null;

    const extent = () => zooms[axis.name] ?? axis.range;

    // The vertical range of the plot for a shown range of x.
    const range = (from, to) => {
      let low = Infinity, high = -Infinity;
      shown.forEach(({ xs, ys }) => {
        for (let i = 0; i < ys.length; i++) {
          if (!isNear(xs, i, from, to) || !Number.isFinite(ys[i]) || (plot.log && ys[i] <= 0)) continue;
          low = Math.min(low, ys[i]);
          high = Math.max(high, ys[i]);
        }
      });
      if (plot.clip && full?.getAttribute("aria-pressed") !== "true") {
        low = Math.max(low, plot.clip[0]);
        high = Math.min(high, plot.clip[1]);
      }
      if (low > high) return plot.log ? [1e-12, 1] : [0, 1];
      (plot.marks ?? []).forEach(({ y }) => {
        if (y === undefined) return;
        low = Math.min(low, y);
        high = Math.max(high, y);
      });
      if (plot.log) {
        const decade = Math.floor(Math.log10(low) + 1e-9);
        return [10 ** decade, 10 ** Math.max(Math.ceil(Math.log10(high) - 1e-9), decade + 1)];
      }
      // A constant is not magnified, nor is a range that is rounding error.
      const size = Math.max(Math.abs(low), Math.abs(high)), least = Math.max(plot.least ?? 0, 1e-6 * size);
      if (high - low > least) return [low - 0.06 * (high - low), high + 0.06 * (high - low)];
      const room = size > least ? 0.1 * size : 1;
      return [low - room, high + room];
    };

    // The path of a curve, and the index of its first sample that lies in the shown range of x but above or below the
    // vertical range; -1 if there is none.
    const trace = ({ xs, ys, breaks = [], dots }, from, to, [low, high]) => {
      const isDense = xs.length * (to - from) > DENSE * width * (axis.range[1] - axis.range[0]);
      const jumps = new Set(breaks);
      let path = "", pen = "M", pixel = NaN, smallest = NaN, largest = NaN, last = NaN, outside = -1;
      const flush = () => {
        if (smallest < largest) path += `V${smallest.toFixed(1)}V${largest.toFixed(1)}V${last.toFixed(1)}`;
      };
      for (let i = 0; i < ys.length; i++) {
        if (jumps.has(i)) pen = "M";
        const y = plot.log && !(ys[i] > 0) ? NaN : ys[i];
        if (!Number.isFinite(y)) {
          pen = "M";
          continue;
        }
        if (!isNear(xs, i, from, to)) continue;
        if (outside < 0 && xs[i] >= from && xs[i] <= to && (y < low || y > high)) outside = i;
        const px = sx.at(xs[i]), py = Math.min(Math.max(sy.at(y), -FAR), FAR), half = Math.round(2 * px);
        if (isDense && half === pixel && pen === "L") {
          smallest = Math.min(smallest, py);
          largest = Math.max(largest, py);
          last = py;
          continue;
        }
        flush();
        path += `${pen}${px.toFixed(1)} ${py.toFixed(1)}`;
        pixel = half;
        smallest = largest = last = py;
        pen = dots === "only" ? "M" : "L";
      }
      flush();
      return { path, outside };
    };

    // The width of the plot on paper. The number of plots side by side is that of the style sheet for print, which does
    // not depend on the width of the window.
    const printedWidth = () => {
      const grid = box.closest("[class^=grid]"), isWide = box.closest(".grid2 > .card:last-child:nth-child(odd)");
      const columns = isWide ? 1 : Number(grid?.className.slice(4) ?? 1);
      return PRINTED / columns - 40;
    };

    const redraw = (wanted = box.clientWidth) => {
      width = Math.max(wanted, 200);
      const [from, to] = extent();
      shown = plot.curves.filter((curve) => !hidden.has(`${group} ${curve.key}`));
      shown = shown.map((curve) => ({ ...curve, xs: column(curve.x), ys: column(curve.y) }));
      const limits = range(from, to), [low, high] = limits;
      const labels = ticks(low, high, plot.log ? 5 : Math.max(2, Math.floor(plot.height / 38)), plot.log);
      left = Math.max(34, 13 + LETTER * Math.max(0, ...labels.map(([, label]) => label.length)));
      // If a name would take more than a third of the width, long names are only in the legend.
      const isLong = ({ length }) => length > 5 && LETTER * length > (width - left) / 3;
      let names = ends(to, limits);
      if (names.some(([name]) => isLong(name))) names = names.filter(([name]) => name.length <= 5);
      const longest = Math.max(0, ...names.map(([name]) => name.length));
      right = width - Math.max(RIGHT, longest && LETTER * longest + 8);
      sx = scale(from, to, left, right, axis.log);
      sy = scale(low, high, bottom, TOP, plot.log);
      svg.replaceChildren();
      svg.setAttribute("viewBox", `0 0 ${width} ${plot.height}`);
      labels.forEach(([value, label]) => {
        draw(svg, "path", { class: "grid", d: `M${left} ${sy.at(value)}H${right}` });
        draw(svg, "text", { x: left - 6, y: sy.at(value) + 4, "text-anchor": "end" }, label);
      });
      ticks(from, to, Math.max(2, Math.floor((width - left) / 62)), axis.log).forEach(([value, label]) => {
        const x = sx.at(value), half = (LETTER * label.length) / 2;
        draw(svg, "path", { class: "grid", d: `M${x} ${TOP}V${bottom}` });
        draw(svg, "text", { x: Math.min(x, width - half), y: plot.height - 7, "text-anchor": "middle" }, label);
      });
      // An inner svg element of the frame's size cuts off the parts of curves outside the frame.
      const size = { x: left, y: TOP, width: right - left, height: bottom - TOP };
      const area = draw(svg, "svg", { ...size, viewBox: `${left} ${TOP} ${size.width} ${size.height}` });
      const marks = (plot.marks ?? []).filter(({ x }) => x === undefined || (x >= from && x <= to));
      marks.forEach(({ x, y }) => {
        const d = x === undefined ? `M${left} ${sy.at(y)}H${right}` : `M${sx.at(x)} ${TOP}V${bottom}`;
        draw(area, "path", { class: "mark", d });
      });
      const top = [], foot = [];  // of the texts at the upper and at the lower edge, the ends of each
      const leaving = [];
      shown.forEach((curve) => {
        const { path, outside } = trace(curve, from, to, limits);
        const only = curve.dots === "only" ? " only" : "";
        draw(area, "path", { class: `curve ${curve.style}${only}`, d: path });
        if (curve.dots) point(area, curve, from, to);
        if (outside >= 0 && !plot.log) leaving.push({ ...curve, first: outside });
      });
      leave(area, leaving, limits, top, foot);
      label(area, shown.filter(({ beside }) => beside && !names.some(([name]) => name === beside)), from, to, limits);
      nameEnds(names);
      marks.filter((mark) => mark.text).forEach((mark) => describe(area, mark, top, foot));
      draw(svg, "path", { class: "axis", d: `M${left} ${TOP}V${bottom}H${right}` });
      cursor = draw(svg, "g", { class: "cursor" });
      read(here, false);
    };

    const point = (area, { xs, ys, style }, from, to) => {
      for (let i = 0; i < xs.length; i++) {
        if (!(xs[i] >= from && xs[i] <= to && Number.isFinite(ys[i])) || (plot.log && ys[i] <= 0)) continue;
        draw(area, "circle", { class: style, cx: sx.at(xs[i]).toFixed(1), cy: sy.at(ys[i]).toFixed(1), r: 3 });
      }
    };

    // (text, value at the right edge) of the curves with a text that reach the right edge within the frame.
    const ends = (to, [low, high]) => shown.filter(({ beside }) => beside).map(({ xs, ys, beside }) => {
      let i = xs.findIndex((x) => x >= to);
      if (i < 0 && to - xs[xs.length - 1] <= 1e-6 * Math.abs(to)) i = xs.length - 1;  // single precision
      const share = i > 0 ? Math.min((to - xs[i - 1]) / (xs[i] - xs[i - 1]), 1) : 1;
      return [beside, i > 0 ? ys[i - 1] + share * (ys[i] - ys[i - 1]) : ys[i]];
    }).filter(([, value]) => value >= low && value <= high);

    // Draws these texts to the right of the frame, where no curve is, at least a line of text apart.
    const nameEnds = (names) => {
      const placed = names.map(([name, value]) => [name, sy.at(value) + 4]).sort((one, other) => one[1] - other[1]);
      placed.forEach((place, i) => {
        if (i) place[1] = Math.max(place[1], placed[i - 1][1] + LINE);
      });
      let lowest = bottom + 4;
      placed.reverse().forEach((place) => {
        place[1] = Math.min(place[1], lowest);
        lowest = place[1] - LINE;
      });
      placed.forEach(([name, y]) => draw(svg, "text", { class: "quiet", x: right + 6, y }, name));
    };

    // Draws the texts of other curves above or below the ends of the curves, over all curves. If there is no room, a text
    // is left out.
    const label = (area, curves, from, to, [low, high]) => {
      const boxes = [];
      curves.forEach(({ xs, ys, beside }) => {
        let i = ys.length - 1;
        while (i >= 0 && !(xs[i] >= from && xs[i] <= to && ys[i] >= low && ys[i] <= high)) i--;
        if (i < 0) return;
        const length = LETTER * beside.length, end = Math.min(sx.at(xs[i]), right) - 4;
        const start = Math.max(end - length, left + 4);
        const isFree = (y) => y - 10 >= TOP && y + 2 <= bottom
          && !boxes.some((box) => Math.abs(box.y - y) < 13 && box.start < start + length && start < box.end);
        const y = [-5, 14, -19, 28].map((shift) => sy.at(ys[i]) + shift).find(isFree);
        if (y === undefined) return;
        boxes.push({ y, start, end: start + length });
        draw(area, "text", { class: "quiet", x: start + length, y, "text-anchor": "end" }, beside);
      });
    };

    // The first line of text at an edge of the frame in which a text covers no other text.
    const freeLine = (taken, from, to) => {
      let line = 0;
      while (taken.some((other) => other.line === line && other.from < to && from < other.to)) line++;
      taken.push({ line, from, to });
      return line;
    };

    // Draws, for a curve that leaves the vertical range, a text with its extreme value. Curves with the same extreme value
    // share a text.
    const leave = (area, curves, [, high], top, foot) => {
      const said = new Map();
      curves.forEach(({ xs, ys, name, first }) => {
        const isAbove = ys[first] > high, known = Array.from(ys).filter(Number.isFinite);
        const end = known.reduce((one, other) => (isAbove ? Math.max(one, other) : Math.min(one, other)));
        const far = `to ${text(end, 3)}`, others = said.get(`${isAbove} ${far}`);
        if (others) others.names.push(name);
        else said.set(`${isAbove} ${far}`, { isAbove, far, names: [name], start: sx.at(xs[first]) });
      });
      said.forEach(({ isAbove, far, names, start }) => {
        const content = `${isAbove ? "▲" : "▼"} ${names.join(", ")}: ${far}`, length = LETTER * content.length;
        const x = Math.max(Math.min(start + 6, right - length), left + 6);
        const line = freeLine(isAbove ? top : foot, x, x + length);
        const y = isAbove ? TOP + 12 + 14 * line : bottom - 6 - 14 * line;
        draw(area, "text", { class: "quiet", x, y }, content);
      });
    };

    // Draws the text of a mark. The text of a vertical mark is moved to another line if it would cover another text.
    const describe = (area, { x, y, text: content }, top, foot) => {
      if (x === undefined) {
        const at = sy.at(y) < TOP + 17 ? sy.at(y) + 14 : sy.at(y) - 5;  // below a mark at the upper edge
        draw(area, "text", { class: "quiet", x: left + 6, y: at }, content);
        return;
      }
      const length = LETTER * content.length, isLeft = sx.at(x) + length > right;
      const from = isLeft ? sx.at(x) - length : sx.at(x);
      // The text is at the lower edge if curves cross it at the upper edge, but not at the lower one.
      const isCrossed = (y) => shown.some(({ xs, ys }) => xs.some((value, i) => {
        const px = sx.at(value);
        return px >= from && px <= from + length && Math.abs(sy.at(ys[i]) - y) < 9;
      }));
      const isBelow = isCrossed(TOP + 8) && !isCrossed(bottom - 10);
      const line = freeLine(isBelow ? foot : top, from, from + length);
      const height = isBelow ? bottom - 6 - 14 * line : TOP + 12 + 14 * line;
      const place = { x: sx.at(x) + (isLeft ? -5 : 5), y: height, "text-anchor": isLeft ? "end" : "start" };
      draw(area, "text", { class: "quiet", ...place }, content);
    };

    // Shows the values of all curves at a value of x. The plot that has the pointer or the keys (`isMine`) also shows
    // them in a box.
    const read = (value, isMine) => {
      here = value;
      cursor.replaceChildren();
      const [from, to] = extent(), isShown = value !== null && value >= from && value <= to && shown.length > 0;
      tip.hidden = !(isMine && isShown);
      if (output) output.textContent = "";
      if (!isShown) return;
      draw(cursor, "path", { d: `M${sx.at(value)} ${TOP}V${bottom}` });
      const rows = shown.map(({ xs, ys, style, name }) => {
        const i = nearest(xs, ys, value), y = i < 0 ? NaN : ys[i];
        const place = plot.log && y <= 0 ? NaN : sy.at(y);
        if (place >= TOP && place <= bottom) draw(cursor, "circle", { class: style, cx: sx.at(xs[i]), cy: place, r: 3.5 });
        return { style, name, y };
      });
      if (output && rows.length < 4) output.textContent = rows.map(({ y }) => text(y)).join("  ·  ");
      svg.setAttribute("aria-valuenow", Number(value.toPrecision(6)));
      const values = rows.map(({ name, y }) => `${name} ${text(y)}`).join(", ");
      svg.setAttribute("aria-valuetext", `${text(value)} ${axis.unit}: ${values}`);
      if (!isMine) return;
      tip.replaceChildren();
      make(tip, "b", "", `${axis.symbol} = ${text(value)} ${axis.unit}`);
      const table = make(tip, "table", "");
      rows.forEach(({ style, name, y }) => {
        const row = table.insertRow(), swatch = draw(row.insertCell(), "svg", { width: 18, height: 8 });
        draw(swatch, "path", { class: `curve ${style}`, d: "M0 4H18" });
        row.insertCell().textContent = name;
        row.insertCell().textContent = text(y, 5);
      });
      // The box is on the side with more room, beside the cursor.
      const x = sx.at(value), isRight = x > box.clientWidth / 2;
      tip.style.left = isRight ? "auto" : `${x + 14}px`;
      tip.style.right = isRight ? `${box.clientWidth - x + 14}px` : "auto";
    };

    // ---- Pointer and keys

    const together = () => plots.filter((other) => other.axis.name === axis.name);

    // Shows the values of all plots over the same quantity at the stored sample that is nearest to a value of x.
    const show = (wanted) => {
      let value = wanted;
      if (value !== null && shown.length > 0) {
        const { xs } = shown.reduce((one, other) => (other.xs.length > one.xs.length ? other : one));
        const place = nearest(xs, xs, value);
        if (place >= 0) value = xs[place];
      }
      together().forEach((other) => other.read(value, other.box === box));
      if (axis.name === TIME && value !== null) document.dispatchEvent(new CustomEvent("plot-time", { detail: value }));
    };

    const zoom = (wanted) => {
      if (wanted) zooms[axis.name] = wanted;
      else delete zooms[axis.name];
      unzoom.hidden = !wanted;
      unzoom.onclick = () => zoom(null);
      if (wanted) unzoom.textContent = `${wanted.map((end) => text(end)).join(" to ")} ${axis.unit} · show all`;
      together().forEach((other) => other.redraw());
    };

    const place = (event) => {
      const rectangle = svg.getBoundingClientRect(), [from, to] = extent();
      return Math.min(Math.max(sx.value((event.clientX - rectangle.left) * (width / rectangle.width)), from), to);
    };

    let pressed = null, band = null;
    svg.addEventListener("pointerdown", (event) => {
      pressed = place(event);
      svg.setPointerCapture(event.pointerId);
      show(pressed);
    });
    svg.addEventListener("pointermove", (event) => {
      const value = place(event);
      show(value);
      if (pressed === null) return;
      const [start, end] = [sx.at(pressed), sx.at(value)].sort((one, other) => one - other);
      band ??= draw(svg, "rect", { class: "band", y: TOP, height: bottom - TOP });
      band.setAttribute("x", start);
      band.setAttribute("width", end - start);
    });
    const release = (event) => {
      const from = pressed, to = from === null || event.type === "pointercancel" ? null : place(event);
      band?.remove();
      pressed = band = null;
      if (to === null || Math.abs(sx.at(to) - sx.at(from)) <= DRAG) return;
      zoom([from, to].sort((one, other) => one - other));
    };
    svg.addEventListener("pointerup", release);
    svg.addEventListener("pointercancel", release);
    // The values stay if a finger leaves the plot. They vanish if a mouse leaves it.
    svg.addEventListener("pointerleave", (event) => {
      if (pressed === null && event.pointerType === "mouse") show(null);
    });
    svg.addEventListener("dblclick", () => zoom(null));
    full?.addEventListener("click", () => {
      full.setAttribute("aria-pressed", full.getAttribute("aria-pressed") !== "true");
      redraw();
    });
    svg.addEventListener("keydown", (event) => {
      if (shown.length === 0 || event.ctrlKey || event.altKey || event.metaKey) return;
      const [from, to] = extent(), at = here ?? from, { xs } = shown[0], step = event.shiftKey ? 20 : 1;
      const walk = (count) => show(xs[Math.min(Math.max(nearest(xs, xs, at) + count, 0), xs.length - 1)]);
      const widen = (factor) => {
        const [first, last] = axis.range;
        const wanted = [Math.max(first, at - factor * (at - from)), Math.min(last, at + factor * (to - at))];
        zoom(wanted[0] <= first && wanted[1] >= last ? null : wanted);
      };
      const keys = {
        ArrowLeft: () => walk(-step), ArrowRight: () => walk(step), Home: () => show(from), End: () => show(to),
        "+": () => widen(0.5), "-": () => widen(2), Escape: () => zoom(null),
      };
      if (!(event.key in keys)) return;
      keys[event.key]();
      event.preventDefault();
    });
    plots.push({ axis, box, redraw, read, printedWidth });
    redraw();
    // If the width changes, the drawing is made again and not scaled, so that its texts stay 12 px high.
    new ResizeObserver(() => {
      if (!isPrinting && box.clientWidth && Math.max(box.clientWidth, 200) !== width) redraw();
    }).observe(box);
  };

  const buttons = document.querySelectorAll("[data-group] button[data-curve]");
  const nameOf = (button) => `${button.closest("[data-group]").dataset.group} ${button.dataset.curve}`;
  buttons.forEach((button) => {
    if (button.getAttribute("aria-pressed") === "false") hidden.add(nameOf(button));
    button.addEventListener("click", () => {
      const name = nameOf(button), isOn = hidden.delete(name);
      if (!isOn) hidden.add(name);
      button.setAttribute("aria-pressed", isOn);
      plots.filter(({ box }) => button.closest("[data-group]").contains(box)).forEach((plot) => plot.redraw());
    });
  });
  document.documentElement.classList.add("live");
  document.querySelectorAll(".plot").forEach(start);
  const print = (isOn) => {
    isPrinting = isOn;
    plots.forEach((plot) => plot.redraw(isOn ? plot.printedWidth() : undefined));
  };
  window.addEventListener("beforeprint", () => print(true));
  window.addEventListener("afterprint", () => print(false));
  // The animation sends its time, and the map of a sweep sends the run that the reader chose.
  document.addEventListener("viewer-time", (event) => {
    plots.filter(({ axis }) => axis.name === TIME).forEach((plot) => plot.read(event.detail, false));
  });
  document.addEventListener("shown-run", (event) => {
    run = event.detail;
    plots.forEach((plot) => plot.redraw());
  });
})();
