"""Both FMUs in libcosim, by its Python interface: pip install libcosimpy fmpy."""

from experiment import COMMANDS, MEASUREMENTS, STEP, STEPS, boost_reference, report
from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave


class Slave:
    """An FMU in an execution; libcosim knows variables by their value references alone."""

    def __init__(self, execution, name):
        path = f"target/fmu/{name}.fmu"
        variables = read_model_description(path).modelVariables
        self.references = {variable.name: variable.valueReference for variable in variables}
        self.index = execution.add_local_slave(CosimLocalSlave(path, name))

    def connect(self, execution, names, target):
        for name in names:
            source = (self.index, self.references[name])
            execution.connect_real_variables(*source, target.index, target.references[name])

    def get(self, observer, name):
        return observer.last_real_values(self.index, [self.references[name]])[0]

    def set(self, manipulator, name, value):
        manipulator.slave_real_values(self.index, [self.references[name]], [value])


log_output_level(CosimLogLevel.FATAL)
execution = CosimExecution.from_step_size(round(STEP * 1e9))  # ns
controller, plant = Slave(execution, "BoostController"), Slave(execution, "BoostPlant")
controller.connect(execution, COMMANDS, plant)
plant.connect(execution, MEASUREMENTS, controller)
observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
execution.add_observer(observer)
execution.add_manipulator(manipulator)

rows = []
for step in range(STEPS):
    controller.set(manipulator, "boost_reference", boost_reference(step))
    assert execution.step(), execution.status()
    rows.append([plant.get(observer, "boost_pressure"), controller.get(observer, "hp_wastegate_pwm")])
report(rows)
