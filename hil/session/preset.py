"""Settings of a procedure by the name that a bench file gives them."""

from __future__ import annotations

from typing import Any

from hil.bench.read import BenchFile
from hil.errors import SettingError
from hil.session.procedure import Procedure
from hil.session.setting import parse_settings

DEFAULT = "default"


def preset_names(bench: BenchFile, procedure: Procedure) -> list[str]:
    """The presets that a bench file has for a procedure."""
    return list(bench.bench.presets.get(procedure.name, {}))


def preset_settings(bench: BenchFile, procedure: Procedure, name: str) -> dict[str, Any]:
    """The settings of a preset as they were understood; for no name those of `default`, where the bench has one.

    Raises:
        SettingError: the bench file has no such preset, or a setting of it cannot be taken; names file and preset.
    """
    known = bench.bench.presets.get(procedure.name, {})
    name = name or DEFAULT
    if name not in known:
        if name == DEFAULT:
            return {}
        there = ", ".join(known) or "none"
        raise SettingError(f"{bench.path}: no preset '{name:.60}' of {procedure.name}; there are: {there}")
    try:
        understood = parse_settings(procedure.settings, known[name])
    except SettingError as error:
        raise SettingError(f"{bench.path}: [presets.{procedure.name}.{name}]: {error}") from None
    return {setting: understood[setting] for setting in known[name]}
