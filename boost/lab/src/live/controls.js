// The controls: what drives the loop, each made from its FMU's declaration.

// A variable's name in words.
const words = name => name.split(".").at(-1).replaceAll("_", " ").replace(/\b(?:hp|lp|pwm)\b|^./g, letters => letters.toUpperCase());
const inUnit = (text, unit) => `${text} ${UNITS[unit] ?? unit}`.trim();

function make(kind, properties = {}, ...children) {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...children);
  return made;
}

// A value that the user sets: a switch, a choice, or a number with a slider over its usual range.
class Control {
  // `changed` is called with the control when the user has changed its value.
  constructor({ fmu, name, range }, variable, changed) {
    Object.assign(this, { fmu, name, variable, changed, value: variable.start });
    this.note = make("small", { id: `${name}-note`, className: "hidden" });
    const parts = { Boolean: () => this.box(), Enumeration: () => this.choice(), Real: () => this.number(range) }[variable.type]();
    const label = make("label", { htmlFor: name, textContent: words(name), title: variable.description });
    this.element = make("div", { className: `control ${variable.type}` }, label, ...parts, this.note);
    this.element.querySelector(`[id="${name}"]`).setAttribute("aria-describedby", this.note.id);
    this.tell(variable.description);
    this.isOf = variable.causality === "input" ? "signal" : variable.variability;
  }

  get isChanged() { return this.value !== this.variable.start; }

  // Describes the control to screen readers, or shows why it refuses a value.
  tell(text, isRefusal = false) {
    this.note.textContent = text;
    this.note.classList.toggle("hidden", !isRefusal);
    this.input.setAttribute("aria-invalid", isRefusal);
  }

  take(value) {
    this.tell(this.variable.description);
    if (value === this.value) return;
    this.value = value;
    this.changed(this);
  }

  box() {
    this.input = make("input", { type: "checkbox", id: this.name, name: this.name, defaultChecked: this.value });
    this.input.addEventListener("change", () => this.take(Number(this.input.checked)));
    this.show = value => { this.input.checked = value; };
    this.enter = text => { this.input.checked = text === "on"; };
    return [this.input];
  }

  choice() {
    const { items } = this.variable;
    const nameOf = value => [...items.keys()].find(name => items.get(name) === value);
    const options = [...items.keys()].map(name => make("option", { value: name, textContent: words(name), defaultSelected: name === nameOf(this.value) }));
    this.input = make("select", { id: this.name, name: this.name }, ...options);
    this.input.addEventListener("change", () => this.take(items.get(this.input.value)));
    this.show = value => { this.input.value = nameOf(value); };
    this.enter = text => { if (items.has(text)) this.input.value = text; };
    return [this.input];
  }

  // The field accepts what the FMU declares, and refuses the rest, as it does if it is cleared.
  number(range) {
    const { min, max, display: { unit, factor, offset } } = this.variable;
    const shown = value => Number((factor * value + offset).toPrecision(6));
    const [low, high] = range.map(shown);
    const size = 10 ** Math.floor(Math.log10((high - low) / 50));
    const defaultValue = shown(this.value);
    const slider = make("input", { type: "range", id: this.name, min: low, max: high, step: size, defaultValue });
    this.input = make("input", { type: "number", name: this.name, min: shown(min), max: shown(max), step: "any", defaultValue });
    this.input.setAttribute("aria-label", [words(this.name), unit].filter(Boolean).join(", "));
    this.show = value => {
      this.input.value = slider.value = shown(value);
      slider.setAttribute("aria-valuetext", inUnit(this.input.value, unit));
    };
    this.enter = text => { this.input.value = text; };
    slider.addEventListener("input", () => {
      this.input.value = slider.value;
      this.input.dispatchEvent(new Event("change"));
    });
    this.input.addEventListener("change", () => {
      const { value, validity: { valid } } = this.input;
      if (value !== "" && valid) this.take(Number(((value - offset) / factor).toPrecision(12)));
      this.show(this.value);
      if (value === "" || !valid) this.tell(`Kept: ${value || "no number"} is outside ${this.input.min} to ${inUnit(this.input.max, unit)}.`, true);
    });
    return [make("span", { className: "field" }, this.input, make("span", { textContent: UNITS[unit] ?? unit })), slider];
  }
}

// All controls, in the form's groups.
class Controls {
  constructor(form, groups, models, plants, changed) {
    Object.assign(this, { form, plants });
    // The parameter sets, as if they were an enumeration of the plant.
    const items = new Map(["nominal plant", ...plants.map(({ name }) => name)].map((name, index) => [name, index]));
    const plant = { name: "plant", type: "Enumeration", items, start: 0, description: "The plant's parameters; changing them restarts the simulation.", variability: "fixed" };
    const made = groups.map(({ controls }) => controls.map(each => new Control(each, each.fmu ? models[each.fmu].variables.get(each.name) : plant, changed)));
    this.all = made.flat();
    this.fieldsets = groups.map(({ name, open }, index) => {
      const elements = made[index].map(({ element }) => element);
      return make("fieldset", { className: "group" }, make("details", { open }, make("summary", { textContent: name }), ...elements));
    });
    this.fieldsets.at(-1).append(make("button", { type: "reset", id: "defaults", textContent: "Defaults" }));
    form.append(...this.fieldsets);
    this.showAll();
    form.addEventListener("change", () => this.writeAddress());
    // The form resets its inputs only after this event.
    form.addEventListener("reset", () => setTimeout(() => this.enterAll()));
  }

  get(name) { return this.all.find(control => control.name === name); }
  set disabled(are) { this.fieldsets.forEach(fieldset => { fieldset.disabled = are; }); }
  // An FMU's changed parameters with their values.
  parameters(fmu) {
    return this.all.filter(control => control.fmu === fmu && control.isOf !== "signal" && control.isChanged).map(({ name, value }) => [name, value]);
  }

  // Those of the chosen parameter set.
  plantValues() { return this.plants[this.get("plant").value - 1]?.values ?? []; }

  // Takes over what the inputs show.
  enterAll() {
    this.all.forEach(({ input }) => input.dispatchEvent(new Event("change")));
    this.form.elements.pace.dispatchEvent(new Event("change"));
    this.writeAddress();
  }

  showAll() { this.all.forEach(control => control.show(control.value)); }

  // Returns what shows a run's values.
  follow(run) {
    this.all.forEach(control => control.tell(control.variable.description));
    const of = Object.groupBy(this.all.filter(({ fmu }) => fmu), ({ fmu }) => fmu);
    const shown = Object.entries(of).map(([fmu, controls]) => [run.instance(fmu), controls]).filter(([instance]) => instance);
    const selections = shown.map(([instance, controls]) => [new Selection(instance, controls.map(({ name }) => name)), controls]);
    return () => selections.forEach(([selection, controls]) => selection.get().forEach((value, index) => controls[index].show(value)));
  }

  // The page's address has what differs from the defaults, as it is displayed.
  writeAddress() {
    const changed = this.all.filter(control => control.isChanged).map(({ input }) => input.name);
    if (this.form.elements.pace.value !== REAL_TIME) changed.push("pace");
    const settings = [...new FormData(this.form)].filter(([name]) => changed.includes(name));
    // A switch that is off is not in the form's data.
    const off = this.all.filter(({ input, isChanged }) => isChanged && input.type === "checkbox" && !input.checked).map(({ name }) => [name, "off"]);
    const text = new URLSearchParams([...settings, ...off]).toString();
    history.replaceState(null, "", text ? `#${text}` : location.href.split("#", 1)[0]);
  }

  readAddress() {
    const settings = [...new URLSearchParams(location.hash.slice(1))];
    const { pace } = this.form.elements;
    this.all.forEach(control => control.show(control.variable.start));
    pace.value = REAL_TIME;
    for (const [name, text] of settings) {
      if (name === "pace" && [...pace.options].some(({ value }) => value === text)) pace.value = text;
      this.get(name)?.enter(text);
    }
    this.enterAll();
  }
}
