"""What WebAssembly modules consist of, by bytes: `python sizes.py MODULE...`, with the names of functions."""

from __future__ import annotations

import re
import sys
from pathlib import Path

IMPORTS, CODE, DATA, CUSTOM = 2, 10, 11, 0
"""Identifiers of sections (WebAssembly Core Specification 1.0, section 5.5)."""

GROUPS = {
    "saved states": r"persist|serialize|saved_states|fmu_(load|save)_state|FMUstate|FMUState",
    "access to variables, copies and checks of them": r"variables(\d+|\.\.)generated",
    "equations, solvers, the law": r"boost_fmu",
    "functions of FMI, and the runtime beneath": r"fmu_export|^fmi|^fmu_",
    "numbers to text": r"flt2dec|fmt5float|fmt3num",
    "other text": r"core3fmt|5alloc3fmt|core3str|5alloc3str|core4char|6string",
    "memory and collections": r"dlmalloc|rust_alloc|raw_vec|collections|5alloc5alloc|memcpy|memmove|memset",
    "mathematics": r"compiler_builtins|libm|math",
    "the rest of the standard library": r"",
}
"""Functions by their mangled names: each belongs to the first group that has it."""


def number(data: bytes, place: int) -> tuple[int, int]:
    """A number in the format LEB128, and the place after it."""
    value = shift = 0
    while True:
        byte = data[place]
        place += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, place


def name(data: bytes, place: int) -> tuple[str, int]:
    """A name, and the place after it."""
    size, place = number(data, place)
    return data[place : place + size].decode(), place + size


def sections(module: bytes) -> list[tuple[int, bytes]]:
    """The sections, each with its identifier."""
    found, place = [], 8
    while place < len(module):
        size, begin = number(module, place + 1)
        found.append((module[place], module[begin : begin + size]))
        place = begin + size
    return found


def imported(section: bytes) -> int:
    """The number of imports, all functions."""
    return number(section, 0)[0]


def sizes(section: bytes) -> list[int]:
    """The bytes of each function."""
    count, place = number(section, 0)
    found = []
    for _ in range(count):
        size, begin = number(section, place)
        found.append(begin - place + size)
        place = begin + size
    return found


def names(section: bytes) -> dict[int, str]:
    """The names of functions by their indices, of the custom section that has them (appendix 7.4)."""
    kind, place = name(section, 0)
    found = {}
    while kind == "name" and place < len(section):
        subsection = section[place]
        size, place = number(section, place + 1)
        end = place + size
        if subsection == 1:
            count, place = number(section, place)
            for _ in range(count):
                index, place = number(section, place)
                found[index], place = name(section, place)
        place = end
    return found


def main() -> None:
    for file in map(Path, sys.argv[1:]):
        parts = dict.fromkeys(GROUPS, 0)
        first, of_functions, named, data = 0, [], {}, 0
        for identifier, section in sections(file.read_bytes()):
            if identifier == IMPORTS:
                first = imported(section)
            elif identifier == CODE:
                of_functions = sizes(section)
            elif identifier == DATA:
                data = len(section)
            elif identifier == CUSTOM:
                named |= names(section)
        for index, size in enumerate(of_functions, start=first):
            group = next(group for group, pattern in GROUPS.items() if re.search(pattern, named[index]))
            parts[group] += size
        print(f"{file.stem}: {(sum(of_functions) + data) / 1e3:.0f} kB")
        for part, size in [*parts.items(), ("data: descriptions of variables, tables, texts", data)]:
            print(f"{size / 1e3:8.1f}  {part}")


if __name__ == "__main__":
    main()
