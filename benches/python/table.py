"""Prints what `benches/run` measured: `python table.py TARGET`, with cargo's target folder.

Times are the least of all samples in all passes, per step or call, since other load only adds to them.
Instruction counts do not depend on other load, and decide where percents matter.
"""

from __future__ import annotations

import csv
import json
import statistics
import sys
from pathlib import Path

from masters import STEP, STEPS

Figures = dict[tuple[str, str], float]
"""By benchmark group and implementation."""

RANDOM = range(1, 11)
"""The experiments in which all inputs move at random."""

GROUPS = [
    "right-hand side",
    *(f"plant 12.5 ms {stretch}" for stretch in ("quiet", "voltage", "duty", "load", "whole", "slowest")),
    *(f"plant 12.5 ms random {number}" for number in RANDOM),
    *(f"plant 12.5 ms {stretch} exhaust area" for stretch in ("quiet", "duty")),
    *(f"plant 1 ms {stretch}" for stretch in ("quiet", "duty")),
    "controller 12.5 ms",
    "controller 12.5 ms thin air",
    "controller 12.5 ms thin air with shaft",
    "controller 12.5 ms paper",
    "controller 1 ms",
    "controller empty",
    "get ten Reals",
    "set ten Reals",
    "instantiate running",
    "instantiate settled",
    "closed loop",
]


def times(target: Path) -> Figures:
    """In s."""
    found: Figures = {}
    for file in target.glob("criterion/*/*/pass*/benchmark.json"):
        benchmark = json.loads(file.read_text())
        sample = json.loads(file.with_name("sample.json").read_text())
        least = min(time / count for time, count in zip(sample["times"], sample["iters"], strict=True))
        key = (benchmark["group_id"], benchmark["function_id"])
        seconds = 1e-9 * least / benchmark["throughput"]["Elements"]
        found[key] = min(seconds, found.get(key, seconds))
    return found


def instructions(target: Path) -> Figures:
    """Instructions counted by callgrind."""
    found = {}
    folder = target / "benches" / "counts"
    with (folder / "names.csv").open() as file:
        for index, (group, by, elements) in enumerate(csv.reader(file), 1):
            lines = (folder / f"count.{index}").read_text().splitlines()
            (total,) = (int(line.split()[1]) for line in lines if line.startswith("totals:"))
            found[group, by] = total / int(elements)
    return found


def duration(seconds: float | None) -> str:
    if seconds is None:
        return ""
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.1f} ns"


def row(*cells: str) -> None:
    print(f"| {' | '.join(cells)} |")


def heading(*cells: str) -> None:
    print()
    row(*cells)
    row("---", *("---:" for _ in cells[1:]))


def print_figures(time: Figures, count: Figures) -> None:
    who = ("fmu", "direct", "reference")
    heading("", "FMU", "model", "reference", "FMU / model", "reference / FMU", "instructions of each")
    for group in GROUPS:
        fmu, direct, reference = (time.get((group, by)) for by in who)
        first = fmu or direct
        counts = [f"{count[group, by]:.0f}" for by in who if (group, by) in count]
        row(
            group,
            *(duration(seconds) for seconds in (fmu, direct, reference)),
            f"{fmu / direct:.3f}" if fmu and direct else "",
            f"{reference / first:.2f}" if reference and first else "",
            " / ".join(counts),
        )


def print_targets(time: Figures, count: Figures, python: dict[str, float]) -> None:
    heading("target", "measured", "")

    def target(what: str, measured: str, met: bool) -> None:
        row(what, measured, "met" if met else "not met")

    def added(figures: Figures, group: str) -> float:
        return figures[group, "fmu"] - figures[group, "direct"]

    group = "plant 12.5 ms quiet"
    share = 100 * added(count, group) / count[group, "direct"]
    by_time = 100 * added(time, group) / time[group, "direct"]
    measured = f"{share:.2f} % of the instructions ({by_time:.1f} % of the time)"
    target("FMI adds less than 2 % to a quiet step of the plant", measured, share < 2)
    empty = added(time, "controller empty")
    target("FMI adds less than 40 ns to an empty step", duration(empty), empty < 40e-9)
    for verb in ("get", "set"):
        seconds = time[f"{verb} ten Reals", "fmu"]
        target(f"{verb} ten values in less than 40 ns", duration(seconds), seconds < 40e-9)
    for stretch in ("quiet", "voltage", "duty", "load"):
        group = f"plant 12.5 ms {stretch}"
        ratio = time[group, "reference"] / time[group, "fmu"]
        target(f"plant {stretch}: 20 times faster than the reference", f"{ratio:.2f} times", ratio >= 20)
    groups = [f"plant 12.5 ms random {number}" for number in RANDOM]
    ratio = statistics.median(time[group, "reference"] / time[group, "fmu"] for group in groups)
    target("plant, all inputs moving: 15 times (median)", f"{ratio:.2f} times", ratio >= 15)
    group = "plant 12.5 ms slowest"
    ratio = time[group, "fmu"] / time[group, "reference"]
    target("slowest step at most 2 times the reference's", f"{ratio:.2f} times", ratio <= 2)
    step, exchange = (python[f"{what}, PythonFMU"] / python[f"{what}, Rust"] for what in ("step", "exchange"))
    measured = f"{step:.0f} times ({exchange:.0f} with inputs set and outputs read)"
    target("controller's step 100 times faster than PythonFMU's", measured, step >= 100)
    for mode, limit in (("running", 100e-6), ("settled", 20e-3)):
        seconds = time[f"instantiate {mode}", "fmu"]
        what = f"instantiate to ready, {mode} start, in less than {duration(limit)}"
        target(what, duration(seconds), seconds < limit)


def main() -> None:
    target = Path(sys.argv[1])
    passes = [json.loads(file.read_text()) for file in (target / "benches").glob("pass*.json")]
    python = {name: min(found[name] for found in passes) for name in passes[0]}
    loop = python["closed loop"]
    time, count = times(target), instructions(target)

    print("Time of one right-hand side, step, call, start, or run; reference: a plain Runge-Kutta method.")
    print_figures(time, count)

    native, simulated = time["closed loop", "fmu"], STEPS * STEP
    heading("closed loop of 124 s at 80 Hz", "time", "times real time", "share inside the FMUs")
    # The native master makes the same calls as the one in Python, with negligible overhead.
    for who, seconds, share in (
        ("both models called in Rust", time["closed loop", "direct"], ""),
        ("both FMUs under a native master", native, ""),
        ("both FMUs under FMPy", loop, f"{100 * native / loop:.0f} %"),
    ):
        row(who, duration(seconds), f"{simulated / seconds:.0f}", share)

    # Both FMUs in one process with Python, which PythonFMU needs, under the same masters.
    heading("controller's step", "in Rust", "by PythonFMU", "ratio")
    for name, what in (
        ("step", "fmi2DoStep under a native master"),
        ("exchange", "the same with inputs set and outputs read"),
        ("exchange by FMPy", "the same under FMPy"),
    ):
        rust, other = python[f"{name}, Rust"], python[f"{name}, PythonFMU"]
        row(what, duration(rust), duration(other), f"{other / rust:.1f}")

    print_targets(time, count, python)


if __name__ == "__main__":
    main()
