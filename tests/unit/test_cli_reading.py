"""The options of reading: stated once, taken by every command that reads a recording."""

from __future__ import annotations

import inspect

import pytest
import typer
from typer.testing import CliRunner

from hil.cli.commands import analyse, average, compare, convert, diagnose, diff, identify, simulate
from hil.cli.reading import takes_reading
from hil.record.reading import Reading

COMMANDS = [
    *(module.command for module in (average, compare, convert, diagnose, diff, identify, simulate)),
    analyse.step, analyse.recursive, analyse.error,
]  # fmt: skip
OPTIONS = {"time", "interval", "unit", "rename", "columns", "gaps"}


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.__module__ + "." + command.__name__)
def test_every_command_takes_every_option_of_reading(command):
    assert set(inspect.signature(command).parameters) >= OPTIONS
    assert "reading" not in inspect.signature(command).parameters


def test_what_is_typed_is_the_reading():
    taken: list[Reading] = []

    @takes_reading
    def command(name=typer.Argument(...), *, reading):
        taken.append(reading)
        typer.echo(name)

    app = typer.Typer()
    app.command()(command)
    typed = [
        "x",
        "--interval",
        "0.5",
        "--unit",
        "a=V",
        "--unit",
        "b=mm",
        "--columns",
        "a, b",
        "--rename",
        "c=a",
        "--gaps",
    ]
    assert CliRunner().invoke(app, typed).output == "x\n"
    assert taken == [Reading("", 0.5, {"a": "V", "b": "mm"}, {"c": "a"}, ("a", "b"), gaps=True)]
