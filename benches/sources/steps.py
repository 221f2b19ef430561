"""The processor time of steps and instantiations: `python steps.py NATIVE COMPILED`, folders of both FMUs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from ctypes import c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from time import process_time

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

STEP = 1 / 80
"""The size of a step in s."""
STEPS = 2000
REPETITIONS = 10
"""The shortest counts: other load only prolongs."""

MOVED = {
    "BoostPlant": ("hp_wastegate_pwm", [40.0, 44.0, 41.0, 50.0]),
    "BoostController": ("boost_pressure", [100e3, 140e3, 120e3, 150e3]),
}
"""An input of each, and its values, each for 0.1 s."""


class Instances:
    """Makes and steps instances of an FMU by its library's functions, without FMPy's part of a call."""

    def __init__(self, file: Path) -> None:
        description = read_model_description(file)
        self.arguments = {
            "guid": description.guid,
            "modelIdentifier": description.coSimulation.modelIdentifier,
            "unzipDirectory": extract(str(file)),
        }
        name, self.values = MOVED[description.modelName]
        self.input = next(v.valueReference for v in description.modelVariables if v.name == name)

    def make(self) -> FMU2Slave:
        fmu = FMU2Slave(**self.arguments)
        fmu.instantiate()
        return fmu

    def step(self, moved: bool) -> float:
        """The time of a step in s, compared with that of the same calls with a null pointer."""
        fmu = self.make()
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        do_step, set_real = fmu.dll.fmi2DoStep, fmu.dll.fmi2SetReal
        do_step.argtypes = [c_void_p, c_double, c_double, c_int]
        set_real.argtypes = [c_void_p, c_void_p, c_size_t, c_void_p]
        reference = (c_uint * 1)(self.input)
        values = [(c_double * 1)(value) for value in self.values]

        def run(component: c_void_p | None) -> float:
            begin = process_time()
            for number in range(STEPS):
                if moved and number % 8 == 0:
                    set_real(component, reference, 1, values[number // 8 % len(values)])
                do_step(component, number * STEP, STEP, 1)
            return process_time() - begin

        time = (run(fmu.component) - run(None)) / STEPS
        fmu.freeInstance()
        return time

    def instantiate(self) -> float:
        """The time of an instantiation in s."""
        count = 50
        begin = process_time()
        fmus = [self.make() for _ in range(count)]
        time = (process_time() - begin) / count
        for fmu in fmus:
            fmu.freeInstance()
        return time


def main() -> None:
    folders = list(map(Path, sys.argv[1:3]))
    print(f"{'':43}{'native':>9}{'sources':>9}{'ratio':>7}")
    for name in MOVED:
        both = [Instances(folder / f"{name}.fmu") for folder in folders]
        measures: dict[str, Callable[[Instances], float]] = {
            "step at rest": lambda fmu: fmu.step(moved=False),
            "step with a moving input": lambda fmu: fmu.step(moved=True),
            "instantiation, with FMPy's part": Instances.instantiate,
        }
        for what, measure in measures.items():
            # In turns, as load changes.
            times = [[measure(fmu) for fmu in both] for _ in range(REPETITIONS)]
            native, compiled = (min(column) * 1e6 for column in zip(*times, strict=True))
            print(f"{name + ', ' + what:43}{native:6.2f} us{compiled:6.2f} us{compiled / native:7.2f}")


if __name__ == "__main__":
    main()
