"""Frames of the links are shown to the command that asked for them, and to no other in the same process."""

import logging


def test_debug_of_one_command_does_not_outlast_it(prints):
    links = logging.getLogger("hil.link")
    before = links.level, list(links.handlers)
    assert prints("--debug", "list", "plants")
    assert (links.level, list(links.handlers)) == before
