"""`hil list`: what is installed, one line each."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hil.catalog import KINDS, entries, models, tables
from hil.cli.options import Json, argument
from hil.cli.printed import printed
from hil.errors import UnknownNameError

_FILES = ("benches", "descriptions", "models", "tables")


def command(
    kind: str = argument("", "KIND", "Only this kind, such as plants."),
    as_json: Json = False,
) -> None:
    """List the installed drivers, devices, procedures, plants, effects, benches, descriptions, models and tables."""
    if kind and kind not in (*KINDS, *_FILES):
        raise UnknownNameError("kind of entry", kind, (*KINDS, *_FILES))
    kinds = [known for known in (*KINDS, *_FILES) if kind in ("", known)]
    found = {name: dict(_lines(name)) for name in kinds}
    words = []
    for name, summaries in found.items():
        words += [] if kind else [f"{name}:"]
        width = max(map(len, summaries), default=0)
        words += [f"{'' if kind else '  '}{entry:{width}}  {text}".rstrip() for entry, text in summaries.items()]
    listed = {name: [{"name": entry, "summary": text} for entry, text in found[name].items()] for name in kinds}
    printed({"schema": "hil.installed/1", **listed}, "\n".join(words), as_json, indent=1)


def _lines(kind: str) -> Iterator[tuple[str, str]]:
    """(name, what it is) of every entry of a kind."""
    if kind == "benches":
        from hil.bench.find import benches

        yield from ((name, _first_words(path, "name = ")) for name, path in benches().items())
    elif kind == "descriptions":
        from hil.description.find import descriptions

        yield from ((name, _first_words(path, "summary = ")) for name, path in descriptions().items())
    elif kind == "models":
        yield from ((name, _first_words(path, '"title": ')) for name, path in models().items())
    elif kind == "tables":
        yield from ((name, str(path)) for name, path in tables().items())
    else:
        yield from ((entry.name, entry.summary) for entry in entries(kind))  # type: ignore[arg-type]


def _first_words(path: Path, key: str) -> str:
    """What stands behind the first occurrence of a key, read as text: listing opens nothing else."""
    with path.open(encoding="utf-8") as file:
        line = next((line for line in file if line.strip().startswith(key)), "")
    return line.strip().removeprefix(key).strip().rstrip(",").strip('"')
