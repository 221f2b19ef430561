"""`cargo fmu linearize`: matrices, poles and frequency responses against NumPy, and a loop with a sampled
controller against its z-transform."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import cont2discrete

from fmu.ladder import FMUS
from fmu.ladder.test_fmi3 import FMI3
from fmu.ladder.test_simulate import COMMAND, run

A = [[-1.0, 4.0, 0.0], [-4.0, -0.5, 0.25], [0.0, 0.0, -20.0]]
B = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.5, 3.0]]
C = [[1.0, 0.0, 0.0], [0.0, 1.0, -1.0], [0.5, 0.0, 1.0]]
D = [[0.0, 0.0, 0.125], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]


def linearized(folder: Path, *arguments: str | Path) -> dict:
    out = folder / "linear.json"
    run("linearize", *arguments, "--out", out)
    return json.loads(out.read_text())


def of_matrix(name: str, matrix: list[list[float]]) -> list[str]:
    """The options that set a matrix."""
    elements = [(i, j, value) for i, row in enumerate(matrix, 1) for j, value in enumerate(row, 1)]
    return [part for i, j, value in elements for part in ("--set", f"{name}[{i},{j}]={value!r}")]


def numbers(pairs: list[list[float]]) -> np.ndarray:
    return np.array([complex(*pair) for pair in pairs])


STATE_SPACE = [
    part for name, matrix in zip("ABCD", [A, B, C, D], strict=True) for part in of_matrix(name, matrix)
]


@pytest.mark.parametrize("interface", ["cs", "me"])
def test_a_linear_system_is_linearized_to_its_matrices(interface: str, tmp_path: Path) -> None:
    path = ["--path", "u[2],y[3]"]
    model = FMI3 / "StateSpace.fmu"
    found = linearized(tmp_path, model, *STATE_SPACE, "--interface", interface, "--at", "1", *path)
    [fmu] = found["fmus"]
    assert fmu["is_exact"]
    for name, matrix in zip("ABCD", [A, B, C, D], strict=True):
        assert fmu[name] == matrix, name
    x, u = ([each["value"] for each in fmu[kind]] for kind in ("states", "inputs"))
    assert u == [1, 2, 3]
    # The derivative at the states that the run reached, to the rounding of three sums.
    assert fmu["derivatives"] == pytest.approx(np.array(A) @ x + np.array(B) @ u, rel=1e-12, abs=1e-12)
    poles = np.sort_complex(numbers(fmu["poles"]))
    assert poles == pytest.approx(np.sort_complex(np.linalg.eigvals(A)), rel=1e-12)
    frequencies = np.array(fmu["path"]["frequencies"])
    assert len(frequencies) > 200
    at = [2j * np.pi * frequency * np.eye(3) - A for frequency in frequencies]
    expected = [C[2] @ np.linalg.solve(matrix, np.array(B)[:, 1]) + D[2][1] for matrix in at]
    assert numbers(fmu["path"]["response"]) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("template", ["VanDerPol", "BouncingBall"])
def test_equations_are_differentiated_where_the_run_is(fmu, template: str, tmp_path: Path) -> None:
    found = linearized(tmp_path, fmu(template), "--interface", "me", "--at", "0.3")
    [fmu_] = found["fmus"]
    first, second = (state["value"] for state in fmu_["states"])
    if template == "VanDerPol":
        # mu is 1; at the start the states are 2 and 0.
        assert first < 2
        assert fmu_["A"] == [
            [0, 1],
            [pytest.approx(-2 * first * second - 1, rel=1e-14), pytest.approx(1 - first**2, rel=1e-14)],
        ]
    else:
        assert fmu_["A"] == [[0, 1], [0, 0]]
        assert fmu_["poles"] == [[0, 0], [0, 0]]


def write_loop(folder: Path, order: list[str]) -> Path:
    """The system of the PI controller, and the first input and output of the linear system."""
    ssd = "http://ssp-standard.org/SSP1/SystemStructureDescription"
    ElementTree.register_namespace("ssd", ssd)
    root = ElementTree.Element(f"{{{ssd}}}SystemStructureDescription", version="1.0", name="loop")
    system = ElementTree.SubElement(root, f"{{{ssd}}}System", name="loop")
    elements = ElementTree.SubElement(system, f"{{{ssd}}}Elements")
    connectors = {
        "PiController": {"measurement": "input", "command": "output"},
        "StateSpace": {"u[1]": "input", "y[1]": "output"},
    }
    for name in order:
        component = ElementTree.SubElement(
            elements, f"{{{ssd}}}Component", name=name, source=f"resources/{name}.fmu"
        )
        listed = ElementTree.SubElement(component, f"{{{ssd}}}Connectors")
        for connector, kind in connectors[name].items():
            ElementTree.SubElement(listed, f"{{{ssd}}}Connector", name=connector, kind=kind)
    connections = ElementTree.SubElement(system, f"{{{ssd}}}Connections")
    for ends in [
        ("PiController", "command", "StateSpace", "u[1]"),
        ("StateSpace", "y[1]", "PiController", "measurement"),
    ]:
        names = ("startElement", "startConnector", "endElement", "endConnector")
        attributes = dict(zip(names, ends, strict=True), suppressUnitConversion="true")
        ElementTree.SubElement(connections, f"{{{ssd}}}Connection", attributes)
    path = folder / "loop.ssp"
    with ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", ElementTree.tostring(root))
        archive.write(FMUS / "PiController.fmu", "resources/PiController.fmu")
        archive.write(FMI3 / "StateSpace.fmu", "resources/StateSpace.fmu")
    return path


STEP, GAIN, INTEGRAL_TIME = 0.1, 2.0, 1.0
TWO_LAGS = {
    "A": [[-2.0, 0.0, 0.0], [5.0, -5.0, 0.0], [0.0, 0.0, -1.0]],
    "B": [[2.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    "C": [[0.0, 1.0, 0.0]],
    "D": [[0.0, 0.0, 0.0]],
}


def loop_gain(frequency: float) -> complex:
    """The PI controller's samples, and both lags behind a hold."""
    z = np.exp(2j * np.pi * frequency * STEP)
    controller = GAIN * (1 + STEP / INTEGRAL_TIME / (z - 1))
    a, b, c, _, _ = cont2discrete([np.array(TWO_LAGS[name]) for name in "ABCD"], STEP, method="zoh")
    return controller * (c @ np.linalg.solve(z * np.eye(3) - a, b))[0, 0]


@pytest.mark.parametrize("order", [["PiController", "StateSpace"], ["StateSpace", "PiController"]])
def test_a_loop_is_measured_with_its_samples(order: list[str], tmp_path: Path) -> None:
    """In both orders the plant acts on what the controller made of its output one step before."""
    system = write_loop(tmp_path, order)
    values = ["--set", f"PiController:gain={GAIN}"]
    for name, matrix in TWO_LAGS.items():
        values += of_matrix(name, matrix)
    arguments = [*values, "--step", str(STEP), "--at", "20", "--loop", "PiController:measurement"]
    cut = linearized(tmp_path, system, *arguments)["loop"]
    frequencies, gain = np.array(cut["frequencies"]), numbers(cut["gain"])
    # Periods of 1000 to 4 steps.
    assert (frequencies.min(), frequencies.max()) == (pytest.approx(0.01), pytest.approx(2.5))
    assert all(cut["is_settled"])
    expected = np.array([loop_gain(frequency) for frequency in frequencies])
    # A measurement is settled where it changes by a thousandth of what it is made of.
    assert (abs(gain - expected) < 2e-3 * abs(expected) * np.maximum(1, abs(1 + expected))).all()
    assert max(cut["distortion"]) < 1e-2

    def phase(frequency: float) -> float:
        return np.angle(-loop_gain(frequency), deg=True)

    crossing = brentq(lambda frequency: abs(loop_gain(frequency)) - 1, 0.1, 2.5)
    # Points are 15 % apart; straight lines between them miss curves of the Bode plot by less than these.
    assert cut["phase_margin"]["frequency"] == pytest.approx(crossing, rel=5e-3)
    assert cut["phase_margin"]["degrees"] == pytest.approx(phase(crossing), abs=0.5)
    limit = brentq(phase, crossing, 2.5)
    assert cut["gain_margin"]["frequency"] == pytest.approx(limit, rel=5e-3)
    assert cut["gain_margin"]["factor"] == pytest.approx(1 / abs(loop_gain(limit)), rel=5e-3)


def test_what_has_no_states_is_refused(fmu, tmp_path: Path) -> None:
    done = subprocess.run(
        [COMMAND, "linearize", fmu("PiController")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "nothing to linearize: PiController has no continuous states" in done.stderr
