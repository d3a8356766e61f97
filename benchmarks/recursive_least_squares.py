"""Recursive least squares per update against padasip and plain numpy: time as a ratio, error of the estimate.

    python benchmarks/recursive_least_squares.py [SAMPLES]

The example of section 3.2.2.2 of the EFC thesis (four poles, three inputs) under noise, with 1 % noise of its own.
Needs the extra `bench`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `hil` itself does; peers gain by it too

import numpy as np
from numpy.typing import NDArray
from table import Row, milliseconds, show

from hil.identification.papers.recursive_least_squares import ArxForm, RecursiveLeastSquares
from hil.physics.published.tugsal import EXAMPLE

Array = NDArray[np.float64]

TRUE = np.array([*EXAMPLE.denominator[1:], *EXAMPLE.numerator])
MEMORY = 0.999


def main() -> None:
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    show(f"recursive least squares, 7 parameters, ms per 1000 of {samples} updates", rows(samples))


def rows(samples: int) -> Iterator[Row]:
    """Time per 1000 updates, and the largest error of a parameter at the end."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(0)
    u = rng.normal(size=samples)
    y = EXAMPLE.response(u) + lfilter([1.0], EXAMPLE.denominator, 0.01 * rng.normal(size=samples))
    psi = regressors(u, y)
    peers: list[tuple[str, Callable[[], Array], str]] = [
        ("hil run, a block at a time", lambda: in_block(u, y), "with covariance, noise and excitation"),
        ("hil run, sample by sample", lambda: one_by_one(u, y), "the same"),
        ("numpy, eqs 3.13 to 3.15", lambda: by_numpy(psi, y), "no uncertainty"),
        ("padasip FilterRLS", lambda: by_padasip(psi, y), "no uncertainty"),
    ]
    for name, estimate, note in peers:
        error = np.abs(estimate() - TRUE).max()
        ms = milliseconds(estimate, 5) * 1000.0 / samples
        yield Row(name, ms, f"largest error {error:.1e}; {note}")


def regressors(u: Array, y: Array) -> Array:
    def late(values: Array, k: int) -> Array:
        return np.concatenate((np.zeros(k), values[: len(values) - k]))

    return np.column_stack([-late(y, k) for k in range(1, 5)] + [late(u, k) for k in range(3)])


def in_block(u: Array, y: Array) -> Array:
    made = RecursiveLeastSquares(ArxForm(4, 3), MEMORY, "exponential")
    made.run(u, y)
    return made.parameters


def one_by_one(u: Array, y: Array) -> Array:
    made = RecursiveLeastSquares(ArxForm(4, 3), MEMORY, "exponential")
    for k in range(len(u)):
        made.run(u[k : k + 1], y[k : k + 1])
    return made.parameters


def by_numpy(psi: Array, y: Array) -> Array:
    theta, p = np.zeros(7), 1e6 * np.eye(7)
    for row, now in zip(psi, y, strict=True):
        pp = p @ row
        gain = pp / (MEMORY + row @ pp)
        theta = theta + gain * (now - row @ theta)
        p = (p - np.outer(gain, pp)) / MEMORY
    return theta


def by_padasip(psi: Array, y: Array) -> Array:
    import padasip

    made = padasip.filters.FilterRLS(n=7, mu=MEMORY, eps=1e-6, w="zeros")
    made.run(y, psi)
    return np.asarray(made.w)


if __name__ == "__main__":
    main()
