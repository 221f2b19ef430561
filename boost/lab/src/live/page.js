// What runs and how fast: the closed loop with the user's settings, or an experiment of the paper.

const laboratory = JSON.parse(document.getElementById("laboratory").textContent);
const element = id => document.getElementById(id);
const lessMotion = matchMedia("(prefers-reduced-motion: reduce)");
// The FMUs' share of a 16 ms frame (ms): at the chosen pace, and as fast as possible.
const BUDGET = { paced: 10, most: 24 };
// Rows kept of the endless loop (25 min), and by how many it may exceed them before the oldest are dropped.
const [ROWS, MORE_ROWS] = [120_000, 12_000];
// Update interval with reduced motion (ms), and that of an experiment's figure and controls.
const [STILL, SLOW] = [1000, 400];
// An experiment ends within this time (s), unless the user has chosen a pace.
const SOON = 15;
const REAL_TIME = "1";

// A time without the round-off of sums.
const seconds = time => `${Number(time.toFixed(6))} s`;
// The runs so far, of an experiment all.
const runsOf = () => [...new Set([...state.finished, state.run])].filter(Boolean);

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

// The current run, and of an experiment the finished ones.
const state = { models: {}, run: undefined, isRunning: false, failed: false, experiment: undefined, finished: [], held: undefined };
let plots, engine, controls;

const say = text => { element("status").textContent = text; };

function fail(error) {
  state.failed = true;
  setRunning(false);
  const isFailure = error instanceof Failure;
  element("failure").firstElementChild.textContent = isFailure ? error.message : `The page failed: ${error.message}`;
  element("failure").hidden = false;
  if (!isFailure) throw error;
}

function attempt(action) {
  try {
    action();
  } catch (error) {
    fail(error);
  }
}

// Warnings are read out, and stay until the next start.
function warn(text) {
  say(text);
  element("warnings").hidden = false;
  element("warnings").querySelector("ul").append(make("li", { textContent: `${seconds(state.run?.now ?? 0)}: ${text}` }));
}

function setRunning(isRunning) {
  const isDone = state.experiment && state.run?.isOver;
  state.isRunning = isRunning && !state.failed && !isDone;
  element("run").textContent = state.isRunning ? "Pause" : "Run";
  // An experiment's records stay until Reset.
  element("run").disabled = element("step").disabled = Boolean(isDone) && state.finished.length === state.experiment.runs.length;
  pace.begin();
}

// The simulation time due by now.
const pace = {
  get factor() { return Number(element("pace").value); },
  begin(now = performance.now()) { Object.assign(this, { since: now, from: state.run?.now ?? 0 }); },
  due(now) { return this.from + this.factor * (now - this.since) / 1000; },
  // Takes the slowest pace at which a duration (s) ends soon, in place of real time.
  raise(duration) {
    this.lower();
    const select = element("pace");
    if (select.value !== REAL_TIME) return;
    this.raised = [...select.options].find(({ value }) => value >= 1 && duration / value <= SOON).value;
    select.value = this.raised;
  },
  lower() {
    if (element("pace").value === this.raised) element("pace").value = REAL_TIME;
    this.raised = undefined;
  },
};

// Starts the closed loop or a run of an experiment; starts are serialized.
let starting = Promise.resolve();
function start(scenario, values, show = async () => {}) {
  starting = starting.then(() => startNow(scenario, values, show));
  return starting;
}

async function startNow(scenario, values, show) {
  element("failure").hidden = true;
  element("warnings").hidden = true;
  element("warnings").querySelector("ul").replaceChildren();
  state.failed = false;
  state.run = undefined;
  try {
    const run = await Run.start(state.models, scenario, values, warn);
    await show(run);
    await engine.of(run.instance("plant"));
    state.run = run;
  } catch (error) {
    fail(error);
  }
  pace.begin();
}

const templateOf = (kind, index) => document.querySelectorAll(`template.${kind}`)[index];

// Puts the page in the state before the loop, or an experiment chosen by its button.
function choose(experiment, chosen) {
  Object.assign(state, { experiment, finished: [] });
  element("results").replaceChildren();
  element("hold").disabled = controls.disabled = Boolean(experiment);
  document.querySelectorAll("#choices [aria-current]").forEach(button => button.removeAttribute("aria-current"));
  chosen?.setAttribute("aria-current", "true");
}

async function startLoop() {
  if (state.experiment) controls.showAll();
  choose();
  pace.lower();
  const inputs = laboratory.loop.inputs.map(([name]) => [name, { constant: controls.get(name).value }]);
  const values = { plant: [...controls.plantValues(), ...controls.parameters("plant")], controller: controls.parameters("controller") };
  await start({ ...laboratory.loop, inputs }, values, run => plots.show(run, templateOf("plots", 0), state.held));
}

async function startExperiment(experiment, button) {
  choose(experiment, button);
  const { runs, number: figure } = experiment;
  pace.raise(runs.reduce((sum, { steps, step }) => sum + steps * step, 0));
  setRunning(false);
  const show = () => plots.showFigure(templateOf("plots", 1 + laboratory.experiments.indexOf(experiment)), () => FIGURES[figure](runsOf()));
  await nextRun(show);
  setRunning(true);
}

async function nextRun(show) {
  const { experiment, finished } = state;
  const scenario = experiment.runs[finished.length];
  const constants = fmu => fmu.inputs.filter(([, signal]) => "constant" in signal).map(([name, { constant }]) => [name, constant]);
  const own = scenario.fmus.flatMap(fmu => [...fmu.values, ...constants(fmu)]);
  const changes = own.map(([name, value]) => `${name} = ${typeof value === "number" ? number(value) : value}`).join(", ");
  const which = experiment.runs.length > 1 ? `, run ${finished.length + 1} of ${experiment.runs.length}` : "";
  say(`Fig. ${experiment.number}${which}, ${seconds(scenario.steps * scenario.step)}: ${scenario.title}${changes ? ` (${changes})` : ""}. Reset returns to the loop.`);
  await start(scenario, {}, show);
  if (state.run) state.follow = controls.follow(state.run);
}

// After a run of an experiment: the next run, or the results.
async function finish() {
  const { experiment, finished, run } = state;
  if (!experiment) return setRunning(false);
  finished.push(run);
  if (finished.length < experiment.runs.length) return nextRun();
  setRunning(false);
  plots.changed();
  plots.drawAll();
  showResults(experiment, templateOf("results", laboratory.experiments.indexOf(experiment)));
  return undefined;
}

// The laboratory's results, as in its report.
function showResults({ number }, { content }) {
  element("results").replaceChildren(content.cloneNode(true));
  say(`Fig. ${number} is drawn. Save CSV saves each run; Reset returns to the loop.`);
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
    if (state.isRunning && run) advance(now);
    if (run && isDue) {
      if (frame.steps !== run.stepsDone || frame.run !== run) {
        if (!state.experiment) plots.changed();
        else if (now - (frame.slow ?? 0) > SLOW) {
          plots.changed();
          state.follow?.();
          frame.slow = now;
        }
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

// A changed input or tunable parameter takes effect at the next step, another one restarts the loop. An experiment has
// its own.
function change({ fmu, name, value, isOf }) {
  if (!state.run || state.failed || state.experiment) return;
  attempt(() => {
    if (isOf === "signal") state.run.signals.set(name, { constant: value });
    else if (isOf === "tunable") state.run.instance(fmu).setValue(name, value);
    else startLoop();
  });
}

// Saves the records, with units below the names; numbers read back as the same doubles.
function saveCsv() {
  const { experiment } = state;
  runsOf().forEach((run, index) => {
    const { record } = run.scenario;
    const columns = [run.time, ...record.map(name => run.columns.get(name))];
    const rows = [["time", ...record], ["# s", ...record.map(unitOf)], ...run.time.map((_, row) => columns.map(values => values[row]))];
    const text = `${rows.map(row => row.join(",")).join("\n")}\n`;
    const name = experiment ? `figure_${experiment.number}_run_${index + 1}.csv` : "boost.csv";
    const link = make("a", { href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: name });
    link.click();
    URL.revokeObjectURL(link.href);
    say(`${name}: ${run.time.length} rows.`);
  });
}

// The unit of a recorded variable.
function unitOf(column) {
  const name = column.slice(column.indexOf(":") + 1);
  return Object.values(state.models).map(({ variables }) => variables.get(name)).find(Boolean).unit;
}

function serve() {
  element("run").addEventListener("click", () => {
    setRunning(!state.isRunning);
    say(state.isRunning ? "Running." : `Paused at ${seconds(state.run?.now ?? 0)}.`);
  });
  element("step").addEventListener("click", () => {
    setRunning(false);
    if (!state.run || state.run.isOver || state.failed) return;
    attempt(() => {
      stepOnce();
      showMeter(performance.now(), state.run);
      say(`Stepped to ${seconds(state.run.now)}.`);
    });
  });
  const reset = async () => {
    await startLoop();
    setRunning(state.isRunning);
    say("Closed loop restarted at rest.");
  };
  for (const button of [element("reset"), element("failure").querySelector("button")]) {
    button.addEventListener("click", async () => {
      const wasFailed = state.failed;
      await reset();
      if (wasFailed) setRunning(true);
    });
  }
  element("pace").addEventListener("change", () => pace.begin());
  element("hold").addEventListener("click", () => {
    state.held = state.held ? undefined : state.run;
    element("hold").setAttribute("aria-pressed", Boolean(state.held));
    say(state.held ? "Held: this run stays as a thin line under the next. Reset starts it." : "Released: the next run starts alone.");
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
  plots = new Plots(element("plots"), new Cursors(element("cursors")));
  engine = new Engine(element("engine"), element("values"), !lessMotion.matches);
  controls = new Controls(element("settings"), laboratory.controls, state.models, laboratory.plants, change);
  controls.readAddress();
  addEventListener("hashchange", () => controls.readAddress());
  serve();
  await startLoop();
  setRunning(!lessMotion.matches);
  if (lessMotion.matches) say("Your system prefers reduced motion: press Run to start.");
  requestAnimationFrame(frame);
  // For tests.
  globalThis.live = state;
}

begin().catch(fail);
