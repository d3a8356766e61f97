"""A transfer function from tables of a frequency response, as a model; and a model held against such a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, cast, get_args

import numpy as np

from hil.errors import FileError, InputError, SettingError
from hil.identification.frequency.criteria import EFFORT
from hil.identification.frequency.factored import model_of
from hil.identification.frequency.frequency_response import FrequencyResponse, average, from_polar, joined
from hil.identification.frequency.linear_evidence import doubts
from hil.identification.frequency.order_choice import fit_transfer_function
from hil.identification.frequency.transfer_function import TransferFunctionFit, Weights
from hil.identification.preparation.recording_quality import runs_the_other_way
from hil.identification.uncertainty.fit import bode_errors, fit_percent
from hil.identification.uncertainty.propagation import central_slopes
from hil.language.note import Note
from hil.physics.model import Covariance, Model, Value
from hil.physics.plants.transfer_function import PLANT
from hil.physics.transfer_function import straight
from hil.record.recording import Array
from hil.record.simulated import marked
from hil.record.table.response_table import ResponseTable
from hil.signals.interval import rounded, width

_STEP = 1e-4  # of a parameter's standard uncertainty, for slopes
_LEAST_STEP = 1e-6  # of the parameter itself, where lines without noise leave no uncertainty


@dataclass(frozen=True, slots=True)
class TableFit:
    """A transfer function fitted to lines of a frequency response, and the model that it makes."""

    model: Model
    fit: TransferFunctionFit
    notes: tuple[Note, ...]

    def summary(self) -> str:
        """What the fit says, the model's parameters that it has, and notes, for a terminal."""
        rows = [self.fit.summary(), f"{self.model.plant}"]
        fitted = {name: found for name, found in self.model.parameters.items() if found.std is not None}
        for name, found in fitted.items():
            rows.append(f"  {name:18} {rounded(found.value, found.std):>12} {width(found.std):12} {found.unit}")
        return "\n".join([*rows, *(f"  note: {note}" for note in self.notes)])


@dataclass(frozen=True, slots=True)
class Orders:
    """What a transfer function is asked to have, and how its lines are weighted; what is None is chosen by evidence."""

    poles: int | None = None
    zeros: int | None = None
    dead_time: bool | None = None
    weights: Weights | None = None

    @property
    def are_open(self) -> bool:
        """Whether nothing is asked."""
        return self == AS_THEY_SHOW


AS_THEY_SHOW = Orders()


def orders_of(poles: int | None, zeros: int | None, dead_time: bool | None, weights: str) -> Orders:
    """What somebody asked for in words.

    Raises:
        SettingError: weights that there are not.
    """
    if weights and weights not in get_args(Weights):
        raise SettingError(f"weights '{weights}': there are {', '.join(get_args(Weights))}")
    return Orders(poles, zeros, dead_time, cast("Weights | None", weights or None))


def fit_tables(
    tables: Sequence[ResponseTable], input_name: str = "", output_name: str = "", orders: Orders = AS_THEY_SHOW
) -> TableFit:
    """The transfer function of all lines together; orders and dead time that are not asked for, chosen by evidence.

    Raises:
        FileError: tables whose gains have different units.
        InputError: too few lines, or a response that no stable transfer function has.
    """
    response = as_response(tables)
    fit = fit_transfer_function(response, **asdict(orders))
    roles = tables[0].meta.get("roles", {})
    below, above = _units(tables[0].unit)
    given = f"{input_name or roles.get('command') or 'input'} [{below}]"
    answer = f"{output_name or roles.get('response') or 'output'} [{above}]"
    made = fit.model.to_model(given, answer)
    names, covariance = _covariance(fit, made)
    stds = dict(zip(names, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(), strict=True))
    values = {name: Value(v.value, v.unit, stds.get(name)) for name, v in made.parameters.items()}
    low, high = float(response.frequency_hz[0]), float(response.frequency_hz[-1])
    origin = {
        "recordings": [table.name for table in tables],
        "fit_percent": {t.name: fit_percent(t.response, fit.model.at(t.frequency_hz)) for t in tables},
        "lines": len(response), "band_hz": [low, high],
    }  # fmt: skip
    model = Model(
        PLANT.name, values, (), given, answer, covariance=Covariance(names, tuple(map(tuple, covariance.tolist()))),
        origin=origin,
    )  # fmt: skip
    unborne = (Note("the measured lines do not support it: {why}", why=why) for why in doubts(fit))
    return TableFit(model, fit, (*unborne, *runs_the_other_way(model)))


def averaged(tables: Sequence[ResponseTable], *, normalised: bool = False) -> ResponseTable:
    """The mean of responses on the same frequencies: of their dB and of their phases.

    Args:
        tables: one for each response.
        normalised: take each over its gain at the lowest frequency first, as eq. 1 of the HPV41 paper does.

    Raises:
        FileError: gains of different units, or other frequencies than those of the first.
    """
    first = tables[0]
    for other in tables[1:]:
        if other.unit != first.unit and not normalised:
            raise FileError(f"{other.name}: its gain is in {other.unit}, that of {first.name} in {first.unit}")
    one_each = [as_response([table]) for table in tables]
    mean = average([one.normalised() for one in one_each] if normalised else one_each)
    notes = [f"mean dB and mean phase of {len(tables)} responses{', each over its lowest line' if normalised else ''}"]
    unit = "1" if normalised else first.unit
    return ResponseTable(
        mean.name, mean.frequency_hz, mean.response, unit, in_db=unit == "1",
        meta={"assumed": notes, "recordings": [table.name for table in tables]},
    )  # fmt: skip


def as_table(response: FrequencyResponse, input_name: str, output_name: str) -> ResponseTable:
    """A measured frequency response as a table, with its uncertainty and the names of its channels."""
    return ResponseTable(
        f"{response.name}, {response.label}", response.frequency_hz, response.response,
        response.output_unit if response.input_unit == "1" else f"{response.output_unit}/{response.input_unit}",
        gain_std=response.gain_std / np.abs(response.response), phase_std_rad=np.radians(response.phase_std_deg),
        meta={"roles": {"command": input_name, "response": output_name}},
    )  # fmt: skip


def as_response(tables: Sequence[ResponseTable]) -> FrequencyResponse:
    """The lines of tables, those of all of them together, as what a transfer function is fitted to.

    Raises:
        FileError: gains of different units.
    """
    first = tables[0]
    for other in tables[1:]:
        if other.unit != first.unit:
            raise FileError(f"{other.name}: its gain is in {other.unit}, that of {first.name} in {first.unit}")
    units = _units(first.unit)
    return joined([
        from_polar(t.name, t.frequency_hz, t.response, t.gain_std, t.phase_std_rad, units) for t in tables
    ])  # fmt: skip


@dataclass(frozen=True, slots=True)
class TableComparison:
    """A model on a table: complex fit in %, rms errors of gain and phase, the lines with the largest errors."""

    name: str
    fit: float
    gain_error_db: float
    phase_error_deg: float
    worst_hz: tuple[float, ...]
    misfit: float | None
    simulated: bool = False

    @property
    def headline(self) -> Note:
        """The fit in words."""
        return Note("fit {fit:.2f} %, rms error {gain_db:.3g} dB and {phase_deg:.3g}°", fit=self.fit,
                    gain_db=self.gain_error_db, phase_deg=self.phase_error_deg)  # fmt: skip

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        figures = {name: value for name, value in asdict(self).items() if name != "name"}
        return {"file": self.name, "kind": "frequency response", **figures, "worst_hz": list(self.worst_hz)}

    def as_text(self) -> str:
        """As lines for a terminal."""
        worst = ", ".join(f"{hz:.4g} Hz" for hz in self.worst_hz)
        noise = "" if self.misfit is None else f"\n  {self.misfit:.3g} times the stated uncertainty (rms)"
        name = marked(self.name, simulated=self.simulated)
        return f"{name}\n  {self.headline}{noise}\n  largest errors at {worst}"


def compare_table(model: Model, table: ResponseTable) -> TableComparison:
    """How well a model's frequency response agrees with a table.

    Raises:
        InputError: a model of another plant, or with effects, has no frequency response of its own.
    """
    if model.plant != PLANT.name or model.effects:
        raise InputError(
            f"{table.name}: a frequency response is compared with a model of the plant '{PLANT.name}' without effects; "
            f"this one is of {model.plant}; simulate it on sines and compare that"
        )
    found = straight(model.values, "the model").at(table.frequency_hz)
    ratio = found / table.response
    worst = table.frequency_hz[np.argsort(-np.abs(ratio - 1.0))[: EFFORT.worst]]
    misfit = None
    if table.gain_std is not None and table.phase_std_rad is not None:
        squares = (np.log(np.abs(ratio)) / table.gain_std) ** 2 + (np.angle(ratio) / table.phase_std_rad) ** 2
        misfit = float(np.sqrt(np.mean(squares) / 2.0))
    return TableComparison(
        table.name, fit_percent(table.response, found), *bode_errors(table.response, found), tuple(worst.tolist()),
        misfit,
    )  # fmt: skip


def _units(unit: str) -> tuple[str, str]:
    """Units of input and output, of a gain in `unit`: `l/min/%` is l/min over %."""
    above, _, below = unit.rpartition("/")
    return (below, above) if above else ("1", unit)


def _covariance(fit: TransferFunctionFit, made: Model) -> tuple[tuple[str, ...], Array]:
    """Of the plant's parameters, from that of the fit's factors, by central differences."""

    def parameters_at(moved: Array) -> Array:
        try:
            found = model_of(fit.form, moved).to_parameters()
        except InputError:
            found = model_of(fit.form, fit.parameters).to_parameters()
        return np.array([found.get(name, 0.0) for name in made.parameters])

    stds = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    steps = np.maximum(_STEP * stds, _LEAST_STEP * np.abs(fit.parameters))
    slopes = central_slopes(parameters_at, fit.parameters, np.where(steps > 0.0, steps, _STEP))
    found = slopes @ fit.covariance @ slopes.T
    names = list(made.parameters)
    late = names.index("dead_time")
    if slopes[late].any():  # beside its scatter what other forms that fit as well say of it
        found[late, late] += fit.form_std_s**2
    known = np.flatnonzero(slopes.any(axis=1) & np.isfinite(np.diag(found)))  # a dead time may have no uncertainty
    return tuple(names[k] for k in known), found[np.ix_(known, known)]
