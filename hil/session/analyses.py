"""The papers' own calculations on what was read: models of steps, corners, an estimate on line, eq. 4.1."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hil.catalog import models
from hil.errors import FileError, InputError, SettingError, UnitError, listed, option
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.identification.frequency.table_fit import as_response
from hil.identification.papers.asymptotic_bode import AsymptoticFit, asymptotic_bode
from hil.identification.papers.curve_model import curve_model, with_measured_curve
from hil.identification.papers.recursive_least_squares import (
    ArxForm,
    Forgetting,
    RecursiveLeastSquares,
    excitation_order,
)
from hil.identification.papers.step_models import StepModels, step_models
from hil.identification.step.step_estimate import MeasuredStep, measured_steps
from hil.language.note import Note
from hil.language.words import marked
from hil.physics.model import Model, load_model, typical_model
from hil.physics.published.tugsal import (
    CLASSIFIED_CURRENT_A,
    THRESHOLDS,
    Level,
    crisp_class,
    current_memberships,
    error_4_1,
    error_memberships,
)
from hil.physics.transfer_function import TransferFunction, straight
from hil.record.csv_text import write_table
from hil.record.invalid_samples import INVALID_SAMPLES, measured_rows
from hil.record.plain import plain
from hil.record.read import read_recording
from hil.record.recording import SAME_STAMP, Array, Recording, split_heading
from hil.record.table.named import pairs
from hil.record.table.response_table import ResponseTable
from hil.signals.interval import rounded, width
from hil.untrusted import read_text

_LINEAR = "transfer-function"
_MEMBERSHIPS = (
    marked("left trapezoid"), marked("left triangle"), marked("right triangle"), marked("right trapezoid"),
)  # fmt: skip
_TIMES = ("s", "ms", "min", "h")


def models_of_steps(
    recording: Recording,
    input_name: str = "",
    output_name: str = "",
    beside: ResponseTable | None = None,
    band: float = 0.02,
) -> list[StepModels]:
    """The models of every step in a recording: eqs 9 to 22 of the HPV41 paper.

    Raises:
        InputError: no step, or a response that does not follow one. SettingError: a band that is none.
    """
    _check_band(band)
    response = None if beside is None else as_response([beside])
    names = channels_of(recording, input_name, output_name)
    found = measured_steps(_levels(measured_rows(recording, names)), *names, band=band)
    return [_of_step(one, recording.channel(names[1]).unit, response, band) for one in found]


def models_of_times(
    rise_s: float | None, settling_s: float | None, beside: ResponseTable | None = None, band: float = 0.02
) -> StepModels:
    """The models of a step of which the two times are known.

    Raises:
        SettingError: one of them is not, or a band that is none.
    """
    _check_band(band)
    if rise_s is None or settling_s is None:
        raise SettingError(f"name a recording with steps, or say {option('rise', 'S')} and {option('settling', 'S')}")
    return step_models(rise_s, settling_s, None if beside is None else as_response([beside]), band=band)


def _check_band(band: float) -> None:
    if not 0.0 < band < 1.0:
        raise SettingError(f"{option('band')}: {100.0 * band:g} % of the change; it must be above 0 and below 100")


def _levels(recording: Recording) -> Recording:
    """Of a run that drove levels, those alone: it goes back to rest slowly, which is no step."""
    parts = [part for part in recording.meta.get("parts", ()) if part.get("kind") == "level"]
    if not parts:
        return recording
    first = int(parts[0]["first"])
    return recording.rows(first, int(parts[-1]["first"]) + int(parts[-1]["count"]) - first)


def _of_step(one: MeasuredStep, unit: str, response: FrequencyResponse | None, band: float) -> StepModels:
    label, times = f"{one.from_command:.4g} → {one.to_command:.4g}", (one.figures.rise_s, one.figures.settling_s)
    stds = (one.std.rise_s, one.std.settling_s)
    try:
        made = step_models(*times, response, band=band, std_s=stds)
    except InputError as error:
        made = StepModels(*times, np.zeros(0, dtype=np.complex128), (), (Note("{why}", why=str(error)),), std_s=stds)
    made = replace(made, notes=(*made.notes, *one.still_moving(unit)))
    return replace(made, label=label)


def corners_of(table: ResponseTable, poles: int, zeros: int = 0) -> AsymptoticFit:
    """Real poles and zeros from the magnitude of a frequency response: eqs 3.1 to 3.6 of the EFC thesis."""
    return asymptotic_bode(as_response([table]), poles, zeros)


_TURN = 2.0 * math.pi


def corners_text(fit: AsymptoticFit) -> str:
    """Corners, gain and misfits, for a terminal."""
    rows = [f"gain at rest {fit.model.dc_gain:.6g}, rms error of the magnitude {fit.rms_db:.3g} dB"]
    for what, rates, stds in (("pole", fit.poles_rad_s, fit.pole_stds), ("zero", fit.zeros_rad_s, fit.zero_stds)):
        for rate, std in zip(rates.tolist(), stds.tolist(), strict=True):
            rows.append(f"  {what} {rounded(rate, std)} {width(std)} rad/s ({rounded(rate / _TURN, std / _TURN)} Hz)")
    rows.append(f"  J of eq. 3.6 {fit.asymptotic_misfit:.3g}, V of eq. 3.1 {fit.misfit:.3g} per line")
    rows.append("  note: the magnitude tells no zero from its mirror image, no dead time, and no resonance")
    return "\n".join(rows)


# -- recursive least squares -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class OnlineEstimate:
    """What recursive least squares found in a recording.

    Attributes:
        estimator: after the last sample.
        path: parameters after each sample, shape (n, parameters).
        time_s: stamps, shape (n,).
        excitation_order: how many parameters the command can tell apart in steady state.
    """

    estimator: RecursiveLeastSquares
    path: Array
    time_s: Array
    excitation_order: int

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        found, excitation = self.estimator, self.estimator.excitation
        rows = zip(found.form.names, found.parameters.tolist(), found.std.tolist(), strict=True)
        poles = [{"re": float(p.real), "im": float(p.imag)} for p in found.poles]
        return plain({
            "schema": "hil.online-estimate/1",
            "parameters": [{"name": n, "value": value, "std": std, "unit": "1"} for n, value, std in rows],
            "numerator": found.numerator, "denominator": found.denominator, "poles": poles,
            "noise_std": found.noise_std, "samples": found.samples,
            "informed": excitation.informed, "asked": excitation.asked, "unknown": list(excitation.unknown),
            "excitation_order": self.excitation_order,
        })  # fmt: skip

    def as_text(self) -> str:
        """As lines for a terminal."""
        found, excitation = self.estimator, self.estimator.excitation
        directions = f"{excitation.informed} of {excitation.asked} directions identifiable"
        rows = [f"{found.samples} samples, noise {found.noise_std:.3g}, {directions}"]
        rows += [
            f"  {name:4} {rounded(value, std):>12} {width(std)}"
            for name, value, std in zip(found.form.names, found.parameters, found.std, strict=True)
        ]
        largest = float(np.abs(found.poles).max()) if len(found.poles) else 0.0
        rows.append(f"  largest pole |z| {largest:.4g}{'' if largest < 1.0 else ': unstable'}")
        if not excitation.enough:
            rows.append(
                f"  note: the command tells {self.excitation_order} parameters apart in steady state, "
                f"{excitation.asked} are asked; unknown: {', '.join(excitation.unknown) or 'combinations of them'}"
            )
        return "\n".join(rows)

    def write_path(self, path: Path) -> None:
        """Write the parameters after each sample as CSV."""
        heads = ("time [s]", *(f"{name} [1]" for name in self.estimator.form.names))
        write_table(heads, np.column_stack((self.time_s, self.path)).tolist(), path)


def estimated_online(
    recording: Recording,
    input_name: str,
    output_name: str,
    form: ArxForm,
    *,
    memory: float = 1.0,
    forgetting: Forgetting = "directional",
    prior_std: float = 1e3,
) -> OnlineEstimate:
    """Recursive least squares over a recording, sample by sample: eqs 3.7 to 3.15 of the EFC thesis.

    Raises:
        FileError: uneven stamps, or input and output stamped apart.
        InputError: what `RecursiveLeastSquares` refuses.
    """
    recording = measured_rows(recording, (input_name, output_name))
    time_s = recording.time_s
    intervals = np.diff(time_s)
    if np.ptp(intervals) > SAME_STAMP * float(np.median(intervals)):
        raise FileError(f"{recording.name}: its stamps are uneven; recursive least squares needs one interval")
    command, output = recording.values(input_name), recording.values(output_name)
    estimator = RecursiveLeastSquares(form, memory, forgetting, prior_std)
    path = estimator.run(command, output)
    order = excitation_order(command, len(form.names), form.difference)
    return OnlineEstimate(estimator, path, time_s, order)


# -- eq. 4.1 -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ThesisError:
    """How a response differs from a reference, as the EFC thesis counts it, and what its section 4.1.3 calls that.

    Attributes:
        level: low (1.4 A) or high (1.6 A).
        error: of eq. 4.1, in psi·√samples/s: it grows with the root of the rate.
        rms: root mean square error, in psi, which does not.
        duration_s, rate_hz: that were taken; the thesis states neither.
        crisp: class by the thresholds of section 4.1.3.
        memberships: degrees of eqs 4.4 to 4.7. `levels`: of eqs 4.2 and 4.3.
    """

    level: Level
    error: float
    rms: float
    duration_s: float
    rate_hz: float
    crisp: str
    memberships: Mapping[str, float]
    levels: Mapping[str, float]

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        return plain({
            "schema": "hil.thesis-error/1", "level": self.level, "error_4_1": self.error, "rms_psi": self.rms,
            "duration_s": self.duration_s, "rate_hz": self.rate_hz, "crisp_class": self.crisp,
            "error_memberships": dict(self.memberships), "current_memberships": dict(self.levels),
        })  # fmt: skip

    def as_text(self) -> str:
        """As lines for a terminal."""
        degrees = ", ".join(f"{name} {degree:.2f}" for name, degree in self.memberships.items() if degree)
        levels = ", ".join(f"{name} {degree:.2f}" for name, degree in self.levels.items() if degree)
        return "\n".join((
            f"{self.level} current: eq. 4.1 {self.error:.4g}, rms {self.rms:.4g} psi",
            f"  by the thresholds of section 4.1.3: {self.crisp}",
            f"  degrees of eqs 4.4 to 4.7: {degrees or 'none'}; of eqs 4.2 and 4.3: {levels}",
            f"  note: {self.caveat}",
        ))  # fmt: skip

    @property
    def caveat(self) -> Note:
        """What was assumed, and what the thesis does not publish."""
        severe_psi = THRESHOLDS[self.level][1] * math.sqrt(self.duration_s / self.rate_hz)
        return Note(
            "taken over {duration_s:g} s at {rate_hz:g} Hz, where {severe_psi:.2g} psi rms are already called severely "
            "malfunctioned. Eq. 4.1 grows with the root of the rate; the thesis states neither time nor rate. Its "
            "fuzzy rule base and table 4.2 are not published, so there is no fuzzy class",
            duration_s=self.duration_s, rate_hz=self.rate_hz, severe_psi=severe_psi,
        )  # fmt: skip

    @property
    def sentence(self) -> Note:
        """All of it in one sentence or two."""
        degrees = {name: degree for name, degree in self.memberships.items() if degree}
        listed = tuple(Note("{of} {degree:.2f}", of=Note(name), degree=degree) for name, degree in degrees.items())
        return Note(
            "{level} current: eq. 4.1 {error:.4g} ({rms_psi:.3g} psi rms), by the thresholds of section 4.1.3 {crisp}, "
            "degrees of eqs 4.4 to 4.7 {degrees}; {caveat}",
            level=Note(self.level), error=self.error, rms_psi=self.rms, crisp=Note(self.crisp),
            degrees=listed or (Note("none"),), caveat=self.caveat,
        )  # fmt: skip


def thesis_error(measured: Array, reference: Array, rate_hz: float, level: Level) -> ThesisError:
    """Eq. 4.1 between two responses on the same stamps, in psi, shape (n,) each.

    Raises:
        InputError: of different lengths, or empty.
    """
    if len(measured) != len(reference) or not len(measured):
        raise InputError(f"eq. 4.1: {len(measured)} samples and a reference of {len(reference)}; they must be as many")
    duration_s = len(measured) / rate_hz
    return thesis_class(error_4_1(measured, reference, duration_s), level, duration_s, rate_hz)


def thesis_class(error: float, level: Level, duration_s: float, rate_hz: float) -> ThesisError:
    """What the thesis calls an error of eq. 4.1 that was taken over a time at a rate."""
    degrees = dict(zip(_MEMBERSHIPS, error_memberships(error), strict=True))
    return ThesisError(
        level, error, error * math.sqrt(duration_s / rate_hz), duration_s, rate_hz, crisp_class(error, level), degrees,
        {str(name): degree for name, degree in current_memberships(CLASSIFIED_CURRENT_A[level]).items()},
    )  # fmt: skip


# -- loops -------------------------------------------------------------------------------------------------


def linear_of(model: Model, name: str) -> TransferFunction:
    """The transfer function of a model.

    Raises:
        InputError: a model of another plant, with effects, or with a bent static curve.
    """
    if model.plant != _LINEAR or model.effects:
        raise InputError(f"{name}: no transfer function; a model of the plant '{_LINEAR}' without effects is one")
    return straight(model.values, name)


def ratio(numerator: Sequence[float], denominator: Sequence[float]) -> TransferFunction:
    """A transfer function from coefficients, highest power first."""
    from hil.physics.transfer_function import transfer_function

    return transfer_function(list(numerator), list(denominator))


def channels_of(recording: Recording, input_name: str = "", output_name: str = "") -> tuple[str, str]:
    """Names of command and response: those given, else the roles that a run declares, else the only two there are.

    Raises:
        FileError: nobody says which they are.
    """
    roles = recording.meta.get("roles", {})
    names = list(recording.channels)
    both = names if len(names) == 2 else ["", ""]
    given = input_name or str(roles.get("command", "")) or both[0]
    answer = output_name or str(roles.get("response", "")) or both[1]
    if not given or not answer:
        raise FileError(
            f"{recording.name}: which channel is the command and which the response? Say {option('input', 'NAME')} and "
            f"{option('output', 'NAME')}; there are: {listed(names)}"
        )
    return recording.channel(given).name, recording.channel(answer).name


def error_between(
    measured: Recording, reference: Recording, level: Level, output_name: str = "pressure"
) -> ThesisError:
    """Eq. 4.1 between two recordings on the same stamps, as far as both go.

    Raises:
        FileError: they have different intervals.
    """
    for one in (measured, reference):
        if len(measured_rows(one, (output_name,))) < len(one):
            raise FileError(f"{'; '.join(one.meta[INVALID_SAMPLES])}: eq. 4.1 compares sample by sample")
    pressure, good = aligned((measured, reference), output_name, "psi")
    return thesis_error(pressure, good, 1.0 / measured.interval_s, level)


def aligned(recordings: Sequence[Recording], output: str, unit: str) -> Array:
    """The channel of every recording, as far as all go, shape (recordings, n).

    Raises:
        FileError: they have different intervals.
    """
    first = recordings[0]
    for one in recordings[1:]:
        if abs(one.interval_s - first.interval_s) > SAME_STAMP * first.interval_s:
            raise FileError(
                f"{one.name}: a sample every {one.interval_s:g} s, and every {first.interval_s:g} s in {first.name}; "
                "they are compared sample by sample"
            )
    shared = min(map(len, recordings))
    return np.array([one.values(output, unit)[:shared] for one in recordings])


# -- figure 17 ---------------------------------------------------------------------------------------------


def composed(curve: Path, dynamics: Model) -> Model:
    """A flow curve and dynamics as one model: section 8 of the HPV41 paper.

    Args:
        curve: run of `flow_curve`, or a table of it as CSV.
        dynamics: a model of the plant `transfer-function`, or of a valve whose orifice the curve replaces.
    """
    levels = flow_curve_of(curve)
    if dynamics.plant == _LINEAR:
        linear = linear_of(dynamics, "the dynamics")
        made = curve_model(levels.command, levels.flow, linear, levels.input, levels.output)
    else:
        units = (split_heading(heading)[1] for heading in (levels.input, levels.output))
        made = with_measured_curve(levels.command, levels.flow, dynamics, *units)
    return replace(made, origin={"curve": str(curve), "dynamics": dict(dynamics.origin)})


@dataclass(frozen=True, slots=True)
class FlowCurve:
    """A steady curve: levels of the command and the response between its branches, shape (n,), and their headings.

    `simulated`: whether it is of a simulated valve; None where nobody knows.
    """

    command: Array
    flow: Array
    input: str
    output: str
    simulated: bool | None = None


def flow_curve_of(path: Path) -> FlowCurve:
    """The flow curve of a run, or of a CSV: command first, then one column, or `rising` and `falling`.

    Raises:
        FileError: no flow curve in it.
    """
    if path.is_dir():
        from hil.session.kept_results import results_of_run

        results = results_of_run(path)
        curves = [one for one in results.curves if one.name == "flow_curve"]
        if not curves:
            raise FileError(f"{path}: the run measured no flow curve; `hil run flow_curve` does")
        roles = read_recording(path).meta["roles"]
        heads = [f"{column.name} [{column.unit}]" for column in curves[0].columns]
        rows = np.array(curves[0].rows, dtype=np.float64)
        found = _middle_of_branches(path, heads, rows)
        unit_in, unit_out = (split_heading(text)[1] for text in (found.input, found.output))
        heads = [f"{roles[role]} [{unit}]" for role, unit in (("command", unit_in), ("response", unit_out))]
        return replace(found, input=heads[0], output=heads[1], simulated=results.simulated)
    try:
        heads, *lines = list(csv.reader(read_text(path).splitlines()))
        return _middle_of_branches(path, heads, np.array(lines, dtype=np.float64))
    except (OSError, ValueError, UnitError) as error:
        raise FileError(f"{path}: not a flow curve as CSV, `command [%],flow [l/min]` and rows: {error}") from error


def _middle_of_branches(path: Path, heads: Sequence[str], rows: Array) -> FlowCurve:
    """The middle between the branches, levels rising; a column of time is none of them."""
    kept = [k for k, head in enumerate(heads) if split_heading(head)[1] not in _TIMES]
    heads, rows = [heads[k] for k in kept], rows[:, kept] if rows.ndim == 2 else rows
    names = [split_heading(head)[0] for head in heads]
    picked = [names.index(name) for name in ("rising", "falling") if name in names] or [1]
    if rows.ndim != 2 or rows.shape[1] <= max(picked) or not np.all(np.isfinite(rows[:, [0, *picked]])):
        raise FileError(f"{path}: not a flow curve: a command and a response are needed on every row")
    order = np.argsort(rows[:, 0], kind="stable")
    if len(order) < 2 or np.any(np.diff(rows[order, 0]) <= 0.0):
        raise FileError(f"{path}: not a flow curve: at least two levels of '{heads[0]}' are needed, each once")
    flow = rows[order][:, picked].mean(axis=1)
    return FlowCurve(rows[order, 0], flow, heads[0], heads[1])


def model_to_linearise(path: Path, changed: Sequence[str] = ()) -> Model:
    """A model file, an installed model or a plant at its typical values, with parameters changed (`coulomb=0`).

    Raises:
        SettingError: a parameter that it does not have, no number, or one that it cannot have.
    """
    installed = path.suffix == ".json" or path.name in models()
    model = load_model(path) if installed else typical_model(str(path))
    values = dict(model.parameters)
    for name, text in pairs("--set", changed, "coulomb=0").items():
        try:
            values[name] = replace(values[name], value=float(text))
        except KeyError:
            raise SettingError(f"--set {name}: {model.plant} has no such parameter: {', '.join(values)}") from None
        except ValueError:
            raise SettingError(f"--set {name}={text}: not a number") from None
        if refusal := model.definition.parameter(name).refusal(values[name].value):
            raise SettingError(f"--set {name}={text}: {refusal}")
    return replace(model, parameters=values)
