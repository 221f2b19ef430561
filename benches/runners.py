#!/usr/bin/env python3
"""Prints what `cargo fmu simulate`, FMPy and fmusim make of the same FMUs: the table of docs/simulate.md.
Then it prints their processor time for some runs in ms: the least of five times, all processes included.

python3 benches/runners.py PYTHON FMUSIM

PYTHON is an interpreter with FMPy, FMUSIM the program (github.com/modelica/fmusim). Exports templates, which
takes a minute or two. A run counts if it ends with status 0 and its record is right.
"""

from __future__ import annotations

import csv
import json
import math
import os
import re
import resource
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
COMMAND = TARGET / "release" / "cargo-fmu"

SECONDS = 60
"""A run that takes longer has failed."""

RUNS = 5
"""The runs of which the least processor time counts."""

OUTPUTS = 20_000

Columns = dict[str, list[str]]

FMPY = """
import json, sys
from fmpy import simulate_fmu
from fmpy.util import read_csv, write_csv
path, out, options, *inputs = sys.argv[1:]
data = read_csv(inputs[0]) if inputs else None
write_csv(out, simulate_fmu(path, input=data, **json.loads(options)))
"""


@dataclass
class Trial:
    """A run, and whether its record is right."""

    title: str
    fmu: Path
    is_right: Callable[[Columns], bool]
    interface: str = "cs"
    stop: float | None = None
    step: float | None = None
    values: dict[str, str | list[str]] = field(default_factory=dict)
    record: list[str] = field(default_factory=list)
    inputs: str = ""


def must(*words: object, folder: Path = ROOT, **environment: str) -> None:
    """A command that must succeed; its output is of interest if it fails."""
    words = tuple(str(word) for word in words)
    variables = {**os.environ, **environment}
    done = subprocess.run(words, cwd=folder, env=variables, capture_output=True, check=False)
    if done.returncode != 0:
        raise SystemExit(done.stderr.decode())


def text(value: str | list[str]) -> str:
    return value if isinstance(value, str) else " ".join(value)


def ours(trial: Trial, out: Path, data: Path | None) -> list[object]:
    words: list[object] = [
        COMMAND,
        "simulate",
        trial.fmu,
        "--out",
        out,
        "--no-units",
        "--interface",
        trial.interface,
    ]
    words += [] if trial.stop is None else ["--stop-time", trial.stop]
    words += [] if trial.step is None else ["--step", trial.step]
    words += [f"--set={name}={text(value)}" for name, value in trial.values.items()]
    words += [f"--record={','.join(trial.record)}"] if trial.record else []
    return words + ([] if data is None else ["--input", data])


def fmusim(program: str, trial: Trial, out: Path, data: Path | None) -> list[object]:
    words: list[object] = [
        program,
        "simulate",
        trial.fmu,
        "--output-file",
        out,
        "--interface-type",
        trial.interface,
    ]
    words += [] if trial.stop is None else ["--stop-time", trial.stop]
    words += [] if trial.step is None else ["--output-interval", trial.step]
    words += [f"--start-value={name}={text(value)}" for name, value in trial.values.items()]
    # Its CVode is of a SUNDIALS that is not to be had everywhere.
    words += ["--solver", "euler"] if trial.interface == "me" else []
    words += [f"--output-variable={name}" for name in trial.record]
    return words + ([] if data is None else ["--input-file", data])


def fmpy(python: str, trial: Trial, out: Path, data: Path | None) -> list[object]:
    interface = {"cs": "CoSimulation", "me": "ModelExchange"}[trial.interface]
    options = {"fmi_type": interface, "start_values": trial.values}
    options |= {} if trial.stop is None else {"stop_time": trial.stop}
    options |= {} if trial.step is None else {"output_interval": trial.step, "step_size": trial.step}
    options |= {"output": trial.record} if trial.record else {}
    return [python, "-c", FMPY, trial.fmu, out, json.dumps(options), *([] if data is None else [data])]


def judge(trial: Trial, words: Callable[[Trial, Path, Path | None], list[object]]) -> str:
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "record.csv"
        data = Path(name) / "inputs.csv" if trial.inputs else None
        if data is not None:
            data.write_text(trial.inputs)
        try:
            command = [str(word) for word in words(trial, out, data)]
            done = subprocess.run(command, cwd=ROOT, capture_output=True, timeout=SECONDS, check=False)
        except subprocess.TimeoutExpired:
            return "no end"
        if done.returncode != 0:
            return "crashes" if done.returncode < 0 else "refused"
        if not out.exists():
            return "wrong"
        with out.open(encoding="utf-8", newline="") as text:
            names, *rows = csv.reader(text)
    columns = {
        name.strip('"'): list(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)
    }
    try:
        return "yes" if trial.is_right(columns) else "wrong"
    except (IndexError, KeyError, StopIteration, ValueError):
        return "wrong"


def milliseconds(trial: Trial, words: Callable[[Trial, Path, Path | None], list[object]]) -> str:
    """The processor time of a run; none if it fails."""
    if judge(trial, words) != "yes":
        return "-"
    times = []
    with tempfile.TemporaryDirectory() as name:
        command = [str(word) for word in words(trial, Path(name) / "record.csv", None)]
        for _ in range(RUNS):
            begin = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
            end = resource.getrusage(resource.RUSAGE_CHILDREN)
            times.append(end.ru_utime + end.ru_stime - begin.ru_utime - begin.ru_stime)
    return f"{1000 * min(times):.0f}"


def changed(fmu: Path, name: str, change: Callable[[str, bytes], tuple[str, bytes]]) -> Path:
    """A copy of an FMU with other entries."""
    copy = fmu.with_name(f"{name}.fmu")
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(copy, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.namelist():
            new.writestr(*change(entry, old.read(entry)))
    return copy


def described(change: Callable[[str], bytes]) -> Callable[[str, bytes], tuple[str, bytes]]:
    """A change of the description alone."""
    return lambda entry, data: (entry, change(data.decode()) if entry == "modelDescription.xml" else data)


def last(name: str, expected: float, within: float = 1e-3) -> Callable[[Columns], bool]:
    return lambda columns: abs(float(columns[name][-1]) - expected) <= within


def time_of(columns: Columns) -> list[float]:
    return [float(time) for time in next(iter(columns.values()))]


def ends_at(stop: float) -> Callable[[Columns], bool]:
    return lambda columns: abs(time_of(columns)[-1] - stop) < 1e-9


def begins_at(value: float) -> Callable[[Columns], bool]:
    def begins(columns: Columns) -> bool:
        _, *others = columns.values()
        numbers = [float(number) for column in others for number in column[0].split()]
        return len(numbers) == 100 and set(numbers) == {value}

    return begins


def ticks(columns: Columns) -> bool:
    """The integral part grows at each of a hundred samples."""
    return len(set(columns["voltage"])) > 90


def hide_outputs(text: str) -> bytes:
    """The state becomes a local variable."""
    text = re.sub("<Outputs>.*?</Outputs>", "", text, flags=re.DOTALL)
    return text.replace('causality="output"', 'causality="local"').encode()


def has_events(columns: Columns) -> bool:
    times = time_of(columns)
    return len(set(times)) < len(times)


def trials(fmus: dict[str, Path]) -> list[Trial]:
    decay, decay3, ball, feedthrough = (fmus[name] for name in ("decay", "decay3", "ball", "feedthrough"))
    decayed = last("x", math.exp(-1.0))
    without_outputs = changed(decay, "without_outputs", described(hide_outputs))
    without_stop = changed(
        decay, "without_stop", described(lambda text: re.sub("<DefaultExperiment[^>]*>", "", text).encode())
    )
    latin = changed(
        decay,
        "latin",
        described(
            lambda text: (
                text.replace("UTF-8", "ISO-8859-1").replace("Dahlquist", "Dahlquïst").encode("latin-1")
            )
        ),
    )
    dotted = changed(decay, "dotted", lambda entry, data: (f"./{entry}", data))
    ramp = "time,Float64_continuous_input\n0,0\n1,1\n"
    return [
        Trial("FMI 2.0, Co-Simulation", decay, decayed, stop=1),
        Trial("FMI 2.0, Model Exchange", decay, decayed, "me", stop=1, step=0.001),
        Trial("FMI 3.0, Co-Simulation", decay3, decayed, stop=1),
        Trial("FMI 3.0, Model Exchange", decay3, decayed, "me", stop=1, step=0.001),
        Trial("Rows before and after events", ball, has_events, "me", stop=1),
        Trial("Periodic clocks of FMI 3.0", fmus["cascade"], ticks, stop=0.1),
        Trial(
            "An array's start as a whole",
            fmus["diffusion"],
            begins_at(350.0),
            stop=1,
            values={"T": 100 * ["350"]},
        ),
        Trial(
            "A start value with a unit", decay, last("x", math.exp(-3.6)), stop=3600, values={"k": "3.6 1/h"}
        ),
        Trial(
            "Strings in the record",
            feedthrough,
            lambda columns: columns["String_output"][-1] == "word",
            stop=1,
            values={"String_input": "word"},
            record=["String_output"],
        ),
        Trial(
            "Inputs from a CSV file",
            feedthrough,
            last("Float64_continuous_output", 1.0, within=0.15),
            stop=1,
            inputs=ramp,
        ),
        Trial("A last step that is shorter", decay, ends_at(1.0), stop=1, step=0.3),
        Trial("No stop time in the FMU", without_stop, ends_at(1.0)),
        Trial("An FMU without outputs", without_outputs, decayed, stop=1),
        Trial("A description in ISO-8859-1", latin, decayed, stop=1),
        Trial("Entries that begin with `./`", dotted, decayed, stop=1),
        Trial("Model Exchange of 3,000 states", fmus["plate"], ends_at(1.0), "me", stop=1),
    ]


def widened(text: str) -> bytes:
    """With 20,000 outputs, which all have the value of the first one."""
    (reference,) = re.findall(r'name="x" valueReference="(\d+)"', text)
    names = range(OUTPUTS)
    first = text.count("<ScalarVariable ") + 1
    known = f'valueReference="{reference}" causality="output"'
    outputs = "".join(
        f'<ScalarVariable name="y{number}" {known}><Real/></ScalarVariable>' for number in names
    )
    unknowns = "".join(f'<Unknown index="{first + number}"/>' for number in names)
    text = text.replace("</ModelVariables>", f"{outputs}</ModelVariables>")
    for ending in ("</Outputs>", "</InitialUnknowns>"):
        text = text.replace(ending, unknowns + ending)
    return text.encode()


def timed(fmus: dict[str, Path]) -> list[Trial]:
    decay = fmus["decay"]
    decayed = last("x", math.exp(-1.0))
    wide = changed(decay, "wide", described(widened))
    return [
        Trial("Start-up", decay, decayed, stop=1),
        Trial("100,000 rows", decay, decayed, stop=1, step=1e-5),
        Trial("20,000 outputs", wide, last(f"y{OUTPUTS - 1}", math.exp(-1.0)), stop=1, step=0.1),
        Trial("Model Exchange of 3,000 states", fmus["plate"], ends_at(1.0), "me", stop=1),
    ]


def export(folder: Path, name: str, template: str, version: int, states: int | None = None) -> Path:
    """The FMU of a template."""
    package = folder / name
    must(COMMAND, "new", package, "--template", template, folder=folder)
    if states is not None:
        text = (package / "model.json").read_text()
        (package / "model.json").write_text(text.replace('"start": 100,', f'"start": {states},', 1))
    options = ["--fmi", version, "--interfaces", "cs,me", "--profile", "dev", "--out", folder / "fmu"]
    must(COMMAND, "export", *options, folder=package, CARGO_TARGET_DIR=str(folder / "target"))
    return folder / "fmu" / ("fmi3" if version == 3 else "") / f"{name}.fmu"


def main() -> None:
    python, program = sys.argv[1:]
    must("cargo", "build", "--release", "--locked", "--package", "cargo-fmu")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        models = [
            ("decay", "dahlquist", 2, None),
            ("decay3", "dahlquist", 3, None),
            ("ball", "bouncing_ball", 2, None),
            ("feedthrough", "feedthrough", 2, None),
            ("cascade", "cascade", 3, None),
            ("diffusion", "diffusion", 3, None),
            ("plate", "diffusion", 3, 3000),
        ]
        fmus = {model: export(folder, model, *rest) for model, *rest in models}
        runners = (ours, partial(fmpy, python), partial(fmusim, program))
        for heading, rows, measure in (("", trials(fmus), judge), ("ms", timed(fmus), milliseconds)):
            print(f"\n| {heading} | `cargo fmu` | FMPy | fmusim |\n|---|---|---|---|")
            for trial in rows:
                found = [measure(trial, words) for words in runners]
                print(f"| {trial.title} | {' | '.join(found)} |", flush=True)


if __name__ == "__main__":
    main()
