"""The functions of FMI 3.0 as the standard's own header declares them, called through ctypes.

FMPy brings the header; its importer checks arguments and raises where a library returns an error, so it is
not used here.
"""

from __future__ import annotations

import re
from ctypes import (
    CDLL,
    CFUNCTYPE,
    POINTER,
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int8,
    c_int16,
    c_int32,
    c_int64,
    c_size_t,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
    create_string_buffer,
)
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import fmpy

HEADER = Path(fmpy.__file__).parent / "c-code" / "fmi3FunctionTypes.h"

MODEL_EXCHANGE, CO_SIMULATION = "ModelExchange", "CoSimulation"
EVENT_MODE = "CoSimulation with Event Mode"
SCHEDULED_EXECUTION = "ScheduledExecution"


class Status(IntEnum):
    """`fmi3Status`."""

    OK = 0
    WARNING = 1
    DISCARD = 2
    ERROR = 3
    FATAL = 4


class Message(NamedTuple):
    """A logged message."""

    status: int
    category: str
    text: str


class Parameter(NamedTuple):
    """A parameter of a function, as the header declares it."""

    type: Any
    name: str
    is_pointer: bool


LOGGER = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
"""`fmi3LogMessageCallback`."""

INTERMEDIATE_UPDATE = CFUNCTYPE(
    None, c_void_p, c_double, c_bool, c_bool, c_bool, c_bool, POINTER(c_bool), POINTER(c_double)
)
"""`fmi3IntermediateUpdateCallback`."""

CLOCK_UPDATE = CFUNCTYPE(None, c_void_p)
"""`fmi3ClockUpdateCallback`."""

PREEMPTION = CFUNCTYPE(None)
"""`fmi3LockPreemptionCallback` and `fmi3UnlockPreemptionCallback`."""

TYPES = {
    "size_t": c_size_t,
    "fmi3Status": c_int,
    "fmi3Instance": c_void_p,
    "fmi3InstanceEnvironment": c_void_p,
    "fmi3FMUState": c_void_p,
    "fmi3ValueReference": c_uint32,
    "fmi3Float32": c_float,
    "fmi3Float64": c_double,
    "fmi3Int8": c_int8,
    "fmi3UInt8": c_uint8,
    "fmi3Int16": c_int16,
    "fmi3UInt16": c_uint16,
    "fmi3Int32": c_int32,
    "fmi3UInt32": c_uint32,
    "fmi3Int64": c_int64,
    "fmi3UInt64": c_uint64,
    "fmi3Boolean": c_bool,
    "fmi3Clock": c_bool,
    "fmi3Byte": c_uint8,
    "fmi3String": c_char_p,
    "fmi3Binary": c_void_p,
    "fmi3DependencyKind": c_int,
    "fmi3IntervalQualifier": c_int,
    "fmi3LogMessageCallback": LOGGER,
    "fmi3IntermediateUpdateCallback": INTERMEDIATE_UPDATE,
    "fmi3ClockUpdateCallback": CLOCK_UPDATE,
    "fmi3LockPreemptionCallback": PREEMPTION,
    "fmi3UnlockPreemptionCallback": PREEMPTION,
}
"""fmi3PlatformTypes.h, and the callbacks."""


def declared() -> dict[str, tuple[Any, list[Parameter]]]:
    """The functions of the header: the type of the result and the parameters of each."""
    text = re.sub(r"/\*.*?\*/", "", HEADER.read_text(), flags=re.DOTALL)
    functions = {}
    for result, name, parameters in re.findall(
        r"typedef\s+([\w\s*]+?)\s*\bfmi3(\w+)TYPE\s*\(([^)]*)\)\s*;", text
    ):
        found = []
        for parameter in parameters.split(","):
            match = re.fullmatch(r"\s*(?:const\s+)?(\w+)\s*(\*?)\s*(\w*)(\[\])?\s*", parameter)
            if match and match[1] != "void":
                found.append(Parameter(TYPES[match[1]], match[3], bool(match[2] or match[4])))
        of_result = {"void": None, "const char*": c_char_p}
        functions[f"fmi3{name}"] = (of_result.get(result) if result in of_result else TYPES[result], found)
    return functions


DECLARED = declared()


class Library:
    """A library with its functions' types."""

    def __init__(self, path: Path) -> None:
        self.c = CDLL(str(path))
        for name, (result, parameters) in DECLARED.items():
            function = getattr(self.c, name)
            function.restype = result
            function.argtypes = [POINTER(type) if is_pointer else type for type, _, is_pointer in parameters]


class Instance:
    """An instance; what it logs is kept."""

    def __init__(self, library: Library, token: str, interface: str, **arguments: Any) -> None:
        self.library = library
        if interface == EVENT_MODE:
            interface, arguments = CO_SIMULATION, {"eventModeUsed": True} | arguments
        self.messages: list[Message] = []

        def log(_environment: int, status: int, category: bytes, text: bytes) -> None:
            self.messages.append(Message(status, category.decode(), text.decode()))

        self._logger = LOGGER(log)
        values = {
            "instanceName": b"instance",
            "instantiationToken": token.encode(),
            "logMessage": self._logger,
        } | arguments
        name = f"fmi3Instantiate{interface}"
        self.address = getattr(library.c, name)(*self.arguments(name, **values))

    def arguments(self, function: str, **values: Any) -> list[Any]:
        """A value for each parameter after the instance: a given one, otherwise 0, memory for pointers."""
        arguments = []
        for type, name, is_pointer in DECLARED[function][1]:
            if name == "instance":
                continue
            if name in values:
                arguments.append(values[name])
            elif is_pointer:
                arguments.append((type * 16)())
            else:
                arguments.append(type())
        return arguments

    def call(self, function: str, *arguments: Any) -> Status:
        """Calls a function with this instance."""
        return Status(getattr(self.library.c, function)(self.address, *arguments))

    def ok(self, function: str, **values: Any) -> list[Any]:
        """Calls a function that must succeed, and returns its arguments."""
        arguments = self.arguments(function, **values)
        status = self.call(function, *arguments)
        assert status == Status.OK, f"{function}: {status.name}, {self.messages}"
        return arguments

    def initialize(self, start_time: float = 0.0) -> None:
        """Up to the end of initialization."""
        self.ok("fmi3EnterInitializationMode", startTime=start_time)
        self.ok("fmi3ExitInitializationMode")

    def get(self, kind: str, references: list[int], size: int | None = None) -> list[Any]:
        """The values of variables, in all of `size` elements."""
        size = len(references) if size is None else size
        values = (TYPES[f"fmi3{kind}"] * size)()
        array = (c_uint32 * len(references))(*references)
        status = self.call(f"fmi3Get{kind}", array, len(references), values, size)
        assert status == Status.OK, self.messages
        return list(values)

    def set(self, kind: str, references: list[int], values: list[Any]) -> Status:
        """Sets variables."""
        array = (c_uint32 * len(references))(*references)
        return self.call(
            f"fmi3Set{kind}",
            array,
            len(references),
            (TYPES[f"fmi3{kind}"] * len(values))(*values),
            len(values),
        )

    def step(self, time: float, size: float) -> tuple[Status, tuple[bool, bool, bool, float]]:
        """A step, with what it returns."""
        flags = [c_bool(True), c_bool(True), c_bool(True)]
        reached = c_double()
        status = self.call("fmi3DoStep", time, size, True, *map(byref, flags), byref(reached))
        return status, (*(flag.value for flag in flags), reached.value)

    def update(self) -> tuple[list[bool], float | None]:
        """`fmi3UpdateDiscreteStates`: the first four flags, and the next event's time if there is one."""
        flags = [c_bool(True) for _ in range(5)]
        next_time = c_double()
        assert self.call("fmi3UpdateDiscreteStates", *map(byref, flags), byref(next_time)) == Status.OK
        return [flag.value for flag in flags[:4]], next_time.value if flags[4] else None

    def state(self) -> c_void_p:
        """A saved state."""
        state = c_void_p()
        assert self.call("fmi3GetFMUState", byref(state)) == Status.OK
        return state

    def serialized(self, state: c_void_p) -> bytes:
        """A saved state as bytes."""
        size = c_size_t()
        assert self.call("fmi3SerializedFMUStateSize", state, byref(size)) == Status.OK
        data = create_string_buffer(size.value)
        target = (c_uint8 * size.value).from_buffer(data)
        assert self.call("fmi3SerializeFMUState", state, target, size) == Status.OK
        return data.raw

    def restore(self, content: bytes) -> None:
        """Goes on from a serialized state."""
        state = c_void_p()
        data = (c_uint8 * len(content)).from_buffer_copy(content)
        assert self.call("fmi3DeserializeFMUState", data, len(content), byref(state)) == Status.OK
        self.ok("fmi3SetFMUState", FMUState=state)
        self.ok("fmi3FreeFMUState", FMUState=byref(state))

    def free(self) -> None:
        """Frees the instance."""
        if self.address:
            self.library.c.fmi3FreeInstance(self.address)
            self.address = None
