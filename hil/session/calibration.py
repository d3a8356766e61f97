"""The points of a calibration: an input is averaged, an output driven through the guard, while a reference is read."""

from __future__ import annotations

import datetime as dt
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hil.bench.audit import on_the_trail
from hil.bench.ending import accounted, word_of_this_process
from hil.bench.file import CalibrationLine
from hil.bench.find import own_bench
from hil.bench.manual.certificate import read_certificate
from hil.bench.manual.fit import Line, Point, fit_line
from hil.bench.manual.inputs import inputs_of
from hil.bench.manual.write import write_calibration
from hil.bench.open import open_rig
from hil.bench.read import BenchFile
from hil.errors import LinkError, SettingError
from hil.record.recording import Array
from hil.record.run_folder.progress import quiet
from hil.rig import Rig
from hil.safety.interrupt import terminable
from hil.safety.operator import Operator
from hil.safety.outputs import Outputs
from hil.session.labels import Labels
from hil.session.manual_output import HELD
from hil.session.preload import preload
from hil.session.procedure import load_procedure
from hil.session.run import evaluate_run
from hil.signals.batch_mean import batch_mean


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Slope and offset of a channel against a reference: the points, the line through them, the entry for the bench."""

    file: BenchFile
    channel: str
    points: tuple[Point, ...]
    line: Line
    entry: CalibrationLine

    def write(self) -> None:
        """Write it into the bench file; its comments stay, and the values before in a history.

        Raises:
            FileError: it is the bench of a package.
        """
        own_bench(self.file.path)
        write_calibration(self.file, self.channel, self.entry)


def calibrated(
    file: BenchFile, channel: str, points: Sequence[Point], reference: str, std: float | None, operator: str,
    valid_days: int, date: dt.date | None = None,
) -> Calibrated:  # fmt: skip
    """The line through the points, as an entry of the bench; `std`: standard uncertainty of a reference reading."""
    line, date = fit_line(points, std), date or dt.datetime.now(dt.UTC).date()
    entry = CalibrationLine(
        slope=_short(line.slope, line.slope_interval), offset=_short(line.offset, line.offset_interval),
        uncertainty=float(f"{line.uncertainty:.3g}"), date=date, due=date + dt.timedelta(days=valid_days),
        source=reference, operator=operator, lag_s=None,
    )  # fmt: skip
    return Calibrated(file, channel, tuple(points), line, entry)


def certified(
    file: BenchFile, channel: str, path: Path, table: str, operator: str, valid_days: int
) -> Calibrated:  # fmt: skip
    """The line through the points of a certificate, as an entry of the bench; no terminal is opened.

    Where the certificate tells values of the channel itself in place of what its terminal reads, they were made by the
    line that the bench has now.

    Raises:
        FileError: no such certificate or table, or a quantity that the channel does not have.
    """
    entry, certificate = file.bench.channels[channel], read_certificate(path)
    raw_unit = file.terminal_of(entry).unit
    unit, stated = certificate.points(table, entry.unit, (raw_unit, entry.unit))
    points = [
        Point(p.indicated if unit == raw_unit else entry.line.raw_at(p.indicated), 0.0, p.reference) for p in stated
    ]
    std = max((p.std for p in stated if p.std is not None), default=None)
    return calibrated(file, channel, points, certificate.source, std, operator, valid_days, certificate.date)


def targets_of(file: BenchFile, channel: str, count: int, between: tuple[float, float] | None) -> list[float]:
    """Places of an output, evenly from end to end: of its limits where not said."""
    entry = file.bench.channels[channel]
    terminal = file.terminal_of(entry)
    low, high = entry.range_at(terminal)
    if entry.limits is not None:
        low, high = entry.limits.low, entry.limits.high
    return [float(target) for target in np.linspace(*(between or (low, high)), count)]


def _short(value: float, interval: float) -> float:
    """As many digits as a hundredth of its interval; the line does not notice what is left out."""
    places = 2 - math.floor(math.log10(interval)) if interval > 0.0 else 12
    return round(value, min(places, 12))


Asked = Callable[[str], None]
"""Poses a question to the operator."""
Answered = Callable[[], float | None]
"""What the reference reads, in the channel's unit; None until it was typed."""

_AVERAGE_S, _PIECE_S, _AGAIN_S = 1.0, 0.1, 0.05


def input_points(file: BenchFile, channel: str, count: int, ask: Asked, answered: Answered) -> list[Point]:
    """An input at so many places: after each answer it is averaged over a second. No output is opened.

    Raises:
        SettingError: the channel is an output, or had no measurement at a point.
        LinkError: its device does not answer.
    """
    unit = file.bench.channels[channel].unit
    points = []
    with terminable(), inputs_of(file, [channel]) as looked:
        for number in range(1, count + 1):
            ask(f"point {number} of {count}: bring it to its place, then type what the reference reads [{unit}]: ")
            while (reference := answered()) is None:
                time.sleep(_AGAIN_S)
            looked.followed[channel].forget()  # who answers at once, as a script does, has moved it only now
            (reading,) = looked.look(_AVERAGE_S)
            if looked.failures:
                raise LinkError("; ".join(looked.failures.values()))
            raw = looked.followed[channel].raw
            if not np.isfinite(raw).all() or reading.state.startswith(("over-range", "open wire", "no measurement")):
                raise SettingError(f"'{channel}' at point {number}: {reading.state}; nothing was written")
            mean, std = batch_mean(raw)
            points.append(Point(mean, std if std is not None else float(np.std(raw)), reference))
    return points


def output_points(
    file: BenchFile, channel: str, targets: Sequence[float], ask: Asked, answered: Answered, out: Path,
    output_states: Outputs, labels: Labels,
) -> list[Point]:  # fmt: skip
    """An output at each target, held there through the guard until the reference was read; recorded as a run.

    Raises:
        RangeError: a target is beyond the limits; nothing was driven.
        HardwareError: as every run.
    """
    entry = file.bench.channels[channel]
    procedure = load_procedure("jog")
    if not file.is_simulated:
        preload(procedure.run)
    about = {"procedure": procedure.name, "settings": {}, "commanding": channel, **labels.about}
    points = []
    with (
        accounted(output_states),
        terminable(),
        open_rig(
            file,
            out,
            about,
            quiet,
            output_states=output_states,
            commanding=channel,
            operator=Operator(),
            within=on_the_trail(file, out, about),
            word=word_of_this_process(),
        ) as rig,  # fmt: skip
    ):
        for number, target in enumerate(targets, start=1):
            rig.check(np.append(rig.way_to(target), target))
            rig.ramp_to(target)
            place = f"output at {target:g} {entry.unit}"
            ask(f"point {number} of {len(targets)}, {place}: the reference reads [{entry.unit}]: ")
            reference = _held_until_answered(rig, target, answered, file.is_simulated)
            points.append(Point(float(entry.line.raw_at(target)), 0.0, reference))
            rig.note("reference read", target=target, reference=reference)
    evaluate_run(procedure, out)
    return points


def _held_until_answered(rig: Rig, target: float, answered: Answered, is_virtual: bool) -> float:
    """Keep the output there until somebody answers; virtual time stands still meanwhile."""
    references: list[float] = []
    part = {"kind": HELD, "channel": rig.command.name, "to": target, "unit": rig.command.unit}
    if is_virtual:
        rig.hold(_AVERAGE_S, part=part)
        while (typed := answered()) is None:
            time.sleep(_AGAIN_S)
        return typed
    samples = max(1, round(_PIECE_S * rig.rate_hz))

    def pieces() -> Iterator[Array]:
        while not references:
            if (typed := answered()) is not None:
                references.append(typed)
            yield np.full(samples, target)

    for _ in rig.stream(pieces(), part=part):
        pass
    return references[0]
