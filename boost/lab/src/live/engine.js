// The engine drawing: live values, moving valves, and flows.

const UNITS = { degC: "°C", "N.m": "N·m", "": "" };
const DECIMALS = { kPa: 1, "g/s": 1, V: 2, degC: 0, K: 0, rpm: 0, "N.m": 0, "%": 0, s: 2 };
// Speed of a flow's dashes per kg/s (drawing units per second).
const SPEED = 900;

// A value in its display unit.
function shown(variable, value) {
  const { unit, factor, offset } = variable.display;
  const number = factor * value + offset;
  // No minus sign for zero.
  const digits = { minimumFractionDigits: DECIMALS[unit] ?? 2, maximumFractionDigits: DECIMALS[unit] ?? 2, signDisplay: "negative", useGrouping: "min2" };
  return `${number.toLocaleString("en", digits).replace("-", "−")} ${UNITS[unit] ?? unit}`.trim();
}

class Engine {
  constructor(svg, table, moves) {
    Object.assign(this, { svg, table, moves });
    const all = kind => [...svg.querySelectorAll(`[data-${kind}]`)].map(element => ({ element, name: element.dataset[kind] }));
    [this.values, this.openings, this.flows] = ["value", "opening", "flow"].map(all);
  }

  // Selects the instance to show.
  async of(instance) {
    this.names = [...new Set([...this.values, ...this.openings, ...this.flows].map(({ name }) => name))];
    this.selection = new Selection(instance, this.names);
    this.variables = this.names.map(name => instance.variable(name));
    this.cells = this.variables.map(() => make("td"));
    this.table.replaceChildren(...this.variables.map(({ name, description }, index) =>
      make("tr", {}, make("th", { scope: "row", textContent: description || name }), this.cells[index])));
    this.update(0);
  }

  // `seconds` is wall-clock time since the last update.
  update(seconds) {
    const values = this.selection.get();
    const find = name => this.names.indexOf(name);
    for (const { element, name } of this.values) {
      const text = shown(this.variables[find(name)], values[find(name)]);
      if (element.textContent !== text) element.textContent = text;
    }
    for (const { element, name } of this.openings) {
      element.style.setProperty("--opening", Math.min(Math.max(values[find(name)], 0), 1).toFixed(3));
    }
    for (const flow of this.flows) {
      const value = values[find(flow.name)];
      flow.element.style.opacity = Math.min(Math.abs(value) / 0.002, 1).toFixed(2);
      if (!this.moves) continue;
      flow.place = ((flow.place ?? 0) - SPEED * value * seconds) % 24;
      flow.element.style.strokeDashoffset = flow.place.toFixed(1);
    }
    if (this.table.closest("details").open) this.cells.forEach((cell, index) => { cell.textContent = shown(this.variables[index], values[index]); });
  }
}
