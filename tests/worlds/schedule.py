"""What happens to a run in a world: drawn from a seed, or read from its code."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

DEVICES = ("io", "aux")
THIRD = "third"
THIRDS = {"m": "module", "s": "source", "p": "amplifier", "v": "valve", "n": "node", "d": "driver", "t": "controller"}
"""Devices that may stand beside those two, by their mark in a code: four on a serial line, three on CAN."""
PHASES = ("opening", "driving", "making safe", "closing")
PROCEDURES = ("plain", "steps", "swallows", "raises", "exits", "blocks", "leaves early", "stays")
KINDS = {
    "out": "network", "hold": "network", "double": "network", "slow line": "network", "reset": "network",
    "switch": "network", "lose": "network", "garble": "network", "echo": "network", "fails": "device",
    "claims": "device", "deaf": "device", "mute": "device", "slow": "device", "lies": "device", "restart": "device",
    "over": "device", "low": "device", "pressed": "device", "swap": "device",
    "sticks": "device", "poke": "device", "crowd": "network", "passive": "network",
    "int": "signal", "term": "signal", "hup": "signal", "kill": "process", "pause": "process",
    "wd term": "process", "wd kill": "process", "wd pause": "process", "fork": "process",
    "stop": "person", "hold run": "person", "second": "person",
    "sleep": "machine", "disk full": "machine", "disk slow": "machine", "disk gone": "machine", "sector": "machine",
    "power": "machine", "clock": "machine",
}  # fmt: skip
_OF_THIRD = {
    "module": {"garble", "echo"}, "source": {"garble", "echo"}, "amplifier": {"garble", "echo", "fails"},
    "controller": {"garble", "echo"}, "valve": {"fails", "claims", "passive"}, "node": {"passive"},
    "driver": {"passive"}, "": set[str](),
}  # fmt: skip
_OF_COUPLERS = {"swap", "over", "low", "pressed", "sticks", "crowd"}
_WITH_DEVICE = {kind for kind, of in KINDS.items() if of in ("network", "device")} - {"switch"}
_AT_ONCE = {"poke", "claims", "swap", "int", "term", "hup", "kill", "wd term", "wd kill", "stop", "sector", "power"}
CALM = {"int", "term", "hup", "stop", "wd term", "wd kill", "wd pause", "fork", "second", "low", "over", "pressed",
        "hold run", "sector", "clock"}  # fmt: skip
"""Faults that touch no device and no way to one, and hold nobody up."""
NO_DISK = {"disk full", "disk gone"}
ARRIVES_LATE = {"hold", "double", "slow line", "swap", "lose", "garble", "echo", "slow", "passive"}
"""What makes that what is on its way may come later, or in another order."""
BLOCK_S, _LONG_BLOCK_S = 0.1, 0.5
_ALL = 0.15  # chance that a fault of one device, or of the way to it, strikes every one: a cabinet, a switch, a supply
_TIMES_S = (0.05, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that happens.

    Attributes:
        kind: a key of `KINDS`.
        phase: of the run, after whose begin it happens.
        after_s: so long after.
        lasts_s: for so long, where it lasts.
        device: to which.
    """

    kind: str
    phase: str
    after_s: float
    lasts_s: float = 0.0
    device: str = ""

    @property
    def code(self) -> str:
        return ":".join((self.kind, self.phase, f"{self.after_s:g}", f"{self.lasts_s:g}", self.device))

    @classmethod
    def of(cls, code: str) -> Fault:
        kind, phase, after_s, lasts_s, device = code.split(":")
        return cls(kind, phase, float(after_s), float(lasts_s), device)


@dataclass(frozen=True, slots=True)
class Schedule:
    """A world.

    Attributes:
        seed: of everything that is drawn while it goes on.
        hurry: chance that a call of the seam takes a task away.
        procedure: what is run.
        armed: whether devices have watchdogs of their own.
        ramped: whether the command goes down a ramp.
        away: whether outputs are found away from their safe values.
        long: whether a block is of half a second, and not of a tenth.
        third: a device beside the couplers, of `THIRDS`; empty: none.
        faults: what happens.
    """

    seed: int
    hurry: float = 0.05
    procedure: str = "plain"
    armed: bool = False
    ramped: bool = False
    away: bool = False
    long: bool = False
    third: str = ""
    faults: tuple[Fault, ...] = field(default=())

    @property
    def code(self) -> str:
        """All of it, on one line."""
        third = "".join(mark for mark, name in THIRDS.items() if name == self.third)
        marks = "w" * self.armed + "r" * self.ramped + "a" * self.away + "b" * self.long + third or "-"
        head = f"{self.seed},{self.hurry:g},{self.procedure},{marks}"
        return "|".join((head, *(fault.code for fault in self.faults)))

    @property
    def block_s(self) -> float:
        """So long a block lasts."""
        return _LONG_BLOCK_S if self.long else BLOCK_S

    @classmethod
    def of(cls, code: str) -> Schedule:
        head, *faults = code.split("|")
        seed, hurry, procedure, marks = head.split(",")
        third = "".join(name for mark, name in THIRDS.items() if mark in marks)
        return cls(int(seed), float(hurry), procedure, "w" in marks, "r" in marks, "a" in marks, "b" in marks, third,
                   tuple(map(Fault.of, faults)))  # fmt: skip


def drawn(seed: int) -> Schedule:
    """One of all: one to four faults, half of them close behind another one; some strike several devices at once."""
    draw = random.Random(f"schedule {seed}")
    third = draw.choices(("", *THIRDS.values()), (len(THIRDS), *[1] * len(THIRDS)))[0]
    kinds = kinds_with(third)
    faults: list[Fault] = []
    for _ in range(draw.choice((1, 1, 2, 2, 2, 3, 3, 4))):
        kind = draw.choice(kinds)
        near = draw.choice(faults) if faults and draw.random() < 0.5 else None
        phase = near.phase if near else draw.choices(PHASES, (2, 5, 4, 2))[0]
        after_s = _after_s(draw, phase)
        if near:
            after_s = max(0.0, near.after_s + draw.choice((-1, 1)) * min(after_s, draw.expovariate(5.0)))
        there = _devices(kind, third) if kind in _WITH_DEVICE else ("",)
        strikes_all = draw.random() < _ALL and kind not in _OF_COUPLERS
        struck = sorted(set(there)) if strikes_all else [draw.choice(there)]
        lasts_s = 0.0 if kind in _AT_ONCE else draw.choice(_TIMES_S)
        faults += [Fault(kind, phase, round(after_s, 4), lasts_s, device) for device in struck]
    marks = [draw.random() < 0.3 for _ in range(4)]
    return Schedule(seed, draw.choice((0.01, 0.05, 0.2)), draw.choice(PROCEDURES), *marks, third, tuple(faults))


def _after_s(draw: random.Random, phase: str) -> float:
    """So long after a phase began; the short ones are over within milliseconds, or last for seconds."""
    if phase in ("opening", "driving"):
        return draw.uniform(0.0, {"opening": 2.0, "driving": 4.0}[phase])
    return 10.0 ** draw.uniform(-4.0, -0.3)


def kinds_with(third: str) -> list[str]:
    """What can happen beside a third device."""
    never = set.union(*_OF_THIRD.values()) - _OF_THIRD[third]
    return [kind for kind in KINDS if kind not in never]


def _devices(kind: str, third: str) -> tuple[str, ...]:
    """To which it can happen; to the third one as often as to both others."""
    if kind in _OF_THIRD[third]:
        return (THIRD,)
    return DEVICES if not third or kind in _OF_COUPLERS else (*DEVICES, THIRD, THIRD)
