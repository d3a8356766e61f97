"""Every fault of a file that was written by hand, a line each, and how many there are as the error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import typer

from hil.errors import FileError


class FaultsError(FileError):
    """A file has faults; `faults` are those, a sentence each."""

    def __init__(self, path: Path, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        super().__init__(f"{path}: {len(faults)} fault{'s' if len(faults) > 1 else ''}")


@contextmanager
def each_reported(path: Path, *, as_json: bool = False) -> Iterator[None]:
    """While a file is read, whose faults are printed; the error has them for a program that asked for JSON.

    Raises:
        FaultsError: it has some.
    """
    from hil.bench.fault import BenchError

    try:
        yield
    except BenchError as error:
        if not as_json:
            typer.echo("\n".join(error.faults))
        raise FaultsError(path, error.faults) from None
