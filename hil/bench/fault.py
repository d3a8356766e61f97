"""A fault of a bench file: where, what, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hil.bench.lines import Place, line_at, lines_of
from hil.errors import FileError


@dataclass(frozen=True, slots=True)
class Fault:
    """Something wrong at a place of the file; the text says what is allowed or what to do."""

    place: Place
    text: str

    def described(self, path: Path, lines: dict[Place, int]) -> str:
        """`bench.toml:12: channels.flow.terminal: …`."""
        line = line_at(lines, self.place)
        where = f"{path}:{line}" if line else f"{path}"
        key = ".".join(f'"{key}"' if isinstance(key, str) and " " in key else str(key) for key in self.place)
        return f"{where}: {key}: {self.text}"


class BenchError(FileError):
    """A bench file with faults; the message has the first, `faults` all of them, a line each."""

    def __init__(self, faults: Sequence[str]) -> None:
        more = f" (and {len(faults) - 1} more; `hil check` shows all)" if len(faults) > 1 else ""
        super().__init__(f"{faults[0]}{more}")
        self.faults = tuple(faults)


def bench_error(path: Path, text: str, faults: Sequence[Fault]) -> BenchError:
    """The faults of a bench file as an error, in the order of its text."""
    lines = lines_of(text)
    in_order = sorted(faults, key=lambda fault: line_at(lines, fault.place) or 0)
    return BenchError(list(dict.fromkeys(fault.described(path, lines) for fault in in_order)))
