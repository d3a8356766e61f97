"""Frames of the links are shown to the command that asked for them, and to no other in the same process."""

import logging


def test_debug_of_one_command_does_not_outlast_it(command_line):
    links = logging.getLogger("hil.link")
    before = links.level, list(links.handlers)
    status, out, _ = command_line("--debug", "list", "plants")
    assert status == 0 and out
    assert (links.level, list(links.handlers)) == before
