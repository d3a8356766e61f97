"""Assemble the commands and turn errors into one line and an exit status."""

from __future__ import annotations

import importlib
import pkgutil
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import typer
from typer.main import get_command

from hil.cli import commands, error_message
from hil.cli.error_message import asks_for_json, say_to_program
from hil.cli.options import option
from hil.errors import InputError, marked, options_of
from hil.printable import printable_streams
from hil.safety.interrupt import ended_by, raised, status_of
from hil.version import __version__

_CTRL_C = 130


def _options(
    context: typer.Context,
    debug: bool = option(False, "--debug", help="Show the traceback of an error, and the frames of every link."),
    version: bool = option(False, "--version", is_eager=True, help="Show the version and exit."),
) -> None:
    error_message.debug = debug
    if debug:
        from hil.cli.frames import hide_frames, show_frames

        show_frames()
        context.call_on_close(hide_frames)
    if version:
        typer.echo(f"hil {__version__}")
        raise typer.Exit


def assembled(asked: str = "") -> typer.Typer:
    """The program with all its commands, or with the one that is asked for if there is one of that name."""
    app = typer.Typer(
        no_args_is_help=True, add_completion=True, pretty_exceptions_enable=False, rich_markup_mode=None,
        help="Test, identify and diagnose electrically modulated hydraulic valves.",
    )  # fmt: skip
    app.callback(invoke_without_command=True)(_options)
    modules = {one.name.rstrip("_").replace("_", "-"): one.name for one in pkgutil.iter_modules(commands.__path__)}
    for name in [asked] if asked in modules else modules:
        module = importlib.import_module(f"{commands.__name__}.{modules[name]}")
        if hasattr(module, "group"):
            app.add_typer(module.group, name=name)
        else:
            own, settings = getattr(module, "Command", None), getattr(module, "CONTEXT", None)
            app.command(name=name, cls=own, context_settings=settings)(module.command)
    return app


@cache
def _program(asked: str) -> Callable[..., Any]:
    """What typer makes of a command, or of all where none is asked for, once in this process."""
    return get_command(assembled(asked))


def main() -> int:
    """Run the command line; returns the exit status of the contract (0, 1, 2, 3)."""
    with printable_streams():
        return _run()


def _run() -> int:
    """The command line, on the streams as they are."""
    silent = len(sys.argv) == 1  # without a word the help is shown, and nothing was done
    error_message.ended = error_message.debug = False  # of an earlier command in this process
    error_message.as_json = asks_for_json(sys.argv[1:])
    try:
        program = _program(next((word for word in sys.argv[1:] if not word.startswith("-")), ""))
        with options_of("prompt"):
            status = program(["--help"] if silent else None, prog_name="hil", standalone_mode=False)
        if status == _CTRL_C and not error_message.ended:
            return _stopped(raised() or KeyboardInterrupt())  # typer takes every signal that was raised for Ctrl-C
        return 2 if silent else int(status or 0)
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        sys.stderr.close()
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, typer.Abort):  # at a question: typer tells only in its context what it was
            if isinstance(error.__context__, EOFError):
                return say_to_program(InputError("no answer was given; nothing was done"))
            return _stopped(KeyboardInterrupt())
        stopped = error.__cause__  # typer makes an error of its own of Ctrl-C
        if isinstance(stopped, KeyboardInterrupt):
            return _stopped(stopped)
        ended = ended_by(error)
        return _stopped(ended) if isinstance(ended, KeyboardInterrupt) else say_to_program(ended)
    return 0


def _stopped(error: KeyboardInterrupt) -> int:
    """Ended by a signal, with the status that shells give to that."""
    marked(error, status_of(error), "")
    return say_to_program(error)
