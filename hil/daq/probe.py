"""Who is on a line: asked with reads that change nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from pydantic import BaseModel

from hil.catalog import entries
from hil.errors import SettingError, UnknownNameError
from hil.record.run_folder.progress import Progress


@dataclass(frozen=True, slots=True)
class Found:
    """Somebody who answered: where (`unit 1`, `node 5`), and what was told, by name."""

    place: str
    answers: Mapping[str, str]


class Probe(Protocol):
    """How a driver asks who is on a kind of line: `Options` beside the address, and `who`."""

    Options: type[BaseModel]

    def who(self, options: Any, progress: Progress) -> list[Found]:
        """Everybody who answers. Raises `DeviceLostError` when the line cannot be opened."""
        ...


def probes() -> dict[str, Callable[[], Any]]:
    """What can be probed: each driver that says `PROBES = "KIND"` has a function `probe` that gives its `Probe`."""
    return dict(_declared())


def probe_of(kind: str, address: str, given: Mapping[str, str]) -> tuple[Any, BaseModel]:
    """The probe of a kind of line, and its options.

    Raises:
        UnknownNameError: a kind that no driver asks on.
        SettingError: an option that is unknown or not allowed.
    """
    known = probes()
    if kind not in known:
        raise UnknownNameError("kind of line", kind, known)
    from pydantic import ValidationError

    probe = known[kind]()
    try:
        return probe, probe.Options.model_validate({"address": address, **given})
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(map(str, first["loc"])) or "options"
        allowed = ", ".join(probe.Options.model_fields)
        text = str(first["msg"]).removeprefix("Value error, ")
        raise SettingError(f"{name}: {text}, found {first['input']!r:.40}; there are: {allowed}") from None


def _declared() -> Iterator[tuple[str, Callable[[], Any]]]:
    for entry in entries("drivers"):
        module = entry.load()
        if kind := getattr(module, "PROBES", ""):
            yield kind, module.probe
