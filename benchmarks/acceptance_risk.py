"""What the acceptance test of the EFC risks: worn valves accepted, good ones not, beside what its certificates state.

    python benchmarks/acceptance_risk.py [--whole VALVES] [--judged VALVES] [--seed SEED]

Valves are drawn from the population of `efc_population`, a third of each class, with another seed than the one that
the test has learnt from. Some go through the whole procedure on the simulated bench, more through the judging of the
same features; Ctrl-C ends it with what there is. Shares with their 95 % intervals after Wilson. A certificate states
the probability that its valve is good: what it risks is summed over all of them.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `hil` itself does


from hil.bench.find import find_bench
from hil.bench.open import open_rig
from hil.bench.read import read_bench
from hil.identification.papers.efc_condition import FREQUENCIES_HZ, simulated_tests
from hil.physics.model import Model, typical_model
from hil.physics.published.efc_population import population
from hil.physics.published.tugsal import CLASSES
from hil.record.folder import read
from hil.record.measurement import Findings, Verdict
from hil.session.procedure import load_procedure
from hil.session.results import evaluated
from hil.session.setting import parse_settings
from procedures.efc_acceptance import judged_condition
from procedures.leakage_check import LEAKAGE

BENCH, PROCEDURE = "cummins-efc-acceptance", "efc_acceptance"
_LEAKAGE_STD = 1.0  # ml/min, by the calibration of that bench


class Judged(NamedTuple):
    """A drawn valve: its class, the verdict, and the probability of a good one that its certificate states."""

    label: str
    verdict: Verdict | None
    stated_good: float


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--whole", type=int, default=200, help="valves through the whole procedure")
    asked.add_argument("--judged", type=int, default=1000, help="valves through the judging of the same features")
    asked.add_argument("--seed", type=int, default=7, help="of the valves and their noise")
    chosen = asked.parse_args()
    judged = list(through_judging(chosen.judged, chosen.seed + 1))
    whole: list[Judged] = []
    try:
        for one in through_procedure(chosen.whole, chosen.seed):
            whole.append(one)
            print(f"\r{len(whole)} of {chosen.whole} valves", end="", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        print("\nstopped; the table is of the valves so far", file=sys.stderr)
    print("\n".join(table([("whole procedure", whole), ("judging of its features", judged)])))


def through_judging(count: int, seed: int) -> Iterator[Judged]:
    """Tests simulated without the bench, judged as the procedure judges them."""
    tests, labels = simulated_tests(count, seed)
    for test, label in zip(tests, labels, strict=True):
        measured, _ = judged_condition(test, FREQUENCIES_HZ, False)
        leakage = LEAKAGE.of(test.leakage_ml_min, _LEAKAGE_STD)
        yield _judged(CLASSES[label], Findings((*measured, leakage)))


def through_procedure(count: int, seed: int) -> Iterator[Judged]:
    """The whole acceptance test on the simulated bench, valve after valve."""
    valves, labels = population(count, seed)
    for i, (model, label) in enumerate(zip(valves, labels, strict=True)):
        with tempfile.TemporaryDirectory() as folder:
            yield _judged(CLASSES[label], tested(model, Path(folder), seed=1000 * seed + i))


def tested(model: Model, folder: Path, seed: int) -> Findings:
    """One acceptance test of a valve with noise of its own: driven and evaluated as by `hil run`, no report."""
    usual = typical_model("efc-drive").values
    changed = ", ".join(f"{name} = {value!r}" for name, value in model.values.items() if value != usual[name])
    (friction,) = model.effects
    coulomb = friction.parameters["coulomb"].value
    world = (
        f"[simulation]\nseed = {seed}\nparameters = {{ {changed} }}\n"
        f'effects = [{{ name = "friction", parameters = {{ coulomb = {coulomb!r} }} }}]\n'
    )
    text, found = re.subn(r"\[simulation\]\n.*?\n\n", lambda _: world + "\n", _text(), count=1, flags=re.DOTALL)
    if found != 1:
        raise RuntimeError(f"{BENCH}: its [simulation] was not found")
    bench = folder / "bench.toml"
    bench.write_text(text, encoding="utf-8")
    procedure = load_procedure(PROCEDURE)
    settings = parse_settings(procedure.settings, {})
    about = {"procedure": procedure.name, "settings": settings, "limits": {}}
    with open_rig(read_bench(bench), folder / "run", about, lambda _done, _text: None) as rig:
        procedure.run(rig, **settings)
    return evaluated(procedure, read(folder / "run"), {})


def table(columns: Sequence[tuple[str, Sequence[Judged]]]) -> Iterator[str]:
    """The risks as a table in Markdown."""
    yield "| | " + " | ".join(name for name, _ in columns) + " |"
    yield "|---|" + "---|" * len(columns)
    rows = [_row(list(judged)) for _, judged in columns]
    for name in rows[0]:
        yield f"| {name} | " + " | ".join(row[name] for row in rows) + " |"


def _row(judged: list[Judged]) -> dict[str, str]:
    accepted = [one for one in judged if one.verdict == "pass"]
    good = [one for one in judged if one.label == "good"]
    refused = [one for one in good if one.verdict != "pass"]
    worn = len(judged) - len(good)
    wrong = [one for one in accepted if one.label != "good"]
    missed = sum(one.stated_good for one in judged if one.verdict != "pass")
    all_good = sum(one.stated_good for one in judged)
    return {
        "valves, good ones": f"{len(judged)}, {len(good)}",
        "worn valves accepted": _share(len(wrong), worn),
        "accepted valves that are worn": _share(len(wrong), len(accepted)),
        "— as the certificates state": _percent(sum(1.0 - one.stated_good for one in accepted), len(accepted)),
        "good valves not accepted": _share(len(refused), len(good)),
        "— as the certificates state it": _percent(missed, all_good),
        "— of these, cannot tell": str(sum(one.verdict == "cannot tell" for one in refused)),
    }


def _judged(label: str, findings: Findings) -> Judged:
    (stated,) = (m.value for m in findings.measured if m.name == "probability_good")
    return Judged(label, findings.verdict, 0.0 if stated is None else stated / 100.0)


def _share(count: int, of: int) -> str:
    if not of:
        return "—"
    from scipy.stats import binomtest

    low, high = (100.0 * share for share in binomtest(count, of).proportion_ci(method="wilson"))
    return f"{count} of {of}: {low:.1f} … {high:.1f} %"


def _percent(part: float, whole: float) -> str:
    return f"{100.0 * part / whole:.1f} %" if whole else "—"


def _text() -> str:
    return find_bench(BENCH).read_text(encoding="utf-8")


if __name__ == "__main__":
    main()
