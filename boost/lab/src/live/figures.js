// The paper's figures from an experiment's records so far: for each, the lines of the laboratory's drawings in their
// order, as lists of x and y. A run that has not started has no points.

const NO_POINTS = [[], []];
const [KILO, PERCENT] = [1e-3, 100];

// Tolerance of communication points, which are multiples of the step (s).
const SAME_TIME = 1e-6;

const rowOf = (run, time) => run.time.findIndex(point => Math.abs(point - time) <= SAME_TIME);
const at = (run, name, time) => run.columns.get(name)[rowOf(run, time)];
const stop = run => run.scenario.start + run.scenario.steps * run.scenario.step;

// The ends of a signal's steps.
const endsOf = (run, name) => [...pointsOf(run.signal(name)).slice(1).map(([time]) => time), stop(run)];

// Table 1, eqs. (6) and (7), from the plant's parameters; eq. (1) is choked, with the flow function of air.
function tableOf(run) {
  const parameter = name => run.instance("plant").variable(name).start;
  const coefficients = (name, count) => Array.from({ length: count }, (_, index) => parameter(`${name}[${index + 1}]`));
  const polynomial = (factors, x) => factors.reduce((sum, factor) => sum * x + factor, 0);
  const [pressures, leakage] = [coefficients("valve.pressure_coefficient", 4), coefficients("valve.leakage_coefficient", 3)];
  const ambient = at(run, "ambient_pressure", 0);
  return {
    pressure: duty => Math.min(polynomial(pressures, duty), ambient),
    area: duty => parameter("valve.leakage_area_scale") * Math.max(polynomial(leakage, duty), 0),
    areaOf: (flow, around, temperature) => flow * Math.sqrt(parameter("air.gas_constant") * temperature) / (around * 0.684731),
  };
}

// Variables with their factors over time.
function lines(run, ...variables) {
  return variables.map(([name, factor = 1]) => (run ? [run.time, run.columns.get(name).map(value => factor * value)] : NO_POINTS));
}

// Actual boost pressure minus its reference (kPa).
function errorOf(run) {
  if (!run) return NO_POINTS;
  const references = run.columns.get("boost_reference");
  return [run.time, run.columns.get("boost_pressure").map((value, row) => KILO * (value - references[row]))];
}

// Variables with their factors at the ends of a signal's steps, over its values.
function overSteps(run, signal, ...variables) {
  if (!run) return variables.map(() => NO_POINTS);
  const ends = endsOf(run, signal).filter(end => rowOf(run, end) >= 0);
  const places = pointsOf(run.signal(signal)).slice(0, ends.length).map(([, value]) => value);
  return variables.map(([name, factor]) => [places, ends.map(end => factor * at(run, name, end))]);
}

const FIGURES = {
  1: ([dip]) => lines(dip, ["supply_voltage"], ["actuator_pressure", KILO], ["hp_wastegate_position", PERCENT], ["boost_pressure", KILO]),

  6([run]) {
    const duties = Array.from({ length: 401 }, (_, index) => 0.25 * index);
    const table = tableOf(run);
    const ambient = ["ambient_pressure", "ambient_temperature"].map(name => at(run, name, 0));
    const variables = [["valve.leakage_mass_flow", 1e6 * table.areaOf(1, ...ambient)], ["actuator_pressure", KILO]];
    const [leakage, pressure] = overSteps(run, "hp_wastegate_pwm", ...variables);
    return [[duties, duties.map(duty => 1e6 * table.area(duty))], leakage, [duties, duties.map(duty => KILO * table.pressure(duty))], pressure];
  },

  // The ramp turns at half of its time.
  7([ramp]) {
    const turn = ramp.scenario.steps / 2;
    const duties = ramp.columns.get("hp_wastegate_pwm");
    return lines(ramp, ["actuator_pressure", KILO], ["hp_wastegate_position", PERCENT]).flatMap(([, values]) => [
      [duties.slice(0, turn + 1), values.slice(0, turn + 1)],
      [duties.slice(turn).reverse(), values.slice(turn).reverse()],
    ]);
  },

  8([ramp, pumping]) {
    const [[, positions], [, forces]] = lines(ramp, ["actuator.position", 1e3], ["actuator.spring_force"]);
    const rows = ramp.scenario.steps / 2;
    return [
      [positions.slice(0, rows), forces.slice(0, rows)],
      ...lines(pumping, ["valve.voltage"], ["tank_pressure", KILO], ["hp_wastegate_position", PERCENT], ["exhaust_manifold_pressure", KILO]),
    ];
  },

  // Row by row, each of ramp and step.
  9(runs) {
    const rows = [[["hp_wastegate_pwm"]], [["valve.pressure", KILO], ["actuator_pressure", KILO], ["tank_pressure", KILO]], [["hp_wastegate_position", PERCENT]]];
    return rows.flatMap(variables => [0, 1].flatMap(index => lines(runs[index], ...variables)));
  },

  10([, without, compensated]) {
    const [position] = lines(without, ["hp_wastegate_position", PERCENT]);
    const [voltage, ...others] = lines(compensated, ["supply_voltage"], ["hp_wastegate_position", PERCENT], ["hp_wastegate_pwm"]);
    return [voltage, position, ...others];
  },

  11([shut, open]) {
    const variables = [["engine_torque", 1], ["boost_pressure", KILO], ["exhaust_manifold_pressure", KILO]];
    const [one, other] = [shut, open].map(run => overSteps(run, "engine_speed", ...variables));
    return one.flatMap((line, index) => [line, other[index]]);
  },

  12: ([run]) => lines(
    run, ["boost_reference", KILO], ["reference_model_pressure", KILO], ["boost_pressure", KILO],
    ["feedforward_pwm"], ["unsaturated_pwm"], ["hp_wastegate_pwm"], ["proportional_term"], ["integral_term"], ["derivative_term"],
  ),

  13: runs => [0, 1].flatMap(index => {
    const [reference, actual, duty] = lines(runs[index], ["boost_reference", KILO], ["boost_pressure", KILO], ["hp_wastegate_pwm"]);
    return [reference, actual, errorOf(runs[index]), duty];
  }),

  14([run, without]) {
    const [voltage, reference, actual, duty] = lines(run, ["supply_voltage"], ["boost_reference", KILO], ["boost_pressure", KILO], ["hp_wastegate_pwm"]);
    return [voltage, reference, actual, errorOf(without), errorOf(run), duty];
  },
};
