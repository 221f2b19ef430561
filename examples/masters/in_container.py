"""The container of both FMUs that fmucontainer made, as one FMU in FMPy."""

from experiment import STEP, STEPS, boost_reference, report
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

description = read_model_description("target/fmu/boost.fmu")
references = {variable.name: variable.valueReference for variable in description.modelVariables}
folder = extract("target/fmu/boost.fmu")
boost = FMU2Slave(guid=description.guid, modelIdentifier="boost", unzipDirectory=folder)
boost.instantiate()
boost.setupExperiment(startTime=0.0)
boost.enterInitializationMode()
boost.exitInitializationMode()

rows = []
for step in range(STEPS):
    boost.setReal([references["boost_reference"]], [boost_reference(step)])
    boost.doStep(step * STEP, STEP)
    rows.append(boost.getReal([references["boost_pressure"], references["hp_wastegate_pwm"]]))
boost.terminate()
boost.freeInstance()
report(rows)
