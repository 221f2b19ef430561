"""Parameter studies: `cargo fmu sweep`, and the same study with FMPy on Dask."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from dask.distributed import Client, LocalCluster, Worker, WorkerPlugin

from fmu import ROOT, Run, csv_lines
from fmu.broken import copy_with
from fmu.resuming import finished, resume

SCENARIO = """
step = 0.0125
stop_time = 4.0

[[fmu]]
name = "controller"
file = "BoostController.fmu"

[[fmu]]
name = "plant"
file = "BoostPlant.fmu"

[fmu.run_in]
duration = 2.0
during = { "initialization.mode" = "running", "tank.frozen" = true }
after = { "tank.frozen" = false }

[inputs]
boost_reference.steps = [[0, 125e3], [1, 135e3], [2.5, 120e3]]
supply_voltage.steps = [[0, 12], [3, 11.1]]
"""

MEASURES = """
[measures]
up = { overshoot_up = "boost_pressure", reference = "boost_reference" }
down = { overshoot_down = "boost_pressure", reference = "boost_reference" }
rise = { rise_time = "boost_pressure", reference = "boost_reference" }
left = { end_error = "boost_pressure", reference = "boost_reference" }
peak = { maximum = "hp_wastegate_pwm", from = 0.5, to = 3 }
least = { minimum = "actuator_pressure" }
last = { final = "boost_pressure", to = 3.5 }
mean = { mean = "boost_pressure", from = 0.5 }
"""

GRID = """
[grid]
"plant:valve.time_constant" = [0.008, 0.04]
"controller:structure" = ["model_reference", "paper"]
"plant:tank.volume" = [1e-3, -1.0, 2e-3]
"""
"""Four of its twelve runs fail: the volume of a tank cannot be negative."""

FAILED_RUNS = 1
"""The exit status of a sweep with failed runs."""


def write_study(folder: Path, text: str, scenario: str = SCENARIO) -> Path:
    """A study and its scenario in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scenario.toml").write_text(scenario)
    study = folder / "study.toml"
    study.write_text(f'scenario = "scenario.toml"\n{text}')
    return study


def number(line: str) -> int:
    """The run of a line of the journal."""
    return json.loads(line)["finished"]["run"]


def rows(path: Path) -> list[dict[str, str]]:
    """A results file's rows."""
    return list(csv.DictReader(csv_lines(path)))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The study of most tests."""
    return write_study(tmp_path_factory.mktemp("sweep"), "records = true\n" + GRID + MEASURES)


@pytest.fixture(scope="module")
def results(cargo_fmu: Run, exported: Path, study: Path) -> Path:
    """The study's results from two workers, for comparison."""
    out = study.parent / "out"
    done = cargo_fmu("sweep", study, "--fmus", exported, "--out", out, "--workers", "2")
    assert done.returncode == FAILED_RUNS, done.stderr
    assert "12 runs, 4 failed" in done.stdout
    return out


def test_a_run_that_fails_is_a_row_with_the_message(results: Path) -> None:
    for row in rows(results / "results.csv"):
        fails = float(row["plant:tank.volume"]) < 0
        assert bool(row["error"]) == fails
        assert all((row[name] == "") == fails for name in ["up", "down", "rise", "left", "peak", "mean"])
        if fails:
            assert "plant: fmi2SetReal of tank.volume" in row["error"]
            assert " returned fmi2Error at " in row["error"] or " returned fmi2Discard at " in row["error"]
            # The FMU's message.
            assert "tank.volume" in row["error"].splitlines()[1]


def test_measures_are_those_of_the_records(results: Path) -> None:
    """Each record exists, and gives the same measures."""
    differing = set()
    for row in rows(results / "results.csv"):
        path = results / "records" / f"{row['run']}.csv"
        assert path.exists() == (row["error"] == "")
        if row["error"]:
            continue
        names, *values = csv.reader(csv_lines(path))
        record = dict(zip(names, np.array(values, dtype=float).T, strict=True))
        t, boost = record["time"], record["boost_pressure"]
        assert len(t) == 321
        first, second = (t >= 1 - 1e-9) & (t <= 2.5 + 1e-9), t >= 2.5 - 1e-9
        assert float(row["up"]) == boost[first].max() - 135e3
        assert float(row["down"]) == 120e3 - boost[second].min()
        within = [abs(boost - after) <= limit for after, limit in [(135e3, 1e3), (120e3, 1.5e3)]]
        rises = [
            t[part & near][0] - begin if (part & near).any() else np.inf
            for part, near, begin in zip([first, second], within, [1, 2.5], strict=True)
        ]
        assert row["rise"] == "" if np.isinf(max(rises)) else float(row["rise"]) == max(rises)
        assert float(row["left"]) == max(abs(boost[first][-1] - 135e3), abs(boost[-1] - 120e3))
        assert float(row["peak"]) == record["hp_wastegate_pwm"][(t >= 0.5) & (t <= 3)].max()
        assert float(row["least"]) == record["actuator_pressure"].min()
        assert float(row["last"]) == boost[280]
        # Another order of summation: 300 roundings of 2e5 Pa, 3e-11 Pa each.
        assert float(row["mean"]) == pytest.approx(boost[t >= 0.5].mean(), abs=1e-8)
        differing.add(row["last"])
    # The valve and the structure have an effect; the tank does not reach its limit.
    assert len(differing) >= 4


def test_parquet_holds_the_same_table(results: Path) -> None:
    table = pyarrow.parquet.read_table(results / "results.parquet").to_pylist()
    lines = rows(results / "results.csv")
    assert len(table) == len(lines)
    for cells, texts in zip(table, lines, strict=True):
        assert list(cells) == list(texts)
        for name, cell in cells.items():
            if cell is None:
                assert texts[name] == ""
            else:
                assert type(cell)(texts[name]) == cell, name
    kinds = {name: type(cell) for name, cell in table[0].items()}
    assert (kinds["run"], kinds["up"], kinds["controller:structure"]) == (int, float, str)


def test_results_do_not_depend_on_the_workers(
    cargo_fmu: Run, exported: Path, study: Path, results: Path, tmp_path: Path
) -> None:
    done = cargo_fmu("sweep", study, "--fmus", exported, "--out", tmp_path, "--workers", "1")
    assert done.returncode == FAILED_RUNS, done.stderr
    for name in ["results.csv", "results.parquet", "records/0.csv", "records/11.csv"]:
        assert (tmp_path / name).read_bytes() == (results / name).read_bytes(), name


def test_a_study_that_was_ended_is_resumed(
    cargo_fmu: Run, exported: Path, study: Path, results: Path, tmp_path: Path
) -> None:
    """That each run is in the journal once it is done is tested in crates/cargo-fmu/tests/running/main.rs."""
    (tmp_path / "records").mkdir()
    for line in finished(results / "journal.jsonl")[1][:3]:
        record = Path("records", f"{number(line)}.csv")
        if (results / record).exists():
            shutil.copy(results / record, tmp_path / record)
    files = ["results.csv", "results.parquet", "records/0.csv", "records/11.csv"]
    sweep = partial(cargo_fmu, "sweep", study, "--fmus", exported, "--out", tmp_path)
    done = resume(sweep, results, tmp_path, 3, files)
    assert done.returncode == FAILED_RUNS, done.stderr
    assert "3 of 12 runs are in the journal" in done.stdout
    assert "12 of 12 runs are in the journal" in sweep().stdout


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.04", "0.05", "values of plant:valve.time_constant was"),
        ("maximum", "minimum", "measures.peak was"),
        ("135e3", "136e3", "scenario's inputs.boost_reference was"),
        ("duration = 2.0", "duration = 1.0", "plant's run_in.duration was 2.0, is 1.0"),
        ("step = 0.0125", "step = 0.025", "scenario's step was 0.0125, is 0.025"),
        ("records = true", "records = false", "records was true, is false"),
    ],
)
def test_a_journal_of_other_settings_is_refused_by_name(
    cargo_fmu: Run, exported: Path, results: Path, tmp_path: Path, old: str, new: str, message: str
) -> None:
    shutil.copytree(results, tmp_path / "out")
    text = ("records = true\n" + GRID + MEASURES).replace(old, new)
    study = write_study(tmp_path, text, SCENARIO.replace(old, new))
    done = cargo_fmu("sweep", study, "--fmus", exported, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert message in done.stderr
    assert (tmp_path / "out" / "journal.jsonl").read_text() == (results / "journal.jsonl").read_text()


def test_a_journal_of_another_fmu_is_refused(
    cargo_fmu: Run, exported: Path, results: Path, tmp_path: Path
) -> None:
    shutil.copytree(results, tmp_path / "out")
    other = copy_with(
        exported / "BoostPlant.fmu", tmp_path / "Other.fmu", "generationTool=", "generationTool="
    )
    study = write_study(tmp_path, "records = true\n" + GRID + MEASURES)
    done = cargo_fmu("sweep", study, "--fmus", exported, "--fmu", f"plant={other}", "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "SHA-256 of plant's file was" in done.stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '[grid]\n"plant:tank.volum" = [1]\n' + MEASURES,
            "no variable tank.volum; did you mean tank.volume?",
        ),
        ('[grid]\n"engine:tank.volume" = [1]\n' + MEASURES, "has no FMU engine; it has controller, plant"),
        ('[grid]\n"plant:boost_pressure" = [1]\n' + MEASURES, "boost_pressure is calculated by the FMU"),
        (GRID + '[measures]\na = { finale = "boost_pressure" }', "line 8, measures.a: expected a table with"),
        (GRID + '[measures]\na = { final = "boost" }', "no FMU has a variable boost"),
        (
            GRID + '[measures]\na = { rise_time = "boost_pressure", reference = "engine_speed" }',
            "measures.a.reference: expected an input of the scenario that is steps",
        ),
        (
            GRID + '[measures]\na = { final = "boost_pressure", to = 9 }',
            "measures.a.to: expected a time from 0 to 4 s, a whole number of steps",
        ),
        ("treads = 2\n" + GRID + MEASURES, "line 2, treads: this key is not known"),
    ],
)
def test_errors_in_a_study_are_named(
    cargo_fmu: Run, exported: Path, tmp_path: Path, text: str, message: str
) -> None:
    study = write_study(tmp_path, text)
    done = cargo_fmu("sweep", study, "--fmus", exported, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert message in done.stderr


class Kill(WorkerPlugin):
    """Kills the first worker that begins a run while it has the result of another; `marker` is the file that
    says that it has."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def setup(self, worker: Worker) -> None:
        self.worker = worker

    def transition(self, key: str, start: str, finish: str, **_more: object) -> None:
        if finish != "executing" or not self.worker.data:
            return
        with suppress(FileExistsError), self.marker.open("x") as marker:
            marker.write(self.worker.address)
            marker.flush()
            os.kill(os.getpid(), signal.SIGKILL)


def test_dask_loses_nothing_with_a_killed_worker(cargo_fmu: Run, exported: Path, tmp_path: Path) -> None:
    """The same study with FMPy on a cluster of two processes, one of which is killed as it begins a run
    after it has results: `cargo fmu`'s numbers, to the bit."""
    measures = MEASURES.replace('mean = { mean = "boost_pressure", from = 0.5 }', "")
    study = write_study(tmp_path, GRID + measures)
    script = ROOT / "examples" / "sweep_with_dask.py"
    out, marker = tmp_path / "results.csv", tmp_path / "killed"
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        client.register_plugin(Kill(marker))
        arguments = [sys.executable, script, study, "--fmus", exported, "--out", out]
        subprocess.run([*arguments, "--scheduler", cluster.scheduler_address], check=True)
        assert marker.read_text() not in client.scheduler_info(n_workers=-1)["workers"]
    done = cargo_fmu("sweep", study, "--fmus", exported, "--out", tmp_path / "out")
    assert done.returncode == FAILED_RUNS, done.stderr
    expected, found = rows(tmp_path / "out" / "results.csv"), rows(out)
    assert len(found) == len(expected) == 12
    for theirs, ours in zip(found, expected, strict=True):
        for name in ["run", "plant:valve.time_constant", "plant:tank.volume"]:
            assert float(theirs[name]) == float(ours[name])
        assert theirs["controller:structure"] == ours["controller:structure"]
        for name in ["up", "down", "rise", "left", "peak", "least", "last"]:
            if ours[name]:
                assert float(theirs[name]) == float(ours[name]), name
            else:
                # An undefined rise time is infinite here.
                assert theirs[name] in ("", "inf"), name
        assert bool(theirs["error"]) == bool(ours["error"]) == (float(ours["plant:tank.volume"]) < 0)
        # The FMU's own message.
        assert all(line.strip() in theirs["error"] for line in ours["error"].splitlines()[1:])
