"""Both FMUs in Ecos: pip install ecospy tbb, with the folder of TBB in LD_LIBRARY_PATH."""

from ecospy import EcosSimulation, EcosSimulationStructure
from experiment import COMMANDS, MEASUREMENTS, STEP, STEPS, boost_reference, report

structure = EcosSimulationStructure()
structure.add_model("controller", "target/fmu/BoostController.fmu")
structure.add_model("plant", "target/fmu/BoostPlant.fmu")
for name in COMMANDS:
    structure.make_real_connection(f"controller::{name}", f"plant::{name}")
for name in MEASUREMENTS:
    structure.make_real_connection(f"plant::{name}", f"controller::{name}")

simulation = EcosSimulation(structure=structure, step_size=STEP)
simulation.init()
rows = []
for step in range(STEPS):
    simulation.set_real("controller::boost_reference", boost_reference(step))
    simulation.step()
    names = ["plant::boost_pressure", "controller::hp_wastegate_pwm"]
    rows.append([simulation.get_real(name) for name in names])
simulation.terminate()
report(rows)
