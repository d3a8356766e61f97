"""Errors of the Python interface in Python's words: arguments instead of options of the command line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import ParamSpec, TypeVar

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

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")
_commands = 0


@contextmanager
def at_the_prompt() -> Iterator[None]:
    """While a command of the command line runs, errors keep its options."""
    global _commands
    _commands += 1
    try:
        yield
    finally:
        _commands -= 1


def in_python_words(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """A function of the interface whose errors name its arguments."""

    @wraps(function)
    def called(*args: _Arguments.args, **named: _Arguments.kwargs) -> _Result:
        try:
            return function(*args, **named)
        except HilError as error:
            if not _commands and error.args:
                error.args = (python_words(str(error)), *error.args[1:])
            raise

    return called


def python_words(text: str) -> str:
    """A message with arguments in place of options: `--unit flow=l/min` is `hil.read(…, units={'flow': 'l/min'})`."""
    text = _PAIR.sub(_pair, _OF_COMMANDS.sub("", text))
    return _OPTION.sub(_argument, text)


def _pair(found: re.Match[str]) -> str:
    name, value = (text.strip() for text in (found[2] or found[4], found[3] or found[5]))
    return f"hil.read(…, {_CALLED[found[1]]}={{'{name}': '{value}'}})"


def _argument(found: re.Match[str]) -> str:
    name, metavar = found[1], found[2]
    called = _CALLED.get(name, name.replace("-", "_"))
    text = f"{called}={metavar}" if metavar else called
    return f"hil.read(…, {text})" if name in _READ else text
