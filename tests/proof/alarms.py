"""`python -m tests.proof.alarms`: how often a healthy unit is not called consistent.

Short recordings of a simulated HPV41 with nothing concealed, half of them with coloured noise, each diagnosed with the
model of another draw. The proof itself has healthy units of all plants with other equations; this is the quick count of
many.
"""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat

import typer
from rich.progress import track

from hil.diagnosis.diagnose import diagnose
from tests.concealed import bound, nominal, records

MEMORIES = (0.0, 0.9)
_FIRST_SEED = 10_000


def verdict(unit: int, first_seed: int = _FIRST_SEED) -> str:
    """The verdict on one healthy unit."""
    memory = MEMORIES[unit % len(MEMORIES)]
    model = nominal(memory)
    return diagnose(model, bound(model, records(seed=first_seed + unit, memory=memory))).diagnosis.verdict


def main(
    units: int = typer.Option(300, min=1, help="Healthy units."),
    jobs: int = typer.Option(2, min=1, help="Processes."),
    seed: int = typer.Option(_FIRST_SEED, help="Seed of the first unit."),
) -> None:
    """Count false alarms and print the rate with its exact 95 % interval."""
    from scipy.stats import binomtest

    alarms = []
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:  # no forks beside threads
        verdicts = pool.map(verdict, range(units), repeat(seed), chunksize=5)
        for unit, found in enumerate(track(verdicts, "diagnosing", total=units)):
            if found != "consistent":
                alarms.append((unit, found))
    interval = binomtest(len(alarms), units).proportion_ci()
    low, rate, high = (100.0 * share for share in (interval.low, len(alarms) / units, interval.high))
    print(f"{len(alarms)} of {units}: {rate:.2g} % [{low:.2g}…{high:.2g}]")
    for unit, found in alarms:
        print(f"  unit {unit} (noise memory {MEMORIES[unit % len(MEMORIES)]}): {found}")


if __name__ == "__main__":
    typer.run(main)
