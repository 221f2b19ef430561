// An FMU as a WebAssembly module: FMI 2.0 co-simulation, called through the module's memory.

// An error with a message for the user.
class Failure extends Error {}

const CO_SIMULATION = 1;
// Values of fmi2Status above this are failures.
const WARNING = 1;
// By type element of a ScalarVariable: its functions and memory layout.
const TYPES = {
  Real: { get: "fmi2GetReal", set: "fmi2SetReal", array: Float64Array },
  Integer: { get: "fmi2GetInteger", set: "fmi2SetInteger", array: Int32Array },
  Enumeration: { get: "fmi2GetInteger", set: "fmi2SetInteger", array: Int32Array },
  Boolean: { get: "fmi2GetBoolean", set: "fmi2SetBoolean", array: Int32Array },
};

// A compiled module with its variables.
class Model {
  static async compile(base64) {
    const bytes = Uint8Array.from(atob(base64), letter => letter.charCodeAt(0));
    const model = new Model();
    model.module = await WebAssembly.compile(bytes);
    const [xml] = WebAssembly.Module.customSections(model.module, "modelDescription.xml");
    model.read(new DOMParser().parseFromString(new TextDecoder().decode(xml), "text/xml"));
    return model;
  }

  read(xml) {
    this.guid = xml.documentElement.getAttribute("guid");
    const types = new Map([...xml.querySelectorAll("SimpleType")].map(type => [type.getAttribute("name"), type.firstElementChild]));
    const items = type => new Map([...type.querySelectorAll("Item")].map(item => [item.getAttribute("name"), Number(item.getAttribute("value"))]));
    const display = new Map([...xml.querySelectorAll("DisplayUnit")].map(unit => [
      `${unit.parentElement.getAttribute("name")} ${unit.getAttribute("name")}`,
      { unit: unit.getAttribute("name"), factor: Number(unit.getAttribute("factor") ?? 1), offset: Number(unit.getAttribute("offset") ?? 0) },
    ]));
    this.variables = new Map([...xml.querySelectorAll("ModelVariables > ScalarVariable")].map(element => {
      const type = element.firstElementChild;
      const declared = types.get(type.getAttribute("declaredType"));
      const attribute = key => type.getAttribute(key) ?? declared?.getAttribute(key) ?? undefined;
      const [name, unit] = [element.getAttribute("name"), attribute("unit") ?? ""];
      const number = key => (attribute(key) === undefined ? undefined : Number(attribute(key)));
      return [name, {
        name, unit,
        type: type.localName,
        reference: Number(element.getAttribute("valueReference")),
        causality: element.getAttribute("causality"),
        variability: element.getAttribute("variability"),
        description: element.getAttribute("description") ?? "",
        items: type.localName === "Enumeration" ? items(declared) : undefined,
        display: {
          ...(display.get(`${unit} ${attribute("displayUnit")}`) ?? { unit: unit === "1" ? "" : unit, factor: 1, offset: 0 }),
          ...(attribute("relativeQuantity") === "true" && { offset: 0 }),
        },
        min: number("min"), max: number("max"),
        start: type.localName === "Boolean" ? Number(type.getAttribute("start") === "true") : number("start"),
      }];
    }));
  }

  names(causality) {
    return [...this.variables.values()].filter(variable => variable.causality === causality).map(variable => variable.name);
  }

  // Each instance has its own memory, since a trap leaves the old one unusable. `warn` receives its warnings.
  async instantiate(name, warn) {
    const instance = new Instance(this, name, warn);
    const { exports } = await WebAssembly.instantiate(this.module, { fmu: instance.imports() });
    instance.begin(exports);
    return instance;
  }
}

class Instance {
  constructor(model, name, warn) {
    Object.assign(this, { model, name, warn, messages: [], panic: "" });
  }

  // The module's imports.
  imports() {
    const log = (environment, status, category, text) => {
      if (status === WARNING) this.warn(`The ${this.name} warns: ${this.text(text)}`);
      else this.messages.push(this.text(text));
    };
    const panic = (text, size) => { this.panic = new TextDecoder().decode(new Uint8Array(this.exports.memory.buffer, text, size)); };
    // The models read no files.
    return { log, panic, file_size: () => -1n, read_file: () => 0 };
  }

  begin(exports) {
    this.exports = exports;
    // The logger is never called by its address, but the address must not be null.
    const callbacks = this.put(Uint32Array, [1, 0, 0, 0, 0]);
    const [name, guid, folder] = [this.name, this.model.guid, ""].map(text => this.put(Uint8Array, [...new TextEncoder().encode(text), 0]));
    const loggingOn = 0;
    this.component = this.run("fmi2Instantiate", name, CO_SIMULATION, guid, folder, callbacks, 0, loggingOn);
    if (!this.component) throw this.failure("fmi2Instantiate");
  }

  // Allocates memory for the instance's lifetime.
  put(type, values) {
    const address = this.exports.fmu_allocate(values.length * type.BYTES_PER_ELEMENT);
    new type(this.exports.memory.buffer, address, values.length).set(values);
    return address;
  }

  text(address) {
    const bytes = new Uint8Array(this.exports.memory.buffer, address);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }

  failure(called) {
    const why = this.messages.join(" ") || `${called}: ${this.panic || "no reason given"}`;
    return new Failure(`The ${this.name} stopped. ${why}`);
  }

  run(called, ...values) {
    try {
      return this.exports[called](...values);
    } catch (trap) {
      this.panic ||= String(trap);
      throw this.failure(called);
    }
  }

  call(called, ...values) {
    this.messages = [];
    if (this.run(called, this.component, ...values) > WARNING) throw this.failure(called);
  }

  variable(name) {
    const variable = this.model.variables.get(name);
    if (!variable) throw new Failure(`The ${this.name} has no variable ${name}`);
    return variable;
  }

  // Sets a variable to a number, a boolean or an enumeration item's name.
  setValue(name, value) {
    const variable = this.variable(name);
    new Selection(this, [name]).set([typeof value === "string" ? variable.items.get(value) : Number(value)]);
  }

  setUp(start) { this.call("fmi2SetupExperiment", 0, 0, start, 0, 0); }
  enterInitialization() { this.call("fmi2EnterInitializationMode"); }
  exitInitialization() { this.call("fmi2ExitInitializationMode"); }
  step(time, size) { this.call("fmi2DoStep", time, size, 1); }
}

// Variables read or set together. Their addresses persist; views do not survive memory growth.
class Selection {
  constructor(instance, names) {
    this.instance = instance;
    this.names = names;
    this.groups = Object.entries(TYPES).map(([type, functions]) => {
      const chosen = names.map((name, position) => [instance.variable(name), position]).filter(([variable]) => variable.type === type);
      const references = instance.put(Uint32Array, chosen.map(([variable]) => variable.reference));
      const values = instance.exports.fmu_allocate(8 * chosen.length);
      return { ...functions, references, values, positions: chosen.map(([, position]) => position) };
    }).filter(group => group.positions.length > 0);
  }

  view(group) {
    return new group.array(this.instance.exports.memory.buffer, group.values, group.positions.length);
  }

  get(values = []) {
    for (const group of this.groups) {
      this.instance.call(group.get, group.references, group.positions.length, group.values);
      const view = this.view(group);
      group.positions.forEach((position, index) => { values[position] = view[index]; });
    }
    return values;
  }

  set(values) {
    for (const group of this.groups) {
      this.view(group).set(group.positions.map(position => values[position]));
      this.instance.call(group.set, group.references, group.positions.length, group.values);
    }
  }
}
