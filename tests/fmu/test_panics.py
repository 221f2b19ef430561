"""What surrounds a model when the model fails: panics and numbers that are none, wherever they come up.

The model is that of `tests/panicking-fmu`. Everything is called in this process, so a panic that unwinds
into C, and with that ends the process, ends the test run.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
from _ctypes import dlclose
from collections.abc import Callable, Iterator
from ctypes import byref, c_char, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import NamedTuple

import pytest
from c_interface import Library, Status
from fmpy import read_model_description
from fmpy.model_description import ModelDescription
from named import Named
from panicking import build

STEP = 0.125
"""Its halves and multiples are exact: the level is computed without rounding."""

TEXTS = {
    "text": "the model panicked: a text, 100 %s of it ##1##",
    "formatted": "the model panicked: a text of {place} parts",
    "number": "the model panicked: no message",
}
"""What is said of each manner of panic. `#` is doubled as section 2.1.5 asks."""


class Built(NamedTuple):
    """What cargo made."""

    library: Library
    folder: Path
    """Where the description is."""
    description: ModelDescription


@pytest.fixture(scope="module")
def built(root: Path) -> Built:
    """The library, made if need be, and its description."""
    library, folder = build(root)
    return Built(Library(library), folder, read_model_description(str(folder)))


class Panicking(Named):
    """An instance of the panicking model."""

    def fail_at(self, place: str, manner: str = "text") -> Panicking:
        """Chooses where and how it fails."""
        for name, item in [("fault.place", place), ("fault.manner", manner)]:
            items = {i.name: int(i.value) for i in self.variables[name].declaredType.items}
            reference, value = (c_uint * 1)(*self.references(name)), (c_int * 1)(items[item])
            assert self.call("fmi2SetInteger", reference, 1, value) == Status.OK
        return self

    def get_errors(self, name: str) -> list[str]:
        """What is said when a Real variable is got, which must fail."""
        return self.errors_of("fmi2GetReal", (c_uint * 1)(*self.references(name)), 1, (c_double * 1)())

    def level(self) -> float:
        """The state."""
        return self.get_reals(self.references("tank.level"))[0]


Make = Callable[..., Panicking]


@pytest.fixture
def make(built: Built, capfd: pytest.CaptureFixture[str]) -> Iterator[Make]:
    """Makes instances and frees them in the end. Nothing is ever written to the host's streams: Rust's
    default would be to write each panic to stderr."""
    made: list[Panicking] = []

    def make(**arguments) -> Panicking:
        made.append(Panicking(built.library, built.description, **arguments))
        return made[-1]

    yield make
    for instance in made:
        instance.free()
    assert capfd.readouterr() == ("", "")


def expected(manner: str, place: int) -> str:
    """What is said of a panic of a manner, at the place of a number."""
    return TEXTS[manner].format(place=place)


def runs_to(instance: Panicking, steps: int) -> None:
    """A fresh or reset instance works: its input is 1 per second, so its level is the time."""
    instance.initialize()
    for index in range(steps):
        assert instance.step(index * STEP, STEP) == Status.OK
    assert instance.level() == steps * STEP


def refuses_until_reset(instance: Panicking, time: float = 0.0) -> None:
    """After a panic the instance is in the state `error` of section 4.2.4, and the way out is a reset."""
    assert instance.errors_of("fmi2DoStep", time, STEP, 1) == [
        "fmi2DoStep: must not be called in the state error"
    ]
    for function in ["fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2Terminate"]:
        assert instance.errors_of(function) == [f"{function}: must not be called in the state error"]
    assert instance.call("fmi2Reset") == Status.OK
    runs_to(instance, 4)


def survives(built: Built, *statements: str) -> None:
    """Runs statements on an `instance` in a process of their own, for what may end it: a panic is not caught
    that another one sets off while it unwinds."""
    code = [
        "import sys, test_panics as t",
        "from c_interface import Library",
        "from fmpy import read_model_description",
        "instance = t.Panicking(Library(sys.argv[1]), read_model_description(sys.argv[2]))",
        *statements,
    ]
    command = [sys.executable, "-c", "\n".join(code), str(built.library.path), str(built.folder)]
    child = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, check=False)
    assert (child.returncode, child.stdout, child.stderr) == (0, b"", b"")


@pytest.fixture
def bystander(make: Make) -> Iterator[Panicking]:
    """Another instance of the same library, in the middle of its run, that notices nothing."""
    instance = make(name=b"bystander")
    runs_to(instance, 3)
    yield instance
    for index in range(3, 6):
        assert instance.step(index * STEP, STEP) == Status.OK
    assert instance.level() == 6 * STEP
    assert instance.messages == []


@pytest.mark.parametrize("manner", TEXTS)
def test_panic_as_parameters_are_checked(make: Make, bystander: Panicking, manner: str) -> None:
    instance = make().fail_at("check_parameters", manner)
    assert instance.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == Status.OK
    assert instance.call("fmi2EnterInitializationMode") == Status.OK
    assert instance.errors_of("fmi2ExitInitializationMode") == [
        f"fmi2ExitInitializationMode: {expected(manner, 2)}; reset the instance"
    ]
    refuses_until_reset(instance)


@pytest.mark.parametrize("manner", TEXTS)
def test_panic_as_tuned_parameters_are_checked(make: Make, bystander: Panicking, manner: str) -> None:
    instance = make()
    runs_to(instance, 2)
    instance.fail_at("check_parameters", manner)
    assert instance.errors_of("fmi2DoStep", 2 * STEP, STEP, 1) == [
        f"fmi2DoStep: {expected(manner, 2)}; reset the instance"
    ]
    refuses_until_reset(instance, 2 * STEP)


@pytest.mark.parametrize("manner", TEXTS)
def test_panic_in_the_initialization(make: Make, bystander: Panicking, manner: str) -> None:
    instance = make().fail_at("initialize", manner)
    assert instance.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == Status.OK
    assert instance.call("fmi2EnterInitializationMode") == Status.OK
    assert instance.errors_of("fmi2ExitInitializationMode") == [
        f"fmi2ExitInitializationMode: {expected(manner, 3)}; reset the instance"
    ]
    refuses_until_reset(instance)


@pytest.mark.parametrize("manner", TEXTS)
def test_panic_in_the_initialization_as_a_value_is_got(make: Make, bystander: Panicking, manner: str) -> None:
    """In Initialization Mode a value that is got is computed then (section 4.2.4, note 2)."""
    instance = make()
    assert instance.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == Status.OK
    assert instance.call("fmi2EnterInitializationMode") == Status.OK
    instance.fail_at("initialize", manner)
    said = f"fmi2GetReal: {expected(manner, 3)}; reset the instance"
    assert instance.get_errors("output") == [said]
    refuses_until_reset(instance)


@pytest.mark.parametrize("manner", TEXTS)
def test_panic_in_a_step(make: Make, bystander: Panicking, manner: str) -> None:
    instance = make()
    runs_to(instance, 2)
    instance.fail_at("step", manner)
    assert instance.errors_of("fmi2DoStep", 2 * STEP, STEP, 1) == [
        f"fmi2DoStep: {expected(manner, 4)}; reset the instance"
    ]
    # Values can be got for debugging (section 4.2.4, note 7): here half of the step.
    assert instance.level() == 2.5 * STEP
    refuses_until_reset(instance, 2 * STEP)


@pytest.mark.parametrize("manner", TEXTS)
def test_panic_as_values_are_refreshed(make: Make, bystander: Panicking, manner: str) -> None:
    instance = make()
    runs_to(instance, 2)
    instance.fail_at("refresh", manner)
    said = f"fmi2GetReal: {expected(manner, 5)}; reset the instance"
    assert instance.get_errors("output") == [said]
    refuses_until_reset(instance, 2 * STEP)


def test_saved_state_leads_back_from_a_panic(make: Make) -> None:
    """As section 2.1.3 says of `fmi2Error`: a state saved before it is taken up again."""
    instance = make()
    runs_to(instance, 2)
    state = instance.save()
    instance.fail_at("step")
    assert instance.step(2 * STEP, STEP) == Status.ERROR
    assert instance.call("fmi2SetFMUstate", state) == Status.OK
    assert instance.call("fmi2FreeFMUstate", byref(state)) == Status.OK
    assert instance.step(2 * STEP, STEP) == Status.OK
    assert instance.level() == 3 * STEP


def test_panic_as_an_instance_is_made(make: Make, bystander: Panicking) -> None:
    """No instance, and the reason through the logger (section 2.1.5, fmi2Instantiate)."""
    make().fail_at("default").initialize()
    instance = make(name=b"made too late")
    assert instance.component is None
    assert [(m.status, m.category) for m in instance.messages] == [(Status.ERROR, "logStatusError")]
    assert "the default panics" in instance.messages[0].text
    assert instance.names_and_environments == [(b"made too late", None)]
    runs_to(make(), 4)


def test_panic_as_an_instance_is_reset(make: Make, bystander: Panicking) -> None:
    instance = make().fail_at("default").initialize()
    assert instance.errors_of("fmi2Reset") == [
        "fmi2Reset: the model panicked: the default panics; reset the instance"
    ]
    refuses_until_reset(instance)


def test_panic_as_a_state_is_saved(make: Make, bystander: Panicking) -> None:
    instance = make().fail_at("clone").initialize()
    state = c_void_p()
    assert instance.errors_of("fmi2GetFMUstate", byref(state)) == [
        "fmi2GetFMUstate: the model panicked: the clone panics; reset the instance"
    ]
    assert state.value is None
    refuses_until_reset(instance)


def test_panic_as_a_saved_state_is_overwritten(make: Make, bystander: Panicking) -> None:
    """What was saved before into the same handle (section 2.1.8) is still there."""
    instance = make()
    runs_to(instance, 2)
    state = instance.save()
    other = make().fail_at("clone").initialize()
    assert other.call("fmi2Terminate") == Status.OK
    handle = state.value
    assert instance.call("fmi2Reset") == Status.OK
    instance.fail_at("clone").initialize()
    assert instance.errors_of("fmi2GetFMUstate", byref(state)) == [
        "fmi2GetFMUstate: the model panicked: the clone panics; reset the instance"
    ]
    assert state.value == handle
    assert instance.call("fmi2SetFMUstate", state) == Status.OK
    assert instance.level() == 2 * STEP
    assert instance.call("fmi2FreeFMUstate", byref(state)) == Status.OK


def test_panic_as_a_state_is_serialized(make: Make, bystander: Panicking) -> None:
    instance = make().fail_at("persist").initialize()
    state, size = instance.save(), c_size_t(7)
    assert instance.errors_of("fmi2SerializedFMUstateSize", state, byref(size)) == [
        "fmi2SerializedFMUstateSize: the model panicked: the serialization panics; reset the instance"
    ]
    assert size.value == 7
    refuses_until_reset(instance)
    # The state is none the worse.
    assert instance.call("fmi2SetFMUstate", state) == Status.OK
    assert instance.step(0.0, STEP) == Status.OK
    assert instance.call("fmi2FreeFMUstate", byref(state)) == Status.OK


@pytest.mark.parametrize("manner", TEXTS)
def test_panic_as_a_state_is_deserialized(make: Make, bystander: Panicking, manner: str) -> None:
    instance = make()
    runs_to(instance, 2)
    instance.fail_at("restored", manner)
    saved = instance.save()
    data = instance.serialize(saved)
    assert instance.call("fmi2FreeFMUstate", byref(saved)) == Status.OK
    made = c_void_p()
    errors = instance.errors_of(
        "fmi2DeSerializeFMUstate", (c_char * len(data))(*data), len(data), byref(made)
    )
    assert errors == [f"fmi2DeSerializeFMUstate: {expected(manner, 10)}; reset the instance"]
    assert made.value is None
    refuses_until_reset(instance, 2 * STEP)


def test_panic_as_an_instance_is_freed(make: Make, bystander: Panicking) -> None:
    """There is nobody left to tell: fmi2FreeInstance has no status. It just returns."""
    instance = make().fail_at("drop").initialize()
    instance.free()
    assert instance.messages == []


@pytest.mark.parametrize("states", [1, 2, 5])
def test_panics_as_an_instance_is_freed_with_its_states(built: Built, states: int) -> None:
    """Each state that is left panics, and the instance too."""
    survives(
        built,
        "instance.fail_at('drop').initialize()",
        *["instance.save()"] * states,
        "instance.free()",
        "assert instance.messages == []",
    )


def test_panic_with_what_panics_itself(built: Built) -> None:
    survives(
        built,
        "instance.initialize().fail_at('step', 'panicking_payload')",
        "texts = instance.errors_of('fmi2DoStep', 0.0, t.STEP, 1)",
        "assert texts == ['fmi2DoStep: the model panicked: no message; reset the instance']",
        "t.refuses_until_reset(instance)",
    )


def test_panic_as_the_old_model_of_a_reset_is_given_up(make: Make, bystander: Panicking) -> None:
    instance = make().fail_at("drop").initialize()
    assert instance.errors_of("fmi2Reset") == [
        "fmi2Reset: the model panicked: the drop panics; reset the instance"
    ]
    refuses_until_reset(instance)


def test_panic_as_a_saved_state_is_freed(make: Make, bystander: Panicking) -> None:
    """The state is gone all the same; its handle is none any more, so that it is not freed twice."""
    instance = make().fail_at("drop").initialize()
    state = instance.save()
    handle = c_void_p(state.value)
    assert instance.errors_of("fmi2FreeFMUstate", byref(state)) == [
        "fmi2FreeFMUstate: the model panicked: the drop panics; reset the instance"
    ]
    assert instance.errors_of("fmi2FreeFMUstate", byref(handle)) == [
        "fmi2FreeFMUstate: the argument FMUstate is not a state of this FMU, or was freed"
    ]


@pytest.mark.parametrize("manner", ["not_a_number", "infinity"])
@pytest.mark.parametrize("getting", [False, True], ids=["exit", "get"])
def test_initialization_to_what_is_no_number(
    make: Make, bystander: Panicking, manner: str, getting: bool
) -> None:
    """The message names the variable; it is no panic, so with other parameters it goes on."""
    instance = make().fail_at("initialize", manner)
    assert instance.call("fmi2SetupExperiment", 0, 0.0, 1.5, 0, 0.0) == Status.OK
    assert instance.call("fmi2EnterInitializationMode") == Status.OK
    found = {"not_a_number": "NaN", "infinity": "inf"}[manner]
    said = f"the variable tank.level became {found} at the time 1.5 s"
    if getting:
        assert instance.get_errors("output") == [f"fmi2GetReal: {said}"]
    else:
        errors = instance.errors_of("fmi2ExitInitializationMode")
        assert errors == [f"fmi2ExitInitializationMode: {said}"]
    instance.fail_at("nowhere")
    assert instance.call("fmi2ExitInitializationMode") == Status.OK
    assert instance.step(1.5, STEP) == Status.OK
    assert instance.level() == STEP


@pytest.mark.parametrize("manner", ["not_a_number", "infinity"])
def test_step_to_what_is_no_number(make: Make, bystander: Panicking, manner: str) -> None:
    instance = make()
    runs_to(instance, 2)
    instance.fail_at("step", manner)
    found = {"not_a_number": "NaN", "infinity": "inf"}[manner]
    assert instance.errors_of("fmi2DoStep", 2 * STEP, STEP, 1) == [
        f"fmi2DoStep: the variable tank.level became {found} at the time 0.375 s"
    ]
    # Nothing that is no number is given as a value.
    value = (c_double * 1)(7.0)
    reference = (c_uint * 1)(*instance.references("tank.level"))
    assert instance.errors_of("fmi2GetReal", reference, 1, value) == [
        f"fmi2GetReal: the variable tank.level is {found}"
    ]
    assert math.isfinite(value[0])
    refuses_until_reset(instance, 2 * STEP)


@pytest.mark.parametrize("manner", ["not_a_number", "infinity"])
def test_refresh_to_what_is_no_number(make: Make, bystander: Panicking, manner: str) -> None:
    instance = make()
    runs_to(instance, 2)
    instance.fail_at("refresh", manner)
    found = {"not_a_number": "NaN", "infinity": "inf"}[manner]
    assert instance.get_errors("output") == [f"fmi2GetReal: the variable output is {found}"]


@pytest.mark.parametrize("place", ["check_parameters", "initialize", "step"])
def test_refusal_is_no_panic(make: Make, bystander: Panicking, place: str) -> None:
    """A model's own errors come through as they are."""
    instance = make()
    if place == "step":
        runs_to(instance, 2)
        instance.fail_at(place, "refusal")
        assert instance.errors_of("fmi2DoStep", 2 * STEP, STEP, 1) == ["fmi2DoStep: a refusal"]
        refuses_until_reset(instance, 2 * STEP)
        return
    instance.fail_at(place, "refusal")
    assert instance.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == Status.OK
    assert instance.call("fmi2EnterInitializationMode") == Status.OK
    assert instance.errors_of("fmi2ExitInitializationMode") == ["fmi2ExitInitializationMode: a refusal"]
    instance.fail_at("nowhere")
    assert instance.call("fmi2ExitInitializationMode") == Status.OK


def test_a_thousand_panics(make: Make, bystander: Panicking) -> None:
    """Rust counts the panics under way in each thread; a count that leaked would end the process."""
    instance = make()
    runs_to(instance, 1)
    instance.fail_at("refresh", "number")
    state = instance.save()
    reference, value = (c_uint * 1)(*instance.references("output")), (c_double * 1)()
    for _ in range(1000):
        assert instance.library.fmi2GetReal(instance.component, reference, 1, value) == Status.ERROR
        assert instance.library.fmi2SetFMUstate(instance.component, state) == Status.OK
    assert len(instance.messages) == 1000
    assert instance.call("fmi2FreeFMUstate", byref(state)) == Status.OK


def test_library_unloads_after_a_panic(built: Built, tmp_path: Path) -> None:
    """What Rust keeps of a panic for the thread's end would hold the library in the process."""
    copy = tmp_path / built.library.path.name
    shutil.copy(built.library.path, copy)

    def is_mapped() -> bool:
        return str(copy) in Path("/proc/self/maps").read_text()

    library = Library(copy)
    instance = Panicking(library, built.description)
    instance.initialize().fail_at("step", "formatted")
    assert instance.step(0.0, STEP) == Status.ERROR
    instance.free()
    assert is_mapped()
    dlclose(library.handle._handle)
    assert not is_mapped()
