"""The experiment of Fig. 13 by a master in C, tests/platforms/loop.c."""

from __future__ import annotations

import struct
import subprocess

import numpy as np

from fmu import ROOT
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, SAMPLE_TIME, staircase
from fmu.master import Fmu

SOURCE = ROOT / "tests" / "platforms" / "loop.c"
FLAGS = ["-std=gnu11", "-O1", "-Wall", "-Wextra", "-Werror"]

SUFFIXES = {"linux64": "so", "win64": "dll", "aarch64-linux": "so"}


def _arguments(fmu: Fmu, other: Fmu, platform: str, extra: list[str]) -> list[str]:
    """The master's arguments for an FMU: its outputs and inputs in the connection, and what is printed."""

    def references(names: list[str]) -> str:
        return ",".join(str(fmu.variables[name].valueReference) for name in names)

    name = fmu.description.modelName
    gives = [output for output in fmu.named("output") if output in other.named("input")]
    takes = extra + [output for output in other.named("output") if output in fmu.named("input")]
    library = fmu.folder / "binaries" / platform / f"{name}.{SUFFIXES[platform]}"
    return [
        str(library),
        fmu.description.guid,
        references(gives),
        references(takes),
        references(fmu.named("output")),
    ]


def run_loop(program: list[str], platform: str, controller: Fmu, plant: Fmu) -> np.ndarray:
    """Runs the experiment on a platform; returns both FMUs' outputs, the controller's first, in each step."""
    command = [
        *program,
        repr(SAMPLE_TIME),
        *_arguments(controller, plant, platform, ["boost_reference"]),
        *_arguments(plant, controller, platform, []),
    ]
    reference = staircase(*BOOST_STEPS)
    steps = round(BOOST_STEPS_END / SAMPLE_TIME)
    signal = "\n".join(repr(reference(index * SAMPLE_TIME)) for index in range(steps))
    result = subprocess.run(command, input=signal, capture_output=True, text=True, timeout=600)
    assert (result.returncode, result.stderr) == (0, "")
    rows = [bytes.fromhex(line.replace(" ", "")) for line in result.stdout.splitlines()]
    assert len(rows) == steps
    return np.array([struct.unpack(f">{len(row) // 8}d", row) for row in rows])
