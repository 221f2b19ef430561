// Connects FMUs by variable name and steps them through a scenario, in the same order as the laboratory's master.

// Communication points, rounded multiples of the step, may precede a signal's point by this much (s).
const ROUNDING = 1e-9;
// Exchanges of outputs and inputs during initialization: a plant that settles at the controller's outputs returns its
// measured supply voltage, which changes them.
const INITIAL_EXCHANGES = 2;

// The value of a scenario's signal at a time (s).
function signalAt(signal, time) {
  if ("constant" in signal) return signal.constant;
  if (signal.steps) return (signal.steps.findLast(([begin]) => begin <= time + ROUNDING) ?? signal.steps[0])[1];
  if (signal.lines) {
    const after = signal.lines.findIndex(([instant]) => instant > time);
    if (after < 0) return signal.lines.at(-1)[1];
    if (after === 0) return signal.lines[0][1];
    const [[t0, y0], [t1, y1]] = signal.lines.slice(after - 1, after + 1);
    return (y1 - y0) / (t1 - t0) * (time - t0) + y0;
  }
  return signal.mean + signal.amplitude * Math.sin(2 * Math.PI * (signal.frequency * time + signal.phase / 360));
}

// The points where a signal jumps or kinks.
const pointsOf = signal => signal.steps ?? signal.lines ?? [];

// A running scenario.
class Run {
  // `values` adds start values by FMU name, such as a parameter set; `warn` receives the FMUs' warnings.
  static async start(models, scenario, values, warn) {
    const run = new Run();
    Object.assign(run, { scenario, stepsDone: 0, time: [], columns: new Map(scenario.record.map(name => [name, []])) });
    run.signals = new Map(scenario.inputs);
    run.members = await Promise.all(scenario.fmus.map(async fmu => ({ fmu, instance: await models[fmu.name].instantiate(fmu.name, warn) })));
    run.connect();
    run.initialize(values);
    return run;
  }

  get now() { return this.scenario.start + this.stepsDone * this.scenario.step; }
  get isOver() { return this.stepsDone >= this.scenario.steps; }
  instance(name) { return this.members.find(member => member.fmu.name === name)?.instance; }
  signal(name) { return this.signals.get(name); }

  connect() {
    for (const member of this.members) {
      const { instance, fmu } = member;
      const inputs = new Set(instance.model.names("input"));
      member.own = new Map(fmu.inputs);
      member.driven = new Selection(instance, [...inputs].filter(name => member.own.has(name) || this.signals.has(name)));
      member.wires = this.members.filter(source => source !== member).map(source => {
        const names = source.instance.model.names("output").filter(name => inputs.has(name) && !member.own.has(name));
        return { source, outputs: new Selection(source.instance, names), inputs: new Selection(instance, names) };
      });
    }
    this.recorded = this.scenario.record.map(name => this.source(name));
    for (const member of this.members) {
      member.recorded = new Selection(member.instance, this.recorded.filter(found => found?.member === member).map(found => found.name));
    }
  }

  // Where a recorded variable comes from: undefined for a signal, else an output if there is one, else any variable.
  source(column) {
    if (this.signals.has(column)) return undefined;
    const [of, name] = column.includes(":") ? column.split(":") : ["", column];
    const members = this.members.filter(member => !of || member.fmu.name === of);
    const known = members.map(member => ({ member, name, variable: member.instance.model.variables.get(name) })).filter(found => found.variable);
    const found = known.find(({ variable }) => variable.causality === "output") ?? known[0];
    if (!found) throw new Failure(`No FMU has a variable ${column}`);
    return found;
  }

  // Initializes FMUs without a run-in together, then those with one, using the others' outputs.
  initialize(values) {
    const { start, step } = this.scenario;
    const late = this.members.filter(member => member.fmu.runIn);
    const prompt = this.members.filter(member => !member.fmu.runIn);
    const assign = (instance, list) => list.forEach(([name, value]) => instance.setValue(name, value));
    const begin = ({ instance, fmu, ...member }, time, also) => {
      instance.setUp(time);
      assign(instance, values[fmu.name] ?? []);
      assign(instance, fmu.values);
      assign(instance, also);
      this.drive(member, start);
      instance.enterInitialization();
    };
    prompt.forEach(member => begin(member, start, []));
    for (let exchange = 0; exchange < INITIAL_EXCHANGES; exchange += 1) prompt.forEach(member => this.take(member, prompt));
    prompt.forEach(member => member.instance.exitInitialization());
    for (const member of late) {
      const { instance, fmu: { runIn } } = member;
      begin(member, start - runIn.duration, runIn.during);
      this.take(member, prompt);
      instance.exitInitialization();
      for (let index = 0; index < runIn.steps; index += 1) instance.step(start - runIn.duration + index * step, step);
      assign(instance, runIn.after);
    }
    this.record();
  }

  // Sets the inputs driven by signals.
  drive(member, time) {
    member.driven.set(member.driven.names.map(name => signalAt(member.own.get(name) ?? this.signals.get(name), time)));
  }

  take(member, from) {
    for (const { source, outputs, inputs } of member.wires) {
      if (from.includes(source)) inputs.set(outputs.get());
    }
  }

  // A communication step: each FMU sees the new outputs of those before it.
  step() {
    const time = this.now;
    this.members.forEach(member => this.drive(member, time));
    for (const member of this.members) {
      this.take(member, this.members);
      member.instance.step(time, this.scenario.step);
    }
    this.stepsDone += 1;
    this.record();
  }

  record() {
    const values = new Map(this.members.map(member => [member, member.recorded.get()[Symbol.iterator]()]));
    this.time.push(this.now);
    this.scenario.record.forEach((name, index) => {
      const member = this.recorded[index]?.member;
      const value = member ? values.get(member).next().value : signalAt(this.signals.get(name), this.now);
      this.columns.get(name).push(value);
    });
  }

  // Drops the oldest rows beyond a number.
  keep(rows) {
    const beyond = this.time.length - rows;
    for (const list of [this.time, ...this.columns.values()]) list.splice(0, beyond);
  }
}
