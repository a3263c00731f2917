"use strict";
(() => {
  // Draws the animation of the rotor from the data of each element .viewer on the page. Angles of a frame: rotor, then the
  // pitch of each blade.
  const RING = 72, ARC = 0.06, TRAIL = 20000;
  const VIEWS = { oblique: [-62, 14], front: [-90, 0], side: [0, 0], top: [-90, 89] };
  const shades = getComputedStyle(document.documentElement), night = matchMedia("(prefers-color-scheme:dark)");
  const shade = (name) => shades.getPropertyValue(`--${name}`).trim();

  // The angles at a place between two frames, which may be fractional. Angles are not reduced to one turn, so that they
  // can be interpolated linearly.
  const between = (frames, place) => {
    const last = frames.length - 1, i = Math.min(Math.floor(place), last), j = Math.min(i + 1, last), part = place - i;
    return frames[i].map((from, k) => from + part * (frames[j][k] - from));
  };

  // The number of points of a tip's path for each interval between frames. It is so large that the blade turns by at most
  // ARC from a point to the next, or by more if the whole path would have more than about TRAIL points.
  const sections = (frames, column) => {
    const ways = frames.slice(1).map((to, i) => Math.abs(to[0] - frames[i][0]) + Math.abs(to[column] - frames[i][column]));
    const arc = Math.max(ARC, ways.reduce((sum, way) => sum + way, 0) / TRAIL);
    return ways.map((way) => Math.max(1, Math.ceil(way / arc)));
  };

  const aboutX = (angle, [x, y, z]) => {
    const c = Math.cos(angle), s = Math.sin(angle);
    return angle ? [x, c * y - s * z, s * y + c * z] : [x, y, z];
  };

  // The position of a point of a blade: Rx(tilt) Ry(rotor + phase) Rx(-cone) Rz(pitch) times the point, with its distance
  // from the pitch axis magnified.
  const placed = (point, blade, tilt, rotor, pitch, magnified) => {
    const c = Math.cos(pitch), s = Math.sin(pitch), x = point[0] * magnified, y = point[1] * magnified;
    const a = Math.cos(rotor + blade.phase), b = Math.sin(rotor + blade.phase);
    const [u, v, w] = aboutX(-blade.cone, [c * x - s * y, s * x + c * y, point[2]]);
    return aboutX(tilt, [a * u + b * w, v, -b * u + a * w]);
  };

  const start = (box) => {
    const data = JSON.parse(box.querySelector("script").textContent), models = data.models;
    const canvas = box.querySelector("canvas"), pen = canvas.getContext("2d");
    const part = (name) => box.querySelector(`[data-part=${name}]`);
    const reach = Math.max(...data.blades.map((blade) => Math.hypot(...blade.tip)));
    const end = (Math.max(...models.map((one) => one.frames.length)) - 1) * data.step;
    let now = 0, told = 0, playing = false, before = 0, [azimuth, elevation] = VIEWS.oblique, trails = [], waiting = false;

    const value = (name, otherwise) => (part(name) ? part(name).value : otherwise);
    const magnified = () => Number(value("offset", 1));

    // Computes the points of the path of each blade's tip, and their times, for each model.
    const trace = () => {
      trails = models.map(({ frames }) => data.blades.map((blade, i) => {
        const points = [], times = [];
        const add = (place) => {
          const angles = between(frames, place);
          points.push(placed(blade.tip, blade, data.tilt, angles[0], angles[i + 1], magnified()));
          times.push(place * data.step);
        };
        add(0);
        sections(frames, i + 1).forEach((count, frame) => {
          for (let k = 1; k <= count; k++) add(frame + k / count);
        });
        return { points, times };
      }));
    };

    const camera = (centre, scale) => {
      const a = (azimuth * Math.PI) / 180, e = (elevation * Math.PI) / 180;
      const right = [-Math.sin(a), Math.cos(a), 0];
      const up = [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)];
      const near = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
      const dot = (p, q) => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
      return { at: (p) => [centre[0] + scale * dot(p, right), centre[1] - scale * dot(p, up)], depth: (p) => dot(p, near) };
    };

    const line = (see, points, colour, width, dashes = []) => {
      pen.beginPath();
      points.forEach((point, i) => pen[i ? "lineTo" : "moveTo"](...see.at(point)));
      Object.assign(pen, { strokeStyle: colour, lineWidth: width, lineJoin: "round", lineCap: "round" });
      pen.setLineDash(dashes);
      pen.stroke();
    };

    const room = (see) => {
      const ring = Array.from({ length: RING + 1 }, (_, i) => (2 * Math.PI * i) / RING);
      const tilted = (points) => points.map((point) => aboutX(data.tilt, point));
      line(see, tilted(ring.map((w) => [reach * Math.sin(w), 0, reach * Math.cos(w)])), shade("ring"), 1);
      line(see, tilted([[0, 0, 0], [0, -0.3 * reach, 0]]), shade("grey"), 6);
    };

    const paths = (see, index, plain) => {
      trails[index].forEach(({ points, times }, i) => {
        const colour = shade(data.colours[i]), dashes = plain ? [4, 3] : [];
        const after = times.findIndex((time) => time > now);
        pen.globalAlpha = 0.18;
        line(see, points, colour, 1, dashes);
        pen.globalAlpha = plain ? 0.6 : 0.9;
        line(see, after < 0 ? points : points.slice(0, after), colour, 1.4, dashes);
      });
      pen.globalAlpha = 1;
    };

    const blades = (see, index, plain) => {
      const angles = between(models[index].frames, now / data.step), m = magnified();
      canvas.dataset[`angles${index}`] = angles.join(" ");
      const drawn = data.blades.map((blade, i) => {
        const put = (point) => placed(point, blade, data.tilt, angles[0], angles[i + 1], m);
        const tip = put(blade.tip), root = put([blade.tip[0], blade.tip[1], 0.06 * reach]);
        return { i, tip, root, axis: put([0, 0, blade.tip[2]]), mass: put(blade.mass), depth: see.depth(tip) };
      });
      drawn.sort((one, other) => one.depth - other.depth).forEach(({ i, tip, root, axis, mass }) => {
        const colour = shade(data.colours[i]);
        if (!plain) {
          pen.beginPath();
          [[0, 0, 0], axis, tip, root].forEach((point, k) => pen[k ? "lineTo" : "moveTo"](...see.at(point)));
          pen.globalAlpha = 0.35;
          pen.fillStyle = colour;
          pen.fill();
          pen.globalAlpha = 1;
        }
        line(see, [[0, 0, 0], axis], colour, plain ? 1 : 1.5, plain ? [5, 4] : []);
        line(see, [[0, 0, 0], root, tip, axis], colour, plain ? 1.5 : 2.5, plain ? [5, 4] : []);
        [[mass, 4], [tip, 2.5]].forEach(([point, size]) => {
          pen.beginPath();
          pen.arc(...see.at(point), size, 0, 2 * Math.PI);
          pen.fillStyle = plain ? shade("card") : colour;
          pen.fill();
          pen.setLineDash([]);
          Object.assign(pen, { strokeStyle: colour, lineWidth: 1.5 });
          pen.stroke();
        });
      });
      pen.beginPath();
      pen.arc(...see.at([0, 0, 0]), 6, 0, 2 * Math.PI);
      pen.fillStyle = shade("ink");
      pen.fill();
    };

    const label = (index, x, y, dashed) => {
      const one = models[index], last = (one.frames.length - 1) * data.step, over = now > last + 0.5 * data.step;
      pen.font = "600 14px system-ui, sans-serif";
      pen.fillStyle = over ? shade("bad") : shade("ink");
      const text = `${one.name}${dashed ? ` (${box.dataset.dashed})` : ""}`;
      pen.fillText(over ? `${text}: ${box.dataset.ended} ${last.toFixed(2)} s` : text, x, y);
    };

    const draw = () => {
      const width = canvas.clientWidth, over = models.length > 1 && value("mode", "side") === "over";
      const views = over ? 1 : models.length, stacked = views > 1 && width < 300;
      const across = stacked ? 1 : views, down = stacked ? views : 1;
      const cell = [width / across, Math.min(width / across, 400)], height = cell[1] * down + 8;
      const sharp = window.devicePixelRatio || 1;
      if (canvas.width !== Math.round(width * sharp) || canvas.height !== Math.round(height * sharp)) {
        canvas.style.height = `${height}px`;
        canvas.width = Math.round(width * sharp);
        canvas.height = Math.round(height * sharp);
      }
      pen.setTransform(sharp, 0, 0, sharp, 0, 0);
      pen.clearRect(0, 0, width, height);
      const scale = (0.5 * Math.min(cell[0], cell[1] - 36)) / (1.04 * reach);
      for (let view = 0; view < views; view++) {
        const x = stacked ? 0 : view * cell[0], y = stacked ? view * cell[1] : 0;
        const see = camera([x + cell[0] / 2, y + 32 + (cell[1] - 36) / 2], scale);
        const shown = over ? [0, 1] : [view];
        room(see);
        shown.forEach((index) => paths(see, index, over && index === 0));
        shown.forEach((index) => blades(see, index, over && index === 0));
        shown.forEach((index, row) => label(index, x + 6, y + 16 + 18 * row, over && index === 0));
      }
      part("time").value = Math.round((1000 * now) / end);
      part("time").setAttribute("aria-valuetext", `${now.toFixed(2)} s`);
      part("clock").textContent = `${now.toFixed(2)} s`;
      if (part("offset")) part("times").textContent = `×${magnified()}`;
    };

    const frame = (stamp) => {
      waiting = false;
      if (playing) {
        if (before) now += ((stamp - before) / 1000) * Number(value("speed", 1));
        before = stamp;
        if (now >= end) {
          now = end;
          play(false);
        }
      }
      draw();
      // The plots of the page then show their values at the same time.
      if (now !== told) document.dispatchEvent(new CustomEvent("viewer-time", { detail: now }));
      told = now;
      if (playing) refresh();
    };

    const refresh = () => {
      if (!waiting) requestAnimationFrame(frame);
      waiting = true;
    };

    const play = (on) => {
      playing = on;
      before = 0;
      if (on && now >= end) now = 0;
      part("play").textContent = on ? box.dataset.pause : box.dataset.play;
      refresh();
    };

    const seek = (time) => {
      now = Math.min(Math.max(time, 0), end);
      refresh();
    };

    const turn = (right, up) => {
      azimuth = (azimuth - right) % 360;
      elevation = Math.min(Math.max(elevation + up, -89), 89);
      refresh();
    };

    document.addEventListener("plot-time", (event) => {
      if (playing) return;
      seek(event.detail);
      told = now;
    });
    part("play").addEventListener("click", () => play(!playing));
    part("time").addEventListener("input", (event) => seek((end * event.target.value) / 1000));
    if (part("mode")) part("mode").addEventListener("input", refresh);
    if (part("offset")) part("offset").addEventListener("input", () => { trace(); refresh(); });
    box.querySelectorAll("[data-view]").forEach((button) => button.addEventListener("click", () => {
      [azimuth, elevation] = VIEWS[button.dataset.view];
      refresh();
    }));

    let held = null;
    canvas.addEventListener("pointerdown", (event) => {
      held = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      turn((event.clientX - held[0]) * 0.4, (event.clientY - held[1]) * 0.4);
      held = [event.clientX, event.clientY];
    });
    ["pointerup", "pointercancel"].forEach((name) => canvas.addEventListener(name, () => { held = null; }));

    const keys = {
      ArrowLeft: () => turn(-5, 0), ArrowRight: () => turn(5, 0), ArrowUp: () => turn(0, 5), ArrowDown: () => turn(0, -5),
      " ": () => play(!playing), Home: () => seek(0), End: () => seek(end),
      ",": () => seek(now - data.step), ".": () => seek(now + data.step),
    };
    canvas.addEventListener("keydown", (event) => {
      if (!(event.key in keys) || event.ctrlKey || event.altKey || event.metaKey) return;
      keys[event.key]();
      event.preventDefault();
    });

    box.hidden = false;
    trace();
    new ResizeObserver(refresh).observe(canvas);
    night.addEventListener("change", refresh);
    refresh();
  };

  document.querySelectorAll(".viewer").forEach(start);
})();
