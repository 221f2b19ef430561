"""The libraries that FMPy compiles of the FMUs' sources compute what the native ones do, to the last bit, and
take the states that those serialize: in both versions of FMI."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from ctypes import byref, c_size_t, c_uint8, c_void_p
from pathlib import Path
from struct import pack

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi3 import FMU3Slave
from wasmtime import FuncType, Linker, Memory, Module, Store, ValType

from fmu import TARGET, Run
from fmu.compile_sources import copy_without_libraries
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, couple_running, scenario, staircase
from fmu.master import Fmu, Instance, Master, Reals
from fmu.recorded import INPUTS, OUTPUTS, STATES, STEP, Recording

NAMES = ["BoostPlant", "BoostController"]

LARGEST = 1_000_000
"""Bytes of a file of the sources."""


VERSIONS = {2: "", 3: "fmi3"}
"""The folders of the versions of FMI, in that of the FMUs."""

BOTH_VERSIONS = pytest.mark.parametrize("version", VERSIONS)

Fmus = dict[tuple[str, int], Fmu]
"""FMUs by their names and versions."""


def extracted(folder: str, tmp_path_factory: pytest.TempPathFactory) -> Fmus:
    """The FMUs of a folder."""

    def extract(name: str, version: int) -> Fmu:
        path = TARGET / folder / VERSIONS[version] / f"{name}.fmu"
        assert path.is_file(), f"{path} is missing: bash tests/run rest makes it"
        return Fmu(path, tmp_path_factory.mktemp(f"{name}{version}"))

    return {(name, version): extract(name, version) for name in NAMES for version in VERSIONS}


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Fmus:
    """The FMUs as they were exported."""
    return extracted("both", tmp_path_factory)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Fmus:
    """The FMUs with the libraries of their sources."""
    return extracted("compiled/both", tmp_path_factory)


Make = Callable[[Fmu], Instance]


def runs(make: Make, fmus: Fmus, version: int, name: str, signal: str, end: float) -> np.ndarray:
    """All outputs in the experiment of a figure that changes one signal."""
    steps = BOOST_STEPS if name == "figure_13" else scenario(name)["inputs"][signal]["steps"]
    instances = [make(fmus[model, version]) for model in NAMES]
    record = couple_running(*instances, inputs={signal: staircase(*steps)}).run(end)
    return np.stack(list(record.values()))


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_an_array_of_states(kind: str) -> None:
    """The rod of the ladder."""
    results = [
        simulate_fmu(
            TARGET / folder / "ladder-fmi3" / "fmu" / "fmi3" / "Diffusion.fmu",
            fmi_type=kind,
            step_size=0.05,
            output_interval=0.05,
            start_values={"left": 412.3},
            output=["T"],
        )["T"]
        for folder in ("", "compiled")
    ]
    assert results[0].shape == (21, 100)
    assert np.ptp(results[0]) > 100
    assert results[0].tobytes() == results[1].tobytes()


@pytest.mark.parametrize(
    ("exported", "by_fmpy"),
    [
        ("sources/ladder/VanDerPol.fmu", "compiled/sources/ladder/VanDerPol.fmu"),
        ("sources/diffusion/fmi3/Diffusion.fmu", "compiled/ladder-fmi3/fmu/fmi3/Diffusion.fmu"),
    ],
)
def test_cargo_fmu_compiles_them_as_fmpy_does(
    cargo_fmu: Run, tmp_path: Path, exported: str, by_fmpy: str
) -> None:
    """Records of the library that it makes, of FMPy's and of the native one are equal, bit for bit."""
    exported, by_fmpy = TARGET / exported, TARGET / by_fmpy
    bare, compiled = tmp_path / "bare.fmu", tmp_path / "compiled.fmu"
    copy_without_libraries(exported, bare)
    done = cargo_fmu("compile", bare, "--out", compiled)
    assert done.returncode == 0, done.stderr
    records = []
    for fmu in (exported, by_fmpy, compiled):
        record = tmp_path / "record.csv"
        done = cargo_fmu("simulate", fmu, "--stop-time", "1", "--out", record)
        assert done.returncode == 0, done.stderr
        records.append(record.read_bytes())
    assert len(records[0].splitlines()) > 10
    assert records[0] == records[1] == records[2]


def module(path: Path) -> tuple[Callable[..., int], Callable[[bytes], int], Memory, Store]:
    """A WebAssembly module: what calls its functions, what puts bytes into its memory, and both."""
    store = Store()
    linker = Linker(store.engine)
    for function, count in (("log", 4), ("panic", 2)):
        linker.define_func("fmu", function, FuncType([ValType.i32()] * count, []), lambda *_: None)
    fmu = linker.instantiate(store, Module.from_file(store.engine, str(path))).exports(store)

    def call(function: str, *arguments: float) -> int:
        return fmu[function](store, *arguments)

    def put(data: bytes) -> int:
        address = call("fmu_allocate", len(data))
        fmu["memory"].write(store, data, address)
        return address

    return call, put, fmu["memory"], store


def steps_of_both(
    slave: FMU3Slave, path: Path, token: str, starts: dict[int, np.ndarray], sizes: dict[int, int]
) -> Iterator[np.ndarray]:
    """Steps of a native instance and of one in a module, from the same start values by value reference: after
    each, the values of references with these sizes, which are equal to the last bit."""
    call, put, memory, store = module(path)
    known = put(token.encode() + b"\0")
    instance = call("fmi3InstantiateCoSimulation", put(b"name\0"), known, *[0] * 10)
    given = np.concatenate(list(starts.values()))
    slave.setFloat64(list(starts), given.tolist())
    references = put(pack(f"<{len(starts)}I", *starts))
    assert call("fmi3SetFloat64", instance, references, len(starts), put(given.tobytes()), len(given)) == 0
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    assert call("fmi3EnterInitializationMode", instance, 0, 0.0, 0.0, 0, 0.0) == 0
    assert call("fmi3ExitInitializationMode", instance) == 0
    references, count = put(pack(f"<{len(sizes)}I", *sizes)), sum(sizes.values())
    values = put(bytes(8 * count))
    # Three flags, and the time reached.
    ends = [put(bytes(8)) for _ in range(4)]
    for step in range(20):
        slave.doStep(step * 0.05, 0.05)
        assert call("fmi3DoStep", instance, step * 0.05, 0.05, 1, *ends) == 0
        assert call("fmi3GetFloat64", instance, references, len(sizes), values, count) == 0
        found = np.array(slave.getFloat64(list(sizes), count))
        assert memory.read(store, values, values + 8 * count) == found.tobytes()
        yield found


def test_an_array_of_states_in_a_module(make: Make, modules: Path, tmp_path: Path) -> None:
    """It goes into the WebAssembly module and comes out of it as of the native library."""
    fmu = Fmu(TARGET / "ladder-fmi3" / "fmu" / "fmi3" / "Diffusion.fmu", tmp_path)
    start, variable = np.linspace(300, 400, 100), fmu.variables["T"].valueReference
    path = modules / "ladder" / "fmi3" / "Diffusion.wasm"
    token = fmu.description.guid
    *_, found = steps_of_both(make(fmu).slave, path, token, {variable: start}, {variable: len(start)})
    assert np.abs(found - start).max() > 10


def test_names_that_other_tools_write_in_a_module(make: Make, modules: Path, tmp_path: Path) -> None:
    """The module has the FMU's description, and by each of its names the value of the native library."""
    fmu = Fmu(TARGET / "names-model" / "fmi3" / "names.fmu", tmp_path)
    path = modules / "names" / "fmi3" / "names.wasm"
    with zipfile.ZipFile(fmu.path) as archive:
        assert archive.read("modelDescription.xml") in path.read_bytes()
    reals = {name: variable for name, variable in fmu.variables.items() if variable.type == "Float64"}
    given = [variable for variable in reals.values() if variable.causality in {"parameter", "input"}]
    starts = {
        reference: np.array([100.0 + number])
        for number, reference in enumerate({variable.valueReference: None for variable in given})
    }
    assert len(starts) == 60 + 2 + 6
    sizes = {variable.valueReference: int(np.prod(variable.shape or 1)) for variable in reals.values()}
    *_, last = steps_of_both(make(fmu).slave, path, fmu.description.guid, starts, sizes)
    places = dict(zip(sizes, np.cumsum([0, *sizes.values()]), strict=False))
    value = {name: last[places[variable.valueReference]] for name, variable in reals.items()}
    section = "Plant.'#1'.Section[2]"
    assert [value[name] for name in ("in", '&<>"', "a[2].b")] == [100.0, 141.0, 111.0]
    assert value[f"{section}.sensor.reading"] > value[f"{section}.sensor.bias"] > 100.0


@pytest.mark.parametrize(
    ("version", "name", "signal", "end"),
    [
        (2, "figure_13", "boost_reference", BOOST_STEPS_END),
        (2, "figure_14", "supply_voltage", 42.0),
        (3, "figure_13", "boost_reference", BOOST_STEPS_END),
    ],
)
def test_figures(
    make: Make, exported: Fmus, compiled: Fmus, version: int, name: str, signal: str, end: float
) -> None:
    native, sources = (runs(make, fmus, version, name, signal, end) for fmus in (exported, compiled))
    assert native.shape == sources.shape == (1 + 20, round(end * 80) + 1)
    assert (native.view(np.uint64) == sources.view(np.uint64)).all()


@BOTH_VERSIONS
def test_the_recorded_experiment(make: Make, exported: Fmus, compiled: Fmus, version: int) -> None:
    recording = Recording.read()

    def values(fmu: Fmu) -> np.ndarray:
        plant = make(fmu)
        recording.begin(plant)
        inputs, values = Reals(plant, INPUTS), Reals(plant, [*STATES, *OUTPUTS])
        rows = []
        for number, row in enumerate(recording.inputs):
            inputs.set(row)
            plant.slave.doStep(number * STEP, STEP)
            rows.append(values.get().copy())
        return np.array(rows)

    native, sources = (values(fmus["BoostPlant", version]) for fmus in (exported, compiled))
    assert native.shape == recording.states_and_outputs.shape
    assert (native.view(np.uint64) == sources.view(np.uint64)).all()


def serialized(instance: Instance) -> bytes:
    """The state of an instance as bytes."""
    slave = instance.slave
    if not instance.fmu.is_fmi3:
        state = slave.getFMUstate()
        content = slave.serializeFMUstate(state)
        slave.freeFMUstate(state)
        return content
    state, size = c_void_p(), c_size_t()
    slave.fmi3GetFMUState(slave.component, byref(state))
    slave.fmi3SerializedFMUStateSize(slave.component, state, byref(size))
    content = (c_uint8 * size.value)()
    slave.fmi3SerializeFMUState(slave.component, state, content, size.value)
    slave.fmi3FreeFMUState(slave.component, byref(state))
    return bytes(content)


def restore(instance: Instance, content: bytes) -> None:
    """Resumes from a serialized state."""
    slave = instance.slave
    if not instance.fmu.is_fmi3:
        state = slave.deSerializeFMUstate(content)
        slave.setFMUstate(state)
        slave.freeFMUstate(state)
        return
    state, array = c_void_p(), (c_uint8 * len(content))(*content)
    slave.fmi3DeserializeFMUState(slave.component, array, len(content), byref(state))
    slave.fmi3SetFMUState(slave.component, state)
    slave.fmi3FreeFMUState(slave.component, byref(state))


@BOTH_VERSIONS
@pytest.mark.parametrize("name", NAMES)
def test_states_pass_from_one_library_to_the_other(
    make: Make, exported: Fmus, compiled: Fmus, name: str, version: int
) -> None:
    """The bytes are the same, and either continues from them as the other does."""
    saved, went_on = [], []
    libraries = [exported[name, version], compiled[name, version]]
    for fmu in libraries:
        instance = make(fmu).start({})
        master = Master([instance], STEP, clock=lambda step: step * STEP)
        master.run(1.0)
        saved.append(serialized(instance))
        went_on.append(np.stack(list(master.run(2.0).values())))
    assert saved[0] == saved[1]
    assert (went_on[0] == went_on[1]).all()
    for fmu, bytes_of_the_other in zip(libraries, reversed(saved), strict=True):
        instance = make(fmu).start({})
        restore(instance, bytes_of_the_other)
        record = Master([instance], STEP, clock=lambda step: (80 + step) * STEP).run(2.0)
        assert (np.stack(list(record.values())) == went_on[0]).all()


@BOTH_VERSIONS
@pytest.mark.parametrize("name", NAMES)
def test_the_files(exported: Fmus, name: str, version: int) -> None:
    """No file is long. The description lists the files to compile; FMPy checks the list by the schema."""
    path = exported[name, version].path
    with zipfile.ZipFile(path) as archive:
        files = {file.filename: file.file_size for file in archive.infolist()}
    sources = {file.removeprefix("sources/"): size for file, size in files.items() if "sources/" in file}
    assert {f"fmi{version}.c", "README.txt"} <= set(sources)
    assert ("buildDescription.xml" in sources) == (version == 3)
    assert max(sources.values()) <= LARGEST
    assert any(file.startswith("binaries/") for file in files)
    description = read_model_description(str(path), validate=True)
    assert description.buildConfigurations
    for build in description.buildConfigurations:
        (file_set,) = build.sourceFileSets
        assert build.modelIdentifier == name
        assert sorted(file_set.sourceFiles) == sorted(file for file in sources if file.endswith(".c"))


STEPS = {
    "BoostPlant": ("hp_wastegate_pwm", [40.0, 60.0]),
    "BoostController": ("boost_pressure", [1e5, 1.4e5]),
}
"""An input of each model, and values that it takes in turn."""


@pytest.mark.parametrize("name", NAMES)
def test_the_memory_of_a_module_does_not_grow_in_a_step(modules: Path, name: str) -> None:
    """That of the sources is this module's."""
    call, put, memory, store = module(modules / f"{name}.wasm")
    description = read_model_description(str(TARGET / "fmu" / f"{name}.fmu"))
    token = put(description.guid.encode() + b"\0")
    instance = call("fmi2Instantiate", put(b"name\0"), 1, token, 0, put(bytes(20)), 0, 0)
    assert call("fmi2SetupExperiment", instance, 0, 0.0, 0.0, 0, 0.0) == 0
    assert call("fmi2EnterInitializationMode", instance) == 0
    assert call("fmi2ExitInitializationMode", instance) == 0
    signal, values = STEPS[name]
    reference = next(v.valueReference for v in description.modelVariables if v.name == signal)
    references, numbers = put(pack("<I", reference)), [put(pack("<d", value)) for value in values]
    pages = memory.size(store)
    for step in range(2000):
        assert call("fmi2SetReal", instance, references, 1, numbers[step // 40 % 2]) == 0
        assert call("fmi2DoStep", instance, step * STEP, STEP, 1) == 0
    assert memory.size(store) == pages
