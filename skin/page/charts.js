// Curves beside the picture: one canvas a chart, a line where the shown frame is; a click goes there.

const kLineColors = ["#ff8a3d", "#e8c07a", "#7fb0d6", "#9bc08a", "#c79bd0", "#d87f7f"];

/// A step of 1, 2 or 5 times a power of ten, of which about `wanted` go into the range.
function niceStep(range, wanted) {
  const rough = Math.max(range, 1e-30) / wanted, power = 10 ** Math.floor(Math.log10(rough));
  return power * ([1, 2, 5].find((m) => m * power >= rough) || 10);
}

class Charts {
  /// go(time): the reader wants to see that moment.
  constructor(parent, page, go) {
    this.times = page.seriesTimes;
    this.charts = [];
    const make = (name, into) => into.appendChild(document.createElement(name)), byChart = new Map();
    for (const series of page.series) byChart.set(series.chart, [...(byChart.get(series.chart) || []), series]);
    parent.style.setProperty("--charts", Math.max(byChart.size, 1));
    for (const [name, lines] of byChart) {
      const box = make("figure", parent), caption = make("figcaption", box), plot = make("div", box), canvas = make("canvas", plot), here = make("hr", plot);
      make("b", caption).textContent = name;
      const readout = make("span", caption);
      const spans = lines.map((line, k) => {
        const span = make("span", readout), dot = make("i", plot);
        span.style.color = dot.style.background = kLineColors[k % kLineColors.length];
        return { span, dot };
      });
      this.charts.push({ lines, canvas, here, spans, range: this.rangeOf(lines) });
      const at = (e) => {
        const r = plot.getBoundingClientRect();
        go(this.timeAt((e.clientX - r.left) / r.width));
      };
      plot.addEventListener("pointerdown", (e) => {
        plot.setPointerCapture(e.pointerId);
        at(e);
      });
      plot.addEventListener("pointermove", (e) => {
        if (e.buttons) at(e);
      });
    }
  }

  timeAt(share) {
    const first = this.times[0], last = this.times[this.times.length - 1];
    return first + clamp(share, 0, 1) * (last - first);
  }

  /// From 0, except temperatures.
  rangeOf(lines) {
    const values = lines.flatMap((l) => l.values.filter((v) => v !== null));
    let low = lines[0].unit === "°C" ? Infinity : 0, high = -Infinity;
    for (const v of values) [low, high] = [Math.min(low, v), Math.max(high, v)];
    return [low, high > low ? high : low + 1];
  }

  placeOf(chart, width, height) {
    const t = this.times, [low, high] = chart.range;
    return {
      x: (time) => ((clamp(time, t[0], t[t.length - 1]) - t[0]) / Math.max(t[t.length - 1] - t[0], 1e-30)) * (width - 2) + 1,
      y: (v) => height - 5 - ((v - low) / (high - low)) * (height - 10),
    };
  }

  /// The curves: when the page's size changes.
  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    for (const chart of this.charts) {
      const { canvas, lines } = chart, width = (chart.width = canvas.clientWidth), height = (chart.height = canvas.clientHeight);
      if (width === 0) continue;
      Object.assign(canvas, { width: width * ratio, height: height * ratio });
      const c = canvas.getContext("2d"), { x, y } = this.placeOf(chart, width, height), [low, high] = chart.range, step = niceStep(high - low, Math.max(height / 27, 1));
      c.scale(ratio, ratio);
      c.font = "10px system-ui, sans-serif";
      for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
        c.fillStyle = "rgba(255,255,255,.07)";
        c.fillRect(0, Math.round(y(v)), width, 1);
        c.fillStyle = "rgba(255,255,255,.34)";
        if (y(v) > 14) c.fillText(withUnit(Math.abs(v) < 1e-9 * step ? 0 : v, lines[0].unit), 2, Math.round(y(v)) - 3);
      }
      lines.forEach((line, k) => {
        c.beginPath();
        let open = false;
        line.values.forEach((v, i) => {
          if (v === null) open = false;
          else c[open ? "lineTo" : ((open = true), "moveTo")](x(this.times[i]), y(v));
        });
        c.lineWidth = 1.6;
        c.lineJoin = "round";
        c.strokeStyle = kLineColors[k % kLineColors.length];
        c.stroke();
      });
    }
  }

  /// Where the shown frame is on them; moves what is there, since drawing costs more than a frame of lava.
  mark(time) {
    const t = this.times;
    let row = 0;
    while (row + 1 < t.length && t[row + 1] <= time + 1e-9 * Math.abs(time)) ++row;
    for (const chart of this.charts) {
      if (!chart.width) continue;
      const { x, y } = this.placeOf(chart, chart.width, chart.height);
      chart.here.style.transform = `translateX(${x(time)}px)`;
      chart.lines.forEach((line, k) => {
        const { span, dot } = chart.spans[k], v = line.values[row];
        dot.style.visibility = v === null ? "hidden" : "";
        if (v !== null) dot.style.transform = `translate(${x(t[row])}px, ${y(v)}px)`;
        const text = (line.name ? line.name + " " : "") + (v === null ? "–" : withUnit(v, line.unit));
        if (span.textContent !== text) span.textContent = text;
      });
    }
  }
}
