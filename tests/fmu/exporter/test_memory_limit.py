"""A process whose memory is exhausted: calls fail with a message, and the process continues."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from fmu import ROOT
from fmu.master import Fmu

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

BEGIN = """
import resource
import sys
from ctypes import byref, c_void_p
from pathlib import Path

from fmpy.fmi2 import fmi2CoSimulation
from fmu.exporter.importer import Instance, Library, Status
from fmu.master import Fmu

fmu = Fmu(Path(sys.argv[1]), Path(sys.argv[2]))
instance = Instance(fmu, Library(fmu.library))


def limit(spare):
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    size = pages * resource.getpagesize() + spare
    resource.setrlimit(resource.RLIMIT_AS, (size, resource.RLIM_INFINITY))
"""

TEXT = """
call = instance.settings({"note": b"x" * (512 << 20)})
limit(256 << 20)
assert instance.call(*call) == Status.ERROR
"""

INSTANCES = """
made = (c_void_p * 1_000_000)()
arguments = (b"more", fmi2CoSimulation, fmu.guid.encode(), None, byref(instance.callbacks), 0, 0)
limit(64 << 20)
for place in range(len(made)):
    made[place] = instance.library.fmi2Instantiate(*arguments)
    if made[place] is None:
        break
"""

END = """
resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
(message,) = instance.messages
assert message.status == Status.ERROR and "memory" in message.text, message
instance.ok("fmi2Reset")
instance.initialize()
print("goes on")
"""


@pytest.mark.parametrize("use_up", [TEXT, INSTANCES], ids=["text", "instances"])
def test_no_memory_is_an_error(fmu: Fmu, tmp_path: Path, use_up: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", BEGIN + use_up + END, fmu.path, tmp_path],
        cwd=ROOT / "tests",
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "goes on\n"), done.stderr
