"""The life of an instance: reset, saved states, and steps of any size."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from conftest import Make
from experiments import couple, ramp, staircase
from master import Fmu, Instance, Master, Reals, Record

STEP = 1 / 80

BOTH = pytest.mark.parametrize("name", ["BoostPlant", "BoostController"])


def stir(instance: Instance, begin: int, end: int) -> np.ndarray:
    """Steps with changing inputs; all outputs after each step."""
    inputs = Reals(instance, ["engine_speed"])
    outputs = Reals(instance, instance.fmu.named("output"))
    result = []
    for index in range(begin, end):
        inputs.set([1500.0 + 400.0 * math.sin(0.1 * index)])
        instance.slave.doStep(index * STEP, STEP)
        result.append(outputs.get().copy())
    return np.array(result)


@BOTH
def test_wrong_guid_makes_no_instance(fmus: dict[str, Fmu], name: str) -> None:
    fmu = fmus[name]
    guid = fmu.description.guid
    fmu.description.guid = "{00000000-0000-0000-0000-000000000000}"
    try:
        with pytest.raises(Exception, match="instantiate"):
            Instance(fmu)
    finally:
        fmu.description.guid = guid


@BOTH
def test_reset_is_a_fresh_instance(make: Callable[[Fmu], Instance], fmus: dict[str, Fmu], name: str) -> None:
    fresh = make(fmus[name])
    fresh.start()
    expected = stir(fresh, 0, 80)

    used = make(fmus[name])
    parameter = {"BoostPlant": "tank.volume", "BoostController": "lambda"}[name]
    used.start({parameter: 0.5, "engine_speed": 2500.0}, start_time=0.0)
    stir(used, 0, 50)
    used.slave.reset()
    used.start()
    assert (stir(used, 0, 80) == expected).all()


@BOTH
def test_restored_state_goes_on_identically(
    make: Callable[[Fmu], Instance], fmus: dict[str, Fmu], name: str
) -> None:
    instance = make(fmus[name])
    instance.start()
    stir(instance, 0, 40)
    state = instance.slave.getFMUstate()
    expected = stir(instance, 40, 120)
    for _ in range(2):
        instance.slave.setFMUstate(state)
        assert (stir(instance, 40, 120) == expected).all()

    instance.slave.freeFMUstate(state)
    assert state.value is None


def test_saved_loop_goes_on_identically(plant: Make, controller: Make) -> None:
    """Both back to a point in a transient, as a master with error control does."""
    inputs = {"boost_reference": staircase((0.0, 125e3), (1.0, 150e3))}
    master = couple(plant(), controller(), inputs=inputs)
    master.run(1.2)
    states = [instance.slave.getFMUstate() for instance in master.instances]
    steps_done = master.steps_done
    first = master.run(4.0)
    for instance, state in zip(master.instances, states, strict=True):
        instance.slave.setFMUstate(state)
        instance.slave.freeFMUstate(state)
    master.steps_done = steps_done
    again = master.run(4.0)
    for name in first:
        assert (first[name] == again[name]).all(), name


def test_input_derivatives_make_a_ramp_in_long_steps(plant: Make) -> None:
    """A ramp of the engine's speed by its slope in 0.1 s steps, against small steps of 1 ms."""
    slope, begin, end = 200.0, 1.0, 4.0
    speed = ramp((0.0, 1500.0), (begin, 1500.0), (end, 1500.0 + slope * (end - begin)), (6.0, 2100.0))

    def run(step: float, derivatives: bool) -> Record:
        instance = plant()
        instance.start()
        if not derivatives:
            # The middle of each step: what a held value lags behind is 0 on the average.
            signal = {"engine_speed": lambda time: speed(time + step / 2)}
            return Master([instance], step, inputs=signal).run(6.0)
        inputs = Reals(instance, ["engine_speed"])
        master = Master([instance], step)
        rows = [master._row()]
        for index in range(round(6.0 / step)):
            time = index * step
            inputs.set([speed(time)])
            inputs.set_derivatives([(speed(time + step) - speed(time)) / step])
            instance.slave.doStep(time, step)
            master.steps_done += 1
            rows.append(master._row())
        return Record(zip(["time", *master.names], np.array(rows).T, strict=True))

    fine, coarse = run(0.001, derivatives=False), run(0.1, derivatives=True)
    for name in ["boost_pressure", "engine_torque", "hp_turbo_speed", "air_mass_flow"]:
        at_equal_times = fine[name][::100]
        # Both within the solver's tolerance (0.01 % of full scale) of the same solution.
        scale = np.max(np.abs(at_equal_times))
        # Outputs that read the speed itself are those of the step's end in the one, of half a
        # millisecond before in the other: 0.1 of 1500 rpm.
        assert np.max(np.abs(coarse[name] - at_equal_times)) <= 2e-4 * scale, name


def test_input_derivatives_reach_each_sample(controller: Make) -> None:
    """A step of eight samples with slopes is eight steps of one sample."""
    start, slope = 125e3, 8e3

    def measured(time: float) -> float:
        return start + slope * time

    names = ["boost_pressure", "boost_reference"]
    one, eight = controller(), controller()
    one.start(dict.fromkeys(names, start))
    eight.start(dict.fromkeys(names, start))
    one_inputs, eight_inputs = Reals(one, names), Reals(eight, names)
    for step in range(10):
        for index in range(8 * step, 8 * step + 8):
            one_inputs.set([measured(index * STEP), start])
            one.slave.doStep(index * STEP, STEP)
        eight_inputs.set([measured(step * 0.1), start])
        eight_inputs.set_derivatives([slope, 0.0])
        eight.slave.doStep(step * 0.1, 0.1)
        assert one.get("sample_count") == eight.get("sample_count") == 8 * (step + 1)
        # The slope times the offset rounds differently.
        assert eight.get("hp_wastegate_pwm") == pytest.approx(one.get("hp_wastegate_pwm"), rel=1e-9)


@BOTH
def test_derivatives_last_one_step(make: Callable[[Fmu], Instance], fmus: dict[str, Fmu], name: str) -> None:
    """Cleared by the step; and for an input by setting its value again."""
    outputs = fmus[name].named("output")

    def run(given: bool) -> np.ndarray:
        instance = make(fmus[name])
        instance.start()
        inputs = Reals(instance, ["engine_speed"])
        if given:
            inputs.set_derivatives([1000.0])
        inputs.set([1500.0])
        instance.slave.doStep(0.0, 0.1)
        return instance.reals(outputs)

    assert (run(given=True) == run(given=False)).all()


@pytest.mark.parametrize("pattern", [[0.1], [0.001], [0.0125], [0.0031, 0.0007, 0.02, 0.0512]])
def test_uneven_steps_give_one_plant(plant: Make, pattern: list[float]) -> None:
    """Whatever steps the master takes with constant inputs, the plant goes the same way."""

    def run(steps: list[float]) -> np.ndarray:
        instance = plant()
        instance.start({"initialization.mode": "running"})
        time, index = 0.0, 0
        while time < 3.0 - 1e-9:
            size = min(steps[index % len(steps)], 3.0 - time)
            instance.slave.doStep(time, size)
            time, index = time + size, index + 1
        return instance.reals(instance.fmu.named("output"))

    expected = run([3.0])
    # The solver's tolerance (0.01 % of full scale) at worst.
    assert run(pattern) == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_instances_do_not_share(plant: Make) -> None:
    """Two instances of one library, stepped in turn, are two alone."""
    alone = plant()
    alone.start()
    expected = stir(alone, 0, 40)
    first, second = plant(), plant()
    first.start()
    second.start({"engine_speed": 3000.0, "hp_wastegate_pwm": 60.0})
    results = []
    for index in range(40):
        results.append(stir(first, index, index + 1)[0])
        stir(second, index, index + 1)
    assert (np.array(results) == expected).all()
