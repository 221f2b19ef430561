"""The FMUs under FMPy: the closed loop of the paper's Fig. 13, and the controller beside one of PythonFMU.

`python masters.py TARGET PASS` writes how long they take into cargo's target folder.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterable
from pathlib import Path
from time import perf_counter

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from pythonfmu.builder import FmuBuilder

ROOT = Path(__file__).resolve().parents[2]

STEP = 1 / 80
"""The size of a step in s."""
STEPS = 124 * 80
TIMES = [0, 5, 15, 25, 38, 52, 64, 76, 88, 100, 112]
KILOPASCALS = [125, 135, 150, 170, 185, 170, 150, 135, 125, 145, 125]
"""What boost pressure shall be from each of these times (s) on."""

LOOPS, REPETITIONS = 5, 20
"""Of the closed loop, and of what is short; the shortest of them counts."""

PAPER = 2
"""The value of the parameter `structure` for the one that was ported to Python."""


class FMU2ByName(FMU2Slave):
    """An instance whose variables go by their names. (FMPy knows by the class's name that it is of FMI 2.)"""

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


class Masters:
    """The FMUs of a folder and that of PythonFMU, with a folder to extract and build in."""

    def __init__(self, exported: Path, work: Path) -> None:
        shutil.rmtree(work, ignore_errors=True)
        built = work / "python"
        built.mkdir(parents=True)
        script = shutil.copy(Path(__file__).with_name("controller.py"), built)
        # Beside the script, which reads it when the FMU is built, too.
        declaration = shutil.copy(ROOT / "modelDescription" / "controller.json", built)
        FmuBuilder.build_FMU(script, dest=built, project_files=[declaration])
        paths = [*exported.glob("*.fmu"), *built.glob("*.fmu")]
        # Once: a library must not be written anew while it is loaded.
        self.folders = {path.stem: extract(path, work / path.stem) for path in paths}

    def slave(self, name: str) -> FMU2ByName:
        return FMU2ByName(self.folders[name])

    def closed_loop(self) -> tuple[float, list[dict[str, float]]]:
        """The duration (s) of the loop that README.md shows, and what was measured in each step."""
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
        """How long (s) a controller's step takes in Rust and by PythonFMU, each called from Python alike.

        Both get what was measured in the closed loop, and have to give the same duties.
        """

        def rust() -> FMU2ByName:
            slave = self.slave("BoostController")
            slave.setInteger(slave.references(["structure"]), [PAPER])
            return slave.initialize()

        def python() -> FMU2ByName:
            return self.slave("PythonController").initialize()

        def between_samples() -> FMU2ByName:
            slave = self.slave("BoostController")
            slave.setReal(slave.references(["sample_time"]), [1.0])
            return slave.initialize()

        def steps(make: Callable[[], FMU2ByName], size: float = STEP) -> float:
            """One step: a call of fmi2DoStep."""
            slave = make()
            # Everything is imported and looked up by then.
            slave.doStep(0.0, size)
            start = perf_counter()
            for i in range(1, STEPS + 1):
                slave.doStep(i * size, size)
            duration = perf_counter() - start
            slave.freeInstance()
            return duration / STEPS

        wanted = boost_references()

        def exchanges(make: Callable[[], FMU2ByName]) -> tuple[float, list[float]]:
            """One step with its inputs set and outputs got; and the duties (%)."""
            slave = make()
            inputs = slave.references(["boost_reference", *measured[0]])
            outputs = slave.references(["hp_wastegate_pwm", "vacuum_pump"])
            rows = [[reference, *row.values()] for reference, row in zip(wanted, measured, strict=True)]
            duties = []
            start = perf_counter()
            for i, row in enumerate(rows):
                slave.setReal(inputs, row)
                slave.doStep(i * STEP, STEP)
                duties.append(slave.getReal(outputs)[0])
            duration = perf_counter() - start
            slave.freeInstance()
            return duration / STEPS, duties

        duties = [exchanges(make)[1] for make in (rust, python)]
        apart = max(abs(a - b) for a, b in zip(*duties, strict=True))
        # Both compute in doubles; the order of some sums is another.
        assert apart < 1e-9, f"the controllers' duties differ by {apart} %"
        measurements = {
            "step, Rust": lambda: steps(rust),
            "step, PythonFMU": lambda: steps(python),
            "call": lambda: steps(between_samples, 1e-7),
            "exchange, Rust": lambda: exchanges(rust)[0],
            "exchange, PythonFMU": lambda: exchanges(python)[0],
        }
        # In turn, because a machine is slower for a while rather than now and then.
        runs = [{name: measure() for name, measure in measurements.items()} for _ in range(REPETITIONS)]
        return {name: min(run[name] for run in runs) for name in measurements}


def boost_references() -> list[float]:
    """The reference of boost pressure (Pa) in each step."""
    return [1e3 * KILOPASCALS[bisect_right(TIMES, i * STEP) - 1] for i in range(STEPS)]


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
