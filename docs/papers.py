"""Put the papers' numbers beside what the commands print, and true ones beside those of one's own recordings.

    python -m docs.papers

runs every command and writes two tables in each of the three pages about a paper, between their marks; a test does the
same and compares.
"""

from __future__ import annotations

import cmath
import contextlib
import io
import json
import math
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from hil.cli import app
from hil.physics.published import tordal, tugsal
from hil.record.read import write_recording
from hil.record.recording import recording
from hil.record.table.response_table import ResponseTable, write_response_table
from hil.signals.interval import COVERED, rounded, width
from tests import own_valves

PAGES = Path(__file__).parent / "explanation"
BEGIN, END = "<!-- Made by docs/papers.py: begin -->", "<!-- end -->"
OWN = "<!-- Own recordings, made by docs/papers.py: begin -->"


@dataclass(frozen=True)
class Row:
    """A number of a paper, the command that gives it, and how it is read from what the command prints as JSON."""

    what: str
    command: str
    paper: str
    read: Callable[[Any], str]


@dataclass(frozen=True, slots=True)
class OwnRow:
    """A true number of a simulated valve, the command that measures it, and value and std in what that prints."""

    what: str
    command: str
    true: float
    read: Callable[[Any], tuple[float, float | None]]


_ORDERS = "--plant transfer-function --poles 3 --zeros 1 --no-dead-time"
_SIX = " ".join(f"hpv41-{side}-{size}" for side in ("plus", "minus") for size in (5, 10, 20))
_STEP = "hil analyse step --rise 0.45 --settling 1.225 --beside hpv41-plus-10 --json"
_LOOP = "hil analyse loop --numerator 0.7837 --denominator 1,3.853,1.011e-5 --json"
_CYLINDER = "--set hysteresis=0 --set coulomb=0 --poles 2 --zeros 0 --json"
_RECURSIVE = "--poles 4 --inputs 3 --difference --exponential"


def rows() -> dict[str, list[Row]]:
    """The rows by page."""
    return {
        "hpv41-paper.md": [*_sections_6_and_8(), *_section_7()],
        "hydraforce-paper.md": list(_gunay()),
        "efc-thesis.md": list(_tugsal()),
    }


def _sections_6_and_8() -> Iterator[Row]:
    for run in tordal.RUNS:
        name = f"hpv41-{'plus' if run.bias > 0 else 'minus'}-{run.amplitude:g}"
        paper = _list((run.b1, run.b0, run.a2, run.a1, run.a0))
        command = f"hil identify {name} {_ORDERS} --out {name}.json; hil export {name}.json --to json"
        yield Row(f"table {1 if run.bias > 0 else 2}, {run.name}: b₁, b₀, a₂, a₁, a₀", command, paper, _exported)
    command = (
        f"hil average {_SIX} --normalised --out mean.csv; "
        f"hil identify mean.csv {_ORDERS} --weights uniform --out mean.json; hil export mean.json --to json"
    )
    yield Row("section 8, G_M: b₁, b₀, a₂, a₁, a₀", command, "not printed", _exported)


def _section_7() -> Iterator[Row]:
    yield Row("eq. 12, a₁", _STEP, "4.89", lambda f: _number(f[0]["models"][0]["numerator"][0]))
    yield Row("eq. 13, a₂", _STEP, "3.27", lambda f: _number(f[0]["models"][1]["numerator"][0]))
    yield Row("table 3, ζ", _STEP, "0.69, −0.91, 0.23 ± 1.13j", lambda f: _roots(f[0]["damping_roots"]))
    yield Row("eq. 21, 2ζω_n and ω_n²", _STEP, "6.53, 22.37", lambda f: _list(f[0]["models"][2]["denominator"][1:]))
    third = "−150.8, 6361, 31.7, 1225, 6345"
    yield Row("eq. 22: b₁, b₀, a₂, a₁, a₀", _STEP, third, lambda f: _function(f[0]["models"][3]))
    errors = "figure 16: rms error of the gain of eqs 19 to 21, dB"
    yield Row(errors, _STEP, "drawn", lambda f: _list(m["gain_error_db"] for m in f[0]["models"][:3]))
    errors = "figure 16: rms error of their phase, °"
    yield Row(errors, _STEP, "drawn", lambda f: _list(m["phase_error_deg"] for m in f[0]["models"][:3]))


def _gunay() -> Iterator[Row]:
    for at, side in ((0.75, "extending"), (-0.75, "retracting")):
        command = f"hil linearise hydraforce-open-loop --at {at:g} {_CYLINDER}"
        gains = (("K_q", "l/min per %"), ("K_q per A", "l/min per A"), ("K_c", "l/min per bar")) if at > 0.0 else ()
        for gain, unit in gains:  # the same on both sides
            yield Row(f"eqs 3 and 4: {gain}, {unit}", command, "no number", _gain(gain))
        yield Row(f"eqs 6 and 8, before the loop is closed, {side}: b₀, a₂, a₁, a₀", command, "no number", _function)
    yield Row("eq. 12: b₀, a₁, a₀", _LOOP, "0.7837, 3.853, −0.78368989", _function)
    yield Row("its unstable pole, rad/s", _LOOP, "not said", lambda f: _list(p["re"] for p in f["unstable_poles"]))


def _tugsal() -> Iterator[Row]:
    command = "hil linearise efc-drive --at 1.5 --json"
    yield Row("eqs 2.15 to 2.17 at 1.5 A: K₁/K₂, psi/A", command, "470 between its steps", _gain("K_1/K_2"))
    command = "hil analyse corners good.csv --poles 3 --zeros 1 --json"
    yield Row("eqs 3.1 to 3.6, good valve: poles, rad/s", command, "6.125, 10, 10", lambda f: _list(f["poles_rad_s"]))
    yield Row("the same: zero, rad/s", command, "13.125", lambda f: _list(f["zeros_rad_s"]))
    tables = (("sine", "3.1", tugsal.EXAMPLE_FROM_SINE, "14.142"), ("step", "3.2", tugsal.EXAMPLE, "10000"))
    for name, table, printed, prior in tables:
        paper = _list((*printed.denominator[1:], *printed.numerator))
        command = f"hil analyse recursive {name}.csv {_RECURSIVE} --prior {prior} --json"
        what = f"table {table}: a₁ … a₄, b₀ … b₂ from a {name}"
        yield Row(what, command, paper, lambda f: _list(round(p["value"], 4) for p in f["parameters"]))
    command = "hil analyse error worn.csv --reference good-step.csv --level low --json"
    yield Row("eq. 4.1, 0.04 psi apart, 1 s at 1 kHz", command, "rate not stated", lambda f: _number(f["error_4_1"]))
    yield Row(
        "eqs 4.2 and 4.3, degrees of the level: low, high", command, "no example",
        lambda f: _list(f["current_memberships"].values()),
    )  # fmt: skip
    yield Row("section 4.1.3, its crisp class", command, "1.065 … 1.535: malfunctioned", lambda f: f["crisp_class"])
    yield Row(
        "eqs 4.4 to 4.7, its degrees", command, "no example", lambda f: _list(f["error_memberships"].values())
    )  # fmt: skip


_SINES = "hil analyse sines sines.csv --json"
_FLOW = "hil analyse flow sweep.csv half-speed.csv --degree 9 --json"
_OPEN = "hil identify open.csv --plant transfer-function --out open.json --json"
_PROCESS = "hil analyse process closed.csv --skip 6 --json"
_CORNERS = "hil analyse sines efc-sines.csv --out efc.csv; hil analyse corners efc.csv --poles 3 --json"
_CURVE = "hil analyse flow efc-sweep.csv --neutral 1.2 --out efc-curve.csv --json"
_K = "hil analyse compose efc-curve.csv cummins-efc --out start.json; hil linearise start.json --at 1.5 --json"
_CLASSES = "hil analyse classes good bad --judge new.csv --json"


def own_rows() -> dict[str, list[OwnRow]]:
    """The rows of one's own recordings by page."""
    return {
        "hpv41-paper.md": [*_own_sines(), *_own_curve()],
        "hydraforce-paper.md": list(_own_cylinder()),
        "efc-thesis.md": list(_own_efc()),
    }


def _own_sines() -> Iterator[OwnRow]:
    valve = (own_valves.hpv41, own_valves.HPV41_REST, 50.0, 10.0)
    for samples in (1000, 250, 80):
        line, hz = own_valves.SINES.index(samples), own_valves.RATE_HZ / samples
        true = own_valves.harmonic(*valve, samples, 3, own_valves.RATE_HZ)
        yield OwnRow(f"eq. 1: gain at {hz:g} Hz, l/min per %", _SINES, abs(true), _line("gain", line))
        phase_deg = math.degrees(cmath.phase(true))
        yield OwnRow("eq. 2: phase there, °", _SINES, phase_deg, _line("phase_deg", line))


def _own_curve() -> Iterator[OwnRow]:
    commands = np.linspace(0.0, 100.0, 501)
    flow = own_valves.at_rest(own_valves.hpv41, own_valves.HPV41_REST, 3, commands + own_valves.HPV41_STICKS)
    (end,) = own_valves.at_rest(own_valves.hpv41, own_valves.HPV41_REST, 3, [100.0])
    linear = (flow >= 0.3 * end) & (flow <= 0.9 * end)
    both, odd = np.concatenate((-commands[:0:-1], commands)), np.concatenate((-flow[:0:-1], flow))
    powers = np.polynomial.Polynomial.fit(both, odd, 9)
    edge = own_valves.edge_of_power_law(commands, flow)
    each = {
        "response_high": ("flow at 100 %, l/min", end),
        "dead_band_positive": ("dead band, upper edge, %", edge),
        "dead_band_negative": ("dead band, lower edge, %", -edge),
        "gain_positive": ("gain, l/min per %", np.polyfit(commands[linear], flow[linear], 1)[0]),
        "hysteresis": ("hysteresis, % of the sweep", own_valves.HPV41_STICKS),
        "lag": ("lag, ms", own_valves.HPV41_LAG_MS),
    }
    for name, (what, true) in each.items():
        yield OwnRow(f"figure 6: {what}", _FLOW, float(true), _figure(name))
    yield OwnRow("its polynomial of degree 9 at 50 %, l/min", _FLOW, float(powers(50.0)), _on_curve(5, 50.0))
    yield OwnRow("its spline at 50 %, l/min", _FLOW, float(np.interp(50.0, commands, flow)), _on_curve(1, 50.0))


def _own_cylinder() -> Iterator[OwnRow]:
    valve = (own_valves.cylinder, own_valves.CYLINDER_REST)
    slow, fast = own_valves.at_rest(*valve, 3, own_valves.LEVELS_A)
    gain = (fast - slow) / (own_valves.LEVELS_A[1] - own_valves.LEVELS_A[0])
    yield OwnRow("eq. 8: speed per current, mm/s per A", _OPEN, gain, _parameter("integrator_gain"))
    yield OwnRow("its lag, s", _OPEN, own_valves.SPOOL_LAG_S, _parameter("lag_time"))
    closed = own_valves.poles(*valve, sum(own_valves.LEVELS_A) / 2.0, gain=0.04, row=4)
    slowest = float(closed[-1].real)
    command = "hil analyse loop open.json --close 0.04 --json"
    yield OwnRow("eq. 8: slowest pole over a K_tk of 0.04, rad/s", command, slowest, _slowest)
    true = own_valves.closed_harmonic()
    gain, time_s = abs(true) / math.cos(cmath.phase(true)), -math.tan(cmath.phase(true))
    yield OwnRow("section 5: gain of the process model", _PROCESS, gain, lambda f: (f["gain"], f["gain_std"]))
    yield OwnRow("its time constant, s", _PROCESS, time_s, lambda f: (f["time_s"], f["time_std_s"]))


def _own_efc() -> Iterator[OwnRow]:
    valve = (own_valves.efc, own_valves.EFC_REST)
    for k, pole in enumerate(sorted(-own_valves.poles(*valve, 1.5, 3).real)):
        yield OwnRow(
            f"eqs 3.1 to 3.6: pole {k + 1}, rad/s", _CORNERS, float(pole),
            lambda f, k=k: (f["poles_rad_s"][k], f["poles_std_rad_s"][k]),
        )  # fmt: skip
    commands = np.linspace(1.2, 2.0, 401)
    pressure = own_valves.at_rest(*valve, 2, commands)
    half = float(np.interp((pressure[0] + pressure[-1]) / 2.0, pressure, commands))
    yield OwnRow("static curve: current at half the change, A", _CURVE, half, _figure("command_half"))
    slope = np.gradient(pressure, commands)
    yield OwnRow("its steepest slope, psi/A", _CURVE, float(slope.max()), _figure("gain_largest"))
    true = float(np.interp(1.5, commands, slope))
    yield OwnRow("eqs 2.15 to 2.17 at 1.5 A: K₁/K₂, psi/A", _K, true, lambda f: (f["gains"]["K_1/K_2"]["value"], None))
    for name in ("accepted_bad", "refused_good"):
        what = f"ten good and five bad valves: {name.replace('_', ' ')}"
        yield OwnRow(what, _CLASSES, 0.0, lambda f, name=name: (float(f[name]["count"]), None))
    yield OwnRow(
        "another bad valve is called bad (1)", _CLASSES, 1.0,
        lambda f: (float(f["others"][0]["found"] == "bad"), None),
    )  # fmt: skip


def prepare(folder: Path) -> None:
    """The recordings that the commands read: what the papers print, as files."""
    frequency_hz = np.geomspace(0.1, 20.0, 60)
    good = tugsal.FREQUENCY_MODELS["good"].reduced(0.7).at(frequency_hz)
    write_response_table(ResponseTable("good", frequency_hz, good, in_db=True), folder / "good.csv")
    time_s = np.arange(1000.0)
    for name, command in (("sine", np.sin(0.3 * time_s)), ("step", np.ones(1000))):
        driven = {"command [1]": command, "response [1]": tugsal.EXAMPLE.response(command)}
        write_recording(recording(name, time_s, driven), folder / f"{name}.csv")
    for name, psi in (("good-step", 30.0), ("worn", 30.04)):
        write_recording(
            recording(name, time_s / 1000.0, {"pressure [psi]": np.full(1000, psi)}), folder / f"{name}.csv"
        )


def made() -> dict[str, tuple[str, str]]:
    """Both tables of each page, every command run once."""
    own = own_rows()
    printed = _printed(row.command for page in (*rows().values(), *own.values()) for row in page)
    return {page: (_table(found, printed), _own_table(own[page], printed)) for page, found in rows().items()}


def _printed(commands: Iterable[str]) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        prepare(Path(name))
        own_valves.write_recordings(Path(name))
        return {command: _run(command) for command in dict.fromkeys(commands)}


def _table(found: Sequence[Row], printed: dict[str, Any]) -> str:
    commands = list(dict.fromkeys(row.command for row in found))
    lines = ["| what | paper | command | gives |", "|---|---|---|---|"]
    for row in found:
        number = commands.index(row.command) + 1
        lines.append(f"| {row.what} | {row.paper} | {number} | {row.read(printed[row.command])} |")
    return "\n".join([*lines, "", *_numbered(commands)])


def _own_table(found: Sequence[OwnRow], printed: dict[str, Any]) -> str:
    """True numbers beside those that a command gives, to the digits that ± leaves."""
    commands = list(dict.fromkeys(row.command for row in found))
    lines, held = ["| what | true | command | gives |", "|---|---|---|---|"], list[bool]()
    for row in found:
        value, std = row.read(printed[row.command])
        held += [abs(value - row.true) <= COVERED * std] if std else []
        true, gives = (
            (rounded(row.true, std), f"{rounded(value, std)} {width(std)}") if std else map(_number, (row.true, value))
        )
        lines.append(f"| {row.what} | {true} | {commands.index(row.command) + 1} | {gives} |".replace(" -", " −"))
    said = f"{sum(held)} of the {len(held)} intervals (95 %) hold the true number."
    return "\n".join([*lines, "", said, "", *_numbered(commands)])


def _numbered(commands: Sequence[str]) -> list[str]:
    """The commands; of several that differ in one name throughout, the first with the names of the others."""
    said, alike = list[str](), dict[str, list[tuple[int, str]]]()
    for number, command in enumerate(commands, 1):
        name = command.split()[2]
        alike.setdefault(command.replace(name, "NAME"), []).append((number, name))
    for pattern, found in alike.items():
        numbers, names = zip(*found, strict=True)
        command = pattern if len(found) > 1 else pattern.replace("NAME", names[0])
        where = f" for {', '.join(names)}" if len(found) > 1 else ""
        said.append(f"{numbers[0]}{f'–{numbers[-1]}' if where else ''}: `{command.replace('; ', '`, `')}`{where}")
    return [f"- {one}" for one in said]


def _run(command: str) -> Any:
    """What the last of several commands prints, as JSON."""
    out = ""
    for one in command.split("; "):
        said, noted = io.StringIO(), io.StringIO()
        with patch("sys.argv", one.split()), contextlib.redirect_stdout(said), contextlib.redirect_stderr(noted):
            if app.main() != 0:
                raise RuntimeError(f"{one}: {noted.getvalue()}")
        out = said.getvalue()
    return json.loads(out)


def page_with(text: str, tables: tuple[str, str]) -> str:
    """A page with its tables exchanged."""
    for begin, table in zip((BEGIN, OWN), tables, strict=True):
        before, _, rest = text.partition(begin)
        text = f"{before}{begin}\n\n{table}\n\n{END}{rest.partition(END)[2]}"
    return text


def main() -> None:
    """Write every page that differs."""
    for name, tables in made().items():
        path = PAGES / name
        text = path.read_text(encoding="utf-8")
        if (new := page_with(text, tables)) != text:
            path.write_text(new, encoding="utf-8")
            print(f"{path}: written{os.linesep}", end="")


def _line(name: str, line: int) -> Callable[[Any], tuple[float, float | None]]:
    std = {"gain": "gain_std", "phase_deg": "phase_std_deg"}[name]
    return lambda found: (found["responses"][0][name][line], found["responses"][0][std][line])


def _figure(name: str) -> Callable[[Any], tuple[float, float | None]]:
    return lambda found: next((one["value"], one["std"]) for one in found["values"] if one["name"] == name)


def _on_curve(column: int, command: float) -> Callable[[Any], tuple[float, float | None]]:
    """A column of the curve at a command, and the curve's uncertainty there."""

    def read(found: Any) -> tuple[float, float]:
        columns = [one["values"] for one in found["curve"]]
        of = [one["name"].startswith("std ") for one in found["curve"]].index(True)
        return float(np.interp(command, columns[0], columns[column])), float(
            np.interp(command, columns[0], columns[of])
        )

    return read


def _parameter(name: str) -> Callable[[Any], tuple[float, float | None]]:
    def read(found: Any) -> tuple[float, float]:
        one = found["model"]["parameters"][name]
        return one["value"], one["std"]

    return read


def _slowest(found: Any) -> tuple[float, None]:
    return max(pole.real for pole in np.roots(found["denominator"])), None


def _gain(name: str) -> Callable[[Any], str]:
    return lambda found: _number(found["gains"][name]["value"])


def _exported(found: Any) -> str:
    return _function(found["transfer_functions"][0])


def _function(one: Any) -> str:
    return _list([*one["numerator"], *one["denominator"][1:]])


def _roots(roots: Any) -> str:
    real = [_number(root["re"]) for root in roots if abs(root["im"]) < 1e-9]
    pairs = [f"{_number(root['re'])} ± {_number(root['im'])}j" for root in roots if root["im"] > 1e-9]
    return ", ".join([*real[::-1], *pairs])


def _list(values: Any) -> str:
    return ", ".join(_number(value) for value in values)


def _number(value: float) -> str:
    return f"{value + 0.0:.4g}".replace("-", "−")


if __name__ == "__main__":
    main()
