"""A model: a plant with the values of its parameters, the effects switched on, and where it all came from.

Model files are JSON, versioned, and checked when read.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge, Interval

from hil.catalog import entries, models
from hil.errors import FileError, UnitError, first_fault, storing
from hil.physics.compose import effects as installed_effects
from hil.physics.compose import kernel, plant
from hil.physics.plant import Parameter, Plant
from hil.physics.simulate import ActiveEffect
from hil.record.durable import write_named
from hil.record.plain import plain
from hil.record.show import table_html
from hil.record.simulated import SIMULATED, marked
from hil.units import scale_and_offset
from hil.untrusted import parse_json, read_small
from hil.version import PROGRAM, made_by

FORMAT = "hil-model"
VERSION = 1
Std = Annotated[float, Ge(0.0)]
_ANY = "any [any]"  # the heading of a channel that nobody named


@dataclass(frozen=True, slots=True)
class Value:
    """A number with its standard uncertainty (None: not estimated) and unit.

    `std` is by noise and by what the model lacks; `calibration_std` what the stated calibrations of the bench's
    instruments add to it (None: nothing is stated).
    """

    value: float
    unit: str
    std: Std | None = None
    calibration_std: Std | None = None

    @property
    def std_with_calibration(self) -> float | None:
        """Both together."""
        return None if self.std is None else math.hypot(self.std, self.calibration_std or 0.0)


@dataclass(frozen=True, slots=True)
class ModelEffect:
    """An effect of the library at a hook of the plant."""

    name: str
    hook: str
    parameters: Mapping[str, Value]

    @property
    def key(self) -> tuple[str, str]:
        """(effect name, hook name)."""
        return self.name, self.hook


@dataclass(frozen=True, slots=True)
class Noise:
    """What the best model cannot explain: e_k = −Σ a_i·e_{k−i} + w_k, with w white.

    Attributes:
        std: of e, in the output's unit.
        colour: a_1 … a_p at `interval_s`; empty for white noise.
        hum_hz, hum: a tone beside e, with a phase of its own in each recording, and its amplitude; None without one.
        std_uncertainty: standard uncertainty of `std`; 0 where nobody stated one.
    """

    std: Std
    colour: tuple[float, ...] = ()
    interval_s: float | None = None
    hum_hz: float | None = None
    hum: float = 0.0
    std_uncertainty: Std = 0.0


@dataclass(frozen=True, slots=True)
class Covariance:
    """How the uncertainties of estimated parameters hang together: matrix[i][j] belongs to names[i], names[j]."""

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        """Raises `ValueError`: not a row and a column for each name, or a variance below zero."""
        count = len(self.names)
        if [len(row) for row in self.matrix] != [count] * count:
            raise ValueError(f"a row and a column are needed for each of the {count} names")
        if any(row[k] < 0.0 for k, row in enumerate(self.matrix)):
            raise ValueError("a variance, on the diagonal, is not below 0")


@dataclass(frozen=True, slots=True)
class Model:
    """A plant with values.

    Attributes:
        plant: name of an installed plant.
        parameters: every parameter of the plant.
        effects: switched on, in the order of the chain.
        input, output: channel headings that the values refer to.
        read_at: share of a sample between a command's update and the reading of the output (see `Drive`).
        noise: of the output, as it was when the model was identified.
        covariance: of the parameters that were estimated, from one recording of the same bench to the next.
        origin: recordings, tool version, fit; for the reader.
        skeleton: what the model left of the recordings of its identification (see `hil.diagnosis.skeleton.table`);
            None where nobody kept it.
    """

    plant: str
    parameters: Mapping[str, Value]
    effects: tuple[ModelEffect, ...] = ()
    input: str = ""
    output: str = ""
    read_at: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.0
    noise: Noise | None = None
    covariance: Covariance | None = None
    origin: Mapping[str, Any] = field(default_factory=dict)
    skeleton: Mapping[str, Any] | None = None

    def _repr_html_(self) -> str:
        rows = [_row(name, value) for name, value in self.parameters.items()]
        for effect in self.effects:
            rows += [_row(f"{effect.name}.{name}", value) for name, value in effect.parameters.items()]
        caption = marked(f"{self.plant}: {self.input} → {self.output}", simulated=self.origin.get(SIMULATED))
        return table_html(("parameter", "value", "unit"), rows, caption)

    def resolved_unit(self, unit: str) -> str:
        """A unit of its plant's page for a reader: that of its own channels where the plant takes any."""
        return self.definition.in_units(unit, self.input or _ANY, self.output or _ANY)

    @property
    def output_unit(self) -> str:
        """In which its output is told."""
        return self.resolved_unit(self.definition.output.unit)

    def to_pandas(self) -> Any:
        """Every parameter with its standard uncertainty and unit as a pandas DataFrame, indexed by name."""
        import pandas as pd

        named = dict(self.parameters)
        for effect in self.effects:
            named |= {f"{effect.name}.{name}": value for name, value in effect.parameters.items()}
        rows = {name: (v.value, v.std, v.unit) for name, v in named.items()}
        return pd.DataFrame.from_dict(rows, orient="index", columns=["value", "std", "unit"])

    def as_dict(self) -> dict[str, Any]:
        """What its file holds, as JSON values."""
        return {"format": FORMAT, "version": VERSION, "program": PROGRAM, **plain(asdict(self))}

    @property
    def definition(self) -> Plant:
        """The installed plant."""
        return plant(self.plant)

    @property
    def values(self) -> dict[str, float]:
        """Parameter values by name."""
        return {name: found.value for name, found in self.parameters.items()}

    @property
    def active_effects(self) -> tuple[ActiveEffect, ...]:
        """The effects as the simulation takes them."""
        return tuple(
            ActiveEffect(e.name, e.hook, {name: found.value for name, found in e.parameters.items()})
            for e in self.effects
        )


def _row(name: str, value: Value) -> tuple[str, str, str]:
    interval = "" if value.std is None else f" ± {2.0 * value.std:.2g}"
    return name, f"{value.value:.6g}{interval}", value.unit


def typical_model(name: str) -> Model:
    """A plant at its typical values."""
    found = plant(name)
    units = found.units(found.inputs[0].heading, found.output.heading)
    values = {p.name: Value(p.typical, units[p.name]) for p in found.parameters}
    return Model(found.name, values, input=found.inputs[0].heading, output=found.output.heading)


def save_model(model: Model, path: Path) -> None:
    """Write a model file; a standard uncertainty without end (the data do not tell the parameter) is null.

    Raises:
        StorageError: it cannot be written.
    """
    with storing(path, "the model cannot be written"):
        write_named(path, json.dumps(model.as_dict(), indent=1, allow_nan=False) + "\n")


def load_model(path: Path) -> Model:
    """Read a model file, or an installed model by its bare name.

    Raises:
        FileError: not a model file, of another version, or of a plant, parameter or effect that is not
            installed; names the field and what was expected.
        UnknownNameError: the plant is not installed.
    """
    from pydantic import TypeAdapter, ValidationError

    path = path if path.exists() or len(path.parts) > 1 else models().get(path.name, path)
    try:
        content = parse_json(read_small(path), f"{path}: not a model file")
    except OSError as error:
        is_plant = any(entry.name == str(path) for entry in entries("plants"))
        plant_of = "; a plant: `hil identify --plant` makes a model of one, `hil list models` shows the installed ones"
        raise FileError(f"{path}: not a model file: {error.strerror}{plant_of if is_plant else ''}") from error
    if not isinstance(content, dict) or content.pop("format", None) != FORMAT:
        raise FileError(f"{path}: not a model file: field 'format' must be '{FORMAT}'")
    version, program = content.pop("version", None), content.pop("program", None)
    if version != VERSION:
        newer = f": {made_by(program)}" if program else ""
        raise FileError(f"{path}: model file of version {version}; this program reads version {VERSION}{newer}")
    try:
        model = TypeAdapter(Model).validate_python(content)
    except ValidationError as error:
        raise FileError(f"{path}: {first_fault(error)}") from None
    return _checked(model, path)


def _checked(model: Model, path: Path) -> Model:
    definition = model.definition
    known = {p.name: p for p in definition.parameters}
    for name in model.parameters:
        if name not in known:
            raise FileError(f"{path}: plant {model.plant} has no parameter '{name}'; known: {', '.join(known)}")
    sites = {site.key: site for site in kernel(model.plant).sites}
    for k, effect in enumerate(model.effects):
        if effect.key in {one.key for one in model.effects[:k]}:
            raise FileError(f"{path}: effect '{effect.name}' at '{effect.hook}' is given twice")
        if effect.key not in sites:
            have = ", ".join(sorted({e.name for e in installed_effects()}))
            raise FileError(
                f"{path}: plant {model.plant} has no effect '{effect.name}' at '{effect.hook}'; effects: {have}"
            )
        wanted = {p.name for p in sites[effect.key].effect.parameters}
        if wanted != set(effect.parameters):
            raise FileError(
                f"{path}: effect '{effect.name}' has the parameters {', '.join(sorted(wanted))}; "
                f"found {', '.join(sorted(effect.parameters)) or 'none'}"
            )
        for one in sites[effect.key].effect.parameters:
            there = one.possible_at(definition.hook(effect.hook))
            place = f"{path}: effects.{effect.name}.{one.name}"
            _check_value(place, effect.parameters[one.name], replace(there, unit=model.resolved_unit(there.unit)))
    units = definition.units(model.input or _ANY, model.output or _ANY)
    for name, given in model.parameters.items():
        _check_value(f"{path}: parameters.{name}", given, replace(known[name], unit=units[name]))
    missing = {name: Value(p.typical, units[name]) for name, p in known.items() if name not in model.parameters}
    return _with_unidentifiable(replace(model, parameters={**model.parameters, **missing}))


def _check_value(place: str, given: Value, parameter: Parameter) -> None:
    """Raises `FileError`: in another unit than the plant takes it, or a value that its equations cannot have."""
    if "any" not in parameter.unit and not _is_same(given.unit, parameter.unit):
        raise FileError(f"{place}: in '{given.unit}'; the plant takes it in '{parameter.unit}'")
    if refusal := parameter.refusal(given.value):
        raise FileError(f"{place}: {refusal}")


def _is_same(unit: str, other: str) -> bool:
    try:
        scale, offset = scale_and_offset(unit, other)
    except UnitError:
        return False
    return math.isclose(scale, 1.0) and offset == 0.0


def _with_unidentifiable(model: Model) -> Model:
    """The model as it was before it was written: what was estimated but has no uncertainty was not told by the data."""
    estimated = () if model.covariance is None else model.covariance.names
    unidentifiable = {
        name: replace(v, std=math.inf) for name, v in model.parameters.items() if name in estimated and v.std is None
    }
    return replace(model, parameters={**model.parameters, **unidentifiable}) if unidentifiable else model
