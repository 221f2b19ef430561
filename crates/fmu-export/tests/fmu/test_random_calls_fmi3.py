"""Random importers of FMI 3.0: any function in any order with any arguments.

- A function that the standard's table does not allow in a state is an error.
- Values returned with success are finite, and nothing is written beyond the end of an array.
- A restored state goes on identically, in the instance and in another.
- After fmi3Reset an instance equals a new one, to the last byte of its state.

The calls are the same each time. `RANDOM_CALLS=1000000 python -m pytest test_random_calls_fmi3.py` makes
more.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from ctypes import byref, c_bool, c_char_p, c_double, c_float, c_size_t, c_uint8, c_void_p, string_at
from random import Random
from typing import Any

import pytest
from fmi3 import CO_SIMULATION, DECLARED, SCHEDULED_EXECUTION, TYPES, Instance, Status
from guarded import CAPACITY, NUMBERS, Guarded, plain, size_of
from test_fmi3 import (
    CLOCKED,
    INSTANCES,
    KINDS,
    STATES,
    allows,
    counts,
    described,
    libraries,
    make,
)

__all__ = ["libraries", "make"]

CALLS = int(os.environ.get("RANDOM_CALLS", "20000"))
FUNCTIONS = sorted(
    name
    for name in DECLARED
    if not name.startswith("fmi3Instantiate") and name not in ("fmi3GetVersion", "fmi3FreeInstance")
)
USEFUL = ["GetFloat64", "SetFloat64", "DoStep", "GetFMUState", "SetFMUState", "UpdateDiscreteStates"]
USEFUL += [
    "EnterContinuousTimeMode",
    "SetTime",
    "SetContinuousStates",
    "GetContinuousStateDerivatives",
    "EnterEventMode",
]
USEFUL += ["EnterInitializationMode", "ExitInitializationMode", "EnterStepMode", "ActivateModelPartition"]
OF_CLOCKS = ["SetClock", "GetClock", "GetIntervalDecimal", "SetIntervalDecimal", "SetInt32", "GetString"]
AFTER = {
    "EnterInitializationMode": "initialization",
    "EnterEventMode": "event",
    "EnterContinuousTimeMode": "continuous",
    "EnterStepMode": "step",
    "Terminate": "terminated",
    "Reset": "instantiated",
}
"""The state that a successful function leads to."""


class Importer:
    """An instance and what an importer knows of it: the state, the time and the saved states."""

    def __init__(self, make: Callable[..., Instance], interface: str, model: str) -> None:
        self.interface, self.model = interface, model
        self.references = [0] + [v.valueReference for v in described(model)[1].modelVariables]
        self.instance = make(interface, model=model, loggingOn=True)
        self.state, self.time = "instantiated", 0.0
        self.saved: list[tuple[c_void_p, str, float]] = []

    def allows(self, function: str) -> bool:
        """Whether the standard's table allows a function now."""
        return allows(function, self.state, self.interface, self.model)

    def call(self, function: str, random: Random) -> tuple[Any, ...]:
        """Calls a function with random arguments: what it returned."""
        short = function.removeprefix("fmi3")
        if short in ("GetFMUState", "SetFMUState", "FreeFMUState") or "erialize" in short:
            return self.call_with_state(short, random)
        sizes = self.sizes(short, random)
        arguments: list[Any] = []
        guarded: list[Guarded] = []
        for type, name, is_pointer in DECLARED[function][1][1:]:
            if name in sizes:
                arguments.append(sizes[name])
            elif not is_pointer:
                arguments.append(self.scalar(type, name, random))
            elif random.random() < 0.01:
                arguments.append(None)
            else:
                size = max(sizes.values(), default=1)
                values = [self.element(type, name, random) for _ in range(size)]
                guarded.append(Guarded(type, values, size))
                arguments.append(guarded[-1].array)
        status = self.instance.call(function, *arguments)
        for array in guarded:
            array.check()
        results = [array.values() for array in guarded]
        if short == "GetBinary" and status <= Status.WARNING and len(results) == 3:
            # What is at an address that an instance returned, which no other returns.
            results[2] = [
                address and string_at(address, size) for size, address in zip(*results[1:], strict=True)
            ]
        if (
            short in ("GetFloat64", "GetFloat32", "GetContinuousStateDerivatives", "GetEventIndicators")
            and status <= 1
            and guarded
        ):
            assert all(
                math.isfinite(value)
                for value in guarded[-1].array[: sizes.get("nValues", max(sizes.values()))]
            )
        self.follow(short, status)
        if short == "DoStep" and status != Status.ERROR:
            assert math.isfinite(arguments[-1][0])
            self.time = arguments[-1][0]
        values = [plain(value) for array in results for value in array]
        return short, status, values if status <= Status.WARNING else []

    def run(self, calls: list[tuple[str, float]]) -> list[tuple[Any, ...]]:
        """Calls functions, each with arguments that follow from a seed: what they returned."""
        return [self.call(name, Random(seed)) for name, seed in calls]

    def sizes(self, function: str, random: Random) -> dict[str, int]:
        """The numbers of elements; mostly those that fit."""
        names = [
            name for type, name, pointer in DECLARED[f"fmi3{function}"][1] if type is c_size_t and not pointer
        ]
        sizes = {name: counts(self.model).get(name, 1) for name in names}
        if function[3:] in KINDS:
            sizes = dict.fromkeys(names, random.randint(0, 3))
        if random.random() < 0.05 and names:
            sizes[random.choice(names)] = random.randint(0, CAPACITY)
        return sizes

    def scalar(self, type: Any, name: str, random: Random) -> Any:
        """A random argument."""
        if type is c_bool:
            return random.random() < 0.5
        if type is c_double:
            if name == "currentCommunicationPoint" and random.random() < 0.95:
                return self.time
            if name == "communicationStepSize" and random.random() < 0.9:
                return random.choice([0.125, 0.01, 1e-3])
            if name in ("time", "activationTime") and random.random() < 0.9:
                self.time += random.choice([0.0, 0.01, 0.0625])
                return self.time
            if name in ("startTime", "stopTime", "tolerance") and random.random() < 0.9:
                return {"startTime": 0.0, "stopTime": 1e3, "tolerance": 1e-6}[name]
            return random.choice(NUMBERS)
        if type is TYPES["fmi3ValueReference"]:
            return random.choice(self.references)
        return random.randint(-(2**31), 2**31 - 1) if type is not c_void_p else None

    def element(self, type: Any, name: str, random: Random) -> Any:
        """A random element of an array."""
        if type is TYPES["fmi3ValueReference"] and "eference" in name:
            return random.choice(self.references) if random.random() < 0.97 else random.randint(0, 2**32 - 1)
        if type in (c_double, c_float):
            return random.uniform(0.0, 2.0) if random.random() < 0.9 else random.choice(NUMBERS)
        if type is c_bool:
            return random.random() < 0.5
        if type is c_char_p:
            return random.choice([b"", b"a text", b"logEvents", b"\xff", "é#%s".encode(), None])
        if type is c_void_p:
            return None
        return random.choice([0, 1, 1, 2, 2, 3, random.randint(0, 2**63)]) & (
            2 ** (8 * size_of(type) - 1) - 1
        )

    def call_with_state(self, function: str, random: Random) -> tuple[Any, ...]:
        """The functions of saved states; of no state and of the importer's own."""
        if function == "GetFMUState":
            state = c_void_p()
            status = self.instance.call("fmi3GetFMUState", byref(state))
            assert status == Status.OK
            self.saved.append((state, self.state, self.time))
            return function, status
        if not self.saved or random.random() < 0.02:
            arguments = self.instance.arguments(f"fmi3{function}")
            status = self.instance.call(f"fmi3{function}", *arguments)
            self.follow(function, status)
            return function, status
        position = random.randrange(len(self.saved))
        state, phase, time = self.saved[position]
        if function == "FreeFMUState":
            self.instance.ok("fmi3FreeFMUState", FMUState=byref(state))
            assert not state.value
            del self.saved[position]
            return function, Status.OK
        if function == "SetFMUState":
            self.instance.ok("fmi3SetFMUState", FMUState=state)
            self.state, self.time = phase, time
            return function, Status.OK
        content = bytearray(self.instance.serialized(state))
        other = c_void_p()
        if function == "DeserializeFMUState" and random.random() < 0.5:
            content[random.randrange(len(content))] ^= 1 << random.randrange(8)
            data = (c_uint8 * len(content)).from_buffer(content)
            status = self.instance.call("fmi3DeserializeFMUState", data, len(content), byref(other))
            assert status == Status.ERROR
            assert not other.value
            self.follow(function, status)
            return function, status
        data = (c_uint8 * len(content)).from_buffer(content)
        assert self.instance.call("fmi3DeserializeFMUState", data, len(content), byref(other)) == Status.OK
        assert self.instance.serialized(other) == bytes(content)
        self.instance.ok("fmi3FreeFMUState", FMUState=byref(other))
        return function, Status.OK

    def follow(self, function: str, status: Status) -> None:
        """Follows the state, and checks that the function was allowed."""
        assert status < Status.FATAL
        assert status == Status.ERROR or self.allows(function), (function, self.state)
        if status == Status.ERROR:
            self.state = "error"
        elif function == "ExitInitializationMode":
            self.state = {CO_SIMULATION: "step", SCHEDULED_EXECUTION: "activation"}.get(
                self.interface, "event"
            )
        else:
            self.state = AFTER.get(function, self.state)
        if status <= Status.WARNING and function in ("EnterInitializationMode", "Reset"):
            self.time = 0.0

    def snapshot(self) -> bytes:
        """The bytes of the present state."""
        state = self.instance.state()
        content = self.instance.serialized(state)
        self.instance.ok("fmi3FreeFMUState", FMUState=byref(state))
        return content

    def restore(self, content: bytes, state: str, time: float) -> None:
        """Goes on from a snapshot, without saved states."""
        self.instance.restore(content)
        self.state, self.time, self.saved = state, time, []


@pytest.mark.parametrize(("interface", "model"), INSTANCES)
def test_calls_in_any_order(
    make: Callable[..., Instance],
    capfd: pytest.CaptureFixture[str],
    interface: str,
    model: str,
) -> None:
    useful = USEFUL + OF_CLOCKS if model.startswith(CLOCKED) else USEFUL

    def choose(random: Random) -> str:
        return f"fmi3{random.choice(useful)}" if random.random() < 0.7 else random.choice(FUNCTIONS)

    made, seed, reached = 0, 0, set()
    fresh = Importer(make, interface, model).snapshot()
    while made < CALLS:
        seed += 1
        random = Random(seed)
        importer = Importer(make, interface, model)
        for opening in ("EnterInitializationMode", "ExitInitializationMode")[: random.randint(0, 3)]:
            importer.instance.ok(f"fmi3{opening}")
            importer.follow(opening, Status.OK)
        for _ in range(random.randint(0, 40)):
            importer.call(choose(random), random)
            reached.add(importer.state)
            made += 1
        content, state, time = importer.snapshot(), importer.state, importer.time
        # The memory of saved states is not part of a state.
        tail = [(name, random.random()) for name in map(choose, [random] * 20) if "FMUState" not in name]
        importer.saved = []
        expected = importer.run(tail)
        end = importer.snapshot()
        for other in (importer, Importer(make, interface, model)):
            other.restore(content, state, time)
            assert other.snapshot() == content
            assert other.run(tail) == expected
            assert other.snapshot() == end
            made += len(tail)
        importer.instance.ok("fmi3Reset")
        assert importer.snapshot() == fresh
        for instance in (importer.instance, other.instance):
            instance.free()
    assert reached == set(STATES[interface])
    assert capfd.readouterr() == ("", "")
    with capfd.disabled():
        print(f"{interface}: {seed} sequences, {made} calls")
