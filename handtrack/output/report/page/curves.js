"use strict";
// The curves, by uPlot: one tall plot of the chosen angles with their 90 % bands, and below it
// strips that share its axis of time. A click goes to a frame, a drag zooms, a double click undoes.

const Z90 = 1.6449; // 90 % of a normal distribution lie within so many standard deviations
const LEFT_AXIS = 50;

class Curves {
  // `data`: columns of the clip; `seek(k)` goes to a frame; `choice()`: angles to show.
  constructor(root, facts, data, seek, choice) {
    Object.assign(this, { root, facts, data, seek, choice, plots: [], k: 0, pending: 0 });
    this.range = this.whole();
    this.build();
    new ResizeObserver(() => this.build()).observe(root);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.build());
  }

  whole() {
    const t = this.data.t, last = t[t.length - 1];
    return [t[0], last > t[0] ? last : t[0] + 1];
  }

  // What stands below the angles: title, columns of data, unit, fixed range.
  strips() {
    const { data, facts } = this, any = (column) => column && column.some(Number.isFinite);
    const strips = [];
    if (facts.truth) strips.push({ name: "error", title: "error of these angles", unit: "°", tall: 1.4 });
    if (any(data.keypoint_error)) {
      strips.push({ name: "keypoints", title: "error of the keypoints", unit: " px", column: data.keypoint_error });
    }
    strips.push({ name: "status", title: "status" });
    strips.push({ name: "confidence", title: "confidence", unit: "", column: data.confidence, range: [0, 1] });
    if (any(data.ess)) {
      strips.push({ name: "ess", title: "effective sample size", unit: "", column: data.ess, zero: true });
    }
    if (any(data.energy)) {
      strips.push({ name: "energy", title: "energy (low fits well)", unit: "", column: data.energy, zero: true });
    }
    if (any(data.log_likelihood)) {
      strips.push({ name: "likelihood", title: "log likelihood of the best particle", unit: "", column: data.log_likelihood });
    }
    if (any(data.ms)) strips.push({ name: "ms", title: "time", unit: " ms", column: data.ms, range: [0, usualMost(data.ms)] });
    return strips;
  }

  build() {
    this.plots.forEach((plot) => plot.destroy());
    this.root.replaceChildren();
    this.style = getComputedStyle(document.documentElement);
    const strips = this.strips(), height = this.root.clientHeight || 600;
    const statusHeight = 26, axisHeight = 24;
    const shares = strips.reduce((sum, s) => sum + (s.name === "status" ? 0 : s.tall || 1), 0);
    const free = height - statusHeight - axisHeight - strips.length - 3;
    const each = Math.max(44, Math.min(78, (0.56 * free) / shares));
    const angles = { name: "angles", title: this.facts.truth ? "angles (dashed: true)" : "angles", unit: "°", height: Math.max(150, free - shares * each) };
    strips.forEach((s) => { s.height = s.name === "status" ? statusHeight : each * (s.tall || 1); });
    strips[strips.length - 1].height += axisHeight;
    this.specs = [angles, ...strips];
    this.specs.forEach((spec, i) => { spec.last = i === this.specs.length - 1; this.fill(spec); });
    this.plots = this.specs.map((spec) => this.plot(spec));
    this.mark(this.k);
  }

  // Columns, colours and modes of a plot's series.
  fill(spec) {
    const { data } = this, colour = (name) => this.style.getPropertyValue(name).trim();
    const line = (column, stroke, more = {}) => ({ column, stroke, mode: "both", width: 1.4, ...more });
    if (spec.column) spec.lines = [line(spec.column, colour("--accent"), { width: 1.1 })];
    else if (spec.name === "status") spec.lines = [line(new Float32Array(data.t.length), "transparent")];
    else if (spec.name === "error") {
      spec.lines = this.choice().map(({ angle, paint }) =>
        line(difference(data[`theta${angle}`], data[`truth${angle}`]), colour(paint), { width: 1.2 }));
    } else spec.lines = this.choice().flatMap((chosen) => this.angleLines(chosen, line, colour));
    if (!spec.lines.length) spec.lines = [line(new Float32Array(data.t.length).fill(NaN), "transparent")];
  }

  angleLines({ angle, paint, dash }, line, colour) {
    const { data } = this, theta = data[`theta${angle}`], std = data[`std${angle}`];
    const stroke = colour(paint), band = { width: 0, fill: `color-mix(in srgb, ${stroke} 20%, transparent)` };
    const lines = [
      line(theta.map((x, i) => x + Z90 * std[i]), stroke, { ...band, mode: "max", band: "high" }),
      line(theta.map((x, i) => x - Z90 * std[i]), stroke, { ...band, mode: "min", band: "low" }),
      line(theta, stroke, { dash }),
    ];
    const truth = data[`truth${angle}`];
    if (truth) {
      const dark = `color-mix(in srgb, ${stroke} 55%, ${colour("--ink")})`;
      lines.push(line(truth, dark, { dash: [5, 3], width: 1.6 }));
    }
    return lines;
  }

  plot(spec) {
    const frame = document.createElement("div");
    frame.className = "plot";
    frame.dataset.plot = spec.name;
    const title = document.createElement("div");
    title.className = "title";
    title.append(spec.title, " ", document.createElement("b"));
    frame.append(title);
    this.root.append(frame);
    const plot = new uPlot(this.options(spec), this.decimated(spec), frame);
    const marker = document.createElement("div");
    marker.className = "marker";
    plot.over.append(marker);
    Object.assign(plot, { spec, marker, value: title.querySelector("b") });
    this.listen(plot);
    return plot;
  }

  options(spec) {
    const soft = this.style.getPropertyValue("--soft").trim();
    const grid = { stroke: this.style.getPropertyValue("--line").trim(), width: 1 };
    const font = "11px system-ui, 'DejaVu Sans', sans-serif", status = spec.name === "status";
    const axis = { stroke: soft, grid, ticks: { ...grid, size: 4 }, font };
    return {
      width: this.root.clientWidth - 2,
      height: Math.round(spec.height),
      padding: [spec.name === "angles" ? 16 : status ? 14 : 15, 12, spec.last ? 0 : 4, 0],
      legend: { show: false },
      cursor: {
        y: false, points: { show: false }, sync: { key: "handtrack", scales: ["x", null] },
        drag: { x: true, y: false, setScale: false },
        bind: { dblclick: () => () => { this.zoom(this.whole()); return null; } },
      },
      scales: {
        x: { time: false, range: () => this.range },
        y: { range: (u, low, high) => rangeOf(spec, low, high) },
      },
      axes: [
        { ...axis, show: spec.last, size: 24, values: (u, v) => v.map((t) => `${round(t)} s`) },
        { ...axis, show: true, size: LEFT_AXIS, space: 22, gap: 3,
          values: (u, v) => v.map((y) => (status ? "" : round(y))),
          grid: { ...grid, show: !status }, ticks: { ...axis.ticks, show: !status } },
      ],
      series: [{}, ...spec.lines.map((s) => ({
        stroke: s.stroke, width: s.width, dash: s.dash, points: { show: false }, spanGaps: false,
      }))],
      bands: spec.lines.flatMap((s, i) => (s.band === "high" ? [{ series: [i + 1, i + 2], fill: s.fill }] : [])),
      hooks: {
        setSelect: [(u) => u.select.width > 4 && this.zoom([
          u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")])],
        draw: [(u) => this.place(u), ...(status ? [(u) => this.paintStatus(u)] : [])],
      },
    };
  }

  decimated(spec) {
    const [from, to] = this.range, pixels = Math.max(50, this.root.clientWidth - LEFT_AXIS - 14);
    const columns = spec.lines.map((s) => s.column), modes = spec.lines.map((s) => s.mode);
    return decimated(this.data.t, columns, modes, from, to, pixels);
  }

  zoom(range) {
    this.range = range;
    this.plots.forEach((plot) => {
      plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
      plot.setData(this.decimated(plot.spec));
    });
    this.mark(this.k);
  }

  listen(plot) {
    let down = 0;
    plot.over.addEventListener("mousedown", (event) => { down = event.clientX; });
    plot.over.addEventListener("click", (event) => {
      if (Math.abs(event.clientX - down) > 4) return;
      this.seek(this.nearest(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x")));
    });
  }

  nearest(time) {
    const t = this.data.t, i = Math.min(t.length - 1, lowerBound(t, time));
    return i > 0 && time - t[i - 1] < t[i] - time ? i - 1 : i;
  }

  // Show where frame k is, and the values there.
  mark(k) {
    this.k = k;
    for (const plot of this.plots) {
      this.place(plot);
      const { column, unit, name } = plot.spec;
      if (column) plot.value.textContent = Number.isFinite(column[k]) ? round(column[k]) + unit : "–";
      if (name === "status") plot.value.textContent = this.facts.statuses[this.data.status[k]];
    }
  }

  // Put a plot's line where the frame is.
  place(plot) {
    if (!plot.marker) return;
    const time = this.data.t[this.k], inside = time >= this.range[0] && time <= this.range[1];
    plot.marker.style.display = inside ? "" : "none";
    plot.marker.style.transform = `translateX(${plot.valToPos(time, "x")}px)`;
  }

  // A strip in the colours of the statuses; of several frames on one pixel the worst shows.
  paintStatus(u) {
    const { ctx, bbox } = u, { t, status } = this.data, colours = this.facts.statuses.map((name) =>
      this.style.getPropertyValue(`--${name}`).trim());
    const [first, end] = rowsWithin(t, ...this.range), step = window.devicePixelRatio || 1;
    const ends = [];
    for (let i = first; i < end; i++) ends.push(u.valToPos(t[Math.min(i + 1, t.length - 1)], "x", true));
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    let x = u.valToPos(t[first], "x", true), worst = 0;
    for (let i = first; i < end; i++) {
      worst = Math.max(worst, status[i]);
      const to = i === end - 1 ? Math.max(ends[i - first], x + step) : ends[i - first];
      if (to - x < step) continue;
      ctx.fillStyle = colours[worst];
      ctx.fillRect(x, bbox.top, to - x + 0.5, bbox.height);
      x = to;
      worst = 0;
    }
    ctx.restore();
  }
}

// A range that holds all but the few greatest values (a first frame that compiles, say).
function usualMost(column) {
  const sorted = Array.from(column).filter(Number.isFinite).sort((a, b) => a - b);
  return 1.4 * (sorted[Math.floor(0.985 * (sorted.length - 1))] || 1);
}

function difference(found, truth) { return found.map((x, i) => Math.abs(x - truth[i])); }

function rangeOf(spec, low, high) {
  if (spec.range) return spec.range;
  if (spec.name === "status" || !Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  // a band that says "unknown" shall not flatten the curves
  if (spec.name === "angles") { low = Math.max(low, -90); high = Math.min(high, 180); }
  const from = spec.zero || spec.name === "error" || spec.name === "keypoints" ? Math.min(0, low) : low;
  const margin = 0.05 * Math.max(high - from, 1e-3);
  return [from < 0 || from !== 0 ? from - margin : 0, high + margin];
}

// A number with as many digits as it deserves.
function round(value) {
  const size = Math.abs(value);
  const digits = size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
  return String(Number(value.toFixed(digits)));
}
