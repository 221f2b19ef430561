"""Boost.ssp in libcosim, with its Python interface: pip install libcosimpy."""

from zipfile import ZipFile

from experiment import STEP, STEPS, boost_reference, report
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver

ZipFile("target/fmu/Boost.ssp").extractall("target/boost")
log_output_level(CosimLogLevel.FATAL)
# libcosim does not support connectors of a system: Components.ssd is the system without them.
execution = CosimExecution.from_ssp_file("target/boost/Components.ssd", step_size=round(STEP * 1e9))  # ns
observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
execution.add_observer(observer)
execution.add_manipulator(manipulator)


def find(slave, name):
    """The index of a slave, and in a list the value reference of its variable."""
    index = execution.slave_index_from_instance_name(slave)
    variables = execution.slave_variables(index)
    return index, [variable.reference for variable in variables if variable.name.decode() == name]


reference = find("BoostController", "boost_reference")
reached = [find("BoostPlant", "boost_pressure"), find("BoostController", "hp_wastegate_pwm")]

rows = []
for step in range(STEPS):
    manipulator.slave_real_values(*reference, [boost_reference(step)])
    assert execution.step(), execution.status()
    rows.append([observer.last_real_values(*variable)[0] for variable in reached])
report(rows)
