"""Solves the systems of the built-in integrator's rows, which are given, by SciPy and by CVode, and prints a
table for each: work against error."""

import csv
import ctypes
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
from fmpy import sundials
from fmpy.sundials.libraries import sundials_cvode, sundials_sunmatrixdense
from scipy.integrate import solve_ivp

EQUATIONS = Path(__file__).parents[2] / "crates/fmu-export/tests/equations"
sys.path.append(str(EQUATIONS))

from reference import SYSTEMS, System  # noqa: E402

TITLES = {
    "decay": "Exponential decay to 3 s",
    "van_der_pol_1": "Van der Pol, μ = 1, to 20 s",
    "bouncing_ball": "Bouncing ball to 2 s, four bounces",
    "robertson": "Robertson to 4·10⁵ s",
    "van_der_pol_1000": "Van der Pol, μ = 1000, to 2000 s",
    "hires": "HIRES to 321.8122 s",
}
STIFF = {"robertson", "van_der_pol_1000", "hires"}


class Counted:
    """A function that counts its calls."""

    def __init__(self, function):
        self.function = function
        self.calls = 0

    def __call__(self, *arguments):
        self.calls += 1
        return self.function(*arguments)


class Ball:
    """The ball that bounces, with the parameters of bouncing_ball.json."""

    RESTITUTION, GRAVITY = 0.7, 9.81
    SYSTEM = System(lambda _, x: [x[1], -Ball.GRAVITY], lambda _, x: [[0, 1], [0, 0]], [1.0, 0.0], 1.0, [2.0])

    @staticmethod
    def height(_, x):
        return x[0]

    @staticmethod
    def bounced(x):
        return [0.0, -Ball.RESTITUTION * x[1]]

    @staticmethod
    def solution(end):
        """Its flight after the last bounce before an end."""
        speed = (2 * Ball.GRAVITY) ** 0.5
        time = speed / Ball.GRAVITY
        while True:
            speed *= Ball.RESTITUTION
            if time + 2 * speed / Ball.GRAVITY > end:
                flight = end - time
                return [speed * flight - Ball.GRAVITY * flight**2 / 2, speed - Ball.GRAVITY * flight]
            time += 2 * speed / Ball.GRAVITY


# What `solve_ivp` takes an event by.
Ball.height.terminal, Ball.height.direction = True, -1


def by_scipy(method, system, end, tolerance, bounces):
    """The states at the end, calls of the rates and of the Jacobian, steps."""
    rates, jacobian = Counted(system.rates), Counted(system.jacobian)
    options = {"jac": jacobian} if method in {"Radau", "BDF", "LSODA"} else {}
    time, states, steps = 0.0, system.start, 0
    while time < end:
        part = solve_ivp(
            rates,
            (time, end),
            states,
            method,
            events=Ball.height if bounces else None,
            rtol=tolerance,
            atol=tolerance * system.nominal,
            # A first step beyond the next bounce would hide it: at its begin, the ball is on the ground.
            first_step=1e-3 if bounces else None,
            **options,
        )
        if not part.success:
            raise RuntimeError(part.message)
        time, states, steps = part.t[-1], part.y[:, -1], steps + len(part.t) - 1
        if part.status == 1:
            states = Ball.bounced(states)
    return states, rates.calls, jacobian.calls, f"{steps}"


JACOBIAN_FUNCTION = ctypes.CFUNCTYPE(
    ctypes.c_int,
    sundials.sunrealtype,
    sundials.N_Vector,
    sundials.N_Vector,
    ctypes.c_void_p,
    ctypes.c_void_p,
    *[sundials.N_Vector] * 3,
)
MATRIX_DATA = sundials_sunmatrixdense.SUNDenseMatrix_Data
MATRIX_DATA.argtypes, MATRIX_DATA.restype = [ctypes.c_void_p], ctypes.POINTER(ctypes.c_double)


def by_cvode(_, system, end, tolerance, bounces):
    """As `by_scipy`, by CVode's BDF, set up as FMPy does, but with the exact Jacobian."""
    size = len(system.start)

    def array(vector):
        return np.ctypeslib.as_array(sundials.NV_DATA_S(vector), (size,))

    rates, jacobian = Counted(system.rates), Counted(system.jacobian)

    def set_rates(time, states, result, _):
        array(result)[:] = rates(time, array(states))
        return 0

    def set_jacobian(time, states, _rates, matrix, *_):
        columns = np.transpose(jacobian(time, array(states)))
        np.ctypeslib.as_array(MATRIX_DATA(matrix), (size, size))[:] = columns
        return 0

    def set_height(time, states, result, _):
        result[0] = Ball.height(time, array(states))
        return 0

    context = sundials.SUNContext()
    check(sundials.SUNContext_Create(sundials.SUN_COMM_NULL, ctypes.byref(context)))
    states, absolute = (sundials.N_VNew_Serial(size, context) for _ in range(2))
    array(states)[:] = system.start
    array(absolute)[:] = tolerance * system.nominal
    memory = sundials.CVodeCreate(sundials.CV_BDF, context)
    callbacks = [sundials.CVRhsFn(set_rates), JACOBIAN_FUNCTION(set_jacobian), sundials.CVRootFn(set_height)]
    check(sundials.CVodeInit(memory, callbacks[0], 0.0, states))
    check(sundials.CVodeSVtolerances(memory, tolerance, absolute))
    matrix = sundials.SUNDenseMatrix(size, size, context)
    check(sundials.CVodeSetLinearSolver(memory, sundials.SUNLinSol_Dense(states, matrix, context), matrix))
    check(sundials_cvode.CVodeSetJacFn(ctypes.c_void_p(memory), callbacks[1]))
    check(sundials.CVodeSetMaxNumSteps(memory, 1_000_000))
    if bounces:
        check(sundials.CVodeRootInit(memory, 1, callbacks[2]))
    time = ctypes.c_double(0.0)
    steps = rejected = 0
    while True:
        flag = sundials.CVode(memory, end, states, ctypes.byref(time), sundials.CV_NORMAL)
        # Counted from each beginning.
        if flag != sundials.CV_ROOT_RETURN or array(states)[1] < 0:
            steps += count(memory, "CVodeGetNumSteps")
            rejected += count(memory, "CVodeGetNumErrTestFails")
        if flag != sundials.CV_ROOT_RETURN:
            break
        if array(states)[1] < 0:
            array(states)[:] = Ball.bounced(array(states))
            check(sundials.CVodeReInit(memory, time, states))
    check(flag)
    result = array(states).copy()
    sundials.CVodeFree(ctypes.byref(ctypes.c_void_p(memory)))
    return result, rates.calls, jacobian.calls, f"{steps}+{rejected}"


def count(memory, name):
    number = ctypes.c_long()
    check(getattr(sundials_cvode, name)(ctypes.c_void_p(memory), ctypes.byref(number)))
    return number.value


def check(flag):
    if flag:
        raise RuntimeError(f"SUNDIALS reports {flag}")


SOLVERS = {
    "CVode (BDF)": by_cvode,
    "Radau": by_scipy,
    "BDF": by_scipy,
    "LSODA": by_scipy,
    "DOP853": by_scipy,
}


def cell(states, reference, nominal, work):
    """The largest error, relative to a state and its nominal value together, and the work."""
    reference = np.array(reference)
    error = max(abs(states - reference) / (abs(reference) + nominal))
    rates, jacobians, *steps = work
    return ", ".join([f"{error:.0e}: {rates} f, {jacobians} J", *steps])


def main(path):
    own = defaultdict(list)
    with open(path, newline="") as file:
        for name, *numbers in csv.reader(file):
            own[name].append(numbers)
    references = {}
    with open(EQUATIONS / "solutions.csv", newline="") as file:
        for name, time, *states in csv.reader(file):
            references[name, float(time)] = [float(state) for state in states]
    for name, title in TITLES.items():
        bounces = name == "bouncing_ball"
        system = Ball.SYSTEM if bounces else SYSTEMS[name]
        end = 4e5 if name == "robertson" else system.times[-1]
        reference = Ball.solution(end) if bounces else references[name, end]
        print(f"\n| {title} |", *(f"{row[0].replace('0.0001', '1e-4')} |" for row in own[name]))
        print("|---" * (1 + len(own[name])) + "|")
        cells = []
        for _, rates, jacobians, *states in own[name]:
            states = np.array([float(state) for state in states])
            cells.append(cell(states, reference, system.nominal, (rates, jacobians)))
        print("| built in |", " | ".join(cells), "|")
        for method, solve in SOLVERS.items():
            if method == "DOP853" and name in STIFF:
                continue
            cells = []
            for tolerance, *_ in own[name]:
                states, *work = solve(method, system, end, float(tolerance), bounces)
                cells.append(cell(states, reference, system.nominal, work))
            print(f"| {method} |", " | ".join(cells), "|")


if __name__ == "__main__":
    main(sys.argv[1])
