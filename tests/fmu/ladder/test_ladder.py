"""The ladder's FMUs in FMPy, and called directly: against closed forms, against solutions that SciPy computes
without them, and against the results of Reference-FMUs (reference/)."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import zipfile
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2CoSimulation, fmi2ModelExchange
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.linalg import expm
from scipy.optimize import brentq

from fmu.exporter.importer import Instance, Library, Status
from fmu.ladder import FMUS, STEPPERS
from fmu.master import Fmu

pytestmark = pytest.mark.quick

REFERENCE = Path(__file__).parent / "reference"
LADDER = ["Dahlquist", "VanDerPol", "BouncingBall", "Stair", "Feedthrough", "Resource"]
OTHERS = ["NeuralLayer", "StickSlip", "Furnace", "PiController", "Cascade", "Battery", "Pack", "DriveCycle"]
TOLERANCE = 1e-10
"""What the solvers are asked for."""
INTERFACES = {
    "co-simulation": {"fmi_type": "CoSimulation", "relative_tolerance": TOLERANCE},
    "CVode": {"fmi_type": "ModelExchange", "solver": "CVode", "relative_tolerance": TOLERANCE},
    "Euler": {"fmi_type": "ModelExchange", "solver": "Euler"},
}
ALL = pytest.mark.parametrize("interface", INTERFACES)
ACCURATE = pytest.mark.parametrize("interface", ["co-simulation", "CVode"])
EPSILON = np.finfo(float).eps
HYSTERESIS = 1e-12
"""By how much an importer sees an event indicator shifted (crates/fmu-solve/src/events.rs)."""


def simulate(fmu, interface, **arguments):
    return simulate_fmu(fmu, **INTERFACES[interface], **arguments)


def reference(model):
    """What Reference-FMUs' fmusim printed for its own FMU, all digits: co-simulation in which explicit Euler
    takes fixed steps, of 0.1 s (Dahlquist), 0.01 s (Van der Pol) and 0.001 s (ball), with events at their
    ends."""
    file = REFERENCE / f"{model}_out.csv"
    return np.genfromtxt(file, delimiter=",", names=True, dtype=None, encoding="utf-8")


# All models


@pytest.mark.parametrize("model", [*LADDER, *OTHERS])
def test_validators_find_nothing(fmu, model):
    assert validate_fmu(fmu(model)) == []
    command = [FMUS.parents[1] / "debug" / "cargo-fmu", "validate", fmu(model)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 errors, 0 warnings" in done.stdout


@pytest.mark.parametrize("model", [*LADDER, *OTHERS])
def test_packages_are_short(model):
    """Lines that are not blank, with the tests. The key `links` is one that halves the first build."""
    files = ["Cargo.toml", "build.rs", "model.json", "src/lib.rs"]
    texts = [(FMUS.parent / model / file).read_text() for file in files]
    lines = sum(bool(line.strip()) for text in texts for line in text.splitlines())
    assert lines <= {"VanDerPol": 41, "StickSlip": 107, "Cascade": 111, "Battery": 126, "Pack": 111}.get(
        model, 91
    )


def interface_of(root):
    """The variables by their names: what importers know them by, and what they may do with them."""
    variables = {}
    for variable in root.findall("ModelVariables/ScalarVariable"):
        (data_type,) = variable.findall("*")
        continuous = "continuous" if data_type.tag == "Real" else "discrete"
        start = data_type.get("start")
        variables[variable.get("name")] = (
            variable.get("valueReference"),
            variable.get("causality", "local"),
            variable.get("variability", continuous),
            data_type.tag,
            float(start) if data_type.tag == "Real" and start else start,
            data_type.get("derivative"),
            data_type.get("reinit"),
            data_type.get("declaredType") if data_type.tag == "Enumeration" else None,
            *(float(data_type.get(name, "nan")) for name in ("min", "max")),
        )
    return variables


@pytest.mark.parametrize("model", LADDER)
def test_variables_are_those_of_the_reference_fmu(fmu2, model):
    with zipfile.ZipFile(fmu2(model)) as archive:
        ours = ElementTree.fromstring(archive.read("modelDescription.xml"))
    theirs = ElementTree.parse(REFERENCE / f"{model}.xml").getroot()
    assert repr(interface_of(ours)) == repr(interface_of(theirs))
    assert ours.get("numberOfEventIndicators") == theirs.get("numberOfEventIndicators")
    assert ours.find("ModelExchange") is not None
    assert ours.find("CoSimulation") is not None


# Dahlquist


DECAY_TOLERANCE = 100 * TOLERANCE
"""An error of the tolerance in each of 100 intervals; what a solver adds by further steps decays as the state
does."""


@ACCURATE
@pytest.mark.parametrize("k", [1.0, 0.3])
def test_decay_is_exponential(fmu, interface, k):
    result = simulate(fmu("Dahlquist"), interface, start_values={"k": k}, stop_time=10, output_interval=0.1)
    assert len(result) == 101
    assert np.abs(result["x"] - np.exp(-k * result["time"])).max() < DECAY_TOLERANCE


def test_euler_gives_the_reference_results_of_dahlquist(fmu):
    result = simulate(fmu("Dahlquist"), "Euler", stop_time=10, output_interval=0.1)
    theirs = reference("Dahlquist")
    assert len(result) == len(theirs) == 101
    # A multiplication and an addition in each of 100 steps, of numbers up to 1.
    assert np.abs(result["x"] - theirs["x"]).max() < 200 * EPSILON
    # That the file is Euler's: (1 - h k)^n.
    assert np.abs(theirs["x"] - 0.9 ** np.arange(101)).max() < 200 * EPSILON


# Van der Pol


TIMES = np.arange(2001) * 0.01


def van_der_pol(_time, state):
    return [state[1], (1 - state[0] ** 2) * state[1] - state[0]]


@cache
def van_der_pol_solution():
    """By SciPy's DOP853 without an FMU; Radau's shows that it is accurate to 1e-11."""
    by = {
        method: solve_ivp(van_der_pol, [0, 20], [2, 0], method, TIMES, rtol=tolerance, atol=tolerance).y
        for method, tolerance in (("DOP853", 1e-13), ("Radau", 1e-12))
    }
    assert np.abs(by["DOP853"] - by["Radau"]).max() < 1e-11
    return by["DOP853"]


@cache
def stretch():
    """By how much an error may grow on the limit cycle: one along the path remains a difference in time,
    which is the larger the faster the state moves; others shrink."""
    speed = np.hypot(*van_der_pol(0.0, van_der_pol_solution()))
    return speed.max() / speed.min()


def off(result):
    """The largest difference to the solution; a result has both states at all times."""
    return np.abs(np.asarray(result) - van_der_pol_solution()).max()


@ACCURATE
def test_van_der_pol_follows_the_solution(fmu, interface):
    result = simulate(fmu("VanDerPol"), interface, stop_time=20, output_interval=0.01)
    # An error of the tolerance in each of the 2000 intervals, relative to 1 and a state of up to 2.7
    # together.
    assert off([result["x0"], result["x1"]]) < 2000 * 3.7 * TOLERANCE * stretch()


def test_euler_gives_the_reference_results_of_van_der_pol(fmu):
    result = simulate(fmu("VanDerPol"), "Euler", stop_time=20, output_interval=0.01)
    theirs = reference("VanDerPol")
    assert len(result) == len(theirs) == 2001
    for name in ("x0", "x1"):
        # Some ten roundings of numbers up to 8 in each of 2000 steps, times the step of 0.01.
        assert np.abs(result[name] - theirs[name]).max() < 2000 * 10 * 8 * EPSILON * 0.01 * stretch()
    # Euler's results are not the solution: they are off by a third of the amplitude.
    assert off([theirs["x0"], theirs["x1"]]) > 0.3


# The ball


GRAVITY, SMALLEST = 9.81, 0.1


class Ball:
    """The closed form: a fall from 1 m, and parabolas that shrink by e until a bounce is slower than 0.1
    m/s."""

    def __init__(self, e):
        velocity = math.sqrt(2 * GRAVITY)
        self.times, self.impacts, self.after = [velocity / GRAVITY], [velocity], []
        while True:
            velocity *= e
            if velocity < SMALLEST:
                self.after.append(0.0)
                break
            self.after.append(velocity)
            self.times.append(self.times[-1] + 2 * velocity / GRAVITY)
            self.impacts.append(velocity)

    def height(self, time):
        if time < self.times[0]:
            return 1 - 0.5 * GRAVITY * time**2
        (bounce,) = np.flatnonzero(np.array(self.times) <= time)[-1:]
        since = time - self.times[bounce]
        return self.after[bounce] * since - 0.5 * GRAVITY * since**2 if self.after[bounce] else 0.0


def lateness(ball, e, depth):
    """How late the last bounce may be where the importer finds each impact at a depth in m. Bounce n is late
    by depth/v; the ball is faster by g times this, and each flight of the rest longer by 2 e^k times it."""
    return sum((1 + 2 * e / (1 - e)) * depth / velocity for velocity in ball.impacts)


@pytest.mark.parametrize("e", [0.7, 0.5])
def test_the_ball_bounces_at_the_right_times_under_cvode(fmu, e):
    ball = Ball(e)
    result = simulate(fmu("BouncingBall"), "CVode", start_values={"e": e}, stop_time=3, output_interval=0.01)
    before = np.flatnonzero(np.diff(result["time"]) == 0)
    assert len(before) == len(ball.times)
    assert result["h"].min() > -2 * TOLERANCE
    assert result["h"][-1] == result["v"][-1] == 0.0
    off = np.abs(result["time"][before] - ball.times)
    # The solver's h is off by its tolerance, relative to 1 m.
    assert off.max() < lateness(ball, e, HYSTERESIS + TOLERANCE)
    # An error of the time is one of the velocity, which is off by the tolerance relative to 1 and 4.4 m/s
    # together.
    assert np.abs(result["v"][before + 1] - ball.after).max() < GRAVITY * off.max() + 5.4 * TOLERANCE


def test_the_ball_follows_its_parabolas_in_co_simulation(fmu, instance):
    ball = Ball(0.7)
    result = simulate(fmu("BouncingBall"), "co-simulation", stop_time=3, output_interval=0.01)
    assert len(result) == 301
    # The built-in integrator is exact for parabolas and finds an impact to the last bit of the time, up to
    # 2.5 s: by that the height at the impact is off by at most 4.43 m/s times 2 bits, and what follows by its
    # lateness.
    late = lateness(ball, 0.7, 4.43 * 2 * 2.5 * EPSILON)
    heights = [ball.height(time) for time in result["time"]]
    assert np.abs(result["h"] - heights).max() < 4.43 * late
    # In one step, with all the bounces in it.
    one = instance("BouncingBall", fmi2CoSimulation, tolerance=TOLERANCE)
    assert one.step(0.0, 2.48) == Status.OK
    assert one.get("h") == pytest.approx(ball.height(2.48), abs=4.43 * late)
    assert one.step(2.48, 0.52) == Status.OK
    assert (one.get("h"), one.get("v"), one.get("der(v)")) == (0.0, 0.0, 0.0)


def test_euler_gives_the_reference_results_of_the_ball(fmu):
    arguments = {"stop_time": 3, "output_interval": 0.001, "record_events": False}
    result, theirs = simulate(fmu("BouncingBall"), "Euler", **arguments)[::10], reference("BouncingBall")
    assert len(result) == len(theirs) == 301
    for name in ("h", "v"):
        # A rounding of numbers up to 4.4 in each of 3000 steps.
        assert np.abs(result[name] - theirs[name]).max() < 3000 * 4.4 * EPSILON


# Stick-slip


def stick_slip(times, static, sliding):
    """Position and speed in closed form: a block of 1 kg, a spring of 100 N/m whose end moves at 0.1 m/s.
    While it slips the spring's extension swings about sliding/k, from static/k with the speed v; it sticks
    again where the extension's speed is v once more, at the mirrored extension, and until that has grown by
    twice the amplitude."""
    k, omega, v = 100.0, 10.0, 0.1
    amplitude = (static - sliding) / k
    slip = 2 * (math.pi - math.atan(amplitude * omega / v)) / omega
    period = slip + 2 * amplitude / v
    since = times - static / k / v
    phase = np.where(since < 0, 0, np.minimum(since % period, slip))
    extension = sliding / k + amplitude * np.cos(omega * phase) + v / omega * np.sin(omega * phase)
    rate = -amplitude * omega * np.sin(omega * phase) + v * np.cos(omega * phase)
    slips = (since >= 0) & (since % period < slip)
    # While it sticks, it stays where it was when it stopped.
    end = np.where(since < 0, 0, np.where(slips, times, times - since % period + slip))
    position = np.where(since < 0, 0, v * end - extension)
    return position, np.where(slips, v - rate, 0)


@pytest.mark.parametrize("interface", ["co-simulation", "CVode"])
@pytest.mark.parametrize(("static", "sliding"), [(2, 1), (1.5, 0.25)])
def test_the_block_sticks_and_slips_in_closed_form(fmu, interface, static, sliding):
    start = {"static_friction": static, "sliding_friction": sliding}
    result = simulate(fmu("StickSlip"), interface, start_values=start, stop_time=3, output_interval=0.01)
    position, speed = stick_slip(result["time"], static, sliding)
    assert np.count_nonzero(np.diff(speed == 0)) >= 7
    # An error of the tolerance in each of 300 intervals. The speed swings with 10 1/s: it has ten times the
    # position's error.
    bound = 300 * TOLERANCE
    assert np.abs(result["position"] - position).max() < bound
    assert np.abs(result["speed"] - speed).max() < 10 * bound


# Furnace


@pytest.mark.parametrize("interface", ["co-simulation", "CVode"])
def test_valve_and_mass_of_the_furnace_follow_the_matrix_exponential(fmu, interface):
    """The equations are linear: with the constant input as a fourth state, x(t) = exp(A t) x(0)."""
    command = {"command": 0.75}
    result = simulate(fmu("Furnace"), interface, start_values=command, stop_time=1, output_interval=0.01)
    # The columns: opening, speed, temperature above ambient, command.
    matrix = np.array([[0, 1, 0, 0], [-4e4, -100, 0, 4e4], [2e5 / 5e4, 0, -100 / 5e4, 0], [0, 0, 0, 0]])
    expected = np.array([expm(matrix * time) @ [0, 0, 0, 0.75] for time in result["time"]])
    assert expected[:, 0].max() > 0.9, "the valve does not overshoot its command"
    # An error of the tolerance, relative to nominal 1 and 1000 and the state, in each of a few hundred steps.
    assert np.abs(result["opening"] - expected[:, 0]).max() < 1000 * TOLERANCE
    assert np.abs(result["temperature"] - 300 - expected[:, 2]).max() < 1000 * 1300 * TOLERANCE


# Stair


def test_the_stair_ends_co_simulation(fmu, instance):
    result, theirs = simulate(fmu("Stair"), "co-simulation", output_interval=0.2), reference("Stair")
    assert list(result["counter"]) == list(theirs["counter"])
    assert list(result["time"]) == pytest.approx(list(theirs["time"]), abs=1e-12)
    stair = instance("Stair", fmi2CoSimulation)
    for step in range(17):
        assert stair.step(0.5 * step, 0.5) == Status.OK
    assert stair.step(8.5, 1.0) == Status.DISCARD
    assert stair.end() == (9.0, True)
    assert stair.get("counter") == 10


@pytest.mark.parametrize("interface", ["CVode", "Euler"])
def test_the_stair_ends_model_exchange(fmu, interface):
    result = simulate(fmu("Stair"), interface, output_interval=0.2)
    # FMPy samples before each event and after it, but not after that which ends the simulation.
    assert result["time"][-1] == 9.0
    before = np.flatnonzero(np.diff(result["time"]) == 0)
    assert list(result["time"][before]) == list(range(1, 9)) + [9.0][: len(before) - 8]
    theirs = reference("Stair")
    regular = np.setdiff1d(np.arange(len(result)), before)
    assert list(result["counter"][regular][:45]) == list(theirs["counter"][:45])


@pytest.mark.parametrize(
    ("start_time", "counter", "end"), [(0.0, 1, 9.0), (-0.5, 4, 5.0), (1e6, 9, 1000001.0)]
)
def test_the_stair_has_its_events_at_whole_seconds(exchange, start_time, counter, end):
    stair = exchange("Stair", {"counter": counter}, start_time)
    events = [(start_time, stair.get("counter"))]
    while not stair.terminates:
        stair.advance(stair.next_event)
        stair.event()
        events.append((stair.time, stair.get("counter")))
    first = math.floor(start_time) + 1
    later = [(first + number, counter + 1 + number) for number in range(10 - counter)]
    assert events == [(start_time, counter), *later]
    assert later[-1][0] == end


def test_the_counter_starts_where_the_importer_says(instance):
    assert instance("Stair", fmi2CoSimulation, start_values={"counter": 7}).get("counter") == 7
    with pytest.raises(AssertionError, match="11 for the variable counter is outside its range"):
        instance("Stair", fmi2CoSimulation, start_values={"counter": 11})
    stair = instance("Stair", fmi2CoSimulation)
    refused = stair.refuses(*stair.settings({"counter": 2}), names=["counter"])
    assert "cannot be set in the state stepComplete" in refused


# Feedthrough


VALUES = {
    "Float64_continuous": 2.5,
    "Float64_discrete": -3.5,
    "Int32": -7,
    "Boolean": True,
    "String": "größer als FMI",
    "Enumeration": 2,
}


@ALL
def test_outputs_are_inputs(fmu, interface):
    outputs = [f"{name}_output" for name in VALUES]
    start_values = {f"{name}_input": value for name, value in VALUES.items()}
    result = simulate(fmu("Feedthrough"), interface, start_values=start_values, output=outputs)
    for name in VALUES.keys() - {"String"}:
        assert (result[f"{name}_output"] == VALUES[name]).all(), name
    # FMPy records no strings.
    assert "String_output" not in result.dtype.names


@ALL
def test_inputs_of_a_file_pass_through(fmu, interface):
    """Discrete inputs change at 1 s, which in Model Exchange is an event."""
    inputs = np.array(
        [(0.0, 1.0, -1.0, 1, False, 1), (1.0, 3.0, -2.0, 2, True, 2)],
        dtype=[
            ("time", float),
            ("Float64_continuous_input", float),
            ("Float64_discrete_input", float),
            ("Int32_input", int),
            ("Boolean_input", bool),
            ("Enumeration_input", int),
        ],
    )
    outputs = [f"{name}_output" for name in VALUES if name != "String"]
    result = simulate(fmu("Feedthrough"), interface, input=inputs, output=outputs, output_interval=0.25)
    assert result[["time", *outputs]][0].tolist() == (0.0, 1.0, -1.0, 1, False, 1)
    assert result[["time", *outputs]][-1].tolist() == (2.0, 3.0, -2.0, 2, True, 2)
    # In co-simulation FMPy sets inputs before each step, and holds them.
    if interface != "co-simulation":
        half = result[result["time"] == 0.5]
        assert half["Float64_continuous_output"] == 2.0
        assert half["Int32_output"] == 1


def test_every_type_passes_through_another_importer(instance):
    for kind in (fmi2CoSimulation, fmi2ModelExchange):
        feedthrough = instance("Feedthrough", kind)
        assert feedthrough.get("String_output") == b"Set me!"
        assert feedthrough.set({f"{name}_input": value for name, value in VALUES.items()}) == Status.OK
        for name, value in VALUES.items():
            assert feedthrough.get(f"{name}_output") == (value.encode() if name == "String" else value)
        assert feedthrough.set({"Float64_tunable_parameter": 4.0}) == Status.OK
        assert feedthrough.get("Float64_tunable_parameter") == 4.0


def test_discrete_inputs_change_at_events_alone(instance):
    feedthrough = instance("Feedthrough", fmi2ModelExchange)
    assert feedthrough.new_discrete_states().newDiscreteStatesNeeded == 0
    feedthrough.ok("fmi2EnterContinuousTimeMode")
    assert feedthrough.set({"Float64_continuous_input": 2.0}) == Status.OK
    assert feedthrough.get("Float64_continuous_output") == 2.0
    for name in VALUES.keys() - {"Float64_continuous"}:
        refused = feedthrough.refuses(*feedthrough.settings({f"{name}_input": VALUES[name]}))
        assert re.search(f"{name}_input .* cannot be set in the state Continuous-Time Mode", refused)


@ALL
def test_without_inputs_the_results_are_those_of_the_reference_fmu(fmu, interface):
    theirs = reference("Feedthrough")
    outputs = [f"{name}_output" for name in VALUES if name != "String"]
    result = simulate(fmu("Feedthrough"), interface, output=outputs, output_interval=0.1)
    assert len(result) == len(theirs) == 21
    for name in outputs:
        assert (result[name] == theirs[name]).all(), name


def test_a_step_to_no_time(instance):
    """The sum of two finite times may be infinite."""
    late = instance("VanDerPol", fmi2CoSimulation, start_time=1.7e308)
    assert "the step from 1.7e308 ends at inf" in late.refuses("fmi2DoStep", 1.7e308, 1e308, 1)


# Resource


@pytest.mark.compiled
@ALL
def test_the_number_is_read_from_the_file(fmu, interface, tmp_path):
    result = simulate(fmu("Resource"), interface, output_interval=1)
    assert list(result["y"]) == list(reference("Resource")["y"]) == [97, 97]
    changed = tmp_path / "changed.fmu"
    with zipfile.ZipFile(fmu("Resource")) as old, zipfile.ZipFile(changed, "w") as new:
        for name in old.namelist():
            new.writestr(name, b"Z" if name == "resources/y.txt" else old.read(name))
    assert set(simulate(changed, interface)["y"]) == {ord("Z")}
    missing = tmp_path / "missing.fmu"
    with zipfile.ZipFile(fmu("Resource")) as old, zipfile.ZipFile(missing, "w") as new:
        for name in old.namelist():
            if name != "resources/y.txt":
                new.writestr(name, old.read(name))
    with pytest.raises(FMICallException):
        simulate(missing, interface)


@pytest.mark.compiled
@pytest.mark.parametrize("kind", [fmi2CoSimulation, fmi2ModelExchange])
def test_a_file_that_cannot_be_read_is_named(instance, tmp_path, kind):
    unread = r"the resource y\.txt cannot be read: "
    assert instance("Resource", kind).get("y") == 97
    with pytest.raises(AssertionError, match=unread + "fmuResourceLocation was NULL"):
        instance("Resource", kind, resources=None)
    elsewhere = tmp_path / "no resources"
    with pytest.raises(AssertionError, match=unread + r".*no resources/y\.txt"):
        instance("Resource", kind, resources=elsewhere.as_uri().encode())
    elsewhere.mkdir()
    shutil.copy(os.devnull, elsewhere / "y.txt")
    with pytest.raises(AssertionError, match=r"the resource y\.txt is empty"):
        instance("Resource", kind, resources=elsewhere.as_uri().encode())


# The layer of a neural network


@ALL
def test_the_layer_is_that_of_its_file(fmu, interface):
    path = fmu("NeuralLayer")
    with zipfile.ZipFile(path) as archive, archive.open("resources/weights.csv") as file:
        rows = np.loadtxt(file, delimiter=",")
    assert rows.shape == (4, 4)
    u = [0.5, -1.25, 2.0]
    is_array = read_model_description(path).fmiVersion.startswith("3")
    inputs = {"u": u} if is_array else {f"u[{number + 1}]": value for number, value in enumerate(u)}
    output = ["y"] if is_array else [f"y[{number}]" for number in range(1, 5)]
    result = simulate(path, interface, start_values=inputs, output=output, output_interval=0.5)
    found = result["y"] if is_array else np.array([result[name] for name in output]).T
    assert len(found) > 1
    # Four products, and the tangent of another library.
    expected = np.tanh(rows[:, 1:] @ u + rows[:, 0])
    assert np.allclose(found, expected, rtol=16 * EPSILON, atol=16 * EPSILON)


def test_a_file_of_another_size_is_refused(fmu2, tmp_path):
    changed = tmp_path / "changed.fmu"
    for content in (b"1,2,3,4\n", b"1,2,3\n" * 4, b"1,2,3,four\n" * 4):
        with zipfile.ZipFile(fmu2("NeuralLayer")) as old, zipfile.ZipFile(changed, "w") as new:
            for name in old.namelist():
                new.writestr(name, content if name.endswith("weights.csv") else old.read(name))
        with pytest.raises(FMICallException):
            simulate(changed, "co-simulation")


# The battery


@ACCURATE
def test_the_weakest_cell_trips_the_battery(fmu, interface):
    """Charges fall at a constant rate; SciPy tells the voltage over them, and where it is the least one."""
    path = fmu("Battery")
    with zipfile.ZipFile(path) as archive, archive.open("resources/voltage.csv") as file:
        charges, voltages = np.loadtxt(file, delimiter=",", skiprows=1).T
    curve = PchipInterpolator(charges, voltages)
    is_array = read_model_description(path).fmiVersion.startswith("3")
    cells = ["cell_voltage"] if is_array else [f"cell_voltage[{number}]" for number in range(1, 13)]
    current, resistance, least = 3.0, 0.03, 3.0
    values = {"current": current, "resistance": resistance}
    result = simulate(path, interface, start_values=values, output=[*cells, "voltage", "is_tripped"])
    starts = np.array([0.9, 0.91, 0.9, 0.89, 0.9, 0.88, 0.9, 0.92, 0.9, 0.9, 0.89, 0.9])
    rate, drop = current / 7200, current * resistance
    trip = (starts.min() - brentq(lambda charge: curve(charge) - drop - least, 0.05, 0.5, xtol=1e-15)) / rate
    # FMPy has rows at the event, a little before or after it.
    result = result[np.abs(result["time"] - trip) > 1e-3]
    times = result["time"]
    is_closed = times < trip
    assert 50 < is_closed.sum() < len(times) - 50
    assert np.array_equal(result["is_tripped"].astype(bool), ~is_closed)
    expected = curve(starts - rate * np.minimum(times, trip)[:, None]) - drop * is_closed[:, None]
    found = result["cell_voltage"] if is_array else np.array([result[name] for name in cells]).T
    # The charges fall along a straight line, which solvers follow but for their tolerance; the place of the
    # trip adds some. The curve's slope is below 20 V.
    assert np.abs(found - expected).max() < 20 * 100 * TOLERANCE
    assert np.abs(result["voltage"] - expected.sum(axis=1) * is_closed).max() < 12 * 20 * 100 * TOLERANCE


# The pack


@ACCURATE
def test_the_cells_of_the_pack_heat_each_other(fmu, interface):
    """C T' = K T + q, with the Laplacian of a row, from one warmer cell: by a matrix's exponential."""
    names = [f"cell[{number}].T" for number in range(1, 25)]
    start_values = {"current": 3.0, "cell[5].T": 320.0, "cell[5].resistance": 0.05}
    result = simulate(fmu("Pack"), interface, start_values=start_values, output=[*names, "voltage", "T_max"])
    resistance = np.full(24, 0.02)
    resistance[[2, 16]], resistance[[7, 20]], resistance[11], resistance[4] = 0.021, 0.019, 0.03, 0.05
    laplacian = np.diag(np.full(23, 0.5), 1) + np.diag(np.full(23, 0.5), -1)
    laplacian -= np.diag(laplacian.sum(axis=0))
    rates = np.block([[laplacian / 40, resistance[:, None] * 9 / 40], [np.zeros((1, 25))]])
    start = np.append(np.full(24, 298.15), 1.0)
    start[4] = 320.0
    expected = np.array([expm(rates * time) @ start for time in result["time"]])[:, :-1]
    found = np.array([result[name] for name in names]).T
    # Some hundred tolerances of the nominal value, 300 K.
    bound = 100 * TOLERANCE * 300
    assert np.abs(found - expected).max() < bound
    assert np.abs(result["T_max"] - expected.max(axis=1)).max() < bound
    charges = 0.9 - 3 * result["time"] / 7200
    expected = 24 * (3.2 + charges) - 3 * resistance.sum()
    assert np.abs(result["voltage"] - expected).max() < 24 * 100 * TOLERANCE


# The drive cycle


@ACCURATE
def test_the_vehicle_follows_the_drive_cycle(fmu, interface):
    """Its two trapezoids, in steps that are longer than parts of them."""
    result = simulate(fmu("DriveCycle"), interface, output=["distance"], output_interval=20)
    # A tolerance for each of some hundred steps.
    assert result["distance"][-1] == pytest.approx(8 * 20 + 14 * 70, rel=100 * TOLERANCE)


# The checkout


@pytest.mark.parametrize("version", ["", "fmi3"])
def test_the_queue_of_the_checkout_is_as_long_as_theory_says(version):
    """A queue M/M/1 with the load r holds r/(1 - r) customers in the mean, with a variance of r/(1 - r)^2 and
    a relaxation time of 1/(s (1 - sqrt(r))^2). Its simulation is the same in steps of any length."""
    fmu, (arrivals, service), stop = STEPPERS / version / "Checkout.fmu", (0.01, 0.02), 2e6
    assert validate_fmu(fmu) == []

    def waiting(step):
        start_values = {"arrivals": arrivals, "service": service}
        result = simulate_fmu(
            fmu, start_values=start_values, stop_time=stop, step_size=step, output_interval=step
        )
        return result["waiting"]

    load = arrivals / service
    found, relaxation = waiting(100), 1 / (service * (1 - math.sqrt(load)) ** 2)
    error = math.sqrt(load / (1 - load) ** 2 * 2 * relaxation / stop)
    assert abs(found.mean() - load / (1 - load)) < 4 * error
    assert (found[::5] == waiting(500)).all()


def test_the_checkout_goes_on_from_a_serialized_state(tmp_path):
    """In another instance, random numbers included."""
    fmu = Fmu(STEPPERS / "Checkout.fmu", tmp_path)
    one, other = (Instance(fmu, Library(fmu.library)) for _ in range(2))
    one.initialize()

    def waiting(instance, minutes):
        found = []
        for minute in minutes:
            assert instance.step(60.0 * minute, 60.0) == Status.OK
            found.append(instance.get("waiting"))
        return found

    before = waiting(one, range(30))
    other.restore(one.snapshot())
    expected = waiting(one, range(30, 90))
    assert len(set(before + expected)) > 3
    assert waiting(other, range(30, 90)) == expected
    one.free()
    other.free()


# The sampled controller


@pytest.mark.parametrize("grid", [0.1, 0.07, 1.0])
def test_samples_are_at_their_times_exactly(exchange, grid):
    """Whatever times an importer stops at between them."""
    period, start = 0.0125, 0.3
    controller = exchange("PiController", {"sample_time": period}, start)
    events = [(start, controller.get("command"))]
    for end in start + np.arange(1, math.floor(2 / grid) + 1) * grid:
        while controller.next_event <= end:
            controller.advance(controller.next_event)
            controller.event()
            events.append((controller.time, controller.get("command")))
        controller.advance(end)
    expected = [start + number * period for number in range(len(events))]
    assert [time for time, _ in events] == expected
    assert expected[-1] + period > end
    commands = [0.5 + 0.5 * period * number for number in range(len(events))]
    assert [command for _, command in events] == pytest.approx(commands, rel=1e-12)


def test_without_states_event_mode_need_not_be_left(instance):
    """FMI 2.0.5, section 3.2.1: there fmi2SetTime may be called in Event Mode. The limit on iterations is one
    for each time."""
    controller = instance("PiController", fmi2ModelExchange, start_values={"sample_time": 0.001})
    for number in range(2500):
        controller.ok("fmi2SetTime", number * 0.001)
        assert controller.new_discrete_states().nextEventTime == (number + 1) * 0.001
        assert controller.get("command") == pytest.approx(0.5 + 0.0005 * number, rel=1e-12)
    # In between there is no sample.
    controller.ok("fmi2SetTime", 2499.5 * 0.001)
    assert controller.new_discrete_states().nextEventTime == 2500 * 0.001
    controller.ok("fmi2EnterContinuousTimeMode")
    assert controller.get("command") == pytest.approx(0.5 + 0.0005 * 2499, rel=1e-12)


@pytest.mark.parametrize("step", [0.1, 0.25, 0.04])
def test_co_simulation_executes_the_samples_of_each_step(instance, step):
    controller = instance("PiController", fmi2CoSimulation)
    for number in range(round(4 / step)):
        assert controller.step(number * step, step) == Status.OK
        # Those in [0, end), sample k at k times 0.1 s.
        samples = math.ceil(round((number + 1) * step / 0.1, 6))
        assert controller.get("command") == pytest.approx(0.5 + 0.05 * (samples - 1), rel=1e-12)


@pytest.mark.parametrize("interface", ["CVode", "Euler"])
def test_fmpy_executes_samples_as_time_events(fmu, interface):
    result = simulate(fmu("PiController"), interface, stop_time=2.02, output_interval=0.04)
    rises = np.flatnonzero(np.diff(result["command"]))
    # FMPy takes times that differ by rounding as one.
    assert result["time"][rises] == pytest.approx(0.1 * np.arange(1, 21), rel=4 * EPSILON)
