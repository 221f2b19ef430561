"""The environment variables with which `tests/fmi-master` finds libclang, in its wheel.

CONTRIBUTING.md says how to set them in a shell.
"""

from __future__ import annotations

import shlex
import subprocess
from importlib.util import find_spec
from pathlib import Path


def environment() -> dict[str, str]:
    """The variables for the generator of bindings."""
    (package,) = find_spec("clang").submodule_search_locations
    # The wheel lacks the compiler's own headers, such as stddef.h; the C compiler has them.
    command = ["cc", "-print-file-name=include"]
    headers = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    return {
        "LIBCLANG_PATH": str(Path(package).resolve() / "native"),
        "BINDGEN_EXTRA_CLANG_ARGS": f"-I{shlex.quote(headers)}",
    }


if __name__ == "__main__":
    for name, value in environment().items():
        print(f"export {name}={shlex.quote(value)}")
