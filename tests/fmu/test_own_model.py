"""docs/own_model.md: its code and its lines make an FMU, whose results are those of SciPy."""

from __future__ import annotations

import os
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.util import read_csv
from scipy.integrate import solve_ivp

from fmu import ROOT, TARGET
from fmu.documents import blocks, run

PAGE = (ROOT / "docs" / "own_model.md").read_text()

TOLERANCE = 1e-10
"""What the FMU and its importer are asked for in each step."""

STEPS = 1000
"""Communication steps, in one second."""

STOP = 1.5
VOLTAGE = {0.0: 6.0, 0.5: -6.0}
"""Until the next time, as the page's file has it."""

FASTEST = 30.0
"""More than the speed at impacts, in rad/s."""

BEYOND = {
    "CoSimulation": 0.0,
    # The exporter's hysteresis, in units of the stop, and the way during CVODE's tolerance of a root's time:
    # 100 roundings of the time and its step, each at most 1 s.
    "ModelExchange": STOP * 1e-12 + FASTEST * 100 * 2 * np.finfo(float).eps,
}
"""How far an interface may show the shaft beyond its stop."""

INTERFACES = pytest.mark.parametrize("interface", BEYOND)


def shell(block: str, folder: Path) -> str:
    """Runs a block of the page as it is."""
    return run(f"bash -e -c {shlex.quote(block)}", folder, CARGO_TARGET_DIR="target")


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package that the page leads to, and what its lines leave in it."""
    folder = tmp_path_factory.mktemp("own") / "boost-fmu"
    folder.mkdir()
    begin, lines = blocks(PAGE, "console")
    # `cargo install` puts the command where cargo finds it; here it has been built.
    install, begin = begin.split("\n", 1)
    assert install == "cargo install --path crates/cargo-fmu"
    shell(begin, folder)
    package = folder.parent / "motor"
    (declaration,) = blocks(PAGE, "json")
    (package / "model.json").write_text(declaration)
    (package / "src" / "lib.rs").write_text("\n".join(blocks(PAGE, "rust")))
    shutil.copy(ROOT / "Cargo.lock", package)
    # Each process of the tests has its own, as all write the same FMU; dependencies stay for the next run.
    target = TARGET.resolve() / "own_model" / os.environ.get("PYTEST_XDIST_WORKER", "alone")
    target.mkdir(parents=True, exist_ok=True)
    (package / "target").symlink_to(target)
    assert "`--out result.csv`" in PAGE
    output = shell(lines.replace("--plot", "--out result.csv --no-units --plot"), package)
    assert "plotly" in (package / "motor.html").read_text()
    assert "1 passed" in output
    assert "0 errors, 0 warnings" in output
    return package


def reference(times: np.ndarray) -> np.ndarray:
    """Current, speed and angle by SciPy, which finds the impacts and the current's change of sign."""
    r, inductance, k, inertia, friction = 2, 0.002, 0.05, 0.001, 0.0002
    restitution, resting_speed = 0.4, 0.05

    def slope(_: float, x: np.ndarray, u: float, side: float) -> list[float]:
        current, speed, _ = x
        rises = 0.0 if side else (k * current - friction * speed) / inertia
        return [(u - r * current - k * speed) / inductance, rises, speed]

    def leaves(_: float, x: np.ndarray, __: float, side: float) -> float:
        return -side * x[0] if side else abs(x[2]) - STOP

    leaves.terminal, leaves.direction = True, 1
    values = np.empty((3, len(times)))
    side, x = 0.0, np.zeros(3)
    for (begin, u), end in zip(VOLTAGE.items(), [*list(VOLTAGE)[1:], times[-1]], strict=True):
        time = begin
        while time < end:
            piece = solve_ivp(
                slope, (time, end), x, "DOP853", None, True, leaves, args=(u, side), rtol=1e-12, atol=1e-13
            )
            inside = (times >= time) & (times <= piece.t[-1])
            values[:, inside] = piece.sol(times[inside])
            time, x = piece.t[-1], piece.y[:, -1]
            if piece.status == 1 and side:
                side = 0.0
            elif piece.status == 1:
                x[2] = np.sign(x[2]) * STOP
                x[1] *= -restitution
                if abs(x[1]) <= resting_speed:
                    side, x[1] = np.sign(x[2]), 0.0
    return values


def simulate(package: Path, interface: str, **arguments: object) -> np.ndarray:
    return simulate_fmu(
        package / "target" / "fmu" / "motor.fmu",
        fmi_type=interface,
        relative_tolerance=TOLERANCE,
        output_interval=1 / STEPS,
        input=read_csv(package / "voltage.csv"),
        output=["current", "speed", "angle"],
        **arguments,
    )


def test_the_plot_shows_both_stops(package: Path) -> None:
    shown = read_csv(package / "result.csv")
    assert (shown["angle"].max(), shown["angle"].min()) == (STOP, -STOP)
    # The stalled motor's torque: 6 V / 2 Ohm at 0.05 N.m/A, to ten times the default tolerance.
    assert shown["torque"][[500, -1]] == pytest.approx([0.15, -0.15], rel=1e-5)


@INTERFACES
def test_the_shaft_moves_as_scipy_says(package: Path, interface: str) -> None:
    result = simulate(package, interface)
    # Events are recorded before and after; there, speed has two values.
    times, first, counts = np.unique(result["time"], return_index=True, return_counts=True)
    once = counts == 1
    expected = reference(times)[:, once]
    assert once.sum() >= STEPS
    for name, values, nominal in zip(["current", "speed", "angle"], expected, [1, 10, 1], strict=True):
        # The error of each step is TOLERANCE of the value and the nominal one together.
        allowed = STEPS * TOLERANCE * (np.abs(values).max() + nominal)
        assert result[name][first][once] == pytest.approx(values, rel=0, abs=allowed), name
    assert np.abs(result["angle"]).max() <= STOP + BEYOND[interface]


def test_bounces_without_an_end_are_an_error(package: Path) -> None:
    """With a resting speed of 0, which leaves the shaft at the stop in Model Exchange, too."""
    messages: list[str] = []
    angles: dict[str, list[float]] = {interface: [] for interface in BEYOND}

    def run_into_the_stop(interface: str) -> None:
        def step_finished(_: float, recorder: object) -> bool:
            angles[interface].append(recorder.rows[-1][-1])
            return len(angles[interface]) < 5 * STEPS

        def logger(*arguments: object) -> None:
            messages.append(arguments[-1].decode())

        simulate(
            package,
            interface,
            start_values={"resting_speed": 0.0},
            step_finished=step_finished,
            logger=logger,
        )

    with pytest.raises(FMICallException):
        run_into_the_stop("CoSimulation")
    assert "events, which come ever faster, the last caused by end_of_mode" in messages[0]
    run_into_the_stop("ModelExchange")
    assert len(angles["ModelExchange"]) == 5 * STEPS
    for interface, reached in angles.items():
        # The last bounces are far smaller than the first.
        assert reached[-1] == pytest.approx(STOP, abs=1e-6)
        assert max(reached) <= STOP + BEYOND[interface]


def test_a_forgotten_output_is_named(package: Path, tmp_path: Path) -> None:
    motor = shutil.copytree(package, tmp_path / "motor", symlinks=True)
    source = (motor / "src" / "lib.rs").read_text()
    line = "        *outputs = Outputs { torque: p.k * states.current };\n"
    assert line in source
    messages = {
        "": "`evaluate` does not set torque, or computes it from its previous value",
        "        *outputs = Outputs {};\n": "missing field `torque` in initializer",
    }
    assert messages[""] in " ".join(PAGE.split())
    for instead, message in messages.items():
        (motor / "src" / "lib.rs").write_text(source.replace(line, instead))
        assert message in shell("! cargo test 2>&1", motor)
