"""Twins of shipped descriptions with one lie at a time: a named check catches it, and without it all of these pass."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

import pytest

from hil.clock import RealClock
from hil.daq.channel import InputChannel, OutputChannel, Pwm, Wiring
from hil.daq.conformance import CHECKS, Subject, outputs, verdict_of
from hil.description.find import descriptions
from hil.description.read import read_description
from sim_devices._quirks import Quirks
from tests.links import free_port

pytestmark = pytest.mark.xdist_group(
    "waits for lies of descriptions"
)  # for clocks: on one worker, beside others that compute

NAMES = sorted(descriptions())
DRIVES, OBEYS, GOES_SAFE = "drives_as_commanded", "obeys_every_command", "goes_to_its_safe_value_on_command"
_TRIES = 3  # a busy computer is late now and then
WATCHDOG, READS = "has_the_watchdog_that_it_promises", "reads_what_is_there"
WATCHDOG_S = 1.5


class Terminals:
    """What is at the terminals of a device: outputs where it put them, inputs at values of their own."""

    def __init__(self, wiring: Wiring) -> None:
        self.at = {c.terminal: c.safe for c in wiring.outputs.values()}
        self.safe = dict(self.at)
        self.inputs = {c.terminal: c.low + (1 - i if c.kind == "digital" else 0.3 + 0.4 * i) * (c.high - c.low)
                       for i, c in enumerate(wiring.inputs.values())}  # fmt: skip
        self.span = {c.terminal: c.high - c.low for c in wiring.inputs.values()}

    def read(self) -> dict[str, float]:
        return dict(self.inputs)

    def standing(self, terminal: str) -> float:
        return self.at.get(terminal, 0.0)


@dataclass(frozen=True)
class Lie:
    """How a device differs from what it says: what an output that is told `value` becomes, None: nothing moves."""

    check: str
    drives: Callable[[Device, str, float], float | None] = lambda _device, _name, value: value
    moves: Callable[[list[str], str], str] = lambda _names, name: name
    reads: Callable[[Device, str, float], float] = lambda _device, _name, value: value
    needs: Callable[[Wiring, Any], bool] = lambda wiring, _told: bool(wiring.outputs)


class Device:
    """The terminals as the device's own program sees them; a lie stands between it and the world."""

    def __init__(self, world: Terminals, lie: Lie | None) -> None:
        self.world, self.lie, self.commands, self.clock, self.quirks = world, lie, 0, RealClock(), Quirks()

    def drive(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            if name not in self.world.at:
                continue
            self.commands += value != self.world.safe[name]
            told = value if self.lie is None else self.lie.drives(self, name, value)
            if told is not None:
                self.world.at[name if self.lie is None else self.lie.moves([*self.world.at], name)] = told

    def read(self) -> dict[str, float]:
        if self.lie is None:
            return self.world.read()
        return {name: self.lie.reads(self, name, value) for name, value in self.world.read().items()}

    def number(self, terminal: str) -> float:
        return self.read().get(terminal, 0.0)

    def standing(self, terminal: str) -> float:
        return self.world.standing(terminal)

    def modulate(self, terminal: str, pwm: Pwm | None) -> None:
        """Nothing is made of it."""


def _exchanged(names: list[str], name: str) -> str:
    return names[len(names) - 1 - names.index(name)]


def _several(wiring: Wiring, _told: Any) -> bool:
    return len(wiring.outputs) > 1


def _has_inputs(wiring: Wiring, _told: Any) -> bool:
    return bool(wiring.inputs)


def _unless_safe(device: Device, name: str, value: float) -> float | None:
    return None if value == device.world.safe[name] else value


def _graded(wiring: Wiring, _told: Any) -> bool:
    return any(c.kind != "digital" for c in wiring.outputs.values())


def _others(device: Device, name: str, value: float) -> float:
    low_or_high = [v for n, v in device.world.inputs.items() if n != name]
    return low_or_high[0] if low_or_high else value


LIES = {
    "ignores": Lie(DRIVES, lambda _device, _name, _value: None),
    "half scale": Lie(DRIVES, lambda _device, _name, value: 0.5 * value, needs=_graded),
    "wrong sign": Lie(DRIVES, lambda _device, _name, value: -value),
    "2 % too far": Lie(DRIVES, lambda _device, _name, value: 1.02 * value, needs=_graded),
    "exchanges two outputs": Lie(DRIVES, moves=_exchanged, needs=_several),
    "sticks after four commands": Lie(OBEYS, lambda device, _name, value: value if device.commands <= 4 else None),
    "ignores the safe command": Lie(GOES_SAFE, _unless_safe),
    "its watchdog moves nothing": Lie(WATCHDOG, _unless_safe, needs=lambda _wiring, told: _watches(told)),
    "its watchdog goes elsewhere": Lie(
        WATCHDOG, lambda device, name, value: 0.1 * value if value else 0.3 * max(map(abs, device.world.at.values())),
        needs=lambda _wiring, told: _watches(told),
    ),
    "reads half": Lie(READS, reads=lambda _device, _name, value: 0.5 * value, needs=_has_inputs),
    "reads 3 % of its range too much": Lie(
        READS, reads=lambda device, name, value: value + 0.03 * device.world.span[name], needs=_has_inputs
    ),
    "exchanges two inputs": Lie(READS, reads=_others, needs=lambda wiring, _told: len(wiring.inputs) > 1),
}  # fmt: skip


def _watches(told: Any) -> bool:
    return getattr(told, "watchdog", None) is not None


@cache
def _told(name: str) -> Any:
    return read_description(descriptions()[name])


def _wiring(told: Any) -> Wiring:
    """Two outputs and two inputs at most, neighbours first; of broadcasts the first: others are slow."""
    most = 1 if told.protocol == "can" else 2
    ways = {way: [(n, p) for n, p in told.ports.items() if p.direction == way][:most] for way in ("out", "in")}
    safe = getattr(getattr(told, "watchdog", None), "expires_to", None) or 0.0
    return Wiring(
        {n: OutputChannel(n, n, p.kind, p.unit, p.low, p.high, min(max(safe, p.low), p.high)) for n, p in ways["out"]},
        {n: InputChannel(n, n, p.kind, p.unit, p.low, p.high) for n, p in ways["in"]},
    )


@contextmanager
def examined(name: str, lie: Lie | None) -> Iterator[Subject]:
    """The driver before a twin that serves this description, with this lie at its terminals."""
    told = _told(name)
    wiring = _wiring(told)
    driver, twin = (import_module(f"{room}.{told.protocol}") for room in ("drivers", "sim_devices"))
    on_a_bus = told.protocol in ("can", "canopen")
    address = f"virtual:{name}-{id(lie)}" if on_a_bus else f"127.0.0.1:{free_port()}"
    if told.protocol in ("text", "scpi", "ascii_module"):
        address = f"socket://{address}"
    settings: dict[str, Any] = {
        "model": name,
        "address": address,
        "timeout_s": 1.0,
        "longest_reply_s": 1.0,
        **({"node": 5} if told.protocol == "canopen" else {}),
    }
    world = Terminals(wiring)
    if _watches(told) and told.protocol != "can":
        settings["watchdog_s"] = WATCHDOG_S
    served = twin.serve(settings, Device(world, lie), Quirks())

    def spoil(**quirks: Any) -> None:
        served.behaviour.quirks = Quirks(**quirks)

    try:
        yield Subject(driver, driver.Settings.model_validate(settings), wiring, side=world, spoil=spoil)
    finally:
        served.close()


@pytest.fixture(autouse=True)
def few_commands(monkeypatch):
    monkeypatch.setattr(outputs, "_COMMANDS", 8)
    monkeypatch.setattr(outputs, "_KEPT_S", 0.01)


def _asked(name: str) -> list[str]:
    """Of the lies that this device could tell, one or two for each check, other ones for each device."""
    found = []
    for check, most in {DRIVES: 2, OBEYS: 1, GOES_SAFE: 1, WATCHDOG: 1, READS: 1}.items():
        lies = [key for key, lie in LIES.items() if lie.check == check and lie.needs(_wiring(_told(name)), _told(name))]
        found += [lies[(NAMES.index(name) + i) % len(lies)] for i in range(min(most, len(lies)))]
    return found


@pytest.mark.parametrize("name", NAMES)
def test_a_device_that_is_as_described_passes(name):
    for check in sorted({LIES[lie].check for lie in _asked(name)}):
        with examined(name, None) as subject:
            for _ in range(_TRIES):
                verdict, text = verdict_of(CHECKS[check], subject)
                if verdict == "passed":
                    break
        assert verdict == "passed", f"{check}: {text}"


@pytest.mark.parametrize("name", NAMES)
def test_lies_are_caught_by_their_checks(name, monkeypatch):
    monkeypatch.setattr(Subject.stand_there, "__defaults__", (0.1,))  # what lies goes on lying
    for lie in _asked(name):
        with examined(name, LIES[lie]) as subject:
            verdict, text = verdict_of(CHECKS[LIES[lie].check], subject)
        assert verdict == "broken" and "raised" not in text, f"{lie}: {text}"
        assert "'" in text or "left alone" in text, f"{lie}: {text}"


def test_every_shipped_description_is_lied_about():
    assert set(NAMES) == {path.stem for path in descriptions()[NAMES[0]].parent.glob("*.toml")}
    assert {lie for name in NAMES for lie in _asked(name)} == set(LIES)
    assert all(_asked(name) for name in NAMES)
