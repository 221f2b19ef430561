"""The experiment of fig. 13 on each platform that can be run here, by a master in C."""

from __future__ import annotations

import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import NAMES
from experiments import BOOST_STEPS, BOOST_STEPS_END, ON_TOLERANCE, SAMPLE_TIME, staircase
from master import Fmu

SUFFIXES = {"linux64": "so", "win64": "dll", "aarch64-linux": "so"}


def arguments(fmu: Fmu, other: Fmu, platform: str, extra: list[str]) -> list[str]:
    """An FMU as the master wants it: what it gives to the other one, takes from it, and what is printed."""

    def references(names: list[str]) -> str:
        return ",".join(str(fmu.variables[name].valueReference) for name in names)

    name = fmu.description.modelName
    gives = [output for output in fmu.named("output") if output in other.named("input")]
    takes = extra + [output for output in other.named("output") if output in fmu.named("input")]
    library = Path(fmu.folder) / "binaries" / platform / f"{name}.{SUFFIXES[platform]}"
    return [
        str(library),
        fmu.description.guid,
        references(gives),
        references(takes),
        references(fmu.named("output")),
    ]


@pytest.fixture(scope="session")
def run(host: Callable[[str], list[str]], fmus: dict[str, Fmu]) -> Callable[[str], np.ndarray]:
    """Runs the experiment on a platform; both FMUs' outputs in each step."""
    known: dict[str, np.ndarray] = {}

    def run(platform: str) -> np.ndarray:
        if platform not in known:
            controller, plant = (fmus[name] for name in NAMES)
            command = [
                *host(platform),
                repr(SAMPLE_TIME),
                *arguments(controller, plant, platform, ["boost_reference"]),
                *arguments(plant, controller, platform, []),
            ]
            reference = staircase(*BOOST_STEPS)
            steps = round(BOOST_STEPS_END / SAMPLE_TIME)
            signal = "\n".join(repr(reference(index * SAMPLE_TIME)) for index in range(steps))
            result = subprocess.run(command, input=signal, capture_output=True, text=True, timeout=600)
            assert (result.returncode, result.stderr) == (0, "")
            rows = [bytes.fromhex(line.replace(" ", "")) for line in result.stdout.splitlines()]
            assert len(rows) == steps
            known[platform] = np.array([struct.unpack(f">{len(row) // 8}d", row) for row in rows])
        return known[platform]

    return run


def test_linux64(run: Callable[[str], np.ndarray], fmus: dict[str, Fmu]) -> None:
    """It is the experiment: boost pressure ends at its last reference, within the 2 Pa of
    tests/fmu/test_boost_steps.py and the tolerance there."""
    names = [name for fmu in NAMES for name in fmus[fmu].named("output")]
    boost = run("linux64")[:, names.index("boost_pressure")]
    assert abs(boost[-1] - BOOST_STEPS[-1][1]) <= 2 + ON_TOLERANCE
    assert max(boost) > 184e3


@pytest.mark.parametrize("platform", ["win64", "aarch64-linux"])
def test_other_platforms_get_the_same_numbers(run: Callable[[str], np.ndarray], platform: str) -> None:
    here, there = run("linux64"), run(platform)
    assert here.shape == there.shape
    assert np.array_equal(here, there)
