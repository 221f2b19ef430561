"""Both FMUs in Model Exchange: the plant solved by FMPy's CVode, the controller's samples as time events, and
both coupled."""

from __future__ import annotations

import ctypes
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from fmu import TARGET
from fmu.exchange import Exchange
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, SAMPLE_TIME, staircase
from fmu.master import Fmu, Instance, Master, Reals, Wires
from fmu.recorded import Recording, in_co_simulation, in_model_exchange
from fmu.solver_settings import documented, evaluations, outcomes

Make = Callable[..., Instance]


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Fmu]:
    """Both FMUs with both interfaces, extracted."""

    def extracted(name: str) -> Fmu:
        path = TARGET / "both" / f"{name}.fmu"
        assert path.is_file(), f"{path} is missing: bash tests/run rest exports it"
        return Fmu(path, tmp_path_factory.mktemp(name))

    return {name: extracted(name) for name in ("BoostPlant", "BoostController")}


@pytest.fixture
def new() -> Make:
    """Makes instances, and frees them after the test."""
    made: list[Instance] = []

    def make(kind: type[Instance], *arguments) -> Instance:
        made.append(kind(*arguments))
        return made[-1]

    yield make
    for instance in made:
        instance.free()


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8])
def test_the_recorded_experiment(new: Make, both: dict[str, Fmu], tolerance: float) -> None:
    """States and outputs within 0.01 % of full scale of the reference solution, as in co-simulation; the
    rod's speed and friction, which are fast and small, within 0.1 % and 0.5 %. CVode's tolerance is per step:
    at 1e-6 the rod's speed is only reported."""
    recording = Recording.read()
    result = in_model_exchange(new(Exchange, both["BoostPlant"], tolerance), recording)
    beside = in_co_simulation(new(Instance, both["BoostPlant"]), recording)
    print(f"\nCVode at {tolerance:g}: {result}, {result.processor_time:.2f} s", end="")
    print(f"; co-simulation: {beside}, {beside.processor_time:.2f} s")
    for name, error in result.errors.items():
        limit = {"actuator.velocity": 1e-3, "actuator.friction_force": 5e-3}.get(name, 1e-4)
        if tolerance > 1e-8 and name == "actuator.velocity":
            continue
        assert error < limit, name


def test_the_documented_settings_run_and_fail_as_documented(both: dict[str, Fmu]) -> None:
    """Step sizes depend on the last bits of the processor's arithmetic: errors may be twice the page's,
    which rounds them to one digit, and counts may be half as large again."""
    page = documented()
    for setting, found in outcomes(both["BoostPlant"]).items():
        if isinstance(found, str) or page[setting].startswith("fails"):
            assert found == page[setting], setting
        else:
            assert found < 2.0 * float(page[setting].removesuffix(" %")), setting
    for solver, count in evaluations(both["BoostPlant"]).items():
        assert count == pytest.approx(int(page[solver]), rel=0.5), solver


def test_the_duty_latch_is_a_time_event(new: Make, both: dict[str, Fmu]) -> None:
    """A duty takes effect at the next period of 300 Hz. Both integrations keep 20 Pa each."""

    def response(instance: Instance, steps: Callable[[Instance, float, float], None]) -> np.ndarray:
        chamber = Reals(instance, ["actuator_pressure"])
        values = []
        for index in range(40):
            # Steps that are no multiples of the period.
            begin, end = index * 0.002, (index + 1) * 0.002
            steps(instance, begin, end)
            values.append(chamber.get()[0])
        return np.array(values)

    def solved(instance: Exchange, begin: float, end: float) -> None:
        if begin == 0.012:
            instance.event(lambda: instance.set({"hp_wastegate_pwm": 60.0}))
        instance.advance(end)
        if instance.is_due():
            instance.event()

    def stepped(instance: Instance, begin: float, end: float) -> None:
        if begin == 0.012:
            instance.set({"hp_wastegate_pwm": 60.0})
        instance.slave.doStep(begin, end - begin)

    start = {"valve.duty_latch": True}
    model = new(Exchange, both["BoostPlant"], 1e-8).start(start).go()
    period = 1.0 / 300.0
    assert model.next_event == pytest.approx(period, rel=1e-12)
    found = response(model, solved)
    expected = response(new(Instance, both["BoostPlant"]).start(start), stepped)
    assert np.ptp(expected) > 2000.0, "the duty has an effect"
    assert np.abs(found - expected).max() < 40.0
    assert model.calls["events"] == 1 + 24, "the event of the input, and a period each 1/300 s in 0.08 s"


@pytest.mark.parametrize("seed", range(5))
def test_the_controllers_samples_are_at_multiples_of_its_period(
    new: Make, both: dict[str, Fmu], seed: int
) -> None:
    """Whatever steps and events the importer makes, a sample is announced at k/80 s and executed there: its
    outputs are those of co-simulation, to the last bit, and stay the same between samples."""
    numbers = random.Random(seed)
    print(f"seed {seed}")
    model = new(Exchange, both["BoostController"])
    slave = new(Instance, both["BoostController"])
    names = ["boost_pressure", "boost_reference", "engine_speed", "tank_pressure", "supply_voltage_measured"]
    values = [180e3, 200e3, 1500.0, 33e3, 12.0]
    outputs = [*model.fmu.named("output"), "integral_term", "unsaturated_pwm"]
    sets = {instance: Reals(instance, names) for instance in (model, slave)}
    gets = {instance: Reals(instance, outputs) for instance in (model, slave)}
    for instance in (model, slave):
        instance.begin()
        sets[instance].set(values)
        instance.slave.exitInitializationMode()
    model.go()
    for sample in range(1, 200):
        slave.slave.doStep((sample - 1) * SAMPLE_TIME, SAMPLE_TIME)
        assert (gets[model].get() == gets[slave].get()).all()
        assert model.get("sample_count") == slave.get("sample_count") == sample
        assert model.next_event == sample * 0.0125, "of the counter, not of a sum"
        while model.time < model.next_event:
            # Steps of the importer, and events of others, between the samples.
            model.time = min(model.time + numbers.expovariate(300.0), model.next_event)
            model.slave.setTime(model.time)
            if model.time < model.next_event:
                model.event(
                    lambda values=values: sets[model].set(
                        [numbers.uniform(0.9, 1.1) * value for value in values]
                    )
                )
                assert (gets[model].get() == gets[slave].get()).all()
        values = [numbers.uniform(0.98, 1.02) * value for value in values]
        sets[slave].set(values)
        if numbers.random() < 0.3:
            # Importers that take times as equal to 1e-9 may come early: nothing happens, and the sample is
            # announced again.
            model.time *= 1.0 - 0.9e-9
            model.slave.setTime(model.time)
            model.event(lambda: None)
            assert (model.get("sample_count"), model.next_event) == (sample, sample * 0.0125)
            model.time = model.next_event
            model.slave.setTime(model.time)
        model.event(lambda values=values: sets[model].set(values))


def test_both_coupled_follow_fig_13_as_in_co_simulation(new: Make, both: dict[str, Fmu]) -> None:
    """Steps of the reference, coupled at the controller's samples, within 50 Pa: 20 Pa of each integration's
    tolerance, and what the loop makes of them."""
    reference = staircase(*BOOST_STEPS)

    def initialized(kind: type[Instance]) -> tuple[Instance, Instance]:
        plant, controller = new(kind, both["BoostPlant"]), new(kind, both["BoostController"])
        plant.begin()
        controller.begin()
        wires = Wires(controller, plant), Wires(plant, controller)
        controller.set({"boost_reference": reference(0.0)})
        for _ in range(2):
            for wire in wires:
                wire.transfer()
        for instance in (controller, plant):
            instance.slave.exitInitializationMode()
        return plant, controller

    plant, controller = initialized(Instance)
    master = Master([controller, plant], SAMPLE_TIME, inputs={"boost_reference": reference})
    expected = master.run(BOOST_STEPS_END)["boost_pressure"]

    plant, controller = initialized(Exchange)
    plant.go()
    to_plant, to_controller = Wires(controller, plant), Wires(plant, controller)
    command = Reals(controller, ["boost_reference"])
    boost = Reals(plant, ["boost_pressure"])

    def take_measurements() -> None:
        to_controller.transfer()
        command.set([reference(plant.time)])

    take_measurements()
    controller.go()
    plant.event(to_plant.transfer)
    found = [boost.get()[0]]
    while plant.time < BOOST_STEPS_END - 1e-9:
        plant.advance(controller.next_event)
        controller.advance(controller.next_event)
        found.append(boost.get()[0])
        controller.event(take_measurements)
        plant.event(to_plant.transfer)
    deviation = np.abs(np.array(found) - expected).max()
    print(f"\nlargest deviation of boost pressure: {deviation:.1f} Pa; {plant.calls}")
    assert len(found) == len(expected)
    assert deviation < 50.0


def test_the_default_fmus_are_for_co_simulation_alone(exported: Path) -> None:
    """Some importers silently take Model Exchange where both are offered."""
    for name in ("BoostPlant", "BoostController"):
        description = Fmu(exported / f"{name}.fmu", exported).description
        assert description.modelExchange is None
        assert description.coSimulation is not None


def test_pressures_below_zero_are_discarded(new: Make, both: dict[str, Fmu]) -> None:
    """Solvers with long steps try them. What is beyond an ordinary bound, as in differences, is not."""
    model = new(Exchange, both["BoostPlant"], 1e-8).start().go()
    states = (ctypes.c_double * len(both["BoostPlant"].description.derivatives))()
    model.slave.getContinuousStates(states, len(states))
    derivatives = (ctypes.c_double * len(states))()
    names = [unknown.variable.derivative.name for unknown in both["BoostPlant"].description.derivatives]
    for name, value, is_discarded in [
        ("exhaust_manifold.pressure", -1.0, True),
        ("exhaust_manifold.pressure", 0.0, False),
        ("tank.pressure", 120_001.0, False),
        ("actuator.chamber_pressure", -1e-9, True),
    ]:
        tried = (ctypes.c_double * len(states))(*states)
        tried[names.index(name)] = value
        model.slave.setContinuousStates(tried, len(states))
        if is_discarded:
            with pytest.raises(FMICallException, match=r"fmi2GetDerivatives failed with status 2"):
                model.slave.getDerivatives(derivatives, len(states))
        else:
            model.slave.getDerivatives(derivatives, len(states))
        model.slave.setContinuousStates(states, len(states))
        model.slave.getDerivatives(derivatives, len(states))
