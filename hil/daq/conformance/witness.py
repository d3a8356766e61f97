"""What an input of the bench sees of an output: the only proof where a device repeats what it was told."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hil.daq.channel import OutputChannel
from hil.daq.conformance.subject import Broken, LeftOut, Subject, Witness
from hil.system import system

Readings = Mapping[str, np.ndarray]
_READINGS = 10
_BEYOND_NOISE = 6.0  # standard deviations of a mean: a response, and not noise
_BEYOND_ROUNDING = 1e-3  # of an input's range


def an_input_sees_what_it_drives(subject: Subject) -> str | None:
    """An input that measures the output, or answers to it, sees it move: a device may repeat what it was told."""
    _ = subject.outputs
    if subject.witnesses:
        notes = [
            _measured(subject, subject.wiring.outputs[name], witness) for name, witness in subject.witnesses.items()
        ]
        return "; ".join(text for text in notes if text) or None
    if subject.side is not None:
        raise LeftOut("the twin's terminals were looked at instead")
    if not subject.responses:
        raise LeftOut("cannot tell: no channel measures it; the device may repeat what it was told (--measured-by)")
    return _answered(subject)


def measured_at(subject: Subject, commanded: Callable[[OutputChannel], float], after: str) -> None:
    """Every output that an input measures is seen where it should be, over a link that has driven nothing.

    Raises:
        Broken: it is not.
    """
    for name, witness in subject.witnesses.items():
        channel = subject.wiring.outputs[name]
        with subject.asking() as link, witness.readings(link) as read:
            _seen(witness, channel, commanded(channel), read, subject.settling_s, after)


def _measured(subject: Subject, channel: OutputChannel, witness: Witness) -> str:
    """Drive it to both sides, as far as the input can show; what is to be said where that is not the whole way."""
    low, high = _levels_in_range(witness)
    can_show_safe, hidden = low <= channel.safe <= high, False
    with subject.link() as link, witness.readings(link) as read:
        for share in (0.5, -0.5, 0.9, -0.9, 0.1, 0.0):
            asked = subject.towards(channel, share)
            level = min(max(asked, low), high)
            hidden = hidden or level != asked
            if level != asked and (channel.kind == "digital" or not can_show_safe):
                continue
            subject.drive(link, subject.safe() | {channel.terminal: level})
            _seen(witness, channel, level, read, subject.settling_s, f"driven to {level:.4g} {channel.unit}")
    if not hidden:
        return ""
    return f"'{witness.channel.name}' can show '{channel.name}' from {low:.4g} to {high:.4g} {channel.unit} alone"


def _levels_in_range(witness: Witness) -> tuple[float, float]:
    """Which levels of the output lie within the input's range; a little less: an input at its end proves nothing."""
    at_zero = witness.expected(0.0)
    slope = witness.expected(1.0) - at_zero
    ends = (witness.channel.low + 2.0 * witness.allowed, witness.channel.high - 2.0 * witness.allowed)
    low, high = sorted((end - at_zero) / slope for end in ends)
    return low, high


def _seen(
    witness: Witness, channel: OutputChannel, level: float, read: Callable[[], float], longest_s: float, after: str
) -> None:
    until_s = system.now_s() + longest_s
    while not abs((reads := read()) - witness.expected(level)) <= witness.allowed:  # NaN is no measurement
        if system.now_s() > until_s:
            raise Broken(
                f"'{channel.name}' was {after}; '{witness.channel.name}', which measures it, reads {reads:.4g} "
                f"{witness.channel.unit}, not {witness.expected(level):.4g}"
            )
        system.sleep(0.005)


def _answered(subject: Subject) -> str:
    """A response differs between one side of an output's safe value and the other; one output after the other."""
    commanded = subject.levels(0.5)
    answers: dict[str, str] = {}
    with subject.link() as link:
        before = _commanded_twice(subject, link, commanded)
        for channel in subject.outputs:
            commanded |= {channel.terminal: subject.levels(-0.5)[channel.terminal]}
            subject.drive(link, commanded)
            after = _settled(subject, link)
            answers |= {name: channel.name for name in subject.responses if _differ(subject, name, before, after)}
            before = after
    if not answers:
        text = ", ".join(
            f"'{n}' reads {after[n].mean():.4g} {subject.wiring.inputs[n].unit}" for n in subject.responses
        )
        raise Broken(
            f"{text} whether driven to one side or to the other: the device does not do what it says, or the supply is "
            f"off"
        )
    pairs = ", ".join(f"'{name}' answers to '{output}'" for name, output in answers.items())
    unseen = ", ".join(f"'{c.name}'" for c in subject.outputs if c.name not in answers.values())
    nothing = f"; nothing answers to {unseen}" if unseen else ""
    return f"{pairs}{nothing}; by how much it should is not known (--measured-by OUTPUT=INPUT compares values)"


def _commanded_twice(subject: Subject, link: Any, commanded: Mapping[str, float]) -> Readings:
    """Drive there, and once more: what stood still must not move when it is told the same again."""
    subject.drive(link, commanded)
    first = _settled(subject, link)
    still = _settled(subject, link)
    subject.drive(link, commanded)
    again = _settled(subject, link)
    for name in subject.responses:
        if _differ(subject, name, still, again) and not _differ(subject, name, first, still):
            raise Broken(
                f"'{name}' stood at {still[name].mean():.4g} {subject.wiring.inputs[name].unit}, and went to "
                f"{again[name].mean():.4g} when the same was told again: the device obeys the command before"
            )
    return again


def _differ(subject: Subject, name: str, one: Readings, other: Readings) -> bool:
    """Whether a response has moved, beyond noise and rounding."""
    channel = subject.wiring.inputs[name]
    noise = float(np.hypot(one[name].std(), other[name].std())) / np.sqrt(_READINGS)
    least = max(_BEYOND_NOISE * noise, _BEYOND_ROUNDING * (channel.high - channel.low))
    return bool(abs(one[name].mean() - other[name].mean()) > least)


def _settled(subject: Subject, link: Any) -> Readings:
    until_s = system.now_s() + subject.settling_s
    while system.now_s() < until_s:
        link.read()  # a watchdog shall not take us for dead
        system.sleep(0.02)
    rows = []
    for _ in range(_READINGS):
        system.sleep(0.01)
        rows.append(link.read())
    return {name: np.array([row[subject.wiring.inputs[name].terminal] for row in rows]) for name in subject.responses}
