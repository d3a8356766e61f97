"""How evenly a polled loop of 1 kHz runs: the loop of `hil.daq.polled` beside bare loops around `time.sleep`.

    python benchmarks/pacing.py [SECONDS]

All drive and read the same device: one that answers at once, so that only the pacing is seen, and a simulated coupler
on Modbus TCP in another process. The error of an interval is its difference from 1 ms, by the stamps of the samples.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from typing import Any

import numpy as np
from links import served
from table import Row, show

from hil.daq.channel import InputChannel, OutputChannel, Wiring
from hil.daq.contract import Waveform, joined
from hil.daq.polled import PolledDaq
from hil.errors import RangeError
from hil.record.recording import Array

RATE_HZ, SECONDS = 1000.0, 1.5
AT_ONCE = Wiring(
    {"out": OutputChannel("out", "out", "voltage", "V", -10.0, 10.0)},
    {"in": InputChannel("in", "in", "voltage", "V", -10.0, 10.0)},
)
Loop = Callable[[Any, Wiring, Array], Array]


class AtOnce:
    """A link whose device answers at once."""

    watchdog_s: float | None = None
    keep_alive_s: float | None = None

    def __init__(self) -> None:
        self._level = 0.0

    def standing(self) -> Mapping[str, float]:
        return {"out": self._level}

    def drive(self, values: Mapping[str, float]) -> None:
        self._level = values["out"]

    def read(self) -> Mapping[str, float]:
        return {"in": self._level}

    def close(self) -> None:
        """Nothing to let go of."""


def polled(link: Any, wiring: Wiring, levels: Array) -> Array:
    with closing(PolledDaq({"device": link}, {"device": wiring})) as daq:
        name = next(iter(wiring.outputs))
        return joined(list(daq.play(Waveform(daq.actual_rate_hz(RATE_HZ), {name: levels}), 100))).time_s


def to_deadlines(link: Any, wiring: Wiring, levels: Array) -> Array:
    """Sleep until each sample is due."""
    return bare(link, wiring, levels, lambda due_s: time.sleep(max(0.0, due_s - time.monotonic())))


def a_while(link: Any, wiring: Wiring, levels: Array) -> Array:
    """Sleep for an interval, whatever the rest took."""
    return bare(link, wiring, levels, lambda _due_s: time.sleep(1.0 / RATE_HZ))


def bare(link: Any, wiring: Wiring, levels: Array, wait: Callable[[float], None]) -> Array:
    """Drive and read in a loop; the stamp is the middle of driving, as in ours."""
    (terminal,) = (channel.terminal for channel in wiring.outputs.values())
    with closing(link):
        stamps, start_s = np.empty(len(levels)), time.monotonic()
        for i, level in enumerate(levels.tolist()):
            wait(start_s + i / RATE_HZ)
            begun_s = time.monotonic()
            link.drive({terminal: level})
            stamps[i] = 0.5 * (begun_s + time.monotonic())
            link.read()
        return stamps


LOOPS: dict[str, Loop] = {
    "hil polled loop": polled, "bare time.sleep until due": to_deadlines, "bare time.sleep(1 ms)": a_while,
}  # fmt: skip


def rows(opened: Callable[[], Any], wiring: Wiring, seconds: float) -> Iterator[Row]:
    levels = np.sin(2.0 * np.pi * np.arange(round(seconds * RATE_HZ)) / RATE_HZ)
    for name, loop in LOOPS.items():
        try:
            stamps = loop(opened(), wiring, levels)
        except RangeError as error:  # a computer so busy that the link did not reach the rate when it was opened
            yield Row(name, float("nan"), str(error))
            continue
        p50_ms, p99_ms, most_ms = 1e3 * np.percentile(np.abs(np.diff(stamps) - 1.0 / RATE_HZ), (50, 99, 100))
        real_hz = (len(stamps) - 1) / (stamps[-1] - stamps[0])
        yield Row(name, float(p50_ms), f"p99 {p99_ms:.3g} ms, largest {most_ms:.3g} ms; {real_hz:.1f} Hz")


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    show("error of an interval of 1 ms (median), a device that answers at once", rows(AtOnce, AT_ONCE, seconds))
    with served() as file:
        device = file.devices["tcp"]
        wiring = device.wiring(file.bench.channels)
        opened = lambda: device.module.open_link(device.settings, wiring)  # noqa: E731
        show("error of an interval of 1 ms (median), a coupler on Modbus TCP", rows(opened, wiring, seconds))


if __name__ == "__main__":
    main()
