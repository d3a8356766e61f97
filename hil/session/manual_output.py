"""Manual mode of one output: to a value, there for a while, and back when the run ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from hil.bench.read import BenchFile
from hil.errors import RangeError, SettingError, UnknownNameError
from hil.record.recording import Array
from hil.rig import Rig
from hil.session.procedure import Procedure

HELD = "held"
"""The kind of the part in which the output stands at its value."""

_PIECE_S = 0.1  # so often somebody who wants to end it is heard


def output_of(bench: BenchFile, name: str) -> str:
    """The name of an output of the bench.

    Raises:
        UnknownNameError: no channel of that name.
        SettingError: it is an input.
    """
    outputs = [channel for channel, entry in bench.bench.channels.items() if entry.is_output]
    if name not in bench.bench.channels:
        raise UnknownNameError("channel", name, outputs)
    if name not in outputs:
        raise SettingError(f"channel '{name}' is an input; what can be driven: {', '.join(outputs)}")
    return name


def to_be_ended(procedure: Procedure, wanted: Callable[[], bool]) -> Procedure:
    """The procedure `jog`, whose output goes back when somebody wants it to.

    Args:
        procedure: as it is installed.
        wanted: says whether the output is still to stand there.
    """

    def run(rig: Rig, *, value: float, for_s: float) -> None:
        hold(rig, value, for_s, wanted)

    return replace(procedure, run=run)


def hold(rig: Rig, value: float, for_s: float, wanted: Callable[[], bool] = lambda: True) -> None:
    """Bring the command to a value at the allowed slew, and keep it there for so long, or as long as it is wanted.

    Raises:
        RangeError: the value or the way to it leaves the limits; nothing was driven.
    """
    out = rig.command
    if not out.low <= value <= out.high:
        raise RangeError(f"output '{out.name}': {value:g} {out.unit} is outside {out.low:g} … {out.high:g} {out.unit}")
    rate_hz = rig.rate_hz
    way, still = rig.way_to(value, rate_hz), max(1, round(for_s * rate_hz))
    rig.check(np.append(way, value), rate_hz)
    whole = len(way) + still
    done = 0
    for kind, pieces in (("way", _pieces(way, rate_hz, wanted)), (HELD, _standing(value, still, rate_hz, wanted))):
        part = {"kind": kind, "to": value, "channel": out.name, "unit": out.unit}
        for recording in rig.stream(pieces, rate_hz, part=part):
            done += len(recording)
            rig.progress(done / whole, f"{out.name} {'to' if kind != HELD else 'at'} {value:g} {out.unit}")
    if done < whole:
        rig.note("ended by hand", after_s=done / rate_hz)


def _standing(value: float, samples: int, rate_hz: float, wanted: Callable[[], bool]) -> Iterator[Array]:
    """The value, piece by piece, made when it is asked for: nobody knows how long it will be wanted."""
    some = max(1, round(_PIECE_S * rate_hz))
    while samples > 0 and wanted():
        yield np.full(min(some, samples), value)
        samples -= some


def _pieces(way: Array, rate_hz: float, wanted: Callable[[], bool]) -> Iterator[Array]:
    some = max(1, round(_PIECE_S * rate_hz))
    for first in range(0, len(way), some):
        if not wanted():
            return
        yield way[first : first + some]
