"""Exports models with many states, runs them, and compares the cost with SciPy's BDF with the pattern of the
Jacobian: a table of docs/integrator.md.

Called with an FMU, a number of steps and a file for the states at the end, runs it for a second."""

import ctypes
import json
import subprocess
import sys
import time
from pathlib import Path
from shutil import rmtree

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from scipy.integrate import solve_ivp
from scipy.sparse import csr_array, diags_array, eye_array, kron

HERE = Path(__file__).parent / "large"
TOLERANCE = 1e-6
#: Where there is no closed form.
PRECISE = 1e-11
SYSTEMS = [
    *(("rod", 10), ("rod", 100), ("rod", 1000), ("rod", 10000)),
    *(("network", 1000), ("cube", 1000), ("cube", 8000), ("cube", 27000)),
]
#: Communication steps in a second.
STEPS = 10, 1000
#: Times are the least of so many runs.
RUNS = 3
#: So many that blocks which the C library keeps for later hardly matter.
SAVED = 100
#: In s.
LONG = 2
#: Larger systems only show where the limit is.
LARGEST = 10_000


class Allocated(ctypes.Structure):
    """`mallinfo2` of the C library."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks"),
            *("uordblks", "fordblks", "keepcost"),
        )
    ]


# Found once, as a library and its functions are allocated, too.
mallinfo2 = ctypes.CDLL(None).mallinfo2
mallinfo2.restype = Allocated


def allocated() -> int:
    """The bytes allocated by this process."""
    found = mallinfo2()
    return found.uordblks + found.hblkhd


def run(path: str, steps: int, file: str) -> None:
    """Runs an FMU for a second, and prints its time (s) and bytes: all, a saved and a serialized state."""
    folder = extract(path)
    description = read_model_description(folder)
    before = allocated()
    fmu = FMU2Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=folder,
    )
    fmu.instantiate()
    fmu.setupExperiment(tolerance=TOLERANCE, startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    begin = time.process_time()
    for step in range(steps):
        fmu.doStep(step / steps, 1 / steps)
    seconds = time.process_time() - begin
    held = allocated() - before
    before = allocated()
    states = [fmu.getFMUState() for _ in range(SAVED)]
    saved = (allocated() - before) / SAVED
    serialized = len(fmu.serializeFMUState(states[0]))
    references = [
        variable.valueReference for variable in description.modelVariables if variable.name[:2] == "x["
    ]
    np.array(fmu.getReal(references)).tofile(file)
    print(json.dumps([seconds, held, saved, serialized]))
    rmtree(folder)


def exported(system: str, size: int, cargo_fmu: str, folder: Path) -> float:
    """Exports a system, and returns how long that took in s."""
    package = folder / f"{system}_{size}"
    rmtree(package, ignore_errors=True)
    new = [cargo_fmu, "fmu", "new", "--vcs", "none", "--template", "van_der_pol", str(package)]
    subprocess.run(new, check=True, capture_output=True)
    states = {"name": "x", "causality": "output", "unit": "1", "dimensions": [size], "start": 0}
    declaration = {
        "description": f"{system} of {size} states",
        "variables": [states | {"derivative": {"unit": "1/s"}}],
    }
    (package / "model.json").write_text(json.dumps(declaration))
    (package / "src" / "lib.rs").write_text((HERE / f"{system}.rs").read_text())
    begin = time.monotonic()
    command = [cargo_fmu, "fmu", "export", "--out", str(folder)]
    subprocess.run(command, cwd=package, check=True, capture_output=True)
    return time.monotonic() - begin


def best(command: list[str]) -> list[float]:
    """What the fastest of some runs prints; of one, if it takes long."""
    runs = []
    while len(runs) < RUNS and (not runs or runs[0][0] < LONG):
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        runs.append(json.loads(f"[{done.stdout.strip().strip('[]')}]"))
    return min(runs)


def solution(system: str, size: int, time: float) -> np.ndarray:
    """The solution of the diffusion's equations at a time in s."""

    def wave(cells: int, number: int) -> np.ndarray:
        decay = 0.04 * cells**2 * np.sin(number * np.pi / (2 * cells)) ** 2
        return np.cos(number * np.pi * (np.arange(cells) + 0.5) / cells) * np.exp(-decay * time)

    if system == "rod":
        return wave(size, 1) + 0.5 * wave(size, 10)
    along = wave(round(size ** (1 / 3)), 1)
    return (along[:, None, None] + along[:, None] + along).ravel()


class Network:
    """The links of network.rs."""

    def __init__(self, size: int) -> None:
        self.nodes, self.others, self.conductances = [], [], []
        seed = 1

        def random() -> int:
            nonlocal seed
            seed = (seed * 6364136223846793005 + 1442695040888963407) % 2**64
            return seed >> 33

        for node in range(size):
            for _ in range(2):
                self.nodes.append(node)
                self.others.append(random() % size)
                self.conductances.append(0.1 + 100 * (random() % 1000 / 1000) ** 4)
        self.conductances = np.array(self.conductances)

    def rates(self, _: float, x: np.ndarray) -> np.ndarray:
        difference = x[self.nodes] - x[self.others]
        flow = self.conductances * difference * (difference**2 + 1)
        return np.bincount(self.others, flow, len(x)) - np.bincount(self.nodes, flow, len(x))

    def pattern(self, size: int) -> np.ndarray:
        pattern = np.eye(size)
        pattern[self.nodes, self.others] = pattern[self.others, self.nodes] = 1
        return pattern


def laplacian(system: str, size: int) -> csr_array:
    """The Jacobian of diffusion in a rod or a cube."""
    edge = size if system == "rod" else round(size ** (1 / 3))
    ends = np.ones(edge)
    line = diags_array([ends[1:], -2 * ends, ends[1:]], offsets=[-1, 0, 1]).tolil()
    line[0, 0] = line[-1, -1] = -1
    if system == "rod":
        return csr_array(0.01 * size**2 * line)
    one = eye_array(edge)
    sum_of_three = kron(kron(line, one), one) + kron(kron(one, line), one) + kron(kron(one, one), line)
    return csr_array(0.01 * edge**2 * sum_of_three)


def by_bdf(system: str, size: int, tolerance: float = TOLERANCE) -> tuple[float, np.ndarray]:
    """The time and the states at 1 s of SciPy's BDF."""
    if system == "network":
        network = Network(size)
        rates, pattern, start = network.rates, network.pattern(size), np.sin(np.arange(size))
    else:
        pattern = laplacian(system, size)
        start = solution(system, size, 0.0)

        def rates(_: float, x: np.ndarray) -> np.ndarray:
            return pattern @ x

    begin = time.process_time()
    solved = solve_ivp(rates, (0, 1), start, "BDF", rtol=tolerance, atol=tolerance, jac_sparsity=pattern)
    return time.process_time() - begin, solved.y[:, -1]


def in_time(seconds: float) -> str:
    if seconds >= 1:
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
    return f"{1000 * seconds:.2g} ms" if seconds < 0.0995 else f"{1000 * seconds:.0f} ms"


def in_memory(size: float) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.1f} kB"


def main(folder: Path, cargo_fmu: str) -> None:
    file = str(folder / "states.bin")
    # Compiles what all packages have in common.
    exported("rod", 11, cargo_fmu, folder)
    heads = "export", "instance", "saved, serialized state", "1 s in 10 steps", "in 1,000 steps", "BDF"
    print("\n| |", " | ".join(heads), "|")
    print("|---" * (1 + len(heads)) + "|")
    for system, size in SYSTEMS:
        export = exported(system, size, cargo_fmu, folder)
        if system == "network":
            _, reference = by_bdf(system, size, PRECISE)
        else:
            reference = solution(system, size, 1.0)

        def off(states: np.ndarray, reference: np.ndarray = reference) -> str:
            return f"{max(abs(states - reference) / (abs(reference) + 1)):.0e}"

        cells = [in_time(export)]
        for steps in STEPS if size <= LARGEST else STEPS[:1]:
            fmu = str(folder / f"{system}_{size}.fmu")
            seconds, held, saved, serialized = best([sys.executable, __file__, fmu, str(steps), file])
            if steps == STEPS[0]:
                cells += [in_memory(held), f"{in_memory(saved)}, {in_memory(serialized)}"]
            cells.append(f"{in_time(seconds)}: {off(np.fromfile(file))}")
        if size <= LARGEST:
            seconds, states = by_bdf(system, size)
            cells.append(f"{in_time(seconds)}: {off(states)}")
        cells += [""] * (len(heads) - len(cells))
        print(f"| {system} of {size:,} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    if sys.argv[1].endswith(".fmu"):
        run(sys.argv[1], int(sys.argv[2]), sys.argv[3])
    else:
        main(Path(sys.argv[1]), sys.argv[2])
