"""Other validators than FMPy: they find nothing in the FMUs, but errors in broken ones."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from fmu import TARGET
from fmu.broken import copy_with
from fmu.master import Fmu

NAMES = ["BoostPlant", "BoostController"]


@pytest.fixture
def broken(exported: Path, tmp_path: Path) -> Path:
    """The controller without the start value of an input."""
    pattern = r'(<ScalarVariable name="boost_reference"[^>]*>\s*<Real[^>]*?) start="[^"]*"'
    file = "BoostController.fmu"
    return copy_with(exported / file, tmp_path / file, pattern, r"\1")


class Message(NamedTuple):
    """A validator's message."""

    level: str
    text: str


def fmutool(file: Path) -> tuple[int, list[Message]]:
    """The exit code and messages of fmu-manipulation-toolbox: by the schema, and by rules beyond it."""
    command = [Path(sys.executable).parent / "fmutool", "-input", file, "-check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = (done.stdout + done.stderr).splitlines()
    return done.returncode, [Message(*(part.strip() for part in line.split("|", 1))) for line in lines]


@pytest.mark.parametrize("name", NAMES)
def test_fmutool_finds_nothing(exported: Path, name: str) -> None:
    code, messages = fmutool(exported / f"{name}.fmu")
    assert code == 0
    assert {message.level for message in messages} == {"INFO"}
    texts = [message.text for message in messages]
    assert "This FMU seems to be compliant with FMI-2.0." in texts
    assert "No semantic error against the FMI-2 standard." in texts


def test_fmutool_finds_what_is_broken(broken: Path) -> None:
    code, messages = fmutool(broken)
    assert code != 0
    found = "Variable 'boost_reference': a start value is required"
    assert any(message.level == "ERROR" and found in message.text for message in messages)


LOAD = """
import sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimSlave import CosimLocalSlave

execution = CosimExecution.from_step_size(12_500_000)
slave = CosimLocalSlave(fmu_path=sys.argv[1], instance_name="slave")
assert execution.add_local_slave(local_slave=slave) == 0
assert execution.step(80)
assert execution.status().current_time == 1_000_000_000
"""
"""A second of simulation in libcosim, which reads and calls FMUs through Modelon's FMI Library."""

LIBCOSIM_LINE = re.compile(r"\[[^]]*\] \[0x[0-9a-f]+\] \[(\w+)\] *(?:\[FMI Library: \w+\] )?(.*)")


def libcosim(file: Path) -> Iterator[Message]:
    """The messages of libcosim and its FMI Library, with the line of the XML if they give it."""
    command = [sys.executable, "-c", LOAD, str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    place = ""
    for line in done.stdout.splitlines():
        level, text = LIBCOSIM_LINE.fullmatch(line).groups()
        if text.endswith("Detected during parsing:"):
            place = f"{text.split()[0]} "
        elif level not in {"trace", "debug", "info"}:
            yield Message(level, place + text)
            place = ""


def expected_of_libcosim(fmu: Fmu) -> set[Message]:
    """Two complaints about a valid FMU."""
    # It expects a start value of the independent variable, which the standard forbids (section 2.2.7).
    time = fmu.variables["time"]
    assert (time.causality, time.start) == ("independent", None)
    line = time.sourceline + 1
    start = "Start attribute is required for this causality, variability and initial combination"
    messages = {Message("error", f"[Line:{line}] {start}")}
    # It does not support enumerations.
    for name, variable in fmu.variables.items():
        if variable.type == "Enumeration":
            text = (
                f"FMI 2.0 Enumeration variable type not supported, variable with name {name} will be ignored"
            )
            messages.add(Message("warning", text))
    return messages


@pytest.mark.parametrize("name", NAMES)
def test_libcosim_finds_nothing(fmus: dict[str, Fmu], name: str) -> None:
    assert set(libcosim(fmus[name].path)) == expected_of_libcosim(fmus[name])


@pytest.mark.parametrize("file", ["names.fmu", "fmi3/names.fmu"])
def test_names_that_other_tools_write_are_taken(file: str) -> None:
    code, messages = fmutool(TARGET / "names-model" / file)
    assert (code, {message.level for message in messages}) == (0, {"INFO"})
    assert any("No semantic error" in message.text for message in messages)


def test_names_that_other_tools_write_are_read_by_the_fmi_library(tmp_path: Path) -> None:
    """With Modelon's library PyFMI reads, too, for either interface. libcosim has no FMI 3.0."""
    file = TARGET / "names-model" / "names.fmu"
    assert set(libcosim(file)) == expected_of_libcosim(Fmu(file, tmp_path))


def test_libcosim_finds_what_is_broken(controller_fmu: Fmu, broken: Path) -> None:
    found = "Start attribute is required for this causality, variability and initial combination"
    more = set(libcosim(broken)) - expected_of_libcosim(controller_fmu)
    assert any(message.level == "error" and found in message.text for message in more)
