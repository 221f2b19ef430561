"""The FMUs under FMPy: the closed loop of Fig. 13, and the controller compared with one of PythonFMU.

`python masters.py TARGET PASS` writes how long they take into cargo's target folder.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
from bisect import bisect_right
from collections.abc import Callable, Iterable
from ctypes import CDLL, c_double, c_size_t, c_uint, c_void_p, cast
from pathlib import Path
from time import perf_counter

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from pythonfmu.builder import FmuBuilder

ROOT = Path(__file__).resolve().parents[2]

STEP = 1 / 80
"""The size of a step in s."""
STEPS = 124 * 80
SCENARIO = ROOT / "boost" / "lab" / "scenarios" / "figure_13.toml"
"""Steps of the boost reference over time."""

LOOPS, REPETITIONS = 5, 20
"""Repetitions of the closed loop and of short runs; the shortest one counts."""

PAPER, BY_SPEED = 2, 2
"""The parameters `structure` and `strategy` for the law that was ported to Python."""


class FMU2ByName(FMU2Slave):
    """An instance with access by variable names. (FMPy recognizes FMI 2 by the class's name.)"""

    def __init__(self, folder: str) -> None:
        description = read_model_description(folder)
        super().__init__(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=folder,
        )
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.instantiate()
        self.setupExperiment(startTime=0.0)

    def references(self, names: Iterable[str]) -> list[int]:
        return [self.variables[name].valueReference for name in names]

    def named(self, causality: str) -> set[str]:
        return {name for name, variable in self.variables.items() if variable.causality == causality}

    def initialize(self) -> FMU2ByName:
        self.enterInitializationMode()
        self.exitInitializationMode()
        return self


class NativeMaster:
    """`master.c`, compiled into a folder."""

    def __init__(self, folder: Path) -> None:
        library = folder / "master.so"
        source = Path(__file__).with_name("master.c")
        command = [os.environ.get("CC", "cc"), "-O2", "-shared", "-fPIC", str(source), "-o", str(library)]
        subprocess.run(command, check=True)
        self.function = CDLL(str(library)).run
        self.function.restype = c_double

    def run(
        self,
        slave: FMU2ByName,
        inputs: Iterable[str],
        rows: list[list[float]],
        outputs: Iterable[str],
    ) -> tuple[float, list[list[float]]]:
        """The duration (s) of a step with a row of inputs set before and outputs read after it; and these
        outputs."""
        # By now everything is imported and looked up.
        slave.doStep(0.0, STEP)
        input_references, output_references = slave.references(inputs), slave.references(outputs)
        values = [value for row in rows for value in row]
        got = (c_double * (STEPS * len(output_references)))()
        functions = (slave.dll.fmi2SetReal, slave.dll.fmi2DoStep, slave.dll.fmi2GetReal)
        duration = self.function(
            *(cast(function, c_void_p) for function in functions),
            c_void_p(slave.component),
            c_double(STEP),
            c_double(STEP),
            c_size_t(STEPS),
            (c_uint * len(input_references))(*input_references),
            c_size_t(len(input_references)),
            (c_double * len(values))(*values),
            (c_uint * len(output_references))(*output_references),
            c_size_t(len(output_references)),
            got,
        )
        assert duration > 0.0, f"{slave.modelIdentifier} does not return fmi2OK"
        width = len(output_references)
        return duration / STEPS, [list(got[i * width : (i + 1) * width]) for i in range(STEPS)]


class Masters:
    """The FMUs of a folder and that of PythonFMU, with a folder to extract and build in."""

    def __init__(self, exported: Path, work: Path) -> None:
        shutil.rmtree(work, ignore_errors=True)
        built = work / "python"
        built.mkdir(parents=True)
        script = shutil.copy(Path(__file__).with_name("controller.py"), built)
        # The script reads it during the build as well.
        declaration = shutil.copy(ROOT / "modelDescription" / "controller.json", built)
        FmuBuilder.build_FMU(script, dest=built, project_files=[declaration])
        paths = [*exported.glob("*.fmu"), *built.glob("*.fmu")]
        self.native = NativeMaster(work)
        # Once: a library must not be overwritten while it is loaded.
        self.folders = {path.stem: extract(path, work / path.stem) for path in paths}

    def slave(self, name: str) -> FMU2ByName:
        return FMU2ByName(self.folders[name])

    def closed_loop(self) -> tuple[float, list[dict[str, float]]]:
        """The duration (s) of the loop that docs/masters.md shows, and what was measured in each step."""
        controller, plant = self.slave("BoostController"), self.slave("BoostPlant")
        commands = sorted(controller.named("output") & plant.named("input"))
        measurements = sorted(plant.named("output") & controller.named("input"))
        command = (controller.references(commands), plant.references(commands))
        measure = (plant.references(measurements), controller.references(measurements))
        reference, boost = controller.references(["boost_reference"]), plant.references(["boost_pressure"])
        duty = controller.references(["hp_wastegate_pwm"])
        controller.enterInitializationMode()
        plant.enterInitializationMode()
        plant.setReal(command[1], controller.getReal(command[0]))
        controller.exitInitializationMode()
        plant.exitInitializationMode()

        wanted = boost_references()
        measured, rows = [], []
        start = perf_counter()
        for i in range(STEPS):
            controller.setReal(reference, [wanted[i]])
            measured.append(plant.getReal(measure[0]))
            controller.setReal(measure[1], measured[-1])
            controller.doStep(i * STEP, STEP)
            plant.setReal(command[1], controller.getReal(command[0]))
            plant.doStep(i * STEP, STEP)
            rows.append(plant.getReal(boost) + controller.getReal(duty))
        duration = perf_counter() - start
        plant.freeInstance()
        controller.freeInstance()
        return duration, [dict(zip(measurements, values, strict=True)) for values in measured]

    def controllers(self, measured: list[dict[str, float]]) -> dict[str, float]:
        """The duration (s) of a controller's step in Rust and in PythonFMU, called in the same way.

        Both get the measurements of the closed loop, and must give the same duties.
        """
        rows = [
            [reference, *row.values()] for reference, row in zip(boost_references(), measured, strict=True)
        ]
        inputs = ["boost_reference", *measured[0]]
        outputs = ["hp_wastegate_pwm", "vacuum_pump"]

        def rust() -> FMU2ByName:
            slave = self.slave("BoostController")
            slave.setInteger(slave.references(["structure", "strategy"]), [PAPER, BY_SPEED])
            return slave.initialize()

        def python() -> FMU2ByName:
            return self.slave("PythonController").initialize()

        def steps(make: Callable[[], FMU2ByName]) -> float:
            """fmi2DoStep under the native master."""
            slave = make()
            duration, _ = self.native.run(slave, inputs=[], rows=[], outputs=[])
            slave.freeInstance()
            return duration

        def exchanges(make: Callable[[], FMU2ByName]) -> tuple[float, list[list[float]]]:
            """The same with inputs set and outputs read; and the outputs."""
            slave = make()
            found = self.native.run(slave, inputs, rows, outputs)
            slave.freeInstance()
            return found

        def exchanges_by_fmpy(make: Callable[[], FMU2ByName]) -> float:
            """The same under FMPy."""
            slave = make()
            input_references, output_references = slave.references(inputs), slave.references(outputs)
            start = perf_counter()
            for i, row in enumerate(rows):
                slave.setReal(input_references, row)
                slave.doStep(i * STEP, STEP)
                slave.getReal(output_references)
            duration = perf_counter() - start
            slave.freeInstance()
            return duration / STEPS

        duties = [[row[0] for row in exchanges(make)[1]] for make in (rust, python)]
        apart = max(abs(a - b) for a, b in zip(*duties, strict=True))
        # Both compute in doubles, but some sums have a different order.
        assert apart < 1e-9, f"the controllers' duties differ by {apart} %"
        measurements = {
            "step, Rust": lambda: steps(rust),
            "step, PythonFMU": lambda: steps(python),
            "exchange, Rust": lambda: exchanges(rust)[0],
            "exchange, PythonFMU": lambda: exchanges(python)[0],
            "exchange by FMPy, Rust": lambda: exchanges_by_fmpy(rust),
            "exchange by FMPy, PythonFMU": lambda: exchanges_by_fmpy(python),
        }
        # In turn, because a machine stays slow for a while.
        runs = [{name: measure() for name, measure in measurements.items()} for _ in range(REPETITIONS)]
        return {name: min(run[name] for run in runs) for name in measurements}


def boost_references() -> list[float]:
    """The reference of boost pressure (Pa) in each step."""
    times, pressures = zip(
        *tomllib.loads(SCENARIO.read_text())["inputs"]["boost_reference"]["steps"], strict=True
    )
    return [pressures[bisect_right(times, i * STEP) - 1] for i in range(STEPS)]


def main() -> None:
    target = Path(sys.argv[1])
    masters = Masters(target / "fmu", target / "benches" / "masters")
    loops = [masters.closed_loop() for _ in range(LOOPS)]
    found = {"closed loop": min(seconds for seconds, _ in loops), **masters.controllers(loops[0][1])}
    (target / "benches" / f"{sys.argv[2]}.json").write_text(json.dumps(found))
    # As a process exits, the library of PythonFMU counts down in memory that it has freed just before: its
    # destructor clears a shared pointer that the exit has already destroyed. Now and then the C library finds
    # its heap corrupted then, and aborts. This leaves out what runs at exit.
    os._exit(0)


if __name__ == "__main__":
    main()
