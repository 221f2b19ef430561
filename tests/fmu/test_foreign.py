"""One of the FMUs is replaced by one made with PythonFMU, from a source in examples/foreign/: both
directions.

The commands that make FMUs and systems are those of docs/masters.md. Programs that load an FMU of PythonFMU
run in a separate process without exit handlers: as the library of these FMUs is unloaded, it accesses freed
memory.
"""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable
from math import exp, pi
from pathlib import Path
from zipfile import ZipFile

import fmpy.ssp.simulation
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import ns
from lxml import etree

from fmu import ROOT, TARGET, Run, csv_lines, documents
from fmu.experiments import (
    BOOST_STEPS,
    BOOST_STEPS_END,
    OPERATING_POINT,
    SAMPLE_TIME,
    SCENARIOS,
    Steps,
    constants,
    couple,
    ssp_of_fmpy,
    staircase,
)
from fmu.master import Fmu, Instance, Record

LINES = documents.lines((ROOT / "docs" / "masters.md").read_text())

REFERENCE = staircase(*BOOST_STEPS)

LARGEST_STEP, SHORTEST_STEP = 20e3, 10.0
"""Largest step of the reference (Pa), and its duration (s)."""

FIT = 6e3
"""The error of the surrogate's static map against the controller's (Pa)."""

COMMANDS = [("hp_wastegate_pwm", "wg_duty", 0.01), ("vacuum_pump", "pump_on", 1.0)]
MEASUREMENTS = [
    ("p_boost", "boost_pressure", 1e5),
    ("p_tank", "tank_pressure", 1e5),
    ("u_measured", "supply_voltage_measured", 1.0),
]
"""Connections of our controller and the surrogate, with their factors."""


@pytest.fixture(scope="module")
def clone(exported: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where the commands were run, except for those that install packages and run masters."""
    folder = documents.clone(exported, tmp_path_factory.mktemp("foreign"))
    (folder / "target" / "foreign").mkdir()
    (folder / "target" / "release").symlink_to(TARGET.resolve() / "debug")
    made = [line for line in LINES if line.split()[0] in ("pythonfmu", "cargo")]
    assert len(made) == 9
    for line in made:
        documents.run(line, folder)
    # By the lines for the system of both FMUs with other parameters, and with one input.
    written = {path.name for path in (folder / "target").iterdir() if path.is_file()}
    assert written == {"plant.ssv", "paper.ssp", "reference.ssp"}
    return folder


def transfer(source: Instance, target: Instance, wires: list[tuple[str, str, float]]) -> None:
    """Transfers values in the target's names and units."""
    target.set({to: source.get(name) * factor for name, to, factor in wires})


def control_surrogate(ours: Instance, surrogate: Instance, at_once: bool = False) -> Record:
    """Steps our controller and the surrogate; returns the values after each step, in our names and units."""
    ours.begin()
    surrogate.begin()
    transfer(ours, surrogate, COMMANDS)
    for instance in (ours, surrogate):
        instance.slave.exitInitializationMode()
    rows = []
    for step in range(round(BOOST_STEPS_END / SAMPLE_TIME)):
        time = step * SAMPLE_TIME
        ours.set({"boost_reference": REFERENCE(time)})
        transfer(surrogate, ours, MEASUREMENTS)
        if at_once:
            transfer(ours, surrogate, COMMANDS)
        ours.slave.doStep(time, SAMPLE_TIME)
        if not at_once:
            transfer(ours, surrogate, COMMANDS)
        surrogate.slave.doStep(time, SAMPLE_TIME)
        measured = [surrogate.get(name) * factor for name, _, factor in MEASUREMENTS]
        rows.append([time + SAMPLE_TIME, *measured, ours.get("hp_wastegate_pwm")])
    names = ["time", *(name for _, name, _ in MEASUREMENTS), "hp_wastegate_pwm"]
    return Record(zip(names, np.array(rows).T, strict=True))


class Loops:
    """Runs with FMUs of PythonFMU, in a separate process."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def instance(self, name: str) -> Instance:
        ours = name in ("BoostPlant", "BoostController")
        path = self.folder / "target" / ("fmu" if ours else "foreign") / f"{name}.fmu"
        return Instance(Fmu(path, Path(tempfile.mkdtemp(dir=self.folder))))

    def foreign_controller(self, at_once: bool = False) -> Record:
        inputs = {"boost_reference": REFERENCE}
        members = self.instance("BoostPlant"), self.instance("PiController")
        return couple(*members, inputs=inputs, at_once=at_once).run(BOOST_STEPS_END)

    def foreign_controller_as_ssp_of_fmpy(self) -> Record:
        members = self.instance("BoostPlant"), self.instance("PiController")
        return ssp_of_fmpy(*members).run(BOOST_STEPS_END)

    def foreign_controller_in_fmpy(self) -> Record:
        # Freeing would unload the FMUs.
        fmpy.ssp.simulation.free_fmu = lambda component: None
        result = simulate_ssp(
            str(self.folder / "target" / "foreign" / "pi.ssp"),
            stop_time=BOOST_STEPS_END,
            step_size=SAMPLE_TIME,
            input={"boost_reference": REFERENCE, **constants(OPERATING_POINT)},
        )
        return Record(boost_pressure=result["boost_pressure"])

    def foreign_plant(self, at_once: bool = False) -> Record:
        return control_surrogate(self.instance("BoostController"), self.instance("SurrogatePlant"), at_once)

    def foreign_plant_at_rest(self, *duties: float) -> Record:
        surrogate, pressures = self.instance("SurrogatePlant"), []
        for duty in duties:
            surrogate.start({"wg_duty": duty / 100})
            pressures.append(surrogate.get("p_boost") * 1e5)
            surrogate.slave.reset()
        return Record(boost_pressure=np.array(pressures))


def loop(folder: Path, name: str, *arguments: float) -> Record:
    """Runs one of the loops and returns its record."""
    command = [sys.executable, "-m", "fmu.test_foreign", folder, name, json.dumps(arguments)]
    done = subprocess.run(command, cwd=ROOT / "tests", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    columns = json.loads(done.stdout.splitlines()[-1])
    return Record({name: np.array(column) for name, column in columns.items()})


def test_controller_of_another_make_controls_our_plant(clone: Path) -> None:
    """It has the plant's names and units: only the file changes."""
    record = loop(clone, "foreign_controller")
    steps = Steps(record, BOOST_STEPS, BOOST_STEPS_END)
    print(steps.summary())
    # The closed loop is slowest at 125 kPa, where a time constant of 1.04 s and a gain of -3210 Pa/% leave
    # it a pole at 0.42 1/s.
    assert max(steps.end_error) <= LARGEST_STEP * exp(-0.42 * SHORTEST_STEP)
    # As in the paper.
    assert max(steps.up) <= 5e3
    assert max(steps.down) <= 1e3
    # Without the pump the wastegate would lose its vacuum.
    assert set(record["vacuum_pump"]) == {0.0, 1.0}


def test_our_controller_controls_a_plant_of_another_make(clone: Path) -> None:
    """It has other names, and the units bar and 1 instead of Pa and %."""
    record = loop(clone, "foreign_plant")
    steps = Steps(record, BOOST_STEPS, BOOST_STEPS_END)
    print(steps.summary())
    # The error by a lag that differs from the controller's schedule decays with the integral time: at most
    # 1.9 s, the largest time constant of the schedule up to 190 kPa.
    assert max(steps.end_error) <= LARGEST_STEP * exp(-SHORTEST_STEP / 1.9)
    # The error of the feedforward is that of the surrogate's static map.
    assert max(steps.up + steps.down) <= FIT
    # The relay of the tank keeps its limits, except for the change in one step.
    assert record["tank_pressure"].min() >= 30e3 - 580 * SAMPLE_TIME
    assert record["tank_pressure"].max() <= 35e3 + 100 * SAMPLE_TIME * (1 + 1e-6)


def test_surrogate_is_fitted_to_the_maps(clone: Path, controller_fmu: Fmu) -> None:
    """Its static map at 1500 rpm: the third column."""

    def column(name: str) -> np.ndarray:
        place = "[{}]" if name == "boost_reference" else "[{},3]"
        names = [f"schedule.{name}{place.format(row)}" for row in range(1, 17)]
        return np.array([float(controller_fmu.variables[name].start) for name in names])

    references = column("boost_reference")
    used = (references >= 125e3) & (references <= 220e3)
    found = loop(clone, "foreign_plant_at_rest", *column("feedforward")[used])["boost_pressure"]
    assert np.abs(found - references[used]).max() <= FIT
    time_constants = column("time_constant")[used]
    assert min(time_constants) < 1.5 < max(time_constants)


def test_check_sees_what_the_connections_are_for(
    clone: Path, boost_fmu: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    """The surrogate can replace the plant with the connections, as the page says, and cannot without them."""
    (line,) = [line for line in LINES if " check " in line and "--connections" in line]
    done = documents.run(line, clone)
    assert "hp_wastegate_pwm = 100 · wg_duty" in done
    assert "boost_pressure = 100000 · p_boost" in done
    without = boost_fmu("check", "target/foreign/SurrogatePlant.fmu", "--as", "plant", folder=clone)
    assert without.returncode == 1


def test_system_converts_by_the_connections(clone: Path) -> None:
    """Connections with the surrogate convert in their direction; the others do not convert."""
    with ZipFile(clone / "target" / "foreign" / "surrogate.ssp") as archive:
        structure = etree.fromstring(archive.read("SystemStructure.ssd"))
    factors = {}
    for connection in structure.iterfind(".//ssd:Connection", ns):
        names = connection.get("startConnector"), connection.get("endConnector")
        transformation = connection.find("ssc:LinearTransformation", ns)
        if transformation is not None:
            assert connection.get("suppressUnitConversion") == "true"
            # OMSimulator reads both attributes from Python, and fails where one is missing.
            assert transformation.get("offset") == "0.0"
            factors[names] = float(transformation.get("factor"))
    # Up to the rounding of a quotient.
    expected = {(start, end): factor for start, end, factor in COMMANDS + MEASUREMENTS if factor != 1.0}
    outside = {("p_boost", "boost_pressure"), ("p_tank", "tank_pressure"), ("engine_speed", "n_engine")}
    assert set(factors) == set(expected) | outside
    expected["engine_speed", "n_engine"] = 2 * pi / 60
    assert factors == pytest.approx(expected, rel=2e-16)


def test_controller_of_another_make_in_the_ssp_of_fmpy(clone: Path) -> None:
    """Against the tests' master, to the last bit. No conversions are needed, which FMPy does not support."""
    result, record = (loop(clone, f"foreign_controller_{how}") for how in ("in_fmpy", "as_ssp_of_fmpy"))
    assert np.array_equal(result["boost_pressure"].view(np.uint64), record["boost_pressure"].view(np.uint64))


IN_ECOS = """
import json, os, sys
from ecospy import EcosSimulation
folder, step, controller, *reached = sys.argv[1:]
simulation = EcosSimulation(ssp_path=folder, step_size=float(step))
simulation.init()
rows = []
for reference in json.load(sys.stdin):
    simulation.set_real(f"{controller}::boost_reference", reference)
    simulation.step()
    rows.append([simulation.get_real(name) for name in reached])
simulation.terminate()
print(json.dumps(rows), flush=True)
os._exit(0)
"""
"""Runs a system with the reference in each step; prints the values after each step."""


def run_in_ecos(system: Path, controller: str, boost: str) -> np.ndarray:
    """Boost pressure and duty after each step."""
    folder = system.with_suffix("")
    ZipFile(system).extractall(folder)
    # Ecos does not support connectors of a system, and reads only this file.
    (folder / "Components.ssd").replace(folder / "SystemStructure.ssd")
    count = round(BOOST_STEPS_END / SAMPLE_TIME)
    reached = [boost, f"{controller}::hp_wastegate_pwm"]
    done = subprocess.run(
        [sys.executable, "-c", IN_ECOS, folder, str(SAMPLE_TIME), controller, *reached],
        input=json.dumps([REFERENCE(step * SAMPLE_TIME) for step in range(count)]),
        env={**os.environ, "LD_LIBRARY_PATH": f"{sys.prefix}/lib"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return np.array(json.loads(done.stdout.splitlines()[-1]))


def test_system_with_the_controller_of_another_make(clone: Path) -> None:
    """In Ecos, against the tests' master that steps both at once."""
    system = clone / "target" / "foreign" / "pi.ssp"
    table = run_in_ecos(system, "PiController", "BoostPlant::boost_pressure")

    record = loop(clone, "foreign_controller", True)
    expected = np.stack([record["boost_pressure"], record["hp_wastegate_pwm"]], axis=1)[1:]
    assert np.array_equal(table.view(np.uint64), expected.view(np.uint64))


def test_system_with_the_plant_of_another_make(clone: Path) -> None:
    """The same; the system converts the units."""
    system = clone / "target" / "foreign" / "surrogate.ssp"
    table = run_in_ecos(system, "BoostController", "SurrogatePlant::p_boost")

    record = loop(clone, "foreign_plant", True)
    expected = np.stack([record["boost_pressure"] / 1e5, record["hp_wastegate_pwm"]], axis=1)
    # Pressure is converted to bar and back, which rounds twice.
    assert np.abs(table / expected - 1).max() <= 2 * np.finfo(float).eps


WITH_PYTHON = {
    "LD_PRELOAD": str(Path(sysconfig.get_config_var("LIBDIR")) / str(sysconfig.get_config_var("INSTSONAME")))
}
"""Commands with this Python's library loaded, which PythonFMU expects of its host."""

SCENARIO = re.sub(r"\[fmu\.run_in\]\n(.+\n)+", "", (SCENARIOS / "figure_13.toml").read_text())
"""The steps of Fig. 13 from the settled start, as the FMUs here."""

CONNECTIONS = ROOT / "examples" / "foreign" / "surrogate_plant.toml"


def simulate(cargo_fmu: Run, clone: Path, folder: Path, text: str, *more: str | Path) -> Record:
    """The record of a scenario."""
    scenario = folder / "scenario.toml"
    scenario.write_text(text)
    out = folder / "record.csv"
    fmus = clone / "target" / "fmu"
    done = cargo_fmu("simulate", scenario, "--fmus", fmus, "--out", out, *more, **WITH_PYTHON)
    assert (done.returncode, done.stderr) == (0, "")
    names, *rows = csv.reader(csv_lines(out))
    return Record(zip(names, np.array(rows, dtype=float).T, strict=True))


def replacing(name: str, foreign: Path) -> list[str]:
    """The option that replaces an FMU of the scenario."""
    return ["--fmu", f"{name}={foreign}"]


def bits(column: np.ndarray) -> np.ndarray:
    """The bits of doubles."""
    return np.ascontiguousarray(column).view(np.uint64)


@pytest.mark.parametrize("stepping", ["in_turn", "at_once"])
@pytest.mark.parametrize("given", ["by the option", "by the scenario"])
def test_cargo_fmu_couples_a_plant_of_another_make_by_connections(
    clone: Path, cargo_fmu: Run, tmp_path: Path, stepping: str, given: str
) -> None:
    """Against the tests' master, which converts by the numbers above, at each communication point.

    To the last bit: both multiply each value once, by the same factors.
    """
    text = f'stepping = "{stepping}"\n{SCENARIO}'
    more = replacing("plant", clone / "target" / "foreign" / "SurrogatePlant.fmu")
    if given == "by the option":
        more += ["--connections", str(CONNECTIONS)]
    else:
        text += CONNECTIONS.read_text()
    names = [f"plant:{name}" for name, *_ in MEASUREMENTS] + ["hp_wastegate_pwm"]
    found = simulate(cargo_fmu, clone, tmp_path, text, *more, "--record", ",".join(names))

    expected = loop(clone, "foreign_plant", stepping == "at_once")
    for own, name, factor in MEASUREMENTS:
        assert np.array_equal(bits(found[f"plant:{own}"][1:] * factor), bits(expected[name])), name
    assert np.array_equal(bits(found["hp_wastegate_pwm"][1:]), bits(expected["hp_wastegate_pwm"]))
    assert np.ptp(found["plant:p_boost"]) * 1e5 > LARGEST_STEP


def test_cargo_fmu_couples_a_controller_of_another_make(clone: Path, cargo_fmu: Run, tmp_path: Path) -> None:
    """By its names."""
    foreign = clone / "target" / "foreign" / "PiController.fmu"
    found = simulate(cargo_fmu, clone, tmp_path, SCENARIO, *replacing("controller", foreign))
    for name, column in loop(clone, "foreign_controller").items():
        assert np.array_equal(bits(found[name]), bits(column)), name


def test_written_connections_run_as_they_are(
    clone: Path, boost_fmu: Run, cargo_fmu: Run, tmp_path: Path
) -> None:
    """Those of the page with a unit that the FMU declares anyway: read and written again by `check`."""
    given, written = tmp_path / "given.toml", tmp_path / "written.toml"
    given.write_text(CONNECTIONS.read_text().replace('"plant:u_battery"', '"plant:u_battery"\nto_unit = "V"'))
    surrogate = clone / "target" / "foreign" / "SurrogatePlant.fmu"
    options = ["--connections", given, "--write-connections", written]
    done = boost_fmu("check", surrogate, "--as", "plant", *options, folder=tmp_path)
    assert done.returncode == 0, done.stdout
    records = []
    for file in (CONNECTIONS, written):
        more = [*replacing("plant", surrogate), "--connections", file]
        records.append(simulate(cargo_fmu, clone, tmp_path, SCENARIO, *more, "--record", "plant:p_boost"))
    assert np.array_equal(*(bits(record["plant:p_boost"]) for record in records))


def typed_surrogate(folder: Path, kind: str) -> Path:
    """The engine model with a pump of a type: an enumeration is an Integer of PythonFMU, declared anew."""
    source = (ROOT / "examples" / "foreign" / "surrogate_plant.py").read_text()
    inputs = 'inputs = {"wg_duty": "1", "pump_on": "1", '
    kinds = "Boolean" if kind == "Boolean" else "Integer"
    start = "False" if kind == "Boolean" else "0"
    pump = f"""
        pump = {kinds}("pump_on", causality=Fmi2Causality.input, variability=Fmi2Variability.discrete)
        pump.unit = "1"
        self.register_variable(pump)
"""
    for old, new in [
        (inputs, 'inputs = {"wg_duty": "1", '),
        ("0.44, 0.0", f"0.44, {start}"),
        ("\n        inputs = {", f"{pump}        inputs = {{"),
        ("import Fmi2Causality", f"import Fmi2Causality, Fmi2Variability, {kinds}"),
    ]:
        assert source.count(old) == 1
        source = source.replace(old, new)
    (folder / "surrogate_plant.py").write_text(source)
    shutil.copy(ROOT / "examples" / "foreign" / "quantity.py", folder)
    documents.run("pythonfmu build --file surrogate_plant.py quantity.py", folder)
    fmu = folder / "SurrogatePlant.fmu"
    if kind == "Enumeration":
        declare_enumeration(fmu)
    return fmu


def declare_enumeration(fmu: Path) -> None:
    """Makes the FMU's Integer an enumeration, whose functions are the same in FMI 2.0."""
    with ZipFile(fmu) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    text = contents["modelDescription.xml"].decode()
    items = '<Item name="off" value="0"/><Item name="on" value="1"/>'
    types = f'<TypeDefinitions><SimpleType name="Pump"><Enumeration>{items}</Enumeration></SimpleType>'
    changed = text.replace("<Integer", '<Enumeration declaredType="Pump"')
    assert changed.count("declaredType") == 1
    changed = changed.replace("</UnitDefinitions>", f"</UnitDefinitions>{types}</TypeDefinitions>")
    contents["modelDescription.xml"] = changed.encode()
    with ZipFile(fmu, "w") as archive:
        for name, content in contents.items():
            archive.writestr(name, content)


def test_all_commands_take_a_pump_of_any_type(
    clone: Path, boost_fmu: Run, cargo_fmu: Run, lab: Run, tmp_path: Path
) -> None:
    """Each gives the results of the Real pump, to the last bit: its values are 0 and 1."""
    ours = clone / "target" / "fmu" / "BoostController.fmu"

    def results(fmu: Path, folder: Path) -> list[str]:
        done = boost_fmu("check", fmu, "--as", "plant", "--connections", CONNECTIONS, folder=folder)
        assert done.returncode == 0, done.stdout
        more = [*replacing("plant", fmu), "--connections", CONNECTIONS]
        coupled = simulate(cargo_fmu, clone, folder, SCENARIO, *more, "--record", "plant:p_boost")

        parts = ["--plant", fmu, "--controller", ours, "--connections", CONNECTIONS]
        done = boost_fmu("ssp", *parts, "--out", "system.ssp", folder=folder)
        assert done.returncode == 0, done.stderr
        out = folder / "system.csv"
        options = ["--stop-time", "20", "--record", "boost_pressure,tank_pressure", "--out", out]
        done = cargo_fmu("simulate", folder / "system.ssp", *options, **WITH_PYTHON)
        assert (done.returncode, done.stderr) == (0, "")

        done = lab("study", *parts, "--cases", "1", "--out", folder / "study", **WITH_PYTHON)
        # 1: the plant does not meet the criteria.
        assert done.returncode in (0, 1), done.stderr
        studied = (folder / "study" / "results.csv").read_text()
        assert ",error," not in studied.partition("\n")[2]
        return [str(coupled["plant:p_boost"].tolist()), out.read_text(), studied]

    (tmp_path / "Real").mkdir()
    expected = results(clone / "target" / "foreign" / "SurrogatePlant.fmu", tmp_path / "Real")
    for kind in ["Boolean", "Integer", "Enumeration"]:
        folder = tmp_path / kind
        folder.mkdir()
        assert results(typed_surrogate(folder, kind), folder) == expected, kind


def test_lines_of_the_laboratorys_page(clone: Path) -> None:
    lines = documents.lines((ROOT / "docs" / "laboratory.md").read_text())
    lines = [line for line in lines if "target/foreign/" in line]
    assert len(lines) == 2
    for line in lines:
        documents.run(line, clone, **WITH_PYTHON)
    for name in ["surrogate", "pi"]:
        rows = list(csv.DictReader(csv_lines(clone / "target" / f"{name}.csv")))
        # The error before the second step.
        assert abs(float(rows[round(22 / SAMPLE_TIME)]["boost_pressure"]) - 150e3) < 100


def test_sweep_with_a_plant_of_another_make(clone: Path, cargo_fmu: Run, tmp_path: Path) -> None:
    """Its runs use the connections, and its journal refuses others."""
    (tmp_path / "scenario.toml").write_text(SCENARIO)
    (tmp_path / "study.toml").write_text(
        'scenario = "scenario.toml"\n[grid]\n"controller:reference_lambda" = [0.48, 0.96]\n'
        '[measures]\npeak = { maximum = "boost_pressure" }\n'
    )
    more = replacing("plant", clone / "target" / "foreign" / "SurrogatePlant.fmu")
    arguments = ["sweep", tmp_path / "study.toml", "--fmus", clone / "target" / "fmu", *more]
    out = tmp_path / "out"
    done = cargo_fmu(*arguments, "--connections", CONNECTIONS, "--out", out, **WITH_PYTHON)
    assert done.returncode == 0, done.stderr
    one, other = csv.DictReader(csv_lines(out / "results.csv"))
    # 0.48 s is the default.
    assert float(one["peak"]) == loop(clone, "foreign_plant")["boost_pressure"].max()
    assert other["peak"] != one["peak"]

    changed = tmp_path / "changed.toml"
    changed.write_text(
        CONNECTIONS.read_text().replace('"plant:u_battery"', '"plant:u_battery"\nto_unit = "V"')
    )
    done = cargo_fmu(*arguments, "--connections", changed, "--out", out, **WITH_PYTHON)
    assert done.returncode == 2
    assert "scenario's connections was" in done.stderr


def test_tuning_to_a_plant_of_another_make(clone: Path, lab: Run, tmp_path: Path) -> None:
    """The result is the surrogate's known behaviour, in the controller's units.

    As in test_tune.py, an identification is accurate to 0.3 % of duty and 2 % of a gain.
    """
    reached = [150e3, 160e3]
    # Not reachable, so that no time is spent on steps.
    references = reached + [300e3 + 1e3 * row for row in range(14)]
    out = tmp_path / "tuned"
    done = lab(
        *["tune", "--plant", clone / "target" / "foreign" / "SurrogatePlant.fmu"],
        *["--connections", CONNECTIONS],
        *["--boost-references", ",".join(map(str, references)), "--out", out],
        **WITH_PYTHON,
    )
    assert done.returncode == 0, done.stderr
    report = json.loads((out / "report.json").read_text())
    column = report["engine_speeds"].index(1500.0)
    cells = [cell for cell in report["cells"] if cell["column"] == column and cell["row"] < len(reached)]
    assert [cell["basis"] for cell in cells] == ["identified"] * len(reached)
    for cell, reference in zip(cells, reached, strict=True):
        duty = cell["feedforward"]
        below, at, above = loop(clone, "foreign_plant_at_rest", duty - 1, duty, duty + 1)["boost_pressure"]
        gain = (above - below) / 2
        assert abs(at - reference) <= 0.3 * abs(gain)
        assert cell["gain"] == pytest.approx(gain, rel=0.02)
        # Two lags of 1.5 and 0.07 s: the smaller one appears partly as lag and partly as delay.
        assert 1.5 < cell["time_constant"] < 1.57
        assert 0 < cell["delay"] < 0.07


def test_tune_names_what_does_not_fit(clone: Path, lab: Run, tmp_path: Path) -> None:
    """As `check` does."""
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(CONNECTIONS.read_text().replace("plant:p_boost", "plant:p_bost"))
    plant = clone / "target" / "foreign" / "SurrogatePlant.fmu"
    done = lab("tune", "--plant", plant, "--connections", wrong, "--out", tmp_path / "out", **WITH_PYTHON)
    assert done.returncode == 2
    assert re.search(r"WRONG +output +boost_pressure +p_bost is missing; similar: p_boost\n", done.stderr)
    assert not (tmp_path / "out").exists()


if __name__ == "__main__":
    folder, name, arguments = sys.argv[1:]
    record = getattr(Loops(Path(folder)), name)(*json.loads(arguments))
    print(json.dumps({name: column.tolist() for name, column in record.items()}), flush=True)
    os._exit(0)
