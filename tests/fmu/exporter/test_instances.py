"""Unusual arguments of fmi2Instantiate, and unusual importers: nothing crashes.

Each case was seen in some importer, or is possible (FMI 2.0.5, section 2.1.5).
"""

from __future__ import annotations

import itertools
import mmap
import subprocess
from collections.abc import Callable
from ctypes import POINTER, addressof, byref, c_char, c_char_p, cast
from math import nan

import pytest
from fmpy.fmi2 import fmi2CoSimulation, fmi2ModelExchange

from fmu.exporter.importer import (
    COMMON,
    DECLARED,
    OF_CO_SIMULATION,
    OF_MODEL_EXCHANGE,
    STEP,
    CallbackFunctions,
    Instance,
    Library,
    Status,
    strings,
)
from fmu.master import Fmu

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

LONG = 65536

Make = Callable[..., Instance]


def refused(instance: Instance) -> str:
    """The message when no instance was made."""
    assert instance.component is None
    assert [(m.status, m.category) for m in instance.messages] == [(Status.ERROR, "logStatusError")]
    return instance.messages[0].text


def provoke(instance: Instance) -> list[str]:
    """The messages of two errors."""
    setting = instance.settings({"rate": nan})
    return [
        instance.refuses(*setting, names=["rate"]),
        instance.refuses("fmi2DoStep", 0.0, -STEP, 1, names=["communicationStepSize"]),
    ]


def instead(instance: Instance, *arguments: object) -> Instance:
    """Replaces the component by one that was made with these arguments of fmi2Instantiate."""
    instance.free()
    instance.component = instance.library.fmi2Instantiate(*arguments)
    assert instance.component is not None
    return instance


# What fmi2Instantiate refuses.


@pytest.mark.parametrize("blank", [None, b"", b" ", b" \t\r\n\v\f"])
def test_an_instance_without_a_name_is_refused(make: Make, blank: bytes | None) -> None:
    instance = make(name=blank, environment=77)
    assert "instanceName" in refused(instance)
    # The logger always gets a string as the name.
    assert instance.names_and_environments == [(blank or b"", 77)]


WRONG_GUIDS = {
    "null": lambda guid: None,
    "empty": lambda guid: b"",
    "zero": lambda guid: b"{00000000-0000-0000-0000-000000000000}",
    "not UTF-8": lambda guid: b"\xff\xfe{",
    "a format": lambda guid: b"%s%n%d#r1#",
    "long": lambda guid: b"{" * LONG,
    "in capitals": lambda guid: guid.upper().encode(),
    "with a space": lambda guid: guid.encode() + b" ",
}


@pytest.mark.parametrize("which", WRONG_GUIDS)
def test_a_wrong_guid_is_refused(make: Make, fmu: Fmu, which: str) -> None:
    instance = make(guid=WRONG_GUIDS[which](fmu.guid), name=b"an instance", environment=77)
    text = refused(instance)
    if which == "null":
        assert "fmuGUID is NULL" in text
    else:
        # Both, so that the user sees which files do not match.
        assert fmu.guid in text
        assert "TestModel" in text
    if which == "a format":
        # In a message `#` is doubled.
        assert "%s%n%d##r1##" in text
    assert instance.names_and_environments == [(b"an instance", 77)]


@pytest.mark.parametrize("fmu_type", [2, -1, 2**31 - 1, -(2**31)])
def test_what_is_not_a_type_is_refused(make: Make, fmu_type: int) -> None:
    text = refused(make(fmu_type=fmu_type))
    assert "fmuType" in text
    assert str(fmu_type) in text


@pytest.mark.parametrize(
    ("interfaces", "functions", "counted"),
    [
        ("cs", COMMON + OF_CO_SIMULATION, 34),
        ("me", COMMON + OF_MODEL_EXCHANGE, 35),
        ("cs,me", [*DECLARED[2]], 44),
    ],
)
def test_the_functions_of_the_interfaces_are_exported(
    exported: Callable[[str], Fmu], interfaces: str, functions: list[str], counted: int
) -> None:
    """Those of the declared ones, and no other global symbol."""
    fmu = exported(interfaces)
    command = ["nm", "-D", "--defined-only", str(fmu.library)]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    symbols = [line.split()[-1] for line in listed.splitlines()]
    assert sorted(symbols) == sorted(functions)
    assert len(symbols) == counted
    assert (fmu.description.coSimulation is not None) == ("cs" in interfaces)
    assert (fmu.description.modelExchange is not None) == ("me" in interfaces)
    assert (fmu.description.numberOfEventIndicators or 0) == (3 if "me" in interfaces else 0)


@pytest.mark.parametrize(
    ("interfaces", "missing", "names"),
    [
        ("cs", fmi2ModelExchange, "this FMU is for Co-Simulation, not for Model Exchange"),
        ("me", fmi2CoSimulation, "this FMU is for Model Exchange, not for Co-Simulation"),
    ],
)
def test_an_interface_that_is_not_there_is_refused(
    exported: Callable[[str], Fmu], interfaces: str, missing: int, names: str
) -> None:
    fmu = exported(interfaces)
    library = Library(fmu.library)
    assert names in refused(Instance(fmu, library, fmu_type=missing))
    instance = Instance(fmu, library, fmu_type=1 - missing)
    instance.initialize()
    instance.free()
    assert instance.messages == []


def test_what_is_asked_without_an_instance(library: Library) -> None:
    """Section 2.1.4."""
    assert (library.fmi2GetTypesPlatform(), library.fmi2GetVersion()) == (b"default", b"2.0")


def test_no_instance_without_callbacks(fmu: Fmu, library: Library) -> None:
    """The struct is required (section 2.1.5). Without a logger, the only result is NULL."""
    guid = fmu.guid.encode()
    for name, this_guid in itertools.product([b"name", None], [guid, None, b"wrong"]):
        assert library.fmi2Instantiate(name, fmi2CoSimulation, this_guid, None, None, 0, 1) is None


def test_refusals_without_a_logger(fmu: Fmu, library: Library) -> None:
    """Each of the refusals above, with `logger` NULL."""
    callbacks = CallbackFunctions()
    right, wrong = (b"name", fmi2CoSimulation, fmu.guid.encode()), (None, 2, None)
    for choice in itertools.product([False, True], repeat=3):
        arguments = [w if is_wrong else r for r, w, is_wrong in zip(right, wrong, choice, strict=True)]
        component = library.fmi2Instantiate(*arguments, None, byref(callbacks), 0, 1)
        assert (component is None) == any(choice)
        library.fmi2FreeInstance(component)


# What it takes.


@pytest.mark.parametrize("visible", [0, 1, -5])
@pytest.mark.parametrize("memory_functions", [False, True])
def test_without_a_logger(make: Make, visible: int, memory_functions: bool) -> None:
    """With `logger`, `stepFinished` and `componentEnvironment` NULL. `allocateMemory` and `freeMemory` may be
    anything, since `canNotUseMemoryManagementFunctions` is true: here, invalid addresses."""
    expected = make().initialize().run(4)
    callbacks = CallbackFunctions()
    if memory_functions:
        callbacks.allocate_memory, callbacks.free_memory = 8, 8
    instance = make()
    guid = instance.fmu.guid.encode()
    instead(instance, b"silent", fmi2CoSimulation, guid, None, byref(callbacks), visible, 1)
    assert instance.initialize().run(4) == expected
    assert instance.step(0.0, nan) == Status.ERROR
    assert instance.set({"rate": -11.0}) == Status.WARNING
    assert instance.call("fmi2Reset") == Status.OK
    assert instance.initialize().run(4) == expected
    assert instance.messages == []


NAMES = [
    b"a",
    b" with spaces  before, between and after ",
    b"100%",
    b"%s%n%d%s%s%s%p%1$s",
    b"#r1# ## #",
    "Motor-Prüfstand Nr. 3, 増圧機 🚗".encode(),
    b"\xff\xfe\x80 latin \xe4\xf6\xfc",
    b"\t\n leads with white space",
    bytes(range(1, 256)),
    b"C:\\Users\\A B\\FMUs\\plant.fmu",
    b"/home/a b/fmus/plant.fmu/",
    b"x" * LONG,
]


@pytest.mark.parametrize("name", NAMES, ids=lambda text: ascii(text)[2:22])
def test_the_name_is_passed_back_byte_for_byte(make: Make, name: bytes) -> None:
    """With the environment; it is never used as a format."""
    for environment in [None, 1, 2**64 - 1]:
        instance = make(name=name, environment=environment).initialize()
        assert provoke(instance) == provoke(make().initialize())
        assert instance.names_and_environments == [(name, environment)] * 2


LOCATIONS = [
    None,
    b"",
    b"file:///C:/Users/A%20B/fmu/resources",
    b"file:///tmp/%zz%/%",
    b"file:///tmp/%s%n%d#resources",
    b"file:///tmp/\xff\xfe/resources",
    b"C:\\fmu\\resources",
    b"file:///tmp/" + b"x" * LONG,
]


def test_resources_may_be_anywhere(make: Make) -> None:
    """The model needs none, so it runs with any location."""
    expected = make().initialize().run(4)
    for location in LOCATIONS:
        instance = make(resource_location=location)
        assert instance.initialize().run(4) == expected, location
        assert instance.messages == []


class Page:
    """Memory for arguments, which can be removed."""

    def __init__(self) -> None:
        self.memory = mmap.mmap(-1, 2 * mmap.PAGESIZE)
        self.address = addressof(c_char.from_buffer(self.memory))
        self.used = 0

    def put(self, content: bytes) -> int:
        """Copies bytes here; returns their address."""
        begin, end = self.used, self.used + len(content)
        self.memory[begin:end] = content
        self.used = (end + 15) // 16 * 16
        return self.address + begin

    def string(self, text: bytes) -> c_char_p:
        """Copies a string here."""
        return c_char_p(self.put(text + b"\0"))


@pytest.mark.parametrize("removed", [False, True], ids=["overwritten", "removed"])
def test_arguments_are_copied(make: Make, removed: bool) -> None:
    """The arguments of fmi2Instantiate are valid during the call only (section 2.1.5): the struct and the
    strings. The logger is still called with the struct's environment and the name."""
    instance = make()
    page = Page()
    callbacks = CallbackFunctions(instance.callbacks.logger, None, None, None, 0xC0FFEE)
    struct = page.put(bytes(callbacks))
    instead(
        instance,
        page.string(b"gone afterwards"),
        fmi2CoSimulation,
        page.string(instance.fmu.guid.encode()),
        page.string(b"file:///tmp/resources"),
        cast(struct, POINTER(CallbackFunctions)),
        0,
        1,
    )
    page.memory[:] = b"\xa5" * len(page.memory)
    if removed:
        page.memory.close()
    provoke(instance.initialize())
    assert instance.step(0.0, STEP) == Status.OK
    assert instance.call("fmi2Reset") == Status.OK
    provoke(instance.initialize())
    # Twice an event and two errors.
    assert instance.names_and_environments == [(b"gone afterwards", 0xC0FFEE)] * 6


def test_category_names_are_copied(make: Make) -> None:
    """The importer may reuse the strings of fmi2SetDebugLogging as well."""
    instance = make()
    page = Page()
    instance.ok("fmi2SetDebugLogging", 1, 1, (c_char_p * 1)(page.string(b"logEvents")))
    page.memory.close()
    instance.initialize().run(4)
    instance.refuses("fmi2DoStep", 0.0, -STEP, 1)


# What is logged.

ALWAYS = ["logStatusError", "logStatusWarning"]
EVERYTHING = ["logEvents", *ALWAYS]


def set_logging(instance: Instance, on: int, *categories: bytes | None) -> None:
    """`fmi2SetDebugLogging`."""
    instance.ok("fmi2SetDebugLogging", on, len(categories), strings(*categories))


def categories_of_a_run(instance: Instance) -> list[str]:
    """The categories of the messages of a run with an event, a warning and an error."""
    assert instance.call("fmi2Reset") == Status.OK
    before = len(instance.messages)
    instance.initialize()
    assert instance.set({"rate": -11.0}) == Status.WARNING
    assert instance.step(0.0, STEP) == Status.OK
    assert instance.step(0.0, -STEP) == Status.ERROR
    return sorted({message.category for message in instance.messages[before:]})


def test_errors_and_warnings_are_always_logged(make: Make, fmu: Fmu) -> None:
    """Events only if debug logging is on for them."""
    assert sorted(category.name for category in fmu.description.logCategories) == EVERYTHING
    on, off = make(logging_on=True), make(logging_on=False)
    assert categories_of_a_run(on) == EVERYTHING
    assert categories_of_a_run(off) == ALWAYS
    for instance in (on, off):
        for arguments, logged in [
            # Without a named category, all are switched.
            ([False], ALWAYS),
            ([True], EVERYTHING),
            # Others do not change.
            ([False, b"logStatusError", b"logStatusWarning"], EVERYTHING),
            ([False, b"logEvents"], ALWAYS),
            ([True, b"logEvents", b"logStatusError", b"logEvents"], EVERYTHING),
        ]:
            set_logging(instance, *arguments)
            assert categories_of_a_run(instance) == logged, arguments
    assert {(m.category, m.status) for m in on.messages} == {
        ("logEvents", Status.OK),
        ("logStatusWarning", Status.WARNING),
        ("logStatusError", Status.ERROR),
    }


def test_every_number_but_zero_is_true(make: Make) -> None:
    """fmi2Boolean is an int, and importers pass what their language calls true."""
    instance = make()
    for value in [1, -1, 2, 2**31 - 1, -(2**31), 0]:
        set_logging(instance, value)
        assert categories_of_a_run(instance) == (EVERYTHING if value else ALWAYS)


UNKNOWN = {
    b"logNothing": "logNothing",
    b"logEvent": "logEvent",
    b"LOGEVENTS": "LOGEVENTS",
    b"": '""',
    b"%s%n#r1#": "%s%n##r1##",
    b"x" * LONG: "x" * LONG,
    b"\xff": "\\xff",
    b"two\nlines\n": "two\\nlines\\n",
}
"""Undeclared categories, and their names in the message."""


@pytest.mark.parametrize("category", UNKNOWN, ids=lambda text: ascii(text)[2:22])
def test_an_unknown_category_is_named(make: Make, category: bytes) -> None:
    """Section 2.1.5: the categories are those of the XML. A valid one before it is not switched on either."""
    instance = make()
    text = instance.refuses("fmi2SetDebugLogging", 1, 2, strings(b"logEvents", category))
    assert UNKNOWN[category] in text
    assert not text.endswith("\n")
    assert categories_of_a_run(instance) == ALWAYS


def test_categories_that_are_null(make: Make) -> None:
    instance = make()
    # "If nCategories == 0, the value of categories is undefined": NULL, or anything.
    instance.ok("fmi2SetDebugLogging", 1, 0, None)
    instance.ok("fmi2SetDebugLogging", 1, 0, cast(8, POINTER(c_char_p)))
    assert instance.messages == []
    for count, categories in [(1, None), (1, strings(None)), (2, strings(b"logEvents", None))]:
        assert "categories is NULL" in instance.refuses("fmi2SetDebugLogging", 1, count, categories)


# Several instances.


def test_instances_of_equal_names(make: Make) -> None:
    """In one process: each logs to its environment, and freeing one does not affect another."""
    instances = [make(name=b"the same", environment=number).initialize() for number in range(1, 5)]
    for instance in reversed(instances):
        provoke(instance)
    for number, instance in enumerate(instances, start=1):
        assert instance.names_and_environments == [(b"the same", number)] * 2
    instances[0].free()
    assert instances[2].step(0.0, STEP) == Status.OK


class Curious(Instance):
    """An importer whose logger looks at the instance that is logging."""

    def __init__(self, *arguments, **named) -> None:
        self.looks: list[Status] = []
        super().__init__(*arguments, **named)

    def _log(self, *arguments) -> None:
        super()._log(*arguments)
        self.looks.append(self.call(*self.getting("output", "tank.level")))


def test_a_logger_that_calls_back(make: Make) -> None:
    """Section 2.1.5 allows loggers to use their fmi2Component without restriction. (In a step, in the state
    stepInProgress of section 4.2.4, no values can be read.) Reading values changes nothing."""

    def run(instance: Instance) -> list[list]:
        # Not used by the initialization, which warns.
        assert instance.set({"motion.position": 0.5}) == Status.OK
        instance.enter()
        assert instance.call("fmi2ExitInitializationMode") == Status.WARNING
        results = []
        for index in range(8):
            # Out of its range and back, with a warning each time that it leaves.
            warned = Status.WARNING if index % 2 else Status.OK
            assert instance.set({"rate": -11.0 if index % 2 else 1.0}) == warned
            assert instance.step(index * STEP, STEP) == Status.OK
            results.append(instance.outputs())
            assert instance.step(index * STEP, nan) == Status.ERROR
            assert instance.set({"rate": nan}) == Status.ERROR
        return results

    plain, curious = make(logging_on=True), make(Curious, logging_on=True)
    assert run(curious) == run(plain)
    assert curious.messages == plain.messages
    assert len(curious.looks) == len(plain.messages) >= 20
    assert set(curious.looks) == {Status.OK}


class Meddling(Instance):
    """An importer whose logger, at the first message, does something with the instance that is logging."""

    def __init__(self, *arguments, deed: str, **named) -> None:
        self.deed: str | None = deed
        super().__init__(*arguments, **named)

    def _log(self, *arguments) -> None:
        super()._log(*arguments)
        deed, self.deed = self.deed, None
        if deed:
            DEEDS[deed](self)


def reset(instance: Instance) -> None:
    """Resets and initializes."""
    instance.ok("fmi2Reset")
    instance.initialize()


DEEDS: dict[str, Callable[[Instance], None]] = {
    "free": Instance.free,
    "step": lambda instance: instance.ok("fmi2DoStep", STEP, STEP, 1),
    "reset": reset,
}


@pytest.mark.parametrize("deed", DEEDS)
def test_a_logger_that_meddles(make: Make, deed: str) -> None:
    """The logger runs after the call that logs: its own calls come after it."""
    meddling, orderly = make(Meddling, deed=deed), make()
    for instance in (meddling, orderly):
        instance.initialize()
        assert instance.step(0.0, STEP) == Status.OK
        instance.refuses("fmi2DoStep", STEP, nan, 1, names=["communicationStepSize"])
    assert meddling.deed is None
    if deed == "free":
        assert meddling.component is None
        return
    DEEDS[deed](orderly)
    assert meddling.snapshot() == orderly.snapshot()
