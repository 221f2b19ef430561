"""The plant's Model Exchange FMU in CasADi."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

FMU = "target/both/fmi3/BoostPlant.fmu"
"""FMI 3.0 has adjoint derivatives; for FMI 2.0 CasADi computes them from directional ones."""

KRPM = 30 / np.pi / 1e3
"""1 rad/s."""

DUTY = 100.0
"""The commanded duty (%), constant because CasADi does not vary discrete inputs. The supply voltage varies
instead: only the product acts, so 40 % at 12 V equals 100 % at 4.8 V."""


def voltage(duty):
    """The supply voltage equivalent to a duty (%) at 12 V."""
    return 12.0 * duty / DUTY


@dataclass
class Plant:
    """The states' derivatives as a function of states and free inputs; states in units of their nominal
    values."""

    derivatives: ca.Function
    states: list[str]
    nominal: np.ndarray
    start: np.ndarray
    """The steady state for the initial inputs, in units of nominal values."""

    def row(self, state, unit):
        """A state's row, and the factor that turns it into a unit."""
        index = self.states.index(state)
        return index, self.nominal[index] * unit


def load(inputs, **start):
    """Loads the plant with these inputs free, in this order; the others keep their start values."""
    dae = ca.DaeBuilder("plant", FMU)
    # CasADi sets fixed values once, before initialization, and everything else at each evaluation.
    for name in dae.p() + [name for name in dae.u() if name not in inputs]:
        dae.set_variability(name, "fixed")
    for name, value in {"hp_wastegate_pwm": DUTY, **start}.items():
        dae.set(name, value)
    model = dae.create("model", ["x", "u"], ["ode"])
    nominal = np.array([dae.nominal(name) for name in dae.x()])
    x, u = ca.MX.sym("x", len(nominal)), ca.MX.sym("u", len(inputs))
    ordered = ca.vertcat(*(u[inputs.index(name)] for name in dae.u()))
    derivatives = ca.Function("derivatives", [x, u], [model(x * nominal, ordered) / nominal])
    # Settled at these values since the function was created.
    return Plant(derivatives, dae.x(), nominal, np.array(dae.get(dae.x())) / nominal)
