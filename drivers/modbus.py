"""Modbus TCP and RTU: analogue I/O modules and flow meters, each a register map in this file.

Registers of the WAGO coupler and of the ioLogik modules are those of their manuals, but which modules sit behind the
coupler, and in which order, is our choice. **The whole map of `flow-meter` is our choice**: makers agree on nothing
but on floats in two registers each; put those of the meter's manual in its place.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NoReturn

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt

from drivers._watchdog import DeviceWatchdog
from hil.daq.channel import Direction, Kind, Terminal, Wiring
from hil.daq.polled import PolledDaq
from hil.errors import DeviceLostError, LinkError, SettingError

Format = Literal["u16", "s16", "f32"]
WordOrder = Literal["big", "little"]
_CHECK_S = 0.5  # how often outputs are read back: another master, or a device that restarted
_IMPLAUSIBLE = 10.0  # a float so many times its full scale, or so small, was put together in the wrong order


@dataclass(frozen=True, slots=True)
class Register:
    """Where a terminal stands in the registers of a device: value = slope · count + offset.

    Attributes:
        table: `input` (read by function 4) or `holding` (3, 6, 16).
        address: counted from 0, as it stands on the wire.
        read_back: address of an output's read-back in the holding registers, where that is another one.
    """

    direction: Direction
    kind: Kind
    unit: str
    low: float
    high: float
    table: Literal["input", "holding"]
    address: int
    format: Format = "u16"
    slope: float = 1.0
    offset: float = 0.0
    read_back: int | None = None

    @property
    def words(self) -> int:
        """Registers that it takes."""
        return 2 if self.format == "f32" else 1

    def count_of(self, value: float) -> int:
        """A value as the register takes it, 0 … 65535."""
        count = round((value - self.offset) / self.slope)
        return max(-0x8000, min(0x7FFF, count)) & 0xFFFF if self.format == "s16" else max(0, min(0xFFFF, count))

    def value_of(self, words: Sequence[int], order: WordOrder) -> float:
        """What registers say."""
        if self.format == "f32":
            return float32(words, order)
        count = words[0] - 0x10000 if self.format == "s16" and words[0] >= 0x8000 else words[0]
        return self.slope * count + self.offset


def float32(words: Sequence[int], order: WordOrder) -> float:
    """Two registers as a floating-point number, the high word first (`big`) or last."""
    from pymodbus.client.mixin import ModbusClientMixin as Mixin

    return float(Mixin.convert_from_registers(list(words), Mixin.DATATYPE.FLOAT32, word_order=order))  # type: ignore[arg-type]


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
    """

    registers: Mapping[str, Register]
    watchdog: Sequence[tuple[int, int | str]] = ()
    expires_to: float | None = None
    safe_status: int | None = None
    clear_safe: int | None = None
    word_order: WordOrder = "big"

    def __post_init__(self) -> None:
        for address, value in self.watchdog:
            if isinstance(value, str):
                _check_placeholder(address, value, self.registers)

    @property
    def terminals(self) -> dict[str, Terminal]:
        """The register map as terminals."""
        return {name: Terminal(r.direction, r.kind, r.unit, r.low, r.high) for name, r in self.registers.items()}


_PER_SECOND = {"{tenths}": 10.0, "{seconds}": 1.0, "{ms}": 1000.0}


def _check_placeholder(address: int, text: str, registers: Mapping[str, Register]) -> None:
    if text in _PER_SECOND or ((safe := _safe_of(text)) in registers and registers[safe].direction == "out"):
        return
    raise SettingError(
        f"Model.watchdog: '{text}' for register {address:#06x}: a number, {', '.join(_PER_SECOND)} or "
        f"{{safe:TERMINAL}} with the name of an output"
    )


def _safe_of(text: str) -> str:
    """The terminal of `{safe:TERMINAL}`, else nothing."""
    return text.removeprefix("{safe:").removesuffix("}") if text.startswith("{safe:") and text.endswith("}") else ""


def _analogue(
    count: int, prefix: str, direction: Direction, table: Literal["input", "holding"], first: int, **more: Any
) -> dict[str, Register]:
    """Neighbouring registers of the same kind."""
    step = 2 if more.get("format") == "f32" else 1
    back = more.pop("read_back", None)
    return {
        f"{prefix}{i}": Register(
            direction, more.get("kind", "voltage"), more.get("unit", "V"), more["low"], more["high"], table,
            first + step * i, more.get("format", "u16"), more.get("slope", 1.0), more.get("offset", 0.0),
            None if back is None else back + i,
        )
        for i in range(count)
    }  # fmt: skip


MODELS: Mapping[str, Model] = {
    # WAGO 750-352 with 750-557 (4 AO) and 750-457 (4 AI), our choice of modules: ±10 V are ±0x7FFF in two's complement,
    # inputs from 0x0000, outputs from 0x0000 and read back from 0x0200. Unless the watchdog is armed, outputs keep
    # their last value when the link fails; the alternative one (0x100A) starts with the first request and sets outputs
    # to zero.
    "wago-750": Model(
        {
            **_analogue(4, "ao", "out", "holding", 0x0000, low=-10.0, high=10.0, format="s16",
                        slope=10.0 / 0x7FFF, read_back=0x0200),
            **_analogue(4, "ai", "in", "input", 0x0000, low=-10.0, high=10.0, format="s16", slope=10.0 / 0x7FFF),
        },
        watchdog=((0x100A, 0), (0x1008, 0xAA55), (0x1000, "{tenths}"), (0x100A, 1)), expires_to=0.0,
    ),
    # Moxa ioLogik E1241: 4 AO of 12 bit, 0 … 10 V; its watchdog and safe values are set on its web page.
    "iologik-e1241": Model(
        _analogue(4, "ao", "out", "holding", 0x0400, low=0.0, high=10.0, slope=10.0 / 4095),
        safe_status=0x1010, clear_safe=0x1020,
    ),
    # Moxa ioLogik E1240: 8 AI of 16 bit, 0 … 10 V.
    "iologik-e1240": Model(_analogue(8, "ai", "in", "input", 0x0000, low=0.0, high=10.0, slope=10.0 / 0xFFFF)),
    # A flow meter with floats: flow [l/min] and oil temperature [°C] in two input registers each; addresses and ranges
    # are ours, of no maker.
    "flow-meter": Model(
        {
            "flow": Register("in", "value", "l/min", -500.0, 500.0, "input", 0, "f32"),
            "temperature": Register("in", "value", "degC", -50.0, 200.0, "input", 2, "f32"),
        }
    ),
}  # fmt: skip


class LineSettings(BaseModel):
    """How a device on Modbus is reached, whatever its registers.

    Attributes:
        transport: `tcp`, or `rtu` on a serial line.
        address: `host:port` for tcp; a serial port or `socket://host:port` (serial server) for rtu.
        unit_id: of the device on its line.
        baud, parity: of a serial line.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: after a failure on a serial line nothing is asked for so long, so that a late answer passes
            and is not taken for the next one. No answer may come later than that.
        watchdog_s: the device makes its outputs safe after so long without a request. Armed by this driver where
            the device allows it; else it says how the device was set.
        word_order: of floats: `big` is the high word first.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    transport: Literal["tcp", "rtu"] = "tcp"
    address: str
    unit_id: PositiveInt = Field(1, le=247)
    baud: PositiveInt = 19200
    parity: Literal["N", "E", "O"] = "N"
    timeout_s: PositiveFloat = 0.2
    longest_reply_s: PositiveFloat = 1.0
    watchdog_s: PositiveFloat | None = None
    word_order: WordOrder | None = None


class Settings(LineSettings):
    """What `[devices.NAME]` may say: how the device is reached, and which it is.

    Attributes:
        model: which register map.
    """

    model: Literal["wago-750", "iologik-e1241", "iologik-e1240", "flow-meter"]


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong beyond the types."""
    yield from line_faults(settings, MODELS[settings.model])


def line_faults(settings: LineSettings, model: Model) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong with the settings of a device of this model."""
    if settings.transport == "tcp" and _host_and_port(settings.address) is None:
        yield ("address",), f"'{settings.address}' is not host:port, such as 192.168.1.10:502"
    if settings.watchdog_s is not None and not any(r.direction == "out" for r in model.registers.values()):
        yield ("watchdog_s",), "this model has no outputs that a watchdog could make safe; take this away"
    per_second = next((_PER_SECOND[v] for _, v in model.watchdog if isinstance(v, str) and v in _PER_SECOND), 10.0)
    if settings.watchdog_s is not None and not _counted(settings.watchdog_s * per_second, bool(model.watchdog)):
        steps = f"{1.0 / per_second:g} … {0xFFFF / per_second:g} s in steps of {1.0 / per_second:g} s"
        yield ("watchdog_s",), f"{settings.watchdog_s:g} s: the device counts {steps}"
    if settings.longest_reply_s < settings.timeout_s:
        yield ("longest_reply_s",), f"must not be shorter than timeout_s = {settings.timeout_s:g}"


def _counted(count: float, told_to_the_device: bool) -> bool:
    """Whether the device can count such a time; one that is set there by other means may be any."""
    return not told_to_the_device or (abs(count - round(count)) < 1e-6 and 1 <= round(count) <= 0xFFFF)


def terminals(settings: Settings) -> dict[str, Terminal]:
    """The register map of the model, as terminals."""
    return MODELS[settings.model].terminals


def check_level(model: Model, wiring: Wiring) -> None:
    """Refuse a watchdog that would put an output elsewhere than at its safe value.

    Raises:
        SettingError: names the output, where it would go and where it is safe.
    """
    for name, channel in wiring.outputs.items():
        register = model.registers[channel.terminal]
        goes_to = channel.safe if model.expires_to is None else model.expires_to
        if register.count_of(goes_to) != register.count_of(channel.safe):
            raise SettingError(
                f"watchdog_s: when it expires the device puts {channel.terminal} at {goes_to:g} {register.unit}, but "
                f"'{name}' is safe at {channel.safe:g} {register.unit}; take watchdog_s away, or connect the valve so "
                f"that {goes_to:g} {register.unit} is safe"
            )


def needs(settings: LineSettings) -> tuple[str, ...]:
    """Packages that must be installed."""
    is_port = settings.transport == "rtu" and not settings.address.startswith("socket://")
    return ("pymodbus", "serial") if is_port else ("pymodbus",)


def watchdog_levels(settings: Settings) -> dict[str, float]:
    """Where the device's watchdog puts outputs, raw, of those of which that is known."""
    return levels_of(MODELS[settings.model])


def levels_of(model: Model) -> dict[str, float]:
    """Where the watchdog of a device of this model puts its outputs, if that is always the same."""
    if model.expires_to is None:
        return {}
    return {name: model.expires_to for name, register in model.registers.items() if register.direction == "out"}


def open_link(settings: Settings, wiring: Wiring) -> ModbusLink:
    """The device, connected, its watchdog armed."""
    return ModbusLink(settings, wiring, MODELS[settings.model])


def open_daq(settings: Settings, wiring: Wiring) -> PolledDaq:
    """The device alone as a DAQ."""
    return PolledDaq({settings.model: open_link(settings, wiring)}, {settings.model: wiring})


@dataclass(slots=True)
class Stretch:
    """Neighbouring registers that go in one request."""

    first: int
    terminals: dict[str, Register] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Registers from the first to the last."""
        last = max(self.terminals.values(), key=lambda register: register.address)
        return last.address + last.words - self.first


def stretches(registers: Mapping[str, Register]) -> list[Stretch]:
    """Registers in as few requests as possible without asking for any that lie between (some devices refuse)."""
    found: list[Stretch] = []
    for name, register in sorted(registers.items(), key=lambda item: item[1].address):
        if not found or found[-1].first + found[-1].count != register.address:
            found.append(Stretch(register.address))
        found[-1].terminals[name] = register
    return found


class ModbusLink:
    """A device on Modbus (see `hil.daq.polled.Link`).

    Raises:
        DeviceLostError: nothing answers at the address.
    """

    def __init__(self, settings: LineSettings, wiring: Wiring, model: Model) -> None:
        if settings.watchdog_s is not None:
            check_level(model, wiring)
        self._watchdog = DeviceWatchdog(settings.watchdog_s)
        self.watchdog_s, self.keep_alive_s = self._watchdog.time_s, self._watchdog.keep_alive_s
        self._settings, self._model = settings, model
        self._order: WordOrder = settings.word_order or model.word_order
        used = {c.terminal for c in wiring.outputs.values()} | {c.terminal for c in wiring.inputs.values()}
        chosen = {name: register for name, register in model.registers.items() if name in used}
        self._out = stretches({name: r for name, r in chosen.items() if r.direction == "out"})
        self._in = stretches({name: r for name, r in chosen.items() if r.direction == "in"})
        self._driven: dict[str, int] = {}
        self._checked_s = time.monotonic()
        self._quiet_until_s = 0.0
        self._client = _client(settings)
        try:
            self._connect()
            self._arm(self.watchdog_s, {c.terminal: c.safe for c in wiring.outputs.values()})
            self._leave_safe_mode({c.terminal: c.safe for c in wiring.outputs.values()})
        except BaseException:
            self.close()
            raise

    def standing(self) -> dict[str, float]:
        """Where the outputs stand, read back."""
        return {name: register.value_of([count], self._order) for name, register, count in self._read_back()}

    def drive(self, values: Mapping[str, float]) -> None:
        """Write the outputs, neighbours in one request.

        Raises:
            LinkError: also when the device's watchdog must have expired meanwhile, so that outputs stand elsewhere.
        """
        late = time.monotonic() < self._quiet_until_s
        if late:  # a safe value shall not wait: sent at once, and once more when the line is clean
            self._write_blindly(values)
        self._watchdog_has_not_expired()
        for stretch, counts in self._counts(values):
            self._ask(16, stretch.first, values=counts)
            self._driven.update(dict(zip(stretch.terminals, counts, strict=True)))

    def read(self) -> dict[str, float]:
        """Every input, and now and then whether outputs still stand where they were driven."""
        self._watchdog_has_not_expired()
        readings: dict[str, float] = {}
        for stretch in self._in:
            function = 4 if next(iter(stretch.terminals.values())).table == "input" else 3
            words = self._ask(function, stretch.first, count=stretch.count)
            for name, register in stretch.terminals.items():
                at = register.address - stretch.first
                readings[name] = self._plausible(name, register, words[at : at + register.words])
        if self._driven and time.monotonic() - self._checked_s > _CHECK_S:
            self._outputs_stand()
        return readings

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    def _connect(self) -> None:
        if not self._client.connect():
            raise DeviceLostError(f"{self._settings.address}: cannot be reached")

    def _arm(self, time_s: float | None, safe: Mapping[str, float]) -> None:
        for address, value in self._model.watchdog if time_s is not None else ():
            if isinstance(value, int):
                self._ask(6, address, values=[value])
            elif value in _PER_SECOND:
                self._ask(6, address, values=[max(1, round(_PER_SECOND[value] * (time_s or 0.0)))])
            elif (terminal := _safe_of(value)) in safe:
                self._ask(6, address, values=[self._model.registers[terminal].count_of(safe[terminal])])

    def _leave_safe_mode(self, safe: Mapping[str, float]) -> None:
        """A device that made its outputs safe in an earlier run takes commands again, from the safe values on."""
        if self._model.safe_status is None or self._model.clear_safe is None or not self._in_safe_mode():
            return
        for stretch, counts in self._counts(safe):
            self._ask(16, stretch.first, values=counts)
        for stretch in self._out:
            for register in stretch.terminals.values():
                self._ask(5, self._model.clear_safe + register.address - self._first_output, values=[1])

    @property
    def _first_output(self) -> int:
        return min(r.address for r in self._model.registers.values() if r.direction == "out")

    def _in_safe_mode(self) -> list[str]:
        """Outputs that the device itself has made safe."""
        flagged: list[str] = []
        if self._model.safe_status is None:
            return flagged
        for stretch in self._out:
            flags = self._ask(1, self._model.safe_status + stretch.first - self._first_output, count=stretch.count)
            flagged += [name for name, flag in zip(stretch.terminals, flags, strict=False) if flag]
        return flagged

    def _counts(self, values: Mapping[str, float]) -> Iterable[tuple[Stretch, list[int]]]:
        """What to write; an output that is not given keeps what was driven before."""
        for stretch in self._out:
            counts = {name: self._driven.get(name, 0) for name in stretch.terminals}
            counts |= {name: r.count_of(values[name]) for name, r in stretch.terminals.items() if name in values}
            yield stretch, list(counts.values())

    def _read_back(self) -> Iterator[tuple[str, Register, int]]:
        for stretch in self._out:
            first = next(iter(stretch.terminals.values()))
            at = stretch.first if first.read_back is None else first.read_back
            counts = self._ask(3, at, count=stretch.count)
            yield from ((name, r, count) for (name, r), count in zip(stretch.terminals.items(), counts, strict=True))

    def _outputs_stand(self) -> None:
        self._checked_s = time.monotonic()
        if safe := self._in_safe_mode():
            raise LinkError(
                f"{', '.join(safe)}: the device itself has made it safe; its watchdog expired, or it was told to"
            )
        for name, register, count in self._read_back():
            if name in self._driven and count != self._driven[name]:
                stands, driven = (register.value_of([c], self._order) for c in (count, self._driven[name]))
                raise LinkError(
                    f"{name} stands at {stands:.4g} {register.unit}, not at {driven:.4g} as it was driven: the device "
                    f"restarted, its watchdog expired, or another master writes to it"
                )

    def _watchdog_has_not_expired(self) -> None:
        if self._driven:
            self._watchdog.check()

    def _plausible(self, name: str, register: Register, words: Sequence[int]) -> float:
        """A reading within the terminal's range; what is a little beyond stands at its end.

        Raises:
            LinkError: not a number, or one that only the wrong word order explains.
        """
        value = register.value_of(words, self._order)
        full = max(abs(register.low), abs(register.high))
        if register.format == "f32":
            denormal = value != 0.0 and abs(value) < 1e-20
            if math.isnan(value):
                raise LinkError(f"{name} reads NaN: no valid measurement, or check word_order (now {self._order})")
            if denormal or abs(value) > _IMPLAUSIBLE * full:
                raise LinkError(
                    f"{name} reads {value:.3g} {register.unit}, beyond anything plausible: check word_order "
                    f"(now {self._order})"
                )
        return min(max(value, register.low), register.high)

    def _write_blindly(self, values: Mapping[str, float]) -> None:
        """Send values without waiting for what the device says to them."""
        try:
            self._connect()
            for stretch, counts in self._counts(values):
                self._client.write_registers(
                    stretch.first, counts, device_id=self._settings.unit_id, no_response_expected=True
                )
        except Exception:  # the checked writing that follows says what is wrong
            pass
        finally:
            self._client.close()

    def _ask(self, function: int, address: int, *, count: int = 1, values: Sequence[int] = ()) -> list[int]:
        """One request and its answer, which is checked to be the answer to just this request."""
        from pymodbus.exceptions import ConnectionException, ModbusException

        self._wait_until_clean()
        try:
            answer = _request(self._client, function, address, count, values, self._settings.unit_id)
        except ConnectionException as error:
            self._fail(error, DeviceLostError, "the connection is lost")
        except (ModbusException, OSError) as error:
            self._fail(error, LinkError, f"no valid answer within {self._settings.timeout_s:g} s")
        self._watchdog.heard()
        if answer.isError():
            raise LinkError(
                f"function {function} at register {address:#06x} is refused with exception {answer.exception_code}"
                f"{_EXCEPTIONS.get(answer.exception_code, '')}"
            )
        if not _belongs(answer, function, address, count, values):
            self._fail(None, LinkError, f"an answer that does not belong to function {function} at {address:#06x}")
        return [int(bit) for bit in answer.bits[:count]] if function == 1 else list(answer.registers)

    def _wait_until_clean(self) -> None:
        """On a serial line, let a late answer pass before the next request, then begin with an empty buffer."""
        wait_s = self._quiet_until_s - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
        self._quiet_until_s = 0.0

    def _fail(self, error: Exception | None, kind: type[Exception], text: str) -> NoReturn:
        """Drop the connection: what arrives on it from now on belongs to nobody."""
        self._client.close()
        if self._settings.transport == "rtu":
            self._quiet_until_s = time.monotonic() + self._settings.longest_reply_s
        raise kind(text) from error


_EXCEPTIONS = {
    1: " (unknown function)",
    2: " (no such register)",
    3: " (value not allowed)",
    4: " (device failure)",
    5: " (accepted, but it takes long)",
    6: " (device busy)",
    8: " (memory of the device is at fault)",
    10: " (gateway: no path to the device; check its port and unit_id)",
    11: " (gateway: the device behind it does not answer; check unit_id, wiring and baud rate there)",
}


def _client(settings: LineSettings) -> Any:
    from pymodbus import FramerType
    from pymodbus.client import ModbusTcpClient

    from drivers._steady_serial import SteadySerialClient

    logging.getLogger("pymodbus.logging").addHandler(logging.NullHandler())  # what matters is raised
    common: dict[str, Any] = {"timeout": settings.timeout_s, "retries": 0}
    if settings.transport == "tcp":
        host, port = _host_and_port(settings.address) or ("", 0)
        return ModbusTcpClient(host, port=port, **common)
    if settings.address.startswith("socket://"):
        host, port = _host_and_port(settings.address.removeprefix("socket://")) or ("", 0)
        return ModbusTcpClient(host, port=port, framer=FramerType.RTU, **common)
    return SteadySerialClient(settings.address, baudrate=settings.baud, parity=settings.parity, **common)


def _request(client: Any, function: int, address: int, count: int, values: Sequence[int], unit_id: int) -> Any:
    ask: dict[int, Callable[[], Any]] = {
        1: lambda: client.read_coils(address, count=count, device_id=unit_id),
        3: lambda: client.read_holding_registers(address, count=count, device_id=unit_id),
        4: lambda: client.read_input_registers(address, count=count, device_id=unit_id),
        5: lambda: client.write_coil(address, bool(values[0]), device_id=unit_id),
        6: lambda: client.write_register(address, values[0], device_id=unit_id),
        16: lambda: client.write_registers(address, list(values), device_id=unit_id),
    }
    return ask[function]()


def _belongs(answer: Any, function: int, address: int, count: int, values: Sequence[int]) -> bool:
    """Whether an answer can be the one to a request: same function, same length or same echo."""
    if answer.function_code != function:
        return False
    if function in (3, 4):
        return len(answer.registers) == count
    if function == 1:
        return len(answer.bits) >= count
    if function == 16:
        return bool(answer.address == address and answer.count == len(values))
    return bool(answer.address == address)


def _host_and_port(text: str) -> tuple[str, int] | None:
    host, colon, port = text.rpartition(":")
    return (host, int(port)) if colon and host and port.isdecimal() and 0 < int(port) < 65536 else None
