"""Every fault of a file that was written by hand, a line each, and how many there are as the error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer


@contextmanager
def each_reported(path: Path) -> Iterator[None]:
    """While a file is read, whose faults are printed.

    Raises:
        FileError: it has some.
    """
    from hil.bench.fault import BenchError
    from hil.errors import FileError

    try:
        yield
    except BenchError as error:
        typer.echo("\n".join(error.faults))
        count = len(error.faults)
        raise FileError(f"{path}: {count} fault{'s' if count > 1 else ''}") from None
