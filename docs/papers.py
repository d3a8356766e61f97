"""Put the papers' numbers beside what the commands print: a table in each of the three pages about a paper.

    python docs/papers.py

runs every command and writes the tables between their marks; a test does the same and compares.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from hil.cli import app
from hil.physics.published import tordal, tugsal
from hil.record.read import write_recording
from hil.record.recording import recording
from hil.record.response_table import ResponseTable, write_response_table

PAGES = Path(__file__).parent / "explanation"
BEGIN, END = "<!-- Made by docs/papers.py: begin -->", "<!-- end -->"


@dataclass(frozen=True)
class Row:
    """A number of a paper, the command that gives it, and how it is read from what the command prints as JSON."""

    what: str
    command: str
    paper: str
    read: Callable[[Any], str]


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
        for gain, unit in (("K_q", "l/min per %"), ("K_q per A", "l/min per A"), ("K_c", "l/min per bar")):
            yield Row(f"eqs 3 and 4, {side}: {gain}, {unit}", command, "no number", _gain(gain))
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
        what = f"eqs 3.7 to 3.15, table {table}: a₁ … a₄, b₀ … b₂ from a {name}"
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


def made() -> dict[str, str]:
    """The table of each page, every command run once."""
    printed: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        prepare(Path(name))
        every = rows()
        for row in (row for page in every.values() for row in page):
            if row.command not in printed:
                printed[row.command] = _run(row.command)
    return {page: _table(found, printed) for page, found in every.items()}


def _table(found: Sequence[Row], printed: dict[str, Any]) -> str:
    commands = list(dict.fromkeys(row.command for row in found))
    lines = ["| what | paper | command | gives |", "|---|---|---|---|"]
    for row in found:
        number = commands.index(row.command) + 1
        lines.append(f"| {row.what} | {row.paper} | {number} | {row.read(printed[row.command])} |")
    said = [f"{number}. `{command.replace('; ', '`, `')}`" for number, command in enumerate(commands, 1)]
    return "\n".join([*lines, "", *said])


def _run(command: str) -> Any:
    """What the last of several commands prints, as JSON."""
    out = ""
    for one in command.split("; "):
        said = io.StringIO()
        with patch("sys.argv", one.split()), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            if app.main() != 0:
                raise RuntimeError(f"{one}: {said.getvalue()}")
        out = said.getvalue()
    return json.loads(out)


def page_with(text: str, table: str) -> str:
    """A page with its table exchanged."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{table}\n\n{END}{rest.partition(END)[2]}"


def main() -> None:
    """Write every page that differs."""
    for name, table in made().items():
        path = PAGES / name
        text = path.read_text(encoding="utf-8")
        if (new := page_with(text, table)) != text:
            path.write_text(new, encoding="utf-8")
            print(f"{path}: written{os.linesep}", end="")


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
