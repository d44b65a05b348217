"use strict";
// Puts the page together: facts and curves from the page itself, everything else when it is near.

const byId = (id) => document.getElementById(id);

async function start() {
  const facts = JSON.parse(byId("facts").textContent);
  const data = await unpackColumns(byId("curve-block").textContent);
  byId("curve-block").remove();
  try {
    await loadScript("times");
    data.ms = Float32Array.from(handtrack.ms);
  } catch {
    notice("report_files is not beside this page: there are curves, but no pictures and layers.");
  }
  const app = new App(facts, data);
  handtrack.app = app;
  const asked = Number(location.hash.slice(1));
  await app.player.seek(Number.isInteger(asked) ? asked : 0);
  handtrack.ready = performance.now();
}

function notice(text) {
  byId("notice").textContent = text;
  byId("notice").hidden = false;
}

class App {
  constructor(facts, data) {
    this.facts = facts;
    this.data = data;
    LAYERS.at(-1).label = facts.cloud;
    this.layers = facts.truth ? [...LAYERS, TRUE_LAYER] : LAYERS;
    this.on = Object.fromEntries(this.layers.map((layer) => [layer.name, layer.on]));
    this.clip = new Clip(facts);
    if (this.clip.fault) notice(this.clip.fault);
    this.painter = new Painter(byId("picture"), facts);
    this.space = new SpacePlot(byId("space"), facts, data);
    this.digits = new Set([1]);
    this.joints = new Set([0, 2, 3]);
    this.head();
    this.player = new Player(this.clip, data.t, {
      shown: (frame) => this.shown(frame),
      moved: (k) => this.moved(k),
      failed: (error) => { notice(error.message); },
      changed: () => { byId("play").textContent = this.player.playing ? "❚❚" : "▶"; },
    });
    this.switches();
    this.curves = new Curves(byId("plots"), facts, data, (k) => this.player.seek(k), () => this.chosen());
    this.controls();
    new ResizeObserver(() => this.repaint()).observe(byId("stage"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.repaint());
  }

  head() {
    const { facts } = this;
    document.title = `${facts.clip} – handtrack`;
    byId("clip").textContent = facts.clip;
    byId("about").textContent = facts.about.join(" · ");
    byId("about").title = facts.about.join("\n");
  }

  // A frame has been fetched: paint all that hangs on it at once.
  shown(frame) {
    this.frame = frame;
    if (this.clip.fault) notice(this.clip.fault);
    this.repaint();
  }

  repaint() {
    if (!this.frame) return;
    const { k, layers } = this.frame, { data } = this;
    const truth = data.true_x && [data.true_x, data.true_y].map((c) => c.subarray(21 * k, 21 * k + 21));
    this.painter.paint(this.frame, this.on, truth || null);
    const line = this.space.paint(k, layers), kind = this.facts.kinds[layers.number("cloud_kind")];
    const size = layers.number("cloud_size"), drawn = layers.part("cloud", "cloud_weight").length;
    const what = { particles: "particles", samples: "samples, one digit each" }[kind] || "";
    byId("space-caption").textContent = what
      ? `${drawn < size ? `${drawn} of ` : ""}${size} ${what}` : "configuration space";
    const names = line[0] < 0 ? "–" : line.map((i) => this.facts.basis_names[i]).join(" to ") + " curled";
    this.readout(k, names);
    this.stamp(k);
  }

  stamp(k) {
    const status = this.facts.statuses[this.data.status[k]], stamp = byId("stamp");
    const style = getComputedStyle(document.documentElement);
    stamp.textContent = `${status} · ${this.data.t[k].toFixed(2)} s · #${this.data.frame[k]}`;
    stamp.style.background = style.getPropertyValue(`--${status}`);
    stamp.dataset.frame = k;
  }

  readout(k, line) {
    const { data, facts } = this, known = (x, unit = "") => (Number.isFinite(x) ? round(x) + unit : "–");
    const rows = [
      ["status", facts.sentences[data.status[k]]],
      ["hand", facts.sides[data.side[k]] || "–"],
      ["confidence", known(data.confidence[k])],
      ["sample size", known(data.ess[k])],
      [Number.isFinite(data.log_likelihood[k]) ? "log likelihood" : "energy",
        known(Number.isFinite(data.log_likelihood[k]) ? data.log_likelihood[k] : data.energy[k])],
      ["nearest line", line],
      ["time", data.ms ? known(data.ms[k], " ms") : "–"],
    ];
    if (data.keypoint_error) rows.push(["true keypoints", known(data.keypoint_error[k], " px off")]);
    byId("readout").replaceChildren(...rows.flatMap(([name, value]) => [
      element("dt", name), Object.assign(element("dd", value), { title: value })]));
  }

  // Another frame is asked for: the curves and the slider follow before the picture can.
  moved(k) {
    this.curves.mark(k);
    byId("slider").value = k;
    this.jointValues(k);
  }

  setLayer(name, on) {
    this.on[name] = on;
    byId("layers").querySelector(`[data-layer=${name}]`).setAttribute("aria-pressed", on);
    this.repaint();
  }

  setZoom(on) {
    this.painter.zoomed = on;
    document.querySelector("[data-zoom]").setAttribute("aria-pressed", on);
    this.repaint();
  }
}

function element(tag, text = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}
