"""Both FMUs as blocks of PathSim: pip install pathsim-fmi fmpy."""

from experiment import COMMANDS, MEASUREMENTS, STEP, STEPS, boost_reference, report
from pathsim import Connection, Simulation
from pathsim.blocks import Constant, Scope, Source
from pathsim_fmi import CoSimulationFMU

controller = CoSimulationFMU("target/fmu/BoostController.fmu", "controller", dt=STEP)
start = {name: controller.outputs[name] for name in COMMANDS}  # at rest where the controller begins
plant = CoSimulationFMU("target/fmu/BoostPlant.fmu", "plant", start_values=start, dt=STEP)
reference = Source(lambda time: boost_reference(round(time / STEP)))
scope = Scope()

blocks = [reference, controller, plant, scope]  # they step in this order
connections = [
    Connection(reference, controller["boost_reference"]),
    *[Connection(controller[name], plant[name]) for name in COMMANDS],
    *[Connection(plant[name], controller[name]) for name in MEASUREMENTS],
    Connection(plant["boost_pressure"], scope[0]),
    Connection(controller["hp_wastegate_pwm"], scope[1]),
]
# PathSim hands over zero where nothing is connected.
for block in (controller, plant):
    for variable in block.fmu_wrapper.model_description.modelVariables:
        if variable.causality == "input" and variable.name not in [
            "boost_reference",
            *COMMANDS,
            *MEASUREMENTS,
        ]:
            constant = Constant(float(variable.start))
            blocks.append(constant)
            connections.append(Connection(constant, block[variable.name]))

simulation = Simulation(blocks, connections, dt=STEP)
simulation.run(STEP * (STEPS - 1))
# The blocks of FMUs step where PathSim samples: what is recorded at a time is what the step from it reached.
rows = list(zip(*scope.read()[1].tolist(), strict=True))
report(rows)
