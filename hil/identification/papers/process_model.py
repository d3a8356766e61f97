"""Process models from recordings in time: gain, one to three lags, an integrator, a dead time, a zero.

K·(1 + T_z·s)·e^(−s·T_d) / (s^I·(1 + T₁s)·(1 + 2ζTs + T²s²)), as a simulation of its own, not one step ahead. Between
samples the command is held, and the model is exact for that, parts of a sample in the dead time included. Before
its first sample the command is taken to have stood where it begins. Gain, zero, level, and the drift of an
integrator enter linearly and are solved for; the times are searched. What is left open is chosen by evidence,
as in `hil.identification.grey_box.structure`, but never beyond what the command excites.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.errors import InputError
from hil.identification.grey_box.estimate import Estimate, Unknown, estimate
from hil.identification.grey_box.structure import independent
from hil.identification.uncertainty.evidence import VERY_STRONG, simplest_good
from hil.identification.uncertainty.fit import fit_percent
from hil.language.note import Note
from hil.physics.transfer_function import TransferFunction, transfer_function
from hil.record.recording import Array, Mask, Recording
from hil.signals.interval import COVERED
from hil.signals.recursion import filtered

MOST_LAGS = 3

_MOST_ORDER = 12  # up to which the excitation is counted
_COUNTED = (60, 400)  # samples of the command from which it is counted: far apart for slow lines, near for fast ones
_TRIAL_TIMES = 5
_SEARCH_EVALUATIONS = 12
_REFINED_EVALUATIONS = 40
_BLOCKS = 5
_MOST_JUDGED = 5
_DOUBTFUL = 0.5  # standard uncertainty of a time's logarithm, or share of the gain, above which nothing is known
_LEAST_SAMPLES = 50


@dataclass(frozen=True, slots=True)
class ProcessForm:
    """Which terms a process model has; `lags` is 1 to 3, the second and third may oscillate."""

    lags: int
    integrator: bool = False
    dead_time: bool = False
    zero: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.lags <= MOST_LAGS:
            raise InputError(f"process model with {self.lags} lags; allowed are 1 to {MOST_LAGS}")
        if self.zero and self.lags + self.integrator < 2:
            raise InputError("process model: a zero needs two poles, lags or integrator")

    @property
    def name(self) -> str:
        """As customary: P2DI has two lags, a dead time and an integrator; Z is a zero."""
        return f"P{self.lags}{'D' * self.dead_time}{'I' * self.integrator}{'Z' * self.zero}"

    @property
    def unknowns(self) -> int:
        """Of the dynamics: gain, times, damping; level and drift are not counted."""
        return 1 + self.lags + self.dead_time + self.zero


@dataclass(frozen=True, slots=True)
class Tried:
    """A form that was fitted.

    Attributes:
        bic: Bayesian information criterion, smaller is better.
        fit_percent: 100·(1 − ‖y − ŷ‖/‖y − mean y‖), of a free run.
        held_out: root mean square error on stretches left out of the fit, in the output's unit; NaN where the
            criterion alone ruled the form out.
    """

    form: ProcessForm
    bic: float
    fit_percent: float
    held_out: float


@dataclass(frozen=True, slots=True)
class ProcessFit:
    """A process model with its uncertainty.

    Attributes:
        form, model: the model; an integrator is a pole at 0.
        gain: K, in output per command, per second with an integrator.
        values: "gain", "time" (T₁), "pair_time" (T), "damping" (ζ), "dead_time", "zero_time" (T_z), those that the
            form has. `std`: standard uncertainty of each, infinite where the data cannot tell.
        drift_per_s: of the output at the command's first value, with an integrator; else 0.
        excitation: numbers that the command can tell apart, mean aside, up to 12.
        simulated: free run, shape (n,). `residuals`: measured minus simulated, of the samples that were judged.
        tried: every form, best evidence first.
        notes: what the reader should know.
    """

    form: ProcessForm
    model: TransferFunction
    values: dict[str, float]
    std: dict[str, float]
    drift_per_s: float
    excitation: int
    fit_percent: float
    simulated: Array
    residuals: Array
    tried: tuple[Tried, ...] = ()
    notes: tuple[Note, ...] = ()

    @property
    def gain(self) -> float:
        """K."""
        return self.values["gain"]

    @property
    def determined(self) -> bool:
        """Whether the data determine every number of the dynamics."""
        return not self.undetermined

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the numbers that are less certain than a factor of 1.6."""
        return tuple(name for name in self.values if not _known(name, self.values[name], self.std[name]))

    def summary(self) -> str:
        """Values with 95 % intervals, fit and notes, for a terminal."""
        rows = [f"{self.form.name}: fit {self.fit_percent:.2f} % of the same data"]
        for name, value in self.values.items():
            rows.append(f"  {name:10} {value:12.6g} ± {COVERED * self.std[name]:.2g}")
        return "\n".join([*rows, *(f"  note: {note}" for note in self.notes)])


def process_model(
    recording: Recording,
    input_name: str,
    output_name: str,
    *,
    lags: int | None = None,
    integrator: bool | None = None,
    dead_time: bool | None = None,
    zero: bool | None = False,
    skip_s: float = 0.0,
) -> ProcessFit:
    """Fit a process model; what is None is chosen by evidence.

    Args:
        recording: evenly sampled.
        input_name: channel of the command.
        output_name: channel of the response.
        lags: 1 to 3.
        integrator: whether there is one: a response that goes on while the command stands.
        dead_time: whether there is one.
        zero: whether there is one.
        skip_s: at the beginning, simulated but not judged: what the state before the record has left.

    Raises:
        InputError: too few samples, a command or a response that stands still, or a form that cannot be.
    """
    record = _record(recording, input_name, output_name, skip_s)
    forms = _forms(lags, integrator, dead_time, zero)
    supported = [form for form in forms if form.unknowns <= record.excitation]
    if not supported and len(forms) > 1:
        simplest = min(form.unknowns for form in forms)
        raise InputError(
            f"{recording.name}: '{input_name}' tells {record.excitation} numbers apart, the simplest process model "
            f"has {simplest}; add a frequency, steps or a binary sequence"
        )
    fitted: list[_Fitted] = []
    for form in supported or forms:
        fitted.append(_best(record, form, fitted))
    return _chosen(record, fitted, tuple(form for form in forms if form not in supported))


def excitation(command: Array) -> int:
    """Numbers of a plant that a command can tell apart in steady state: two for each sine, mean aside, up to 12."""
    from hil.identification.papers.recursive_least_squares import excitation_order

    spaced = [command[:: max(1, len(command) // samples)] for samples in _COUNTED]
    return max(excitation_order(values, _MOST_ORDER, difference=True) for values in spaced)


@dataclass(frozen=True, slots=True)
class _Record:
    """What is fitted: the command from its first value on, the output, and which samples count."""

    name: str
    interval_s: float
    command: Array
    output: Array
    judged: Mask
    excitation: int

    @property
    def length_s(self) -> float:
        return self.interval_s * len(self.output)

    def fit_percent(self, simulated: Array) -> float:
        return fit_percent(self.output[self.judged], simulated[self.judged])


@dataclass(frozen=True, slots=True)
class _Fitted:
    """A form at its best: logarithms of times and damping, the dead time, what was linear, and the free run."""

    form: ProcessForm
    found: Estimate
    linear: Array
    simulated: Array
    bic: float


def _record(recording: Recording, input_name: str, output_name: str, skip_s: float) -> _Record:
    command = recording.values(input_name)
    # on the stamps of the command, along straight lines where each sample was read at a time of its own
    output = np.interp(recording.time_s, recording.stamps(output_name), recording.values(output_name))
    judged = recording.time_s - recording.time_s[0] >= skip_s
    if np.count_nonzero(judged) < _LEAST_SAMPLES:
        raise InputError(
            f"{recording.name}: {np.count_nonzero(judged)} samples after {skip_s:g} s; a process model needs at least "
            f"{_LEAST_SAMPLES}"
        )
    for name, values in ((input_name, command), (output_name, output)):
        if np.ptp(values[judged]) == 0.0:
            raise InputError(f"{recording.name}: '{name}' stands still; nothing can be identified")
    order = excitation(command[judged])
    return _Record(recording.name, recording.interval_s, command - command[0], output, judged, order)


def _forms(lags: int | None, integrator: bool | None, dead_time: bool | None, zero: bool | None) -> list[ProcessForm]:
    """Every form that is left open, the simplest first."""

    def both(asked: bool | None) -> tuple[bool, ...]:
        return (False, True) if asked is None else (asked,)

    orders = range(1, MOST_LAGS + 1) if lags is None else (lags,)
    asked = [(n, i, d, z) for n in orders for i in both(integrator) for d in both(dead_time) for z in both(zero)]
    possible = [(n, i, d, z) for n, i, d, z in asked if n + i > 1 or not z]
    return sorted((ProcessForm(*one) for one in possible or asked), key=lambda form: form.unknowns)


def _best(record: _Record, form: ProcessForm, before: Sequence[_Fitted]) -> _Fitted:
    """The best fit of a form over its starts."""
    tries = [_fit(record, form, start, _SEARCH_EVALUATIONS, 1e-4) for start in _starts(record, form, before)]
    good = min(tries, key=lambda one: one.found.chi2)
    return _fit(record, form, good.found.named, _REFINED_EVALUATIONS, 1e-8)


def _fit(record: _Record, form: ProcessForm, start: dict[str, float], evaluations: int, tolerance: float) -> _Fitted:
    found = estimate(
        lambda values: _residuals(record, form, values)[0],
        _unknowns(record, form, start), max_evaluations=evaluations, tolerance=tolerance,
    )  # fmt: skip
    _, linear, simulated = _residuals(record, form, found.values)
    left = found.residuals[record.judged]
    count = independent(left)
    unknowns = len(found.values) + len(linear)
    floor = 1e-24 * float(np.var(record.output))
    bic = count * math.log(max(float(left @ left) / len(left), floor)) + unknowns * math.log(count)
    return _Fitted(form, found, linear, simulated, bic)


def _starts(record: _Record, form: ProcessForm, before: Sequence[_Fitted]) -> Iterator[dict[str, float]]:
    """Where to begin: the fits of simpler forms, or trial times between a sample and the record."""
    simpler = [one for one in before if one.form.integrator == form.integrator and one.form.lags <= form.lags]
    totals = [_total_s(one) for one in simpler[-2:]]
    if not totals:
        totals = np.geomspace(2.0 * record.interval_s, record.length_s / 5.0, _TRIAL_TIMES).tolist()
    late = (0.05, 0.4) if form.dead_time else (0.0,)
    for total_s in totals:
        for share in late:
            rest_s = max((1.0 - share) * total_s, record.interval_s / 10.0)
            made: dict[str, float] = {"dead_time": share * total_s} if form.dead_time else {}
            if form.lags == 1:
                yield {**made, "time": math.log(rest_s)}
            elif form.lags == 2:
                yield {**made, "pair_time": math.log(rest_s / 2.0), "damping": 0.0}
            else:
                yield {**made, "time": math.log(0.6 * rest_s), "pair_time": math.log(0.2 * rest_s), "damping": -0.3}


def _total_s(one: _Fitted) -> float:
    """Sum of lags and dead time: what the slow end of the response shows."""
    at = one.found.named
    pair_s = 2.0 * math.exp(at["damping"] + at["pair_time"]) if "damping" in at else 0.0
    return at.get("dead_time", 0.0) + (math.exp(at["time"]) if "time" in at else 0.0) + pair_s


def _unknowns(record: _Record, form: ProcessForm, start: dict[str, float]) -> list[Unknown]:
    low, high = math.log(record.interval_s / 20.0), math.log(20.0 * record.length_s)
    made = []
    if form.lags != 2:
        made.append(Unknown("time", "1", start["time"], low, high, 1.0))
    if form.lags > 1:
        made.append(Unknown("pair_time", "1", start["pair_time"], low, high, 1.0))
        made.append(Unknown("damping", "1", start["damping"], math.log(0.02), math.log(20.0), 1.0))
    if form.dead_time:
        longest_s = record.length_s / 4.0
        scale_s = max(start["dead_time"], record.interval_s)
        made.append(Unknown("dead_time", "s", start["dead_time"], 0.0, longest_s, scale_s))
    return made


def _residuals(record: _Record, form: ProcessForm, values: Array) -> tuple[Array, Array, Array]:
    """(measured minus simulated where judged, else 0; linear parameters; everything simulated)."""
    columns = _columns(record, form, values)
    size = np.sqrt(np.mean(columns**2, axis=0))
    size[size == 0.0] = 1.0
    solved = np.linalg.lstsq(columns[record.judged] / size, record.output[record.judged], rcond=None)[0] / size
    simulated: Array = columns @ solved
    return np.where(record.judged, record.output - simulated, 0.0), solved, simulated


def _columns(record: _Record, form: ProcessForm, values: Array) -> Array:
    """Responses of the unscaled model: to the command, to its change, level, ramp."""
    below, dead_s = _denominator(form, values)
    states = _held_response(below, record.command, record.interval_s, dead_s, 1 + form.zero)
    n = len(record.output)
    made = [*states, np.ones(n)]
    if form.integrator:
        made.append(np.linspace(0.0, record.length_s, n, endpoint=False))
    return np.column_stack(made)


def _denominator(form: ProcessForm, values: Array) -> tuple[Array, float]:
    """Coefficients of s^I·Π(1 + …) from the highest power down, and the dead time."""
    rest = values.tolist()
    below = np.ones(1)
    if form.lags != 2:
        below = np.convolve(below, [math.exp(rest.pop(0)), 1.0])
    if form.lags > 1:
        time_s, damping = math.exp(rest.pop(0)), math.exp(rest.pop(0))
        below = np.convolve(below, [time_s**2, 2.0 * damping * time_s, 1.0])
    if form.integrator:
        below = np.append(below, 0.0)
    return below, rest.pop(0) if form.dead_time else 0.0


def _held_response(below: Array, command: Array, interval_s: float, dead_s: float, outputs: int) -> list[Array]:
    """1/A(s) and s/A(s) times a held command, exactly, the dead time to parts of a sample.

    The states are taken to triangular form, where each is a first-order recursion of those below it: as exact as
    the exponential even for equal, slow or integrating poles, and compiled.
    """
    from scipy.linalg import schur

    whole = math.floor(dead_s / interval_s)
    late_s = dead_s - whole * interval_s
    step, given = _stepped(below, interval_s - late_s)
    first, before = _stepped(below, late_s)
    triangle, turn = schur(step @ first, output="complex")
    now, last = turn.conj().T @ given, turn.conj().T @ (step @ before)
    held = np.concatenate((np.zeros(min(whole, len(command))), command))[: len(command)]
    earlier = np.concatenate(([0.0], held[:-1]))
    states = np.zeros((len(triangle), len(command)), dtype=np.complex128)
    for i in range(len(triangle) - 1, -1, -1):
        driven = now[i] * held + last[i] * earlier + triangle[i, i + 1 :] @ states[i + 1 :]
        states[i] = filtered([0.0, 1.0], [1.0, -triangle[i, i]], driven)
    return [np.ascontiguousarray((turn[k] @ states).real) for k in range(outputs)]


def _stepped(below: Array, duration_s: float) -> tuple[Array, Array]:
    """Transition of (output, its rates …) over a time, and what a held unit command adds."""
    from scipy.linalg import expm

    n = len(below) - 1
    system = np.zeros((n + 1, n + 1))
    system[np.arange(n - 1), np.arange(1, n)] = 1.0
    system[n - 1, :n] = -below[:0:-1] / below[0]
    system[n - 1, n] = 1.0 / below[0]
    moved = expm(system * duration_s)
    return moved[:n, :n], moved[:n, n]


def _chosen(record: _Record, fitted: Sequence[_Fitted], refused: tuple[ProcessForm, ...]) -> ProcessFit:
    ranked = sorted(fitted, key=lambda one: one.bic)
    near = [one for one in ranked if one.bic <= ranked[0].bic + VERY_STRONG][:_MOST_JUDGED]
    errors = [_left_out(record, one) for one in near] if len(near) > 1 else [np.full(_BLOCKS, np.nan)]
    best = simplest_good(errors, [(one.form.unknowns, one.bic) for one in near]) if len(near) > 1 else 0
    held_out = [float(np.sqrt(np.mean(error))) for error in errors] + [math.nan] * (len(ranked) - len(near))
    each = zip(ranked, held_out, strict=True)
    tried = tuple(Tried(one.form, one.bic, record.fit_percent(one.simulated), error) for one, error in each)
    return _result(record, near[best], tried, refused)


def _left_out(record: _Record, one: _Fitted) -> Array:
    """Mean squared error in each stretch of the record, fitted without it."""
    judged = np.flatnonzero(record.judged)
    made = []
    for block in np.array_split(judged, _BLOCKS):
        used = record.judged.copy()
        used[block] = False
        without = _fit(replace(record, judged=used), one.form, one.found.named, _SEARCH_EVALUATIONS, 1e-4)
        made.append(float(np.mean((record.output - without.simulated)[block] ** 2)))
    return np.array(made)


def _result(record: _Record, one: _Fitted, tried: tuple[Tried, ...], refused: tuple[ProcessForm, ...]) -> ProcessFit:
    form = one.form
    linear_std, std = _uncertainty(record, one)
    below, dead_s = _denominator(form, one.found.values)
    gain = float(one.linear[0])
    values, spread = {"gain": gain}, {"gain": float(linear_std[0])}
    for (name, value), log_std in zip(one.found.named.items(), std.tolist(), strict=True):
        values[name] = value if name == "dead_time" else math.exp(value)
        spread[name] = log_std if name == "dead_time" else values[name] * log_std
    if form.zero:
        values["zero_time"] = float(one.linear[1]) / gain
        spread["zero_time"] = math.hypot(float(linear_std[1]), values["zero_time"] * float(linear_std[0])) / abs(gain)
    top = [float(one.linear[1]), gain] if form.zero else [gain]
    model = transfer_function(top, below, dead_s)
    made = ProcessFit(
        form, model, values, spread, float(one.linear[-1]) if form.integrator else 0.0, record.excitation,
        record.fit_percent(one.simulated), one.simulated, one.found.residuals[record.judged], tried,
    )  # fmt: skip
    return replace(made, notes=_notes(record, made, refused))


def _uncertainty(record: _Record, one: _Fitted) -> tuple[Array, Array]:
    """Standard uncertainties of the linear numbers and of the searched ones, all free together."""
    searched, linear = one.found.values, one.linear

    def residuals(values: Array) -> Array:
        made: Array = record.output - _columns(record, one.form, values[len(linear) :]) @ values[: len(linear)]
        return np.where(record.judged, made, 0.0)

    size = float(np.std(record.output)) / np.sqrt(np.mean(_columns(record, one.form, searched) ** 2, axis=0))
    free = [
        Unknown(f"linear {i}", "", value, -math.inf, math.inf, scale)
        for i, (value, scale) in enumerate(zip(linear.tolist(), size.tolist(), strict=True))
    ]
    both = estimate(residuals, [*free, *_unknowns(record, one.form, one.found.named)], max_evaluations=1)
    return both.std[: len(linear)], both.std[len(linear) :]


def _known(name: str, value: float, std: float) -> bool:
    """A dead time may be nothing; everything else must be told from nothing."""
    return math.isfinite(std) and (name == "dead_time" or std <= _DOUBTFUL * abs(value))


def _notes(record: _Record, fit: ProcessFit, refused: tuple[ProcessForm, ...]) -> tuple[Note, ...]:
    made = []
    if fit.form.unknowns > record.excitation:
        made.append(Note(
            "The command determines {count} numbers; {form} has {unknowns}. Other models fit these data as well: add a "
            "frequency, steps or a binary sequence.",
            count=record.excitation, form=fit.form.name, unknowns=fit.form.unknowns,
        ))  # fmt: skip
    elif refused:
        made.append(Note("The command determines {count} numbers. Models with more were not tried: {forms}.",
                         count=record.excitation, forms=tuple(form.name for form in refused)))  # fmt: skip
    if fit.undetermined:
        made.append(Note("Not determined by these data: {names}.", names=fit.undetermined))
    return tuple(made)
