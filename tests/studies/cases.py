"""One unit of another structure: identified as it is, then diagnosed unchanged and changed."""

from __future__ import annotations

import hashlib
import importlib
import json
import pkgutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from scipy.optimize import brentq

import hil
from tests.studies import skeletons as _skeletons
from tests.studies.excitation import OTHER, USUAL, Array
from tests.studies.names import RANGES, right_names
from tests.studies.proof.diagnosers import PYTHON

NOTHING = "nothing"
SEVERITIES = (0.3, 10.0)
"""Of a change over noise and what the model left before, drawn evenly in its logarithm."""
_HELD_SHARE = 0.8  # how far from the middle of its range a command goes


@dataclass(frozen=True, slots=True, order=True)
class Case:
    """A skeleton, the number of a unit, what changes in it, how much (as d), and the seed of them all."""

    skeleton: str
    unit: int
    change: str
    wanted: float
    seed: int

    def rng(self, what: str) -> np.random.Generator:
        """Chance of its own for each purpose; the unit and its first recordings are the same for all its changes."""
        own = (self.skeleton, self.unit, what) if what in ("unit", "before") else (*asdict(self).values(), what)
        return np.random.default_rng([self.seed, *hashlib.sha256(repr(own).encode()).digest()])


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was said of a case.

    Attributes:
        moved: rms of the change between noise-free answers, over noise and what the model left before (d).
        named: effects and parameters that it names, in order; `alike`: those that it cannot tell from them, or would
            name where it names nothing.
    """

    case: Case
    moved: float
    verdict: str
    named: tuple[str, ...]
    alike: tuple[str, ...]
    error: str = ""

    @property
    def is_alarm(self) -> bool:
        """Something has changed, it says."""
        return self.verdict != "consistent" or bool(self.named)

    @property
    def _right(self) -> frozenset[str]:
        return right_names(self.case.skeleton, self.case.change)

    @property
    def is_right(self) -> bool:
        """The first name is right, or nothing is named of what the page has no place for."""
        said = self.named[:1] or (self.verdict,)
        return self.is_alarm and said[0] in self._right

    @property
    def is_in_set(self) -> bool:
        """A right name is first, or among at most three that it gives."""
        names = set(self.named) | set(self.alike)
        return self.is_right or (self.is_alarm and len(names) <= 3 and bool(names & self._right))

    @property
    def is_wrong(self) -> bool:
        """It names, and nothing of it is right."""
        return bool(self.named) and not {*self.named, *self.alike} & self._right


@dataclass(frozen=True, slots=True)
class Condition:
    """What a study takes away: how units are recorded, and what their models have lost when they are asked.

    Attributes:
        has_inner: whether inner signals are recorded. `noise`: times the skeleton's own. `share`: of the time.
        lost: keys of the model file.
    """

    has_inner: bool = True
    noise: float = 1.0
    share: float = 1.0
    lost: tuple[str, ...] = ()


CONDITIONS = {
    "": Condition(),
    "no-inner-signals": Condition(has_inner=False),
    "no-skeleton-misfit": Condition(lost=("skeleton",)),
    "no-prior": Condition(lost=("covariance",)),
    "noise-twice": Condition(noise=2.0),
    "a-third": Condition(share=1.0 / 3.0),
}
"""By name; the first is that of the published tables, and sizes of changes are those of it."""


def skeletons() -> list[str]:
    """Names of all skeletons."""
    return sorted(module.name for module in pkgutil.iter_modules(_skeletons.__path__))


def cases_of(names: Sequence[str], units: int, changes: int, seed: int) -> list[list[Case]]:
    """The cases of each unit: as it is, and with so many of the skeleton's changes, in an order that the seed draws."""
    return [list(_of_unit(name, unit, changes, seed)) for unit in range(units) for name in names]


def seal(units: Sequence[Sequence[Case]]) -> str:
    """A hash of all truths: what every unit is, and what is asked of it."""
    truths = [(skeleton(cases[0].skeleton).draw(cases[0].rng("unit")), *cases) for cases in units]
    return hashlib.sha256(repr(truths).encode()).hexdigest()


def _of_unit(name: str, unit: int, changes: int, seed: int) -> Iterator[Case]:
    yield Case(name, unit, NOTHING, 0.0, seed)
    possible = sorted(skeleton(name).CHANGES)
    Case(name, 0, NOTHING, 0.0, seed).rng("order").shuffle(possible)
    rng = Case(name, unit, NOTHING, 0.0, seed).rng("changes")
    low, high = np.log(SEVERITIES)
    for k in range(changes):
        wanted = float(np.exp(rng.uniform(low, high)))
        yield Case(name, unit, possible[(unit * changes + k) % len(possible)], wanted, seed)


def examined(cases: Sequence[Case], out: Path, condition: str = "") -> list[Outcome]:
    """What is said of all cases of one unit; its model is identified once."""
    first = cases[0]
    place = out / f"{first.skeleton}-{first.unit}-{first.seed}"
    module = skeleton(first.skeleton)
    unit = module.draw(first.rng("unit"))
    try:
        commands, paths, model = _identified(module, unit, first, place, "")
        left = _left(module, unit, commands, paths, model)
        if condition:
            _, _, model = _identified(module, unit, first, place / condition, condition)
            known = json.loads(model.read_text("utf-8"))
            lost = CONDITIONS[condition].lost
            model = model.with_name("asked.json")
            model.write_text(json.dumps({key: value for key, value in known.items() if key not in lost}), "utf-8")
    except Exception as error:  # whatever the program does, the study goes on and counts it
        return [Outcome(case, float("nan"), "failed", (), (), f"identify: {error}") for case in cases]
    return [_answered(case, module, unit, left, model, condition) for case in cases]


def _identified(
    module: ModuleType, unit: Any, first: Case, place: Path, condition: str
) -> tuple[list[Array], list[Path], Path]:
    """The unit's commands and recordings of before, and its nominal model; made once."""
    rng = first.rng("before")
    commands = [_steered(module, unit, make(rng, module.STEP_S)) for make in USUAL.values()]
    paths = [place / f"before-{k}.csv" for k in range(len(commands))]
    model = place / "nominal.json"
    if not model.exists():
        for one, path in zip(commands, paths, strict=True):
            _write(module, module.respond(unit, one), one, rng, path, CONDITIONS[condition])
        PYTHON.identify(paths, module.PLANT, model)
    return commands, paths, model


def _answered(case: Case, module: ModuleType, unit: Any, left: float, model: Path, condition: str) -> Outcome:
    place = model.parent
    kept = place / f"{case.change}.json"
    if kept.exists():
        told = json.loads(kept.read_text("utf-8"))
        return Outcome(**{**told, "case": case, "named": tuple(told["named"]), "alike": tuple(told["alike"])})
    rng = case.rng("after")
    kinds = dict(USUAL) if case.unit % 2 else {**dict(list(USUAL.items())[:2]), **OTHER}
    commands = [_steered(module, unit, make(rng, module.STEP_S)) for make in kinds.values()]
    changed, moved = _changed(case, module, unit, commands, left)
    folder = place / case.change
    paths = [
        _write(module, module.respond(changed, one), one, rng, folder / f"later-{k}.csv", CONDITIONS[condition])
        for k, one in enumerate(commands)
    ]
    try:
        PYTHON.diagnose(model, paths, folder)
        outcome = _read(case, moved, json.loads((folder / "diagnosis.json").read_text("utf-8")))
    except Exception as error:  # as above
        outcome = Outcome(case, moved, "failed", (), (), str(error))
    kept.write_text(json.dumps(asdict(outcome)), "utf-8")
    return outcome


def _read(case: Case, moved: float, told: Mapping[str, Any]) -> Outcome:
    named = [one["name"] for one in (*told["effects"], *told["changed_parameters"])]
    groups = [group for group in told["not_separable"] if not named or set(group) & set(named)]
    alike = [name for group in groups for name in group]
    return Outcome(case, moved, told["verdict"], tuple(named), tuple(dict.fromkeys(alike)))


def _changed(case: Case, module: ModuleType, unit: Any, commands: Sequence[Array], left: float) -> tuple[Any, float]:
    """The unit with as much of a change as shows with the d that is wanted, and the d that it has."""
    if case.change == NOTHING:
        return unit, 0.0
    output = list(module.CHANNELS)[1]
    before = np.concatenate([module.respond(unit, one)[output] for one in commands])
    scale = float(np.hypot(module.NOISE[output], left))

    def moved(amount: float) -> float:
        other = module.CHANGES[case.change](unit, amount)
        after = np.concatenate([module.respond(other, one)[output] for one in commands])
        return float(np.sqrt(np.mean((after - before) ** 2))) / scale

    amount = _where(moved, case.wanted, 1.0, 0.02)
    return module.CHANGES[case.change](unit, amount), moved(amount)


def _where(grows: Callable[[float], float], wanted: float, most: float, near: float) -> float:
    """Where what grows reaches what is wanted, or its end."""
    if grows(most) <= wanted:
        return most
    return float(brentq(lambda x: grows(x) - wanted, 0.0, most, xtol=near * most, maxiter=12, disp=False))


def _steered(module: ModuleType, unit: Any, shape: Array) -> Array:
    """A command of this shape in the plant's range; an integrating one is led back to where it began by a bias."""
    low, high, integrates = RANGES[module.PLANT]
    middle, half = 0.5 * (low + high), 0.5 * (high - low) * _HELD_SHARE
    if not integrates:
        return middle + half * shape
    end = partial(_end, module, unit)
    bias = 0.0
    if end(middle + half * (shape - 0.3)) < 0.0 < end(middle + half * (shape + 0.3)):
        bias = float(brentq(lambda b: end(middle + half * (shape + b)), -0.3, 0.3, xtol=1e-3, maxiter=12, disp=False))
    return np.asarray(middle + half * (shape + bias))


def _end(module: ModuleType, unit: Any, command: Array) -> float:
    output = module.respond(unit, command)[list(module.CHANNELS)[1]]
    return float(output[-1] - output[0])


def _left(module: ModuleType, unit: Any, commands: Sequence[Array], paths: Sequence[Path], model: Path) -> float:
    """The rms that the nominal model leaves of the unit's noise-free answers, on its own recordings."""
    output = list(module.CHANNELS)[1]
    off = [
        hil.simulate(model, path).values(output, module.CHANNELS[output]) - module.respond(unit, command)[output]
        for command, path in zip(commands, paths, strict=True)
    ]
    return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))


def _write(
    module: ModuleType,
    clean: Mapping[str, Array],
    command: Array,
    rng: np.random.Generator,
    path: Path,
    condition: Condition,
) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    (source, unit), *measured = module.CHANNELS.items()
    if not condition.has_inner:
        measured = measured[:1]
    noisy = [
        clean[name] + condition.noise * module.NOISE[name] * rng.standard_normal(len(command)) for name, _ in measured
    ]
    heading = ",".join(["time [s]", f"{source} [{unit}]", *(f"{name} [{unit}]" for name, unit in measured)])
    rows = np.column_stack([np.arange(len(command)) * module.STEP_S, command, *noisy])
    rows = rows[: round(condition.share * len(rows))]
    np.savetxt(path, rows, fmt="%.8g", delimiter=",", header=heading, comments="")
    return path


def skeleton(name: str) -> ModuleType:
    """A skeleton by name."""
    return importlib.import_module(f"tests.studies.skeletons.{name}")
