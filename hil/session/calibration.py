"""The points of a calibration: an input is averaged, an output driven through the guard, while a reference is read."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from hil.bench.audit import on_the_trail
from hil.bench.ending import accounted
from hil.bench.hand.fit import Point
from hil.bench.hand.inputs import inputs_of
from hil.bench.open import open_rig
from hil.bench.read import BenchFile
from hil.errors import LinkError, SettingError
from hil.record.recording import Array
from hil.rig import Rig
from hil.safety.interrupt import terminable
from hil.safety.operator import Operator
from hil.safety.outputs import Outputs
from hil.session.by_hand import HELD
from hil.session.labels import Labels
from hil.session.preload import preload
from hil.session.procedure import load_procedure
from hil.session.run import evaluate_run
from hil.signals.batch_mean import batch_mean

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
            while (told := answered()) is None:
                time.sleep(_AGAIN_S)
            (reading,) = looked.look(_AVERAGE_S)
            if looked.failures:
                raise LinkError("; ".join(looked.failures.values()))
            raw = looked.raw(channel)
            if not np.isfinite(raw).all() or reading.state.startswith(("over-range", "open wire", "no measurement")):
                raise SettingError(f"'{channel}' at point {number}: {reading.state}; nothing was written")
            mean, std = batch_mean(raw)
            points.append(Point(mean, std if std is not None else float(np.std(raw)), told))
    return points


def output_points(
    file: BenchFile, channel: str, targets: Sequence[float], ask: Asked, answered: Answered, out: Path, known: Outputs,
    labels: Labels,
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
        accounted(known),
        terminable(),
        on_the_trail(file, out, about),
        open_rig(
            file, out, about, lambda _done, _text: None, known=known, commanding=channel, operator=Operator()
        ) as rig,
    ):
        for number, target in enumerate(targets, start=1):
            rig.check(np.append(rig.way_to(target), target))
            rig.ramp_to(target)
            place = f"output at {target:g} {entry.unit}"
            ask(f"point {number} of {len(targets)}, {place}: the reference reads [{entry.unit}]: ")
            told = _held(rig, target, answered, file.is_simulated)
            points.append(Point(float(entry.line.raw_at(target)), 0.0, told))
            rig.note("reference read", target=target, reference=told)
    evaluate_run(procedure, out)
    return points


def _held(rig: Rig, target: float, answered: Answered, is_virtual: bool) -> float:
    """Keep the output there until somebody answers; virtual time stands still meanwhile."""
    told: list[float] = []
    part = {"kind": HELD, "channel": rig.command.name, "to": target, "unit": rig.command.unit}
    if is_virtual:
        rig.hold(_AVERAGE_S, part=part)
        while (typed := answered()) is None:
            time.sleep(_AGAIN_S)
        return typed
    samples = max(1, round(_PIECE_S * rig.rate_hz))

    def pieces() -> Iterator[Array]:
        while not told:
            if (typed := answered()) is not None:
                told.append(typed)
            yield np.full(samples, target)

    for _ in rig.stream(pieces(), part=part):
        pass
    return told[0]
