"""Failing models: panics as an instance is made, copied, saved or freed, and what is left of them. Those of
every function are tested in Rust (tests/importer)."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from _ctypes import dlclose
from collections.abc import Callable, Iterator
from ctypes import byref, c_double, c_size_t, c_void_p
from pathlib import Path

import pytest

from fmu import ROOT
from fmu.exporter.importer import STEP, Instance, Library, Status
from fmu.master import Fmu

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

Make = Callable[..., Instance]

SOURCE = ROOT / "crates" / "fmu-export" / "tests" / "test-model" / "src" / "lib.rs"

NOT_FINITE = {"not_a_number": "NaN", "infinity": "inf"}


def without_place(text: str) -> str:
    """The message of a panic, whose place was checked: a line of the model that panics."""
    found = re.search(r" \(src/lib\.rs:(\d+)\)", text)
    assert found, text
    line = SOURCE.read_text().splitlines()[int(found[1]) - 1]
    assert re.search(r"panic!|panic_any|assert!", line), line
    return text.replace(found[0], "")


def runs(instance: Instance, steps: int) -> None:
    """A new or reset instance works: its rate is 1 per second, so its level is the time."""
    instance.initialize().run(steps)
    assert instance.get("tank.level") == steps * STEP


def refuses_until_reset(instance: Instance, time: float = 0.0) -> None:
    """After a panic the instance is in the state `error` of section 4.2.4, until a reset."""
    refused = "must not be called in the state error"
    assert instance.refuses("fmi2DoStep", time, STEP, 1) == refused
    for function in ["fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2Terminate"]:
        assert instance.refuses(function) == refused
    assert instance.call("fmi2Reset") == Status.OK
    runs(instance, 4)


def survives(fmu: Fmu, folder: Path, *statements: str) -> None:
    """Runs statements on an `instance` in another process, which may abort: a panic during unwinding is not
    caught."""
    code = [
        "import sys, pathlib, fmu.exporter.test_panics as t",
        "path = pathlib.Path(sys.argv[1])",
        "fmu = t.Fmu(path, pathlib.Path(sys.argv[2]))",
        "instance = t.Instance(fmu, t.Library(fmu.library))",
        *statements,
    ]
    command = [sys.executable, "-c", "\n".join(code), str(fmu.path), str(folder)]
    child = subprocess.run(command, cwd=ROOT / "tests", capture_output=True, check=False)
    assert (child.returncode, child.stdout, child.stderr) == (0, b"", b"")


@pytest.fixture(autouse=True)
def bystander(make: Make) -> Iterator[None]:
    """Another instance of the same library, in the middle of its run, which must not be affected."""
    instance = make(name=b"bystander")
    runs(instance, 3)
    yield
    for index in range(3, 6):
        assert instance.step(index * STEP, STEP) == Status.OK
    assert instance.get("tank.level") == 6 * STEP
    assert instance.messages == []


# The model remembers this fault outside of its instances, which compiled sources do not share.
@pytest.mark.native
def test_a_panic_as_an_instance_is_made(make: Make) -> None:
    """No instance, and the reason through the logger (section 2.1.5, fmi2Instantiate)."""
    make().choose(fault__place="default").initialize()
    instance = make(name=b"made too late")
    assert instance.component is None
    assert [(m.status, m.category) for m in instance.messages] == [(Status.ERROR, "logStatusError")]
    assert "the default panics" in instance.messages[0].text
    assert instance.names_and_environments == [(b"made too late", None)]
    runs(make(), 4)


@pytest.mark.parametrize(
    ("place", "function", "cause"),
    [
        ("default", "fmi2Reset", "the default"),
        ("drop", "fmi2Reset", "the drop"),
        ("clone", "fmi2GetFMUstate", "the clone"),
        # Compiled sources serialize states as they are got.
        pytest.param("persist", "fmi2SerializedFMUstateSize", "the serialization", marks=pytest.mark.native),
    ],
)
def test_a_panic_as_the_model_is_copied_or_dropped(make: Make, place: str, function: str, cause: str) -> None:
    instance = make().choose(fault__place=place).initialize()
    state, size = c_void_p(), c_size_t(7)
    arguments = [byref(state)] if place == "clone" else []
    if place == "persist":
        state = instance.save()
        arguments = [state, byref(size)]
    text = f"the model panicked: {cause} panics; reset the instance"
    assert without_place(instance.refuses(function, *arguments)) == text
    assert size.value == 7
    refuses_until_reset(instance)
    if place == "clone":
        assert state.value is None
    if place == "persist":
        # The state is unharmed.
        instance.ok("fmi2SetFMUstate", state)
        assert instance.step(0.0, STEP) == Status.OK
        instance.ok("fmi2FreeFMUstate", byref(state))


def test_a_panic_as_a_saved_state_is_overwritten(make: Make) -> None:
    """The state saved before into the same handle (section 2.1.8) is kept."""
    instance = make()
    runs(instance, 2)
    state = instance.save()
    handle = state.value
    assert instance.call("fmi2Reset") == Status.OK
    instance.choose(fault__place="clone").initialize()
    text = "the model panicked: the clone panics; reset the instance"
    assert without_place(instance.refuses("fmi2GetFMUstate", byref(state))) == text
    assert state.value == handle
    instance.ok("fmi2SetFMUstate", state)
    assert instance.get("tank.level") == 2 * STEP
    instance.ok("fmi2FreeFMUstate", byref(state))


def test_a_panic_as_an_instance_is_freed(make: Make) -> None:
    """fmi2FreeInstance has no status, and nothing can be logged any more: it just returns."""
    instance = make().choose(fault__place="drop").initialize()
    instance.free()
    assert instance.messages == []


# Compiled sources keep bytes, which are freed without the model.
@pytest.mark.native
@pytest.mark.parametrize("states", [1, 2, 5])
def test_panics_as_an_instance_is_freed_with_its_states(fmu: Fmu, tmp_path: Path, states: int) -> None:
    """Each remaining state panics, and the instance, too."""
    survives(
        fmu,
        tmp_path,
        "instance.choose(fault__place='drop').initialize()",
        *["instance.save()"] * states,
        "instance.free()",
        "assert instance.messages == []",
    )


def test_a_payload_that_panics(fmu: Fmu, tmp_path: Path) -> None:
    survives(
        fmu,
        tmp_path,
        "instance.initialize().choose(fault__place='step', fault__manner='panicking_payload')",
        "text = instance.refuses('fmi2DoStep', 0.0, t.STEP, 1)",
        "assert t.without_place(text) == 'the model panicked: no message; reset the instance', text",
        "t.refuses_until_reset(instance)",
    )


# Compiled sources have no threads.
@pytest.mark.native
def test_a_panic_in_a_thread_of_the_model(make: Make) -> None:
    """It is told with the error to which it leads, and only then."""
    instance = make()
    own = "the model's own error"
    told = "the thread failed; before, a thread panicked: a text of the thread"
    for _ in range(2):
        instance.initialize().choose(fault__place="step", fault__manner="thread")
        assert without_place(instance.refuses("fmi2DoStep", 0.0, STEP, 1)) == told
        assert instance.call("fmi2Reset") == Status.OK
        instance.initialize().choose(fault__place="step", fault__manner="error")
        assert instance.refuses("fmi2DoStep", 0.0, STEP, 1) == own
        assert instance.call("fmi2Reset") == Status.OK


# Compiled sources keep bytes, which are freed without the model.
@pytest.mark.native
def test_a_panic_as_a_saved_state_is_freed(make: Make) -> None:
    """The state is freed nevertheless; its handle is invalid, so that it is not freed twice."""
    instance = make().choose(fault__place="drop").initialize()
    state = instance.save()
    handle = c_void_p(state.value)
    text = "the model panicked: the drop panics; reset the instance"
    assert without_place(instance.refuses("fmi2FreeFMUstate", byref(state))) == text
    text = "the argument FMUstate is not a state of this FMU, or was freed"
    assert instance.refuses("fmi2FreeFMUstate", byref(handle)) == text


def test_values_that_are_not_finite_are_not_returned(make: Make) -> None:
    instance = make().initialize().choose(fault__place="refresh", fault__manner="not_a_number")
    function, vr, count, _ = instance.getting("output")
    value = (c_double * 1)(7.0)
    assert instance.refuses(function, vr, count, value) == "the variable output is NaN"
    assert value[0] == 7.0


def test_a_thousand_panics(make: Make) -> None:
    """Rust counts active panics in each thread; a leaked count would end the process."""
    instance = make()
    runs(instance, 1)
    instance.choose(fault__place="refresh", fault__manner="number")
    state = instance.save()
    getting = instance.getting("output")
    for _ in range(1000):
        assert instance.call(*getting) == Status.ERROR
        assert instance.call("fmi2SetFMUstate", state) == Status.OK
    assert len(instance.messages) == 1000


def test_the_library_unloads_after_a_panic(fmu: Fmu, tmp_path: Path) -> None:
    """Thread-local data with a destructor would keep the library in the process."""
    copy = shutil.copy(fmu.library, tmp_path)
    library = Library(copy)
    instance = Instance(fmu, library).initialize().choose(fault__place="step", fault__manner="formatted")
    assert instance.step(0.0, STEP) == Status.ERROR
    instance.free()
    assert str(copy) in Path("/proc/self/maps").read_text()
    dlclose(library.handle._handle)
    assert str(copy) not in Path("/proc/self/maps").read_text()
