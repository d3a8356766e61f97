"""What a diagnosis says: verdict, findings, evidence, and the pictures behind them."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from hil.diagnosis.evidence.coverage import Limit
from hil.diagnosis.evidence.locate import StageShare, Where
from hil.diagnosis.false_alarms import FalseAlarms
from hil.language.note import codes_of
from hil.record.plain import plain
from hil.record.recording import Array
from hil.record.simulated import SIMULATED, marked

SCHEMA = "hil.diagnosis/1"

Asked = Literal["changed", "left_out"]
DiagnosisVerdict = Literal["consistent", "parameter_change", "explained", "partly_explained", "unexplained"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number with its standard uncertainty (None when the data do not say) and unit.

    Attributes:
        was: what it is in the nominal model, where that has the effect already.
    """

    value: float
    std: float | None
    unit: str
    meaning: str = ""
    was: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """As in `diagnosis.json`."""
        document = {"value": self.value, "std": self.std, "unit": self.unit}
        return document if self.was is None else {**document, "from": self.was}


@dataclass(frozen=True, slots=True)
class Finding:
    """An effect that was left out of the nominal model, or that is in it and has changed.

    Attributes:
        name: of the effect. `title`: in the words of a fitter. `equation`: for the engineer.
        probability: that this, and not another of the library or none of it, is the cause.
        stage: of the chain, and `hook`, its place on the plant's page.
        parameters: by name. `where`: it shows. `sentence`: for the operator.
    """

    name: str
    title: str
    probability: float
    stage: str
    hook: str
    parameters: Mapping[str, Quantity]
    where: Where
    sentence: str
    equation: str
    source: str

    @property
    def is_new(self) -> bool:
        """Whether the nominal model lacks it."""
        return all(q.was is None for q in self.parameters.values())

    def as_dict(self) -> dict[str, Any]:
        """As in `diagnosis.json`: without what only a page says of it."""
        stated = ("name", "probability", "stage", "where", "sentence", "equation", "source")
        parameters = {name: q.as_dict() for name, q in self.parameters.items()}
        return {"parameters": parameters, **{name: getattr(self, name) for name in stated}}


@dataclass(frozen=True, slots=True)
class ChangedParameter:
    """A base parameter that is not what it was; `at_bound` warns that it went as far as it may."""

    name: str
    before: float
    after: float
    std: float | None
    unit: str
    meaning: str
    at_bound: bool = False

    @property
    def times(self) -> float:
        """How many times what it was; 1 where it was nothing."""
        return self.after / self.before if self.before else 1.0

    def as_dict(self) -> dict[str, Any]:
        """As in `diagnosis.json`."""
        stated = {name: getattr(self, name) for name in ("name", "std", "unit", "at_bound")}
        return {**stated, "from": self.before, "to": self.after}


@dataclass(frozen=True, slots=True)
class Candidate:
    """An explanation that was fitted: fit % and evidence (gain in log-likelihood) on data kept back."""

    name: str
    stage: str
    fit_held_out: float
    evidence: float
    probability: float
    unknowns: int = 0


@dataclass(frozen=True, slots=True)
class NextTest:
    """The experiment that would tell most: a procedure, its settings, why, and the bench time it takes."""

    procedure: str
    settings: Mapping[str, Any]
    why: str
    bench_s: float

    @property
    def command(self) -> str:
        """What is typed to run it, but for the bench."""
        settings = (f"--set {shlex.quote(f'{name}={_setting(value)}')}" for name, value in self.settings.items())
        return " ".join(["hil run", self.procedure, *settings])


@dataclass(frozen=True, slots=True)
class Fit:
    """Fit % of the nominal and corrected model, against the best that noise allows."""

    nominal: float
    corrected: float
    ceiling: float


@dataclass(frozen=True, slots=True)
class Strip:
    """A recording beside its simulations, all on the recording's stamps.

    Attributes:
        name: of the recording. `time_s`, `command`, `measured`, `nominal`, `corrected`: shape (n,); `measured` is NaN
            in stretches that were left out.
        noise_std: of the measured channel, in its unit.
    """

    name: str
    time_s: Array
    command: Array
    measured: Array
    nominal: Array
    corrected: Array
    noise_std: float

    def off(self, simulated: Array) -> Array:
        """Recording minus a simulation; 0 where the recording was left out."""
        return np.nan_to_num(self.measured - simulated)


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Amplitude spectrum of the residuals in one recording, in the output's unit.

    Attributes:
        lines_hz: frequencies that the command excites, where there are few; `odd_hz`, `even_hz`: their harmonics.
    """

    name: str
    frequency_hz: Array
    nominal: Array
    corrected: Array
    noise: float
    lines_hz: tuple[float, ...] = ()
    odd_hz: tuple[float, ...] = ()
    even_hz: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Left:
    """What the corrected model still leaves: its size beside the noise, where it is, what it depends on.

    `rms`, `nominal_rms`: beyond white noise, of the corrected model and of the nominal one as it is.
    `stages`: how much of it a free disturbance at each hook in turn would explain, best first, as curves over what
    passes there, by direction of motion.
    """

    share: float
    rms: float
    noise_std: float
    unit: str
    where: Where | None
    stages: tuple[StageShare, ...]
    nominal_rms: float


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The answer to the six questions (docs/explanation/diagnosis.md).

    Attributes:
        chain: (hook, stage) in order of the signal. `stage_shares`: as in `Left.stages`, for the nominal model.
        kept_back: what `held_out` was judged on.
        question: what was asked, and `why_asked`. `gate`: the statistic that says whether the unit has changed, where
            the model left more than noise. `left_out`: the other question's answer, where *changed* was asked.
        table: every hypothesis with its score, the best first; the first is the verdict (see `verdict.score`). None
            below the gate of *changed*.
        corrected_is: what the corrected model holds, and `why_corrected`. `work`: simulations, their samples and
            what was not searched for want of a larger budget.
        simulated: whether a recording is of a simulated valve.
        false_alarms: how often an unchanged unit is called changed, and where that was counted.
    """

    verdict: DiagnosisVerdict
    headline: str
    plant: str
    plant_title: str
    input: str
    output: str
    chain: tuple[tuple[str, str], ...]
    effects: tuple[Finding, ...]
    changed_parameters: tuple[ChangedParameter, ...]
    not_separable: tuple[tuple[str, ...], ...]
    next_test: NextTest | None
    candidates: tuple[Candidate, ...]
    held_out: Fit
    kept_back: str
    recordings: Mapping[str, Fit]
    mismatch: Where | None
    stage_shares: tuple[StageShare, ...]
    left: Left
    limits: tuple[Limit, ...]
    warnings: tuple[str, ...]
    false_alarms: FalseAlarms
    seconds: float
    strips: tuple[Strip, ...] = ()
    spectra: tuple[Spectrum, ...] = ()
    question: Asked = "left_out"
    why_asked: str = ""
    gate: Mapping[str, Any] | None = None
    table: Mapping[str, Any] | None = None
    left_out: Mapping[str, Any] | None = None
    corrected_is: Literal["nominal", "named"] = "nominal"
    why_corrected: str = ""
    work: Mapping[str, Any] = field(default_factory=dict)
    simulated: bool = False

    def as_dict(self) -> dict[str, Any]:
        """`diagnosis.json`: the contract's fields and more, without the pictures' arrays."""

        def stated(*names: str) -> dict[str, Any]:
            return {name: getattr(self, name) for name in names}

        return plain({
            "schema": SCHEMA,
            **stated(
                "question", "why_asked", "verdict", "headline", "plant", "effects", "changed_parameters",
                "not_separable", "next_test", "candidates",
            ),
            "effects": [f.as_dict() for f in self.effects],
            "changed_parameters": [c.as_dict() for c in self.changed_parameters],
            "fit": {"held_out": self.held_out, "kept_back": self.kept_back, "recordings": self.recordings},
            **stated(
                "left_out", "gate", "table", "corrected_is", "why_corrected", "mismatch", "left", "limits", "warnings",
            ),
            "false_alarm_rate": self.false_alarms.rate,
            "false_alarm_scope": self.false_alarms.scope,
            **stated("seconds", "work"),
            SIMULATED: self.simulated,
            "codes": codes_of(self._texts()),
        })  # fmt: skip

    def _texts(self) -> Iterator[str]:
        yield from (self.headline, self.why_asked, self.why_corrected, self.kept_back, self.false_alarms.scope)
        yield from (*self.warnings, *(f.sentence for f in self.effects))
        if self.next_test is not None:
            yield self.next_test.why

    def as_text(self) -> str:
        """For a terminal: the headline, findings, fits, and what to do next."""
        rows = [f"{marked(self.verdict, simulated=self.simulated)}: {self.headline}"]
        rows += [f"  {f.name} ({100 * f.probability:.0f} %): {f.sentence}" for f in self.effects]
        if len(self.not_separable):
            rows += [f"  cannot be told apart with these data: {', '.join(names)}" for names in self.not_separable]
        for name, fit in self.recordings.items():
            rows.append(f"  fit {fit.nominal:7.2f} → {fit.corrected:6.2f} % (noise allows {fit.ceiling:.2f} %)  {name}")
        if self.next_test is not None:
            rows.append(f"  next: {self.next_test.command}")
            rows.append(f"        {self.next_test.why} (bench time {self.next_test.bench_s:g} s)")
        return "\n".join([*rows, *(f"  warning: {text}" for text in self.warnings)])


def _setting(value: Any) -> str:
    return ",".join(f"{v:g}" for v in value) if isinstance(value, tuple | list) else str(value)
