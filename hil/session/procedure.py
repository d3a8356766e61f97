"""A procedure as it is installed: what it drives, what it measures, and which settings it takes."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any, get_type_hints

from hil.catalog import find
from hil.errors import FileError
from hil.record.measurement import Findings, Measurement
from hil.record.recording import Recording
from hil.session.setting import Setting


@dataclass(frozen=True, slots=True)
class Procedure:
    """The two functions of a procedure and what it declares.

    Attributes:
        name: as installed.
        doc: of its module; the first line says what it is.
        run: drives the rig; its keyword arguments are the settings.
        evaluate: makes findings of the recording, when the outputs are safe.
        settings: by name.
        measurements: what it promises to measure.
        resumable: whether its `run` leaves out what `Rig.finished` says.
        certificate: whether what it finds is certified of a unit, which then needs a serial number.
    """

    name: str
    doc: str
    run: Callable[..., None]
    evaluate: Callable[[Recording], Findings]
    settings: Mapping[str, Setting]
    measurements: tuple[Measurement, ...]
    resumable: bool = False
    certificate: bool = False


def load_procedure(name: str) -> Procedure:
    """An installed procedure.

    Raises:
        UnknownNameError: there is none of that name.
        FileError: the module is not a procedure; says what it lacks.
    """
    module = find("procedures", name).load()
    run, evaluate = _function(module, "run"), _function(module, "evaluate")
    return Procedure(
        name.replace("-", "_"), inspect.getdoc(module) or "", run, evaluate, _settings(module, run),
        tuple(getattr(module, "MEASUREMENTS", ())), bool(getattr(module, "RESUMABLE", False)),
        bool(getattr(module, "CERTIFICATE", False)),
    )  # fmt: skip


def _function(module: ModuleType, name: str) -> Callable[..., Any]:
    found = getattr(module, name, None)
    if not callable(found):
        raise FileError(f"{module.__file__}: a procedure has a function '{name}'")
    return found


def _settings(module: ModuleType, run: Callable[..., None]) -> dict[str, Setting]:
    types = get_type_hints(run, include_extras=True)
    meanings = argument_lines(inspect.getdoc(run) or "")
    settings = {}
    for name, parameter in list(inspect.signature(run).parameters.items())[1:]:
        if parameter.default is parameter.empty:
            raise FileError(f"{module.__file__}: setting '{name}' needs a default")
        settings[name] = Setting(name, types.get(name, Any), parameter.default, meanings.get(name, ""))
    return settings


def argument_lines(doc: str) -> dict[str, str]:
    """What a Google-style docstring says about each argument, on one line."""
    found: dict[str, str] = {}
    current = ""
    _, _, arguments = doc.partition("Args:\n")
    for line in arguments.splitlines():
        indent = len(line) - len(line.lstrip())
        if line.strip() and indent == 0:
            break
        name, colon, text = line.strip().partition(": ")
        if indent == 4 and colon and name.isidentifier():
            current = name
            found[current] = text
        elif current and line.strip():
            found[current] += f" {line.strip()}"
    return found
