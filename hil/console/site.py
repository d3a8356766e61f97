"""What a console may show and start: benches, procedures and runs by name; no path comes from a browser."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

from hil.archive.place import Place
from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.errors import FileError, UnknownNameError
from hil.record.run_folder.header import HEADER_FILE
from hil.untrusted import MOST_TOML_BYTES, is_regular, read_small

_ANEW_S = 5.0
_NAME = re.compile(r"^[^\x00-\x1f/\\]{1,200}$")


class NotHereError(FileError):
    """What a page was asked for is not there."""


@dataclass(frozen=True, slots=True)
class Site:
    """Where a console works.

    Attributes:
        place: the archive.
        runs: the folder in which runs lie and new ones are made.
        benches: the folder in which bench files of this lab lie, beside those that are installed.
        state: for the console's own files: logs of what it started, uploads.
    """

    place: Place
    runs: Path
    benches: Path
    state: Path

    def bench_files(self) -> Mapping[str, Path]:
        """Every bench by name: those of the lab's folder first, then the installed ones."""
        own = {path.stem: path for path in sorted(self.benches.glob("*.toml")) if _is_bench(path)}
        return {**own, **{name: path for name, path in _installed().items() if name not in own}}

    def bench_path(self, name: str) -> Path:
        """Where the bench file of that name lies.

        Raises:
            UnknownNameError: there is none.
        """
        known = self.bench_files()
        if name not in known:
            raise UnknownNameError("bench", name, known)
        return known[name]

    def bench(self, name: str) -> BenchFile:
        """The bench of that name.

        Raises:
            UnknownNameError: there is none.
            FileError, BenchError: its file has faults.
        """
        path = self.bench_path(name)
        return _read(path, path.stat().st_mtime_ns, int(time.monotonic() / _ANEW_S))

    def run(self, name: str) -> Path:
        """The folder of a run, by its name in the folder of runs.

        Raises:
            NotHereError: no run of that name; a name that leads out of the folder is none.
        """
        folder = self.runs / name
        plain = _NAME.match(name) is not None and not name.startswith(".")
        if not plain or not is_regular(self.runs, f"{name}/{HEADER_FILE}"):
            raise NotHereError(f"no run '{name:.80}' in {self.runs}")
        return folder


def _is_bench(path: Path) -> bool:
    try:
        return path.is_file() and _has_channels(path, path.stat().st_mtime_ns)
    except OSError:
        return False


@lru_cache(maxsize=256)
def _has_channels(path: Path, _changed_ns: int) -> bool:
    try:
        text = read_small(path, MOST_TOML_BYTES).decode("utf-8")
        return "[channels" in text or "based_on" in text
    except (OSError, UnicodeDecodeError, FileError):
        return False


@lru_cache(maxsize=16)
def _read(path: Path, _changed_ns: int, _age: int) -> BenchFile:
    """A bench file: read anew when it has changed, and now and then, since what it is based on may have."""
    return read_bench(path)


@cache
def _installed() -> Mapping[str, Path]:
    return benches()
