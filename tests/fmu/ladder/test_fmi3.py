"""The ladder's FMUs of FMI 3.0 in FMPy: all types and arrays, against Reference-FMUs (reference/)."""

from __future__ import annotations

import csv
import ctypes
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu

from fmu.ladder import FMUS, exported

REFERENCE = Path(__file__).parent / "reference"
FMI3 = FMUS.parents[1] / "ladder-fmi3" / "fmu" / "fmi3"
MODELS = ["Feedthrough", "StateSpace", "Diffusion", "VanDerPol"]
WHOLE = {
    "Int8": 8,
    "UInt8": 8,
    "Int16": 16,
    "UInt16": 16,
    "Int32": 32,
    "UInt32": 32,
    "Int64": 64,
    "UInt64": 64,
}
"""The types of whole numbers, with their bits."""
OTHERS: dict[str, list[object]] = {
    "Float64_continuous": [2.5, -1e300],
    "Float64_discrete": [-3.5, 5e-324],
    "Float32_continuous": [0.5, 2.0**-149],
    "Float32_discrete": [-0.25, -3e38],
    "Boolean": [True, False],
    "String": ["größer als FMI", ""],
    "Binary": [b"\0\xff\0", b"", bytes(range(256)) * 100],
    "Enumeration": [2, 1],
}


@pytest.fixture
def make(tmp_path: Path) -> Callable[..., FMU3Slave]:
    """Makes an instance."""

    def make(model: str, interface: type) -> FMU3Slave:
        path = exported(model, FMI3)
        fmu = interface(
            guid=fmpy.read_model_description(path).guid,
            modelIdentifier=model,
            unzipDirectory=fmpy.extract(path, tmp_path / interface.__name__),
        )
        fmu.instantiate()
        return fmu

    return make


def references(model: str) -> dict[str, int]:
    return {
        v.name: v.valueReference for v in fmpy.read_model_description(exported(model, FMI3)).modelVariables
    }


@pytest.mark.parametrize("model", MODELS)
def test_validators_find_nothing(model: str) -> None:
    assert validate_fmu(exported(model, FMI3)) == []


def interface_of(root: ElementTree.Element) -> dict[str, tuple[object, ...]]:
    """The variables by their names: what importers know them by, and what they may do with them."""
    variables = {}
    for variable in root.findall("ModelVariables/*"):
        continuous = "continuous" if variable.tag.startswith("Float") else "discrete"
        start = variable.get("start")
        texts = [text.get("value") for text in variable.findall("Start")]
        variables[variable.get("name")] = (
            variable.tag,
            variable.get("valueReference"),
            variable.get("causality", "local"),
            variable.get("variability", continuous),
            variable.get("declaredType"),
            float(start) if variable.tag.startswith("Float") and start else start,
            texts,
        )
    return variables


def test_variables_are_those_of_the_reference_fmu() -> None:
    with ZipFile(exported("Feedthrough", FMI3)) as archive:
        ours = ElementTree.fromstring(archive.read("modelDescription.xml"))
    theirs = ElementTree.parse(REFERENCE / "Feedthrough.fmi3.xml").getroot()
    assert interface_of(ours) == interface_of(theirs)


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_without_inputs_the_results_are_those_of_the_reference_fmu(kind: str) -> None:
    theirs = np.genfromtxt(
        REFERENCE / "Feedthrough_out.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    # FMPy records no strings, and bytes as objects.
    outputs = [name for name in theirs.dtype.names if name not in ("time", "String_output", "Binary_output")]
    result = fmpy.simulate_fmu(
        exported("Feedthrough", FMI3), fmi_type=kind, output=outputs, output_interval=0.1
    )
    assert len(result) == len(theirs) == 21
    for name in outputs:
        assert (result[name] == theirs[name]).all(), name


def test_the_bounds_of_each_type_pass_through(make: Callable[..., FMU3Slave]) -> None:
    by_name, fmu = references("Feedthrough"), make("Feedthrough", FMU3Slave)
    with (REFERENCE / "Feedthrough_in.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["UInt64_input"]) for row in rows] == [0, 2**64 - 1]
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    for row in rows:
        for name in WHOLE:
            getattr(fmu, f"set{name}")([by_name[f"{name}_input"]], [int(row[f"{name}_input"])])
        # Saved, and restored over other values; serialized for the sizes of all types.
        state = fmu.getFMUState()
        content = fmu.serializeFMUState(state)
        for name in WHOLE:
            getattr(fmu, f"set{name}")([by_name[f"{name}_input"]], [1])
            assert getattr(fmu, f"get{name}")([by_name[f"{name}_output"]]) == [1]
        fmu.setFMUState(fmu.deserializeFMUState(content))
        for name in WHOLE:
            assert getattr(fmu, f"get{name}")([by_name[f"{name}_output"]]) == [int(row[f"{name}_input"])], (
                name
            )
    fmu.freeInstance()


def test_values_of_the_other_types_pass_through(make: Callable[..., FMU3Slave]) -> None:
    by_name, fmu = references("Feedthrough"), make("Feedthrough", FMU3Slave)
    assert fmu.getBinary([by_name["Binary_input"]]) == [b"foo"]
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    for name, values in OTHERS.items():
        kind = "Int64" if name == "Enumeration" else name.split("_")[0]
        for value in values:
            expected = float(np.float32(value)) if kind == "Float32" else value
            getattr(fmu, f"set{kind}")([by_name[f"{name}_input"]], [value])
            assert getattr(fmu, f"get{kind}")([by_name[f"{name}_output"]]) == [expected], name
    # Several values of a kind, an enumeration among those of Int64.
    both = [by_name["Int64_input"], by_name["Enumeration_input"]]
    fmu.setInt64(both, [-5, 2])
    assert fmu.getInt64(both) == [-5, 2]
    fmu.freeInstance()


def test_sizes_are_structural_parameters() -> None:
    variables = {v.name: v for v in fmpy.read_model_description(exported("StateSpace", FMI3)).modelVariables}
    for name, sizes in {
        "A": "nn",
        "B": "nm",
        "C": "rn",
        "D": "rm",
        "x0": "n",
        "u": "m",
        "y": "r",
        "x": "n",
    }.items():
        assert [dimension.variable.name for dimension in variables[name].dimensions] == list(sizes)
    with ZipFile(exported("StateSpace", FMI3)) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    sizes = root.findall("ModelVariables/UInt64")
    assert [size.get("name") for size in sizes] == ["m", "n", "r"]
    for size in sizes:
        found = [size.get(key) for key in ("causality", "variability", "start", "min", "max")]
        assert found == ["structuralParameter", "fixed", "3", "3", "3"]


def test_euler_gives_the_reference_results_of_state_space(make: Callable[..., FMU3Model]) -> None:
    """With identity matrices, x is u ((1 + h)^n - 1) by explicit Euler's steps h, and y is x + u."""
    by_name, fmu = references("StateSpace"), make("StateSpace", FMU3Model)
    with (REFERENCE / "StateSpace_out.csv").open() as file:
        theirs = [[float(y) for y in row["y"].split()] for row in csv.DictReader(file)]
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.updateDiscreteStates()
    fmu.enterContinuousTimeMode()
    steps, states = 1000, np.zeros(3)
    for second, expected in enumerate(theirs):
        found = fmu.getFloat64([by_name["y"]], 3)
        # An addition and a multiplication for each step so far, whose roundings grow as the states do.
        assert found == pytest.approx(expected, rel=2 * steps * (second + 1) * np.finfo(float).eps)
        for step in range(steps):
            states = states + np.array(fmu.getFloat64([by_name["der(x)"]], 3)) / steps
            fmu.setTime(second + (step + 1) / steps)
            fmu.setFloat64([by_name["x"]], states.tolist())
    assert len(theirs) == 11
    fmu.freeInstance()


def test_matrices_are_parameters(make: Callable[..., FMU3Slave]) -> None:
    by_name, fmu, random = references("StateSpace"), make("StateSpace", FMU3Slave), np.random.default_rng(5)
    matrices = {name: random.normal(size=(3, 3)) for name in "ABCD"}
    for name, matrix in matrices.items():
        fmu.setFloat64([by_name[name]], matrix.ravel().tolist())
    x, u = random.normal(size=3), random.normal(size=3)
    fmu.setFloat64([by_name["x0"], by_name["u"]], [*x, *u])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    a, b, c, d = matrices.values()
    # Six products of numbers of order 1.
    assert fmu.getFloat64([by_name["y"]], 3) == pytest.approx((c @ x + d @ u).tolist(), rel=1e-13, abs=1e-14)
    rates = fmu.getFloat64([by_name["der(x)"]], 3)
    assert rates == pytest.approx((a @ x + b @ u).tolist(), rel=1e-13, abs=1e-14)
    weights, unknowns = random.normal(size=6), [by_name["y"], by_name["der(x)"]]
    found = fmu.getAdjointDerivative(unknowns, [by_name["u"], by_name["x"]], weights.tolist(), 6)
    expected = weights @ np.block([[d, c], [b, a]])
    assert found == pytest.approx(expected.tolist(), rel=1e-13, abs=1e-14)
    fmu.freeInstance()


def test_configuration_mode_takes_the_sizes_of_the_build(make: Callable[..., FMU3Slave]) -> None:
    by_name, fmu = references("StateSpace"), make("StateSpace", FMU3Slave)
    with pytest.raises(FMICallException):
        fmu.setUInt64([by_name["n"]], [3])
    fmu.reset()
    fmu.enterConfigurationMode()
    fmu.setUInt64([by_name["n"], by_name["m"]], [3, 3])
    fmu.exitConfigurationMode()
    assert fmu.getUInt64([by_name["n"]]) == [3]
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    for forbidden in (
        lambda: fmu.setUInt64([by_name["n"]], [4]),
        lambda: fmu.setFloat64([by_name["u"]], [1.0, 2.0, 3.0]),
        lambda: fmu.setFloat64([by_name["A"]], [1.0] * 9),
        fmu.enterInitializationMode,
    ):
        fmu.reset()
        fmu.enterConfigurationMode()
        with pytest.raises(FMICallException):
            forbidden()
    fmu.reset()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    with pytest.raises(FMICallException):
        fmu.enterConfigurationMode()
    fmu.freeInstance()


def test_another_size_is_refused_with_the_reason_and_the_way(make: Callable[..., FMU3Slave]) -> None:
    by_name, fmu = references("StateSpace"), make("StateSpace", FMU3Slave)
    # FMPy's freeInstance unloads the library, too.
    fmu.fmi3FreeInstance(fmu.component)
    messages = []
    fmu.instantiate(loggingOn=True, logMessage=lambda *arguments: messages.append(arguments[-1].decode()))
    fmu.enterConfigurationMode()
    with pytest.raises(FMICallException):
        fmu.setUInt64([by_name["n"]], [4])
    (message,) = messages
    for part in (
        "4 for the size n, fixed at 3 when this FMU was built",
        "the elements of larger arrays would have the references of other variables",
        "export the model with another start value",
    ):
        assert part in message
    fmu.freeInstance()


CELLS = 100
RATE = 0.1 * CELLS**2
"""Of the rod: its diffusivity over the square of a cell's length."""


def slopes(temperatures: np.ndarray, left: float, right: float) -> np.ndarray:
    """By its definition: the profile continues as a straight line, with the given temperature at the end."""
    beyond = [2 * left - temperatures[0], *temperatures, 2 * right - temperatures[-1]]
    return RATE * np.diff(beyond, 2)


def test_the_rod_is_at_most_forty_lines_of_rust() -> None:
    source = FMI3.parents[1] / "Diffusion" / "src" / "lib.rs"
    assert len(source.read_text().splitlines()) <= 40


@pytest.mark.compiled
def test_cells_read_their_neighbors(make: Callable[..., FMU3Slave]) -> None:
    by_name, fmu = references("Diffusion"), make("Diffusion", FMU3Model)
    assert list(by_name) == ["time", "n", "length", "diffusivity", "left", "right", "T", "der(T)"]
    temperatures = np.random.default_rng(7).normal(300, 10, CELLS)
    fmu.setFloat64([by_name["T"]], temperatures.tolist())
    fmu.setFloat64([by_name["left"], by_name["right"]], [350.0, 280.0])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    assert fmu.getFloat64([by_name["T"]], CELLS) == temperatures.tolist()
    expected = slopes(temperatures, 350.0, 280.0)
    # Differences of numbers of 300 K, times the rate.
    tolerance = 8 * np.finfo(float).eps * 300 * RATE
    assert np.allclose(fmu.getFloat64([by_name["der(T)"]], CELLS), expected, rtol=0, atol=tolerance)
    # Linear: along a direction, and backwards along the same one, as the matrix is symmetric.
    direction = np.random.default_rng(8).normal(size=CELLS)
    for derivative in (fmu.getDirectionalDerivative, fmu.getAdjointDerivative):
        unknowns, knowns = [by_name["der(T)"]], [by_name["T"]]
        found = derivative(unknowns, knowns, direction.tolist(), CELLS)
        assert np.allclose(found, slopes(direction, 0, 0), rtol=0, atol=1e-12 * RATE)
    fmu.freeInstance()


def dependencies(fmu: FMU3Slave, dependent: int) -> list[tuple[int, int, int]]:
    """Elements of a variable with those of others on which they depend, of which FMPy has no method."""
    count = ctypes.c_size_t()
    assert fmu.dll.fmi3GetNumberOfVariableDependencies(fmu.component, dependent, ctypes.byref(count)) == 0
    types = (ctypes.c_size_t, ctypes.c_uint32, ctypes.c_size_t, ctypes.c_int)
    elements, independents, of_independents, kinds = ((of * count.value)() for of in types)
    arguments = (elements, independents, of_independents, kinds, count)
    assert fmu.dll.fmi3GetVariableDependencies(fmu.component, dependent, *arguments) == 0
    # fmi3Dependent
    assert set(kinds) == {5}
    return list(zip(elements, independents, of_independents, strict=True))


@pytest.mark.compiled
def test_each_cell_depends_on_its_neighbors_alone(make: Callable[..., FMU3Slave]) -> None:
    by_name, fmu = references("Diffusion"), make("Diffusion", FMU3Slave)
    others = [(by_name[name], 1) for name in ("length", "diffusivity", "left", "right")]
    expected = [
        (cell, *known)
        for cell in range(1, CELLS + 1)
        for known in [
            *others,
            *((by_name["T"], near) for near in range(cell - 1, cell + 2) if 1 <= near <= CELLS),
        ]
    ]
    # Of the initial values, and of those later.
    assert sorted(dependencies(fmu, by_name["der(T)"])) == sorted(expected)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    assert sorted(dependencies(fmu, by_name["der(T)"])) == sorted(expected)
    # A state that is an output is its own.
    assert dependencies(fmu, by_name["T"]) == [(cell, by_name["T"], cell) for cell in range(1, CELLS + 1)]
    for known in ("left", "n", "time"):
        count = ctypes.c_size_t()
        status = fmu.dll.fmi3GetNumberOfVariableDependencies(
            fmu.component, by_name[known], ctypes.byref(count)
        )
        assert status == 3, known
    fmu.freeInstance()


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_the_rod_decays_to_its_steady_profile(kind: str) -> None:
    """From a mode of the cells' equations, which decays exponentially while the profile stays straight."""
    cells = np.arange(CELLS) + 0.5
    profile, mode = 400 - 100 * cells / CELLS, np.sin(np.pi * cells / CELLS)
    eigenvalue = -4 * RATE * np.sin(np.pi / 2 / CELLS) ** 2
    tolerance = 1e-6
    result = fmpy.simulate_fmu(
        exported("Diffusion", FMI3),
        fmi_type=kind,
        stop_time=1,
        step_size=0.05,
        output_interval=0.05,
        relative_tolerance=tolerance,
        start_values={"T": (profile + 50 * mode).tolist()},
        output=["T"],
    )
    assert len(result) == 21
    expected = profile + 50 * np.outer(np.exp(eigenvalue * result["time"]), mode)
    # Each of some hundred steps may be off by the tolerance of 300 K.
    assert np.abs(result["T"] - expected).max() < 100 * tolerance * 300
    assert np.ptp(expected[:, 50]) > 20
