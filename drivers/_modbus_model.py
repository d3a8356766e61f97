"""A kind of Modbus device: its registers, and what it needs to be made safe, to obey, and to be asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from drivers._registers import Flag, Register, WordOrder
from hil.daq.channel import Terminal, Wiring
from hil.description.modbus import TIMES, safe_of
from hil.description.modbus_place import Table
from hil.errors import SettingError


@dataclass(frozen=True, slots=True)
class Step:
    """One write: where, and a number or one of the placeholders of `Model.watchdog`."""

    address: int
    value: int | str
    table: Table = "holding"


@dataclass(frozen=True, slots=True)
class Enabling:
    """What outputs need before they obey.

    Attributes:
        steps: written with the outputs at their safe values.
        ready: what is so when they obey; None where the device does not tell.
        patience_s: how long that is waited for.
        undo: written when the device is let go of.
    """

    steps: Sequence[Step] = ()
    ready: Flag | None = None
    patience_s: float = 2.0
    undo: Sequence[Step] = ()


@dataclass(frozen=True, slots=True)
class Model:
    """A kind of device.

    Attributes:
        registers: by terminal.
        watchdog: how its watchdog is armed over Modbus: registers and what is written to them in this order, numbers
            or `{tenths}`, `{seconds}`, `{ms}` (its time in that unit) and `{safe:TERMINAL}` (the count of the safe
            value of the channel on that terminal; nothing is written where none is connected). Empty when it is set
            by other means, and the bench file then only says how it was set.
        expires_to: where the device puts its outputs when its watchdog expires, if it is always the same; it is
            armed only where that is every channel's safe value.
        safe_status, clear_safe: first coil of the flags by output that say that the device has made it safe, and of
            those that end it.
        enabling: what outputs need before they obey.
        faults: what the device reports; looked at when it is opened and with each reading back.
        clear: written when one is so at opening.
        clear_patience_s: how long they may take to go.
        gap, longest_read, longest_write: how registers are put together in requests.
        pause_s, echo: of every device of its kind.
        may_have_watchdog: whether it has one at all.
    """

    registers: Mapping[str, Register]
    watchdog: Sequence[tuple[int, int | str] | Step] = ()
    expires_to: float | None = None
    safe_status: int | None = None
    clear_safe: int | None = None
    word_order: WordOrder = "big"
    enabling: Enabling = field(default_factory=Enabling)
    faults: Sequence[Flag] = ()
    clear: Sequence[Step] = ()
    clear_patience_s: float = 1.0
    gap: int = 0
    longest_read: int = 125
    longest_write: int = 123
    pause_s: float = 0.0
    echo: bool = False
    may_have_watchdog: bool = True

    def __post_init__(self) -> None:
        for step in self.arming:
            if isinstance(step.value, str):
                _check_placeholder(step.address, step.value, self.registers)

    @property
    def arming(self) -> tuple[Step, ...]:
        """What is written to arm its watchdog."""
        return tuple(step if isinstance(step, Step) else Step(*step) for step in self.watchdog)

    @property
    def outputs(self) -> dict[str, Register]:
        """Registers of outputs by terminal."""
        return {name: register for name, register in self.registers.items() if register.direction == "out"}

    @property
    def terminals(self) -> dict[str, Terminal]:
        """The register map as terminals."""
        return {
            name: Terminal(r.direction, r.kind, r.unit, r.low, r.high, step=r.step)
            for name, r in self.registers.items()
        }


def check_level(model: Model, wiring: Wiring) -> None:
    """Refuse a watchdog that would put an output elsewhere than at its safe value.

    Raises:
        SettingError: names the output, where it would go and where it is safe.
    """
    for name, channel in wiring.outputs.items():
        register = model.registers[channel.terminal]
        goes_to = channel.safe if model.expires_to is None else model.expires_to
        if register.words_of(goes_to, "big") != register.words_of(channel.safe, "big"):
            raise SettingError(
                f"watchdog_s: when it expires the device puts {channel.terminal} at {goes_to:g} {register.unit}, but "
                f"'{name}' is safe at {channel.safe:g} {register.unit}; take watchdog_s away, or connect the valve so "
                f"that {goes_to:g} {register.unit} is safe{_where_it_can_be_set(model)}"
            )


def levels_of(model: Model) -> dict[str, float]:
    """Where the watchdog of a device of this model puts its outputs, if that is always the same."""
    return {} if model.expires_to is None else dict.fromkeys(model.outputs, model.expires_to)


def _where_it_can_be_set(model: Model) -> str:
    return "" if model.watchdog else ", or set that at the device and say so with watchdog_level"


def _check_placeholder(address: int, text: str, registers: Mapping[str, Register]) -> None:
    if text in TIMES or ((safe := safe_of(text)) in registers and registers[safe].direction == "out"):
        return
    raise SettingError(
        f"Model.watchdog: '{text}' for register {address:#06x}: a number, {', '.join(TIMES)} or "
        f"{{safe:TERMINAL}} with the name of an output"
    )
