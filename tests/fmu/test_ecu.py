"""The controller's firmware on QEMU's Cortex-M7: in the loop as an FMU, and calibrated by its A2L."""

import itertools
import os
import random
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from pya2l.parser import A2lParser

from fmu import ROOT, TARGET
from fmu.master import Fmu, Instance, Reals

IN_THE_LOOP = TARGET / "ecu/BoostControllerInTheLoop.fmu"
CONTROLLER = TARGET / "fmu/BoostController.fmu"
SINGLE_PRECISION = TARGET / "ecu/single/BoostController.fmu"
PERIOD = 0.0125


@pytest.mark.parametrize("figure", ["figure_13", "figure_14"])
def test_a_figure_is_that_of_the_fmu(figure: str, tmp_path: Path) -> None:
    """Each record is the same to the last bit, with the firmware in place of the controller."""
    command = [TARGET / "debug/cargo-fmu", "simulate", ROOT / f"boost/lab/scenarios/{figure}.toml"]
    replaced = ["--fmu", f"controller={IN_THE_LOOP}"]
    for name, others in [("own.csv", []), ("firmware.csv", replaced)]:
        subprocess.run([*command, *others, "--out", tmp_path / name], cwd=ROOT, check=True)
    own, of_firmware = ((tmp_path / name).read_bytes() for name in ("own.csv", "firmware.csv"))
    assert own.count(b"\n") > 3000
    assert own == of_firmware


def test_single_precision_moves_boost_by_less_than_a_sensor_resolves(tmp_path: Path) -> None:
    """16 bits over 130 kPa are 2 Pa."""
    records = []
    for name, fmu in [("double", CONTROLLER), ("single", SINGLE_PRECISION)]:
        command = [TARGET / "debug/cargo-fmu", "simulate", ROOT / "boost/lab/scenarios/figure_13.toml"]
        record = tmp_path / f"{name}.csv"
        subprocess.run([*command, "--fmu", f"controller={fmu}", "--out", record], cwd=ROOT, check=True)
        records.append(np.genfromtxt(record, delimiter=",", names=True)["boost_pressure"])
    double, single = records
    assert 0 < np.abs(double - single).max() < 2


class Driven:
    """An instance that is driven by measurements."""

    def __init__(self, file: Path, folder: Path, values: dict[str, float]) -> None:
        self.instance = Instance(Fmu(file, folder)).start(values)
        variables = self.instance.fmu.variables.values()
        reals = [v.name for v in variables if v.type == "Real" and v.causality != "independent"]
        self.results = Reals(self.instance, reals)
        self.commands = Reals(self.instance, self.instance.fmu.named("output"))
        self.time = 0.0

    def step(self, measured: dict[str, float]) -> tuple[float, ...]:
        """The commands after a sample."""
        self.instance.set(measured)
        self.instance.slave.doStep(self.time, PERIOD)
        self.time += PERIOD
        return tuple(self.commands.get())

    def refusals(self) -> list[str]:
        """Why the firmware has refused parameters."""
        messages = (message.text for message in self.instance.messages)
        return [text for text in messages if "the parameters stay as they were" in text]


@pytest.fixture
def start(tmp_path: Path):
    """Starts instances of FMUs."""
    started = []

    def start(file: Path, **values: float) -> Driven:
        started.append(Driven(file, tmp_path / str(len(started)), values))
        return started[-1]

    yield start
    for driven in started:
        driven.instance.free()


@pytest.fixture
def socket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The socket of the next processor's debugger."""
    socket = tmp_path / "gdb"
    monkeypatch.setenv("ECU_QEMU_ARGUMENTS", f"-gdb unix:{socket},server=on,wait=off")
    return socket


def measurements(seed: int) -> Iterator[dict[str, float]]:
    """Noisy measurements of a drive at random, in which boost pressure follows its reference."""
    noise = random.Random(seed)
    reference, engine_speed, boost_pressure, shaft_speed = 150e3, 2000.0, 150e3, 9e4
    aimed = engine_speed
    for number in itertools.count():
        if number % 100 == 50:
            reference = noise.uniform(125e3, 180e3)
            aimed = noise.uniform(1500, 4500)
        engine_speed += max(-10.0, min(10.0, aimed - engine_speed))
        boost_pressure += 0.02 * (reference - boost_pressure)
        shaft_speed += 0.01 * (boost_pressure - 60e3 - shaft_speed)
        yield {
            "boost_reference": reference,
            "boost_pressure": boost_pressure + noise.gauss(0, 100),
            "engine_speed": engine_speed + noise.gauss(0, 10),
            "supply_voltage_measured": 13 + noise.gauss(0, 0.2),
            "tank_pressure": noise.uniform(2e4, 4e4),
            "ambient_pressure": 95e3,
            "ambient_temperature": 303.0,
            "hp_turbo_speed": shaft_speed,
        }


def drive(instances: list[Driven], measurements: Iterable[dict[str, float]]) -> list[tuple[float, ...]]:
    """Drives instances, which give the same. Returns their commands."""
    commands = []
    for number, measured in enumerate(measurements):
        found = [instance.step(measured) for instance in instances]
        assert found == [found[0]] * len(found), number
        commands.append(found[0])
    return commands


def test_a_noisy_drive_is_that_of_the_fmu(start) -> None:
    firmware, own = start(IN_THE_LOOP), start(CONTROLLER)
    commands = drive([firmware, own], itertools.islice(measurements(20), 1200))
    assert len({duty for duty, *_ in commands}) > 1000
    assert own.instance.get("fault_code") == 0
    assert firmware.results.get().tolist() == own.results.get().tolist()


def test_single_precision_takes_the_nearest_of_its_numbers(start) -> None:
    single = start(SINGLE_PRECISION).instance
    single.set({"boost_pressure": 100000.01})
    assert single.get("boost_pressure") == float(np.float32(100000.01))


@pytest.mark.parametrize("period", [0.005, 0.01, 0.0125, 0.02])
def test_samples_of_single_precision_are_at_the_same_times(start, period: float) -> None:
    """A period that was rounded down would give two samples in the first step."""
    counts = []
    for file in [CONTROLLER, SINGLE_PRECISION]:
        instance = start(file, sample_time=period).instance
        found = []
        for number in range(300):
            instance.slave.doStep(number * period, period)
            found.append(instance.get("sample_count"))
        counts.append(found)
    assert counts[0] == counts[1]


def characteristics() -> dict[str, tuple[int, tuple[int, ...]]]:
    """The maps, curves, blocks and values of the A2L: address, and sizes along the axes."""
    with A2lParser() as parser:
        (module,) = parser.tree_from_a2l((TARGET / "ecu/ecu.a2l").read_bytes()).PROJECT.MODULE
        found = {}
        for known in module.CHARACTERISTIC:
            sizes = tuple(axis.MaxAxisPoints.Value for axis in known.AXIS_DESCR)
            found[known.Name.Value] = (known.Address.Value, sizes)
        points = {known.Name.Value for known in module.AXIS_PTS}
        measured = {known.Name.Value for known in module.MEASUREMENT}
    assert points == {
        f"{schedule}.{axis}"
        for schedule in ("schedule", "range_schedule")
        for axis in ("engine_speed", "boost_reference")
    }
    assert {"hp_wastegate_pwm", "boost_pressure", "freeze_frame.time"} <= measured
    return found


def write(socket: Path, address: int, values: np.ndarray) -> None:
    """Writes doubles to the memory of the running processor, by its debugger."""
    content = socket.with_name("written.bin")
    content.write_bytes(values.astype("<f8").tobytes())
    command = ["gdb-multiarch", "-batch", "-nx"]
    for line in [
        "set architecture arm",
        f"target remote {socket}",
        f"restore {content} binary {address:#x}",
        "detach",
    ]:
        command += ["-ex", line]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "Restoring" in done.stdout, done.stdout + done.stderr


def test_a_map_written_at_its_address_acts_on_the_next_command(start, socket: Path) -> None:
    firmware, own, unchanged = start(IN_THE_LOOP), start(CONTROLLER), start(CONTROLLER)
    measured = list(itertools.islice(measurements(1), 150))
    drive([firmware, own, unchanged], measured[:100])
    name = "range_schedule.gain"
    address, sizes = characteristics()[name]
    assert sizes == (12, 16), "engine speeds along a row, then boost pressures"
    elements = [f"{name}[{row + 1},{column + 1}]" for row in range(16) for column in range(12)]
    values = 1.2 * own.instance.reals(elements)
    write(socket, address, values)
    own.instance.set(dict(zip(elements, values, strict=True)))
    commands = drive([firmware, own], measured[100:])
    assert commands[0] != unchanged.step(measured[100])
    assert not firmware.refusals()


def test_a_page_with_a_fault_is_refused(start, socket: Path) -> None:
    firmware, own = start(IN_THE_LOOP), start(CONTROLLER)
    measured = measurements(5)
    drive([firmware, own], itertools.islice(measured, 50))
    address, _ = characteristics()["range_schedule.gain"]
    for number, wrong in enumerate([0.0, np.nan, 1e9]):
        write(socket, address, np.array([wrong]))
        drive([firmware, own], itertools.islice(measured, 20))
        refusals = firmware.refusals()
        assert len(refusals) == number + 1, refusals
        assert "range_schedule.gain[1,1]" in refusals[-1]


def test_an_ecu_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    environment = {**os.environ, "PATH": str(tmp_path)}
    command = [TARGET / "debug/cargo-fmu", "simulate", IN_THE_LOOP, "--stop-time", "0.1"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 2
    assert "qemu-system-arm cannot be started" in done.stderr


def test_the_template_computes_the_same_as_firmware(tmp_path: Path) -> None:
    """The firmware prints its commands with all digits; each measurement is half the command before."""
    printed = [float(line) for line in (TARGET / "ecu-template/commands.txt").read_text().split()]
    instance = Instance(Fmu(TARGET / "ecu-template/fmu/PiController.fmu", tmp_path)).start()
    period = instance.get("sample_time")
    commands = []
    for number in range(10):
        instance.set({"measurement": 0.5 * instance.get("command")})
        instance.slave.doStep(number * period, period)
        commands.append(instance.get("command"))
    instance.free()
    assert commands == printed
