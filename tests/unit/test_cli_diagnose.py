"""Recordings of before on the command line."""

import pytest
import typer
from typer.main import get_command

from hil.cli.commands import diagnose


@pytest.mark.parametrize(
    ("words", "later", "before"),
    [
        (["x.csv", "--before", "a.csv", "b.csv", "--out", "d"], ["x.csv"], ["a.csv", "b.csv"]),
        (["--before", "a.csv", "x.csv", "--out", "d"], ["x.csv"], ["a.csv"]),
        (["--before", "a.csv", "--before", "b.csv", "--out", "d", "x.csv"], ["x.csv"], ["a.csv", "b.csv"]),
        (["x.csv", "y.csv", "--out", "d"], ["x.csv", "y.csv"], []),
    ],
)
def test_words_behind_before_are_of_before(words, later, before):
    app = typer.Typer()
    app.command(cls=diagnose.Command)(diagnose.command)
    asked = get_command(app)
    with asked.make_context("diagnose", ["--model", "m.json", *words]) as context:
        assert [str(path) for path in context.params["recordings"]] == later
        assert [str(path) for path in context.params["before"]] == before
