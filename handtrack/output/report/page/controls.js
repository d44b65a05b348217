"use strict";
// Switches, choices and keys.

const DIGIT_NAMES = ["thumb", "index", "middle", "ring", "little"];
// Names of a digit's four angles: the fingers', then the thumb's where it is another.
const JOINTS = [["MCP flexion", "CMC flexion"], ["abduction", "abduction"], ["PIP", "MCP"], ["DIP", "IP"]];

Object.assign(App.prototype, {
  // The angles to show: one digit's in the colours of the joints, several digits' in their own.
  chosen() {
    const digits = [...this.digits].sort(), joints = [...this.joints].sort(), alone = digits.length === 1;
    const dashes = [null, [8, 3], [3, 3], [8, 3, 2, 3]];
    return digits.flatMap((digit) => joints.map((joint, j) => ({
      digit, joint, angle: 4 * digit + joint,
      paint: alone ? `--series${joint}` : `--digit${digit}`, dash: alone ? null : dashes[j],
    })));
  },

  switches() {
    const box = byId("layers");
    this.layers.forEach((layer, i) => {
      const button = toggle(layer.label, layer.on, layer.colour, String(i + 1));
      button.dataset.layer = layer.name;
      button.title = `${layer.label} (${i + 1})`;
      button.onclick = () => this.setLayer(layer.name, !this.on[layer.name]);
      box.append(button);
    });
    const zoom = toggle("Zoom", false, null, "z");
    zoom.dataset.zoom = "";
    zoom.title = "Follow the hand closely (z)";
    zoom.onclick = () => this.setZoom(!this.painter.zoomed);
    byId("transport").append(zoom);
    this.choose(byId("digits"), DIGIT_NAMES, this.digits, (i) => `--digit${i}`);
    this.choose(byId("joints"), JOINTS.map(([name]) => name), this.joints, (i) => `--series${i}`);
  },

  // A row of switches over a set of numbers of which one at least stays on. A click on a digit
  // chooses it alone, with Ctrl or Shift it adds to the others.
  choose(box, names, set, colour) {
    const single = set === this.digits;
    const all = single ? [...names, "all"] : names;
    const buttons = all.map((name, i) => {
      const button = toggle(name, set.has(i), i < names.length ? `var(${colour(i)})` : null);
      button.dataset.choice = name;
      if (single) button.title = "with Shift or Ctrl: beside the others";
      button.onclick = (event) => {
        const adds = !single || event.shiftKey || event.ctrlKey || event.metaKey;
        if (i === names.length) names.forEach((_, n) => set.add(n));
        else if (!adds) { set.clear(); set.add(i); }
        else if (!set.has(i)) set.add(i);
        else if (set.size > 1) set.delete(i);
        buttons.forEach((b, n) => b.setAttribute("aria-pressed",
          n < names.length ? set.has(n) : set.size === names.length));
        this.jointNames();
        this.curves.build();
        this.moved(this.player.k);
      };
      return button;
    });
    box.append(...buttons);
  },

  jointNames() {
    const thumb = this.digits.has(0), fingers = this.digits.size > (thumb ? 1 : 0);
    const alone = this.digits.size === 1;
    byId("joints").querySelectorAll("button").forEach((button, j) => {
      const [finger, own] = JOINTS[j];
      const name = !thumb || finger === own ? finger : fingers ? `${finger} (thumb ${own})` : own;
      button.querySelector(".name").textContent = name;
      button.querySelector(".swatch").style.display = alone ? "" : "none";
    });
  },

  // Beside each joint its angle in frame k, where one digit is chosen.
  jointValues(k) {
    const digit = [...this.digits][0];
    byId("joints").querySelectorAll("button").forEach((button, j) => {
      const theta = this.data[`theta${4 * digit + j}`][k], std = this.data[`std${4 * digit + j}`][k];
      const known = this.digits.size === 1 && Number.isFinite(theta);
      button.querySelector("kbd").textContent = known ? `${theta.toFixed(0)}° ±${(Z90 * std).toFixed(0)}` : "";
    });
  },

  controls() {
    const { player } = this;
    byId("slider").max = player.last;
    byId("slider").oninput = (event) => { player.pause(); player.seek(Number(event.target.value)); };
    byId("speed").onchange = (event) => {
      player.speed = Number(event.target.value);
      player.clock = null;
      event.target.blur();
    };
    const actions = {
      home: () => { player.pause(); player.seek(0); }, end: () => { player.pause(); player.seek(player.last); },
      back: () => player.step(-1), next: () => player.step(1), play: () => player.toggle(),
    };
    document.querySelectorAll("[data-do]").forEach((button) => { button.onclick = actions[button.dataset.do]; });
    byId("help-button").onclick = () => byId("help").showModal();
    this.keys(actions);
  },

  keys(actions) {
    const { player } = this, keys = {
      " ": [actions.play, "space", "play, pause"],
      ArrowRight: [actions.next, "→", "one frame on"],
      ArrowLeft: [actions.back, "←", "one frame back"],
      "Shift+ArrowRight": [() => player.step(10), "Shift →", "ten frames on"],
      "Shift+ArrowLeft": [() => player.step(-10), "Shift ←", "ten frames back"],
      Home: [actions.home, "Home", "first frame"],
      End: [actions.end, "End", "last frame"],
      z: [() => this.setZoom(!this.painter.zoomed), "z", "follow the hand closely"],
      "?": [() => byId("help").showModal(), "?", "these keys"],
    };
    this.layers.forEach((layer, i) => {
      keys[String(i + 1)] = [() => this.setLayer(layer.name, !this.on[layer.name]), String(i + 1), layer.label];
    });
    byId("keys").replaceChildren(...Object.values(keys).map(([, name, what]) => {
      const row = element("tr"), cell = element("td");
      cell.append(element("kbd", name));
      row.append(cell, element("td", what));
      return row;
    }));
    addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || byId("help").open) return;
      if (event.target.tagName === "SELECT") return;
      const plain = keys[event.key], shifted = keys[`Shift+${event.key}`];
      const found = event.shiftKey && shifted ? shifted : plain;
      if (!found) return;
      event.preventDefault();
      found[0]();
    });
  },
});

// A button that is on or off.
function toggle(label, on, colour, key = "") {
  const button = element("button");
  button.type = "button";
  button.setAttribute("aria-pressed", on);
  if (colour) {
    const swatch = element("span");
    swatch.className = "swatch";
    swatch.style.background = colour;
    button.append(swatch);
  }
  const name = element("span", label);
  name.className = "name";
  button.append(name, element("kbd", key));
  return button;
}

start();
