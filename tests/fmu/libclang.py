"""Where the build of `tests/fmi-master` finds libclang: in the wheel, which needs no package of the system.

CONTRIBUTING.md says how a shell gets it.
"""

from __future__ import annotations

import shlex
import subprocess
from importlib.util import find_spec
from pathlib import Path


def environment() -> dict[str, str]:
    """What the generator of bindings must know."""
    (package,) = find_spec("clang").submodule_search_locations
    # The wheel is without the headers that belong to a compiler, such as stddef.h: the C compiler has them.
    command = ["cc", "-print-file-name=include"]
    headers = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    return {
        "LIBCLANG_PATH": str(Path(package).resolve() / "native"),
        "BINDGEN_EXTRA_CLANG_ARGS": f"-I{shlex.quote(headers)}",
    }


if __name__ == "__main__":
    for name, value in environment().items():
        print(f"export {name}={shlex.quote(value)}")
