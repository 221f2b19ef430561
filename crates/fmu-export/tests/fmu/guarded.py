"""Arrays of random importers, with bytes behind them that no call may change."""

from __future__ import annotations

import math
from ctypes import Array, c_uint8
from typing import Any

CAPACITY = 16
"""Of arrays."""

CANARY = 0xA5

NUMBERS = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, 1e300, math.inf, -math.inf, math.nan]


class Guarded:
    """An array for `size` values, with bytes behind it that must stay as they are."""

    def __init__(self, type: Any, values: list[Any], size: int) -> None:
        self.array: Array[Any] = (type * (size + CAPACITY))()
        self.size = size
        self.bytes = (c_uint8 * (len(self.array) * size_of(type))).from_buffer(self.array)
        self.end = size * size_of(type)
        for position in range(self.end, len(self.bytes)):
            self.bytes[position] = CANARY
        for position, value in enumerate(values[:size]):
            self.array[position] = value

    def check(self) -> None:
        """Whether the bytes behind it are as they were."""
        assert all(byte == CANARY for byte in self.bytes[self.end :]), "written beyond the end of an array"

    def values(self) -> list[Any]:
        """What it holds."""
        return list(self.array[: self.size])


def size_of(type: Any) -> int:
    """The bytes of an element."""
    return len(bytes((type * 1)()))


def plain(value: Any) -> Any:
    """A value that equals itself, which NaN does not."""
    return repr(value) if isinstance(value, float) else value
