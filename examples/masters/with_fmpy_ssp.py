"""Boost.ssp in FMPy: pip install fmpy."""

from experiment import STEP, STEPS, boost_reference, report
from fmpy.ssp.simulation import simulate_ssp

inputs = {
    "boost_reference": lambda time: boost_reference(round(time / STEP)),
    # FMPy ignores the system's parameter bindings, and passes zero for other inputs.
    "engine_speed": lambda time: 1500.0,
    "supply_voltage": lambda time: 12.0,
    "throttle": lambda time: 1.0,
    "ambient_pressure": lambda time: 101325.0,
    "ambient_temperature": lambda time: 298.0,
}
result = simulate_ssp("target/fmu/Boost.ssp", stop_time=STEP * STEPS, step_size=STEP, input=inputs)
rows = result[["boost_pressure", "hp_wastegate_pwm"]].tolist()
report(rows)
