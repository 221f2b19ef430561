"""FMI 3.0: the symbols, arrays, types, events, and results equal to FMI 2.0. The order of calls and invalid
arguments are tested in Rust (tests/importer)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from ctypes import c_double, c_int, c_uint32, c_uint64
from itertools import pairwise
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import (
    fmi3IntermediateUpdateCallback,
    fmi3LockPreemptionCallback,
    fmi3UnlockPreemptionCallback,
)
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu

from fmu import TARGET
from fmu.exporter.importer import (
    CO_SIMULATION,
    DECLARED,
    EVENT_MODE,
    LOGGER,
    MODEL_EXCHANGE,
    SCHEDULED_EXECUTION,
    Instance3,
    Library,
    Status,
)

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

KINDS = ["Float32", "Float64", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"]
KINDS += ["Boolean", "String", "Binary"]
COUNTS = {"nContinuousStates": 2, "nEventIndicators": 3}
SAMPLED, SCHEDULED = "SampledModel", "SampledModelScheduled"
CLOCKED, CLOCKED_SCHEDULED = "ClockedModel", "ClockedModel, scheduled"
FOLDERS = {
    "TestModel": "test-model/cs,me",
    SAMPLED: "sampled-model",
    SCHEDULED: "sampled-model",
    CLOCKED: "clocked-model/cs,me",
    CLOCKED_SCHEDULED: "clocked-model/se",
}
MODELS = {EVENT_MODE: SAMPLED, SCHEDULED_EXECUTION: SCHEDULED}
"""The models of interfaces that the test model does not have."""
CLOCK = 9
"""The clock of the sampled model."""
OF_INSTANCES = sorted(name for name, (result, _) in DECLARED[3].items() if result is c_int)
"""The functions that take an instance and return a status."""


def described(model: str = "TestModel") -> tuple[Path, ModelDescription]:
    """A model as an FMU of FMI 3.0, with Model Exchange and Co-Simulation or with Scheduled Execution."""
    path = TARGET / FOLDERS[model] / "fmi3" / f"{model.split(',')[0]}.fmu"
    assert path.is_file(), f"{path} is missing: bash tests/run exports it"
    return path, fmpy.read_model_description(path)


@pytest.fixture(scope="module")
def description() -> ModelDescription:
    return described()[1]


@pytest.fixture(scope="module")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Library, str]]:
    """The library of each model, and its instantiation token."""

    def load(model: str) -> tuple[Library, str]:
        path, description = described(model)
        folder = Path(fmpy.extract(path, tmp_path_factory.mktemp("fmu")))
        (binary,) = folder.glob(f"binaries/*/{path.stem}.*")
        return Library(binary), description.instantiationToken

    return {model: load(model) for model in FOLDERS}


@pytest.fixture
def library(libraries: dict[str, tuple[Library, str]]) -> Library:
    return libraries["TestModel"][0]


@pytest.fixture
def make(
    libraries: dict[str, tuple[Library, str]], capfd: pytest.CaptureFixture[str]
) -> Iterator[Callable[..., Instance3]]:
    """Makes instances, and frees them after the test. Nothing may be written to the host's streams."""
    made: list[Instance3] = []

    def make(interface: str, state: str = "instantiated", model: str = "", **arguments: object) -> Instance3:
        library, token = libraries[model or MODELS.get(interface, "TestModel")]
        instance = Instance3(library, token, interface, **arguments)
        made.append(instance)
        if state == "initialization":
            instance.ok("fmi3EnterInitializationMode")
        elif state != "instantiated":
            instance.initialize()
            if interface == EVENT_MODE and state == "step":
                instance.ok("fmi3EnterStepMode")
            elif state == "continuous":
                instance.ok("fmi3EnterContinuousTimeMode")
            elif state == "terminated":
                instance.ok("fmi3Terminate")
            elif state == "error":
                assert instance.call("fmi3ExitInitializationMode") == Status.ERROR
        return instance

    yield make
    for instance in made:
        instance.free()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("model", FOLDERS)
def test_the_description_is_valid(model: str) -> None:
    path, description = described(model)
    assert validate_fmu(path) == []
    if model == SCHEDULED:
        # A clock binds all interfaces of its FMU (section 2.5.2).
        assert description.coSimulation is None
        assert description.modelExchange is None
        clocked = {variable.name for variable in description.modelVariables if variable.clocks}
        assert clocked == {"signal", "sign", "sum", "samples", "last"}
        assert all(v.variability == "discrete" for v in description.modelVariables if v.clocks)
    elif model != CLOCKED_SCHEDULED:
        assert description.coSimulation.hasEventMode == (model != "TestModel")


@pytest.mark.parametrize("function", OF_INSTANCES)
def test_each_function_in_an_intermediate_update(make: Callable[..., Instance3], function: str) -> None:
    """Section 4.2.2: registered variables are got and set. After another call the step is an error."""
    statuses: list[int] = []

    def update(_environment: int, time: float, *_: object) -> None:
        assert time == 0.25 * (1 + len(statuses))
        values = {} if "GetNumberOf" in function else COUNTS
        statuses.append(instance.call(function, *instance.arguments(function, **values)))

    callback = fmi3IntermediateUpdateCallback(update)
    instance = make(CO_SIMULATION, "step", model=SAMPLED, intermediateUpdate=callback)
    status, (_, _, _, reached) = instance.step(0.0, 0.625)
    allowed = function in ("fmi3GetFloat64", "fmi3SetFloat64")
    assert (status, reached) == ((Status.OK, 0.625) if allowed else (Status.ERROR, 0.25))
    assert statuses == ([Status.OK, Status.OK] if allowed else [Status.ERROR])


def test_a_sample_takes_the_inputs_of_its_intermediate_update(make: Callable[..., Instance3]) -> None:
    """Those that the importer registered: the signal, but not the sum, which is discrete."""
    signals = [10.0, 100.0]

    def update(_environment: int, _time: float, *_: object) -> None:
        assert instance.set("Float64", [1], [signals.pop(0)]) == Status.OK

    registered = {"requiredIntermediateVariables": (c_uint32 * 1)(1), "nRequiredIntermediateVariables": 1}
    callback = fmi3IntermediateUpdateCallback(update)
    instance = make(CO_SIMULATION, "step", model=SAMPLED, intermediateUpdate=callback, **registered)
    assert instance.step(0.0, 0.625) == (Status.OK, (False, False, False, 0.625))
    assert instance.get("Float64", [6]) == [111.0]
    registered["requiredIntermediateVariables"] = (c_uint32 * 1)(6)
    refused = make(CO_SIMULATION, model=SAMPLED, **registered)
    assert refused.component is None
    assert "the variable sum" in refused.messages[0].text


def test_an_instance_of_another_interface_is_refused(
    library: Library, libraries: dict[str, tuple[Library, str]], description: ModelDescription
) -> None:
    token = description.instantiationToken
    for interface, arguments, reason in [
        ("ScheduledExecution", {}, "this FMU does not offer Scheduled Execution"),
        (CO_SIMULATION, {"eventModeUsed": True}, "hasEventMode is false"),
        (CO_SIMULATION, {"instanceName": None}, "instanceName is NULL"),
        (CO_SIMULATION, {"instantiationToken": b"another"}, "is another FMU's"),
        (
            CO_SIMULATION,
            {"requiredIntermediateVariables": (c_uint32 * 1)(1), "nRequiredIntermediateVariables": 1},
            "the variable rate",
        ),
    ]:
        instance = Instance3(library, token, interface, **arguments)
        assert instance.component is None
        (message,) = instance.messages
        assert reason in message.text
    scheduled, of_scheduled = libraries[SCHEDULED]
    for interface in (CO_SIMULATION, MODEL_EXCHANGE):
        instance = Instance3(scheduled, of_scheduled, interface)
        assert instance.component is None
        assert "this FMU does not offer" in instance.messages[0].text
    assert library.fmi3GetVersion() == b"3.0"
    # Without a callback there is no one to tell.
    assert Instance3(library, token, "ScheduledExecution", logMessage=LOGGER()).component is None


def test_arrays(make: Callable[..., Instance3], description: ModelDescription) -> None:
    table = next(v for v in description.modelVariables if v.name == "settings.table")
    assert [dimension.start for dimension in table.dimensions] == [2, 2]
    determinant = next(v for v in description.modelVariables if v.name == "settings.determinant")
    instance = make(CO_SIMULATION)
    assert instance.get("Float64", [table.valueReference], 4) == [1.0, 0.0, 0.0, 1.0]
    assert instance.set("Float64", [table.valueReference], [1.0, 2.0, 3.0, 5.0]) == Status.OK
    instance.initialize()
    references = [table.valueReference, determinant.valueReference, table.valueReference]
    assert instance.get("Float64", references, 9) == [1.0, 2.0, 3.0, 5.0, -1.0, 1.0, 2.0, 3.0, 5.0]


def test_event_indicators_are_variables(
    make: Callable[..., Instance3], description: ModelDescription
) -> None:
    references = [unknown.variable.valueReference for unknown in description.eventIndicators]
    instance = make(MODEL_EXCHANGE, "event")
    indicators = (c_double * 3)()
    assert instance.call("fmi3GetEventIndicators", indicators, 3) == Status.OK
    assert instance.get("Float64", [1, *references, 0]) == [1.0, *indicators, 0.0]
    assert instance.derivatives("Directional", references[:1], [1], [1.0]) == (Status.ERROR, [9.0])
    assert "is not an unknown" in instance.messages[-1].text


OF_INITIALIZATION = ["rate", "drive", "pulse", "tank.level", "tank.gain"]
OF_STEPS = ["rate", "drive", "pulse", "tank.level", "motion.position"]


@pytest.mark.parametrize("state", ["initialization", "step", "event", "continuous"])
def test_adjoint_derivatives_are_the_directional_ones(
    make: Callable[..., Instance3], description: ModelDescription, state: str
) -> None:
    """Section 2.2.11: v·J in the place of J·v; each element of the sum within its own rounding."""
    by_name = {v.name: v.valueReference for v in description.modelVariables}
    initializing = state == "initialization"
    unknowns = [by_name["output"], by_name["position"]]
    if not initializing:
        unknowns += [by_name["der(tank.level)"], by_name["der(motion.position)"]]
    knowns = [by_name[name] for name in (OF_INITIALIZATION if initializing else OF_STEPS)]
    random = np.random.default_rng(11)
    instance = make(CO_SIMULATION if state == "step" else MODEL_EXCHANGE)
    parameters = [by_name[name] for name in ("tank.gain", "motion.position")]
    assert instance.set("Float64", parameters, [2.5, 0.75]) == Status.OK
    assert instance.set("Int64", [by_name["motion.start"]], [2]) == Status.OK
    instance.ok("fmi3EnterInitializationMode")
    assert (
        instance.set("Float64", [by_name["rate"], by_name["drive"]], random.uniform(1, 2, 2).tolist())
        == Status.OK
    )
    if not initializing:
        instance.ok("fmi3ExitInitializationMode")
    if state == "continuous":
        instance.ok("fmi3EnterContinuousTimeMode")

    def derivatives(kind: str, unknowns: list[int], knowns: list[int], seeds: list[float]) -> np.ndarray:
        status, found = instance.derivatives(kind, unknowns, knowns, seeds)
        assert status == Status.OK, instance.messages
        return np.array(found)

    for _ in range(20):
        direction, weights = random.normal(size=len(knowns)), random.normal(size=len(unknowns))
        jacobian = np.array([derivatives("Directional", unknowns, [known], [1.0]) for known in knowns]).T
        found = derivatives("Adjoint", unknowns, knowns, weights.tolist())
        scale = np.abs(weights) @ np.abs(jacobian)
        assert (scale > 0).any()
        assert (np.abs(found - weights @ jacobian) <= 1e-12 * scale).all()
        along = derivatives("Directional", unknowns, knowns, direction.tolist())
        assert weights @ along == pytest.approx(
            found @ direction, rel=1e-12, abs=1e-12 * (scale @ np.abs(direction))
        )
    # Any order, and a part of both.
    assert (derivatives("Adjoint", unknowns[:1], knowns[::-1], [2.0]) == 2 * jacobian[0, ::-1]).all()


@pytest.mark.parametrize("state", ["step", "event", "continuous"])
def test_parameters_are_knowns(
    make: Callable[..., Instance3], description: ModelDescription, state: str
) -> None:
    """Sections 2.2.12 and 2.4.8: whatever may be a dependency, fixed parameters and between events, too."""
    by_name = {v.name: v.valueReference for v in description.modelVariables}
    instance = make(CO_SIMULATION if state == "step" else MODEL_EXCHANGE, state)
    assert instance.set("Float64", [by_name["rate"]], [1.5]) == Status.OK
    # The output is the level and the gain times the rate.
    for name, expected in (("events.wall", 0.0), ("tank.gain", 1.5)):
        for kind in ("Directional", "Adjoint"):
            found = instance.derivatives(kind, [by_name["output"]], [by_name[name]], [1.0])
            assert found == (Status.OK, [expected])


def test_an_input_at_its_bound_has_no_effect(make: Callable[..., Instance3]) -> None:
    instance = make(CO_SIMULATION, "step")
    assert instance.derivatives("Adjoint", [8], [1], [1.0]) != (Status.OK, [0.0])
    assert instance.set("Float64", [1], [1000.0]) == Status.WARNING
    assert instance.derivatives("Adjoint", [8], [1], [1.0]) == (Status.OK, [0.0])


def test_adjoint_derivatives_that_are_refused(make: Callable[..., Instance3]) -> None:
    for unknown, known, reason in [(1, 2, "rate is not an unknown"), (8, 9, "position is not a known")]:
        instance = make(CO_SIMULATION, "step")
        assert instance.derivatives("Adjoint", [unknown], [known], [1.0])[0] == Status.ERROR
        assert reason in instance.messages[-1].text


def test_warnings_are_logged_on_request(make: Callable[..., Instance3]) -> None:
    """Section 2.3.1: without `loggingOn` errors alone."""
    for logging_on in (False, True):
        instance = make(CO_SIMULATION, loggingOn=logging_on)
        instance.initialize()
        assert instance.set("Float64", [1], [1000.0]) == Status.WARNING
        categories = [message.category for message in instance.messages]
        assert categories.count("logStatusWarning") == logging_on
        assert logging_on or categories == []


def test_a_step_tells_where_it_ended(make: Callable[..., Instance3]) -> None:
    instance = make(CO_SIMULATION, "step")
    assert instance.step(0.0, 0.125) == (Status.OK, (False, False, False, 0.125))
    assert instance.step(0.125, -1.0) == (Status.ERROR, (False, False, False, 0.125))


EARLY: dict[str, dict[str, bool]] = {
    "TestModel": {"event": False, "update": False, "end": True},
    SAMPLED: {"event": True, "update": True, "end": True},
    CLOCKED: {"event": False, "update": False, "end": False},
}
"""Whether a step ends early at an event, at an intermediate update, and where the model asks for the end."""


@pytest.mark.parametrize("model", EARLY)
def test_steps_end_early_in_models_that_say_so(make: Callable[..., Instance3], model: str) -> None:
    """Section 4.4, `mightReturnEarlyFromDoStep`: without it, importers rely on whole steps."""
    _, description = described(model)
    has_event_mode = description.coSimulation.hasEventMode
    updates = []

    def update(_environment: int, time: float, *flags: object) -> None:
        updates.append(time)
        *_, can_return, asked, at = flags
        asked[0], at[0] = can_return, time

    for cause, expected in EARLY[model].items():
        # With clocks there is no Co-Simulation without Event Mode.
        has_events = has_event_mode and (cause == "event" or model == CLOCKED)
        arguments = {"earlyReturnAllowed": True, "model": model}
        if cause == "update":
            arguments["intermediateUpdate"] = fmi3IntermediateUpdateCallback(update)
        instance = make(EVENT_MODE if has_events else CO_SIMULATION, **arguments)
        for variable in description.modelVariables:
            if cause == "end" and variable.name in ("events.end", "end"):
                assert instance.set("Float64", [variable.valueReference], [0.25]) == Status.OK
        instance.initialize()
        if has_events:
            instance.update()
            instance.ok("fmi3EnterStepMode")
        assert instance.step(0.0, 0.125) == (Status.OK, (False, False, False, 0.125))
        status, (_, ends, is_early, reached) = instance.step(0.125, 0.25)
        assert (status, is_early, reached) == (Status.OK, expected, 0.25 if expected else 0.375), cause
        assert ends == (expected and cause == "end")
    assert (updates != []) == description.coSimulation.providesIntermediateUpdate
    assert any(EARLY[model].values()) == description.coSimulation.mightReturnEarlyFromDoStep


@pytest.mark.parametrize("early", [False, True])
def test_the_model_asks_for_the_end(
    make: Callable[..., Instance3], description: ModelDescription, early: bool
) -> None:
    end = next(v.valueReference for v in description.modelVariables if v.name == "events.end")
    instance = make(CO_SIMULATION, earlyReturnAllowed=early)
    assert instance.set("Float64", [end], [0.1875]) == Status.OK
    instance.initialize()
    assert instance.step(0.0, 0.125)[1] == (False, False, False, 0.125)
    status, (_, terminate, returned_early, reached) = instance.step(0.125, 0.125)
    assert (status, terminate, reached) == (Status.OK, True, 0.1875)
    assert returned_early == early
    instance.ok("fmi3Terminate")


def test_an_event_answers_all_questions(make: Callable[..., Instance3]) -> None:
    instance = make(MODEL_EXCHANGE, "event")
    assert instance.update() == ([False] * 4, None)


def to_event(instance: Instance3, time: float, size: float) -> tuple[bool, bool, bool, float]:
    """A step that succeeds."""
    status, result = instance.step(time, size)
    assert status == Status.OK, instance.messages
    return result


def test_a_step_ends_early_at_an_event(make: Callable[..., Instance3]) -> None:
    """Section 4.2.1: the importer enters Event Mode where the step ended, in which the sample is computed."""
    instance = make(EVENT_MODE, "initialization", earlyReturnAllowed=True)
    instance.ok("fmi3ExitInitializationMode")
    # The sample at the start.
    assert instance.get("Int32", [7]) == [0]
    assert instance.update() == ([False] * 4, 0.25)
    assert instance.get("Int32", [7]) == [1]
    assert instance.update() == ([False] * 4, 0.25)
    instance.ok("fmi3EnterStepMode")
    assert to_event(instance, 0.0, 0.125) == (False, False, False, 0.125)
    assert instance.set("Float64", [1], [2.0]) == Status.OK
    assert to_event(instance, 0.125, 1.0) == (True, False, True, 0.25)
    assert instance.get("Float64", [6, 8, 0]) == [1.0, 0.0, 0.25]
    instance.ok("fmi3EnterEventMode")
    assert instance.set("Int32", [2], [-1]) == Status.OK
    assert instance.update() == ([False] * 4, 0.5)
    assert instance.get("Float64", [6, 8, 0]) == [-1.0, 0.25, 0.25]
    instance.ok("fmi3EnterStepMode")
    # An event at the very end of a step is no early return.
    assert to_event(instance, 0.25, 0.25) == (True, False, False, 0.5)
    # Until the importer has handled it, it is there.
    assert to_event(instance, 0.5, 0.25) == (True, False, True, 0.5)
    assert instance.get("Int32", [7]) == [2]
    instance.ok("fmi3EnterEventMode")
    instance.ok("fmi3Terminate")


def test_without_early_return_the_model_handles_events_within_a_step(make: Callable[..., Instance3]) -> None:
    instance = make(EVENT_MODE, "event")
    assert instance.update()[1] == 0.25
    instance.ok("fmi3EnterStepMode")
    assert to_event(instance, 0.0, 0.625) == (False, False, False, 0.625)
    assert instance.get("Int32", [7]) == [3]
    assert instance.get("Float64", [8]) == [0.5]
    assert to_event(instance, 0.625, 0.375) == (True, False, False, 1.0)
    assert instance.get("Float64", [8]) == [0.75]
    instance.ok("fmi3EnterEventMode")
    assert instance.update()[1] == 1.25
    assert instance.get("Float64", [8]) == [1.0]


def test_events_beside_the_end_of_a_step_by_rounding_are_at_its_end(make: Callable[..., Instance3]) -> None:
    """0.1 added up is off by some roundings from the samples' times."""
    for early in (False, True):
        instance = make(EVENT_MODE, earlyReturnAllowed=early)
        assert instance.set("Float64", [3], [0.1]) == Status.OK
        instance.initialize()
        instance.update()
        instance.ok("fmi3EnterStepMode")
        time = 0.0
        for sample in range(1, 30):
            assert to_event(instance, time, 0.1) == (True, False, False, time + 0.1)
            time += 0.1
            instance.ok("fmi3EnterEventMode")
            instance.update()
            assert instance.get("Int32", [7]) == [sample + 1]
            instance.ok("fmi3EnterStepMode")


@pytest.mark.parametrize("early", [False, True])
def test_with_event_mode_results_are_those_without(make: Callable[..., Instance3], early: bool) -> None:
    """No sample coincides with the end of a step; at one, the importer may set inputs in Event Mode."""

    def run(instance: Instance3, has_events: bool) -> list[list[float]]:
        assert instance.set("Float64", [3], [np.pi / 10]) == Status.OK
        instance.initialize()
        if has_events:
            instance.update()
            instance.ok("fmi3EnterStepMode")
        random, time, results = np.random.default_rng(30), 0.0, []
        for _ in range(100):
            # Multiples of a power of 2, so that sums are exact.
            end = time + int(random.integers(1, 8)) / 8
            while time < end:
                needed, _, is_early, time = to_event(instance, time, end - time)
                assert needed == is_early == (time < end)
                if needed:
                    instance.ok("fmi3EnterEventMode")
                    instance.update()
                    instance.ok("fmi3EnterStepMode")
            results.append(instance.get("Float64", [6, 8]))
            assert instance.set("Float64", [1], [float(random.uniform(-1, 1))]) == Status.OK
        return results

    expected = run(make(CO_SIMULATION, model=SAMPLED), False)
    assert len({tuple(values) for values in expected}) > 50
    assert run(make(EVENT_MODE, earlyReturnAllowed=early), True) == expected


def test_the_end_is_asked_for_in_event_mode(make: Callable[..., Instance3]) -> None:
    instance = make(EVENT_MODE, earlyReturnAllowed=True)
    assert instance.set("Float64", [5], [0.25]) == Status.OK
    instance.initialize()
    assert instance.update() == ([False] * 4, 0.25)
    instance.ok("fmi3EnterStepMode")
    assert to_event(instance, 0.0, 1.0) == (True, False, True, 0.25)
    instance.ok("fmi3EnterEventMode")
    assert instance.update() == ([False, True, False, False], 0.5)
    instance.ok("fmi3Terminate")


def test_a_clock_activates_the_model_partition(make: Callable[..., Instance3]) -> None:
    """Section 5.2: nothing changes but by the activation, which is at the importer's times."""
    instance = make(SCHEDULED_EXECUTION, "activation")
    assert instance.get("Int32", [7]) == [0]
    assert instance.set("Float64", [1], [3.0]) == Status.OK
    assert instance.get("Float64", [6]) == [0.0]
    instance.activate(CLOCK, 0.0)
    assert instance.get("Float64", [6, 8, 0]) == [3.0, 0.0, 0.0]
    assert instance.set("Float64", [1, 4], [0.5, 2.0]) == Status.OK
    instance.activate(CLOCK, 0.25)
    assert instance.get("Float64", [6, 8, 0]) == [4.0, 0.25, 0.25]
    assert instance.get("Int32", [7]) == [2]
    content = instance.snapshot()
    instance.activate(CLOCK, 0.5)
    instance.restore(content)
    instance.activate(CLOCK, 0.5)
    assert instance.get("Float64", [6, 8]) == [5.0, 0.5]
    instance.ok("fmi3Reset")
    instance.initialize()
    instance.activate(CLOCK, 0.0)
    assert instance.get("Int32", [7]) == [1]


@pytest.mark.parametrize(
    ("time", "reason"),
    [
        (0.75, "activationTime is 0.75; the last activation was at 0.75"),
        (0.625, "activationTime is 0.625; the last activation was at 0.75"),
        (2.5, "activationTime is 2.5, which is after the stopTime 2"),
    ],
)
def test_wrong_activations(make: Callable[..., Instance3], time: float, reason: str) -> None:
    instance = make(SCHEDULED_EXECUTION)
    instance.ok("fmi3EnterInitializationMode", startTime=0.5, stopTimeDefined=True, stopTime=2.0)
    instance.ok("fmi3ExitInitializationMode")
    instance.activate(CLOCK, 0.5)
    instance.activate(CLOCK, 0.75)
    assert instance.call("fmi3ActivateModelPartition", CLOCK, time) == Status.ERROR
    assert instance.messages[-1].text == f"fmi3ActivateModelPartition: {reason}"


def test_an_activation_before_the_start(make: Callable[..., Instance3]) -> None:
    instance = make(SCHEDULED_EXECUTION)
    instance.initialize(start_time=1.0)
    assert instance.call("fmi3ActivateModelPartition", CLOCK, 0.5) == Status.ERROR
    assert instance.messages[-1].text.endswith("activationTime is 0.5, which is before the startTime 1")


def test_a_model_that_asks_for_the_end_or_cannot_go_on(make: Callable[..., Instance3]) -> None:
    ends, refuses = make(SCHEDULED_EXECUTION), make(SCHEDULED_EXECUTION)
    assert ends.set("Float64", [5], [0.0]) == Status.OK
    ends.initialize()
    refuses.initialize()
    assert refuses.set("Float64", [4], [11.0]) == Status.OK
    for instance, reason in [(ends, "requests the end of the simulation at 0 s"), (refuses, "gain is 11.0")]:
        assert instance.call("fmi3ActivateModelPartition", CLOCK, 0.0) == Status.ERROR
        assert instance.messages[-1].text.endswith(reason)


def test_the_interval_follows_the_parameter(make: Callable[..., Instance3]) -> None:
    """Section 2.2.8.3: the importer asks for it, as a fraction too; it is fixed when initialization ends."""
    instance = make(SCHEDULED_EXECUTION, "initialization")
    unchanged, changed = 1, 2
    assert instance.interval(CLOCK) == (0.25, changed)
    assert instance.interval(CLOCK) == (0.25, unchanged)
    assert instance.set("Float64", [3], [0.0125]) == Status.OK
    counters, resolutions, qualifiers = (c_uint64 * 1)(), (c_uint64 * 1)(), (c_int * 1)()
    clocks = (c_uint32 * 1)(CLOCK)
    arguments = (clocks, 1, counters, resolutions, qualifiers)
    assert instance.call("fmi3GetIntervalFraction", *arguments) == Status.OK
    assert (counters[0], resolutions[0], qualifiers[0]) == (1, 80, changed)
    assert instance.interval(CLOCK) == (0.0125, unchanged)
    assert instance.call("fmi3GetShiftFraction", clocks, 1, counters, resolutions) == Status.OK
    assert (instance.shift(CLOCK), counters[0], resolutions[0]) == (0.0, 0, 1)
    instance.ok("fmi3ExitInitializationMode")
    assert instance.interval(CLOCK) == (0.0125, unchanged)
    # It is the FMU's: it cannot be set.
    instance = make(SCHEDULED_EXECUTION, "initialization")
    assert instance.call("fmi3SetIntervalDecimal", clocks, 1, (c_double * 1)(0.5)) == Status.ERROR


def test_an_interval_that_is_none(make: Callable[..., Instance3]) -> None:
    instance = make(SCHEDULED_EXECUTION, "initialization")
    assert instance.set("Float64", [3], [0.0]) == Status.OK
    clocks = (c_uint32 * 1)(CLOCK)
    assert instance.call("fmi3GetIntervalDecimal", clocks, 1, (c_double * 1)(), (c_int * 1)()) == Status.ERROR
    assert instance.messages[-1].text.endswith("0 s for the interval of the clock sample_clock")


def test_nothing_preempts_a_call(make: Callable[..., Instance3]) -> None:
    """Section 5.1.2: each call is between one pair of the importer's callbacks, after an error too."""
    calls: list[str] = []
    lock, unlock = (
        fmi3LockPreemptionCallback(lambda: calls.append("lock")),
        fmi3UnlockPreemptionCallback(lambda: calls.append("unlock")),
    )
    instance = make(SCHEDULED_EXECUTION, lockPreemption=lock, unlockPreemption=unlock)
    instance.initialize()
    calls.clear()
    for step, expected in enumerate([Status.OK, Status.ERROR]):
        assert instance.call("fmi3ActivateModelPartition", CLOCK, -1.0 * step) == expected
        assert calls == ["lock", "unlock"]
        calls.clear()
    instance.get("Float64", [6])
    assert calls == ["lock", "unlock"]


@pytest.mark.parametrize("early", [False, True])
def test_fmpy_handles_the_events(early: bool) -> None:
    """A second importer: with early return, it records each sample before and after its event."""
    result = fmpy.simulate_fmu(
        described(SAMPLED)[0],
        fmi_type="CoSimulation",
        stop_time=1.0,
        output_interval=0.1,
        output=["samples", "last"],
        use_event_mode=True,
        early_return_allowed=early,
    )
    assert (result["samples"][-1], result["last"][-1]) == (5, 1.0)
    times = [before["time"] for before, after in pairwise(result) if after["samples"] > before["samples"]]
    assert not early or times == [0.25, 0.5, 0.75, 1.0]
