"""Instances in many threads at once: no call of one affects another (FMI 2.0.5, section 2.1.1).

ctypes releases Python's lock during a call, so that calls run in parallel.
"""

from __future__ import annotations

import shutil
import sys
import threading
from _ctypes import dlclose
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from ctypes import byref, c_void_p
from math import nan
from pathlib import Path

import pytest

from fmu.exporter.importer import STEP, Instance, Library, Status, buffer
from fmu.master import Fmu

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

THREADS = 8
STEPS = 120


@pytest.fixture(autouse=True)
def switch_often() -> Iterator[None]:
    """Lets Python switch threads far more often than by default (5 ms)."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def at_once(work: Callable[[int], object]) -> list:
    """The results of some work in parallel threads, which start together."""
    barrier = threading.Barrier(THREADS)

    def begin(index: int) -> object:
        barrier.wait()
        return work(index)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(begin, range(THREADS)))


class Run:
    """Runs with a number, which selects the inputs."""

    def __init__(self, fmu: Fmu, library: Library) -> None:
        self.fmu, self.library = fmu, library

    def instance(self, index: int) -> Instance:
        """An instance, with the number as name and environment."""
        instance = Instance(self.fmu, self.library, name=b"%d" % index, environment=index)
        assert instance.component is not None
        return instance

    def set_inputs(self, instance: Instance, index: int, step: int) -> None:
        """Sets the inputs."""
        values = {"rate": 0.5 * index + 0.01 * step, "drive": 0.1 * index, "note": b"%d" % index}
        assert instance.set(values) == Status.OK

    def __call__(self, index: int) -> list[list]:
        """From fmi2Instantiate to fmi2FreeInstance; the outputs after each step."""
        instance = self.instance(index).initialize()
        results = []
        for step in range(STEPS):
            self.set_inputs(instance, index, step)
            assert instance.step(step * STEP, STEP) == Status.OK
            results.append(instance.outputs())
        assert instance.messages == []
        instance.free()
        return results


@pytest.fixture
def run(fmu: Fmu, library: Library) -> Run:
    """Runs of the test model."""
    return Run(fmu, library)


def test_threads_compute_what_one_computes(run: Run) -> None:
    """Eight instances in parallel, like one after the other."""
    alone = [run(index) for index in range(THREADS)]
    # So that an instance with another's input would be detected.
    assert len({str(results) for results in alone}) == THREADS
    for _ in range(5):
        assert at_once(run) == alone


def test_instances_come_and_go_at_once(run: Run) -> None:
    """A thousand per thread, while another one is stepping."""
    expected = run(0)

    def work(index: int) -> object:
        if index == 0:
            return [run(0) for _ in range(3)]
        for _ in range(1000):
            instance = run.instance(index)
            instance.set_up()
            instance.free()
        return None

    assert at_once(work)[0] == [expected] * 3


def test_states_are_saved_and_restored_at_once(run: Run) -> None:
    """Each thread restores states repeatedly, from handles and bytes, and does not free all of them."""
    alone = [run(index) for index in range(THREADS)]

    def work(index: int) -> list[list]:
        instance = run.instance(index).initialize()
        results = []
        reused = c_void_p()
        for step in range(STEPS):
            run.set_inputs(instance, index, step)
            instance.ok("fmi2GetFMUstate", byref(reused))
            data = instance.serialize(reused)
            read = c_void_p()
            instance.ok("fmi2DeSerializeFMUstate", buffer(data), len(data), byref(read))
            # A step elsewhere, then back, from either state.
            assert instance.step(step * STEP, 3 * STEP) == Status.OK
            instance.ok("fmi2SetFMUstate", read if step % 2 else reused)
            if step % 3:
                instance.ok("fmi2FreeFMUstate", byref(read))
            assert instance.step(step * STEP, STEP) == Status.OK
            results.append(instance.outputs())
        assert instance.messages == []
        instance.free()
        return results

    assert at_once(work) == alone


def test_a_state_goes_to_other_threads(run: Run) -> None:
    """One state, set in instances of other threads at the same time (section 2.1.8 ties it to the FMU)."""
    first = run.instance(0).initialize()
    first.run(10)
    state = first.save()

    def work(_: int) -> list:
        instance = run.instance(0).initialize()
        for _ in range(200):
            instance.ok("fmi2SetFMUstate", state)
        assert instance.step(10 * STEP, STEP) == Status.OK
        result = instance.outputs()
        instance.free()
        return result

    everywhere = at_once(work)
    assert first.step(10 * STEP, STEP) == Status.OK
    assert everywhere == [first.outputs()] * THREADS
    first.free()


def test_messages_reach_their_own_logger(run: Run) -> None:
    """Each thread causes errors with its number."""

    def work(index: int) -> None:
        instance = run.instance(index).initialize()
        expected = []
        for number in range(300):
            point = 1000 * (index + 1) + number
            assert instance.step(float(point), STEP) == Status.ERROR
            assert instance.set({"rate": nan}) == Status.ERROR
            expected.append(f"fmi2DoStep: currentCommunicationPoint is {point}, but the last step ended at 0")
            expected.append("fmi2SetReal: NaN for the variable rate")
        assert [message.text for message in instance.messages] == expected
        assert instance.names_and_environments == [(b"%d" % index, index or None)] * 600
        instance.free()

    at_once(work)


def test_the_library_unloads_after_threads(fmu: Fmu, tmp_path: Path) -> None:
    """While threads that called it still run: with thread-local destructors, it could not."""
    copy = shutil.copy(fmu.library, tmp_path)
    library = Library(copy)
    run, barrier = Run(fmu, library), threading.Barrier(THREADS)

    def work(index: int) -> None:
        barrier.wait()
        run(index)

    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(work, range(THREADS)))
        assert str(copy) in Path("/proc/self/maps").read_text()
        dlclose(library.handle._handle)
        assert str(copy) not in Path("/proc/self/maps").read_text()
