"""A parameter study of both FMUs on Dask: like `cargo fmu sweep`, on any number of machines.

python examples/sweep_with_dask.py [STUDY.toml] [--fmus DIR] [--out FILE.csv] [--scheduler ADDRESS]

It supports grids of listed values as designs, and numbers and steps as signals. The master is like
examples/closed_loop.py and steps in its order, so the results are bit-identical. Dask repeats the
runs of a lost worker on the others. The FMU folder must have the same path on all machines.
"""

import argparse
import csv
import itertools
import tomllib
from ctypes import byref
from functools import cache
from pathlib import Path

from dask.distributed import Client, LocalCluster, as_completed
from fmpy import calloc, extract, free, read_model_description
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.logging import addLoggerProxy

MESSAGES = []
"""The messages of this process's instances in the current run."""


@fmi2CallbackLoggerTYPE
def log(environment, name, status, category, message):
    MESSAGES.append(message.decode())


@cache
def imported(file):
    """An FMU's description and its folder, extracted once per process."""
    return read_model_description(file), extract(file)


class FMU2ByName(FMU2Slave):
    """An instance of an FMU with access by name. FMPy requires the class's name to begin with FMU2."""

    def __init__(self, file, name):
        description, folder = imported(file)
        identifier = description.coSimulation.modelIdentifier
        super().__init__(
            guid=description.guid, modelIdentifier=identifier, unzipDirectory=folder, instanceName=name
        )
        self.variables = {v.name: v for v in description.modelVariables}
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = log
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(byref(callbacks))
        self.instantiate(callbacks=callbacks)

    def named(self, causality):
        return [name for name, v in self.variables.items() if v.causality == causality]

    def get(self, names):
        return [self.get_one(name) for name in names]

    def get_one(self, name):
        variable = self.variables[name]
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        return getattr(self, f"get{kind}")([variable.valueReference])[0]

    def set(self, values):
        for name, value in values.items():
            variable = self.variables[name]
            if variable.type == "Enumeration" and isinstance(value, str):
                value = next(int(item.value) for item in variable.declaredType.items if item.name == value)
            kind = "Integer" if variable.type == "Enumeration" else variable.type
            getattr(self, f"set{kind}")([variable.valueReference], [value])


def signal_at(signal, time):
    """A constant, or steps; with a tolerance for the rounding of communication points."""
    if not isinstance(signal, dict):
        return signal
    steps = signal["steps"]
    return [value for begin, value in steps if begin <= time + 1e-9 or begin == steps[0][0]][-1]


class Run:
    """The FMUs of a scenario, coupled by equal names."""

    def __init__(self, scenario, fmus):
        self.step, self.signals = scenario["step"], scenario.get("inputs", {})
        self.start = scenario.get("start_time", 0.0)
        self.members = [(each, FMU2ByName(fmus / each["file"], each["name"])) for each in scenario["fmu"]]

    def free(self):
        for _, fmu in self.members:
            fmu.freeInstance()

    def begin(self, values):
        """Initializes all: first those without a run-in, together; then the others, with their outputs.
        `values` replace the scenario's, by the FMU's name, a colon and the variable's name."""
        for member, fmu in self.members:
            prefix, run_in = member["name"] + ":", member.get("run_in", {})
            own = {key.removeprefix(prefix): v for key, v in values.items() if key.startswith(prefix)}
            fmu.setupExperiment(startTime=self.start - run_in.get("duration", 0.0))
            fmu.set(member.get("values", {}) | own)
            fmu.set(run_in.get("during", {}))
            self.drive(fmu, self.start)
        prompt = [fmu for member, fmu in self.members if "run_in" not in member]
        for fmu in prompt:
            fmu.enterInitializationMode()
        for _, fmu in itertools.product(range(2), prompt):
            self.take(fmu, prompt)
        for fmu in prompt:
            fmu.exitInitializationMode()
        for member, fmu in self.members:
            if run_in := member.get("run_in"):
                fmu.enterInitializationMode()
                self.take(fmu, prompt)
                fmu.exitInitializationMode()
                begin = self.start - run_in["duration"]
                for i in range(round(run_in["duration"] / self.step)):
                    fmu.doStep(begin + i * self.step, self.step)
                fmu.set(run_in.get("after", {}))

    def drive(self, fmu, time):
        inputs = fmu.named("input")
        fmu.set({name: signal_at(s, time) for name, s in self.signals.items() if name in inputs})

    def take(self, fmu, others):
        """Sets an instance's inputs to the others' outputs."""
        inputs = fmu.named("input")
        for other in others:
            if other is not fmu:
                names = [name for name in other.named("output") if name in inputs]
                fmu.set(dict(zip(names, other.get(names), strict=True)))

    def do_step(self, i):
        """In sequence, each with the new outputs of those before it."""
        time = self.start + i * self.step
        everyone = [fmu for _, fmu in self.members]
        for fmu in everyone:
            self.drive(fmu, time)
        for fmu in everyone:
            self.take(fmu, everyone)
            fmu.doStep(time, self.step)

    def value(self, name):
        """An output."""
        return next(fmu for _, fmu in self.members if name in fmu.named("output")).get_one(name)


def simulate(scenario, fmus, values, measures):
    """The measures of a run, and its error if it failed."""
    MESSAGES.clear()
    steps = round((scenario["stop_time"] - scenario.get("start_time", 0.0)) / scenario["step"])
    variables = {next(iter(measure.values())) for measure in measures.values()}
    run = Run(scenario, fmus)
    try:
        run.begin(values)
        times = [run.start]
        records = {name: [run.value(name)] for name in variables}
        for i in range(steps):
            run.do_step(i)
            times.append(run.start + (i + 1) * run.step)
            for name, record in records.items():
                record.append(run.value(name))
    except Exception as error:
        return {}, "\n".join([str(error), *MESSAGES])
    finally:
        run.free()
    signals = scenario.get("inputs", {})
    return {name: measured(measure, times, records, signals) for name, measure in measures.items()}, ""


def measured(measure, times, records, signals):
    """A measure of a run."""
    (kind, variable), *_ = measure.items()
    if kind in STATISTICS:
        begin, end = measure.get("from", times[0]), measure.get("to", times[-1])
        pairs = zip(times, records[variable], strict=True)
        return STATISTICS[kind]([value for t, value in pairs if begin - 1e-6 <= t <= end + 1e-6])
    steps = signals[measure["reference"]]["steps"]
    ends = [begin for begin, _ in steps[2:]] + [times[-1]]
    found = []
    for (_, before), (begin, after), end in zip(steps, steps[1:], ends, strict=False):
        pairs = zip(times, records[variable], strict=True)
        part = [(t, value) for t, value in pairs if begin - 1e-6 <= t <= end + 1e-6]
        found.append(STEPS[kind](part, before, after, begin))
    return max(value for value in found if value is not None)


def rise(part, before, after, begin):
    reached = [t for t, value in part if abs(value - after) <= 0.1 * abs(after - before)]
    return reached[0] - begin if reached else float("inf")


STATISTICS = {
    "final": lambda values: values[-1],
    "mean": lambda values: sum(values) / len(values),
    "minimum": min,
    "maximum": max,
}
STEPS = {
    "overshoot_up": lambda part, old, new, _: max(v for _, v in part) - new if new > old else None,
    "overshoot_down": lambda part, old, new, _: new - min(v for _, v in part) if new <= old else None,
    "rise_time": rise,
    "end_error": lambda part, old, new, _: abs(part[-1][1] - new),
}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", nargs="?", type=Path, default=Path(__file__).with_name("study.toml"))
    parser.add_argument("--fmus", type=Path, default=Path("target/fmu"))
    parser.add_argument("--out", type=Path, default=Path("results.csv"))
    parser.add_argument("--scheduler", help="Dask scheduler [default: two processes on this machine]")
    arguments = parser.parse_args()

    study = tomllib.loads(arguments.study.read_text())
    scenario = tomllib.loads((arguments.study.parent / study["scenario"]).read_text())
    parameters, measures = list(study["grid"]), study["measures"]
    points = list(itertools.product(*study["grid"].values()))

    cluster = arguments.scheduler or LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with Client(cluster) as client:
        # The workers import this file, so that each of them extracts the FMUs once.
        client.upload_file(__file__)
        import sweep_with_dask

        fmus = arguments.fmus.resolve()
        futures = {}
        for run, point in enumerate(points):
            values = dict(zip(parameters, point, strict=True))
            work = (sweep_with_dask.simulate, scenario, fmus, values, measures)
            futures[client.submit(*work, key=f"run-{run}")] = run
        results = {futures[future]: future.result() for future in as_completed(futures)}
    with arguments.out.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["run", *parameters, *measures, "error"])
        for run, point in enumerate(points):
            values, error = results[run]
            writer.writerow([run, *point, *[values.get(name, "") for name in measures], error])
    print(f"{arguments.out}  {len(points)} runs")


if __name__ == "__main__":
    main()
