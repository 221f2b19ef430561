// A run's scrolling plots and its cursors, or an experiment's figure; the reports' `interactive.js` provides style, zoom
// and keyboard control.

// Visible time span (s).
const VIEW = 40;
// A line has at most this many strips of two points, their minimum and maximum.
const STRIPS = 1200;
// Significant digits at the cursors: of values and of their difference.
const DIGITS = [5, 3];
const HELD_OPACITY = 0.5;
// The least height of a plot, as a share of its values: less is round-off.
const LEAST_SHARE = 0.002;

// A plot pauses under the pointer so that values can be read; touch leaves no pointer behind.
const pointer = matchMedia("(hover: hover)");

// The rows of a line between two places: all, or the minimum and maximum of each strip.
function rowsToDraw(places, values, from, to) {
  const begin = Math.max(places.findLastIndex(place => place <= from), 0);
  const end = Math.min(places.findLastIndex(place => place <= to) + 2, places.length);
  const size = Math.ceil((end - begin) / STRIPS);
  if (size <= 2) return Array.from({ length: end - begin }, (_, index) => begin + index);
  const rows = [];
  for (let strip = begin; strip < end; strip += size) {
    let [low, high] = [strip, strip];
    for (let row = strip; row < Math.min(strip + size, end); row += 1) {
      if (values[row] < values[low]) low = row;
      if (values[row] > values[high]) high = row;
    }
    rows.push(...(low === high ? [low] : [Math.min(low, high), Math.max(low, high)]));
  }
  if (rows.at(-1) !== end - 1) rows.push(end - 1);
  return rows;
}

// The vertical range: that of the values unless they differ by round-off alone.
function heightOf(values) {
  const low = values.reduce((least, value) => Math.min(least, value), Infinity);
  const high = values.reduce((most, value) => Math.max(most, value), -Infinity);
  const share = LEAST_SHARE * Math.max(Math.abs(low), Math.abs(high));
  if (high - low > share || values.length === 0) return { "yaxis.autorange": true };
  const [middle, half] = [(low + high) / 2, share / 2 || 1];
  return { "yaxis.range": [middle - half, middle + half] };
}

// The variable of a line of the template, and what is shown of its values: `0.001 name`, or with an offset
// `1.0-273.15 name`.
function source(meta) {
  const [, text, shift, name] = meta.match(/^(-?[\d.]+(?:e-?\d+)?)([+-][\d.]+(?:e-?\d+)?)? (.*)$/);
  const [factor, offset] = [Number(text), Number(shift ?? 0)];
  return { name, shown: value => factor * value + offset };
}

// Two times at which the plots show values and their difference.
class Cursors {
  constructor(group) {
    this.fields = [...group.querySelectorAll("input")];
    this.difference = group.querySelector("output");
  }

  // Each with its name; undefined if it is not placed.
  get times() { return this.fields.map(field => (field.value === "" ? undefined : Number(field.value))); }

  // The first free cursor, or the nearer one.
  place(time) {
    const distances = this.times.map(placed => (placed === undefined ? -1 : Math.abs(placed - time)));
    const field = this.fields[distances[0] < 0 ? 0 : Number(distances[1] < distances[0])];
    field.value = Number(time.toFixed(6));
    field.dispatchEvent(new Event("change"));
  }

  lines() {
    const color = getComputedStyle(document.documentElement).getPropertyValue("--ink");
    return this.times.flatMap((time, index) => (time === undefined ? [] : [{
      type: "line", x0: time, x1: time, y0: 0, y1: 1, yref: "paper", line: { color, width: 1, dash: "dot" },
      label: { text: "AB"[index], textposition: "end", textangle: 0, font: { color } },
    }]));
  }

  // A line's values, in a unit.
  read(time, values, shown, unit) {
    const text = (value, digits) => value.toLocaleString("en", { maximumSignificantDigits: digits, useGrouping: "min2" }).replace("-", "−");
    const found = this.times.map(placed => placed >= time[0] ? shown(values[time.findLastIndex(instant => instant <= placed)]) : undefined);
    const parts = found.map((value, index) => (value === undefined ? "" : `${"AB"[index]}\u00a0${text(value, DIGITS[0])}`));
    if (!found.includes(undefined)) parts.push(`Δ\u00a0${text(found[1] - found[0], DIGITS[1])}`);
    const joined = parts.filter(Boolean).join(", ");
    return joined && (unit ? `${joined}\u00a0${UNITS[unit] ?? unit}` : joined);
  }

  showDifference() {
    const [a, b] = this.times;
    this.difference.textContent = a === undefined || b === undefined ? "" : `Δ ${Number((b - a).toFixed(6))} s`;
  }
}

class Plots {
  constructor(figure, cursors) {
    Object.assign(this, { figure, cursors, panels: [], stale: new Set(), rests: 0 });
    // interactive.js redraws when the colour scheme changes, but without the live data.
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.changed());
    cursors.fields.forEach(field => field.addEventListener("change", () => this.read()));
  }

  // Shows a run in a template's panels, a held one as thin lines under it.
  async show(run, template, held) {
    const length = run.scenario.steps * run.scenario.step;
    Object.assign(this, { run, held, lines: undefined, length: Math.min(length, 10 * VIEW), scrolls: length > 10 * VIEW });
    const named = text => text.replace(/^[\w.]+/, words);
    const thin = line => ({ ...line, zorder: -1, opacity: HELD_OPACITY, line: { ...line.line, width: 1 }, hoverinfo: "skip" });
    // Each plot says the unit of time, since those below it may be out of view.
    await this.fill(template, ({ data, layout: { xaxis, yaxis, ...layout } }) => {
      const lines = data.map(line => ({ ...line, name: named(line.name) }));
      return {
        data: held ? lines.concat(lines.map(thin)) : lines,
        layout: { ...layout, xaxis: { ...xaxis, title: undefined, ticksuffix: " s" }, yaxis: { ...yaxis, exponentformat: "none" } },
      };
    });
    for (const label of this.figure.querySelectorAll(".legend label")) label.lastChild.textContent = named(label.lastChild.textContent.trim());
    for (const plot of this.panels) {
      plot.on("plotly_relayout", change => this.follow(plot, change));
      plot.on("plotly_click", ({ points: [{ x }] }) => {
        this.urgent = plot;
        this.cursors.place(x);
      });
      plot.sources = plot.data.map(({ meta }) => source(meta));
    }
    this.read();
  }

  // Shows an experiment's figure: `lines` returns its lines.
  async showFigure(template, lines) {
    Object.assign(this, { lines });
    await this.fill(template, plot => plot);
    let count = 0;
    for (const plot of this.panels) {
      plot.first = count;
      count += plot.data.length;
    }
  }

  async fill(template, change) {
    this.panels.forEach(plot => Plotly.purge(plot));
    this.figure.replaceChildren(template.content.cloneNode(true));
    this.figure.classList.toggle("paper", Boolean(this.lines));
    for (const script of this.figure.querySelectorAll(".panel > script")) {
      script.textContent = JSON.stringify(change(JSON.parse(script.textContent)));
    }
    await showFigures(this.figure);
    this.panels = [...this.figure.querySelectorAll(".plot")];
    Object.assign(this, { zoom: undefined, urgent: undefined, stale: new Set(this.panels) });
  }

  // A zoomed view stays until the axes are reset.
  follow(plot, change) {
    const keys = Object.keys(change).filter(key => key.startsWith("xaxis."));
    if (keys.length === 0) return;
    this.zoom = keys.includes("xaxis.autorange") ? undefined : [...plot.layout.xaxis.range].map(Number);
    this.urgent = plot;
    this.changed();
  }

  // A set keeps its order, so the longest waiting are drawn first.
  changed() {
    this.drawn = undefined;
    this.panels.forEach(plot => this.stale.add(plot));
  }

  // Writes the values at the cursors into the legends.
  read() {
    this.cursors.showDifference();
    if (this.lines || !this.run) return;
    for (const plot of this.panels) {
      const unit = plot.layout.yaxis.title?.text ?? "";
      for (const box of plot.parentElement.querySelectorAll(".legend input")) {
        const { name, shown } = plot.sources[box.value];
        const output = box.parentElement.querySelector("output") ?? box.parentElement.appendChild(make("output"));
        output.textContent = this.cursors.read(this.run.time, this.run.columns.get(name), shown, unit);
      }
    }
    this.changed();
  }

  range() {
    const { now, scenario: { start } } = this.run;
    if (!this.scrolls) return [start, start + this.length];
    const from = Math.max(this.run.time[0], now - VIEW);
    return [from, from + VIEW];
  }

  next() {
    const rests = plot => pointer.matches && plot.matches(":hover") && !this.lines && plot.data[0].x.length > 0;
    return [...this.stale].find(plot => plot === this.urgent || !rests(plot));
  }

  // Draws the next stale panel: one per frame, to keep frames short, then pauses for as long as it took, to leave time
  // for the rest.
  drawNext() {
    const plot = this.next();
    if (!plot || performance.now() < this.rests) return;
    const begun = performance.now();
    this.draw(plot);
    this.rests = 2 * performance.now() - begun;
  }

  // A panel's lines, each x, y and the function to what is shown of it.
  linesOf(plot) {
    if (this.lines) return (this.drawn ??= this.lines()).slice(plot.first, plot.first + plot.data.length);
    const runs = [this.run, this.held].filter(Boolean);
    return plot.data.map((_, index) => {
      const { name, shown } = plot.sources[index];
      const { time, columns } = runs[Math.floor(index * runs.length / plot.data.length)];
      return [time, columns.get(name), shown];
    });
  }

  draw(plot) {
    this.stale.delete(plot);
    if (plot === this.urgent) this.urgent = undefined;
    const [from, to] = this.lines ? [-Infinity, Infinity] : this.zoom ?? this.range();
    const margin = this.zoom ? to - from : 0;
    const [x, y] = [[], []];
    for (const [places, values, shown = value => value] of this.linesOf(plot)) {
      const rows = rowsToDraw(places, values, from - margin, to + margin);
      x.push(rows.map(row => places[row]));
      y.push(rows.map(row => shown(values[row])));
    }
    Plotly.update(plot, { x, y }, {
      ...(this.lines ? {} : { shapes: this.cursors.lines() }),
      ...(this.lines || this.zoom ? {} : { "xaxis.range": [from, to], ...heightOf(y.flat()) }),
    });
  }

  drawAll() {
    for (let plot = this.next(); plot; plot = this.next()) this.draw(plot);
  }
}
