"""Twenty-one seeded recordings: our choice of a form from nothing beside peers that are told the true order.

    python benchmarks/black_box.py [SEEDS [PART OF A NAME]]

5 000 samples with 5 % of noise each. The peers are an output-error fit (`least_squares` over `lfilter`, three starts),
ARX by least squares, and N4SID (nfoursid); each gets order and delay of the linear plant. "fit" is on another command
without noise; "held" counts intervals of 95 % that hold the truth, of the parameters that the chosen form has; "doubt"
counts the fits that say that the model lacks something, and behind the plus those that say that it does, or that the
noise is coloured. Needs the extra `bench`.
"""

from __future__ import annotations

import math
import os
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `hil` itself does; peers gain by it too

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, dlsim, lfilter

from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.physics.model import typical_model
from hil.physics.simulate import Drive, simulate
from hil.record.recording import recording

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

_STEP_S, _COUNT, _NOISE, _COVERAGE = 0.005, 5000, 0.05, 1.96
_DEFINITION = plant("transfer-function")


@dataclass(frozen=True)
class Kind:
    """A linear plant, what stands before or behind it, and how it is driven and recorded."""

    name: str
    numerator: Sequence[float]
    denominator: Sequence[float]
    late: int = 0  # samples
    command: str = "binary"
    noise: str = "white"
    experiments: int = 1
    before: Function | None = None
    behind: Function | None = None
    instead: Function | None = None

    @property
    def order(self) -> int:
        return len(self.denominator) - 1

    @property
    def is_linear(self) -> bool:
        return self.before is self.behind is self.instead is None

    def answer(self, command: Array) -> Array:
        """Its output without noise, shape (n,)."""
        if self.instead is not None:
            return self.instead(command)
        driven = command if self.before is None else self.before(command)
        above, below, _ = cont2discrete((self.numerator, self.denominator), _STEP_S)
        linear = lfilter(np.r_[np.zeros(self.late), np.ravel(above)], below, driven)
        return linear if self.behind is None else self.behind(linear)

    @property
    def truth(self) -> dict[str, float]:
        """Its parameters, called as in the forms that it may be given."""
        if not self.is_linear:
            return {}
        below = np.array(self.denominator)
        integrates = below[-1] == 0.0
        below = below[:-1] if integrates else below
        made = {"integrator_gain" if integrates else "gain": self.numerator[-1] / below[-1],
                "dead_time": self.late * _STEP_S}  # fmt: skip
        poles = np.roots(below)
        real = np.sort(poles[poles.imag == 0.0].real)[::-1]
        if len(real) == 1:
            made["lag_time"] = -1.0 / real[0]
        pairs = [[*real]] if len(real) == 2 else [[p, p.conjugate()] for p in poles if p.imag > 0.0]
        for number, (one, other) in enumerate(sorted(pairs, key=lambda pair: abs(pair[0])), 1):
            time_s = 1.0 / math.sqrt((one * other).real)
            made[f"pair{number}_time"], made[f"pair{number}_damping"] = time_s, -(one + other).real * time_s / 2.0
        if len(self.numerator) == 2:
            made["pair1_zero"] = self.numerator[0] / self.numerator[1]
        return made


def _play(given: Array) -> Array:
    made, held = np.empty_like(given), 0.0
    for k, value in enumerate(given):
        held = min(max(held, value - 0.2), value + 0.2)
        made[k] = held
    return made


def _rubbing(command: Array) -> Array:
    """A mass of 1 on a spring of 25 and a damper of 4, held by a friction of 3."""
    place = speed = 0.0
    made, step_s = np.empty_like(command), _STEP_S / 10.0
    for k, force in enumerate(25.0 * command):
        for _ in range(10):
            push = force - 25.0 * place - 4.0 * speed
            free = speed + step_s * push
            speed = math.copysign(max(abs(free) - 3.0 * step_s, 0.0), free)
            place += step_s * speed
        made[k] = place
    return made


_SECOND: tuple[Sequence[float], Sequence[float]] = ([25.0], [1.0, 4.0, 25.0])
KINDS = (
    Kind("first order", [2.0], [0.3, 1.0]),
    Kind("second order", *_SECOND),
    Kind("two real poles", [1.0], [0.03, 0.4, 1.0]),
    Kind("third order", [50.0], [0.2, 1.8, 9.0, 50.0]),
    Kind("fourth order", [10000.0], np.polymul([1.0, 4.0, 25.0], [1.0, 8.0, 400.0])),
    Kind("first order, 24 samples late", [2.0], [0.3, 1.0], 24),
    Kind("second order, 3 samples late", *_SECOND, 3),
    Kind("zero in the right half plane", [-2.5, 25.0], [1.0, 6.0, 25.0]),
    Kind("zero in the left half plane", [3.0, 25.0], [1.0, 8.0, 25.0]),
    Kind("resonance", [100.0], [1.0, 1.0, 100.0]),
    Kind("integrator", [0.8], [0.1, 1.0, 0.0], command="levels"),
    Kind("friction", *_SECOND, command="levels", instead=_rubbing),
    Kind("backlash behind", *_SECOND, command="levels", behind=_play),
    Kind("dead band before", *_SECOND, command="levels",
         before=lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.2, 0.0)),
    Kind("saturation before", *_SECOND, command="levels", before=lambda u: np.clip(u, -0.6, 0.6)),
    Kind("parabola before", *_SECOND, command="levels", before=lambda u: u + 0.3 * u**2),
    Kind("second order, coloured noise", *_SECOND, command="levels", noise="coloured"),
    Kind("third order, 10 bit", [50.0], [0.2, 1.8, 9.0, 50.0], noise="10 bit"),
    Kind("second order, from rest", *_SECOND, command="rest"),
    Kind("second order, uneven stamps", *_SECOND, noise="uneven"),
    Kind("second order, two experiments", *_SECOND, command="levels", experiments=2),
)  # fmt: skip


def main() -> None:
    warnings.simplefilter("ignore")  # peers warn about what they are asked to do
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    part = sys.argv[2] if len(sys.argv) > 2 else ""
    print(f"{'':30} {'fit %':>6} {'OE':>6} {'ARX':>6} {'N4SID':>6} {'time':>5}  held    doubt  forms")
    tried(KINDS[0], [0])  # compiles
    total, ratios = np.zeros(2, dtype=int), []
    for at, kind in enumerate(KINDS):
        if part not in kind.name:
            continue
        tally = tried(kind, [1000 * at + seed for seed in range(seeds)])
        fits = np.mean(tally.fits, axis=0)
        ratio = tally.ours_s / tally.peer_s
        total += (tally.held, tally.told)
        ratios.append(ratio)
        held = f"{tally.held}/{tally.told}" + (f" ({tally.untold} not told)" if tally.untold else "")
        forms = ", ".join(f"{count} × {form}" for form, count in tally.forms.most_common(3))
        print(f"{kind.name:30} {fits[0]:6.2f} {fits[1]:6.2f} {fits[2]:6.2f} {fits[3]:6.2f} {ratio:5.1f}  {held:7} "
              f"{tally.doubts}+{tally.open}/{seeds}  {forms}", flush=True)  # fmt: skip
    print(f"held {total[0]} of {total[1]} ({100.0 * total[0] / max(total[1], 1):.1f} %); time over the output-error "
          f"peer's: median {np.median(ratios):.1f}, largest {max(ratios):.1f}, bar 20")  # fmt: skip


@dataclass
class Tally:
    """What came of a kind over its seeds: fits of ours and of the three peers, in %."""

    fits: list[list[float]] = field(default_factory=list)
    forms: Counter[str] = field(default_factory=Counter)
    held: int = 0
    told: int = 0
    untold: int = 0
    doubts: int = 0
    open: int = 0
    ours_s: float = 0.0
    peer_s: float = 0.0


def tried(kind: Kind, seeds: Sequence[int]) -> Tally:
    """Identify from the recordings of all seeds, and simulate another command."""
    made = Tally()
    for seed in seeds:
        rng = np.random.default_rng(seed)
        recorded = [_recorded(kind, rng) for _ in range(kind.experiments)]
        other = _command(kind.command, rng)
        wanted = kind.answer(other)
        experiments = [
            experiment(recording(f"{k}", t, {"u [1]": u, "y [1]": y}), _DEFINITION, "u", "y")
            for k, (t, u, y) in enumerate(recorded)
        ]
        begun = time.process_time()
        found = fit_plant(typical_model("transfer-function"), experiments)
        done = time.process_time()
        even_s = _STEP_S * np.arange(_COUNT)
        sets = [(u[np.clip(np.searchsorted(t, even_s, "right") - 1, 0, None)], np.interp(even_s, t, y))
                for t, u, y in recorded]  # fmt: skip
        above, below = _output_error(sets, kind.order, kind.late)
        made.peer_s += time.process_time() - done
        made.ours_s += done - begun
        drive = Drive(np.r_[np.zeros(200), other][None, :], 0.0, _STEP_S)  # from rest, as the peers' filters
        answers = [
            simulate(found.model.definition, found.model.values, drive)[0][200:], lfilter(above, below, other),
            lfilter(*_arx(sets, kind.order, kind.late), other), _subspace(sets, kind.order + kind.late, other),
        ]  # fmt: skip
        spread = np.linalg.norm(wanted - wanted.mean())
        made.fits.append([100.0 * (1.0 - min(float(np.linalg.norm(y - wanted)) / spread, 2.0)) for y in answers])
        made.forms[str(found.model.origin["structure"])] += 1
        made.doubts += any("the residuals are no noise" in str(note) for note in found.notes)
        made.open += any("the noise is coloured, or the model lacks" in str(note) for note in found.notes)
        for name, true in kind.truth.items():
            value = found.model.parameters.get(name)
            if value is None or value.std is None:
                continue
            if not math.isfinite(value.std):
                made.untold += 1
                continue
            made.told += 1
            made.held += abs(value.value - true) <= _COVERAGE * value.std
    return made


def _command(kind: str, rng: np.random.Generator) -> Array:
    if kind == "binary":
        return np.repeat(rng.choice([-1.0, 1.0], _COUNT // 20), 20)
    if kind == "levels":
        return np.repeat(rng.uniform(-1.0, 1.0, _COUNT // 50), 50)
    return np.r_[np.zeros(_COUNT // 10), np.repeat(rng.uniform(0.2, 1.0, 9 * _COUNT // 1000), 100)]


def _recorded(kind: Kind, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Stamps in s, command and noisy output, shape (n,) each."""
    time_s, command = _STEP_S * np.arange(_COUNT), _command(kind.command, rng)
    clean = kind.answer(command)
    if kind.noise == "10 bit":
        code = np.ptp(clean) / 1023.0
        noisy = clean + 0.002 * np.std(clean) * rng.normal(size=_COUNT)
        return time_s, command, code * np.round(noisy / code)
    noise = rng.normal(size=_COUNT)
    if kind.noise == "coloured":
        noise = lfilter([0.6], [1.0, -0.8], noise)  # of variance 1
    output = clean + _NOISE * np.std(clean) * noise
    kept = np.sort(rng.permutation(_COUNT)[: 9 * _COUNT // 10]) if kind.noise == "uneven" else slice(None)
    return time_s[kept], command[kept], output[kept]


Sets = Sequence[tuple[Array, Array]]


def _output_error(sets: Sets, order: int, late: int) -> tuple[Array, Array]:
    """(numerator, denominator) in z⁻¹, of the best of three output-error fits, starting from poles at random."""

    def error(values: Array) -> Array:
        above, below = np.r_[np.zeros(1 + late), values[:order]], np.r_[1.0, values[order:]]
        left = np.concatenate([lfilter(above, below, command) - output for command, output in sets])
        return np.nan_to_num(left, nan=1e3, posinf=1e3, neginf=-1e3)

    starts = []
    for seed in range(3):
        below = np.poly(np.random.default_rng(seed).uniform(0.5, 0.98, order))[1:]
        starts.append(np.r_[np.full(order, (1.0 + below.sum()) / order), below])
    best: Any = min((least_squares(error, start, max_nfev=200) for start in starts), key=lambda found: found.cost)
    return np.r_[np.zeros(1 + late), best.x[:order]], np.r_[1.0, best.x[order:]]


def _arx(sets: Sets, order: int, late: int) -> tuple[Array, Array]:
    """Likewise, by least squares of one step ahead."""
    first = order + late
    rows, values = [], []
    for command, output in sets:
        past = [-output[first - k : -k] for k in range(1, order + 1)]
        driven = [command[first - late - k : len(command) - late - k] for k in range(1, order + 1)]
        rows.append(np.column_stack([*past, *driven]))
        values.append(output[first:])
    found = np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
    return np.r_[np.zeros(1 + late), found[order:]], np.r_[1.0, found[:order]]


def _subspace(sets: Sets, order: int, other: Array) -> Array:
    """What a state-space model of N4SID, of the first experiment, answers to another command."""
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    frame = pd.DataFrame({"u": sets[0][0], "y": sets[0][1]})
    method = NFourSID(frame, output_columns=["y"], input_columns=["u"], num_block_rows=max(order + 2, 10))
    method.subspace_identification()
    found, _ = method.system_identification(rank=order)
    return np.nan_to_num(dlsim((found.a, found.b, found.c, found.d, 1.0), other)[1][:, 0], nan=1e3)


if __name__ == "__main__":
    main()
