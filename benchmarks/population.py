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

from table import Row, show

from hil.identification.papers.efc_condition import compared, reference_steps, simulated_tests


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    reference_steps()  # compiles the plant
    start = time.perf_counter()
    tests, labels = simulated_tests(count, 1)
    tested_s = time.perf_counter() - start
    start = time.perf_counter()
    found = compared(tests, labels)
    judged_s = time.perf_counter() - start
    show(
        f"{count} EFC valves, {os.cpu_count()} threads",
        [
            Row("tests simulated and evaluated", 1e3 * tested_s, f"{1e3 * tested_s / count:.1f} ms per valve"),
            Row("judged, each left out", 1e3 * judged_s, ""),
        ],
    )
    print(f"  friction, rise, leakage and bandwidth: {found.physics}")
    print(f"  of those, at least 95 % sure: {found.confident}")
    for level, share in found.by_error.items():
        print(f"  eq. 4.1 at the {level} current: {share}")


if __name__ == "__main__":
    main()
