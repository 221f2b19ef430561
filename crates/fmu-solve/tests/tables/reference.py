"""Prints what SciPy interpolates between the numbers of the tests of tables:

python crates/fmu-solve/tests/tables/reference.py > crates/fmu-solve/tests/tables/values.csv

Run with SciPy 1.17.1."""

import numpy as np
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

KNOTS = np.array([-1.0, 0.0, 0.5, 2.0, 2.25, 7.0])
VALUES = np.array([3.0, 1.0, 1.0, -2.0, 4.0, 4.5])
ROWS = np.array([0.0, 1.0, 1.5, 4.0])
COLUMNS = np.array([-2.0, -1.0, 3.0, 5.0, 6.0])
GRID = np.array(
    [
        [1.0, 2.0, 0.0, 5.0, 5.0],
        [0.5, 2.5, 3.0, 2.0, 1.0],
        [4.0, -1.0, 2.0, 2.0, 7.0],
        [0.0, 0.0, 1.0, 3.0, -3.0],
    ]
)


def show(*cells: object) -> None:
    """A line, with the shortest texts that read back as the same numbers."""
    print(",".join(cell if isinstance(cell, str) else repr(float(cell)) for cell in cells))


def main() -> None:
    """Places at knots, between them and in the outermost segments; slopes at knots are those to the right."""
    print("interpolation,row,column,value,slope")
    cubic = PchipInterpolator(KNOTS, VALUES)
    for x in [*KNOTS[:-1], *np.linspace(-0.95, 6.95, 32)]:
        after = np.searchsorted(KNOTS, x, side="right")
        slope = (VALUES[after] - VALUES[after - 1]) / (KNOTS[after] - KNOTS[after - 1])
        show("linear", "", x, np.interp(x, KNOTS, VALUES), slope)
        show("cubic", "", x, cubic(x), cubic.derivative()(x))
    for interpolation, method in [("linear", "linear"), ("cubic", "pchip")]:
        surface = RegularGridInterpolator((ROWS, COLUMNS), GRID, method=method)
        for row in [0.0, 0.3, 1.0, 1.2, 2.0, 3.9]:
            for column in [-2.0, -1.5, -1.0, 0.7, 3.0, 4.4, 5.5]:
                show(interpolation, row, column, surface([[row, column]])[0], "")


if __name__ == "__main__":
    main()
