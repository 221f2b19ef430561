"""Instances in many threads at once: no call of one is felt by another (FMI 2.0.5, section 2.1.1).

ctypes releases Python's lock during a call, so the calls do run at the same time.
"""

from __future__ import annotations

import shutil
import sys
import threading
from _ctypes import dlclose
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from ctypes import byref, c_char, c_void_p
from math import nan
from pathlib import Path

import pytest
from c_interface import Library, Status
from master import Fmu
from named import Named

THREADS = 8
STEP = 1 / 80
STEPS = 120


@pytest.fixture(autouse=True)
def switch_often() -> Iterator[None]:
    """Lets Python change threads far more often than it does by itself (5 ms)."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def at_once(work: Callable[[int], object]) -> list:
    """What some work gives in each of the threads, which begin together."""
    barrier = threading.Barrier(THREADS)

    def begin(index: int) -> object:
        barrier.wait()
        return work(index)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(begin, range(THREADS)))


NAMES = ["BoostPlant", "BoostController"]


class Run:
    """Runs of both FMUs, by a number: even ones are of the plant, odd ones of the controller, and each has an
    input of its own."""

    def __init__(self, fmus: dict[str, Fmu], libraries: dict[str, Library]) -> None:
        self.fmus, self.libraries = fmus, libraries

    def caller(self, index: int) -> Named:
        """An instance; its name and its environment tell the number."""
        name = NAMES[index % 2]
        description = self.fmus[name].description
        caller = Named(self.libraries[name], description, name=b"%d" % index, environment=index)
        assert caller.component is not None
        return caller

    def set_speed(self, caller: Named, index: int, step: int) -> None:
        """Sets the input."""
        speed = 1200.0 + 150.0 * index + 2.0 * step
        assert caller.set_reals(caller.references("engine_speed"), [speed]) == Status.OK

    def __call__(self, index: int) -> list[list[float]]:
        """From fmi2Instantiate to fmi2FreeInstance; the outputs after each step, to the bit."""
        caller = self.caller(index)
        self.set_speed(caller, index, 0)
        caller.initialize()
        results = []
        for step in range(STEPS):
            self.set_speed(caller, index, step)
            assert caller.step(step * STEP, STEP) == Status.OK
            results.append(caller.get_reals(caller.output_references()))
        assert caller.messages == []
        caller.free()
        return results


@pytest.fixture
def run(fmus: dict[str, Fmu], libraries: dict[str, Library]) -> Run:
    """Runs of both FMUs."""
    return Run(fmus, libraries)


def test_threads_give_what_one_gives(run: Run) -> None:
    """Four instances of each FMU at once, as one after the other."""
    alone = [run(index) for index in range(THREADS)]
    # Otherwise an instance that took its neighbour's input would go unseen.
    assert len({str(results) for results in alone}) == THREADS
    for _ in range(5):
        assert at_once(run) == alone


def test_instances_come_and_go_at_once(run: Run) -> None:
    """A thousand per thread, while a bystander works."""
    expected = run(0)

    def work(index: int) -> object:
        if index == 0:
            return [run(0) for _ in range(3)]
        for _ in range(1000):
            caller = run.caller(index)
            assert caller.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == Status.OK
            caller.free()
        return None

    assert at_once(work)[0] == [expected] * 3


def test_states_are_saved_and_restored_at_once(run: Run) -> None:
    """Each thread goes back again and again, by handles and by bytes, and leaves states behind."""
    alone = [run(index) for index in range(THREADS)]

    def work(index: int) -> list[list[float]]:
        caller = run.caller(index)
        run.set_speed(caller, index, 0)
        caller.initialize()
        results = []
        reused = c_void_p()
        for step in range(STEPS):
            run.set_speed(caller, index, step)
            assert caller.call("fmi2GetFMUstate", byref(reused)) == Status.OK
            data = caller.serialize(reused)
            read, buffer = c_void_p(), (c_char * len(data))(*data)
            arguments = [buffer, len(data), byref(read)]
            assert caller.call("fmi2DeSerializeFMUstate", *arguments) == Status.OK
            # Somewhere else, and back; by the one state and by the other.
            assert caller.step(step * STEP, 3 * STEP) == Status.OK
            assert caller.call("fmi2SetFMUstate", read if step % 2 else reused) == Status.OK
            if step % 3:
                assert caller.call("fmi2FreeFMUstate", byref(read)) == Status.OK
            assert caller.step(step * STEP, STEP) == Status.OK
            results.append(caller.get_reals(caller.output_references()))
        assert caller.messages == []
        caller.free()
        return results

    assert at_once(work) == alone


def test_a_state_goes_to_other_threads(run: Run) -> None:
    """One state, set in instances of other threads at the same time (section 2.1.8 ties it to the FMU)."""
    first = run.caller(0)
    first.initialize()
    for step in range(10):
        assert first.step(step * STEP, STEP) == Status.OK
    state = first.save()

    def work(_: int) -> list[float]:
        caller = run.caller(0).initialize()
        for _ in range(200):
            assert caller.call("fmi2SetFMUstate", state) == Status.OK
        assert caller.step(10 * STEP, STEP) == Status.OK
        result = caller.get_reals(caller.output_references())
        caller.free()
        return result

    everywhere = at_once(work)
    assert first.step(10 * STEP, STEP) == Status.OK
    assert everywhere == [first.get_reals(first.output_references())] * THREADS
    first.free()


def test_messages_reach_their_own_logger(run: Run) -> None:
    """Each thread provokes errors that tell of its own number."""

    def work(index: int) -> None:
        caller = run.caller(index)
        caller.initialize()
        for number in range(300):
            assert caller.step(1000.0 * (index + 1) + number, STEP) == Status.ERROR
            assert caller.set_reals(caller.references("engine_speed"), [nan]) == Status.ERROR
        expected = []
        for number in range(300):
            point = 1000 * (index + 1) + number
            expected.append(f"fmi2DoStep: currentCommunicationPoint is {point}, but the last step ended at 0")
            expected.append("fmi2SetReal: NaN for the variable engine_speed")
        assert [message.text for message in caller.messages] == expected
        assert caller.names_and_environments == [(b"%d" % index, index or None)] * 600
        caller.free()

    at_once(work)


@pytest.mark.parametrize("name", NAMES)
def test_library_unloads_after_threads(
    fmus: dict[str, Fmu], libraries: dict[str, Library], name: str, tmp_path: Path
) -> None:
    """While threads that called it are alive: with something to do at a thread's end, it could not."""
    copy = tmp_path / libraries[name].path.name
    shutil.copy(libraries[name].path, copy)
    library = Library(copy)
    run = Run(fmus, {**libraries, name: library})
    barrier = threading.Barrier(THREADS)

    def is_mapped() -> bool:
        return str(copy) in Path("/proc/self/maps").read_text()

    with ThreadPoolExecutor(THREADS) as pool:

        def work(index: int) -> None:
            barrier.wait()
            run(index)

        list(pool.map(work, [2 * thread + NAMES.index(name) for thread in range(THREADS)]))
        assert is_mapped()
        dlclose(library.handle._handle)
        assert not is_mapped()
