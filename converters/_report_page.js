// What the page does: views, colours, legends, sorting and selecting. All texts are set as text, never as HTML.
(() => {
  "use strict";
  const SVG = "http://www.w3.org/2000/svg";
  const page = JSON.parse(document.getElementById("page-data").textContent);
  const maps = Object.fromEntries(Object.entries(page.maps).map(([name, anchors]) => [name, View.table(anchors)]));
  const MODES = {
    deviation: { title: "deviation, mm", map: "signed", key: "deviation" },
    distance: { title: "distance, mm", map: "magnitude", key: "deviation", absolute: true },
    mean: { title: "mean curvature, 1/mm", map: "signed", key: "mean", quantile: 0.98 },
    gaussian: { title: "Gaussian curvature, 1/mm\u00b2", map: "signed", key: "gaussian", quantile: 0.98 },
    zebra: { number: 2 },
    plain: { number: 0 },
  };

  // --- the scene as it is kept in the page ---

  function bytes(text) {
    const raw = atob(text), found = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) found[i] = raw.charCodeAt(i);
    return found.buffer;
  }

  function unpacked(data) {
    const total = data.faces.reduce((sum, face) => sum + face.count, 0);
    const scene = {
      places: new Float32Array(3 * total), normals: new Int16Array(4 * total), owners: new Float32Array(total),
      triangles: new Uint32Array(data.faces.reduce((sum, face) => sum + face.triangles_count * 3, 0)),
      values: {}, lines: [], box: data.box, names: data.faces.map((face) => face.name), middles: [],
    };
    for (const key of ["deviation", "mean", "gaussian"]) scene.values[key] = new Float32Array(total).fill(View.UNKNOWN);
    let first = 0, next = 0;
    data.faces.forEach((face, number) => {
      scene.places.set(new Float32Array(bytes(face.places)), 3 * first);
      scene.normals.set(new Int16Array(bytes(face.normals)), 4 * first);
      scene.owners.fill(number, first, first + face.count);
      const triangles = face.count > 65535 ? new Uint32Array(bytes(face.triangles)) : new Uint16Array(bytes(face.triangles));
      for (const corner of triangles) scene.triangles[next++] = first + corner;
      for (const [key, text] of Object.entries(face.values)) {
        const values = new Float32Array(bytes(text));
        for (let i = 0; i < values.length; i++) scene.values[key][first + i] = Number.isFinite(values[i]) ? values[i] : View.UNKNOWN;
      }
      first += face.count;
    });
    for (const group of data.lines) scene.lines.push(segments(group));
    return scene;
  }

  function segments(group) { // polylines as pieces with the length before and after each
    const points = new Float32Array(bytes(group.points));
    const count = group.lengths.reduce((sum, length) => sum + Math.max(0, length - 1), 0);
    const made = { from: new Float32Array(3 * count), to: new Float32Array(3 * count), along: new Float32Array(count), reach: new Float32Array(count) };
    let at = 0, k = 0;
    for (const length of group.lengths) {
      let along = 0;
      for (let i = 0; i < length - 1; i++, k++) {
        const p = points.subarray(3 * (at + i), 3 * (at + i) + 3), q = points.subarray(3 * (at + i) + 3, 3 * (at + i) + 6);
        made.from.set(p, 3 * k);
        made.to.set(q, 3 * k);
        made.along[k] = along;
        along += Math.hypot(q[0] - p[0], q[1] - p[1], q[2] - p[2]);
        made.reach[k] = along;
      }
      at += length;
    }
    return Object.assign(made, { kind: group.kind, colour: group.colour, width: group.width, dash: group.dash });
  }

  // --- one view ---

  function viewer(section) {
    const data = JSON.parse(section.querySelector("script.scene").textContent);
    const canvas = section.querySelector("canvas"), context = canvas.getContext("2d"), triad = section.querySelector(".triad");
    const legend = section.querySelector(".legend"), summary = section.querySelector(".selected");
    const hint = summary.textContent;
    const toggles = [...section.querySelectorAll("button[data-lines]")];
    const colours = [...section.querySelectorAll("button[data-mode]")];
    const tolerance = section.querySelector("button[data-tolerance]");
    const state = { mode: colours.find((one) => one.getAttribute("aria-pressed") === "true").dataset.mode, chosen: null, mark: null, row: null };
    let scene = null, eye = null, waiting = false, look = null;

    function start() {
      if (scene) return;
      scene = unpacked(data);
      eye = View.camera(scene.box);
      fit();
      recolour();
    }

    function fit() { // the whole scene from where the eye is
      const box = canvas.getBoundingClientRect(), corners = [];
      for (let k = 0; k < 8; k++) for (let i = 0; i < 3; i++) corners.push(((k >> i) & 1 ? 0.5 : -0.5) * scene.box.size[i]);
      Object.assign(eye, { x: 0, y: 0, zoom: 1 });
      const seen = View.projected(scene, eye, box.width, box.height, Float32Array.from(corners)), k = View.scaleOf(eye, box.width, box.height);
      const reach = [box.width, box.height].map((side, axis) => (2 * Math.max(...seen.filter((_, i) => i % 3 === axis).map((x) => Math.abs(x - side / 2)))) / k);
      const shorter = Math.min(box.width, box.height) / eye.size;
      eye.zoom = 0.86 * Math.min(box.width / Math.max(reach[0], 1e-9), box.height / Math.max(reach[1], 1e-9)) / shorter;
    }

    function limits(mode, values) {
      const known = [];
      for (const value of values) if (value < 1e29) known.push(Math.abs(value));
      known.sort((a, b) => a - b);
      const largest = known.length ? known[mode.quantile ? Math.floor(mode.quantile * (known.length - 1)) : known.length - 1] : 0;
      const flat = mode.quantile ? 1e-9 : 1e-15;
      const end = mode.key === "deviation" && tolerance && tolerance.getAttribute("aria-pressed") === "true" ? data.tolerance : Math.max(largest, flat);
      return { range: [mode.absolute ? 0 : -end, end], beyond: known.length > 0 && known[known.length - 1] > 1.001 * end };
    }

    function recolour() {
      const mode = MODES[state.mode], shown = (group) => toggles.every((one) => one.dataset.lines !== group.kind || one.getAttribute("aria-pressed") === "true");
      const values = mode.key ? scene.values[mode.key] : new Float32Array(scene.owners.length);
      const drawn = mode.absolute ? values.map((value) => (value < 1e29 ? Math.abs(value) : value)) : values;
      const { range, beyond } = mode.key ? limits(mode, values) : { range: [0, 1], beyond: false };
      look = { mode: mode.key ? 1 : mode.number, range, values: drawn, colours: maps[mode.map || "signed"], shown };
      drawLegend(mode, range, beyond);
      redraw();
    }

    function drawLegend(mode, range, beyond) {
      legend.replaceChildren();
      if (!mode.key) return;
      const anchors = page.maps[mode.map], svg = node("svg", { viewBox: "0 0 240 44", role: "img", "aria-label": `${mode.title}: ${number(range[0])} to ${number(range[1])}` });
      const gradient = node("linearGradient", { id: `colours-${section.id}` });
      anchors.forEach((colour, k) => gradient.append(node("stop", { offset: k / (anchors.length - 1), "stop-color": colour })));
      svg.append(gradient, node("rect", { x: 10, y: 16, width: 220, height: 10, fill: `url(#colours-${section.id})`, stroke: "#666" }));
      const title = node("text", { x: 120, y: 11, "text-anchor": "middle" });
      title.textContent = mode.title + (beyond ? " (some beyond)" : "");
      svg.append(title);
      for (const t of [0, 0.5, 1]) {
        const label = node("text", { x: 10 + 220 * t, y: 40, "text-anchor": ["start", "middle", "end"][2 * t] });
        label.textContent = number(range[0] + t * (range[1] - range[0]));
        svg.append(label);
      }
      legend.append(svg);
    }

    function redraw() {
      if (waiting || !scene) return;
      waiting = true;
      requestAnimationFrame(() => { waiting = false; paint(); });
    }

    function paint() {
      const ratio = Math.min(2, window.devicePixelRatio || 1), box = canvas.getBoundingClientRect();
      const fine = View.renderer().name === "WebGL" ? ratio : 1;
      const width = Math.max(1, Math.round(box.width * fine)), height = Math.max(1, Math.round(box.height * fine));
      look.faded = Float32Array.from(scene.owners, (face) => (state.chosen && !state.chosen.has(face) ? 1 : 0));
      const picture = View.drawn(scene, eye, look, width, height);
      section.dataset.renderer = View.renderer().name;
      if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
      context.drawImage(picture, 0, 0);
      if (state.mark) drawMark(width, height, fine);
      drawTriad();
    }

    function drawMark(width, height, ratio) {
      const [x, y] = View.projected(scene, eye, width, height, Float32Array.from(state.mark.point));
      const m = View.axes(eye), [dx, dy, dz] = state.mark.vector || [0, 0, 0];
      const way = [m[0] * dx + m[1] * dy, -(m[3] * dx + m[4] * dy + m[5] * dz)], length = Math.hypot(...way), whole = Math.hypot(dx, dy, dz);
      context.lineWidth = 2.5 * ratio;
      for (const [colour, extra] of [["#ffffff", 2.5], ["#000000", 0]]) {
        context.strokeStyle = colour;
        context.lineWidth = (2.5 + extra) * ratio;
        context.beginPath();
        context.arc(x, y, 7 * ratio, 0, 2 * Math.PI);
        if (length > 0.1 * whole) {
          const reach = (45 * ratio) / whole, [ex, ey] = [x + way[0] * reach, y + way[1] * reach], angle = Math.atan2(way[1], way[0]);
          context.moveTo(x, y);
          context.lineTo(ex, ey);
          for (const turn of [2.6, -2.6]) {
            context.moveTo(ex, ey);
            context.lineTo(ex + 9 * ratio * Math.cos(angle + turn), ey + 9 * ratio * Math.sin(angle + turn));
          }
        }
        context.stroke();
      }
    }

    function drawTriad() {
      const m = View.axes(eye);
      triad.replaceChildren();
      ["x", "y", "z"].forEach((name, k) => {
        const [x, y] = [30 + 20 * m[k], 30 - 20 * m[3 + k]];
        triad.append(node("line", { x1: 30, y1: 30, x2: x, y2: y, stroke: "#333", "stroke-width": 1.5 }));
        const label = node("text", { x: 30 + 26 * m[k], y: 34 - 26 * m[3 + k], "text-anchor": "middle" });
        label.textContent = name;
        triad.append(label);
      });
    }

    // --- selecting ---

    function select(row) {
      for (const old of section.querySelectorAll("tr.chosen")) old.classList.remove("chosen");
      for (const old of section.querySelectorAll("tr button.name[aria-pressed=true]")) old.setAttribute("aria-pressed", "false");
      state.row = row;
      state.mark = null;
      state.chosen = null;
      summary.replaceChildren();
      if (!row) {
        summary.textContent = hint;
        redraw();
        return;
      }
      row.classList.add("chosen");
      const button = row.querySelector("button.name");
      if (button) button.setAttribute("aria-pressed", "true");
      const faces = (row.dataset.faces || "").split(" ").filter(Boolean).map(Number);
      state.chosen = faces.length ? new Set(faces) : null;
      if (row.dataset.point) state.mark = { point: JSON.parse(row.dataset.point).map((x, k) => x - data.box.middle[k]), vector: row.dataset.vector ? JSON.parse(row.dataset.vector) : null };
      describe(row);
      redraw();
    }

    function face() { // the eye towards what is chosen when that looks away
      const sum = [0, 0, 0];
      let count = 0;
      scene.owners.forEach((owner, i) => {
        if (!state.chosen.has(owner)) return;
        for (let k = 0; k < 3; k++) sum[k] += scene.normals[4 * i + k] / 32767;
        count++;
      });
      const m = View.axes(eye), length = Math.hypot(...sum);
      const seen = (sum[0] * m[6] + sum[1] * m[7] + sum[2] * m[8]) / length;
      if (length < 0.3 * count || seen > 0.2) return; // it goes all the way round, or is seen
      const level = Math.hypot(sum[0], sum[1]);
      if (level > 0.05 * length) eye.azimuth = Math.atan2(sum[1], sum[0]);
      eye.elevation = Math.min(1.3, Math.max(-1.3, Math.atan2(sum[2], level) + 0.3));
      fit();
    }

    function describe(row) {
      const list = document.createElement("dl"), headings = [...row.closest("table").tHead.rows[0].cells];
      const cells = [...row.cells].map((cell, k) => [headings[k].dataset.label, cell]).filter(([, cell]) => cell.textContent.trim());
      cells.sort(([, a], [, b]) => rank(a) - rank(b));
      for (const [label, cell] of cells) {
        const term = document.createElement("dt"), value = document.createElement("dd"), figure = cell.querySelector("svg.histogram");
        term.textContent = label;
        if (figure) value.append(figure.cloneNode(true));
        else value.textContent = cell.innerText;
        list.append(term, value);
      }
      summary.append(list);
    }

    function rank(cell) { return cell.querySelector("svg.histogram") ? 3 : cell.cellIndex; } // after the deviation

    function rowOf(face) {
      const rows = [...section.querySelectorAll("tr[data-faces]")].filter((row) => row.dataset.faces.split(" ").includes(String(face)));
      return rows.sort((a, b) => a.dataset.faces.length - b.dataset.faces.length)[0] || null;
    }

    section.addEventListener("click", (event) => {
      const row = event.target.closest("tr[data-row]");
      if (!row || !section.contains(row) || window.getSelection().toString()) return;
      start();
      select(row === state.row ? null : row);
      if (state.chosen) face();
    });

    // --- buttons, pointers and keys ---

    for (const button of colours) button.addEventListener("click", () => {
      start();
      for (const other of colours) other.setAttribute("aria-pressed", String(other === button));
      state.mode = button.dataset.mode;
      recolour();
    });
    for (const button of [...toggles, ...(tolerance ? [tolerance] : [])]) button.addEventListener("click", () => {
      start();
      button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
      recolour();
    });
    const looks = { fit: null, top: [-Math.PI / 2, Math.PI / 2], front: [-Math.PI / 2, 0], right: [0, 0] };
    for (const button of section.querySelectorAll("button[data-view]")) button.addEventListener("click", () => {
      start();
      Object.assign(eye, eye.home);
      if (looks[button.dataset.view]) [eye.azimuth, eye.elevation] = looks[button.dataset.view];
      fit();
      redraw();
    });

    function turn(dx, dy) {
      eye.azimuth -= dx;
      eye.elevation = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, eye.elevation + dy));
      redraw();
    }
    function move(dx, dy) { // in pixels of the page
      const box = canvas.getBoundingClientRect(), k = View.scaleOf(eye, box.width, box.height);
      eye.x += dx / k;
      eye.y -= dy / k;
      redraw();
    }
    function zoom(factor) {
      eye.zoom = Math.min(1e4, Math.max(0.05, eye.zoom * factor));
      redraw();
    }
    const pointers = new Map();
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => {
      start();
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      if (pointers.size === 1) moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
      moved += Math.abs(dx) + Math.abs(dy);
      if (pointers.size === 2) {
        const other = [...pointers.entries()].find(([id]) => id !== event.pointerId)[1];
        const [old, now] = [before, [event.clientX, event.clientY]].map((p) => Math.hypot(p[0] - other[0], p[1] - other[1]));
        if (old > 0 && now > 0) zoom(now / old);
        move(dx / 2, dy / 2);
      } else if (event.shiftKey || event.buttons & 6) move(dx, dy);
      else turn(dx * 0.01, dy * 0.01);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointerup", (event) => {
      if (pointers.delete(event.pointerId) && moved < 5 && event.button === 0) {
        const box = canvas.getBoundingClientRect();
        const face = View.picked(scene, eye, box.width, box.height, event.clientX - box.left, event.clientY - box.top);
        const row = face < 0 ? null : rowOf(face);
        select(row);
        if (row) row.scrollIntoView({ block: "nearest" });
      }
    });
    canvas.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return; // else the page scrolls, until the view is clicked
      event.preventDefault();
      start();
      zoom(Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      const known = way || ["+", "=", "-", "Home", "Escape"].includes(event.key);
      if (!known || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      start();
      if (way && event.shiftKey) move(20 * way[0], 20 * way[1]);
      else if (way) turn(0.1 * way[0], 0.1 * way[1]);
      else if (event.key === "Escape") select(null);
      else if (event.key === "Home") { Object.assign(eye, eye.home); fit(); redraw(); }
      else zoom(event.key === "-" ? 1 / 1.2 : 1.2);
    });

    new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      start();
      redraw();
    }, { rootMargin: "300px" }).observe(canvas);
    new ResizeObserver(redraw).observe(canvas);
    window.addEventListener("beforeprint", () => { start(); paint(); });
  }

  // --- tables ---

  function sortable(table) {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => {
      const button = head.querySelector("button");
      if (button) button.addEventListener("click", () => {
        const sign = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
        for (const other of heads) if (other.querySelector("button")) other.setAttribute("aria-sort", "none");
        head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
        const key = (row) => row.cells[column].dataset.sort ?? row.cells[column].textContent;
        const rows = [...table.tBodies[0].rows].map((row) => [key(row), row]);
        rows.sort(([a], [b]) => sign * compared(a, b));
        table.tBodies[0].append(...rows.map(([, row]) => row));
      });
    });
  }

  function compared(a, b) {
    const [x, y] = [Number(a), Number(b)];
    if (a !== "" && b !== "" && !Number.isNaN(x) && !Number.isNaN(y)) return x - y;
    return a.localeCompare(b, "en", { numeric: true });
  }

  // --- small things ---

  function node(name, attributes) {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
  }

  function number(value) { return value === 0 ? "0" : Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5 ? value.toExponential(2) : String(Number(value.toPrecision(3))); }

  document.querySelectorAll("table.sortable").forEach(sortable);
  document.querySelectorAll("section.outcome").forEach((section) => { if (section.querySelector("script.scene")) viewer(section); });
  document.documentElement.dataset.ready = "yes";
})();
