"""A bench file that says only in what it differs from another one: `based_on = "NAME"`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hil.bench.files import at_home
from hil.bench.find import find_bench
from hil.errors import FileError, HilError, reading
from hil.untrusted import parse_toml, read_text

BASED_ON = "based_on"
_DEEPEST = 5  # files on files; more is a circle
_HOW_REACHED = ("driver", "simulated")
_OF_TERMINAL = ("device", "terminal", "calibration", "calibration_history", "range", "pwm")


def whole_bench(path: Path, text: str) -> tuple[dict[str, Any], str]:
    """The content of a bench file with what it is based on, and that as one text.

    Tables are merged key by key; everything else replaces what the other file says. A device that says how it is
    reached is another one, and what belongs to a channel's terminal goes with that. The text of a file that stands for
    itself is its own.

    Raises:
        FileError: a file cannot be read, is not TOML, or is based on itself.
    """
    content = _content(path, text)
    if BASED_ON not in content:
        return content, text
    import tomlkit

    merged = _with_base(path, content, 0)
    return merged, f"# {path.name} with what it is based on, {content[BASED_ON]}\n{tomlkit.dumps(merged)}"


def _with_base(path: Path, content: Mapping[str, Any], depth: int) -> dict[str, Any]:
    own = {key: value for key, value in content.items() if key != BASED_ON}
    if BASED_ON not in content:
        return own
    if depth == _DEEPEST:
        raise FileError(f"{path}: {BASED_ON}: more than {_DEEPEST} files one on the other, or one on itself")
    home = _base_path(path, content[BASED_ON])
    base = _with_base(home, _content(home, text_of(home)), depth + 1)
    return merged(_without_replaced(_at_home(base, home.parent), own), own)


def _base_path(path: Path, name: Any) -> Path:
    if not isinstance(name, str) or not name:
        raise FileError(f"{path}: {BASED_ON}: name a bench file, or an installed bench; found {name!r:.40}")
    try:
        return find_bench(str(path.parent / name) if name.endswith(".toml") else name)
    except HilError as error:
        raise FileError(f"{path}: {BASED_ON}: {error}") from None


def _without_replaced(base: dict[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """The base less its device of a name that is another one here, and less what a channel had of another terminal."""
    kept = dict(base)
    for section, telling, gone in (("devices", _HOW_REACHED, ()), ("channels", ("terminal",), _OF_TERMINAL)):
        before, here = base.get(section), own.get(section)
        if isinstance(before, Mapping) and isinstance(here, Mapping):
            moved = {name for name, table in here.items() if isinstance(table, Mapping) and set(telling) & set(table)}
            kept[section] = {
                name: {k: v for k, v in table.items() if gone and k not in gone} if name in moved else table
                for name, table in before.items()
            }
    return kept


def merged(base: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Two tables as one, the second going before the first."""
    both = dict(base)
    for key, value in own.items():
        below = both.get(key)
        both[key] = merged(below, value) if isinstance(below, Mapping) and isinstance(value, Mapping) else value
    return both


def _at_home(content: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Files beside the base, its model and descriptions of devices, are found from elsewhere too."""
    valve, devices = content.get("valve"), content.get("devices")
    own = dict(content)
    if isinstance(devices, dict):
        own["devices"] = at_home(devices, folder)
    plant = valve.get("plant") if isinstance(valve, dict) else None
    if isinstance(valve, dict) and isinstance(plant, str) and plant.endswith(".json"):
        own["valve"] = {**valve, "plant": str(folder / plant)}
    return own


def text_of(path: Path) -> str:
    """The text of a bench file.

    Raises:
        FileError: it cannot be read.
    """
    with reading(path, "not a bench file"):
        return read_text(path)


def _content(path: Path, text: str) -> dict[str, Any]:
    return parse_toml(text, f"{path}: not a bench file")
