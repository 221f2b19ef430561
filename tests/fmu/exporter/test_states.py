"""Serialized states in another process, and what is told of bytes that are none (FMI 2.0.5, section 2.1.8).

That instances go on identically from states, and that damaged ones are refused, is tested in Rust
(tests/importer).
"""

from __future__ import annotations

import math
import struct
import subprocess
import sys
from collections.abc import Callable
from ctypes import byref, c_void_p
from pathlib import Path

import pytest

from fmu import ROOT
from fmu.exporter.importer import STEP, Instance, Library, Status, buffer
from fmu.master import Fmu

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

Make = Callable[..., Instance]


def drive(instance: Instance, begin: int, end: int) -> list[list]:
    """Steps of uneven length with changing inputs, some out of their bounds, since past warnings are part of
    the state. Returns the outputs after each step."""
    results = []
    for index in range(begin, end):
        values = {"rate": 11.0 * math.sin(0.3 * index), "drive": math.cos(index), "note": b"%d" % index}
        assert instance.set(values) in (Status.OK, Status.WARNING)
        assert instance.step(3.0 + index * 0.6 * STEP, 0.6 * STEP) == Status.OK
        results.append(instance.outputs())
    return results


def prepare(instance: Instance) -> Instance:
    """An instance with other parameters than the defaults, in the middle of a run."""
    parameters = {"tank.gain": 1.5, "settings.label": b"x", "settings.doubled": 1, "settings.first": 3}
    assert instance.set(parameters) == Status.OK
    instance.initialize(start_time=3.0, stop_time=100.0)
    drive(instance, 0, 20)
    return instance


def refusal(instance: Instance, data: bytes) -> str:
    """The message when bytes are refused, and no state is made."""
    state = c_void_p()
    text = instance.refuses("fmi2DeSerializeFMUstate", buffer(data), len(data), byref(state))
    assert state.value is None
    return text


def test_another_process_goes_on_identically(make: Make, fmu: Fmu, tmp_path: Path) -> None:
    first = prepare(make())
    (tmp_path / "state").write_bytes(first.snapshot())
    command = [sys.executable, "-m", "fmu.exporter.test_states", fmu.path, tmp_path]
    done = subprocess.run(command, cwd=ROOT / "tests", check=True, timeout=60, capture_output=True, text=True)
    assert done.stdout.strip() == repr(drive(first, 20, 50))


def test_errors_in_the_bytes_are_named(make: Make) -> None:
    instance = prepare(make())
    data = instance.snapshot()
    assert "end" in refusal(instance, data[:-1])
    assert "3 bytes follow" in refusal(instance, data + b"abc")
    # The format's version follows the 8 bytes of the signature.
    newer = struct.unpack("<I", data[8:12])[0] + 1
    assert f"format {newer}" in refusal(instance, data[:8] + struct.pack("<I", newer) + data[12:])
    assert "not a serialized state" in refusal(instance, b"PK\3\4" + data[4:])
    damaged = bytearray(data)
    damaged[len(damaged) // 2] ^= 0x10
    assert "checksum" in refusal(instance, bytes(damaged))


if __name__ == "__main__":
    restored = Fmu(Path(sys.argv[1]), Path(sys.argv[2]) / "extracted")
    elsewhere = Instance(restored, Library(restored.library))
    elsewhere.restore((Path(sys.argv[2]) / "state").read_bytes())
    print(repr(drive(elsewhere, 20, 50)))
