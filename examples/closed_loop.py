"""Couples plant and controller with FMPy: the boost reference steps of the paper's Fig. 13.

python examples/closed_loop.py [--plot FILE]
"""

import argparse

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave


class FMU2ByName(FMU2Slave):
    """An FMU in initialization mode, its variables by name."""

    def __init__(self, name):
        description = read_model_description(f"target/fmu/{name}.fmu")
        folder = extract(f"target/fmu/{name}.fmu")
        super().__init__(guid=description.guid, modelIdentifier=name, unzipDirectory=folder)
        self.variables = {v.name: v for v in description.modelVariables}
        self.instantiate()
        self.setupExperiment(startTime=0.0)
        self.enterInitializationMode()

    def get(self, names):
        return self.getReal([self.variables[name].valueReference for name in names])

    def set(self, names, values):
        self.setReal([self.variables[name].valueReference for name in names], values)

    def named(self, causality):
        return {name for name, v in self.variables.items() if v.causality == causality}


controller, plant = FMU2ByName("BoostController"), FMU2ByName("BoostPlant")
commands = controller.named("output") & plant.named("input")
measurements = plant.named("output") & controller.named("input")
steps = {0: 125, 5: 135, 15: 150, 25: 170, 38: 185, 52: 170, 64: 150, 76: 135, 88: 125, 100: 145, 112: 125}

plant.set(commands, controller.get(commands))  # at rest at the controller's outputs
controller.exitInitializationMode()
plant.exitInitializationMode()

h, rows = 1 / 80, []
for i in range(round(124 / h)):
    reference = 1e3 * [kilopascal for time, kilopascal in steps.items() if time <= i * h][-1]
    controller.set(["boost_reference"], [reference])
    controller.set(measurements, plant.get(measurements))
    controller.doStep(i * h, h)
    plant.set(commands, controller.get(commands))
    plant.doStep(i * h, h)
    boost, duty = plant.get(["boost_pressure"]) + controller.get(["hp_wastegate_pwm"])
    rows.append([(i + 1) * h, reference, boost, duty])
print(f"boost pressure {boost / 1e3:.2f} kPa, reference {reference / 1e3:.2f} kPa")


def plot(file):
    """Draws reference, boost pressure and duty."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    time, reference, boost, duty = zip(*rows, strict=True)
    plt.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    figure, (upper, lower) = plt.subplots(2, sharex=True, figsize=(9, 5), height_ratios=[2, 1])
    upper.step(time, [p / 1e3 for p in reference], where="pre", color="0.45", lw=1.2, label="reference")
    upper.plot(time, [p / 1e3 for p in boost], color="tab:blue", lw=1.8, label="boost pressure")
    upper.set_ylabel("pressure (kPa)")
    upper.legend(loc="upper left", frameon=False)
    lower.step(time, duty, where="pre", color="tab:orange", lw=1.2)
    lower.set(ylabel="wastegate duty (%)", xlabel="time (s)", xlim=(0, time[-1]))
    for axes in (upper, lower):
        axes.grid(color="0.9")
        axes.set_axisbelow(True)
    figure.align_ylabels()
    figure.tight_layout()
    figure.savefig(file, dpi=110, metadata={"Software": None} if str(file).endswith(".png") else None)
    print(f"wrote {file}")


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--plot", metavar="FILE", help="plot the run to a PNG or SVG file")
    if file := arguments.parse_args().plot:
        plot(file)
