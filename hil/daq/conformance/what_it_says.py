"""What a driver says before anything is driven."""

from __future__ import annotations

import math
from contextlib import suppress

from hil.daq.conformance.subject import Broken, LeftOut, Subject, agree, expect
from hil.daq.pin import opened_alone
from hil.errors import HardwareError
from hil.system import system
from hil.units import check_unit

LONGEST_S = 5.0  # for anything that a driver does


def says_what_it_is(subject: Subject) -> None:
    """Its first line says what it drives; its terminals have units and ranges that make sense."""
    expect(bool((subject.module.__doc__ or "").strip()), "the module has no docstring; `hil list` shows its first line")
    terminals = subject.module.terminals(subject.settings)
    expect(bool(terminals), "it offers no terminals")
    for name, terminal in terminals.items():
        check_unit(terminal.unit)
        in_order = math.isfinite(terminal.low) and math.isfinite(terminal.high) and terminal.low < terminal.high
        expect(in_order, f"terminal '{name}' has the range {terminal.low:g} … {terminal.high:g}")
    used = [c.terminal for c in subject.wiring.outputs.values()] + [c.terminal for c in subject.wiring.inputs.values()]
    for terminal_name in used:
        expect(terminal_name in terminals, f"no terminal '{terminal_name}'")


def says_soon_that_nobody_is_there(subject: Subject) -> None:
    """Without a device it raises a `HardwareError`, and soon."""
    if subject.another_address is None:
        raise LeftOut("real hardware is there")
    begun_s = system.now_s()
    try:
        link = opened_alone(subject.module, subject.another_address, subject.wiring)
    except HardwareError:
        taken_s = system.now_s() - begun_s
        expect(taken_s < LONGEST_S, f"it took {taken_s:.1f} s to say so")
    else:
        with suppress(HardwareError):
            link.close()
        raise Broken("it opened a device where none is")


def leaves_outputs_where_they_are(subject: Subject) -> None:
    """Opening it moves no output but to its safe value, and tells where they stand."""
    with subject.daq() as daq:
        for name, channel in daq.outputs.items():
            level = daq.levels[name]
            expect(channel.low <= level <= channel.high, f"'{name}' is told at {level:g} {channel.unit}")
            if subject.side is not None:
                stands = subject.side.standing(channel.terminal)
                expect(agree(channel, level, stands), f"'{name}' stands at {stands:g}, it is told at {level:g}")
