"""`python -m tests.studies.proof.small_sines`: from small sines to one name, by tests that the diagnosis chooses.

The paper's practice is a small sine about half opening: it shows little of what may be missing. A valve on the
simulated bench gets one effect, of any kind the plant lists, the small sines are recorded, and `hil diagnose --bench`
goes on from there: it runs the tests it asks for on the same bench until it can conclude or its time is spent.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from hil.bench.find import find_bench
from hil.bench.read import read_bench
from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import experiment, for_model
from hil.physics.compose import Site, kernel
from hil.physics.model import Model, load_model, save_model
from hil.physics.simulate import ActiveEffect
from hil.record.read import read_recording
from hil.session.demo import write_bench_with
from hil.session.diagnosis import conclude
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure
from tests.studies.jobs import finished
from tests.studies.rates import Rate

SMALL_SINES = {"frequencies": (0.3, 0.7, 1.5, 3.1, 4.9), "amplitudes": (10.0,), "biases": (50.0,), "measure_s": 3.0}
HEALTHY = {
    "frequency_response": SMALL_SINES | {"amplitudes": (20.0,)},
    "flow_curve": {},
    "step_response": {},
}
BUDGET_S = 60.0
BENCH, PLANT = "brevini-hpv41", "brevini-hpv41"
_RATE_HZ = 250
_WEAKEST, _STRONGEST = 0.8, 1.6


@dataclass(frozen=True, slots=True)
class Concealed:
    """What a unit has: an effect, and the name under which it is told."""

    told: str
    effect: ActiveEffect


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was concealed, what was said after the small sines alone and at the end, and the bench time it took."""

    concealed: Concealed
    said_first: tuple[str, ...]
    said: tuple[str, ...]
    tests: int
    bench_s: float

    @property
    def right(self) -> bool:
        """Whether the effect is named first."""
        return self.said[:1] == (self.concealed.reported_name,)


def drawn(unit: int, seed: int) -> Concealed:
    """One effect of the plant in turn, at one of its hooks, about as large as is typical."""
    rng = np.random.default_rng([seed, unit])
    by_name: dict[str, list[Site]] = {}
    for site in kernel(PLANT).sites:
        by_name.setdefault(site.effect.reported_name, []).append(site)
    told = sorted(by_name)[unit % len(by_name)]
    site = by_name[told][rng.integers(len(by_name[told]))]
    values = {p.name: p.typical for p in site.effect.parameters_at(site.hook)}
    strength, null = next(iter(site.effect.null_at(site.hook).items()))
    times = float(rng.uniform(_WEAKEST, _STRONGEST))
    values[strength] = values[strength] / times if math.isinf(null) else null + times * (values[strength] - null)
    return Concealed(told, ActiveEffect(site.effect.name, site.hook.name, values))


def healthy_model(folder: Path) -> Model:
    """The nominal model, identified from tests of the healthy unit on the bench."""
    bench = read_bench(find_bench(BENCH))
    runs = [run_procedure(load_procedure(name), bench, {**given, "rate_hz": _RATE_HZ}, folder / name).folder
            for name, given in HEALTHY.items()]  # fmt: skip
    start = starting_model(PLANT)
    return fit_plant(start, [experiment(read_recording(run), start.definition) for run in runs]).model


def concluded(concealed: Concealed, model: Model, folder: Path, seed: int) -> Outcome:
    """Record the small sines, and let the diagnosis conclude on the bench."""
    write_bench_with(concealed.effect, folder / "worn.toml", seed)
    bench = read_bench(folder / "worn.toml")
    given: dict[str, Any] = SMALL_SINES | {"rate_hz": _RATE_HZ}
    sines = run_procedure(load_procedure("frequency_response"), bench, given, folder / "sines").folder
    first = for_model(model, read_recording(sines))
    alone = conclude(model, [first], bench, 0.0, folder / "alone")
    found = conclude(model, [first], bench, BUDGET_S, folder / "out")
    tests = sorted((folder / "out").glob("test-*")) if (folder / "out").exists() else []
    spent = sum(float(read_recording(test).time_s[-1]) for test in tests)
    names = [tuple(effect.name for effect in one.diagnosis.effects) for one in (alone, found)]
    return Outcome(concealed, names[0], names[1], len(tests), spent)


def _one(unit: int, seed: int, model: Path) -> Outcome:
    with tempfile.TemporaryDirectory(prefix="small-sines-") as place:
        return concluded(drawn(unit, seed), load_model(model), Path(place), seed + 1 + unit)


def main(
    units: int = typer.Option(38, min=1, help="Units, each with the next effect of the plant's list."),
    jobs: int = typer.Option(2, min=1, help="Processes."),
    seed: int = typer.Option(1, help="Seed of all units."),
) -> None:
    """Count how often one right name is reached, and print every unit."""
    found = []
    with tempfile.TemporaryDirectory(prefix="small-sines-") as place:
        nominal = Path(place) / "nominal.json"
        save_model(healthy_model(Path(place)), nominal)
        for _, outcome in finished(_one, [(unit, seed, nominal) for unit in range(units)], jobs):
            found.append(outcome)
            print(_line(outcome), flush=True)
    alone = Rate(sum(o.said_first[:1] == (o.concealed.reported_name,) for o in found), units)
    tested = Rate(sum(o.right for o in found), units)
    longest = max(o.bench_s for o in found)
    print(f"named first: small sines alone {alone}, with own tests {tested}; at most {longest:.0f} s of bench time")


def _line(outcome: Outcome) -> str:
    hidden = outcome.concealed.effect
    values = ", ".join(f"{name} {value:.3g}" for name, value in hidden.parameters.items())
    first, last = (" + ".join(said) or "–" for said in (outcome.said_first, outcome.said))
    tests = f"{outcome.tests} | {outcome.bench_s:.0f} | {'right' if outcome.right else ''}"
    return f"| {outcome.concealed.reported_name} | {hidden.hook} | {values} | {first} | {last} | {tests} |"


if __name__ == "__main__":
    typer.run(main)
