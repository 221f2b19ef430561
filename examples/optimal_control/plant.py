"""The plant's Model Exchange FMU in CasADi."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

FMU = "target/both/fmi3/BoostPlant.fmu"
"""That of FMI 3.0 has adjoint derivatives; with that of FMI 2.0 CasADi makes them of directional ones."""

# In krpm of rad/s.
KRPM = 30 / np.pi / 1e3

DUTY = 100.0
"""The commanded duty (%), constant: CasADi has no discrete inputs. The supply voltage takes its place, since the valve
sees their product: at 12 V and 40 % what it is at 4.8 V and 100 %."""


def voltage(duty):
    """The supply voltage that acts as a duty (%) at 12 V does."""
    return 12.0 * duty / DUTY


@dataclass
class Plant:
    """Derivatives of the states, by the states and the inputs that were left free, in their nominal values."""

    derivatives: ca.Function
    states: list[str]
    nominal: np.ndarray
    start: np.ndarray
    """The steady state for the inputs at the start, in nominal values."""

    def scale(self, state, unit=1.0):
        """Turns a state in its nominal value into one in a unit."""
        return self.nominal[self.states.index(state)] * unit


def load(inputs, **start):
    """Loads the plant with some inputs free, in this order; the others keep their start values."""
    dae = ca.DaeBuilder("plant", FMU)
    # CasADi sets tunable parameters and all inputs at each evaluation, as variables; what is fixed, only once.
    for name in dae.p() + [name for name in dae.u() if name not in inputs]:
        dae.set_variability(name, "fixed")
    for name, value in {"hp_wastegate_pwm": DUTY, **start}.items():
        dae.set(name, value)
    model = dae.create("model", ["x", "u"], ["ode"])
    nominal = np.array([dae.nominal(name) for name in dae.x()])
    x, u = ca.MX.sym("x", len(nominal)), ca.MX.sym("u", len(inputs))
    ordered = ca.vertcat(*(u[inputs.index(name)] for name in dae.u()))
    derivatives = ca.Function("derivatives", [x, u], [model(x * nominal, ordered) / nominal])
    # Settled since the function was created.
    return Plant(derivatives, dae.x(), nominal, np.array(dae.get(dae.x())) / nominal)
