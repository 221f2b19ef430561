"""What an importer hands over to fmi2Instantiate, and does around the calls: however odd, it crashes nothing.

What comes here was seen from some importer, or may be what its memory holds (FMI 2.0.5, section 2.1.5).
"""

from __future__ import annotations

import itertools
import mmap
from collections.abc import Callable, Iterator
from ctypes import (
    CDLL,
    POINTER,
    byref,
    c_char_p,
    c_double,
    c_int,
    c_long,
    c_size_t,
    c_uint,
    c_void_p,
    cast,
    memmove,
    memset,
)
from math import nan

import pytest
from c_interface import CO_SIMULATION, CallbackFunctions, Library, Status
from master import Fmu
from named import Named

STEP = 1 / 80
MODEL_EXCHANGE = 0
LONG = 65536


BOTH = pytest.mark.parametrize("name", ["BoostPlant", "BoostController"])


class Strange(Named):
    """An instance with whatever its host does."""

    def outputs(self) -> list[float]:
        """The outputs as they are."""
        return self.get_reals(self.output_references())

    def run(self) -> list[float]:
        """The outputs after a few steps from the default start."""
        self.initialize()
        for index in range(4):
            assert self.step(index * STEP, STEP) == Status.OK
        return self.outputs()

    def provoke(self) -> list[str]:
        """The messages of two errors."""
        before = len(self.messages)
        assert self.set_reals(self.references("engine_speed"), [nan]) == Status.ERROR
        assert self.step(0.0, -STEP) == Status.ERROR
        texts = [message.text for message in self.messages[before:]]
        assert len(texts) == 2
        assert "engine_speed" in texts[0]
        assert texts[1].startswith("fmi2DoStep: ")
        return texts

    def instead(self, *arguments: object) -> Strange:
        """Takes another instance in the place of this one, made with these arguments of fmi2Instantiate."""
        self.free()
        self.component = self.library.fmi2Instantiate(*arguments)
        assert self.component is not None
        return self


Make = Callable[..., Strange]


@pytest.fixture
def make(
    fmus: dict[str, Fmu], libraries: dict[str, Library], capfd: pytest.CaptureFixture[str]
) -> Iterator[Make]:
    """Makes instances of the FMU of a name, and frees them in the end. What they have to say goes through the
    logger, and nothing to the host's streams."""
    made: list[Strange] = []

    def make(fmu: str, kind: type[Strange] = Strange, **arguments) -> Strange:
        made.append(kind(libraries[fmu], fmus[fmu].description, **arguments))
        return made[-1]

    yield make
    for caller in made:
        caller.free()
    assert capfd.readouterr() == ("", "")


# What fmi2Instantiate refuses.

BLANK_NAMES = [None, b"", b" ", b" \t\r\n\v\f"]
WRONG_GUIDS = [
    None,
    b"",
    b"{00000000-0000-0000-0000-000000000000}",
    b"\xff\xfe{",
    b"%s%n%d#r1#",
    b"{" * LONG,
    "another FMU's",
    "in capitals",
    "with a space",
]


def guid_of(fmus: dict[str, Fmu], name: str, which: bytes | str | None) -> bytes | None:
    """A GUID that is almost the FMU's."""
    (other,) = set(fmus) - {name}
    right = fmus[name].description.guid
    almost = {
        "another FMU's": fmus[other].description.guid,
        "in capitals": right.upper(),
        "with a space": right + " ",
    }
    return almost[which].encode() if isinstance(which, str) else which


@BOTH
def test_instance_without_a_name_is_refused(make: Make, name: str) -> None:
    for blank in BLANK_NAMES:
        caller = make(name, name=blank, environment=77)
        assert caller.component is None
        assert [(m.status, m.category) for m in caller.messages] == [(Status.ERROR, "logStatusError")]
        assert "instanceName" in caller.messages[0].text
        # There may be no name to hand back, but there is always a string.
        assert caller.names_and_environments == [(blank or b"", 77)]


@BOTH
@pytest.mark.parametrize("which", WRONG_GUIDS, ids=lambda which: str(which)[:20])
def test_wrong_guid_is_refused(
    make: Make, fmus: dict[str, Fmu], name: str, which: bytes | str | None
) -> None:
    caller = make(name, guid=guid_of(fmus, name, which), name=b"an instance", environment=77)
    assert caller.component is None
    assert [(m.status, m.category) for m in caller.messages] == [(Status.ERROR, "logStatusError")]
    text = caller.messages[0].text
    if which is None:
        assert "fmuGUID is NULL" in text
    else:
        # Both, so that the user sees which files do not belong together.
        assert fmus[name].description.guid in text
        assert name in text
    if which == b"%s%n%d#r1#":
        # In a message `#` is doubled, and `%s` is none: it is no part of the format.
        assert "%s%n%d##r1##" in text
    assert caller.names_and_environments == [(b"an instance", 77)]


@BOTH
@pytest.mark.parametrize("fmu_type", [MODEL_EXCHANGE, 2, -1, 2**31 - 1])
def test_what_is_no_co_simulation_is_refused(make: Make, name: str, fmu_type: int) -> None:
    caller = make(name, fmu_type=fmu_type)
    assert caller.component is None
    assert [m.status for m in caller.messages] == [Status.ERROR]
    assert "co-simulation" in caller.messages[0].text


@BOTH
def test_no_callbacks_no_instance(fmus: dict[str, Fmu], libraries: dict[str, Library], name: str) -> None:
    """The struct must be there (section 2.1.5). With nowhere to send a message, NULL says it all."""
    guid = fmus[name].description.guid.encode()
    for instance_name, this_guid in itertools.product([b"name", None], [guid, None, b"wrong"]):
        component = libraries[name].fmi2Instantiate(instance_name, CO_SIMULATION, this_guid, None, None, 0, 1)
        assert component is None


@BOTH
def test_refused_without_a_logger(fmus: dict[str, Fmu], libraries: dict[str, Library], name: str) -> None:
    """Each of the refusals above, with `logger` NULL."""
    guid = fmus[name].description.guid.encode()
    callbacks = CallbackFunctions()
    right = (b"name", CO_SIMULATION, guid)
    wrong = (None, MODEL_EXCHANGE, None)
    for choice in itertools.product([False, True], repeat=3):
        arguments = [w if is_wrong else r for r, w, is_wrong in zip(right, wrong, choice, strict=True)]
        component = libraries[name].fmi2Instantiate(*arguments, None, byref(callbacks), 0, 1)
        assert (component is None) == any(choice)
        libraries[name].fmi2FreeInstance(component)


# What it takes.


@BOTH
@pytest.mark.parametrize("visible", [0, 1, -5])
@pytest.mark.parametrize("memory_functions", [False, True])
def test_without_a_logger(make: Make, name: str, visible: int, memory_functions: bool) -> None:
    """With `logger`, `stepFinished` and `componentEnvironment` NULL. `allocateMemory` and `freeMemory` may be
    anything, for `canNotUseMemoryManagementFunctions` is true: here, addresses where there is nothing."""
    expected = make(name).run()
    callbacks = CallbackFunctions()
    if memory_functions:
        callbacks.allocate_memory, callbacks.free_memory = 8, 8
    caller = make(name)
    guid = caller.description.guid.encode()
    caller.instead(b"silent", CO_SIMULATION, guid, None, byref(callbacks), visible, 1)
    assert caller.run() == expected
    assert caller.call("fmi2DoStep", 0.0, nan, 1) == Status.ERROR
    assert caller.set_reals(caller.references("engine_speed"), [-1.0]) == Status.WARNING
    assert caller.call("fmi2Reset") == Status.OK
    assert caller.run() == expected
    assert caller.messages == []


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


@BOTH
@pytest.mark.parametrize("instance_name", NAMES, ids=lambda text: ascii(text)[2:22])
def test_name_is_handed_back_byte_for_byte(make: Make, name: str, instance_name: bytes) -> None:
    """And with it the environment; in no message is it taken for a format."""
    for environment in [None, 1, 2**64 - 1]:
        caller = make(name, name=instance_name, environment=environment).initialize()
        expected = make(name).initialize()
        assert caller.provoke() == expected.provoke()
        assert caller.names_and_environments == [(instance_name, environment)] * 2


LOCATIONS = [
    None,
    b"",
    b"file:/tmp/fmu/resources",
    b"file:///tmp/fmu/resources",
    b"file:////tmp/fmu/resources/",
    b"file:///tmp/fmu/resources///",
    b"file://localhost/tmp/fmu/resources",
    b"file://server/share/fmu/resources",
    b"file:///C:/Users/A%20B/fmu/resources",
    b"file:///C:/Users/A B/100%/fmu/resources",
    b"file:///tmp/%zz%/%",
    b"file:///tmp/%s%n%d#resources",
    "file:///tmp/Prüfstand/増圧機/resources".encode(),
    b"file:///tmp/\xff\xfe/resources",
    b"FILE:///TMP",
    b"file:",
    b"C:\\fmu\\resources",
    b"resources",
    b"https://example.org/fmu/resources",
    b"fmi2://fmu/resources",
    b"file:///tmp/" + b"x" * LONG,
]


@BOTH
def test_resources_may_be_anywhere(make: Make, name: str) -> None:
    """The models need none, so no form of location keeps them from running."""
    expected = make(name).run()
    for location in LOCATIONS:
        caller = make(name, resource_location=location)
        assert caller.run() == expected, location
        assert caller.messages == []
        caller.free()


class Page:
    """Memory of its own that holds arguments, to be taken away."""

    def __init__(self, size: int) -> None:
        self.library = CDLL(None)
        self.library.mmap.restype = c_void_p
        self.library.mmap.argtypes = [c_void_p, c_size_t, c_int, c_int, c_int, c_long]
        self.library.munmap.argtypes = [c_void_p, c_size_t]
        access, kind = mmap.PROT_READ | mmap.PROT_WRITE, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
        self.size = size
        self.address = self.library.mmap(None, size, access, kind, -1, 0)
        self.used = 0

    def put(self, content: bytes) -> int:
        """Copies bytes here; their address."""
        address = self.address + self.used
        self.used += (len(content) + 15) // 16 * 16
        assert self.used <= self.size
        memmove(address, content, len(content))
        return address

    def string(self, text: bytes) -> c_char_p:
        """A string here."""
        return c_char_p(self.put(text + b"\0"))

    def overwrite(self) -> None:
        """Leaves nothing of what was here."""
        memset(self.address, 0xA5, self.size)

    def remove(self) -> None:
        """Whoever reads this memory now crashes."""
        assert self.library.munmap(self.address, self.size) == 0


@BOTH
@pytest.mark.parametrize("removed", [False, True], ids=["overwritten", "removed"])
def test_arguments_are_copied(make: Make, libraries: dict[str, Library], name: str, removed: bool) -> None:
    """All that fmi2Instantiate is passed is valid during the call only (section 2.1.5): the struct and the
    strings. What the struct held goes on: the logger is called with its environment and the name."""
    caller = make(name)
    page = Page(2 * mmap.PAGESIZE)
    callbacks = CallbackFunctions(caller.callbacks.logger, None, None, None, 0xC0FFEE)
    struct = page.put(bytes(callbacks))
    caller.instead(
        page.string(b"gone afterwards"),
        CO_SIMULATION,
        page.string(caller.description.guid.encode()),
        page.string(b"file:///tmp/resources"),
        cast(struct, POINTER(CallbackFunctions)),
        0,
        1,
    )
    page.overwrite()
    if removed:
        page.remove()
    caller.initialize()
    caller.provoke()
    assert caller.step(0.0, STEP) == Status.OK
    assert caller.call("fmi2Reset") == Status.OK
    caller.initialize()
    caller.provoke()
    assert set(caller.names_and_environments) == {(b"gone afterwards", 0xC0FFEE)}
    assert len(caller.messages) >= 4


@BOTH
def test_category_names_are_copied(make: Make, name: str) -> None:
    """The strings of fmi2SetDebugLogging, too, are the importer's to reuse."""
    caller = make(name)
    page = Page(mmap.PAGESIZE)
    names = (c_char_p * 1)(page.string(b"logEvents"))
    assert caller.call("fmi2SetDebugLogging", 1, 1, names) == Status.OK
    page.remove()
    caller.run()
    caller.provoke()


# What is logged.


def set_logging(caller: Strange, on: bool, categories: list[bytes | None]) -> Status:
    """`fmi2SetDebugLogging`."""
    count = len(categories)
    return caller.call("fmi2SetDebugLogging", int(on), count, (c_char_p * count)(*categories))


def categories_of_a_run(caller: Strange) -> list[str]:
    """The categories of the messages of a run with an event (the first measurement of boost), a warning (a
    speed below its range) and an error."""
    assert caller.call("fmi2Reset") == Status.OK
    before = len(caller.messages)
    caller.initialize()
    assert caller.set_reals(caller.references("engine_speed"), [-1.0]) == Status.WARNING
    assert caller.step(0.0, STEP) == Status.OK
    assert caller.step(0.0, -STEP) == Status.ERROR
    return sorted({message.category for message in caller.messages[before:]})


def test_errors_and_warnings_are_always_logged(make: Make) -> None:
    """Events only where debug logging is on for them."""
    always = ["logStatusError", "logStatusWarning"]
    everything = ["logEvents", *always]
    declared = [category.name for category in make("BoostController").description.logCategories]
    assert sorted(declared) == everything

    on, off = make("BoostController", logging_on=True), make("BoostController", logging_on=False)
    assert categories_of_a_run(on) == everything
    assert categories_of_a_run(off) == always
    for caller in (on, off):
        # As long as no category is named, all are meant.
        assert set_logging(caller, False, []) == Status.OK
        assert categories_of_a_run(caller) == always
        assert set_logging(caller, True, []) == Status.OK
        assert categories_of_a_run(caller) == everything
        # Those that are not named stay as they are.
        assert set_logging(caller, False, [b"logStatusError", b"logStatusWarning"]) == Status.OK
        assert categories_of_a_run(caller) == everything
        assert set_logging(caller, False, [b"logEvents"]) == Status.OK
        assert categories_of_a_run(caller) == always
        assert set_logging(caller, True, [b"logEvents", b"logStatusError", b"logEvents"]) == Status.OK
        assert categories_of_a_run(caller) == everything
    statuses = {(m.category, m.status) for m in on.messages}
    expected = {("logEvents", Status.OK), ("logStatusWarning", Status.WARNING)}
    assert statuses == expected | {("logStatusError", Status.ERROR)}


@BOTH
def test_truth_is_whatever_is_not_zero(make: Make, name: str) -> None:
    """fmi2Boolean is an int, and importers pass what their language calls true."""
    caller = make(name, logging_on=False)
    for value in [1, -1, 2, 2**31 - 1, -(2**31), 0]:
        assert caller.call("fmi2SetDebugLogging", value, 0, None) == Status.OK
        if name == "BoostController":
            assert ("logEvents" in categories_of_a_run(caller)) == (value != 0)


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
"""Categories that there are not, and how they are named in the message."""


@BOTH
@pytest.mark.parametrize("category", UNKNOWN, ids=lambda text: ascii(text)[2:22])
def test_unknown_category_is_named(make: Make, name: str, category: bytes) -> None:
    caller = make(name, logging_on=False)
    assert set_logging(caller, True, [b"logEvents", category]) == Status.ERROR
    assert [m.status for m in caller.messages] == [Status.ERROR]
    text = caller.messages[0].text
    assert text.startswith("fmi2SetDebugLogging: ")
    assert UNKNOWN[category] in text
    assert not text.endswith("\n")
    # Nothing of a call that is refused was done.
    assert "logEvents" not in categories_of_a_run(caller)


@BOTH
def test_categories_that_are_null(make: Make, name: str) -> None:
    caller = make(name)
    # "If nCategories == 0, the value of categories is undefined": NULL, or anything.
    assert caller.call("fmi2SetDebugLogging", 1, 0, None) == Status.OK
    anything = cast(8, POINTER(c_char_p))
    assert caller.call("fmi2SetDebugLogging", 1, 0, anything) == Status.OK
    assert caller.messages == []
    for refused in [(1, None), (1, (c_char_p * 1)(None)), (2, (c_char_p * 2)(b"logEvents", None))]:
        (text,) = caller.errors_of("fmi2SetDebugLogging", 1, *refused)
        assert "categories is NULL" in text


# Several instances.


def test_instances_of_equal_names(make: Make) -> None:
    """Of one FMU and of the other, in one process: each logs to its own environment."""
    callers = [
        make(name, name=b"the same", environment=environment)
        for environment, name in enumerate(["BoostPlant", "BoostController"] * 2, start=1)
    ]
    for caller in callers:
        caller.initialize()
    for caller in reversed(callers):
        caller.provoke()
    for environment, caller in enumerate(callers, start=1):
        assert caller.names_and_environments == [(b"the same", environment)] * 2
    # The one's end is not the other's.
    callers[0].free()
    assert callers[2].step(0.0, STEP) == Status.OK


class Curious(Strange):
    """An importer whose logger looks at the instance that is logging."""

    def __init__(self, *arguments, **named) -> None:
        self.looks: list[Status] = []
        super().__init__(*arguments, **named)

    def _log(self, *arguments) -> None:
        super()._log(*arguments)
        references = self.output_references()
        count = len(references)
        values = (c_double * count)()
        self.looks.append(self.call("fmi2GetReal", (c_uint * count)(*references), count, values))


@BOTH
def test_logger_that_calls_back(make: Make, name: str) -> None:
    """Section 2.1.5 foresees loggers that know their fmi2Component, and forbids them nothing. (In a step,
    section 4.2.4 has no values to get: stepInProgress.) Whatever they get, all else stays as it is."""

    def run(caller: Strange) -> list[list[float]]:
        speed = caller.references("engine_speed")
        assert caller.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == Status.OK
        if name == "BoostPlant":
            # Ignored in the initialization, which says so.
            assert caller.set_reals(caller.references("hp_shaft.speed"), [9999.0]) == Status.OK
        assert caller.call("fmi2EnterInitializationMode") == Status.OK
        warned = Status.WARNING if name == "BoostPlant" else Status.OK
        assert caller.call("fmi2ExitInitializationMode") == warned
        results = []
        for index in range(8):
            # Out of its range and back, with a warning each time that it leaves.
            warned = Status.WARNING if index % 2 else Status.OK
            assert caller.set_reals(speed, [-1.0 if index % 2 else 1500.0]) == warned
            assert caller.step(index * STEP, STEP) == Status.OK
            results.append(caller.outputs())
            assert caller.step(index * STEP, nan) == Status.ERROR
            assert caller.set_reals(speed, [nan]) == Status.ERROR
        return results

    plain, curious = make(name, logging_on=True), make(name, Curious, logging_on=True)
    assert run(curious) == run(plain)
    assert curious.messages == plain.messages
    assert len(curious.looks) == len(plain.messages) >= 20
    assert set(curious.looks) == {Status.OK}


class Meddling(Strange):
    """An importer whose logger, at the first message, does something with the instance that is logging."""

    def __init__(self, *arguments, deed: str, **named) -> None:
        self.deed: str | None = deed
        super().__init__(*arguments, **named)

    def _log(self, *arguments) -> None:
        super()._log(*arguments)
        deed, self.deed = self.deed, None
        if deed == "free":
            self.free()
        elif deed == "step":
            assert self.step(STEP, STEP) == Status.OK
        elif deed == "reset":
            assert self.call("fmi2Reset") == Status.OK
            self.initialize()


@BOTH
@pytest.mark.parametrize("deed", ["free", "step", "reset"])
def test_logger_that_meddles(make: Make, name: str, deed: str) -> None:
    """The call that logs is over when the logger is called: what this does is a call after it."""
    meddling, orderly = make(name, Meddling, deed=deed), make(name)
    for caller in (meddling, orderly):
        caller.initialize()
        assert caller.step(0.0, STEP) == Status.OK
        (text,) = caller.errors_of("fmi2DoStep", STEP, nan, 1)
        assert "communicationStepSize" in text
    assert meddling.deed is None
    if deed == "free":
        assert meddling.component is None
        return
    if deed == "step":
        assert orderly.step(STEP, STEP) == Status.OK
    else:
        assert orderly.call("fmi2Reset") == Status.OK
        orderly.initialize()
    assert meddling.outputs() == orderly.outputs()
    assert meddling.serialize(meddling.save()) == orderly.serialize(orderly.save())
