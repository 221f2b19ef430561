"""Co-simulation of both FMUs with FMPy: the loop with BoostController, and the plant with given valves."""

from functools import cache

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

FOLDER = "target/both"
STEP = 1 / 80  # s, the controller's sample time

START_KPA, END_KPA = 125.0, 170.0
"""The step of boost."""

MEASURED = ["boost_pressure", "hp_turbo_speed", "exhaust_manifold_pressure", "hp_wastegate_position"]
VALVES = ["hp_wastegate_pwm", "lp_wastegate", "hp_bypass"]


@cache
def opened(name):
    """An FMU's description, and the folder it is extracted to."""
    path = f"{FOLDER}/{name}.fmu"
    return read_model_description(path), extract(path)


class FMU2ByName(FMU2Slave):
    """An FMU in initialization mode, its variables by name."""

    def __init__(self, name, engine_speed):
        description, folder = opened(name)
        super().__init__(guid=description.guid, modelIdentifier=name, unzipDirectory=folder)
        self.variables = {v.name: v for v in description.modelVariables}
        self.instantiate()
        self.setupExperiment(startTime=0.0)
        self.enterInitializationMode()
        self.set(["engine_speed"], [engine_speed])

    def get(self, names):
        return self.getReal([self.variables[name].valueReference for name in names])

    def set(self, names, values):
        self.setReal([self.variables[name].valueReference for name in names], values)

    def named(self, causality):
        return {name for name, v in self.variables.items() if v.causality == causality}


def plant_at(engine_speed, valves):
    """The plant, settled at an engine speed (rpm) with these valves."""
    plant = FMU2ByName("BoostPlant", engine_speed)
    plant.set(VALVES, valves)
    plant.exitInitializationMode()
    return plant


def apply(engine_speed, valves):
    """Settles the plant at the first row of valves and steps through the others; returns the measurements."""
    plant = plant_at(engine_speed, valves[0])
    rows = [plant.get(MEASURED)]
    for step, openings in enumerate(valves[1:]):
        plant.set(VALVES, openings)
        plant.doStep(step * STEP, STEP)
        rows.append(plant.get(MEASURED))
    return rows


def closed_loop(engine_speed, references):
    """Runs BoostController with a boost reference (Pa) for each step; returns measurements and valves."""
    controller, plant = (FMU2ByName(name, engine_speed) for name in ("BoostController", "BoostPlant"))
    commands = controller.named("output") & plant.named("input")
    measurements = plant.named("output") & controller.named("input")
    controller.set(["boost_reference"], [references[0]])
    plant.set(commands, controller.get(commands))
    controller.exitInitializationMode()
    plant.exitInitializationMode()
    rows = []
    for step, reference in enumerate(references):
        controller.set(["boost_reference"], [reference])
        controller.set(measurements, plant.get(measurements))
        controller.doStep(step * STEP, STEP)
        plant.set(commands, controller.get(commands))
        plant.doStep(step * STEP, STEP)
        rows.append((plant.get(MEASURED), controller.get(VALVES)))
    return rows
