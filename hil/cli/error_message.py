"""What is said of an error at the end: one line on stderr, and the exit status that goes with it."""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from hil.cli.faults import FaultsError
from hil.cli.progress import clear
from hil.errors import HilError, exit_status_of, reason
from hil.extras import lacking, of_extra
from hil.safety.interrupt import Halted
from hil.stderr import write

debug = False
"""Whether the traceback is shown too."""

as_json = False
"""Whether a program reads stdout: then the error is printed there too, as JSON."""

ended = False
"""Whether it has been said why the program ends: it is said once."""

WAITS_S = 5.0
"""So long a terminal that is stopped, or a pipe that is full, is waited for; then the program ends without its word."""


def say(error: BaseException, *more: str) -> int:
    """Print why the program ends, as far as anybody reads it; returns the exit status.

    May be called from the handler of a signal, whatever was just being printed.
    """
    global ended
    ended = True
    status = exit_status_of(error)
    clear()
    trace = "".join(traceback.format_exception(error)) if debug else ""
    write(f"{trace}hil: {text_of(error, *more)}\n", WAITS_S)
    return status


def say_to_program(error: BaseException) -> int:
    """Print why the program ends, on stdout too where a program reads it; returns the exit status."""
    status = say(error)
    if as_json:
        faults = {"faults": list(error.faults)} if isinstance(error, FaultsError) else {}
        document = {"schema": "hil.error/1", "error": text_of(error), "exit_status": status, **faults}
        write(f"{json.dumps(document, ensure_ascii=False)}\n", WAITS_S, sys.stdout)
    return status


def asks_for_json(arguments: Sequence[str]) -> bool:
    """Whether a command line, refused or not, asks for JSON on stdout; `hil results` names a file behind `--json`."""
    if "results" not in arguments[:2]:
        return "--json" in arguments
    return "--json=-" in arguments or ("--json", "-") in pairwise(arguments)


def text_of(error: BaseException, *more: str) -> str:
    """Why the program ends, in one line: the error, what was noted on it, and what else is to be said."""
    return "; ".join(dict.fromkeys(filter(None, (_text(error), *_notes(error), *more))))


def _text(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt):
        return f"stopped: {error}" if isinstance(error, Halted) else "stopped"
    if isinstance(error, HilError):
        return reason(error)
    if isinstance(error, OSError):
        return f"{error.filename or 'file'}: {error.strerror or error}"
    if isinstance(error, MemoryError):
        return f"more memory is needed than there is: {error}; a shorter test or recording, or a lower rate, needs less"
    if isinstance(error, ModuleNotFoundError) and (library := of_extra(error)):
        return f"this needs {lacking(library)}"
    if hasattr(error, "format_message"):  # of click or of typer's own copy of it, by version
        return _usage(error)
    hint = "" if debug else "; `hil --debug …` shows where"
    return f"a fault {_whose(error)}: {type(error).__name__}: {error}{hint}"


def _whose(error: BaseException) -> str:
    """Of this program, or of a file that somebody else has installed; libraries fail for who called them."""
    from hil.catalog import packages

    own, others = packages()
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if package in own:
            break
        if package in others:
            return f"in {frame.f_code.co_filename}, line {line}, which is no part of this program"
    return "of this program, not of its input"


def _notes(error: BaseException) -> list[str]:
    return list(getattr(error, "__notes__", ()))


def _usage(error: Any) -> str:
    """A wrong use in one line; where the command is known, how to see its right use."""
    text = str(error.format_message()).rstrip(".")
    context = getattr(error, "ctx", None)
    return text if context is None else f"{text}; `{context.command_path} --help` shows what is allowed"
