"""Random importers of FMI 2.0: any function in any order with any arguments.

- A function returns a status of the standard. Values returned with success are finite, and nothing is written
  beyond the end of an array.
- A restored state goes on identically, in the instance and in another.
- After fmi2Reset an instance equals a new one, to the last byte of its state.

Which call is allowed in which state is in test_calling_sequence.py. The calls are the same each time.
`RANDOM_CALLS=1000000 python -m pytest test_random_calls.py` makes more.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from random import Random
from typing import Any

import pytest
from fmi2 import CO_SIMULATION, FUNCTIONS, MODEL_EXCHANGE, EventInfo, Instance, Status, buffer
from guarded import CAPACITY, NUMBERS, Guarded, plain

Make = Callable[..., Instance]

CALLS = int(os.environ.get("RANDOM_CALLS", "20000"))
OF_STATES = ["fmi2GetFMUstate", "fmi2SetFMUstate", "fmi2FreeFMUstate", "fmi2DeSerializeFMUstate"]
CALLED = sorted(
    name
    for name, (_, types) in FUNCTIONS.items()
    if types and name not in ("fmi2Instantiate", "fmi2FreeInstance") and "FMUstate" not in name
)
USEFUL = [
    "EnterInitializationMode",
    "ExitInitializationMode",
    "GetReal",
    "SetReal",
    "SetInteger",
    "SetupExperiment",
]
USEFUL_OF = {
    CO_SIMULATION: [*USEFUL, "DoStep", "DoStep", "SetRealInputDerivatives"],
    MODEL_EXCHANGE: [
        *USEFUL,
        "EnterEventMode",
        "NewDiscreteStates",
        "EnterContinuousTimeMode",
        "SetTime",
        "SetContinuousStates",
        "GetDerivatives",
    ],
}


class Importer:
    """An instance and what an importer knows of it: the time and the saved states."""

    def __init__(self, make: Make, fmu_type: int) -> None:
        self.instance = make(fmu_type=fmu_type, logging_on=True)
        self.functions = [f"fmi2{name}" for name in USEFUL_OF[fmu_type]]
        description = self.instance.fmu.description
        self.references = [v.valueReference for v in description.modelVariables]
        self.counts = {
            "ContinuousStates": len(description.derivatives),
            "Derivatives": len(description.derivatives),
            "EventIndicators": description.numberOfEventIndicators,
        }
        self.time = 0.0
        self.saved: list[tuple[c_void_p, float]] = []

    def choose(self, random: Random) -> str:
        """A function, mostly one that leads on."""
        return random.choice(self.functions) if random.random() < 0.7 else random.choice(CALLED)

    def call(self, function: str, random: Random) -> tuple[Any, ...]:
        """Calls a function with random arguments: what it returned."""
        size = next((n for name, n in self.counts.items() if function.endswith(name)), random.randint(0, 3))
        if random.random() < 0.05:
            size = random.randint(0, CAPACITY)
        numbers = self.numbers(function, random)
        arguments: list[Any] = []
        guarded: list[Guarded] = []
        for type in FUNCTIONS[function][1][1:]:
            if type is c_size_t:
                arguments.append(size)
            elif not hasattr(type, "_type_") or isinstance(type._type_, str):
                arguments.append(next(numbers))
            elif random.random() < 0.01:
                arguments.append(None)
            elif type._type_ is EventInfo:
                arguments.append(byref(EventInfo()))
            else:
                count = size if c_size_t in FUNCTIONS[function][1] else 1
                values = [self.element(type._type_, random) for _ in range(count)]
                guarded.append(Guarded(type._type_, values, count))
                arguments.append(guarded[-1].array)
        status = self.instance.call(function, *arguments)
        assert status <= Status.ERROR
        for array in guarded:
            array.check()
        returned = [value for array in guarded for value in array.values()]
        if status <= Status.WARNING and guarded and function.startswith("fmi2Get"):
            assert all(math.isfinite(value) for value in guarded[-1].values() if isinstance(value, float))
        if status <= Status.WARNING and function == "fmi2EnterInitializationMode":
            self.time = 0.0
        if status <= Status.WARNING and function == "fmi2DoStep":
            self.time = sum(arguments[:2])
        return function, status, [plain(value) for value in returned] if status <= Status.WARNING else []

    def numbers(self, function: str, random: Random) -> Any:
        """The arguments that are no arrays; mostly those that lead on."""
        if function == "fmi2SetTime":
            self.time += random.choice([0.0, 0.01, 0.0625])
        useful = {
            "fmi2DoStep": [self.time, random.choice([0.125, 0.01, 1e-3]), 1],
            "fmi2SetTime": [self.time],
            "fmi2SetupExperiment": [1, 1e-6, 0.0, 1, 1e3],
        }.get(function)
        if useful and random.random() < 0.95:
            return iter(useful)
        types = [type for type in FUNCTIONS[function][1][1:] if type in (c_int, c_double)]
        integers = [0, 1, 2, 3, random.randint(-(2**31), 2**31 - 1)]
        return iter([random.choice(NUMBERS if type is c_double else integers) for type in types])

    def element(self, type: Any, random: Random) -> Any:
        """A random element of an array."""
        if type is c_uint:
            return random.choice(self.references) if random.random() < 0.97 else random.randint(0, 2**32 - 1)
        if type is c_double:
            return random.uniform(0.0, 2.0) if random.random() < 0.9 else random.choice(NUMBERS)
        if type is c_char_p:
            return random.choice([b"", b"a text", b"logEvents", b"\xff", "é#%s".encode(), None])
        return random.choice([0, 1, 1, 2, 2, 3, random.randint(-(2**31), 2**31 - 1)])

    def call_with_state(self, random: Random) -> None:
        """One of the functions of saved states."""
        function = random.choice(OF_STATES)
        if function == "fmi2GetFMUstate" or not self.saved:
            self.saved.append((self.instance.save(), self.time))
            return
        position = random.randrange(len(self.saved))
        state, time = self.saved[position]
        if function == "fmi2SetFMUstate":
            self.instance.ok(function, state)
            self.time = time
        elif function == "fmi2FreeFMUstate":
            self.instance.ok(function, byref(state))
            assert not state.value
            del self.saved[position]
        else:
            content = bytearray(self.instance.serialize(state))
            content[random.randrange(len(content))] ^= 1 << random.randrange(8)
            other = c_void_p()
            status = self.instance.call(function, buffer(bytes(content)), len(content), byref(other))
            assert (status, other.value) == (Status.ERROR, None)

    def run(self, calls: list[tuple[str, float]]) -> list[tuple[Any, ...]]:
        """Calls functions, each with arguments that follow from a seed: what they returned."""
        return [self.call(name, Random(seed)) for name, seed in calls]


@pytest.mark.parametrize("fmu_type", [CO_SIMULATION, MODEL_EXCHANGE], ids=["co-simulation", "model exchange"])
def test_calls_in_any_order(make: Make, capfd: pytest.CaptureFixture[str], fmu_type: int) -> None:
    made, seed, stepped = 0, 0, 0.0
    fresh = Importer(make, fmu_type).instance.snapshot()
    while made < CALLS:
        seed += 1
        random = Random(seed)
        importer = Importer(make, fmu_type)
        openings = ["fmi2SetupExperiment", "fmi2EnterInitializationMode", "fmi2ExitInitializationMode"]
        for opening in openings[: random.randint(0, 5)]:
            importer.instance.ok(opening, *([0, 0.0, 0.0, 0, 0.0] if "Setup" in opening else []))
        for _ in range(random.randint(0, 40)):
            if random.random() < 0.1:
                importer.call_with_state(random)
            else:
                importer.call(importer.choose(random), random)
            made += 1
        stepped = max(stepped, importer.time)
        content, time = importer.instance.snapshot(), importer.time
        tail = [(importer.choose(random), random.random()) for _ in range(20)]
        expected = importer.run(tail)
        end = importer.instance.snapshot()
        other = Importer(make, fmu_type)
        for each in (importer, other):
            each.instance.restore(content)
            each.time = time
            assert each.instance.snapshot() == content
            assert each.run(tail) == expected
            assert each.instance.snapshot() == end
            made += len(tail)
        importer.instance.ok("fmi2Reset")
        assert importer.instance.snapshot() == fresh
        for each in (importer, other):
            each.instance.free()
    # They have come some way.
    assert stepped >= 0.125
    with capfd.disabled():
        print(f"{seed} sequences, {made} calls")
