"""Modbus TCP and RTU: analogue I/O modules and flow meters, each a register map in this file.

Registers of the WAGO coupler and of the ioLogik modules are those of their manuals, but which modules sit behind the
coupler, and in which order, is our choice. **The whole map of `flow-meter` is our choice**: makers agree on nothing
but on floats in two registers each; put those of the meter's manual in its place.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NoReturn

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, PositiveFloat, PositiveInt

from drivers._edge import edge, quiet, wire_log
from drivers._registers import Format, Register, Stretch, WordOrder, float32, stretches
from drivers._watchdog import DeviceWatchdog
from hil.daq.channel import Direction, Terminal, Wiring
from hil.daq.polled import PolledDaq
from hil.errors import DeviceLostError, LinkError, SettingError

__all__ = [
    "Format", "LineSettings", "ModbusLink", "Model", "Register", "Settings", "Stretch", "WordOrder", "faults",
    "float32", "line_faults", "open_daq", "open_link", "stretches", "terminals",
]  # fmt: skip

_CHECK_S = 0.5  # how often outputs are read back: another master, or a device that restarted
PROBES = "modbus"


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
    # Moxa ioLogik E1241: 4 AO of 12 bit, 0 … 10 V; its watchdog and safe values are set on its web page. As it is
    # delivered its safe value is 0 V; what it was set to is `watchdog_level`.
    "iologik-e1241": Model(
        _analogue(4, "ao", "out", "holding", 0x0400, low=0.0, high=10.0, slope=10.0 / 4095),
        expires_to=0.0, safe_status=0x1010, clear_safe=0x1020,
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
        address: `host:port` for tcp; for rtu a serial port, `usb:` with the number or place of its adapter, or
            `socket://host:port` (serial server).
        unit_id: of the device on its line.
        baud, parity: of a serial line.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: after a failure on a serial line nothing is asked for so long, so that a late answer passes
            and is not taken for the next one. No answer may come later than that.
        watchdog_s: the device makes its outputs safe after so long without a request. Armed by this driver where
            the device allows it; else it says how the device was set.
        word_order: of numbers in two registers: `big` (or `ABCD`) is the high word first, `little` (`CDAB`) the low
            one; `BADC` and `DCBA` have the bytes of each word swapped.
        echo: what is sent on a serial line comes back before the answer, as some RS-485 adapters do.
        pause_s: so long nothing is asked after an answer, for devices and converters that need to turn around.
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
    echo: bool = False
    pause_s: float = Field(0.0, ge=0.0, le=1.0)


class Settings(LineSettings):
    """What `[devices.NAME]` may say: how the device is reached, and which it is.

    Attributes:
        model: which register map.
        watchdog_level: where the device was set to put its outputs when its watchdog expires, in the unit of its
            terminals; as it is delivered if not given.
    """

    model: Literal["wago-750", "iologik-e1241", "iologik-e1240", "flow-meter"]
    watchdog_level: FiniteFloat | None = None


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong beyond the types."""
    yield from line_faults(settings, MODELS[settings.model])
    if settings.watchdog_level is not None and (settings.watchdog_s is None or MODELS[settings.model].watchdog):
        yield ("watchdog_level",), "only for a watchdog that was set at the device itself; take this away"


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
    if settings.echo and settings.transport == "tcp":
        yield ("echo",), "only a serial line echoes; take this away"
    if settings.longest_reply_s < settings.timeout_s:
        yield ("longest_reply_s",), f"must not be shorter than timeout_s = {settings.timeout_s:g}"


def _counted(count: float, told_to_the_device: bool) -> bool:
    """Whether the device can count such a time; one that is set there by other means may be any."""
    return not told_to_the_device or (abs(count - round(count)) < 1e-6 and 1 <= round(count) <= 0xFFFF)


def probe() -> Any:
    """Who is on such a line (see `hil.daq.probe`)."""
    from drivers import _probe_modbus

    return _probe_modbus


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
        if register.words_of(goes_to, "big") != register.words_of(channel.safe, "big"):
            raise SettingError(
                f"watchdog_s: when it expires the device puts {channel.terminal} at {goes_to:g} {register.unit}, but "
                f"'{name}' is safe at {channel.safe:g} {register.unit}; take watchdog_s away, or connect the valve so "
                f"that {goes_to:g} {register.unit} is safe{_where_it_can_be_set(model)}"
            )


def _where_it_can_be_set(model: Model) -> str:
    return "" if model.watchdog else ", or set that at the device and say so with watchdog_level"


def needs(settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return line_needs(settings)


def line_needs(settings: LineSettings) -> tuple[str, ...]:
    """Packages that must be installed for a device that is reached so."""
    is_port = settings.transport == "rtu" and not settings.address.startswith("socket://")
    return ("pymodbus", "serial") if is_port else ("pymodbus",)


def watchdog_levels(settings: Settings) -> dict[str, float]:
    """Where the device's watchdog puts outputs, raw, of those of which that is known."""
    return levels_of(_model(settings))


def levels_of(model: Model) -> dict[str, float]:
    """Where the watchdog of a device of this model puts its outputs, if that is always the same."""
    if model.expires_to is None:
        return {}
    return {name: model.expires_to for name, register in model.registers.items() if register.direction == "out"}


def _model(settings: Settings) -> Model:
    """The model, its watchdog as this device was set."""
    model = MODELS[settings.model]
    return model if settings.watchdog_level is None else replace(model, expires_to=settings.watchdog_level)


def open_link(settings: Settings, wiring: Wiring) -> ModbusLink:
    """The device, connected, its watchdog armed."""
    return ModbusLink(settings, wiring, _model(settings))


def open_daq(settings: Settings, wiring: Wiring) -> PolledDaq:
    """The device alone as a DAQ."""
    return PolledDaq({settings.model: open_link(settings, wiring)}, {settings.model: wiring})


@edge
class ModbusLink:
    """A device on Modbus (see `hil.daq.polled.Link`).

    Attributes:
        identity: maker, product and version as the device tells them (function 43/14), empty when it does not. Only
            asked on TCP: on a serial line a device that keeps silent would keep an output waiting.

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
        self._driven: dict[str, tuple[int, ...]] = {}
        self._before: dict[str, float] = {}
        self._checked_s = time.monotonic()
        self._quiet_until_s = self._rest_until_s = 0.0
        self._sent = self._heard = b""
        self._log = wire_log("modbus", settings.address)
        self._client = _client(settings, self._trace)
        try:
            self._connect()
            if wiring.outputs:  # a device whose inputs alone are read is left as it is
                self._arm(self.watchdog_s, {c.terminal: c.safe for c in wiring.outputs.values()})
                self._leave_safe_mode({c.terminal: c.safe for c in wiring.outputs.values()})
            self.identity = self._identity()
        except BaseException:
            self.close()
            raise

    def standing(self) -> dict[str, float]:
        """Where the outputs stand, read back."""
        return {name: register.value_of(words, self._order) for name, register, words in self._read_back()}

    def drive(self, values: Mapping[str, float]) -> None:
        """Write the outputs, neighbours in one request.

        Raises:
            LinkError: also when the device's watchdog must have expired meanwhile, so that outputs stand elsewhere.
        """
        late = time.monotonic() < self._quiet_until_s
        if late:  # a safe value shall not wait: sent at once, and once more when the line is clean
            self._write_blindly(values)
        self._watchdog_has_not_expired()
        for stretch, words in self._words(values):
            self._ask(16, stretch.first, values=words)
            self._driven.update(stretch.split(words))

    def read(self) -> dict[str, float]:
        """Every input, NaN where it has no measurement; now and then also whether outputs still stand as driven."""
        self._watchdog_has_not_expired()
        readings: dict[str, float] = {}
        for stretch in self._in:
            words = stretch.split(self._ask(stretch.function, stretch.first, count=stretch.count))
            readings |= {name: self._measured(name, r, words[name]) for name, r in stretch.terminals.items()}
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
                words = self._model.registers[terminal].words_of(safe[terminal], self._order)
                self._ask(6 if len(words) == 1 else 16, address, values=words)

    def _identity(self) -> str:
        """What the device says of itself; most that say nothing refuse the question at once."""
        from pymodbus.exceptions import ModbusException

        if self._settings.transport != "tcp":
            return ""
        try:
            answer = self._client.read_device_information(device_id=self._settings.unit_id)
            told: Mapping[int, bytes] = {} if answer.isError() else answer.information
        except (ModbusException, OSError):  # the next question begins on a new connection
            self._client.close()
            return ""
        return " ".join(part.decode("ascii", "replace").strip() for part in told.values() if isinstance(part, bytes))

    def _leave_safe_mode(self, safe: Mapping[str, float]) -> None:
        """A device that made its outputs safe in an earlier run takes commands again, from the safe values on."""
        if self._model.safe_status is None or self._model.clear_safe is None or not self._in_safe_mode():
            return
        for stretch, words in self._words(safe):
            self._ask(16, stretch.first, values=words)
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

    def _words(self, values: Mapping[str, float]) -> Iterable[tuple[Stretch, list[int]]]:
        """What to write; an output that is not given keeps what was driven before."""
        for stretch in self._out:
            words = {name: self._driven.get(name, (0,) * r.words) for name, r in stretch.terminals.items()}
            words |= {name: tuple(r.words_of(values[name], self._order)) for name, r in stretch.terminals.items()
                      if name in values}  # fmt: skip
            yield stretch, [word for name in stretch.terminals for word in words[name]]

    def _read_back(self) -> Iterator[tuple[str, Register, tuple[int, ...]]]:
        for stretch in self._out:
            words = stretch.split(self._ask(3, stretch.read_back, count=stretch.count))
            yield from ((name, register, words[name]) for name, register in stretch.terminals.items())

    def _outputs_stand(self) -> None:
        self._checked_s = time.monotonic()
        if safe := self._in_safe_mode():
            raise LinkError(
                f"{', '.join(safe)}: the device itself has made it safe; its watchdog expired, or it was told to"
            )
        for name, register, words in self._read_back():
            if name in self._driven and words != self._driven[name]:
                stands, driven = (register.value_of(w, self._order) for w in (words, self._driven[name]))
                raise LinkError(
                    f"{name} stands at {stands:.4g} {register.unit}, not at {driven:.4g} as it was driven: the device "
                    f"restarted, its watchdog expired, or another master writes to it"
                )

    def _watchdog_has_not_expired(self) -> None:
        if self._driven:
            self._watchdog.check()

    def _measured(self, name: str, register: Register, words: Sequence[int]) -> float:
        """A reading, NaN when it is none.

        Raises:
            LinkError: it is none from the first on: then the bench file is wrong, or the sensor dead.
        """
        said = register.value_of(words, self._order)
        value = register.measured(said, self._before.get(name))
        if math.isnan(value) and name not in self._before:
            raise LinkError(
                f"{name} reads {said:.3g} {register.unit}, no measurement: a dead sensor, or check word_order (now "
                f"{self._order})"
            )
        self._before[name] = value
        return value

    def _write_blindly(self, values: Mapping[str, float]) -> None:
        """Send values without waiting for what the device says to them."""
        try:
            self._connect()
            for stretch, words in self._words(values):
                self._client.write_registers(
                    stretch.first, words, device_id=self._settings.unit_id, no_response_expected=True
                )
        except Exception:  # the checked writing that follows says what is wrong
            pass
        finally:
            self._client.close()

    def _ask(self, function: int, address: int, *, count: int = 1, values: Sequence[int] = ()) -> list[int]:
        """One request and its answer, which is checked to be the answer to just this request."""
        from pymodbus.exceptions import ConnectionException

        self._wait_until_clean()
        self._heard = b""
        try:
            answer = _request(self._client, function, address, count, values, self._settings.unit_id)
        except DeviceLostError:  # the port is not there, or not the same one any more
            raise
        except ConnectionException as error:
            self._fail(error, DeviceLostError, "the connection is lost")
        except Exception as error:  # whatever the library makes of what came
            self._fail(error, LinkError, f"no valid answer within {self._settings.timeout_s:g} s{self._what_came()}")
        self._watchdog.heard()
        if answer.isError():
            raise LinkError(
                f"function {function} at register {address:#06x} is refused with exception {answer.exception_code}"
                f"{_EXCEPTIONS.get(answer.exception_code, '')}"
            )
        if not _belongs(answer, function, address, count, values):
            echo = ": an adapter that echoes does so, then say echo = true" if self._may_echo else ""
            self._fail(
                None, LinkError, f"an answer that does not belong to function {function} at {address:#06x}{echo}"
            )
        if self._settings.pause_s:
            self._rest_until_s = time.monotonic() + self._settings.pause_s
        return [int(bit) for bit in answer.bits[:count]] if function == 1 else list(answer.registers)

    def _what_came(self) -> str:
        """What can be said of an answer that was none."""
        if not self._heard:
            first = self._settings.transport == "rtu" and not self._before and not self._settings.pause_s
            return "; if it answers now and then, it may need a pause between frames: say pause_s" if first else ""
        if self._settings.transport == "tcp" and self._heard[:2] != self._sent[:2]:
            came, sent = (int.from_bytes(frame[:2], "big") for frame in (self._heard, self._sent))
            return (
                f": one came, but with transaction number {came} instead of {sent}: a gateway that numbers by itself, "
                f"which cannot be used, or answers that come late"
            )
        if self._may_echo and self._heard.startswith(self._sent):
            return ": what was sent came back: the adapter echoes, say echo = true"
        return f": what came is none ({self._heard[:20].hex(' ')})"

    @property
    def _may_echo(self) -> bool:
        return self._settings.transport == "rtu" and not self._settings.echo

    def _trace(self, sending: bool, frame: bytes) -> bytes:
        if sending:
            self._sent = frame
        else:
            self._heard = frame
        self._log.debug("%s %s", "→" if sending else "←", frame.hex(" "))
        return frame if sending or self._settings.transport == "tcp" else self._from_the_answer_on(frame)

    def _from_the_answer_on(self, frame: bytes) -> bytes:
        """What came on a serial line without the noise of its turning around, which the library takes for an answer."""
        unit_id, function = self._sent[:2]
        starts = (i for i in range(len(frame) - 1) if frame[i] == unit_id and frame[i + 1] & 0x7F == function)
        return frame[next(starts, 0) :]

    def _wait_until_clean(self) -> None:
        """Let a late answer pass on a serial line, and a device its pause, before the next request."""
        wait_s = max(self._quiet_until_s, self._rest_until_s) - time.monotonic()
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


def _client(settings: LineSettings, trace: Callable[[bool, bytes], bytes] | None = None) -> Any:
    from pymodbus import FramerType
    from pymodbus.client import ModbusTcpClient

    from drivers._steady_serial import SteadySerialClient

    quiet("pymodbus.logging")
    common: dict[str, Any] = {"timeout": settings.timeout_s, "retries": 0, "trace_packet": trace}
    if settings.transport == "tcp":
        host, port = _host_and_port(settings.address) or ("", 0)
        return ModbusTcpClient(host, port=port, **common)
    if settings.address.startswith("socket://"):
        host, port = _host_and_port(settings.address.removeprefix("socket://")) or ("", 0)
        client: Any = ModbusTcpClient(host, port=port, framer=FramerType.RTU, **common)
    else:
        client = SteadySerialClient(settings.address, baudrate=settings.baud, parity=settings.parity, **common)
    client.comm_params.handle_local_echo = client.transaction.comm_params.handle_local_echo = settings.echo
    return client


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
