"""Saved and serialized states: another instance and another process continue from them, and anything else
than a state of this FMU is refused (FMI 2.0.5, section 2.1.8)."""

from __future__ import annotations

import copy
import math
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from ctypes import byref, c_char, c_size_t, c_void_p
from pathlib import Path

import pytest
from fmi2 import STEP, Fmu, Instance, Library, Status, buffer
from life import LIVES, Life, differences

Make = Callable[..., Instance]
Live = Callable[..., Life]


def drive(instance: Instance, begin: int, end: int) -> list[list]:
    """Steps of uneven length with changing inputs, some out of their bounds, since past warnings are part of
    the state. Returns the outputs after each step."""
    results = []
    for index in range(begin, end):
        values = {"rate": 11.0 * math.sin(0.3 * index), "drive": math.cos(index), "note": b"%d" % index}
        assert instance.set(values) in (Status.OK, Status.WARNING)
        assert instance.step(3.0 + index * 0.6 * STEP, 0.6 * STEP) == Status.OK
        results.append(instance.outputs())
    return results


def prepare(instance: Instance) -> Instance:
    """An instance with other parameters than the defaults, in the middle of a run."""
    parameters = {"tank.gain": 1.5, "settings.label": b"x", "settings.doubled": 1, "settings.first": 3}
    assert instance.set(parameters) == Status.OK
    instance.initialize(start_time=3.0, stop_time=100.0)
    drive(instance, 0, 20)
    return instance


def refusal(instance: Instance, data: bytes) -> str:
    """The message when bytes are refused, and no state is made."""
    state = c_void_p()
    text = instance.refuses("fmi2DeSerializeFMUstate", buffer(data), len(data), byref(state))
    assert state.value is None
    return text


def test_a_restored_state_goes_on_identically(make: Make) -> None:
    """In the instance, in a new one, and in one with another history; from a handle, any number of times, and
    from bytes, which serializing does not change."""
    first = prepare(make())
    state = first.save()
    data = first.serialize(state)
    expected = drive(first, 20, 50)
    for _ in range(2):
        first.ok("fmi2SetFMUstate", state)
        assert drive(first, 20, 50) == expected
    assert first.serialize(state) == data
    elsewhere = make().initialize(start_time=-1.0)
    assert elsewhere.step(-1.0, 0.3) == Status.OK
    for instance in (first, make(), elsewhere):
        instance.restore(data)
        assert instance.snapshot() == data
        assert drive(instance, 20, 50) == expected


@pytest.mark.parametrize(("fmu_type", "state"), LIVES)
def test_every_state_of_the_calling_sequence_is_kept(live: Live, fmu_type: int, state: str) -> None:
    """From bytes in another instance, and from a handle in the same."""
    life, other = live(state, fmu_type=fmu_type), live(fmu_type=fmu_type)
    saved, reached = life.save(), copy.copy(life)
    data = life.serialize(saved)
    other.restore(data)
    assert other.snapshot() == data
    expected = life.go_on()
    assert differences(other.take_the_place_of(reached).go_on(), expected) == []
    life.ok("fmi2SetFMUstate", saved)
    assert differences(life.take_the_place_of(reached).go_on(), expected) == []


@pytest.mark.parametrize(("fmu_type", "state"), LIVES)
def test_a_state_of_the_other_interface_is_refused(live: Live, unharmed, fmu_type: int, state: str) -> None:
    """By its handle and by its bytes, in each state; the message names both interfaces."""
    life, other = live(state, fmu_type=fmu_type), live(fmu_type=1 - fmu_type)
    saved = other.save()
    names = ["Co-Simulation", "Model Exchange"]
    life.refuses("fmi2SetFMUstate", saved, names=names)
    data, made = other.serialize(saved), c_void_p()
    life.refuses("fmi2DeSerializeFMUstate", buffer(data), len(data), byref(made), names=names)
    assert made.value is None
    other.ok("fmi2SetFMUstate", saved)
    unharmed(life)


def test_a_warning_is_not_repeated_after_a_restore(make: Make) -> None:
    """Initialization is repeated after each change, but logs each warning once."""
    first, second = make(), make()
    assert first.set({"motion.position": 0.5}) == Status.OK
    first.enter()
    assert first.call(*first.getting("output")) == Status.WARNING
    assert len(first.messages) == 1
    assert "motion.position" in first.messages[0].text
    second.restore(first.snapshot())
    for instance in (first, second):
        assert instance.set({"rate": 2.0}) == Status.OK
        assert instance.get("output") == 2.0
    assert len(first.messages) == 1
    assert second.messages == []


def test_warnings_of_initialization_do_not_accumulate(make: Make) -> None:
    """An importer that tries thousands of values gets a warning for each; one that alternates between two,
    once."""
    instance = make()
    instance.enter()

    def initialized(number: int) -> Status:
        assert instance.set({"note": b"warning %4d" % number}) == Status.OK
        return instance.call(*instance.getting("output"))

    assert [initialized(number) for number in range(100)] == [Status.WARNING] * 100
    before = len(instance.snapshot())
    assert [initialized(number) for number in range(100, 2000)] == [Status.WARNING] * 1900
    assert len(instance.snapshot()) == before
    assert [initialized(number) for number in [1997, 1998, 1999] * 3] == [Status.OK] * 9
    assert len(instance.messages) == 2000


def test_another_process_goes_on_identically(make: Make, fmu: Fmu, tmp_path: Path) -> None:
    first = prepare(make())
    (tmp_path / "state").write_bytes(first.snapshot())
    command = [sys.executable, __file__, fmu.path, tmp_path]
    done = subprocess.run(command, check=True, timeout=60, capture_output=True, text=True)
    assert done.stdout.strip() == repr(drive(first, 20, 50))


def test_every_changed_byte_is_noticed(make: Make) -> None:
    instance = prepare(make())
    data = instance.snapshot()
    for position in range(len(data)):
        changed = bytearray(data)
        changed[position] ^= 1 << (position % 8)
        refusal(instance, bytes(changed))
    assert instance.snapshot() == data


def test_every_wrong_length_is_noticed(make: Make) -> None:
    instance = prepare(make())
    data = instance.snapshot()
    for length in range(len(data)):
        assert "end" in refusal(instance, data[:length])
    assert "3 bytes follow" in refusal(instance, data + b"abc")


def test_errors_in_the_bytes_are_named(make: Make) -> None:
    instance = prepare(make())
    data = instance.snapshot()
    # The format's version follows the 8 bytes of the signature.
    newer = struct.unpack("<I", data[8:12])[0] + 1
    assert f"format {newer}" in refusal(instance, data[:8] + struct.pack("<I", newer) + data[12:])
    assert "not a serialized state" in refusal(instance, b"PK\3\4" + data[4:])
    damaged = bytearray(data)
    damaged[len(damaged) // 2] ^= 0x10
    assert "checksum" in refusal(instance, bytes(damaged))


def test_arguments_are_checked(make: Make) -> None:
    instance = make()
    state, size = instance.save(), c_size_t()
    instance.ok("fmi2SerializedFMUstateSize", state, byref(size))
    room = (c_char * (size.value + 1))()
    for wrong in (0, 1, size.value - 1, size.value + 1):
        assert str(size.value) in instance.refuses("fmi2SerializeFMUstate", state, room, wrong)
        assert bytes(room) == bytes(len(room))
    for function, arguments, name in [
        ("fmi2SerializedFMUstateSize", [state, None], "size"),
        ("fmi2SerializedFMUstateSize", [None, byref(size)], "FMUstate"),
        ("fmi2SerializeFMUstate", [state, None, size], "serializedState"),
        ("fmi2SerializeFMUstate", [None, room, size], "FMUstate"),
        ("fmi2DeSerializeFMUstate", [None, size, byref(c_void_p())], "serializedState"),
        ("fmi2DeSerializeFMUstate", [room, size, None], "FMUstate"),
    ]:
        instance.refuses(function, *arguments, names=[name])


@pytest.fixture
def other(fmu: Fmu, tmp_path: Path) -> Instance:
    """An instance of another library."""
    instance = Instance(fmu, Library(shutil.copy(fmu.library, tmp_path)))
    yield instance
    instance.free()


def test_a_handle_that_is_not_a_state(live: Live, unharmed: Callable[[Life], None], other: Instance) -> None:
    """Freed, another library's, or anything else: refused, and not dereferenced."""
    life = live("stepComplete")
    freed, of_other = life.save(), other.save()
    wrong = [freed.value, of_other.value, 4096, life.component]
    life.ok("fmi2FreeFMUstate", byref(freed))
    size, room = c_size_t(), (c_char * 10)()
    for value in wrong:
        handle = c_void_p(value)
        for function, arguments in [
            ("fmi2GetFMUstate", [byref(handle)]),
            ("fmi2SetFMUstate", [handle]),
            ("fmi2FreeFMUstate", [byref(handle)]),
            ("fmi2SerializedFMUstateSize", [handle, byref(size)]),
            ("fmi2SerializeFMUstate", [handle, room, 10]),
        ]:
            life.refuses(function, *arguments, names=["FMUstate"])
            assert handle.value == value
    other.ok("fmi2SetFMUstate", of_other)
    unharmed(life)


def test_a_saved_state_can_be_saved_over(make: Make) -> None:
    """As in masters with error control, thousands of times with one handle."""
    instance = prepare(make())
    state = instance.save()
    handle = state.value
    for index in range(20, 23):
        drive(instance, index, index + 1)
        instance.ok("fmi2GetFMUstate", byref(state))
        assert state.value == handle
    expected = drive(instance, 23, 30)
    instance.ok("fmi2SetFMUstate", state)
    assert drive(instance, 23, 30) == expected


def test_bytes_become_a_new_state(make: Make) -> None:
    """Section 2.1.8: a copy is constructed. An importer's variable that was never set may hold anything, such
    as an earlier state, which must not change."""
    instance = prepare(make())
    older = instance.save()
    before = instance.serialize(older)
    drive(instance, 20, 23)
    later = instance.snapshot()
    assert later != before
    for held in (older.value, 12345, None):
        there = c_void_p(held)
        instance.ok("fmi2DeSerializeFMUstate", buffer(later), len(later), byref(there))
        assert there.value not in (None, held)
        assert instance.serialize(there) == later
        assert instance.serialize(older) == before


def test_the_experiment_that_was_set_up_is_kept(make: Make) -> None:
    instance, other = make(), make()
    instance.set_up(start_time=3.0, stop_time=4.0)
    other.restore(instance.snapshot())
    other.ok("fmi2EnterInitializationMode")
    other.ok("fmi2ExitInitializationMode")
    assert other.get("time") == 3.0
    other.refuses("fmi2DoStep", 3.0, 2.0, 1, names=["stopTime"])


def test_instances_do_not_share(make: Make) -> None:
    """Two instances of one library, stepped in turn, are independent."""
    alone = drive(make().initialize(3.0), 0, 20)
    first, second = make().initialize(3.0), prepare(make())
    results = []
    for index in range(20):
        results += drive(first, index, index + 1)
        drive(second, 20 + index, 21 + index)
    assert results == alone


if __name__ == "__main__":
    restored = Fmu(Path(sys.argv[1]), Path(sys.argv[2]) / "extracted")
    elsewhere = Instance(restored, Library(restored.library))
    elsewhere.restore((Path(sys.argv[2]) / "state").read_bytes())
    print(repr(drive(elsewhere, 20, 50)))
