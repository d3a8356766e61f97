"""Valves of an engineer's own for the pages about the papers: simulators of another structure than the library's.

Explicit Runge-Kutta steps over differential equations, and true figures from the simulator itself: Fourier sums over
its noiseless output, poles from its Jacobian, curves at rest. Nothing of the library is asked for a truth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from scipy.optimize import curve_fit

from hil.record.read import write_recording
from hil.record.recording import recording

RATE_HZ = 250.0
_SUBSTEPS = 20


@njit
def hpv41(x: Any, u: float) -> Any:
    """A pilot that has to fill the spool's stroke, a bristle at the spool, slots behind a fixed orifice, a meter.

    States: magnet's pressure in N/mm², stroke in mm, bristle, meter in l/min. Command in %.
    """
    magnet, stroke, bristle, meter = x
    drop = magnet - 0.285 * stroke - 0.010 * bristle
    speed = 70.0 * drop / math.sqrt(1.0 + abs(drop) / 0.6)
    opened = max(abs(stroke) - 1.4, 0.0)
    flow = math.copysign(17.1 * opened / math.sqrt(1.0 + (opened / 6.0) ** 2), stroke)
    return np.array([(0.02 * u - magnet) / 0.025, speed, (speed - abs(speed) * bristle) / 0.03, (flow - meter) / 0.03])


@njit
def efc(x: Any, u: float) -> Any:
    """A rotor against its spring, whose torque depends on the angle, a port, and a rail that fills and drains.

    States: angle in rad, speed in rad/s, rail in psi, and the rotor's drag, which stays. Command in A.
    """
    angle, speed, rail, drag = x
    torque = 0.30 * u * math.cos(angle - 0.3) - 0.9 * angle - 0.30 - drag * speed
    port = 120.0 * (0.005 + 1.0 / (1.0 + math.exp(-(angle - 0.16) / 0.05)))
    net = port * math.sqrt(max(220.0 - rail, 0.0)) - 40.0 * math.sqrt(max(rail, 0.0))
    return np.array([speed, torque / 5e-4, 11.8 * net, 0.0])


@njit
def cylinder(x: Any, u: float) -> Any:
    """Four edges, two chambers of compressed oil, a mass. Command in A.

    States: spool as a share, pressures in bar, speed in mm/s, position in mm.
    """
    spool, a, b, speed, _ = x
    into = 20.0 * spool * math.sqrt(max(100.0 - a if spool > 0.0 else a, 0.0))
    out = 20.0 * spool * math.sqrt(max(b if spool > 0.0 else 100.0 - b, 0.0))
    pushes = 2.0 * (1963.5 * a - 1256.6 * b) - 30.0 * speed
    oil = 14000.0 / 1.2e5
    rises = oil * (1000.0 * into - 1963.5 * speed), oil * (1256.6 * speed - 1000.0 * out)
    return np.array([(u - spool) / 0.02, rises[0], rises[1], pushes, speed])


@njit
def _run(rates: Any, x: Any, command: Any, step_s: float, count: int, gain: float, row: int) -> Any:
    """States at each sample, shape (n, states); `gain` closes a loop over the state in `row`."""
    made = np.empty((len(command), len(x)))
    for k in range(len(command)):
        made[k] = x
        for _ in range(count):
            u = command[k]
            a = rates(x, u - gain * x[row])
            b = rates(x + 0.5 * step_s * a, u - gain * (x + 0.5 * step_s * a)[row])
            c = rates(x + 0.5 * step_s * b, u - gain * (x + 0.5 * step_s * b)[row])
            d = rates(x + step_s * c, u - gain * (x + step_s * c)[row])
            x = x + step_s / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return made


def states(
    rates: Any, command: np.ndarray, start: Any, *, gain: float = 0.0, row: int = 0, rate_hz: float = RATE_HZ
) -> np.ndarray:
    """States at each sample of a held command, after four seconds under the first of them, shape (n, states)."""
    count = round(_SUBSTEPS * RATE_HZ / rate_hz)
    held = np.full(round(4.0 * rate_hz), command[0])
    both = np.concatenate((held, command))
    return _run(rates, np.array(start, dtype=float), both, 1.0 / rate_hz / count, count, gain, row)[len(held) :]


HPV41_REST, EFC_REST, CYLINDER_REST = (0.0,) * 4, (0.1, 0.0, 100.0, 0.081), (0.0, 39.0, 61.0, 0.0, 0.0)


def stepped_sines(bias: float, amplitude: float, periods: Sequence[int], least: int) -> np.ndarray:
    """Sines about a bias, each of so many samples a period, for at least so many samples and four periods."""
    each = [np.full(least, bias)]
    for n in periods:
        k = np.arange(n * max(4, -(-least // n)))
        each += [bias + amplitude * np.sin(2.0 * np.pi * k / n), np.full(least, bias)]
    return np.concatenate(each)


def harmonic(rates: Any, start: Any, bias: float, amplitude: float, n: int, row: int, rate_hz: float) -> complex:
    """Response over command of the first harmonic, of the last of many periods of n samples, without noise."""
    k = np.arange(n * max(6, -(-round(4.0 * rate_hz) // n)))
    command = bias + amplitude * np.sin(2.0 * np.pi * k / n)
    turned = np.exp(-2j * np.pi * k[-n:] / n)
    answer = states(rates, command, start, rate_hz=rate_hz)[-n:, row]
    return complex(turned @ answer / (turned @ command[-n:]))


def poles(
    rates: Any, start: Any, command: float, size: int = 0, gain: float = 0.0, row: int = 0, rate_hz: float = 1000.0
) -> np.ndarray:
    """Poles of the first states where a valve has come to under a command, rad/s, from differences of its rates.

    `gain` closes a loop over the state in `row`.
    """
    there = states(rates, np.full(2, command), start, rate_hz=rate_hz)[-1]
    size = size or len(there)
    columns = []
    for k in range(size):
        step = 1e-5 * max(abs(there[k]), 1e-2) * np.eye(len(there))[k]
        up, down = (rates(there + s, command - gain * s[row])[:size] for s in (step, -step))
        columns.append((up - down) / (2.0 * step[k]))
    return np.sort_complex(np.linalg.eigvals(np.array(columns).T))


def triangle(top: float, bottom: float, seconds: float) -> np.ndarray:
    """From 0 to the top, the bottom and 0, twice."""
    corners = np.array([0.0, top, bottom, 0.0])
    at = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(corners)))))
    return np.tile(np.interp(np.linspace(0.0, at[-1], round(seconds * RATE_HZ), endpoint=False), at, corners), 2)


def noisy(values: np.ndarray, std: float, step: float, seed: int) -> np.ndarray:
    """As a converter reads them."""
    return step * np.round((values + std * np.random.default_rng(seed).standard_normal(len(values))) / step)


def at_rest(rates: Any, start: Any, row: int, commands: Any) -> np.ndarray:
    """A state under commands that stand, shape (n,)."""
    return np.array([states(rates, np.full(1, float(one)), start)[0, row] for one in commands])


def edge_of_power_law(command: np.ndarray, flow: np.ndarray) -> float:
    """Where a power law through a curve up to 40 % of its end begins."""
    foot = (flow > 0.0) & (flow < 0.4 * flow[-1])
    start = command[foot][0]

    def law(at: np.ndarray, gain: float, edge: float, power: float) -> np.ndarray:
        return gain * np.maximum(at - edge, 1e-9) ** power

    return float(curve_fit(law, command[foot], flow[foot], [1.0, 0.95 * start, 1.0])[0][1])


HPV41_STICKS = 0.010 / 0.02
"""Of the command in %: by which a branch lies to either side of the middle; of a sweep over ±100 %, the hysteresis."""
HPV41_LAG_MS = 1e3 * (0.025 + 1.0 / (70.0 * 0.285) + 0.03)
SINES = (2000, 1000, 500, 320, 250, 200, 160, 125, 100, 80, 64, 50)
LEVELS_A, SPOOL_LAG_S = (0.2, 0.4), 0.02
_LVDT = 0.04  # V/mm
_LOOP = 0.5  # A/V


def closed_position(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Request and reading of the LVDT in V of a proportional loop on a sine of 1 rad/s, after it has come to rest."""
    request = 5.0 + 2.0 * np.sin(time_s)
    whole = np.concatenate((np.full(round(10.0 * RATE_HZ), 5.0), request))
    moved = states(cylinder, _LOOP * whole, CYLINDER_REST, gain=_LOOP * _LVDT, row=4)[-len(request) :, 4]
    return request, _LVDT * moved


def closed_harmonic() -> complex:
    """Reading over request at 1 rad/s, from the last whole period of six."""
    time_s = np.arange(round(12.0 * math.pi * RATE_HZ)) / RATE_HZ
    request, read = (one[-round(2.0 * math.pi * RATE_HZ) :] for one in closed_position(time_s))
    turned = np.exp(-1j * time_s[-len(request) :])
    return complex(turned @ (read - read.mean()) / (turned @ (request - request.mean())))


def write_recordings(folder: Path) -> None:
    """What an engineer would have recorded of the three valves, as CSV."""

    def keep(name: str, command: np.ndarray, unit: str, read: np.ndarray, of: str, rate_hz: float = RATE_HZ) -> None:
        channels = {unit: command, of: read}
        write_recording(recording(name, np.arange(len(command)) / rate_hz, channels), folder / f"{name}.csv")

    flow, pressure = ("command [%]", "flow [l/min]"), ("current [A]", "pressure [psi]")
    command = stepped_sines(50.0, 10.0, SINES, 500)
    read = noisy(states(hpv41, command, HPV41_REST)[:, 3], 0.25, 0.05, 1)
    keep("sines", command, flow[0], read, flow[1])
    for name, seconds, seed in (("sweep", 40.0, 2), ("half-speed", 80.0, 3)):
        command = triangle(100.0, -100.0, seconds)
        read = noisy(states(hpv41, command, HPV41_REST)[:, 3], 0.25, 0.05, seed)
        keep(name, command[::5], flow[0], read[::5], flow[1], RATE_HZ / 5.0)

    command = stepped_sines(1.5, 0.02, [round(1000.0 / hz) for hz in np.geomspace(0.25, 25.0, 20)], 1000)
    read = noisy(states(efc, command, EFC_REST, rate_hz=1000.0)[:, 2], 0.1, 0.02, 4)
    keep("efc-sines", command, pressure[0], read, pressure[1], 1000.0)
    command = 1.2 + 0.8 * triangle(1.0, 0.0, 60.0)
    read = noisy(states(efc, command, EFC_REST)[:, 2], 0.4, 0.1, 5)
    keep("efc-sweep", command[::5], pressure[0], read[::5], pressure[1], RATE_HZ / 5.0)
    drawn = np.random.default_rng(6)
    command = np.repeat([1.4, 1.6], [125, 250])
    for number, name in enumerate([*(f"good/{k}" for k in range(10)), *(f"bad/{k}" for k in range(5)), "new"]):
        drag = (0.081 if number < 10 else 0.125) * math.exp(0.12 * drawn.standard_normal())
        read = noisy(states(efc, command, (*EFC_REST[:3], drag))[:, 2], 0.4, 0.1, 100 + number)
        (folder / name).parent.mkdir(exist_ok=True)
        keep(name, command, pressure[0], read, pressure[1])

    command = np.repeat([0.0, *np.random.default_rng(7).choice(LEVELS_A, 40)], [250, *[50] * 40])
    read = noisy(states(cylinder, command, CYLINDER_REST)[:, 4], 0.05, 0.01, 8)
    keep("open", command, "current [A]", read, "position [mm]")
    request, volts = closed_position(np.arange(round(10.0 * math.pi * RATE_HZ)) / RATE_HZ)
    keep("closed", request, "request [V]", noisy(volts, 0.005, 0.0025, 9), "position [V]")
