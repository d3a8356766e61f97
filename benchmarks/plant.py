"""One simulated second of the HPV41 against other ways to solve the same equations.

    python benchmarks/plant.py

1000 samples with 10 sub-steps each, a sine over both sides, all effects of the library compiled in and switched off
(and once more with friction on). The peers: the same steps in plain C, compiled with `cc -O3` when the benchmark
runs; the differential equations with `scipy.integrate.solve_ivp`, and with `control.input_output_response`. Errors
are against our own solution at 200 sub-steps.
"""

from __future__ import annotations

import ctypes
import math
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray
from table import Row, milliseconds, show

from hil.physics.compose import plant
from hil.physics.simulate import ActiveEffect, Drive, simulate

Array = NDArray[np.float64]
InC = Callable[[Array, dict[str, float] | None], Array]

SAMPLES, INTERVAL_S, SUB_STEPS = 1000, 1e-3, 10
LONG = 20 * SAMPLES
TIME_S = np.arange(LONG) * INTERVAL_S
LONG_COMMAND = 80.0 * np.sin(2.0 * np.pi * 1.3 * TIME_S)
TIME_S, COMMAND = TIME_S[:SAMPLES], LONG_COMMAND[:SAMPLES].copy()
FRICTION = {"coulomb": 2.0, "stiction": 1.2, "stribeck": 10.0, "presliding": 0.2}
VALVE = plant("brevini-hpv41")
BAR_US = 2.0

C_SOURCE = r"""
#include <math.h>
#include <string.h>

typedef struct {
    double dead_steps, keep_pos, xx_pos, xv_pos, x0_pos, x1_pos, vx_pos, vv_pos, v0_pos, v1_pos;
    double keep_neg, xx_neg, xv_neg, x0_neg, x1_neg, vx_neg, vv_neg, v0_neg, v1_neg;
    double dead_band, full_flow, exponent, supply, m_keep, m_old, m_new;
} coefficients;

static double metered(double opening, double dead_band, double full_flow, double exponent) {
    double over = fabs(opening) - dead_band;
    if (over <= 0.0) return 0.0;
    double flow = full_flow * pow(over / (100.0 - dead_band), exponent);
    return opening > 0.0 ? flow : -flow;
}

static double slipping(double free, double drive, double grip, double wear) {
    double along = drive >= 0.0 ? free : -free;
    double linear = 1.0 + grip - wear * along;
    double root = sqrt(linear * linear + 4.0 * wear * fabs(drive));
    double speed = linear > 0.0 ? 2.0 * fabs(drive) / (linear + root) : (root - linear) / (2.0 * wear);
    return copysign(speed, drive);
}

static double level_at(double speed, const double *p) {
    double ratio = speed / p[2];
    return p[0] * (1.0 + (p[1] - 1.0) * exp(-ratio * ratio));
}

static double friction(double free, double mobility, double step, double *z, const double *p) {
    double stiffness = p[0] / p[3];
    double wear = step * stiffness / level_at(z[1], p);
    double grip = mobility * stiffness;
    double speed = slipping(free, free - grip * z[0], grip * step, wear);
    z[0] = (z[0] + step * speed) / (1.0 + wear * fabs(speed));
    z[1] = speed;
    return stiffness * z[0];
}

void run(const double *command, long n, long sub_steps, double step, const coefficients *c,
         double *line, long size, const double *rub, double *out) {
    double pilot = command[0], drive = command[0], spool = command[0], speed = 0.0, old = 0.0, meter = 0.0;
    double z[2] = {0.0, 0.0};
    double pressure = c->supply;
    long at = 0;
    for (long k = 0; k < size; k++) line[k] = command[0];
    double opening = spool;
    old = meter = metered(opening, c->dead_band, c->full_flow, c->exponent);
    long whole = (long)c->dead_steps;
    double part = c->dead_steps - (double)whole;
    for (long i = 0; i < n; i++) {
        out[i] = meter; out[n + i] = spool; out[2 * n + i] = pressure;
        for (long j = 0; j < sub_steps; j++) {
            line[at] = command[i];
            long newer = at - whole;
            if (newer < 0) newer += size;
            long older = newer - 1;
            if (older < 0) older += size;
            at = at + 1 < size ? at + 1 : 0;
            double reference = (1.0 - part) * line[newer] + part * line[older];
            double keep = reference >= 0.0 ? c->keep_pos : c->keep_neg;
            pilot = keep * pilot + (1.0 - keep) * reference;
            double place, free, mobility, compliance;
            if (spool >= 0.0) {
                place = c->xx_pos * spool + c->xv_pos * speed + c->x0_pos * drive + c->x1_pos * pilot;
                free = c->vx_pos * spool + c->vv_pos * speed + c->v0_pos * drive + c->v1_pos * pilot;
                mobility = c->v0_pos + c->v1_pos;
                compliance = c->x0_pos + c->x1_pos;
            } else {
                place = c->xx_neg * spool + c->xv_neg * speed + c->x0_neg * drive + c->x1_neg * pilot;
                free = c->vx_neg * spool + c->vv_neg * speed + c->v0_neg * drive + c->v1_neg * pilot;
                mobility = c->v0_neg + c->v1_neg;
                compliance = c->x0_neg + c->x1_neg;
            }
            drive = pilot;
            double force = rub ? friction(free, mobility, step, z, rub) : 0.0;
            spool = place - compliance * force;
            speed = free - mobility * force;
            double demand = metered(spool, c->dead_band, c->full_flow, c->exponent);
            pressure = c->supply;
            double flow = demand * sqrt(fmax(pressure, 0.0) / c->supply);
            meter = c->m_keep * meter + c->m_old * old + c->m_new * flow;
            old = flow;
        }
    }
}
"""
C_ORDER = (
    "dead_steps", *(f"{name}_{side}" for side in ("pos", "neg")
                    for name in ("keep", "xx", "xv", "x0", "x1", "vx", "vv", "v0", "v1")),
    "dead_band", "full_flow", "exponent", "supply", "m_keep", "m_old", "m_new",
)  # fmt: skip


def ours(command: Array, *effects: ActiveEffect, factor: float = SUB_STEPS) -> Array:
    return simulate(VALVE, VALVE.typical, Drive(command[None, :], math.nan, INTERVAL_S), effects, factor=factor)


def rows() -> Iterator[Row]:
    warnings.simplefilter("ignore")  # peers warn about what they are asked to do
    exact = ours(COMMAND, factor=200.0)[0]

    def error(found: Array) -> str:
        return f"error {np.abs(found - exact).max() / np.ptp(exact):.1e} of the span"

    ms = milliseconds(lambda: ours(COMMAND), 60)
    yield Row("hil, 10 sub-steps", ms, f"{error(ours(COMMAND)[0])}; {ms:.2f} µs a sample, bar {BAR_US:g}")
    fast_ms = milliseconds(lambda: ours(COMMAND, factor=1.0), 60)
    yield Row("hil, 1 sub-step, as it runs", fast_ms, error(ours(COMMAND, factor=1.0)[0]))
    if shutil.which("cc"):
        with tempfile.TemporaryDirectory() as folder:
            yield from c_rows(compiled_c(Path(folder)), ms)
    for name, solve in (
        ("scipy solve_ivp, LSODA, rtol 1e-6", lambda: by_solve_ivp("LSODA")),
        ("scipy solve_ivp, RK45, rtol 1e-6", lambda: by_solve_ivp("RK45")),
        ("control.input_output_response, rtol 1e-6", by_control),
    ):
        yield Row(name, milliseconds(solve, 3), error(solve()))


def c_rows(in_c: InC, ms: float) -> Iterator[Row]:
    """The same steps in C: one second, twenty (what preparing a run costs no longer counts), and with friction."""
    rub = ActiveEffect("friction", "force", FRICTION)
    cases = (
        ("1 s", COMMAND, (), None, ms),
        ("20 s", LONG_COMMAND, (), None, 0.0),
        ("20 s with friction", LONG_COMMAND, (rub,), FRICTION, 0.0),
    )
    for name, command, effects, friction, known_ms in cases:
        repeats = 60 if command is COMMAND else 15
        c_ms = milliseconds(lambda command=command, friction=friction: in_c(command, friction), repeats)
        our_ms = known_ms or milliseconds(lambda command=command, effects=effects: ours(command, *effects), repeats)
        if not known_ms:
            yield Row(f"hil, {name}", our_ms)
        gap = np.abs(in_c(command, friction) - ours(command, *effects)).max()
        yield Row(
            f"plain C (cc -O3), {name}", c_ms, f"hil takes {our_ms / c_ms:.2f} of it, bar 1.5; they differ by {gap:.0e}"
        )


def compiled_c(folder: Path) -> InC:
    """The C source as a function of the command and the friction's parameters (None: no friction)."""
    source, library = folder / "valve.c", folder / "valve.so"
    source.write_text(C_SOURCE, encoding="utf-8")
    subprocess.run(["cc", "-O3", "-march=native", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    run = ctypes.CDLL(str(library)).run
    pointer = np.ctypeslib.ndpointer(np.float64)
    run.argtypes = [pointer, ctypes.c_long, ctypes.c_long, ctypes.c_double, pointer, pointer, ctypes.c_long,
                    ctypes.c_void_p, pointer]  # fmt: skip
    step_s = INTERVAL_S / SUB_STEPS
    found = VALVE.coefficients(VALVE.typical, step_s)
    values = np.array([found[name] for name in C_ORDER])
    line = np.zeros(VALVE.line_words(VALVE.typical, step_s)[0] - 1)

    def in_c(command: Array, rub: dict[str, float] | None) -> Array:
        out = np.empty((3, len(command)))
        given = None if rub is None else np.array(list(rub.values()))
        run(command, len(command), SUB_STEPS, step_s, values, line, len(line),
            None if given is None else given.ctypes.data, out)  # fmt: skip
        return out

    return in_c


def slope(x: Any, command: float) -> tuple[float, float, float, float]:
    """The differential equations: pilot, spool, its speed, flow meter."""
    p = PARAMETERS
    pilot, spool, speed, meter = x
    w = p["spool_frequency"]
    over = abs(spool) - p["dead_band"]
    flow = p["full_flow"] * (over / (100.0 - p["dead_band"])) ** p["curve_exponent"] if over > 0.0 else 0.0
    return (
        p["pilot_rate"] * (command - pilot),
        speed,
        w * w * (pilot - spool) - 2.0 * p["spool_damping"] * w * speed,
        (math.copysign(flow, spool) - meter) / p["sensor_lag"],
    )


PARAMETERS = VALVE.typical
LATE = round(PARAMETERS["dead_time"] / INTERVAL_S)


def by_solve_ivp(method: str) -> Array:
    from scipy.integrate import solve_ivp

    late = np.concatenate((np.full(LATE, COMMAND[0]), COMMAND[:-LATE]))

    def rhs(t: float, x: Any) -> Any:
        return slope(x, late[min(int(t * 1000.0 + 1e-9), SAMPLES - 1)])

    found = solve_ivp(rhs, (0.0, TIME_S[-1]), np.zeros(4), method=method, t_eval=TIME_S, rtol=1e-6, atol=1e-6)
    return found.y[3]


def by_control() -> Array:
    import control

    late = np.concatenate((np.full(LATE, COMMAND[0]), COMMAND[:-LATE]))
    system = control.nlsys(
        lambda _t, x, u, _p: np.array(slope(x, u[0])), lambda _t, x, _u, _p: x[3], inputs=1, outputs=1, states=4
    )
    options = {"rtol": 1e-6, "atol": 1e-6}
    found = control.input_output_response(system, TIME_S, late, 0.0, solve_ivp_method="LSODA", solve_ivp_kwargs=options)
    return np.asarray(found.outputs).ravel()


def main() -> None:
    show("one simulated second of the HPV41, 1000 samples", rows())


if __name__ == "__main__":
    sys.exit(main())
