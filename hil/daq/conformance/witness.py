"""What an input of the bench sees of an output: the only proof where a device repeats what it was told."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from hil.daq.channel import OutputChannel
from hil.daq.conformance.subject import Broken, LeftOut, Subject, Witness

_READINGS = 10
_BEYOND_NOISE = 6.0  # standard deviations of a mean: a response, and not noise
_BEYOND_ROUNDING = 1e-3  # of an input's range


def an_input_sees_what_it_drives(subject: Subject) -> str | None:
    """An input that measures the output, or answers to it, sees it move: a device may repeat what it was told."""
    _ = subject.outputs
    if subject.witnesses:
        for name, witness in subject.witnesses.items():
            _measured(subject, subject.wiring.outputs[name], witness)
        return None
    if subject.side is not None:
        raise LeftOut("the twin's terminals were looked at instead")
    if not subject.responses:
        raise LeftOut("cannot tell: no channel measures it; the device may repeat what it was told (--measured-by)")
    return _answered(subject)


def measured_at(subject: Subject, told: Callable[[OutputChannel], float], after: str) -> None:
    """Every output that an input measures is seen where it should be, over a link that has driven nothing.

    Raises:
        Broken: it is not.
    """
    for name, witness in subject.witnesses.items():
        channel = subject.wiring.outputs[name]
        with subject.asking() as link, witness.readings(link) as read:
            _seen(witness, channel, told(channel), read, subject.settling_s, after)


def _measured(subject: Subject, channel: OutputChannel, witness: Witness) -> None:
    with subject.link() as link, witness.readings(link) as read:
        for share in (0.5, -0.5, 0.9, -0.9, 0.1, 0.0):
            level = subject.towards(channel, share)
            if not witness.channel.low <= witness.expected(level) <= witness.channel.high:
                continue  # the input cannot show it
            subject.drive(link, subject.safe() | {channel.terminal: level})
            _seen(witness, channel, level, read, subject.settling_s, f"driven to {level:.4g} {channel.unit}")


def _seen(
    witness: Witness, channel: OutputChannel, level: float, read: Callable[[], float], longest_s: float, after: str
) -> None:
    until_s = time.monotonic() + longest_s
    while not abs((reads := read()) - witness.expected(level)) <= witness.allowed:  # NaN is no measurement
        if time.monotonic() > until_s:
            raise Broken(
                f"'{channel.name}' was {after}; '{witness.channel.name}', which measures it, reads {reads:.4g} "
                f"{witness.channel.unit}, not {witness.expected(level):.4g}"
            )
        time.sleep(0.005)


def _answered(subject: Subject) -> str:
    """A response differs between one side of the safe value and the other."""
    with subject.link() as link:
        subject.drive(link, subject.levels(0.5))
        _waited(subject, link)
        before = _taken(subject, link)
        subject.drive(link, subject.levels(-0.5))
        _waited(subject, link)
        after = _taken(subject, link)
    for name in subject.responses:
        one, other = before[name], after[name]
        channel = subject.wiring.inputs[name]
        noise = float(np.hypot(one.std(), other.std())) / np.sqrt(_READINGS)
        least = max(_BEYOND_NOISE * noise, _BEYOND_ROUNDING * (channel.high - channel.low))
        if abs(float(one.mean() - other.mean())) > least:
            return f"'{name}' answers; by how much it should is not known (--measured-by OUTPUT=INPUT compares values)"
    text = ", ".join(f"'{name}' reads {after[name].mean():.4g} {subject.wiring.inputs[name].unit}" for name in before)
    raise Broken(
        f"{text} whether driven to one side or to the other: the device does not do what it says, or the supply is off"
    )


def _waited(subject: Subject, link: Any) -> None:
    until_s = time.monotonic() + subject.settling_s
    while time.monotonic() < until_s:
        link.read()  # a watchdog shall not take us for dead
        time.sleep(0.02)


def _taken(subject: Subject, link: Any) -> dict[str, np.ndarray]:
    rows = []
    for _ in range(_READINGS):
        time.sleep(0.01)
        rows.append(link.read())
    return {name: np.array([row[subject.wiring.inputs[name].terminal] for row in rows]) for name in subject.responses}
