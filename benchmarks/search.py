"""What a diagnosis costs, as a multiple of one simulation of its recordings.

    python benchmarks/search.py [LABEL...]

Three cases of the concealment proof (those of `mismatch.py`), each with the search alone, then with all that a
diagnosis says. Times are of the processor, all threads together; one simulation takes the plant's own sub-steps.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `hil` itself does

from _concealed import Case, conceal
from mismatch import SEED, SHORT
from table import Row, milliseconds, show

from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.intake.problem import pose, settled
from hil.diagnosis.verdict.explain import explained
from tests.studies.proof.cases.label import parse


def rows(case: Case) -> Iterator[Row]:
    """One simulation, the search and the diagnosis, each after a first one."""
    yield Row("one simulation", milliseconds(lambda: [e.simulated(case.nominal) for e in case.changed]))
    problem, _ = settled(pose(case.nominal, case.changed))
    yield Row("search", milliseconds(lambda: explained(problem), 1), _simulations(problem.work.simulations / 2, case))
    found = []
    took_ms = milliseconds(lambda: found.append(diagnose(case.nominal, case.changed).diagnosis), 1)
    yield Row("diagnosis", took_ms, _simulations(found[-1].work["simulations"], case))


def _simulations(count: float, case: Case) -> str:
    return f"{count / len(case.changed):.0f} simulations of each recording"


def main() -> None:
    for label in sys.argv[1:] or SHORT:
        case = conceal(SEED, parse(label))
        laws = " + ".join(h.law for h in case.truth.hidden) or "nothing"
        show(f"{case.truth.plant.name}, concealed: {laws}", rows(case))


if __name__ == "__main__":
    main()
