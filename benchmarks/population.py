"""A population of EFC valves: tested, classified by physics and by the thesis's error, in seconds.

    python benchmarks/population.py [VALVES]

Every valve goes through sweeps at two speeds, six steps and nine sines, with noise; each is judged by what the others
taught. Shares with their 95 % intervals after Wilson.
"""

from __future__ import annotations

import os
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `hil` itself does

import numpy as np
from scipy.stats import binomtest
from table import Row, show

from hil.identification.papers.classification import by_thresholds, leave_one_out, ordered_thresholds
from hil.identification.papers.efc_condition import reference_steps, simulated_tests
from hil.physics.published.tugsal import CLASSES, CLASSIFIED_CURRENT_A
from hil.record.recording import Array, Integers, Mask


def share(right: Mask) -> str:
    """Of right verdicts, with its 95 % interval after Wilson."""
    found = binomtest(int(right.sum()), len(right))
    low, high = (100.0 * end for end in found.proportion_ci(method="wilson"))
    return f"{found.k} of {found.n}, {100.0 * found.statistic:.1f} % ({low:.1f} … {high:.1f} %)"


def by_others(values: Array, labels: Integers) -> Integers:
    """Class of each value by the thresholds that all others ask for."""
    keep = ~np.eye(len(values), dtype=bool)
    pairs = zip(keep, values, strict=True)
    return np.array([by_thresholds(v, ordered_thresholds(values[k], labels[k], len(CLASSES))) for k, v in pairs])


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    reference_steps()  # compiles the plant
    start = time.perf_counter()
    tests, labels = simulated_tests(count, 1)
    tested_s = time.perf_counter() - start
    start = time.perf_counter()
    shares = leave_one_out(np.array([test.features for test in tests]), labels, CLASSES)
    judged_s = time.perf_counter() - start
    show(
        f"{count} EFC valves, {os.cpu_count()} threads",
        [
            Row("tests simulated and evaluated", 1e3 * tested_s, f"{1e3 * tested_s / count:.1f} ms per valve"),
            Row("judged, each left out", 1e3 * judged_s, ""),
        ],
    )
    right = shares.argmax(axis=1) == labels
    print(f"  friction, rise, leakage and bandwidth: {share(right)}")
    print(f"  of those, at least 95 % sure: {share(right[shares.max(axis=1) >= 0.95])}")
    for level in CLASSIFIED_CURRENT_A:
        errors = np.array([test.error_psi[level] for test in tests])
        print(f"  eq. 4.1 at the {level} current: {share(by_others(errors, labels) == labels)}")


if __name__ == "__main__":
    main()
