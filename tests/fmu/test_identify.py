"""The actuator's identification: known parameters of the plant, found again in simulated measurements."""

from __future__ import annotations

import csv
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssv

from fmu import ROOT, Run, csv_lines
from fmu.report import Report

BENCH = ROOT / "examples" / "actuator_bench.toml"

NOISE = {
    name: noise["standard_deviation"]
    for name, noise in tomllib.loads(BENCH.read_text())["measurement_noise"].items()
}
"""Standard deviations of the sensors (Pa, m, V): 0.1 % of 100 kPa and of the stroke."""

DEFAULTS = {
    "valve.pressure_coefficient[1]": 2.8939e-2,
    "valve.pressure_coefficient[2]": -6.5767,
    "valve.pressure_coefficient[3]": -4.4044e2,
    "valve.pressure_coefficient[4]": 1.0612e5,
    "valve.leakage_coefficient[1]": -4.7625e-5,
    "valve.leakage_coefficient[2]": 7.2e-2,
    "valve.leakage_coefficient[3]": -5.23e-2,
    "pump.mass_flow": 6.84e-6,
    "actuator.spring_preload": 19.0,
    "actuator.spring_stiffness": 3530.0,
    "actuator.spring_hardening": 2e15,
    "actuator.coulomb_friction": 0.2,
    "actuator.friction_stiffness": 400.0,
    "valve.tank_area": 1e-6,
    "valve.ambient_area": 8e-7,
    "valve.proportional_band": 2000.0,
    "valve.time_constant": 0.008,
    "actuator.damping": 30.0,
    "actuator.mass": 0.1,
}
"""The paper's Table 1, as the plant reads it, and the plant's own."""

CHANGED = {
    "valve.pressure_coefficient[1]": 2.6e-2,
    "valve.pressure_coefficient[2]": -6.0,
    "valve.pressure_coefficient[3]": -4.6e2,
    "valve.pressure_coefficient[4]": 1.055e5,
    "valve.leakage_coefficient[1]": 3e-4,
    "valve.leakage_coefficient[2]": 5e-2,
    "valve.leakage_coefficient[3]": 0.2,
    "pump.mass_flow": 8e-6,
    "actuator.spring_preload": 20.5,
    "actuator.spring_stiffness": 3200.0,
    "actuator.spring_hardening": 1.6e15,
    "actuator.coulomb_friction": 0.5,
    "actuator.friction_stiffness": 700.0,
    "valve.tank_area": 7e-7,
    "valve.ambient_area": 1.1e-6,
    "valve.proportional_band": 2600.0,
    "valve.time_constant": 0.012,
    "actuator.damping": 45.0,
    "actuator.mass": 0.14,
}
"""Another plant; the identification starts from the default one."""

USEFUL = {
    "valve.pressure_coefficient[1]": 0.01,
    "valve.pressure_coefficient[2]": 0.01,
    "valve.pressure_coefficient[3]": 0.005,
    "valve.pressure_coefficient[4]": 0.0005,
    "pump.mass_flow": 0.01,
    "actuator.spring_preload": 0.001,
    "actuator.spring_stiffness": 0.001,
    "actuator.spring_hardening": 0.002,
    "actuator.coulomb_friction": 0.03,
    "actuator.friction_stiffness": 0.1,
    "valve.tank_area": 0.002,
    "valve.ambient_area": 0.002,
    "valve.proportional_band": 0.02,
    "valve.time_constant": 0.03,
    "actuator.damping": 0.02,
    "actuator.mass": 0.06,
}
"""The largest useful standard error, relative to its parameter. The coefficients of eq. (6) are correlated:
the area at a duty matters."""

LEAKAGE = [f"valve.leakage_coefficient[{index}]" for index in (1, 2, 3)]


class Table:
    """A CSV file's columns."""

    def __init__(self, names: list[str], rows: np.ndarray) -> None:
        self.names, self.rows = names, rows

    @classmethod
    def read(cls, path: Path) -> Table:
        names, *rows = csv.reader(csv_lines(path))
        return cls(names, np.array(rows, dtype=float))

    def __getitem__(self, name: str) -> np.ndarray:
        return self.rows[:, self.names.index(name)]

    def measured(self, seed: int) -> Table:
        """The same with the sensors' noise."""
        generator = np.random.default_rng(seed)
        table = Table(self.names, self.rows.copy())
        for name, deviation in NOISE.items():
            table[name][:] += generator.normal(0.0, deviation, len(table.rows))
        return table

    def between(self, begin: float, end: float) -> Table:
        time = self["time"]
        return Table(self.names, self.rows[(time >= begin) & (time < end)])

    def write(self, path: Path) -> Path:
        lines = [",".join(self.names), *(",".join(map(repr, row)) for row in self.rows.tolist())]
        path.write_text("\n".join(lines) + "\n")
        return path


def bench(
    cargo_fmu: Run, exported: Path, folder: Path, *, values: dict[str, float], parameters: str = ""
) -> Table:
    """The record of a plant on the bench."""
    listed = ", ".join(f'"{name}" = {value!r}' for name, value in values.items())
    lines = f'file = "BoostPlant.fmu"\nvalues = {{ {listed} }}\n{parameters}'
    scenario = folder / "bench.toml"
    without_noise = BENCH.read_text().partition("[measurement_noise]")[0]
    scenario.write_text(without_noise.replace('file = "BoostPlant.fmu"\n', lines))
    done = cargo_fmu("simulate", scenario, "--fmus", exported, "--out", folder / "bench.csv")
    assert done.returncode == 0, done.stderr
    return Table.read(folder / "bench.csv")


@pytest.fixture(scope="module")
def benches(cargo_fmu: Run, exported: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Table]:
    """The records of both plants, without noise."""
    folder = tmp_path_factory.mktemp("bench")
    return {
        name: bench(cargo_fmu, exported, folder, values=values)
        for name, values in [("defaults", {}), ("changed", CHANGED)]
    }


Identify = Callable[..., dict]


def identification(lab: Run, exported: Path, folder: Path) -> Identify:
    """Identifies from a table; returns the report."""

    def run(table: Table, *arguments: str | Path) -> dict:
        data = table.write(folder / "data.csv")
        plant = exported / "BoostPlant.fmu"
        done = lab("identify", "actuator", data, "--plant", plant, "--out", folder / "out", *arguments)
        assert done.returncode == 0, done.stderr
        return json.loads((folder / "out" / "report.json").read_text())

    return run


@pytest.fixture
def identify(lab: Run, exported: Path, tmp_path: Path) -> Identify:
    """Identifies from a table, in the test's folder."""
    return identification(lab, exported, tmp_path)


@pytest.fixture(scope="module")
def changed(
    lab: Run, exported: Path, benches: dict[str, Table], tmp_path_factory: pytest.TempPathFactory
) -> tuple[dict, Path]:
    """The report on the other plant, and the folder of the results."""
    folder = tmp_path_factory.mktemp("changed")
    return identification(lab, exported, folder)(benches["changed"].measured(1)), folder / "out"


@pytest.fixture(scope="module")
def defaults(
    lab: Run, exported: Path, benches: dict[str, Table], tmp_path_factory: pytest.TempPathFactory
) -> dict:
    """The report on the default plant."""
    folder = tmp_path_factory.mktemp("defaults")
    return identification(lab, exported, folder)(benches["defaults"].measured(1))


def estimates(report: dict) -> dict[str, tuple[float, float]]:
    """Values and standard errors by names."""
    return {each["name"]: (each["value"], each["standard_error"]) for each in report["parameters"]}


SEEDS = {"defaults": range(1, 7), "changed": range(11, 17)}
"""Of the sensors' noise, different for each plant, so that the results are independent."""

FARTHEST = NormalDist().inv_cdf(1 - 0.001 / (2 * 12 * len(DEFAULTS)))
"""The largest error of all estimates of both plants, in standard errors, with a probability of 99.9 % by
Bonferroni's inequality, which holds for dependent estimates."""

STUDENT = 4.437
"""Student's t for 99.9 % with 11 degrees of freedom: 12 identifications are independent of each other."""


def test_known_parameters_are_found_again(identify: Identify, benches: dict[str, Table]) -> None:
    """Each within its standard errors, which are neither too large nor too small: the mean square of the
    errors over the standard errors is 1."""
    squares = []
    for plant, truth in [("defaults", DEFAULTS), ("changed", CHANGED)]:
        deviations: dict[str, list[float]] = {name: [] for name in truth}
        errors: dict[str, list[float]] = {name: [] for name in truth}
        for seed in SEEDS[plant]:
            report = identify(benches[plant].measured(seed))
            found = estimates(report)
            assert set(found) == set(truth)
            assert report["unidentified"] == []
            for name, (value, error) in found.items():
                deviations[name].append((value - truth[name]) / error)
                errors[name].append(error)
                assert error < USEFUL.get(name, np.inf) * abs(truth[name]), name
            for sensor, noise in [
                ("actuator_pressure", "actuator_pressure"),
                ("position", "actuator.position"),
            ]:
                # Some 20 000 rows at rest: 0.5 %.
                assert report["noise"][sensor] == pytest.approx(NOISE[noise], rel=0.02)
        for name, values in deviations.items():
            part = np.mean(errors[name]) / abs(truth[name])
            print(f"{plant:8} {name:30} {part:8.2%} " + " ".join(f"{value:+.2f}" for value in values))
            assert max(map(abs, values)) < FARTHEST, name
        squares += list(np.mean(np.square(list(deviations.values())), axis=0))
    mean, deviation = np.mean(squares), np.std(squares, ddof=1) / np.sqrt(len(squares))
    print(f"mean square of errors over standard errors {mean:.3f} ± {deviation:.3f}")
    assert abs(mean - 1) < STUDENT * deviation


FAR = {
    "valve.tank_area": 1.4e-6,
    "valve.ambient_area": 1.7e-6,
    "valve.proportional_band": 1200.0,
    "valve.time_constant": 0.018,
    "actuator.damping": 63.0,
    "actuator.mass": 0.04,
}
"""Half and double of the start of the fit, where it has local minima."""


def test_a_far_start_finds_the_same_minimum(
    identify: Identify, cargo_fmu: Run, exported: Path, tmp_path: Path
) -> None:
    report = identify(bench(cargo_fmu, exported, tmp_path, values=FAR).measured(1))
    found = estimates(report)
    for name, truth in (DEFAULTS | FAR).items():
        assert abs(found[name][0] - truth) < FARTHEST * found[name][1], name
    assert not any("residuals" in note for note in report["notes"])


def test_a_plant_of_another_structure_is_reported(
    identify: Identify, cargo_fmu: Run, exported: Path, tmp_path: Path
) -> None:
    """The force of the exhaust gases, which the fits neglect."""
    report = identify(
        bench(cargo_fmu, exported, tmp_path, values={"actuator.exhaust_area": 1e-4}).measured(1)
    )
    assert any("the position residuals are" in note for note in report["notes"]), report["notes"]


def test_the_model_itself_errs_less_than_the_noise(
    identify: Identify, benches: dict[str, Table], changed: tuple[dict, Path]
) -> None:
    """Without noise, the errors are those of the plant's integration, 0.01 % of full scale, and of the fits'
    model: less than half a standard error, so that they do not limit the estimates. The fit of the motion
    includes them in its standard errors."""
    noisy = estimates(changed[0])
    found = estimates(identify(benches["changed"]))
    for name, (value, error) in found.items():
        deviation = value - CHANGED[name]
        print(f"{name:30} {deviation / noisy[name][1]:+.2f} {deviation / error:+.2f}")
        assert abs(deviation) < 0.5 * noisy[name][1], name
        if name in MOTION:
            assert abs(deviation) < FARTHEST * error, name


def test_validation_data_are_met_as_well(changed: tuple[dict, Path]) -> None:
    """In the validation data, the residuals are the sensors' noise, as in the tuning data."""
    pressure, leakage, spring, motion = (fit["residuals"] for fit in changed[0]["fits"])
    assert [each["name"] for each in motion] == ["chamber pressure", "position"]
    for each, noise in zip(
        motion, [NOISE["actuator_pressure"], 1e3 * NOISE["actuator.position"]], strict=True
    ):
        for part in ["tuning", "validation"]:
            # 47 rows in each of ten transients and more: 1/√940, 3.3 %. 99.9 % are within 3.3 times that.
            assert each[part] == pytest.approx(noise, rel=0.11), (each["name"], part)
    for part in ["tuning", "validation"]:
        # More than 5000 rows at rest: 1 %.
        assert leakage[0][part] == pytest.approx(NOISE["tank_pressure"], rel=0.033)
        # Means of at least 80 rows, in at least some 20 phases: 16 % of the error of 80 rows.
        mean = NOISE["actuator_pressure"] / np.sqrt(80)
        assert 0 < pressure[0][part] < 1.5 * mean
        assert 0 < spring[0][part] < 1.5 * 1.5e-3 * mean


def test_no_fit_sees_the_validation_data(
    identify: Identify, benches: dict[str, Table], defaults: dict
) -> None:
    """The fourth phase at rest is the first validation phase, at a share of 0.3."""
    table = benches["defaults"].measured(1)
    time = table["time"]
    # At 18 %, from one second after the step on: the fourth duty of the bench.
    table["actuator_pressure"][(time >= 10.0) & (time < 12.0)] += 300.0
    changed = identify(table)
    for name in [f"valve.pressure_coefficient[{index}]" for index in (1, 2, 3, 4)]:
        assert estimates(changed)[name] == estimates(defaults)[name]
    left = [report["fits"][0]["residuals"][0]["validation"] for report in (defaults, changed)]
    assert left[1] > 4 * left[0]
    # Without validation data it has an effect.
    assert estimates(identify(table, "--validation-share=0")) != estimates(changed)


def test_the_parameter_set_makes_the_plant_that_was_measured(
    changed: tuple[dict, Path], cargo_fmu: Run, exported: Path, benches: dict[str, Table], tmp_path: Path
) -> None:
    """The default plant with identified.ssv against the other one, within the sensors' noise."""
    _, out = changed
    parameters = f'parameters = ["{out / "identified.ssv"}"]\n'
    found = bench(cargo_fmu, exported, tmp_path, values={}, parameters=parameters)
    expected, default = benches["changed"], benches["defaults"]
    for name in ["actuator_pressure", "actuator.position"]:
        error = np.sqrt(np.mean((found[name] - expected[name]) ** 2))
        assert error < 0.5 * NOISE[name], name
        # The default plant differs.
        assert np.sqrt(np.mean((default[name] - expected[name]) ** 2)) > 5 * NOISE[name]


def test_the_parameter_set_fits_the_plant(
    changed: tuple[dict, Path], boost_fmu: Run, exported: Path, tmp_path: Path
) -> None:
    """Its values equal the report's to the last bit, and `boost-fmu` binds it in a system."""
    report, out = changed
    read = {each.name: (float(each.value), each.unit) for each in read_ssv(out / "identified.ssv").parameters}
    assert read == {each["name"]: (each["value"], each["unit"]) for each in report["parameters"]}
    fmus = ["--plant", exported / "BoostPlant.fmu", "--controller", exported / "BoostController.fmu"]
    sets = ["--parameters", out / "identified.ssv", "--out", "Boost.ssp"]
    done = boost_fmu("ssp", *fmus, *sets, folder=tmp_path)
    assert done.returncode == 0, done.stderr


def test_report_has_each_fit_and_parameter(changed: tuple[dict, Path]) -> None:
    report = Report(changed[1] / "report.html")
    # A fit with its residuals four times, the last one of pressure and position.
    assert len(report.plots) == 4 * 2 + 2
    assert all(name in report.text for name in DEFAULTS)


FRICTION = {"actuator.coulomb_friction", "actuator.friction_stiffness"}
MOTION = {
    "valve.tank_area",
    "valve.ambient_area",
    "valve.proportional_band",
    "valve.time_constant",
    "actuator.damping",
    "actuator.mass",
}
PRESSURE = {f"valve.pressure_coefficient[{index}]" for index in (1, 2, 3, 4)}
SPRING = {f"actuator.spring_{what}" for what in ("preload", "stiffness", "hardening")}


def left_out(report: dict, missing: set[str], reason: str) -> None:
    """Missing parameters are named with the reason, others are right, and none is both."""
    reasons = {each["name"]: each["reason"] for each in report["unidentified"]}
    assert missing <= set(reasons)
    assert all(reason in reasons[name] for name in missing), reasons
    found = estimates(report)
    assert not set(found) & set(reasons)
    assert set(found) | set(reasons) == set(DEFAULTS)
    for name, (value, error) in found.items():
        assert abs(value - DEFAULTS[name]) < FARTHEST * error, name


@pytest.mark.parametrize(
    ("begin", "end", "missing", "reason"),
    [
        (0, 117, FRICTION, "friction needs 3 phases at rest after motion in each direction"),
        (23, 217, MOTION, "needs 4 transients: steps from a phase at rest that move the chamber"),
        (347, 497, PRESSURE, "eq. (7) needs 6 duties at which the chamber rests"),
        (347, 497, SPRING | FRICTION, "the spring needs 8 phases at rest with the rod between its stops"),
    ],
)
def test_undetermined_parameters_are_named_and_left_out(
    identify: Identify,
    benches: dict[str, Table],
    tmp_path: Path,
    begin: float,
    end: float,
    missing: set[str],
    reason: str,
) -> None:
    report = identify(benches["defaults"].measured(1).between(begin, end))
    left_out(report, missing, reason)
    parameters = (tmp_path / "out" / "identified.ssv").read_text()
    found = estimates(report)
    assert all((f'name="{name}"' in parameters) == (name in found) for name in DEFAULTS)


def test_a_pump_that_never_rests_hides_the_leakage(identify: Identify, benches: dict[str, Table]) -> None:
    table = benches["defaults"].measured(1)
    table["vacuum_pump"][:] = 1.0
    report = identify(table)
    reasons = {each["name"]: each["reason"] for each in report["unidentified"]}
    assert set(reasons) == {*LEAKAGE, "pump.mass_flow"}
    assert all("phases at rest, pump off" in reason for reason in reasons.values())


def test_a_pump_that_never_runs_is_not_identified(identify: Identify, benches: dict[str, Table]) -> None:
    table = benches["defaults"].measured(1)
    rests = Table(table.names, table.rows[table["vacuum_pump"] < 0.5])
    left_out(identify(rests), {"pump.mass_flow"}, "no phase at rest with the pump on")


def test_a_port_that_never_opens_is_not_identified(identify: Identify, benches: dict[str, Table]) -> None:
    """Large steps, of which those that vent do not start at rest: the ends of the phases before are
    missing."""
    table = benches["defaults"].measured(1).between(297, 347)
    since = (table["time"] - 297) % 2.5
    rests = Table(table.names, table.rows[(table["hp_wastegate_pwm"] < 50) | (since < 1)])
    left_out(identify(rests), {"valve.ambient_area"}, "no transient in which the chamber pressure rises")


def test_names_and_units_are_free(identify: Identify, benches: dict[str, Table], defaults: dict) -> None:
    """The same data with other names and units, and without ambient conditions."""
    table = benches["defaults"].measured(1)
    table = Table(table.names[:-2], table.rows[:, :-2])
    expected = estimates(defaults)
    others = {
        "time": ("t", "ms", 1e3),
        "hp_wastegate_pwm": ("duty (%)", None, 1.0),
        "supply_voltage": ("U [mV]", None, 1e3),
        "vacuum_pump": ("pump", None, 1.0),
        "tank_pressure": ("p_tank (kPa)", None, 1e-3),
        "actuator_pressure": ("p_act", "mbar", 1e-2),
        "actuator.position": ("lift (%)", None, 1e4),
    }
    names = [others[name][0] for name in table.names]
    rows = table.rows * [others[name][2] for name in table.names]
    roles = {"duty": "duty", "supply_voltage": "U", "pump": "pump"}
    roles |= {"tank_pressure": "p_tank", "actuator_pressure": "p_act", "position": "lift"}
    arguments = [f"--column={role}={name}" for role, name in roles.items()]
    arguments += ["--unit=time=ms", "--unit=actuator_pressure=mbar"]
    report = identify(Table(names, rows), *arguments)
    assert "The data have no ambient pressure; assumed to be 101325 Pa." in report["notes"]
    found = estimates(report)
    for name, (value, error) in expected.items():
        # Rounding, and numerical derivatives: far below the errors.
        assert found[name][0] == pytest.approx(value, abs=0.01 * error), name
        assert found[name][1] == pytest.approx(error, rel=0.01), name


def test_known_values_are_used(
    identify: Identify, benches: dict[str, Table], defaults: dict, tmp_path: Path
) -> None:
    """A membrane of another area: forces are proportional to it at the same pressures."""
    table = benches["defaults"].measured(1)
    known = tmp_path / "known.ssv"
    text = (ROOT / "parameters" / "strong_spring.ssv").read_text()
    start, end = text.index("<ssv:Parameter "), text.index("</ssv:Parameters>")
    parameter = '<ssv:Parameter name="actuator.membrane_area"><ssv:Real value="1.65e-3"/></ssv:Parameter>'
    known.write_text(text[:start] + parameter + text[end:])
    smaller, larger = estimates(defaults), estimates(identify(table, "--parameters", known))
    for name in SPRING | {"actuator.coulomb_friction"}:
        assert larger[name][0] == pytest.approx(1.1 * smaller[name][0], abs=0.1 * smaller[name][1]), name


def test_a_unit_that_makes_no_sense_of_the_data_is_named(
    lab: Run, exported: Path, benches: dict[str, Table], tmp_path: Path
) -> None:
    data = benches["defaults"].between(0, 1).write(tmp_path / "data.csv")
    data.write_text(data.read_text().replace("tank_pressure", "tank_pressure (MPa)"))
    done = lab(
        "identify", "actuator", data, "--plant", exported / "BoostPlant.fmu", "--out", tmp_path / "out"
    )
    assert done.returncode == 2
    assert "data.csv: line 2, tank_pressure: expected 1000 to 1000000 Pa, found 3" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("begin", "end", "message"),
    [
        (0, 2.5, "lines 2 to 201: expected duty steps, each held for more than a second; of 1 phases"),
        (
            380,
            400,
            "eq. (7) needs 6 duties at which the chamber rests between tank and ambient pressure",
        ),
    ],
)
def test_data_without_information_are_refused(
    lab: Run,
    exported: Path,
    benches: dict[str, Table],
    tmp_path: Path,
    begin: float,
    end: float,
    message: str,
) -> None:
    """Too few rows, or no step."""
    data = benches["defaults"].measured(1).between(begin, end).write(tmp_path / "data.csv")
    done = lab(
        "identify", "actuator", data, "--plant", exported / "BoostPlant.fmu", "--out", tmp_path / "out"
    )
    assert done.returncode == 2
    assert f"{data}, lines 2 to" in done.stderr
    assert message in done.stderr
    assert not (tmp_path / "out").exists()
