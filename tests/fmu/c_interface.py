"""An exported library's functions as the standard declares them in C, with nothing in between.

An importer such as FMPy guards its callers; what it would never pass on (null pointers, calls out of order,
numbers that are none) is passed here.
"""

from __future__ import annotations

from collections.abc import Iterable
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
from typing import Any

from fmpy import platform as fmi_platform
from fmpy import sharedLibraryExtension
from master import Fmu, Message

CO_SIMULATION = 1
"""`fmi2Type`."""


class Status(IntEnum):
    """`fmi2Status`."""

    OK = 0
    WARNING = 1
    DISCARD = 2
    ERROR = 3
    FATAL = 4
    PENDING = 5


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


_COMPONENT = c_void_p
_REFERENCES = POINTER(c_uint)
_SIZE = c_size_t

FUNCTIONS: dict[str, tuple[Any, list[Any]]] = {
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
"""Each function's result and arguments, in the order of the standard (fmi2FunctionTypes.h)."""


def library_path(fmu: Fmu) -> Path:
    """The library in an extracted FMU for the platform that this runs on."""
    identifier = fmu.description.coSimulation.modelIdentifier
    return Path(fmu.folder) / "binaries" / fmi_platform / (identifier + sharedLibraryExtension)


class Library:
    """A loaded library, its functions as attributes with the types of the standard."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.handle = CDLL(str(path))
        for name, (result, arguments) in FUNCTIONS.items():
            function = getattr(self.handle, name)
            function.restype, function.argtypes = result, arguments

    def __getattr__(self, name: str) -> Any:
        return getattr(self.handle, name)


class Caller:
    """One instance, called function by function, and what it logged.

    `messages` grows as the logger is called; `component` is None when there is no instance.
    """

    def __init__(
        self,
        library: Library,
        guid: str | bytes | None,
        name: bytes | None = b"caller",
        *,
        fmu_type: int = CO_SIMULATION,
        resource_location: bytes | None = None,
        environment: int | None = None,
        logging_on: bool = False,
    ) -> None:
        self.library = library
        self.messages: list[Message] = []
        self.names_and_environments: list[tuple[bytes, int | None]] = []
        self.callbacks = CallbackFunctions(LOGGER(self._log), None, None, None, environment)
        guid = guid.encode() if isinstance(guid, str) else guid
        self.component = library.fmi2Instantiate(
            name, fmu_type, guid, resource_location, byref(self.callbacks), 0, int(logging_on)
        )

    def _log(
        self, environment: int | None, name: bytes, status: int, category: bytes, fmt: bytes, text: bytes
    ) -> None:
        self.names_and_environments.append((name, environment))
        # A message in the place of the format would be read as one.
        assert fmt == b"%s"
        self.messages.append(Message(status, category.decode(), text.decode()))

    def call(self, function: str, *arguments: Any) -> Status:
        """Calls a function of the standard with this instance."""
        return Status(getattr(self.library, function)(self.component, *arguments))

    def errors_of(self, function: str, *arguments: Any) -> list[str]:
        """Calls a function that must answer Error; the messages that it gave."""
        before = len(self.messages)
        status = self.call(function, *arguments)
        assert status == Status.ERROR, f"{function} answers {status.name}"
        return [message.text for message in self.messages[before:] if message.status == Status.ERROR]

    def initialize(self, start_time: float = 0.0, stop_time: float | None = None) -> Caller:
        """Brings a fresh instance to where it can be stepped."""
        defined = stop_time is not None
        assert self.call("fmi2SetupExperiment", 0, 0.0, start_time, defined, stop_time or 0.0) == Status.OK
        assert self.call("fmi2EnterInitializationMode") == Status.OK
        assert self.call("fmi2ExitInitializationMode") == Status.OK
        return self

    def set_reals(self, references: Iterable[int], values: Iterable[float]) -> Status:
        """`fmi2SetReal`."""
        references, values = list(references), list(values)
        count = len(references)
        return self.call("fmi2SetReal", (c_uint * count)(*references), count, (c_double * count)(*values))

    def get_reals(self, references: Iterable[int]) -> list[float]:
        """`fmi2GetReal`, which must succeed."""
        references = list(references)
        count = len(references)
        values = (c_double * count)()
        assert self.call("fmi2GetReal", (c_uint * count)(*references), count, values) == Status.OK
        return list(values)

    def step(self, time: float, size: float) -> Status:
        """`fmi2DoStep`."""
        return self.call("fmi2DoStep", time, size, 1)

    def save(self) -> c_void_p:
        """`fmi2GetFMUstate` into a new state."""
        state = c_void_p()
        assert self.call("fmi2GetFMUstate", byref(state)) == Status.OK
        return state

    def serialize(self, state: c_void_p) -> bytes:
        """The bytes of a saved state."""
        size = c_size_t()
        assert self.call("fmi2SerializedFMUstateSize", state, byref(size)) == Status.OK
        buffer = (c_char * size.value)()
        assert self.call("fmi2SerializeFMUstate", state, buffer, size) == Status.OK
        return bytes(buffer)

    def free(self) -> None:
        """Frees the instance, once."""
        if self.component:
            self.library.fmi2FreeInstance(self.component)
            self.component = None
