"""`python -m tests.studies.proof.alarms`: how often a healthy unit is not called consistent.

Short recordings of a simulated HPV41 with nothing concealed, half of them with coloured noise, each diagnosed with the
model of another draw. The proof itself has healthy units of all plants with other equations; this is the quick count of
many.
"""

from __future__ import annotations

import typer
from rich.progress import track

from hil.diagnosis.diagnose import diagnose
from tests.concealed import bound, nominal, records
from tests.studies.jobs import finished
from tests.studies.rates import Rate

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
    verdicts = finished(verdict, [(unit, seed) for unit in range(units)], jobs)
    alarms = sorted(one for one in track(verdicts, "diagnosing", total=units) if one[1] != "consistent")
    found = Rate(len(alarms), units)
    low, rate, high = (100.0 * share for share in (found.interval()[0], found.share, found.interval()[1]))
    print(f"{len(alarms)} of {units}: {rate:.2g} % [{low:.2g}…{high:.2g}]")
    for unit, said in alarms:
        print(f"  unit {unit} (noise memory {MEMORIES[unit % len(MEMORIES)]}): {said}")


if __name__ == "__main__":
    typer.run(main)
