"""Frames of the links are shown to the command that asked for them, and to no other in the same process."""

import logging

from hil.cli import app


def test_debug_of_one_command_does_not_outlast_it(monkeypatch, capsys):
    links = logging.getLogger("hil.link")
    before = links.level, list(links.handlers)
    monkeypatch.setattr("sys.argv", ["hil", "--debug", "list", "plants"])
    assert app.main() == 0
    assert (links.level, list(links.handlers)) == before
    assert capsys.readouterr().out
