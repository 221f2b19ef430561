"""States as bytes: another instance and another process go on where they were taken, and what is no state of
this FMU is refused (FMI 2.0.5, section 2.1.8)."""

from __future__ import annotations

import math
import os
import struct
import subprocess
import sys
from collections.abc import Callable
from ctypes import Array, byref, c_char, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path

import pytest
from c_interface import Caller, Library, Status, library_path
from conftest import ROOT
from master import Fmu

STEP = 1 / 80
BOTH = pytest.mark.parametrize("name", ["BoostPlant", "BoostController"])
OTHER = {"BoostPlant": "BoostController", "BoostController": "BoostPlant"}

PARAMETERS = {
    # What a fresh instance has otherwise: the latch counts periods and holds a duty.
    "BoostPlant": {"valve.duty_latch": True, "tank.volume": 0.01},
    "BoostController": {"lambda": 0.4},
}


def prepare(caller: Caller, fmu: Fmu) -> Caller:
    """An instance with parameters of its own, in the middle of a transient and of the clock's period."""
    variables = fmu.variables
    for name, value in PARAMETERS[fmu.description.modelName].items():
        if variables[name].type == "Boolean":
            one = (c_uint * 1)(variables[name].valueReference)
            assert caller.call("fmi2SetBoolean", one, 1, (c_int * 1)(value)) == Status.OK
        else:
            assert caller.set_reals([variables[name].valueReference], [value]) == Status.OK
    caller.initialize(start_time=3.0, stop_time=100.0)
    stir(caller, fmu, 0, 57)
    return caller


def references(fmu: Fmu, data_type: str) -> list[int]:
    """The value references of all variables of a type."""
    return [v.valueReference for v in fmu.description.modelVariables if v.type == data_type]


def stir(caller: Caller, fmu: Fmu, begin: int, end: int) -> list[bytes]:
    """Steps of uneven length with changing inputs; after each, the bits of all Real variables."""
    reals = references(fmu, "Real")
    inputs = [v for v in fmu.description.modelVariables if v.causality == "input"]
    results = []
    for index in range(begin, end):
        values = [float(v.start) * (1 + 0.2 * math.sin(0.3 * index + i)) for i, v in enumerate(inputs)]
        # Some are out of their bounds then: which warnings were given is part of the state.
        assert caller.set_reals([v.valueReference for v in inputs], values) in (Status.OK, Status.WARNING)
        assert caller.step(3.0 + index * 0.6 * STEP, 0.6 * STEP) == Status.OK
        results.append(struct.pack(f"{len(reals)}d", *caller.get_reals(reals)))
    return results


def restore(caller: Caller, serialized: bytes) -> None:
    """Goes on from a serialized state."""
    state = c_void_p()
    size = len(serialized)
    assert caller.call("fmi2DeSerializeFMUstate", buffer(serialized), size, byref(state)) == Status.OK
    assert caller.call("fmi2SetFMUstate", state) == Status.OK
    assert caller.call("fmi2FreeFMUstate", byref(state)) == Status.OK
    assert state.value is None


def buffer(data: bytes) -> Array[c_char]:
    """Bytes, as C takes them."""
    return (c_char * len(data)).from_buffer_copy(data)


def refusal(caller: Caller, data: bytes) -> str:
    """The message by which bytes are refused; there is no state then."""
    state = c_void_p()
    errors = caller.errors_of("fmi2DeSerializeFMUstate", buffer(data), len(data), byref(state))
    assert state.value is None
    assert len(errors) == 1
    return errors[0]


@BOTH
def test_another_instance_goes_on_identically(
    call: Callable[..., Caller], fmus: dict[str, Fmu], name: str
) -> None:
    fmu = fmus[name]
    first = prepare(call(name), fmu)
    serialized = first.serialize(first.save())
    expected = stir(first, fmu, 57, 150)
    # A fresh one, and one that has been elsewhere.
    other = call(name).initialize(start_time=-1.0)
    assert other.step(-1.0, 0.3) == Status.OK
    for caller in (call(name), other):
        restore(caller, serialized)
        assert stir(caller, fmu, 57, 150) == expected


@BOTH
@pytest.mark.parametrize("point", ["instantiated", "initializing", "terminated"])
def test_every_state_of_the_calling_sequence_is_kept(
    call: Callable[..., Caller], fmus: dict[str, Fmu], name: str, point: str
) -> None:
    fmu = fmus[name]
    first = call(name)
    speed = fmu.variables["engine_speed"].valueReference
    assert first.call("fmi2SetupExperiment", 0, 0.0, 3.0, 0, 0.0) == Status.OK
    assert first.set_reals([speed], [2000.0]) == Status.OK
    if point != "instantiated":
        assert first.call("fmi2EnterInitializationMode") == Status.OK
    if point == "terminated":
        assert first.call("fmi2ExitInitializationMode") == Status.OK
        assert first.step(3.0, 0.5) == Status.OK
        assert first.call("fmi2Terminate") == Status.OK
    second = call(name)
    restore(second, first.serialize(first.save()))

    def go_on(caller: Caller) -> object:
        if point == "terminated":
            caller.errors_of("fmi2DoStep", 3.5, STEP, 1)
            return caller.get_reals(
                v.valueReference for v in fmu.description.modelVariables if v.type == "Real"
            )
        if point == "instantiated":
            assert caller.call("fmi2EnterInitializationMode") == Status.OK
        assert caller.call("fmi2ExitInitializationMode") == Status.OK
        return stir(caller, fmu, 0, 40)

    assert go_on(second) == go_on(first)


def test_what_was_said_in_initialization_is_not_said_again(
    call: Callable[..., Caller], fmus: dict[str, Fmu]
) -> None:
    """The values are computed anew after each change; a warning of that is given once."""
    variables = fmus["BoostPlant"].variables
    first, second = call("BoostPlant"), call("BoostPlant")
    assert first.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == Status.OK
    # A start value that the settled start does not use.
    assert first.set_reals([variables["hp_shaft.speed"].valueReference], [9000.0]) == Status.OK
    assert first.call("fmi2EnterInitializationMode") == Status.OK
    output = (c_uint * 1)(variables["boost_pressure"].valueReference)
    assert first.call("fmi2GetReal", output, 1, (c_double * 1)()) == Status.WARNING
    assert len(first.messages) == 1
    assert "hp_shaft.speed" in first.messages[0].text
    restore(second, first.serialize(first.save()))
    for caller in (first, second):
        assert caller.set_reals([variables["engine_speed"].valueReference], [1600.0]) == Status.OK
        assert caller.call("fmi2GetReal", output, 1, (c_double * 1)()) == Status.OK
    assert len(first.messages) == 1
    assert second.messages == []


@BOTH
def test_another_process_goes_on_identically(
    call: Callable[..., Caller], fmus: dict[str, Fmu], name: str, tmp_path: Path
) -> None:
    fmu = fmus[name]
    first = prepare(call(name), fmu)
    (tmp_path / "state").write_bytes(first.serialize(first.save()))
    expected = stir(first, fmu, 57, 150)
    command = [sys.executable, __file__, fmu.path, tmp_path]
    modules = {**os.environ, "PYTHONPATH": str(ROOT / "tests" / "fmu")}
    subprocess.run(command, env=modules, check=True, timeout=60)
    assert (tmp_path / "continuation").read_bytes() == b"".join(expected)


def continue_elsewhere(path: Path, folder: Path) -> None:
    """What the other process does."""
    fmu = Fmu(path, folder / "extracted")
    caller = Caller(Library(library_path(fmu)), fmu.description.guid)
    restore(caller, (folder / "state").read_bytes())
    (folder / "continuation").write_bytes(b"".join(stir(caller, fmu, 57, 150)))
    caller.free()


@BOTH
def test_serializing_changes_nothing(call: Callable[..., Caller], fmus: dict[str, Fmu], name: str) -> None:
    fmu = fmus[name]
    caller = prepare(call(name), fmu)
    state = caller.save()
    once = caller.serialize(state)
    expected = stir(caller, fmu, 57, 80)
    # The saved state is what it was, and what comes back from bytes has the same bytes.
    assert caller.serialize(state) == once
    restore(caller, once)
    assert caller.serialize(caller.save()) == once
    assert stir(caller, fmu, 57, 80) == expected


@BOTH
def test_every_changed_byte_is_noticed(call: Callable[..., Caller], fmus: dict[str, Fmu], name: str) -> None:
    caller = prepare(call(name), fmus[name])
    serialized = caller.serialize(caller.save())
    before = caller.serialize(caller.save())
    for position in range(len(serialized)):
        changed = bytearray(serialized)
        changed[position] ^= 1 << (position % 8)
        refusal(caller, bytes(changed))
    assert caller.serialize(caller.save()) == before


@BOTH
def test_every_length_but_the_right_one_is_noticed(
    call: Callable[..., Caller], fmus: dict[str, Fmu], name: str
) -> None:
    caller = prepare(call(name), fmus[name])
    serialized = caller.serialize(caller.save())
    for length in range(len(serialized)):
        assert "end" in refusal(caller, serialized[:length])
    assert "3 bytes follow" in refusal(caller, serialized + b"abc")


@BOTH
def test_what_is_wrong_with_the_bytes_is_named(
    call: Callable[..., Caller], fmus: dict[str, Fmu], name: str
) -> None:
    caller = prepare(call(name), fmus[name])
    serialized = caller.serialize(caller.save())
    other = call(OTHER[name])
    foreign = refusal(caller, other.serialize(other.save()))
    assert name in foreign
    assert OTHER[name] in foreign
    assert fmus[OTHER[name]].description.guid in foreign
    # The format's version follows the 8 bytes of the signature.
    newer = struct.unpack("<I", serialized[8:12])[0] + 1
    assert f"format {newer}" in refusal(caller, serialized[:8] + struct.pack("<I", newer) + serialized[12:])
    assert "not a serialized state" in refusal(caller, b"PK\3\4" + serialized[4:])
    damaged = bytearray(serialized)
    damaged[len(damaged) // 2] ^= 0x10
    assert "checksum" in refusal(caller, bytes(damaged))


@BOTH
def test_arguments_are_checked(call: Callable[..., Caller], name: str) -> None:
    caller = call(name)
    state, size = caller.save(), c_size_t()
    assert caller.call("fmi2SerializedFMUstateSize", state, byref(size)) == Status.OK
    room = (c_char * (size.value + 1))()
    for wrong in (0, 1, size.value - 1, size.value + 1):
        assert str(size.value) in caller.errors_of("fmi2SerializeFMUstate", state, room, wrong)[0]
        assert bytes(room) == bytes(len(room))
    assert "size" in caller.errors_of("fmi2SerializedFMUstateSize", state, None)[0]
    assert "serializedState" in caller.errors_of("fmi2SerializeFMUstate", state, None, size)[0]
    for function in ("fmi2SerializedFMUstateSize", "fmi2SerializeFMUstate"):
        arguments = [byref(size)] if function == "fmi2SerializedFMUstateSize" else [room, size]
        assert "FMUstate" in caller.errors_of(function, None, *arguments)[0]
    assert caller.call("fmi2SerializeFMUstate", state, room, size) == Status.OK
    assert "FMUstate" in caller.errors_of("fmi2DeSerializeFMUstate", room, size, None)[0]
    assert "serializedState" in caller.errors_of("fmi2DeSerializeFMUstate", None, size, byref(c_void_p()))[0]


@BOTH
def test_handles_that_are_no_states_are_refused(call: Callable[..., Caller], name: str) -> None:
    caller, other = call(name), call(OTHER[name])
    freed = caller.save()
    stale = c_void_p(freed.value)
    assert caller.call("fmi2FreeFMUstate", byref(freed)) == Status.OK
    size, room = c_size_t(), (c_char * 10)()
    for wrong in (stale, c_void_p(12345), c_void_p(caller.component), other.save()):
        for function, arguments in [
            ("fmi2GetFMUstate", [byref(wrong)]),
            ("fmi2SetFMUstate", [wrong]),
            ("fmi2FreeFMUstate", [byref(wrong)]),
            ("fmi2SerializedFMUstateSize", [wrong, byref(size)]),
            ("fmi2SerializeFMUstate", [wrong, room, 10]),
        ]:
            assert "FMUstate" in caller.errors_of(function, *arguments)[0]


@BOTH
def test_a_component_of_another_fmu_is_refused(call: Callable[..., Caller], name: str) -> None:
    caller, other = call(name), call(OTHER[name])
    own, caller.component = caller.component, other.component
    try:
        assert caller.call("fmi2Reset") == Status.ERROR
        caller.library.fmi2FreeInstance(caller.component)
    finally:
        caller.component = own
    assert other.call("fmi2Reset") == Status.OK
    assert caller.call("fmi2Reset") == Status.OK


@BOTH
def test_a_saved_state_can_be_saved_over(
    call: Callable[..., Caller], fmus: dict[str, Fmu], name: str
) -> None:
    """As masters with error control do, through one handle, thousands of times."""
    fmu = fmus[name]
    caller = prepare(call(name), fmu)
    state = caller.save()
    handle = state.value
    for index in range(57, 60):
        stir(caller, fmu, index, index + 1)
        assert caller.call("fmi2GetFMUstate", byref(state)) == Status.OK
        assert state.value == handle
    expected = stir(caller, fmu, 60, 70)
    assert caller.call("fmi2SetFMUstate", state) == Status.OK
    assert stir(caller, fmu, 60, 70) == expected


@BOTH
def test_bytes_become_a_new_state(call: Callable[..., Caller], fmus: dict[str, Fmu], name: str) -> None:
    """Section 2.1.8: a copy is constructed. An importer's variable that was never set may hold anything, an
    earlier state that is alive among it; that stays as it is."""
    fmu = fmus[name]
    caller = prepare(call(name), fmu)
    older = caller.save()
    before = caller.serialize(older)
    stir(caller, fmu, 57, 60)
    later = caller.serialize(caller.save())
    assert later != before
    for held in (older.value, 12345, None):
        there = c_void_p(held)
        assert caller.call("fmi2DeSerializeFMUstate", buffer(later), len(later), byref(there)) == Status.OK
        assert there.value not in (None, held)
        assert caller.serialize(there) == later
        assert caller.serialize(older) == before


if __name__ == "__main__":
    continue_elsewhere(Path(sys.argv[1]), Path(sys.argv[2]))
