"""The program under test, called as its user calls it: identify, diagnose, simulate."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from hil.cli.commands import diagnose, identify, simulate

_COMMANDS = {"identify": identify, "diagnose": diagnose, "simulate": simulate}


class Diagnoser(Protocol):
    """What the proof asks of a program. It is given recordings and places for its answers, nothing else."""

    def identify(self, recordings: Sequence[Path], plant: str, model: Path) -> None:
        """Identify the nominal model."""

    def diagnose(self, model: Path, recordings: Sequence[Path], out: Path) -> None:
        """Leave `diagnosis.json` and `corrected.json` in `out`."""

    def simulate(self, model: Path, recording: Path, out: Path) -> None:
        """Leave `time [s]` and the output, the same rows, in the file `out`."""


@dataclass(frozen=True, slots=True)
class Commands:
    """The contract's commands, run by `call(arguments, log)`."""

    call: Callable[[Sequence[str], Path], None]

    def identify(self, recordings: Sequence[Path], plant: str, model: Path) -> None:
        """`hil identify RECORDING... --plant NAME --out MODEL.json`."""
        self.call(["identify", *map(str, recordings), "--plant", plant, "--out", str(model)], model.with_suffix(".log"))

    def diagnose(self, model: Path, recordings: Sequence[Path], out: Path) -> None:
        """`hil diagnose --model MODEL.json RECORDING... --out DIR`."""
        out.mkdir(parents=True, exist_ok=True)
        self.call(["diagnose", "--model", str(model), *map(str, recordings), "--out", str(out)], out / "diagnose.log")

    def simulate(self, model: Path, recording: Path, out: Path) -> None:
        """`hil simulate --model MODEL.json --input RECORDING --out FILE.csv`."""
        self.call(
            ["simulate", "--model", str(model), "--input", str(recording), "--out", str(out)], out.with_suffix(".log")
        )


def in_process(arguments: Sequence[str], log: Path) -> None:
    """Run a command of `hil` in this process, its arguments read as the command line reads them."""
    with log.open("w") as file, contextlib.redirect_stdout(file), contextlib.redirect_stderr(file):
        _command(arguments[0]).main(args=list(arguments[1:]), standalone_mode=False)


@cache
def _command(name: str) -> Any:
    import typer

    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(_COMMANDS[name].command)
    return typer.main.get_command(app)


def by_command_line(python: Path) -> Commands:
    """Return the `hil` of an interpreter, asked in a process of its own; another version's answers to the same cases.

    A call raises `RuntimeError` with the last line that `hil` wrote, when its exit status is not 0.
    """

    def call(arguments: Sequence[str], log: Path) -> None:
        with log.open("w") as file:
            # from an empty folder: a tree in the working folder would be imported in place of the installed one
            status = subprocess.run(
                [python.absolute(), "-m", "hil", *arguments], stdout=file, stderr=file, check=False, cwd=log.parent
            ).returncode
        if status != 0:
            last = log.read_text().strip().splitlines()[-1:]
            raise RuntimeError(f"hil {arguments[0]}: exit status {status}: {''.join(last)}")

    return Commands(call)


PYTHON = Commands(in_process)
