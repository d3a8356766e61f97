"""How often the noise of an identification is right: `python -m tests.studies.noise --seeds 40`.

A throttle flap is driven by steps, in three recordings of 20 s at 200 samples a second, and identified by a plant that
has its structure, or lacks the friction of the unit. The command rests for 6 s of each recording, or never for long.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from hil.cores import parallel_map
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import Experiment, experiment
from hil.physics.compose import plant
from hil.physics.model import typical_model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import Array, recording
from hil.signals.interval import COVERED
from hil.signals.recursion import filtered

FLAP = plant("throttle-flap")
STEP_S, COUNT, RESTING, NOISE_V = 0.005, 4000, 1200, 0.004
TEN_BIT_V = 5.0 / 1024.0
NOISES = {"white": 0.0, "pole 0.5": 0.5, "pole 0.8": 0.8, "pole 0.95": 0.95, "10 bit": 0.0}
FRICTION = ActiveEffect("friction", "force", {"coulomb": 3.0, "stiction": 1.2, "stribeck": 0.5, "presliding": 0.01})


@dataclass(frozen=True, slots=True)
class Row:
    """One kind of recording; `is_right`: the structure of the model."""

    noise: str
    rests: bool
    is_right: bool


def rows() -> list[Row]:
    """Every kind."""
    return [Row(*each) for each in product(NOISES, (True, False), (True, False))]


def holds(row: Row, seed: int) -> tuple[bool, bool]:
    """Whether the interval of the noise holds it, and whether noise and misfit were not told apart.

    Where they were not, the interval reaches up to all that the model leaves.
    """
    rng = np.random.default_rng([seed, rows().index(row)])
    found = fit_plant(typical_model(FLAP.name), [_recorded(row, f"{seed}-{k}", rng) for k in range(3)])
    noise, beyond = found.model.noise, found.model.origin.get("discrepancy")
    assert noise is not None
    truth = float(np.hypot(NOISE_V, TEN_BIT_V / np.sqrt(12.0))) if row.noise == "10 bit" else NOISE_V
    low, high = _interval(noise.std, noise.std_uncertainty)
    if beyond is None or beyond["is_witnessed"]:
        return low <= truth <= high, False
    return low <= truth <= _interval(beyond["left"], beyond["left_uncertainty"])[1], True


def _interval(std: float, uncertainty: float) -> tuple[float, float]:
    """Of 95 %, of a size that is not below 0."""
    factor = float(np.exp(COVERED * uncertainty / std))
    return std / factor, std * factor


def _recorded(row: Row, name: str, rng: np.random.Generator) -> Experiment:
    held = rng.integers(40, 120, COUNT)
    held[0] = RESTING if row.rests else held[0]
    command = np.repeat(rng.uniform(-15.0, 15.0, COUNT), held)[:COUNT]
    effects = [] if row.is_right else [FRICTION]
    angle = simulate(FLAP, FLAP.typical, Drive(command[None, :], 2.5, STEP_S), effects)[0]
    angle += NOISE_V * _noise(NOISES[row.noise], rng)
    if row.noise == "10 bit":
        angle = np.asarray(np.round(angle / TEN_BIT_V) * TEN_BIT_V, dtype=np.float64)
    channels = {"motor command [V]": command, "flap angle [V]": angle}
    return experiment(recording(name, STEP_S * np.arange(COUNT, dtype=np.float64), channels), FLAP)


def _noise(pole: float, rng: np.random.Generator) -> Array:
    white = rng.standard_normal(COUNT + 500)
    return np.asarray(filtered([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[500:], dtype=np.float64)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=40)
    seeds = range(parser.parse_args().seeds)
    print("| noise | rest | structure | 95 % intervals that hold | not told apart |")
    print("| --- | --- | --- | --- | --- |")
    total = 0
    for row in rows():
        found = parallel_map(partial(holds, row), seeds)
        held, opened = (sum(column) for column in zip(*found, strict=True))
        total += held
        said = ("yes" if row.rests else "no", "right" if row.is_right else "wrong")
        print(f"| {row.noise} | {said[0]} | {said[1]} | {held} of {len(seeds)} | {opened} |", flush=True)
    print(f"All: {total} of {len(seeds) * len(rows())}.")


if __name__ == "__main__":
    main()
