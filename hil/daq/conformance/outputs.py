"""Whether outputs stand where they were driven: asked of the device, never of what was told to it."""

from __future__ import annotations

from hil.daq.conformance.subject import Subject, agree, expect, quiet_s
from hil.system import system

_COMMANDS, _FEWEST, _COMMANDING_S = 100, 20, 1.0  # so many, but no longer; so few in any case
_KEPT_S = 0.5  # without a word


def drives_as_commanded(subject: Subject) -> None:
    """A value that is driven stands at the device, soon, on either side of the safe value; each line its own."""
    lines = sum(c.kind == "digital" for c in subject.outputs)
    apart = [subject.nth(number) for number in range(2 * lines.bit_length() if lines > 1 else 0)]
    with subject.link() as link:
        for commanded in (*(subject.levels(share) for share in (0.6, 0.25, -0.4, 0.0)), *apart):
            subject.drive(link, commanded)
            subject.stand_there(link, commanded)


def obeys_every_command(subject: Subject) -> str | None:
    """Of many commands in a row every one is obeyed, and what stands goes on standing."""
    _ = subject.outputs
    with subject.link() as link:
        until_s = system.now_s() + _COMMANDING_S
        for number in range(_COMMANDS):
            commanded = subject.nth(number)
            subject.drive(link, commanded)
            subject.stand_there(link, commanded)
            if number + 1 >= _FEWEST and system.now_s() > until_s:
                break
        system.sleep(min(_KEPT_S, quiet_s(link)))
        subject.stand_there(link, commanded, 0.0)
    return None if number + 1 == _COMMANDS else f"tried {number + 1} of {_COMMANDS} commands, a link of this speed"


def reaches_its_limits(subject: Subject) -> str | None:
    """Step by step it goes to both ends of the room that the bench gives it, and its device with it."""
    _ = subject.outputs
    with subject.link() as link:
        for share in (0.7, 0.85, 1.0, -0.7, -0.85, -1.0, 0.0):
            commanded = {c.terminal: subject.towards(c, share) for c in subject.outputs}
            subject.drive(link, commanded)
            subject.stand_there(link, commanded)
    return None if subject.reach >= 1.0 else f"tried {100.0 * subject.reach:.0f} % of the way to the bench's limits"


def goes_to_its_safe_value_on_command(subject: Subject) -> None:
    """The safe value is obeyed as any other, from near it and from far."""
    _ = subject.outputs
    with subject.link() as link:
        for share in (0.5, 0.03, -0.5):
            subject.drive(link, subject.levels(share))
            subject.stand_there(link, subject.levels(share))
            subject.drive(link, subject.safe())
            subject.stand_there(link, subject.safe())


def stands_while_the_link_is_opened_again(subject: Subject) -> str | None:
    """A link that is opened anew, and so remembers nothing, finds outputs where they were driven, or safe."""
    _ = subject.outputs
    commanded = subject.levels(0.5)
    with subject.asking() as link:
        subject.drive(link, commanded)
    with subject.link() as again:
        found = subject.asked(again)
        stands = subject.seen(again)
    for channel in subject.outputs:
        level, at = commanded[channel.terminal], found[channel.terminal]
        expect(
            agree(channel, level, at) or agree(channel, channel.safe, at),
            f"'{channel.name}' was driven to {level:.4g} {channel.unit}; a link opened anew finds it at {at:.4g}",
        )
        expect(
            agree(channel, at, stands[channel.terminal]),
            f"'{channel.name}' stands at {stands[channel.terminal]:.4g}; a link opened anew says {at:.4g}",
        )
    safe = all(agree(c, c.safe, found[c.terminal]) for c in subject.outputs)
    return "it was found safe: closing or opening the link makes it so" if safe else None
