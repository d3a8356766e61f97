"""Files that a bench file stands on beside itself: descriptions of devices, and the makers' files that these name."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hil.errors import FileError
from hil.untrusted import parse_toml, read_small, read_text

_KEYS = ("model", "eds", "dbc")
_SUFFIXES = (".toml", ".eds", ".dcf", ".dbc")
_LONGEST = 100_000  # bytes that are kept word for word; of a longer file its hash


def at_home(given: Any, folder: Path) -> Any:
    """Settings in which such files stand as paths."""
    if isinstance(given, Mapping):
        return {key: str(folder / value) if _is_file(key, value) else at_home(value, folder)
                for key, value in given.items()}  # fmt: skip
    return given


def kept(settings: Mapping[str, Mapping[str, Any]]) -> str:
    """The files that devices name, as comments behind a bench file: a run shows what it was driven by.

    Args:
        settings: by device, with these files as paths.
    """
    found = dict.fromkeys(path for given in settings.values() for path in _named(given))
    return "".join(_as_comment(path) for path in found if path.is_file())


def _named(given: Mapping[str, Any]) -> Iterator[Path]:
    for key, value in given.items():
        if isinstance(value, Mapping):
            yield from _named(value)
        elif _is_file(key, value):
            yield Path(value)
            yield from _named(at_home(_content(Path(value)), Path(value).parent))


def _content(path: Path) -> Mapping[str, Any]:
    try:
        return parse_toml(read_text(path), str(path)) if path.suffix == ".toml" else {}
    except (OSError, FileError):
        return {}  # its driver says what is wrong with it


def _as_comment(path: Path) -> str:
    data = read_small(path)
    if len(data) > _LONGEST:
        return f"\n# {path.name}: SHA-256 {hashlib.sha256(data).hexdigest()}\n"
    lines = "".join(f"#   {line}".rstrip() + "\n" for line in data.decode("utf-8", "replace").splitlines())
    return f"\n# {path.name}:\n{lines}"


def _is_file(key: str, value: Any) -> bool:
    return key in _KEYS and isinstance(value, str) and value.lower().endswith(_SUFFIXES)
