"""An exported library's functions as the standard declares them in C, called through ctypes.

Importers such as FMPy protect their users from null pointers, calls out of order and values that are not
finite; here they reach the library.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from ctypes import (
    CDLL,
    CFUNCTYPE,
    POINTER,
    Structure,
    byref,
    c_char,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint,
    c_void_p,
)
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

from fmpy import extract, platform, read_model_description, sharedLibraryExtension
from fmpy.model_description import ScalarVariable

STEP = 0.125
"""Exact in binary, so that the model's level is computed without rounding."""

MODEL_EXCHANGE, CO_SIMULATION = 0, 1
"""`fmi2Type`."""


class Status(IntEnum):
    """`fmi2Status`."""

    OK = 0
    WARNING = 1
    DISCARD = 2
    ERROR = 3
    FATAL = 4
    PENDING = 5


class Message(NamedTuple):
    """A logged message."""

    status: int
    category: str
    text: str


LOGGER = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)
"""`fmi2CallbackLogger`, with the one variadic argument that the format "%s" reads. On the 64-bit platforms
whose binaries run here, a pointer is passed to a variadic function as to any other."""


class CallbackFunctions(Structure):
    """`fmi2CallbackFunctions`."""

    _fields_ = [
        ("logger", LOGGER),
        ("allocate_memory", c_void_p),
        ("free_memory", c_void_p),
        ("step_finished", c_void_p),
        ("component_environment", c_void_p),
    ]


class EventInfo(Structure):
    """`fmi2EventInfo`."""

    _fields_ = [
        ("new_discrete_states_needed", c_int),
        ("terminate_simulation", c_int),
        ("nominals_of_continuous_states_changed", c_int),
        ("values_of_continuous_states_changed", c_int),
        ("next_event_time_defined", c_int),
        ("next_event_time", c_double),
    ]


_COMPONENT = c_void_p
_REFERENCES = POINTER(c_uint)
_SIZE = c_size_t

Functions = Mapping[str, tuple[Any, list[Any]]]

COMMON: Functions = {
    "fmi2GetTypesPlatform": (c_char_p, []),
    "fmi2GetVersion": (c_char_p, []),
    "fmi2SetDebugLogging": (c_int, [_COMPONENT, c_int, _SIZE, POINTER(c_char_p)]),
    "fmi2Instantiate": (
        c_void_p,
        [c_char_p, c_int, c_char_p, c_char_p, POINTER(CallbackFunctions), c_int, c_int],
    ),
    "fmi2FreeInstance": (None, [_COMPONENT]),
    "fmi2SetupExperiment": (c_int, [_COMPONENT, c_int, c_double, c_double, c_int, c_double]),
    "fmi2EnterInitializationMode": (c_int, [_COMPONENT]),
    "fmi2ExitInitializationMode": (c_int, [_COMPONENT]),
    "fmi2Terminate": (c_int, [_COMPONENT]),
    "fmi2Reset": (c_int, [_COMPONENT]),
    "fmi2GetReal": (c_int, [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_double)]),
    "fmi2GetInteger": (c_int, [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_int)]),
    "fmi2GetBoolean": (c_int, [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_int)]),
    "fmi2GetString": (c_int, [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_char_p)]),
    "fmi2SetReal": (c_int, [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_double)]),
    "fmi2SetInteger": (c_int, [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_int)]),
    "fmi2SetBoolean": (c_int, [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_int)]),
    "fmi2SetString": (c_int, [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_char_p)]),
    "fmi2GetFMUstate": (c_int, [_COMPONENT, POINTER(c_void_p)]),
    "fmi2SetFMUstate": (c_int, [_COMPONENT, c_void_p]),
    "fmi2FreeFMUstate": (c_int, [_COMPONENT, POINTER(c_void_p)]),
    "fmi2SerializedFMUstateSize": (c_int, [_COMPONENT, c_void_p, POINTER(c_size_t)]),
    "fmi2SerializeFMUstate": (c_int, [_COMPONENT, c_void_p, POINTER(c_char), _SIZE]),
    "fmi2DeSerializeFMUstate": (c_int, [_COMPONENT, POINTER(c_char), _SIZE, POINTER(c_void_p)]),
    "fmi2GetDirectionalDerivative": (
        c_int,
        [_COMPONENT, _REFERENCES, _SIZE, _REFERENCES, _SIZE, POINTER(c_double), POINTER(c_double)],
    ),
}
"""Each function's result and arguments, in the order of the standard (fmi2FunctionTypes.h)."""

OF_MODEL_EXCHANGE: Functions = {
    "fmi2EnterEventMode": (c_int, [_COMPONENT]),
    "fmi2NewDiscreteStates": (c_int, [_COMPONENT, POINTER(EventInfo)]),
    "fmi2EnterContinuousTimeMode": (c_int, [_COMPONENT]),
    "fmi2CompletedIntegratorStep": (c_int, [_COMPONENT, c_int, POINTER(c_int), POINTER(c_int)]),
    "fmi2SetTime": (c_int, [_COMPONENT, c_double]),
    "fmi2SetContinuousStates": (c_int, [_COMPONENT, POINTER(c_double), _SIZE]),
    "fmi2GetDerivatives": (c_int, [_COMPONENT, POINTER(c_double), _SIZE]),
    "fmi2GetEventIndicators": (c_int, [_COMPONENT, POINTER(c_double), _SIZE]),
    "fmi2GetContinuousStates": (c_int, [_COMPONENT, POINTER(c_double), _SIZE]),
    "fmi2GetNominalsOfContinuousStates": (c_int, [_COMPONENT, POINTER(c_double), _SIZE]),
}
"""Those that only Model Exchange has."""

OF_CO_SIMULATION: Functions = {
    "fmi2SetRealInputDerivatives": (
        c_int,
        [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_int), POINTER(c_double)],
    ),
    "fmi2GetRealOutputDerivatives": (
        c_int,
        [_COMPONENT, _REFERENCES, _SIZE, POINTER(c_int), POINTER(c_double)],
    ),
    "fmi2DoStep": (c_int, [_COMPONENT, c_double, c_double, c_int]),
    "fmi2CancelStep": (c_int, [_COMPONENT]),
    "fmi2GetStatus": (c_int, [_COMPONENT, c_int, POINTER(c_int)]),
    "fmi2GetRealStatus": (c_int, [_COMPONENT, c_int, POINTER(c_double)]),
    "fmi2GetIntegerStatus": (c_int, [_COMPONENT, c_int, POINTER(c_int)]),
    "fmi2GetBooleanStatus": (c_int, [_COMPONENT, c_int, POINTER(c_int)]),
    "fmi2GetStringStatus": (c_int, [_COMPONENT, c_int, POINTER(c_char_p)]),
}
"""Those that only co-simulation has."""

FUNCTIONS: Functions = {**COMMON, **OF_MODEL_EXCHANGE, **OF_CO_SIMULATION}


class Fmu:
    """An extracted FMU."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.path = path
        self.description = read_model_description(path)
        self.guid = self.description.guid
        simulation, exchange = self.description.coSimulation, self.description.modelExchange
        identifier = (simulation or exchange).modelIdentifier
        self.functions = {
            **COMMON,
            **(OF_MODEL_EXCHANGE if exchange else {}),
            **(OF_CO_SIMULATION if simulation else {}),
        }
        self.folder = Path(extract(path, folder))
        self.library = self.folder / "binaries" / platform / (identifier + sharedLibraryExtension)
        self.variables: dict[str, ScalarVariable] = {v.name: v for v in self.description.modelVariables}

    def references(self, *names: str) -> Any:
        """The value references of variables, as an array."""
        return references(*(self.variables[name].valueReference for name in names))

    def named(self, condition: Callable[[ScalarVariable], bool]) -> list[str]:
        """The names of the variables that a condition holds for."""
        return [name for name, variable in self.variables.items() if condition(variable)]


class Library:
    """A loaded library, its functions as attributes with the types of the standard."""

    def __init__(self, path: Path, functions: Functions = FUNCTIONS) -> None:
        self.path = path
        self.handle = CDLL(str(path))
        for name, (result, arguments) in functions.items():
            function = getattr(self.handle, name)
            function.restype, function.argtypes = result, arguments

    def __getattr__(self, name: str) -> Any:
        return getattr(self.handle, name)


def references(*values: int) -> Any:
    """An array of value references."""
    return (c_uint * len(values))(*values)


def reals(*values: float) -> Any:
    """An array of fmi2Real."""
    return (c_double * len(values))(*values)


def integers(*values: int) -> Any:
    """An array of fmi2Integer or fmi2Boolean."""
    return (c_int * len(values))(*values)


def strings(*values: bytes | None) -> Any:
    """An array of fmi2String."""
    return (c_char_p * len(values))(*values)


def buffer(data: bytes) -> Any:
    """Bytes, as C takes them."""
    return (c_char * len(data)).from_buffer_copy(data)


ARRAYS: dict[str, Callable[..., Any]] = {
    "Real": reals,
    "Integer": integers,
    "Boolean": integers,
    "String": strings,
}
EMPTY = {"Real": 0.0, "Integer": 0, "Boolean": 0, "String": None}


def c_type_of(variable: ScalarVariable) -> str:
    """The type in the names of the functions that get and set a variable: section 2.2.7 has enumerations
    go through those of Integer."""
    return "Integer" if variable.type == "Enumeration" else variable.type


def numbers_in(text: str) -> list[float]:
    """The numbers in a message, however they are written."""
    pattern = r"(?<![\w.])-?(?:\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|inf|NaN)(?![\w])"
    return [float(number) for number in re.findall(pattern, text)]


class Instance:
    """An instance, called function by function, and its messages.

    `messages` grows as the logger is called; `component` is None when there is no instance.
    """

    component = None

    def __init__(
        self,
        fmu: Fmu,
        library: Library,
        *,
        name: bytes | None = b"instance",
        guid: bytes | None = b"right",
        fmu_type: int = CO_SIMULATION,
        resource_location: bytes | None = None,
        environment: int | None = None,
        logging_on: bool = False,
    ) -> None:
        self.fmu, self.library, self.fmu_type = fmu, library, fmu_type
        self.messages: list[Message] = []
        self.names_and_environments: list[tuple[bytes, int | None]] = []
        self.callbacks = CallbackFunctions(LOGGER(self._log), None, None, None, environment)
        guid = fmu.guid.encode() if guid == b"right" else guid
        self.component = library.fmi2Instantiate(
            name, fmu_type, guid, resource_location, byref(self.callbacks), 0, int(logging_on)
        )

    def _log(
        self, environment: int | None, name: bytes, status: int, category: bytes, fmt: bytes, text: bytes
    ) -> None:
        self.names_and_environments.append((name, environment))
        # A message must be an argument, not the format.
        assert fmt == b"%s"
        self.messages.append(Message(status, category.decode(), text.decode()))

    def call(self, function: str, *arguments: Any) -> Status:
        """Calls a function on the instance."""
        return Status(getattr(self.library, function)(self.component, *arguments))

    def ok(self, function: str, *arguments: Any) -> None:
        """A call that must succeed."""
        status = self.call(function, *arguments)
        assert status == Status.OK, f"{function} returns {status.name}: {self.messages}"

    def refuses(
        self, function: str, *arguments: Any, names: Iterable[str] = (), numbers: Iterable[float] = ()
    ) -> str:
        """A call is an Error with exactly one message, which has the function, the names and the numbers.
        Returns the message without the function."""
        before = len(self.messages)
        status = self.call(function, *arguments)
        messages = self.messages[before:]
        assert status == Status.ERROR, f"{function} returns {status.name}: {messages}"
        assert [(message.status, message.category) for message in messages] == [(3, "logStatusError")], (
            messages
        )
        text = messages[0].text
        assert text.startswith(f"{function}: "), text
        for name in names:
            assert re.search(rf"(?<![\w.]){re.escape(name)}(?!\w)", text), f"{name!r} is not in: {text}"
        named = numbers_in(text)
        for number in numbers:
            is_named = any(map(math.isnan, named)) if math.isnan(number) else number in named
            assert is_named, f"{number!r} is not in: {text}"
        return text.removeprefix(f"{function}: ")

    def set_up(self, start_time: float = 0.0, stop_time: float | None = None) -> None:
        """`fmi2SetupExperiment`."""
        defined = stop_time is not None
        self.ok("fmi2SetupExperiment", 0, 0.0, start_time, defined, stop_time or 0.0)

    def enter(self, start_time: float = 0.0, stop_time: float | None = None) -> None:
        """Brings a new instance into Initialization Mode."""
        self.set_up(start_time, stop_time)
        self.ok("fmi2EnterInitializationMode")

    def initialize(self, start_time: float = 0.0, stop_time: float | None = None) -> Instance:
        """Initializes a new instance."""
        self.enter(start_time, stop_time)
        self.ok("fmi2ExitInitializationMode")
        return self

    def settings(self, values: Mapping[str, Any]) -> tuple[str, Any, int, Any]:
        """The function that sets variables of one type, and its arguments."""
        (kind,) = {c_type_of(self.fmu.variables[name]) for name in values}
        return f"fmi2Set{kind}", self.fmu.references(*values), len(values), ARRAYS[kind](*values.values())

    def getting(self, *names: str) -> tuple[str, Any, int, Any]:
        """The function that gets variables of one type, and its arguments."""
        (kind,) = {c_type_of(self.fmu.variables[name]) for name in names}
        values = ARRAYS[kind](*[EMPTY[kind]] * len(names))
        return f"fmi2Get{kind}", self.fmu.references(*names), len(names), values

    def set(self, values: Mapping[str, Any]) -> Status:
        """Sets variables; returns the worst status."""
        by_kind: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            by_kind.setdefault(c_type_of(self.fmu.variables[name]), {})[name] = value
        return max((self.call(*self.settings(of_kind)) for of_kind in by_kind.values()), default=Status.OK)

    def choose(self, **items: str) -> Instance:
        """Sets the enumerations of a component, `component__variable="item"`."""
        for name, chosen in items.items():
            name = name.replace("__", ".")
            declared = self.fmu.variables[name].declaredType.items
            value = next(int(item.value) for item in declared if item.name == chosen)
            assert self.set({name: value}) == Status.OK
        return self

    def get(self, name: str) -> Any:
        """The value of a variable, which must be readable."""
        function, vr, count, values = self.getting(name)
        self.ok(function, vr, count, values)
        return values[0]

    def outputs(self) -> list[Any]:
        """The values of all outputs."""
        return [self.get(name) for name in self.fmu.named(lambda v: v.causality == "output")]

    def set_derivative(self, name: str, order: int, value: float) -> Status:
        """`fmi2SetRealInputDerivatives` of one input."""
        arguments = (self.fmu.references(name), 1, integers(order), reals(value))
        return self.call("fmi2SetRealInputDerivatives", *arguments)

    def step(self, time: float, size: float) -> Status:
        """`fmi2DoStep`."""
        return self.call("fmi2DoStep", time, size, 1)

    def run(self, steps: int, size: float = STEP) -> list[Any]:
        """Steps from 0; the outputs."""
        for index in range(steps):
            assert self.step(index * size, size) == Status.OK
        return self.outputs()

    def vector(self, quantity: str) -> list[float]:
        """What Model Exchange has an array of, such as `Derivatives`."""
        count = len(self.fmu.description.derivatives)
        if quantity == "EventIndicators":
            count = self.fmu.description.numberOfEventIndicators
        values = reals(*[math.nan] * count)
        self.ok(f"fmi2Get{quantity}", values, count)
        assert all(map(math.isfinite, values)), f"{quantity}: {list(values)}"
        return list(values)

    def set_states(self, *states: float) -> None:
        """`fmi2SetContinuousStates`."""
        self.ok("fmi2SetContinuousStates", reals(*states), len(states))

    def new_discrete_states(self) -> EventInfo:
        """`fmi2NewDiscreteStates`."""
        info = EventInfo(*[7] * 5, math.nan)
        self.ok("fmi2NewDiscreteStates", byref(info))
        for name, kind in EventInfo._fields_:
            assert kind is c_double or getattr(info, name) in (0, 1), name
        assert info.nominals_of_continuous_states_changed == 0
        assert not info.next_event_time_defined or math.isfinite(info.next_event_time)
        return info

    def save(self) -> c_void_p:
        """`fmi2GetFMUstate` into a new state."""
        state = c_void_p()
        self.ok("fmi2GetFMUstate", byref(state))
        return state

    def serialize(self, state: c_void_p) -> bytes:
        """The bytes of a saved state."""
        size = c_size_t()
        self.ok("fmi2SerializedFMUstateSize", state, byref(size))
        room = (c_char * size.value)()
        self.ok("fmi2SerializeFMUstate", state, room, size)
        return bytes(room)

    def snapshot(self) -> bytes:
        """The bytes of the present state."""
        state = self.save()
        data = self.serialize(state)
        self.ok("fmi2FreeFMUstate", byref(state))
        return data

    def restore(self, data: bytes) -> None:
        """Continues from a serialized state."""
        state = c_void_p()
        self.ok("fmi2DeSerializeFMUstate", buffer(data), len(data), byref(state))
        self.ok("fmi2SetFMUstate", state)
        self.ok("fmi2FreeFMUstate", byref(state))
        assert state.value is None

    def free(self) -> None:
        """Frees the instance, once."""
        if self.component:
            self.library.fmi2FreeInstance(self.component)
            self.component = None
