"""What carrier, dither and faults of the coil do to an EFC with friction: the table and the picture of the EFC page.

    python docs/dither.py

writes docs/explanation/dither.svg and prints the rows of the table.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import hil
from hil.record.recording import Recording

PICTURE = Path(__file__).parent / "explanation" / "dither.svg"
BENCH = """based_on = "cummins-efc"
name = "an EFC with friction"
[channels.current]
pwm = {{ carrier_hz = {carrier}, dither_hz = {dither}, dither_amplitude = {amplitude} }}
[simulation]
effects = [{{ name = "friction", parameters = {{ coulomb = 0.03, stiction = 1.3 }} }}]
[simulation.instruments]
current.coil = {{ fault = "{fault}" }}
"""


@dataclass(frozen=True)
class Drive:
    """A coil and how it is driven."""

    carrier: float = 1000.0
    dither: float = 50.0
    amplitude: float = 0.0
    fault: str = ""

    @property
    def title(self) -> str:
        """In words."""
        if self.fault:
            return f"{self.fault} circuit"
        shaken = f"dither {self.dither:g} Hz, {1000 * self.amplitude:g} mA" if self.amplitude else "no dither"
        return f"carrier {self.carrier:g} Hz, {shaken}"

    def run(self, procedure: str, name: str, **settings: object) -> Recording:
        """A run on the bench with this coil."""
        bench = Path(f"{name}.toml")
        bench.write_text(BENCH.format(**vars(self)), encoding="utf-8")
        hil.run(procedure, bench, name, settings=settings)
        found = hil.read(name)
        assert isinstance(found, Recording)
        return found


SWEPT = (
    Drive(5000.0), Drive(1000.0, 125.0, 0.05), Drive(1000.0, 125.0, 0.1), Drive(1000.0, 50.0, 0.05),
    Drive(1000.0, 50.0, 0.1), Drive(1000.0, 50.0, 0.2), Drive(1000.0, 50.0, 0.4), Drive(200.0), Drive(100.0),
    Drive(60.0),
)  # fmt: skip
DRAWN = (Drive(5000.0), Drive(60.0), Drive(1000.0, 50.0, 0.2))
FAULTS = (Drive(), Drive(fault="open"), Drive(fault="short"))


def rows() -> Iterable[str]:
    """The table: a sweep up and down in 20 s and one in 40 s, for each drive."""
    for number, drive in enumerate(SWEPT):
        drive.run("pressure_current", f"sweep-{number}", cycle_s=20.0)
        found = hil.results(f"sweep-{number}")
        told = [found[name].value for name in ("hysteresis", "lag", "pressure, 1.6 A")]
        loop, lag, psi = (0.0 if value is None else value for value in told)
        yield f"| {drive.title} | {loop:.1f} mA | {lag:.0f} ms | {psi:.1f} psi |"


def draw() -> Figure:
    """Coil currents, loops, and what a fault does to a step."""
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    axes = figure.subplot_mosaic([["current", "current"], ["loop", "fault"]])
    for number, drive in enumerate(DRAWN):
        _current(axes["current"], drive, f"current-{number}")
        _loop(axes["loop"], drive, f"loop-{number}")
    for number, drive in enumerate(FAULTS):
        _fault(axes["fault"], drive, f"fault-{number}")
    for axis, title, x, y in (
        (axes["current"], "current in the coil at 1.6 A", "time [ms]", "current [A]"),
        (axes["loop"], "40 s up and down", "current [A]", "pressure [psi]"),
        (axes["fault"], "a step to 1.6 A", "time [s]", "pressure [psi]"),
    ):
        axis.set(title=title, xlabel=x, ylabel=y)
        axis.legend(fontsize="small")
    return figure


def _current(axis: Axes, drive: Drive, name: str) -> None:
    read = drive.run("step_response", name, levels=(0.0, 72.7), hold_s=1.0)
    at = np.flatnonzero(read.values("current") > 1.59)[800:900]
    axis.plot(1e3 * (read.time_s[at] - read.time_s[at[0]]), read.values("coil current")[at], label=drive.title)


def _loop(axis: Axes, drive: Drive, name: str) -> None:
    read = drive.run("pressure_current", name, cycle_s=20.0)
    part = read.meta["parts"][-1]
    swept = read.rows(int(part["first"]), int(part["count"]))
    middle = (swept.values("current") > 1.3) & (swept.values("current") < 1.8)
    axis.plot(swept.values("current")[middle][::10], swept.values("pressure")[middle][::10], label=drive.title)


def _fault(axis: Axes, drive: Drive, name: str) -> None:
    read = drive.run("step_response", name, levels=(0.0, 72.7), hold_s=0.5)
    begun = read.time_s[int(np.argmax(read.values("current") > 1.0))]
    shown = (read.time_s > begun - 0.1) & (read.time_s < begun + 0.5)
    label = drive.title if drive.fault else "sound"
    style = ":" if drive.fault == "short" else "-"
    axis.plot(read.time_s[shown] - begun, read.values("pressure")[shown], style, label=label)


def main() -> None:
    """Write the picture, print the table."""
    rcParams["svg.hashsalt"] = "hil"
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        draw().savefig(PICTURE, metadata={"Date": None})
        print("\n".join(rows()))


if __name__ == "__main__":
    main()
