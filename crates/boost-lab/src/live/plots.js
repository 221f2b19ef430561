// A run's scrolling plots; the reports' `interactive.js` provides style, zoom and keyboard control.

// Visible time span (s).
const VIEW = 40;
// A line has at most this many strips of two points, their minimum and maximum.
const STRIPS = 1200;

// A plot pauses under the cursor so that values can be read; touch leaves no cursor behind.
const cursor = matchMedia("(hover: hover)");

// The rows of a record between two times: all, or the minimum and maximum of each strip.
function rowsToDraw(time, values, from, to) {
  let begin = time.findLastIndex(instant => instant <= from);
  if (begin < 0) begin = 0;
  let end = time.findLastIndex(instant => instant <= to) + 2;
  end = Math.min(end, time.length);
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

class Plots {
  constructor(figure) {
    Object.assign(this, { figure, panels: [], stale: new Set(), rests: 0 });
    // interactive.js redraws when the colour scheme changes, but without the live data.
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.changed());
  }

  // Shows a run in a template's panels. A short run is shown as a whole.
  async show(run, template) {
    this.panels.forEach(plot => Plotly.purge(plot));
    this.figure.replaceChildren(template.content.cloneNode(true));
    await showFigures(this.figure);
    const length = run.scenario.steps * run.scenario.step;
    Object.assign(this, { run, zoom: undefined, urgent: undefined, length: Math.min(length, 10 * VIEW), scrolls: length > 10 * VIEW });
    this.panels = [...this.figure.querySelectorAll(".plot")];
    for (const plot of this.panels) {
      plot.on("plotly_relayout", change => this.follow(plot, change));
      // The sources of the lines, from the template.
      plot.sources = plot.data.map(({ meta }) => ({ factor: parseFloat(meta), name: meta.slice(meta.indexOf(" ") + 1) }));
    }
    this.stale = new Set(this.panels);
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
    this.panels.forEach(plot => this.stale.add(plot));
  }

  range() {
    const { now, scenario: { start } } = this.run;
    if (!this.scrolls) return [start, start + this.length];
    const from = Math.max(this.run.time[0], now - VIEW);
    return [from, from + VIEW];
  }

  next() {
    return [...this.stale].find(plot => plot === this.urgent || !(cursor.matches && plot.matches(":hover")));
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

  draw(plot) {
    this.stale.delete(plot);
    if (plot === this.urgent) this.urgent = undefined;
    const { time, columns } = this.run;
    const [from, to] = this.zoom ?? this.range();
    const margin = this.zoom ? to - from : 0;
    const [x, y] = [[], []];
    for (const { name, factor } of plot.sources) {
      const values = columns.get(name);
      const rows = rowsToDraw(time, values, from - margin, to + margin);
      x.push(rows.map(row => time[row]));
      y.push(rows.map(row => factor * values[row]));
    }
    Plotly.update(plot, { x, y }, this.zoom ? {} : { "xaxis.range": [from, to] });
  }

  drawAll() {
    for (let plot = this.next(); plot; plot = this.next()) this.draw(plot);
  }
}
