"""Commands of `hil` within this process, where what is wrong is raised and not said."""

from __future__ import annotations

from typer.testing import CliRunner

from hil.cli.app import assembled


def hil(*words: str) -> str:
    """What a command prints."""
    result = CliRunner().invoke(assembled(), list(words))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.output
