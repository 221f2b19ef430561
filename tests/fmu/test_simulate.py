"""`cargo fmu simulate` with the exported FMUs, against the master of these tests on FMPy, and the lines of
docs/simulate.md and docs/laboratory.md."""

from __future__ import annotations

import csv
import json
import os
import re
import shlex
import shutil
import subprocess
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from pythonfmu.builder import FmuBuilder

from fmu import ROOT, TARGET, Run, csv_lines, documents
from fmu.broken import copy_with
from fmu.experiments import (
    BOOST_STEPS,
    BOOST_STEPS_END,
    SCENARIOS,
    couple_running,
    staircase,
)
from fmu.master import Fmu, Make
from fmu.report import Report

LAG = """
from pythonfmu import Fmi2Slave

class Lag(Fmi2Slave):
    def do_step(self, time, size):
        return True
"""
"""A model for PythonFMU."""


def read(path: Path) -> dict[str, np.ndarray]:
    """A CSV file's columns by their names."""
    names, *rows = csv.reader(csv_lines(path))
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))


def assert_equal(found: np.ndarray, expected: np.ndarray, name: str) -> None:
    """Bit for bit."""
    different = np.ascontiguousarray(found).view(np.uint64) != np.ascontiguousarray(expected).view(np.uint64)
    assert not different.any(), f"{name}: first in row {np.argmax(different)}"


@pytest.mark.parametrize("stepping", ["in_turn", "at_once"])
def test_simulate_gets_the_numbers_of_fmpy(
    cargo_fmu: Run, exported: Path, plant: Make, controller: Make, tmp_path: Path, stepping: str
) -> None:
    """Fig. 13: every output at each communication point."""
    file = tmp_path / "steps.toml"
    text = (SCENARIOS / "figure_13.toml").read_text()
    file.write_text(f'stepping = "{stepping}"\n{text}')
    done = cargo_fmu(
        "simulate", file, "--fmus", exported, "--out", tmp_path, "--plot", tmp_path / "steps.html"
    )
    assert (done.returncode, done.stderr) == (0, "")
    found = read(tmp_path / "steps.csv")

    reference = staircase(*BOOST_STEPS)
    master = couple_running(
        plant(), controller(), inputs={"boost_reference": reference}, at_once=stepping == "at_once"
    )
    record = master.run(BOOST_STEPS_END)
    assert list(found) == ["time", "boost_reference", *list(record)[1:]]
    for name, expected in record.items():
        assert_equal(found[name], expected, name)
    assert_equal(
        found["boost_reference"], np.array([reference(time) for time in record["time"]]), "reference"
    )
    # The comparison would not detect constant columns.
    assert sum(np.ptp(column) > 0 for column in found.values()) > 10
    report = Report(tmp_path / "steps.html")
    # In kPa, and rounded to at most a ten-thousandth of the panel's range, which is below 200 kPa.
    drawn = report.line("boost_pressure")["y"]
    extremes = 1e-3 * np.array([found["boost_pressure"].min(), found["boost_pressure"].max()])
    assert [min(drawn), max(drawn)] == pytest.approx(extremes, abs=0.01)
    # What does not change is a line of text.
    changing = {name for name, column in found.items() if np.ptp(column) > 0} - {"time"}
    assert {line["name"] for plot in report.plots for line in plot["data"]} == changing


def test_noise_is_the_same_each_time_and_reaches_the_measurement_only(
    cargo_fmu: Run, exported: Path, tmp_path: Path
) -> None:
    text = (SCENARIOS / "figure_14.toml").read_text()
    records = []
    for seed in [1, 1, 2]:
        file = tmp_path / "noise.toml"
        file.write_text(f"{text}\n[noise]\nboost_pressure = {{ standard_deviation = 100, seed = {seed} }}\n")
        assert cargo_fmu("simulate", file, "--fmus", exported, "--out", tmp_path).returncode == 0
        records.append(read(tmp_path / "noise.csv"))
    assert_equal(records[0]["boost_pressure"], records[1]["boost_pressure"], "the same seed")
    assert (records[0]["hp_wastegate_pwm"] != records[2]["hp_wastegate_pwm"]).any()
    # The record has the plant's value: it changes by a fraction of the noise from sample to sample.
    assert np.std(np.diff(records[0]["boost_pressure"][400:])) < 50
    assert np.std(np.diff(records[0]["hp_wastegate_pwm"][400:])) > 0


def test_measurement_noise_is_in_the_record_alone(cargo_fmu: Run, exported: Path, tmp_path: Path) -> None:
    text = (SCENARIOS / "figure_14.toml").read_text()
    noise = "[measurement_noise]\nboost_pressure = { standard_deviation = 100, seed = 1 }\n"
    records = []
    for more in ["", noise, noise]:
        file = tmp_path / "measured.toml"
        file.write_text(f"{text}\n{more}")
        assert cargo_fmu("simulate", file, "--fmus", exported, "--out", tmp_path).returncode == 0
        records.append(read(tmp_path / "measured.csv"))
    exact, measured, again = records
    added = measured["boost_pressure"] - exact["boost_pressure"]
    # Within five standard errors.
    assert abs(added.mean()) < 5 * 100 / np.sqrt(len(added))
    assert abs(added.std() - 100) < 5 * 100 / np.sqrt(2 * len(added))
    assert_equal(measured["boost_pressure"], again["boost_pressure"], "the same seed")
    for name in set(exact) - {"boost_pressure"}:
        assert_equal(measured[name], exact[name], name)


ALONE = """
step = 0.125
start_time = {start}
stop_time = {stop}
[[fmu]]
name = "alone"
file = "{file}"
{more}
"""
"""An FMU alone."""


def test_failing_step_ends_with_time_and_the_fmus_message(cargo_fmu: Run, tmp_path: Path) -> None:
    shutil.copy(TARGET / "test-model" / "cs" / "TestModel.fmu", tmp_path)
    more = 'run_in = { duration = 1, after = { "fault.place" = "step", "fault.manner" = "error" } }'
    file = tmp_path / "alone.toml"
    # Not all outputs of this FMU are numbers.
    file.write_text('record = ["output"]' + ALONE.format(start=5, stop=6, file="TestModel.fmu", more=more))
    out = tmp_path / "alone.csv"
    done = cargo_fmu("simulate", file, "--fmus", tmp_path, "--out", out)
    assert done.returncode == 2
    assert done.stderr.startswith("error: alone: fmi2DoStep returned fmi2Error at 5 s\n")
    assert "the model's own error" in done.stderr
    assert not out.exists()


def test_a_description_in_another_encoding_is_read_as_it_declares(cargo_fmu: Run, tmp_path: Path) -> None:
    """The standard asks for UTF-8, but some tools write ISO-8859-1."""
    source = TARGET / "names-model" / "names.fmu"
    file = tmp_path / "latin.fmu"
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(file, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                text = content.decode().replace('encoding="UTF-8"', 'encoding="ISO-8859-1"')
                content = text.encode("iso-8859-1", errors="xmlcharrefreplace")
                assert b"gr\xf6\xdfe" in content
            new.writestr(name, content)
    out = tmp_path / "latin.csv"
    options = ["--set", "größe=5", "--tolerance", "none", "--record", "größe", "--out", out, "--no-units"]
    done = cargo_fmu("simulate", file, *options)
    assert (done.returncode, done.stderr) == (0, "")
    assert out.read_text(encoding="utf-8").splitlines()[:2] == ["time,größe", "0.0,5.0"]


def test_a_library_that_cannot_be_loaded_is_reported_with_the_reason(cargo_fmu: Run, tmp_path: Path) -> None:
    """PythonFMU expects Python's library in the host."""
    source = tmp_path / "lag.py"
    source.write_text(LAG)
    FmuBuilder.build_FMU(source, dest=tmp_path)
    file = tmp_path / "lag.toml"
    file.write_text(ALONE.format(start=0, stop=2, file="Lag.fmu", more=""))
    done = cargo_fmu("simulate", file, "--fmus", tmp_path, "--out", tmp_path)
    assert done.returncode == 2
    place = f"{file}, line 7, fmu[1].file: cannot import {tmp_path / 'Lag.fmu'}"
    assert done.stderr.startswith(f"error: {place}: its library cannot be loaded: ")
    assert "undefined symbol: _Py" in done.stderr.removeprefix(f"error: {place}")
    # The remedy.
    assert "put LD_PRELOAD=libpython3" in done.stderr


def refusal(cargo_fmu: Run, tmp_path: Path, fmus: Path, text: str) -> str:
    """The message for a scenario, without the file's folder."""
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    done = cargo_fmu("simulate", file, "--fmus", fmus, "--out", tmp_path)
    assert done.returncode == 2
    assert not (tmp_path / "wrong.csv").exists()
    return done.stderr.replace(f"{file}", "wrong.toml").replace(f"{fmus}/", "")


FIGURE_13 = (SCENARIOS / "figure_13.toml").read_text()

RUN_IN = r"line \d+, fmu\[2\].run_in.during"

WRONG = [
    (
        '"tank.frozen" = true',
        '"tank.frosen" = true',
        RUN_IN + r'."tank.frosen": BoostPlant.fmu has no variable tank.frosen; did you mean tank.frozen\?',
    ),
    (
        "[inputs.boost_reference]",
        "[inputs]\nboost_pressure = 1e5\n[inputs.boost_reference]",
        r"line \d+, inputs.boost_pressure: controller gets boost_pressure from another FMU",
    ),
    (
        "step = 0.0125",
        "step = 0.0125\nrecord = ['engine:boost_pressure']",
        r"line \d+, record\[1\]: no FMU is named engine",
    ),
    (
        "step = 0.0125",
        "step = 0.0125\nnoise = { boost = { standard_deviation = 1 } }",
        r"line \d+, noise.boost: no FMU gets boost from another",
    ),
    (
        "step = 0.0125",
        "step = 0.0125\nmeasurement_noise = { boost_presure = { standard_deviation = 1 } }",
        r"line \d+, measurement_noise.boost_presure: boost_presure is not recorded; "
        r"did you mean boost_pressure\?",
    ),
]
"""A text in the scenario of Fig. 13, its replacement, and the message."""


@pytest.mark.parametrize(("old", "new", "expected"), WRONG, ids=[new for _, new, _ in WRONG])
def test_an_error_in_a_scenario_is_reported_with_its_place(
    cargo_fmu: Run, exported: Path, tmp_path: Path, old: str, new: str, expected: str
) -> None:
    assert FIGURE_13.count(old) >= 1
    message = refusal(cargo_fmu, tmp_path, exported, FIGURE_13.replace(old, new, 1))
    assert re.match(f"error: wrong.toml, {expected}", message), message


def test_a_refused_value_is_reported_with_its_place_and_the_fmus_message(
    cargo_fmu: Run, exported: Path, tmp_path: Path
) -> None:
    text = FIGURE_13.replace(
        'file = "BoostController.fmu"', 'file = "BoostController.fmu"\nvalues = { lambda = -1 }'
    )
    message = refusal(cargo_fmu, tmp_path, exported, text)
    assert re.match(
        r"error: wrong.toml, line \d+, fmu\[1\].values.lambda: controller: fmi2SetReal of lambda ", message
    )
    assert "lambda" in message.splitlines()[1]
    assert "-1" in message.splitlines()[1]


def test_units_that_differ_are_converted(cargo_fmu: Run, exported: Path, tmp_path: Path) -> None:
    """A plant whose unit Pa is 0.8 Pa: the controller reaches its reference, with another number."""
    fmus = tmp_path / "fmus"
    fmus.mkdir()
    shutil.copy(exported / "BoostController.fmu", fmus)
    pattern = r'(<Unit name="Pa">\s*<BaseUnit [^/]*)/>'
    copy_with(exported / "BoostPlant.fmu", fmus / "BoostPlant.fmu", pattern, r'\1 factor="0.8"/>')
    file = tmp_path / "units.toml"
    file.write_text(FIGURE_13.replace("stop_time = 124.0", "stop_time = 5.0"))
    done = cargo_fmu("simulate", file, "--fmus", fmus, "--out", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    found = read(tmp_path / "units.csv")
    # The tuning suits a plant of 0.8 times the gain: nine tenths of the step are reached.
    first, last = (0.8 * found["boost_pressure"][row] - 125e3 for row in (0, -1))
    assert abs(last) < 0.1 * abs(first)

    copy_with(exported / "BoostPlant.fmu", fmus / "BoostPlant.fmu", pattern, r'\1 mol="1"/>')
    message = refusal(cargo_fmu, tmp_path, fmus, FIGURE_13)
    what = r"plant:(\w+) to controller:\1: the unit Pa does not convert to Pa"
    assert re.match(rf"error: wrong.toml, line \d+, fmu\[1\].file: {what}", message), message

    # A common signal would have different values in both.
    pattern = r'(<Unit name="rpm">\s*<BaseUnit [^/]*factor=)"[^"]*"'
    copy_with(exported / "BoostPlant.fmu", fmus / "BoostPlant.fmu", pattern, r'\1"0.1"')
    message = refusal(cargo_fmu, tmp_path, fmus, FIGURE_13 + "\n[inputs.engine_speed]\nsteps = [[0, 1500]]\n")
    what = "controller:engine_speed is in rpm, plant:engine_speed in rpm: give each its own signal"
    assert what in message


def test_system_runs_as_the_scenario_of_its_fmus(cargo_fmu: Run, exported: Path, tmp_path: Path) -> None:
    """Boost.ssp, controller first: the numbers of a scenario with the same inputs."""
    scenario_file = tmp_path / "scenario.toml"
    members = "".join(
        f'[[fmu]]\nname = "{name}"\nfile = "{name}.fmu"\n' for name in ("BoostController", "BoostPlant")
    )
    scenario_file.write_text(
        f"step = 0.0125\nstop_time = 5\n{members}[inputs]\nboost_reference = 150e3\nsupply_voltage = 11.5\n"
    )
    assert cargo_fmu("simulate", scenario_file, "--fmus", exported, "--out", tmp_path).returncode == 0
    out = tmp_path / "system.parquet"
    values = ["--set", "boost_reference=150 kPa", "--set", "supply_voltage=11.5"]
    done = cargo_fmu("simulate", exported / "Boost.ssp", *values, "--stop-time", "5", "--out", out)
    assert (done.returncode, done.stderr) == (0, "")
    expected = read(tmp_path / "scenario.csv")
    table = pyarrow.parquet.read_table(out)
    assert len(expected["time"]) == len(table) == 401
    for name in expected:
        assert_equal(table[name].to_numpy(), expected[name], name)
    units = json.loads(pyarrow.parquet.read_metadata(out).metadata[b"units"])
    assert (units["boost_pressure"], units["hp_wastegate_pwm"], units["time"]) == ("Pa", "%", "s")


def test_one_fmu_runs_with_its_default_experiment(
    cargo_fmu: Run, exported: Path, tmp_path: Path, plant_fmu: Fmu
) -> None:
    out = tmp_path / "plant.csv"
    done = cargo_fmu("simulate", exported / "BoostPlant.fmu", "--set", "hp_wastegate_pwm=60", "--out", out)
    assert (done.returncode, done.stderr) == (0, "")
    found = read(out)
    assert found["time"][-1] == float(plant_fmu.description.defaultExperiment.stopTime)
    assert set(found["hp_wastegate_pwm"]) == {60.0}
    assert set(plant_fmu.named("output")) <= set(found)
    names, units, _ = out.read_text().split("\n", 2)
    units = dict(zip(names.split(","), units.removeprefix("# ").split(","), strict=True))
    assert (units["time"], units["hp_wastegate_pwm"], units["boost_pressure"]) == ("s", "%", "Pa")


def test_an_fmu_that_the_scenario_does_not_have_is_refused(
    cargo_fmu: Run, exported: Path, tmp_path: Path
) -> None:
    file, plant = SCENARIOS / "figure_1.toml", exported / "BoostPlant.fmu"
    done = cargo_fmu("simulate", file, "--fmu", f"engine={plant}", "--out", tmp_path)
    assert done.returncode == 2
    assert done.stderr.endswith("has no FMU engine; it has plant\n")


SIMULATE, LABORATORY = [(ROOT / "docs" / name).read_text() for name in ("simulate.md", "laboratory.md")]

LINES = documents.lines(SIMULATE) + documents.lines(LABORATORY)

LAB_LINES = [line for line in LINES if line.startswith(("cargo fmu ", "target/release/boost-lab "))]

FOREIGN_LINES = [line for line in LAB_LINES if "target/foreign/" in line]
"""Those with FMUs from other tools, which test_foreign.py runs."""


@pytest.fixture
def clone(exported: Path, tmp_path: Path) -> Path:
    """A folder like the repository's, with cargo's target folder linked."""
    (tmp_path / "target").mkdir()
    (tmp_path / "target" / "fmu").symlink_to(exported)
    (tmp_path / "target" / "release").symlink_to(TARGET / "debug")
    for folder in ["boost", "examples", "parameters"]:
        (tmp_path / folder).symlink_to(ROOT / folder)
    return tmp_path


def test_every_line_of_the_documents_is_run() -> None:
    others = [line for line in LINES if line not in LAB_LINES]
    # As a user types them, tests/walk runs both; tests/run builds the same commands to test them.
    assert others == ["cargo run -- export", "cargo build --release --package boost-lab"]
    assert len(LAB_LINES) - len(FOREIGN_LINES) == 14


def outputs(line: str) -> list[str]:
    """The output paths of a line."""
    return re.findall(r"(?<=--out |-plot )\S+", line)


@pytest.mark.parametrize("line", [line for line in LAB_LINES if line not in FOREIGN_LINES])
def test_line_of_the_documents(clone: Path, line: str) -> None:
    # `tests/run` builds `cargo fmu` here.
    environment = {
        **os.environ,
        "PATH": os.pathsep.join([str(TARGET.resolve() / "debug"), os.environ["PATH"]]),
    }
    # Another line may write its inputs.
    makers = [other for other in LAB_LINES if set(outputs(other)) & set(line.split()) - set(outputs(line))]
    for each in [*makers, line]:
        words = shlex.split(each)
        done = subprocess.run(words, cwd=clone, env=environment, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
    # The command prints each file that it wrote, and the document the first.
    written = [clone / word for word in done.stdout.split() if word.startswith("target/")]
    assert written
    for file in written:
        assert file.stat().st_size > 500
    for path in outputs(line):
        assert (clone / path).exists()


def test_scenario_of_the_document(cargo_fmu: Run, clone: Path) -> None:
    text, *_ = documents.blocks(SIMULATE, "toml")
    folder = clone / "mine"
    folder.mkdir()
    (folder / "mine.toml").write_text(text)
    done = cargo_fmu("simulate", folder / "mine.toml", "--fmus", clone / "target" / "fmu", "--out", folder)
    assert (done.returncode, done.stderr) == (0, "")
    record = read(folder / "mine.csv")
    assert list(record) == ["time", *tomllib.loads(text)["record"]]
    assert record["time"][-1] == 30.0
    assert (record["boost_reference"][0], record["boost_reference"][-1]) == (125e3, 150e3)
    assert abs(record["boost_pressure"][-1] - 150e3) < 2e3
    assert record["controller:engine_speed"][-1] == 2000.0


def test_study_of_the_document(cargo_fmu: Run, clone: Path) -> None:
    *_, text = documents.blocks(SIMULATE, "toml")
    folder = clone / "mine"
    folder.mkdir()
    assert "runs = 200" in text
    (folder / "mine.toml").write_text(text.replace("runs = 200", "runs = 2"))
    done = cargo_fmu(
        "sweep", folder / "mine.toml", "--fmus", clone / "target" / "fmu", "--out", folder / "out"
    )
    assert (done.returncode, done.stderr) == (0, "")
    runs = list(csv.DictReader(csv_lines(folder / "out" / "results.csv")))
    assert [run["run"] for run in runs] == ["0", "1"]
    study = tomllib.loads(text)
    for run in runs:
        for name, limits in study["latin_hypercube"]["ranges"].items():
            assert limits["from"] <= float(run[name]) <= limits["to"]
        assert all(np.isfinite(float(run[name])) for name in study["measures"])
        assert run["error"] == ""
    records = sorted(file.name for file in (folder / "out" / "records").iterdir())
    assert records == ["0.csv", "1.csv"]


@pytest.mark.parametrize(
    ("sources", "least"),
    [
        (
            [f"fmu-master/src/scenario/{name}.rs" for name in ("mod", "signal")]
            + ["fmu-package/src/connection.rs"],
            35,
        ),
        ([f"fmu-run/src/sweep/{name}.rs" for name in ("mod", "design", "measures")], 15),
    ],
)
def test_document_has_every_key(sources: list[str], least: int) -> None:
    """The keys in the parser's source."""
    source = "".join((ROOT / "crates" / name).read_text() for name in sources)
    keys = set(re.findall(r'(?:optional|required|number|time)\(\s*"(\w+)"', source))
    for variants in re.findall(r"^enum (?:Statistic|Quality) \{([^}]*)\}", source, re.MULTILINE):
        keys |= {re.sub(r"\B[A-Z]", r"_\g<0>", name).lower() for name in re.findall(r"\w+", variants)}
    assert len(keys) > least
    for key in keys:
        assert re.search(rf"\b{key}\b", SIMULATE), key
