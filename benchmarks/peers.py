# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Benchmark of the paper's closed loop next to what a user would write or pick instead.

The closed loop is that of `config/paper.yaml`: `rasmc` with `tanh`, adaptation, disturbance,
1 kHz, two Runge-Kutta steps per period. `closed_loop_tick` computes it for numbers and for arrays:
with `math` it is a plain Python script, with NumPy a script for many runs at once, with JAX a
compiled one. SciPy integrates the same plant with an adaptive step. MuJoCo computes a plant only.
Every closed loop has to end in the state of the package.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
import math
import time
from typing import Any, TypeVar

from benchmarks.measure import compared, Measure
from masmc_ros.files import shared_file
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulation import Simulation
from masmc_ros.report.measure.reduced import reduced_metrics
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray

SECONDS, PACKAGE_SECONDS = 1.0, 20.0
"""Length of the runs of others and of the package in s."""

TOLERANCE = 1.0e-6
"""Largest relative deviation of a final state from that of the package."""

LANES, RUNS = 16, 1000
"""Number of runs side by side in the package, and in scripts with arrays."""

PERIOD, STEPS = 1.0e-3, 2
"""Control period in s, and integration steps per period."""

RADIUS, TRACK, BASE, LINK_1, LINK_2 = 0.0508, 0.182, 0.116, 0.514, 0.362
"""Lengths of the robot in m: wheel radius, half track, base of the arm, links."""

THETA = (
    21.353000310000624, 0.36151294256, 0.42108, 1.1951, 0.26001, 0.59325996, 0.08598243,
)  # fmt: skip
"""Base inertial parameters of the robot; the controller assumes half of them."""

PUSH = 1.5
"""Amplitude of the disturbance of the wheels, half of that of the arm joints, in N·m."""

START = (0.0, 0.0, 0.5 * math.pi, 0.0, 0.0, 0.25 * math.pi, -0.5 * math.pi)
"""Initial positions: x, y, yaw, wheels, arm joints."""

Values = Any
"""Sequence of components: numbers, or arrays with an entry for each run."""

Result = TypeVar('Result')

State = tuple[Values, Values, Values]
"""Positions (7), velocities (4) and estimated parameters (7)."""


def plant_rates(m: Any, q: Values, v: Values, torque: Values, theta: Values) -> list[Any]:
    """Return the derivatives of positions and velocities (11); `m` has sin and cos."""
    c0, s0, c1, s1, c2, s2 = (f(q[i]) for i in (2, 5, 6) for f in (m.cos, m.sin))
    c12, s12 = c1 * c2 - s1 * s2, s1 * c2 + c1 * s2
    u, w = 0.5 * RADIUS * (v[0] + v[1]), 0.5 * RADIUS / TRACK * (v[0] - v[1])
    a, b = w + v[2], w + v[2] + v[3]
    mass, yaw, offset, p1, p2, i1, i2 = theta
    w1, w2, pull, slide = p1 * a * a, p2 * b * b, BASE * w * w, w * u
    fu = (torque[0] + torque[1]) / RADIUS + offset * w * w + w1 * c1 + w2 * c12
    fw = TRACK * (torque[0] - torque[1]) / RADIUS - torque[2] - offset * slide
    fw = fw + BASE * (w1 * s1 + w2 * s12)
    fa = torque[2] - torque[3] - (p1 * (s1 * pull + c1 * slide) - LINK_1 * s2 * w2)
    fb = torque[3] - p2 * (s12 * pull + c12 * slide + LINK_1 * s2 * a * a)
    ua, ub, wa, wb = -p1 * s1, -p2 * s12, BASE * p1 * c1, BASE * p2 * c12
    aa, bb = i1 - ua * ua / mass - wa * wa / yaw, i2 - ub * ub / mass - wb * wb / yaw
    ab = LINK_1 * p2 * c2 - ua * ub / mass - wa * wb / yaw
    ra, rb = fa - ua * fu / mass - wa * fw / yaw, fb - ub * fu / mass - wb * fw / yaw
    scale = 1.0 / (aa * bb - ab * ab)
    da, db = (bb * ra - ab * rb) * scale, (aa * rb - ab * ra) * scale
    du, dw = (fu - ua * da - ub * db) / mass, (fw - wa * da - wb * db) / yaw
    wheels = (du + TRACK * dw) / RADIUS, (du - TRACK * dw) / RADIUS
    return [u * c0, u * s0, w, *v, *wheels, da - dw, db - da]


def disturbed(m: Any, torque: Values, t: Any) -> list[Any]:
    """Return the torques with the disturbance at a time."""
    slow, fast = 1.5 * t, 3.0 * t
    return [
        torque[0] + PUSH * m.sin(fast), torque[1] + PUSH * m.cos(fast),
        torque[2] + 2.0 * PUSH * m.sin(slow), torque[3] + 2.0 * PUSH * m.cos(slow),
    ]  # fmt: skip


def quasi_velocities(c: Values, e: Values) -> tuple[Any, ...]:
    """Return J⁻¹ of a task velocity; `c` are cosines and sines of yaw, link 1 and link 2."""
    c0, s0, c1, s1, c12, s12 = c
    f, g = c0 * e[2] + s0 * e[3], c0 * e[3] - s0 * e[2]
    dx, dy = c0 * e[0] + s0 * e[1] - f, c0 * e[1] - s0 * e[0] - g
    s2 = s12 * c1 - c12 * s1
    return (
        f, g / BASE, (c12 * dx + s12 * dy) / (s2 * LINK_1), -(c1 * dx + s1 * dy) / (s2 * LINK_2)
    )  # fmt: skip


def reference(m: Any, t: Any) -> list[Any]:
    """Return the reference of the task: positions, velocities and accelerations (12)."""
    g = 0.2 * math.pi
    wave, slope = 0.25 * m.sin(g * t), 0.25 * g * m.cos(g * t)
    return [
        0.2 * t + 0.3, 0.5 + wave, 0.2 * t, 0.0, 0.2, slope, 0.2, 0.0, 0.0, -g * g * wave, 0.0, 0.0
    ]  # fmt: skip


def control(m: Any, state: State, t: Any) -> tuple[list[Any], list[Any]]:
    """Return the torques of `rasmc` with `tanh`, and the estimate of the next tick."""
    q, v, th = state
    ref = reference(m, t)
    c0, s0, c1, s1, c2, s2 = (f(q[i]) for i in (2, 5, 6) for f in (m.cos, m.sin))
    c12, s12 = c1 * c2 - s1 * s2, s1 * c2 + c1 * s2
    c = (c0, s0, c1, s1, c12, s12)
    u, w = 0.5 * RADIUS * (v[0] + v[1]), 0.5 * RADIUS / TRACK * (v[0] - v[1])
    a, b = w + v[2], w + v[2] + v[3]
    gx, gy = BASE + LINK_1 * c1 + LINK_2 * c12, LINK_1 * s1 + LINK_2 * s12
    x = (q[0] + c0 * gx - s0 * gy, q[1] + s0 * gx + c0 * gy, q[0] + c0 * BASE, q[1] + s0 * BASE)
    hx = u - LINK_1 * s1 * a - LINK_2 * s12 * b
    hy = BASE * w + LINK_1 * c1 * a + LINK_2 * c12 * b
    x_dot = (
        c0 * hx - s0 * hy, s0 * hx + c0 * hy, c0 * u - s0 * BASE * w, s0 * u + c0 * BASE * w
    )  # fmt: skip
    e = [x[i] - ref[i] for i in range(4)]
    e_dot = [x_dot[i] - ref[4 + i] for i in range(4)]
    s = [e_dot[i] + 2.0 * e[i] for i in range(4)]
    force = [-100.0 * s[i] - 100.0 * m.tanh(s[i] / 0.2) for i in range(4)]
    vr = quasi_velocities(c, [ref[4 + i] - 2.0 * e[i] for i in range(4)])
    fx, fy = -w * BASE * vr[1], w * vr[0]
    k1, k2 = LINK_1 * a * vr[2], LINK_2 * b * vr[3]
    ex, ey = fx - k1 * c1 - k2 * c12, fy - k1 * s1 - k2 * s12
    turned = (c0 * ex - s0 * ey, s0 * ex + c0 * ey, c0 * fx - s0 * fy, s0 * fx + c0 * fy)
    ar = quasi_velocities(c, [ref[8 + i] - 2.0 * e_dot[i] - turned[i] for i in range(4)])
    px, py = ar[0] - BASE * w * vr[1], BASE * ar[1] + w * vr[0]
    x1, y1 = -s1 * ar[2] - c1 * a * vr[2], c1 * ar[2] - s1 * a * vr[2]
    x2, y2 = -s12 * ar[3] - c12 * b * vr[3], c12 * ar[3] - s12 * b * vr[3]
    a3, a4 = c1 * py - s1 * px, LINK_1 * (c2 * ar[3] - s2 * b * vr[3])
    b4 = c12 * py - s12 * px + LINK_1 * (c2 * ar[2] + s2 * a * vr[2])
    tx, ty = c0 * force[0] + s0 * force[1], c0 * force[1] - s0 * force[0]
    zx, zy = c0 * force[2] + s0 * force[3], c0 * force[3] - s0 * force[2]
    fu = ar[0] * th[0] - w * vr[1] * th[2] + x1 * th[3] + x2 * th[4] + tx + zx
    fw = ar[1] * th[1] + w * vr[0] * th[2] + BASE * (y1 * th[3] + y2 * th[4] + ty + zy)
    fa = a3 * th[3] + a4 * th[4] + ar[2] * th[5] + LINK_1 * (c1 * ty - s1 * tx)
    fb = b4 * th[4] + ar[3] * th[6] + LINK_2 * (c12 * ty - s12 * tx)
    drive, turn = 0.5 * RADIUS * fu, 0.5 * RADIUS / TRACK * (fw + fa + fb)
    ws = quasi_velocities(c, s)
    gradient = (
        ar[0] * ws[0],
        ar[1] * ws[1],
        -w * vr[1] * ws[0] + w * vr[0] * ws[1],
        x1 * ws[0] + BASE * y1 * ws[1] + a3 * ws[2],
        x2 * ws[0] + BASE * y2 * ws[1] + a4 * ws[2] + b4 * ws[3],
        ar[2] * ws[2],
        ar[3] * ws[3],
    )
    estimate = [th[j] - PERIOD * gradient[j] for j in range(7)]
    return [drive + turn, drive - turn, fa + fb, fb], estimate


def closed_loop_tick(m: Any, state: State, theta: Values, t: Any) -> State:
    """Return the state after the tick at a time; `theta` are the parameters of the robot."""
    torque, estimate = control(m, state, t)
    y, h = [*state[0], *state[1]], PERIOD / STEPS
    for step in range(STEPS):
        start = t + step * h
        forces = [disturbed(m, torque, start + part * h) for part in (0.0, 0.5, 1.0)]

        def rates(y: Values, part: int, forces: Sequence[Values] = forces) -> list[Any]:
            return plant_rates(m, y[:7], y[7:], forces[part], theta)

        k1 = rates(y, 0)
        k2 = rates([a + 0.5 * h * b for a, b in zip(y, k1, strict=True)], 1)
        k3 = rates([a + 0.5 * h * b for a, b in zip(y, k2, strict=True)], 1)
        k4 = rates([a + h * b for a, b in zip(y, k3, strict=True)], 2)
        y = [y[j] + h / 6.0 * (k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j]) for j in range(11)]
    return y[:7], y[7:], estimate


def in_python() -> State:
    """Compute a run as a plain Python script, on numbers."""
    state: State = (list(START), [0.0] * 4, [0.5 * value for value in THETA])
    for k in range(round(SECONDS / PERIOD)):
        state = closed_loop_tick(math, state, THETA, k * PERIOD)
    return state


def robots(runs: int) -> NDArray[np.float64]:
    """Return the parameters (7, runs) of robots; the first one is that of the scenario."""
    return np.array(THETA)[:, None] * np.linspace(1.0, 1.2, runs)


def starts(runs: int) -> list[NDArray[np.float64]]:
    """Return the initial positions, velocities and estimates (components, runs)."""
    state = (START, (0.0,) * 4, [0.5 * value for value in THETA])
    return [np.repeat(np.array(values)[:, None], runs, axis=1) for values in state]


def in_numpy() -> State:
    """Compute many runs at once as a NumPy script, on arrays (runs)."""
    q, v, estimate = starts(RUNS)
    state, theta = (list(q), list(v), list(estimate)), list(robots(RUNS))
    for k in range(round(SECONDS / PERIOD)):
        state = closed_loop_tick(np, state, theta, k * PERIOD)
    positions, rates, estimates = ([values[0] for values in part] for part in state)
    return positions, rates, estimates


def in_jax() -> Callable[[], State]:
    """Return the computation of many runs at once by JAX on the processor, compiled."""
    import jax

    jax.config.update('jax_enable_x64', True)
    jax.config.update('jax_platforms', 'cpu')

    def run(q: Any, v: Any, estimate: Any, theta: Any) -> Any:
        def tick(state: Any, k: Any) -> Any:
            following = closed_loop_tick(jax.numpy, state, theta, k * PERIOD)
            return tuple(map(jax.numpy.stack, following)), None

        ticks = jax.numpy.arange(round(SECONDS / PERIOD))
        return jax.lax.scan(tick, (q, v, estimate), ticks)[0]

    arguments = [values.T for values in (*starts(RUNS), robots(RUNS))]
    compiled = jax.jit(jax.vmap(run)).lower(*arguments).compile()
    return lambda: tuple(np.asarray(part)[0] for part in compiled(*arguments))


def in_scipy() -> State:
    """Compute a run with the plant integrated by `scipy.integrate.solve_ivp`."""
    from scipy.integrate import solve_ivp

    q, v, estimate = list(START), [0.0] * 4, [0.5 * value for value in THETA]
    for k in range(round(SECONDS / PERIOD)):
        torque, estimate = control(math, (q, v, estimate), k * PERIOD)

        def rates(t: float, y: NDArray[np.float64], torque: Values = torque) -> list[Any]:
            y = y.tolist()
            return plant_rates(math, y[:7], y[7:], disturbed(math, torque, t), THETA)

        solved = solve_ivp(
            rates, (k * PERIOD, (k + 1) * PERIOD), [*q, *v], rtol=1.0e-9, atol=1.0e-12
        )
        y = solved.y[:, -1].tolist()
        q, v = y[:7], y[7:]
    return q, v, estimate


def mujoco_rollout() -> float:
    """
    Return the processor time in s of a plant in MuJoCo, per run.

    Its wheels roll by contact forces, as MuJoCo has no rolling constraint, and it has no
    controller: the disturbance is its only torque.
    """
    from masmc_ros.physics.mujoco_model import contact_model
    from masmc_ros.robot.robot import robot_of
    import mujoco
    from mujoco.rollout import rollout

    step = PERIOD / STEPS
    parts = contact_model(robot_of(scenario(SECONDS)['plant']), step, friction=1.0)
    times = np.arange(0.0, SECONDS, step)
    torques = np.zeros((LANES, len(times), parts.model.nv))
    torques[:, :, parts.rates] = np.stack(disturbed(np, [0.0] * 4, times), axis=-1)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(parts.model, kind))
    data = mujoco.MjData(parts.model)
    mujoco.mj_getState(parts.model, data, start, kind)
    starts = np.repeat(start[None], LANES, axis=0)
    spec = mujoco.mjtState.mjSTATE_QFRC_APPLIED

    def run() -> None:
        rollout(parts.model, data, starts, torques, control_spec=spec)

    return timed(run)[0] / LANES


def scenario(seconds: float) -> Scenario:
    """Return the scenario of the package."""
    return load_scenario(str(shared_file('config', 'paper.yaml')), (f'duration={seconds}',))


def in_package() -> State:
    """Compute a run by the package; the last tick commands and does not move."""
    *_, block = Simulation(scenario(SECONDS)).run()
    last = block.signals[-1]
    return last['true_position'][:, 0], last['true_velocity'][-4:, 0], last['estimate'][:, 0]


def deviation(state: State, expected: State) -> float:
    """Return the largest deviation of a state, relative to components larger than 1."""
    own, other = (np.hstack([np.asarray(part) for part in s]) for s in (state, expected))
    return float(np.max(np.abs(own - other) / np.maximum(np.abs(other), 1.0)))


def timed(run: Callable[[], Result], repeats: int = 3) -> tuple[float, Result]:
    """Return the best processor time in s, and the result."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        result = run()
        times.append(time.process_time() - start)
    return min(times), result


def measures() -> Iterator[Measure]:
    """Yield the processor times per simulated second of a run, in ms."""
    expected = in_package()
    in_lanes = [scenario(PACKAGE_SECONDS)] * LANES
    reduced_metrics(in_lanes)
    seconds = timed(lambda: reduced_metrics(in_lanes))[0] / LANES / PACKAGE_SECONDS
    reference = Measure(f'masmc_ros, each of {LANES} side by side', 1e3 * seconds, 'ms')
    yield reference
    alone = Simulation(scenario(PACKAGE_SECONDS))
    seconds = timed(lambda: sum(1 for _ in alone.run()))[0] / PACKAGE_SECONDS
    yield compared('masmc_ros, one run with its signals', 1e3 * seconds, 'ms', reference)
    peers = {
        'plain Python, one run': (in_python, 1),
        f'NumPy, each of {RUNS} at once': (in_numpy, RUNS),
        'SciPy solve_ivp, one run': (in_scipy, 1),
    }
    if find_spec('jax') is not None:
        peers[f'JAX vmap, each of {RUNS} at once, compiled'] = (in_jax(), RUNS)
    for name, (run, runs) in peers.items():
        seconds, state = timed(run)
        error = deviation(state, expected)
        if not error < TOLERANCE:
            raise ValueError(f'{name}: deviates by {error:g}; expected less than {TOLERANCE:g}')
        yield compared(name, 1e3 * seconds / runs / SECONDS, 'ms', reference)
    if find_spec('mujoco') is not None:
        seconds = mujoco_rollout() / SECONDS
        yield compared('MuJoCo rollout, plant alone', 1e3 * seconds, 'ms', reference)
