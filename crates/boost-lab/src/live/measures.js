// The paper's numbers from an experiment's records: for each figure, from its runs in order, the values of the claims
// of `boost-lab reproduce`, by name.

// Tolerance of communication points, which are multiples of the step (s).
const SAME_TIME = 1e-6;

const greatest = values => values.reduce((most, value) => Math.max(most, value), -Infinity);
const least = values => values.reduce((most, value) => Math.min(most, value), Infinity);
const range = values => greatest(values) - least(values);
const rowOf = (run, time) => run.time.findIndex(point => Math.abs(point - time) <= SAME_TIME);
const at = (run, name, time) => run.columns.get(name)[rowOf(run, time)];
const between = (run, name, from, to) => run.columns.get(name).slice(rowOf(run, from), rowOf(run, to) + 1);
const stop = run => run.scenario.start + run.scenario.steps * run.scenario.step;

// The times of a signal's steps.
const edgesOf = (run, name) => pointsOf(run.signal(name)).slice(1).map(([time]) => time);
// The ends of a signal's steps.
const endsOf = (run, name) => [...edgesOf(run, name), stop(run)];

const interpolate = (points, place) => signalAt({ lines: points }, place);

// How a variable tracked the steps of its reference: the worst overshoot up and down, rise time and final error.
function following(run, name, reference) {
  const steps = pointsOf(run.signal(reference));
  const ends = endsOf(run, reference).slice(1);
  const found = { up: [], down: [], rise: [], end: [] };
  steps.slice(1).forEach(([begin, after], index) => {
    const before = steps[index][1];
    const values = between(run, name, begin, ends[index]);
    if (after > before) found.up.push(greatest(values) - after);
    else found.down.push(after - least(values));
    const reached = values.findIndex(value => Math.abs(value - after) <= 0.1 * Math.abs(after - before));
    found.rise.push(reached < 0 ? Infinity : run.time[rowOf(run, begin) + reached] - begin);
    found.end.push(Math.abs(values.at(-1) - after));
  });
  return Object.fromEntries(Object.entries(found).map(([key, values]) => [key, greatest(values)]));
}

// The time from a step until a variable has completed a share of its change (s).
function settling(run, name, begin, end, share) {
  const values = between(run, name, begin, end);
  const reached = values.findIndex(value => (value - values[0]) / (values.at(-1) - values[0]) >= share);
  return run.time[rowOf(run, begin) + reached] - begin;
}

// A variable over rising and falling duty, one point per duty.
function branches(run, name) {
  const duties = run.columns.get("hp_wastegate_pwm");
  const points = run.columns.get(name).map((value, row) => [duties[row], value]);
  const half = Math.floor(points.length / 2);
  return [points.slice(0, half + 1), points.slice(half).reverse()].map(branch => {
    const ascending = [];
    for (const point of branch) if (!ascending.length || point[0] > ascending.at(-1)[0]) ascending.push(point);
    return ascending;
  });
}

// The largest difference between the branches at equal duty, from 5 % to a limit.
function gap([up, down], most) {
  const duties = Array.from({ length: 361 }, (_, index) => 5 + 0.25 * index).filter(duty => duty < most);
  return greatest(duties.map(duty => Math.abs(interpolate(up, duty) - interpolate(down, duty))));
}

// Full load over engine speed: torque and pressure upstream of the turbines at the end of each step.
function fullLoad(run) {
  const ends = endsOf(run, "engine_speed");
  const speeds = pointsOf(run.signal("engine_speed")).map(([, speed]) => speed);
  const read = name => ends.map(end => at(run, name, end));
  const [torques, pressures] = [read("engine_torque"), read("exhaust_manifold_pressure")];
  const near = (values, speed) => values[speeds.indexOf(speed)];
  return { speeds, torques, torque: speed => near(torques, speed), pressure: speed => near(pressures, speed), best: speeds[torques.lastIndexOf(greatest(torques))] };
}

// The largest error of boost pressure after the start.
function deviation(run) {
  const [boost, reference] = ["boost_pressure", "boost_reference"].map(name => run.columns.get(name));
  return greatest(boost.map((value, row) => (run.time[row] > 3 ? Math.abs(value - reference[row]) : -Infinity)));
}

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

const MEASURES = {
  1([dip]) {
    const [begin, end] = edgesOf(dip, "supply_voltage");
    const change = name => at(dip, name, end) - at(dip, name, begin);
    return { actuator_pressure_change: change("actuator_pressure"), position_change: -100 * change("hp_wastegate_position") };
  },

  6([run]) {
    const table = tableOf(run);
    const ends = endsOf(run, "hp_wastegate_pwm");
    const errors = pointsOf(run.signal("hp_wastegate_pwm")).map(([, duty], index) => {
      const [pressure, flow, ...around] =
        ["actuator_pressure", "valve.leakage_mass_flow", "ambient_pressure", "ambient_temperature"].map(name => at(run, name, ends[index]));
      return [Math.abs(pressure - table.pressure(duty)), Math.abs(table.areaOf(flow, ...around) - table.area(duty))];
    });
    return { pressure_deviation: greatest(errors.map(([p]) => p)), leakage_area_deviation: 1e6 * greatest(errors.map(([, area]) => area)) };
  },

  7([ramp]) {
    // Above 85 % tank pressure is the lower limit.
    return {
      position_hysteresis: 100 * gap(branches(ramp, "hp_wastegate_position"), 95.01),
      pressure_hysteresis: gap(branches(ramp, "actuator_pressure"), 85),
    };
  },

  8([ramp, pumping]) {
    const half = Math.floor(ramp.time.length / 2);
    const positions = ramp.columns.get("actuator.position").slice(0, half).map(x => 1e3 * x);
    const forces = ramp.columns.get("actuator.spring_force");
    const near = place => {
      const distances = positions.map(x => Math.abs(x - place));
      return distances.indexOf(least(distances));
    };
    const stiffness = (from, to) => {
      const [a, b] = [near(from), near(to)];
      return (forces[b] - forces[a]) / (positions[b] - positions[a]);
    };
    const runs = pumping.columns.get("vacuum_pump").map(value => value > 0.5);
    const [first, last] = [runs.indexOf(true), runs.lastIndexOf(true)];
    // A row holds the controller outputs of the previous communication point.
    const changes = name => {
      const values = pumping.columns.get(name);
      return values.slice(first, last + 1).map(value => value - values[first - 1]);
    };
    return {
      spring_stiffening: stiffness(8, 9.5) / stiffness(1, 4),
      pump_on: pumping.time[first - 1],
      pump_duration: pumping.time[last] - pumping.time[first - 1],
      voltage_drop: -least(changes("valve.voltage")),
      position_change: greatest(changes("hp_wastegate_position").map(change => 100 * Math.abs(change))),
    };
  },

  9([ramp, step]) {
    const [actuator, valve, tank] = ["actuator_pressure", "valve.pressure", "tank_pressure"].map(name => ramp.columns.get(name));
    const [up, down] = edgesOf(step, "hp_wastegate_pwm");
    return {
      ramp_deviation: greatest(actuator.map((pressure, row) => Math.abs(pressure - Math.max(valve[row], tank[row])))),
      evacuation_time: settling(step, "actuator_pressure", up, down, 0.95),
      venting_time: settling(step, "actuator_pressure", down, stop(step), 0.95),
      tank_is_floor: greatest(actuator.map((pressure, row) => tank[row] - pressure)),
      tank_pressure_rise: at(step, "tank_pressure", down) - at(step, "tank_pressure", up),
    };
  },

  10([exact, without, compensated]) {
    const edges = edgesOf(compensated, "supply_voltage");
    const position = time => at(compensated, "hp_wastegate_position", time);
    return {
      position_range_exact: 100 * range(exact.columns.get("hp_wastegate_position")),
      position_at_rest: 100 * Math.abs(position(edges[0] + 3.9) - position(edges[0])),
      position_after_pulse: greatest(edges.map(edge => 100 * Math.abs(position(edge + 0.1) - position(edge + 3.9)))),
      position_range_without: 100 * range(without.columns.get("hp_wastegate_position")),
    };
  },

  11(runs) {
    const [shut, open] = runs.map(fullLoad);
    return {
      speed_of_greatest_torque: open.best - shut.best,
      torque_gained: shut.torque(1500) - open.torque(1500),
      torque_lost_at_2000_rpm: greatest(shut.torques) - shut.torque(2000),
      back_pressure_at_2000_rpm: 1e-3 * shut.pressure(2000),
      torque_gained_open_above_2000_rpm: least(
        shut.torques.flatMap((torque, index) => (shut.speeds[index] > 2000 ? [100 * (open.torques[index] / torque - 1)] : [])),
      ),
    };
  },

  12([run]) {
    const get = name => run.columns.get(name).slice(1);
    const terms = ["feedforward_pwm", "proportional_term", "integral_term", "derivative_term"].map(get);
    const [unsaturated, compensation, output, lowest, highest] =
      ["unsaturated_pwm", "voltage_compensation", "hp_wastegate_pwm", "pwm_min", "pwm_max"].map(get);
    const limited = unsaturated.map((duty, row) => Math.min(Math.max(duty, lowest[row]), Math.min(highest[row], 100 / compensation[row])));
    return {
      sum_of_terms: greatest(unsaturated.map((duty, row) => Math.abs(terms.reduce((sum, term) => sum + term[row], 0) - duty))),
      compensated_output: greatest(limited.map((duty, row) => Math.abs(duty * compensation[row] - output[row]))),
      limits_act: get("saturated").reduce((sum, value) => sum + value, 0),
    };
  },

  13([run, paper]) {
    const [found, papers] = [run, paper].map(each => following(each, "boost_pressure", "boost_reference"));
    return {
      overshoot_up: found.up, overshoot_down: found.down, rise_time: found.rise, end_error: found.end,
      least_duty: least(run.columns.get("hp_wastegate_pwm")),
      paper_structure_overshoot_up: papers.up, paper_structure_overshoot_down: papers.down,
    };
  },

  14([run, without]) {
    const positions = endsOf(run, "supply_voltage").map(end => at(run, "hp_wastegate_position", end));
    return { deviation: deviation(run), rejection: deviation(without) / deviation(run), position_at_rest: 100 * range(positions) };
  },
};
