// The page's controls: what runs, how fast, and the user's settings.

const laboratory = JSON.parse(document.getElementById("laboratory").textContent);
const element = id => document.getElementById(id);
const lessMotion = matchMedia("(prefers-reduced-motion: reduce)");
// The FMUs' share of a 16 ms frame (ms): at the chosen pace, and as fast as possible.
const BUDGET = { paced: 10, most: 24 };
// Rows kept of the endless loop (25 min), and by how many it may exceed them before the oldest are dropped.
const [ROWS, MORE_ROWS] = [120_000, 12_000];
// Update interval with reduced motion (ms).
const STILL = 1000;

// At least three significant digits, as the laboratory writes numbers.
function number(value) {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const magnitude = Math.floor(Math.log10(Math.abs(value)));
  const minus = text => text.replaceAll("-", "−");
  if (magnitude < -3 || magnitude >= 6) {
    const power = [...String(magnitude)].map(digit => (digit === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit])).join("");
    return `${minus((value / 10 ** magnitude).toFixed(1))}·10${power}`;
  }
  const text = value.toFixed(Math.max(2 - magnitude, 0));
  return minus(text.includes(".") ? text.replace(/\.?0+$/, "") : text);
}

function make(kind, properties = {}, ...children) {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...children);
  return made;
}

// The current run and the user's settings.
const state = {
  models: {}, run: undefined, isRunning: false, failed: false,
  experiment: undefined, finished: [], // the experiment and its finished runs
  inputs: new Map(laboratory.loop.inputs), parameters: new Map(), plant: [],
};
let plots, engine;

const say = text => { element("status").textContent = text; };

function fail(error) {
  state.failed = true;
  setRunning(false);
  const isFailure = error instanceof Failure;
  element("failure").firstElementChild.textContent = isFailure ? error.message : `The page failed: ${error.message}`;
  element("failure").hidden = false;
  if (!isFailure) throw error;
}

// Warnings are read out, and stay until the next start.
function warn(text) {
  say(text);
  element("warnings").hidden = false;
  element("warnings").querySelector("ul").append(make("li", { textContent: `${state.run?.now.toFixed(2) ?? 0} s: ${text}` }));
}

function setRunning(isRunning) {
  state.isRunning = isRunning && !state.failed;
  element("run").textContent = state.isRunning ? "Pause" : "Run";
  pace.begin();
}

// The simulation time due by now.
const pace = {
  factor: 1,
  begin(now = performance.now()) { Object.assign(this, { since: now, from: state.run?.now ?? 0 }); },
  due(now) { return this.from + this.factor * (now - this.since) / 1000; },
};

// Starts the closed loop or a run of an experiment; starts are serialized.
let starting = Promise.resolve();
function start(scenario, values) {
  starting = starting.then(() => startNow(scenario, values));
  return starting;
}

async function startNow(scenario, values) {
  element("failure").hidden = true;
  element("warnings").hidden = true;
  element("warnings").querySelector("ul").replaceChildren();
  state.failed = false;
  state.run = undefined;
  try {
    const run = await Run.start(state.models, scenario, values, warn);
    await plots.show(run, document.querySelectorAll("template.plots")[scenario.template]);
    await engine.of(run.instance("plant"));
    state.run = run;
  } catch (error) {
    fail(error);
  }
  pace.begin();
}

async function startLoop() {
  state.experiment = undefined;
  element("sliders").disabled = false;
  document.querySelectorAll("#choices [aria-current]").forEach(button => button.removeAttribute("aria-current"));
  element("caption").textContent = "Closed loop. Plots pause under the cursor and while zoomed; “Reset axes” resumes them.";
  const inputs = laboratory.loop.inputs.map(([name]) => [name, state.inputs.get(name)]);
  await start({ ...laboratory.loop, inputs }, { plant: state.plant, controller: [...state.parameters] });
}

async function startExperiment(experiment, button) {
  document.querySelectorAll("#choices button").forEach(other => other.removeAttribute("aria-current"));
  button.setAttribute("aria-current", "true");
  Object.assign(state, { experiment, finished: [] });
  element("sliders").disabled = true;
  element("results").replaceChildren();
  setRunning(false);
  await nextRun();
  setRunning(true);
}

async function nextRun() {
  const { experiment, finished } = state;
  const scenario = experiment.runs[finished.length];
  const changes = scenario.fmus.flatMap(fmu => fmu.values.map(([name, value]) => `${name} = ${value}`)).join(", ");
  const which = experiment.runs.length > 1 ? `, run ${finished.length + 1} of ${experiment.runs.length}` : "";
  element("caption").textContent = `Fig. ${experiment.number}${which}: ${scenario.title}${changes ? ` (${changes})` : ""}.`;
  say(`Running Fig. ${experiment.number}${which}; the experiment sets the controls. Reset returns to the loop.`);
  await start(scenario, {});
}

// After a run of an experiment: the next run, or the results.
async function finish() {
  const { experiment, finished, run } = state;
  if (!experiment) return setRunning(false);
  finished.push(run);
  if (finished.length < experiment.runs.length) return nextRun();
  setRunning(false);
  showResults(experiment, MEASURES[experiment.number](finished));
  return undefined;
}

function showResults(experiment, measures) {
  let holding = 0;
  const rows = experiment.claims.map(claim => {
    const value = measures[claim.name];
    const holds = value >= (claim.least ?? -Infinity) && value <= (claim.most ?? Infinity);
    holding += holds;
    const cell = (label, text) => {
      const made = make("td", { className: "number", textContent: text ?? "" });
      made.dataset.label = label;
      return made;
    };
    const verdict = make("td", {}, make("span", { className: holds ? "holds" : "fails", textContent: holds ? "holds" : "fails" }));
    const row = make(
      "tr", {}, make("td", { textContent: claim.paper }, make("div", { className: "how", textContent: `${claim.basis}: ${claim.how}` })),
      cell("paper", claim.inPaper), cell("here", `${number(claim.factor * value)} ${claim.unit}`.trim()), cell("laboratory", claim.found),
      cell("accepted", claim.asked), verdict,
    );
    row.dataset.claim = claim.name;
    return row;
  });
  const head = ["Claim", "Paper", "Here", "Laboratory", "Accepted", ""].map(text => make("th", { textContent: text }));
  const table = make("table", {}, make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...rows));
  const title = `Fig. ${experiment.number}: ${holding} of ${rows.length} claims hold.`;
  element("results").replaceChildren(make("h3", { textContent: title }), table);
  say(`Experiment finished. ${title}`);
}

// One step; drops the oldest rows.
function stepOnce() {
  state.run.step();
  if (!state.experiment && state.run.time.length > ROWS + MORE_ROWS) state.run.keep(ROWS);
}

// Takes the steps due, within the frame's budget.
function advance(now) {
  const end = performance.now() + (pace.factor === Infinity ? BUDGET.most : BUDGET.paced);
  const due = pace.due(now);
  while (state.run && !state.run.isOver && state.run.now < due) {
    stepOnce();
    if (performance.now() > end) {
      // Do not catch up on lost time.
      if (pace.factor !== Infinity) pace.begin(now);
      break;
    }
  }
}

// Achieved pace and main-thread time over the last second.
const meter = { since: 0, from: 0, spent: 0, frames: 0 };

function frame(now) {
  const begun = performance.now();
  const { run } = state;
  const isDue = !lessMotion.matches || now - (frame.shown ?? 0) > STILL;
  try {
    if (state.isRunning && run) {
      advance(now);
    }
    if (run && isDue) {
      if (frame.steps !== run.stepsDone || frame.run !== run) {
        plots.changed();
        engine.update(state.isRunning ? Math.min((now - (frame.shown ?? now)) / 1000, 0.1) : 0);
        Object.assign(frame, { steps: run.stepsDone, run });
      }
      if (lessMotion.matches) plots.drawAll();
      else plots.drawNext();
      frame.shown = now;
    }
  } catch (error) {
    fail(error);
  }
  meter.spent += performance.now() - begun;
  meter.frames += 1;
  if (run && (now - meter.since > 1000 || run.now < meter.from)) showMeter(now, run);
  requestAnimationFrame(frame);
  // Start the next run only once, since frames continue while it is prepared.
  if (state.isRunning && run?.isOver && frame.over !== run) {
    frame.over = run;
    finish().catch(fail);
  }
}

function showMeter(now, run) {
  // A new run has no pace yet.
  const reached = Math.max(run.now - meter.from, 0) / ((now - meter.since) / 1000);
  const load = meter.spent / meter.frames;
  const shownPace = state.isRunning ? `${number(Number(reached.toPrecision(2)))} × · ${load.toFixed(1)} ms a frame` : "paused";
  element("clock").replaceChildren(make("b", { textContent: `${run.now.toFixed(2)} s` }), ` ${shownPace}`);
  Object.assign(element("clock").dataset, { time: run.now, load: load.toFixed(2), pace: reached.toFixed(2) });
  Object.assign(meter, { since: now, from: run.now, spent: 0, frames: 0 });
}

// A changed input or parameter takes effect at the next step and survives a reset.
function set(slider, value) {
  const { fmu, name } = slider;
  if (state.inputs.has(name)) {
    state.inputs.set(name, { constant: value });
    state.run?.signals.set(name, { constant: value });
    return;
  }
  state.parameters.set(name, value);
  try {
    if (state.run && !state.failed) state.run.instance(fmu).setValue(name, value);
  } catch (error) {
    fail(error);
  }
}

const words = name => name.replaceAll("_", " ").replace(/^./, letter => letter.toUpperCase());
// The first part of a description, without details.
const brief = text => text.split(/[;,(]/, 1)[0].trim();

function control(name, description, ...children) {
  const note = make("small", { id: `${name}-note`, textContent: brief(description), title: description });
  return make("div", { className: "control" }, make("label", { htmlFor: name, textContent: words(name) }), ...children, note);
}

// A slider over the operating range, and a field for the whole declared range.
function makeSlider(slider) {
  const variable = state.models[slider.fmu].variables.get(slider.name);
  const { factor, offset, unit } = variable.display;
  const show = value => Number((factor * value + offset).toPrecision(6));
  const [low, high] = slider.range.map(show);
  const begin = state.inputs.get(slider.name)?.constant ?? variable.start;
  const size = 10 ** Math.floor(Math.log10((high - low) / 50));
  const range = make("input", { type: "range", id: slider.name, min: low, max: high, step: size, defaultValue: show(begin) });
  const field = make("input", { type: "number", min: show(variable.min), max: show(variable.max), step: "any", defaultValue: show(begin) });
  range.setAttribute("aria-describedby", `${slider.name}-note`);
  const read = value => range.setAttribute("aria-valuetext", `${value} ${unit}`.trim());
  read(range.value);
  field.setAttribute("aria-label", [words(slider.name), unit].filter(Boolean).join(", "));
  const change = (value, other) => {
    other.value = value;
    read(value);
    set(slider, (value - offset) / factor);
  };
  range.addEventListener("input", () => change(Number(range.value), field));
  field.addEventListener("change", () => {
    const value = Math.min(Math.max(Number(field.value), Number(field.min)), Number(field.max));
    field.value = value;
    change(value, range);
  });
  return control(slider.name, variable.description, make("span", { className: "field" }, field, make("span", { textContent: UNITS[unit] ?? unit })), range);
}

function makeSwitch() {
  const [fmu, name] = ["controller", "compensate_voltage"];
  const variable = state.models[fmu].variables.get(name);
  const box = make("input", { type: "checkbox", id: name, defaultChecked: variable.start === 1 });
  box.setAttribute("aria-describedby", `${name}-note`);
  box.addEventListener("change", () => set({ fmu, name }, box.checked));
  return control(name, variable.description, box);
}

function makePlants() {
  const plants = [{ name: "as tuned for", description: "Changing the plant restarts the simulation.", values: [] }, ...laboratory.plants];
  const select = make("select", { id: "plant" }, ...plants.map(({ name }, index) => make("option", { value: index, textContent: name })));
  select.setAttribute("aria-describedby", "plant-note");
  const made = control("plant", plants[0].description, select);
  select.addEventListener("change", () => {
    const { values, description } = plants[select.value];
    state.plant = values;
    made.querySelector("small").textContent = description;
    startLoop();
  });
  return made;
}

// Saves the record; numbers read back as the same doubles.
function saveCsv() {
  const { run, experiment, finished } = state;
  if (!run) return;
  const columns = [["time", run.time], ...run.columns];
  const rows = [columns.map(([name]) => name), ...run.time.map((_, row) => columns.map(([, values]) => values[row]))];
  const text = `${rows.map(row => row.join(",")).join("\n")}\n`;
  const name = experiment ? `figure_${experiment.number}_run_${Math.min(finished.length + 1, experiment.runs.length)}.csv` : "boost.csv";
  const link = make("a", { href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
  say(`${name}: ${run.time.length} rows.`);
}

function serve() {
  const defaults = make("button", { type: "reset", id: "defaults", textContent: "Defaults" });
  element("sliders").append(...laboratory.sliders.map(makeSlider), makeSwitch(), makePlants(), defaults);
  // The controls are reset only after this event; then report their values as changes.
  element("settings").addEventListener("reset", () => setTimeout(() => {
    document.querySelectorAll("#sliders [id]:is(input, select)").forEach(input => input.dispatchEvent(new Event(input.type === "range" ? "input" : "change")));
  }));
  element("run").addEventListener("click", async () => {
    if (!state.isRunning && state.run?.isOver) await reset();
    setRunning(!state.isRunning);
    say(state.isRunning ? "Running." : `Paused at ${state.run?.now.toFixed(4)} s.`);
  });
  element("step").addEventListener("click", () => {
    setRunning(false);
    if (!state.run || state.run.isOver || state.failed) return;
    try {
      stepOnce();
      say(`Stepped to ${state.run.now.toFixed(4)} s.`);
    } catch (error) {
      fail(error);
    }
  });
  const reset = async () => {
    await startLoop();
    element("results").replaceChildren();
    say("Closed loop restarted at rest.");
  };
  for (const button of [element("reset"), element("failure").querySelector("button")]) {
    button.addEventListener("click", async () => {
      const wasFailed = state.failed;
      await reset();
      if (wasFailed) setRunning(true);
    });
  }
  element("pace").addEventListener("change", () => {
    pace.factor = Number(element("pace").value);
    pace.begin();
  });
  element("csv").addEventListener("click", saveCsv);
  document.querySelectorAll("#choices button").forEach((button, index) =>
    button.addEventListener("click", () => startExperiment(laboratory.experiments[index], button)));
  // A hidden page does not catch up.
  document.addEventListener("visibilitychange", () => pace.begin());
}

async function begin() {
  const models = Object.entries(laboratory.modules).map(async ([name, module]) => [name, await Model.compile(module)]);
  state.models = Object.fromEntries(await Promise.all(models));
  plots = new Plots(element("plots"));
  engine = new Engine(element("engine"), element("values"), !lessMotion.matches);
  serve();
  await startLoop();
  setRunning(!lessMotion.matches);
  if (lessMotion.matches) say("Your system prefers reduced motion: press Run to start.");
  requestAnimationFrame(frame);
  // For tests.
  globalThis.live = state;
}

begin().catch(fail);
