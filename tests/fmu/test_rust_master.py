"""The master in Rust, an importer without common code with FMPy, must get the same numbers."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fmu import TARGET, libclang
from fmu.broken import copy_with
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, couple, staircase
from fmu.master import Make

NAMES = ["BoostController", "BoostPlant"]

Run = Callable[[Path], subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def run(root: Path) -> Run:
    """Builds the master if necessary; runs it on a folder of FMUs."""
    # With the profile and features of `tests/run`, which has compiled most of it.
    build = "cargo build --quiet --locked --profile test --workspace --all-features --bin fmi-master"
    subprocess.run(build.split(), cwd=root, env={**os.environ, **libclang.environment()}, check=True)
    master = TARGET / "debug" / "fmi-master"
    return lambda folder: subprocess.run([master, folder], capture_output=True, text=True, check=False)


def test_every_number_equals_that_of_fmpy(run: Run, exported: Path, plant: Make, controller: Make) -> None:
    """Fig. 13: all outputs of both at each communication point, compared as 64-bit patterns."""
    done = run(exported)
    assert (done.returncode, done.stderr) == (0, "")
    names, *lines = done.stdout.splitlines()
    table = np.array([[float(number) for number in line.split(",")] for line in lines])

    inputs = {"boost_reference": staircase(*BOOST_STEPS)}
    record = couple(plant(), controller(), inputs=inputs).run(BOOST_STEPS_END)
    expected = np.stack(list(record.values()), axis=1)

    assert names.split(",") == list(record)
    assert table.shape == expected.shape == (124 * 80 + 1, 1 + 6 + 14)
    different = table.view(np.uint64) != expected.view(np.uint64)
    assert not different.any(), f"first at {table[different.any(axis=1), 0][0]} s"
    # The comparison would not detect constant tables.
    assert (np.ptp(table, axis=0) > 0).sum() > 10


OF_TYPES = "unit|displayUnit|nominal|quantity|relativeQuantity|unbounded"
NOT_READ = rf'(?s)<UnitDefinitions>.*</UnitDefinitions>| (?:{OF_TYPES})="[^"]*"(?=[^<]*/?>)'
"""What the crate does not read: units, and attributes of Float64."""


def test_fmi_3_gives_the_numbers_of_fmi_2(run: Run, tmp_path: Path) -> None:
    """As far as the crate reads it: without units, and what it knows of types alone."""
    exported = TARGET / "both"
    of_fmi2, whole = run(exported), run(exported / "fmi3")
    assert (of_fmi2.returncode, of_fmi2.stderr) == (0, "")
    assert whole.returncode == 1
    assert 'in element "BaseUnit"' in whole.stderr
    for name in NAMES:
        file = f"{name}.fmu"
        copy_with(exported / "fmi3" / file, tmp_path / file, NOT_READ, "", most=0)
    of_fmi3 = run(tmp_path)
    assert (of_fmi3.returncode, of_fmi3.stderr) == (0, "")
    assert of_fmi3.stdout == of_fmi2.stdout


def test_missing_fmu_is_named(run: Run, tmp_path: Path) -> None:
    done = run(tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith(f"error: cannot import {tmp_path / 'BoostController.fmu'}: ")


def test_a_refusal_is_reported_with_the_fmus_message(run: Run, exported: Path, tmp_path: Path) -> None:
    """Through the variadic C callback to the master's standard error."""

    for name in NAMES:
        file = f"{name}.fmu"
        copy_with(exported / file, tmp_path / file, r'guid="\{[^}]*\}"', 'guid="{another}"')
    done = run(tmp_path)
    assert done.returncode == 1
    message, error = done.stderr.splitlines()
    assert message.startswith("BoostController: ")
    assert "{another}" in message
    assert error.startswith(f"error: cannot instantiate {tmp_path / 'BoostController.fmu'}: ")
