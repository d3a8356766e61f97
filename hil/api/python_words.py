"""Errors and notes of the Python interface in Python's words: arguments instead of options of the command line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import is_dataclass, replace
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from hil.errors import HilError

_READ = ("time", "interval", "unit", "rename", "columns", "gaps")
_CALLED = {
    "interval": "interval_s", "unit": "units", "rename": "renamed", "input": "inputs", "input-name": "inputs",
    "output-name": "output", "budget": "budget_s", "bench-budget": "bench_budget_s", "window": "window_s",
    "limit": "limits", "note": "notes", "reset": "resets", "gaps": "gaps=True",
}  # fmt: skip
"""Options whose argument is called otherwise; every other one is called as it is."""
_PAIR = re.compile(r"--(unit|rename) (?:'([^'=]+)=([^']+)'|([^\s'=]+)=([^\s'=;,]+))")
_OPTION = re.compile(r"--([a-z]+(?:-[a-z]+)*)(?: ([A-Z]+)\b)?")
_OF_COMMANDS = re.compile(r" \(of hil simulate: [^)]*\)")
_COMMAND = re.compile(r"(`hil [^`]*`|^ *next: hil .*$)", re.M)  # to be typed as it stands, in either world
_WORDS = ("notes", "warnings", "why_asked", "error", "text")
_HOLD_WORDS = ("diagnosis", "diagnosed")

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")
_commands = 0


@contextmanager
def at_the_prompt() -> Iterator[None]:
    """While a command of the command line runs, errors and notes keep its options."""
    global _commands
    _commands += 1
    try:
        yield
    finally:
        _commands -= 1


def in_python_words(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """A function of the interface whose errors and notes, told or returned, name its arguments."""

    @wraps(function)
    def called(*args: _Arguments.args, **named: _Arguments.kwargs) -> _Result:
        if _commands:
            return function(*args, **named)
        if callable(tell := named.get("notes")):
            named["notes"] = lambda note: tell(python_words(note))
        with python_errors():
            found: _Result = _reworded(function(*args, **named))
            return found

    return called


@contextmanager
def python_errors() -> Iterator[None]:
    """Errors that come out of it name arguments, unless a command runs."""
    try:
        yield
    except HilError as error:
        if not _commands and error.args:
            error.args = (python_words(str(error)), *error.args[1:])
        raise


def python_words(text: str) -> str:
    """A message with arguments in place of options: `--unit flow=l/min` is `hil.read(…, units={'flow': 'l/min'})`."""
    parts = _COMMAND.split(_OF_COMMANDS.sub("", text))  # every second one is a command
    return "".join(part if i % 2 else _OPTION.sub(_argument, _PAIR.sub(_pair, part)) for i, part in enumerate(parts))


def _reworded(found: Any) -> Any:
    """What a function returns, its notes in Python's words."""
    if isinstance(found, list):
        return [_reworded(one) for one in found]
    if not is_dataclass(found) or isinstance(found, type):
        return found
    words = {name: _in_words(getattr(found, name)) for name in _WORDS if hasattr(found, name)}
    words |= {name: _reworded(getattr(found, name)) for name in _HOLD_WORDS if hasattr(found, name)}
    changed = {name: value for name, value in words.items() if value is not getattr(found, name)}
    return replace(found, **changed) if changed else found


def _in_words(words: Any) -> Any:
    if isinstance(words, str):
        return words if (text := python_words(words)) == words else text
    if not isinstance(words, tuple):
        return words
    texts = tuple(_in_words(one) for one in words)
    return words if texts == words else texts


def _pair(found: re.Match[str]) -> str:
    name, value = (text.strip() for text in (found[2] or found[4], found[3] or found[5]))
    return f"hil.read(…, {_CALLED[found[1]]}={{'{name}': '{value}'}})"


def _argument(found: re.Match[str]) -> str:
    name, metavar = found[1], found[2]
    called = _CALLED.get(name, name.replace("-", "_"))
    text = f"{called}={metavar}" if metavar else called
    return f"hil.read(…, {text})" if name in _READ else text
