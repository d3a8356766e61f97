"""Assemble the commands and turn errors into one line and an exit status."""

from __future__ import annotations

import importlib
import pkgutil
import sys
import traceback
from typing import Any

import typer

from hil import __version__, cli
from hil.errors import HilError
from hil.extras import EXTRAS, lacking

_debug = False


def _options(
    debug: bool = typer.Option(False, "--debug", help="Show the traceback of an error, and the frames of every link."),
    version: bool = typer.Option(False, "--version", is_eager=True, help="Show the version and exit."),
) -> None:
    global _debug
    _debug = debug
    if debug:
        from hil.cli.frames import show_frames

        show_frames()
    if version:
        typer.echo(f"hil {__version__}")
        raise typer.Exit


def _assembled() -> typer.Typer:
    app = typer.Typer(
        no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None,
        help="Test, identify and diagnose electrically modulated hydraulic valves.",
    )  # fmt: skip
    app.callback(invoke_without_command=True)(_options)
    for found in pkgutil.iter_modules(cli.__path__):
        module = importlib.import_module(f"{cli.__name__}.{found.name}")
        name = found.name.rstrip("_").replace("_", "-")
        if hasattr(module, "command"):
            app.command(name=name)(module.command)
        elif hasattr(module, "group"):
            app.add_typer(module.group, name=name)
    return app


def main() -> int:
    """Run the command line; returns the exit status of the contract (0, 1, 2, 3)."""
    app = _assembled()
    silent = len(sys.argv) == 1  # the help is shown, and nothing was done
    try:
        status = app(["--help"] if silent else None, prog_name="hil", standalone_mode=False)
        return 2 if silent else int(status or 0)
    except HilError as error:
        return _say(str(error), error.exit_status)
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        sys.stderr.close()
    except OSError as error:
        return _say(f"{error.filename or 'file'}: {error.strerror or error}", 2)
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in EXTRAS:
            raise
        return _say(f"this needs {lacking(library)}", 2)
    except Exception as error:
        if hasattr(error, "format_message"):  # of click or of typer's own copy of it, by version
            return _say(_usage(error), 2)
        hint = "" if _debug else "; `hil --debug …` shows where"
        return _say(f"a fault of this program, not of its input: {type(error).__name__}: {error}{hint}", 2)
    return 0


def _usage(error: Any) -> str:
    """A wrong use in one line; where the command is known, how to see its right use."""
    text = str(error.format_message()).rstrip(".")
    context = getattr(error, "ctx", None)
    return text if context is None else f"{text}; `{context.command_path} --help` shows what is allowed"


def _say(text: str, status: int) -> int:
    if _debug:
        traceback.print_exc()
    print(f"hil: {' '.join(text.split())}", file=sys.stderr)
    return status
