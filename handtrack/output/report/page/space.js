"use strict";
// The configuration space seen along its first two components: the basis states, the lines between
// them, the cloud of this frame, the estimate with where it came from, and the line nearest to it.

const TRAIL = 40; // frames

class SpacePlot {
  constructor(canvas, facts, curves) {
    Object.assign(this, { canvas, facts, curves });
    const points = facts.basis.concat(this.extent());
    const range = (axis) => {
      const values = points.map((p) => p[axis]);
      const low = Math.min(...values), high = Math.max(...values);
      return [low - 0.06 * (high - low), high + 0.06 * (high - low)];
    };
    this.ranges = [range(0), range(1)];
  }

  // Corners of the box in which the estimates of the clip lie.
  extent() {
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    [this.curves.X0, this.curves.X1].forEach((column, axis) => {
      for (const value of column) {
        if (value < low[axis]) low[axis] = value;
        if (value > high[axis]) high[axis] = value;
      }
    });
    return Number.isFinite(low[0]) ? [low, high] : [];
  }

  paint(k, layers) {
    const { canvas } = this, ctx = canvas.getContext("2d"), ratio = window.devicePixelRatio || 1;
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink"), soft = style.getPropertyValue("--soft");
    const accent = style.getPropertyValue("--accent");
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    ctx.scale(ratio, ratio);
    const w = canvas.clientWidth, h = canvas.clientHeight;
    const at = (X) => [
      8 + ((w - 16) * (X[0] - this.ranges[0][0])) / (this.ranges[0][1] - this.ranges[0][0]),
      h - 8 - ((h - 30) * (X[1] - this.ranges[1][0])) / (this.ranges[1][1] - this.ranges[1][0]),
    ];
    const line = [layers.number("line_i") - 1, layers.number("line_j") - 1];
    this.paintLines(ctx, at, soft, accent, line);
    this.paintCloud(ctx, at, layers);
    this.paintEstimate(ctx, at, k, ink, accent);
    ctx.fillStyle = soft;
    ctx.font = "10px system-ui, 'DejaVu Sans', sans-serif";
    ctx.textAlign = "right";
    ctx.fillText("component 1", w - 6, h - 5);
    ctx.rotate(-Math.PI / 2);
    ctx.fillText("component 2", -24, 11);
    return line;
  }

  paintLines(ctx, at, soft, accent, line) {
    const basis = this.facts.basis.map(at);
    ctx.strokeStyle = soft;
    ctx.globalAlpha = 0.09;
    ctx.lineWidth = 1;
    ctx.beginPath();
    basis.forEach((a, i) => basis.slice(i + 1).forEach((b) => {
      ctx.moveTo(...a);
      ctx.lineTo(...b);
    }));
    ctx.stroke();
    ctx.globalAlpha = 1;
    if (line[0] >= 0) {
      ctx.strokeStyle = accent;
      ctx.lineWidth = 2;
      ctx.beginPath();
      ctx.moveTo(...basis[line[0]]);
      ctx.lineTo(...basis[line[1]]);
      ctx.stroke();
    }
    basis.forEach((p, i) => {
      ctx.fillStyle = line.includes(i) ? accent : soft;
      ctx.beginPath();
      ctx.arc(...p, line.includes(i) ? 3.6 : 2.4, 0, 7);
      ctx.fill();
    });
  }

  paintCloud(ctx, at, layers) {
    const X0 = layers.part("cloud", "cloud_X0"), X1 = layers.part("cloud", "cloud_X1");
    const weight = layers.part("cloud", "cloud_weight"), digit = layers.part("cloud", "cloud_digit");
    for (let i = 0; i < X0.length; i++) {
      const share = weight[i] / 255;
      ctx.globalAlpha = 0.3 + 0.7 * share;
      ctx.fillStyle = digit[i] ? digitColour(digit[i] - 1) : LAYERS.at(-1).colour;
      ctx.beginPath();
      ctx.arc(...at([X0[i], X1[i]]), 1.1 + 1.8 * Math.sqrt(share), 0, 7);
      ctx.fill();
    }
    ctx.globalAlpha = 1;
  }

  paintEstimate(ctx, at, k, ink, accent) {
    const { X0, X1 } = this.curves;
    ctx.strokeStyle = ink;
    ctx.lineWidth = 1.2;
    ctx.globalAlpha = 0.6;
    ctx.beginPath();
    let down = false;
    for (let i = Math.max(0, k - TRAIL); i <= k; i++) {
      if (!Number.isFinite(X0[i])) { down = false; continue; }
      if (down) ctx.lineTo(...at([X0[i], X1[i]])); else ctx.moveTo(...at([X0[i], X1[i]]));
      down = true;
    }
    ctx.stroke();
    ctx.globalAlpha = 1;
    if (!Number.isFinite(X0[k])) return;
    ctx.beginPath();
    ctx.arc(...at([X0[k], X1[k]]), 5, 0, 7);
    ctx.fillStyle = accent;
    ctx.fill();
    ctx.lineWidth = 1.6;
    ctx.stroke();
  }
}
