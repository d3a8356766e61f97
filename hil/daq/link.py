"""One device that the host tells and asks over a link, and its place in a DAQ."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from hil.clock import Clock
from hil.daq.channel import Wiring
from hil.daq.contract import CANNOT_BE_ASKED, ReadBack
from hil.errors import HardwareError, HilError, LinkError

DIRECT_S = 1.0  # what has left this computer arrives so soon, or never
RELAYED_S = 5.0  # so long a serial server, a gateway or a CAN hub may hold it back
WHATEVER = (Exception, SystemExit)  # that a library may throw; Ctrl-C is not its own


class Link(Protocol):
    """One device that is told and asked over a link. Values are raw, by terminal.

    Every method may raise `LinkError` (no answer, a late or garbled one) or `DeviceLostError`. After a
    `LinkError` the next call must start clean: a late answer is never taken for the next one.

    Attributes:
        watchdog_s: the device itself makes outputs safe when it hears nothing for so long; None: it does not.
        keep_alive_s: in a pause the outputs are driven again so often; None: not needed.

    A device that tells its readings without being asked may say `reading_age_s`: how old one is on average. One that
    says what it is (a serial number) may keep that as `identity`, empty when it has not: who answers to its address
    with another one later is another device. It asks before it writes, and calls `Wiring.refuse_another`; on every new
    connection within its life it asks again. One that says why an input has no measurement may keep that after each
    `read` as `invalid_reasons`, in words by terminal. One on a connection that the device may close while it idles may
    have a `renew`, called before a task with outputs safe.
    """

    watchdog_s: float | None
    keep_alive_s: float | None

    def standing(self) -> Mapping[str, float]:
        """Where every output in use stands, as the device answers now; never what it was told before.

        An output that the device cannot be asked about is left out: it is then called "commanded safe", never "safe".
        NaN is one of which the device says only that it is not at its safe value.
        """
        ...

    def drive(self, values: Mapping[str, float]) -> None:
        """Put outputs at these values, and return when the device has acknowledged, where it does."""
        ...

    def read(self) -> Mapping[str, float]:
        """Every input in use, read now; NaN where the device has no valid reading, infinite where it says "beyond".

        A reading is never held at the end of a range: that it stands there is seen behind the link. Called in each
        sample, also without inputs, so that a device may be asked whether it is still as it was left.
        """
        ...

    def close(self) -> None:
        """Let go of the device. May be called twice; never raises."""
        ...


@dataclass(slots=True)
class Late:
    """For how long a command that was sent and not answered may still arrive: on its way, or held by a hub.

    Attributes:
        late_s: nothing that has left this computer arrives later than that.
    """

    late_s: float = DIRECT_S
    _driven_s: float = -math.inf
    _lost: bool = False

    def drove(self, now_s: float) -> None:
        """A command that is not a safe one goes out, or may have until now."""
        self._driven_s = now_s

    def lost(self) -> None:
        """An answer did not come: which command it was nobody knows."""
        self._lost = True

    def left_s(self, now_s: float) -> float:
        """So long the last of them may still arrive."""
        return max(0.0, self._driven_s + self.late_s - now_s) if self._lost else 0.0


@dataclass(slots=True)
class Member:
    """A link of a DAQ, the channels on it, and how long it took of late; `doubt`: why what it says is not believed,
    given what it says that it is; `answers`: whether it did what it was asked last.
    """

    name: str
    link: Link
    wiring: Wiring
    clock: Clock
    doubt: Callable[[str], str] = lambda _identity: ""
    late: Late = field(default_factory=Late)
    read_after_s: deque[float] = field(default_factory=lambda: deque(maxlen=1000))
    read_for_s: deque[float] = field(default_factory=lambda: deque(maxlen=1000))
    answers: bool = field(default=True, init=False)

    @property
    def delay_name(self) -> str:
        """Under which blocks keep how long after the update of the outputs it was read."""
        return f"delay of {self.name}"

    @property
    def identity(self) -> str:
        """What the device says that it is; empty where it says nothing."""
        return str(getattr(self.link, "identity", ""))

    @property
    def reading_age_s(self) -> float:
        """How old a reading is on average when the device is asked for it."""
        return float(getattr(self.link, "reading_age_s", 0.0))

    def renew(self) -> None:
        """Have the link connect again where the device has hung up while nothing was asked; outputs are safe."""
        renew = getattr(self.link, "renew", None)
        if renew is not None:
            self._named(renew)

    def drive(self, levels: Mapping[str, float]) -> None:
        """Put its own of these outputs, by channel, at their values."""
        values = {channel.terminal: levels[name] for name, channel in self.wiring.outputs.items() if name in levels}
        if not values:
            return
        away = any(levels[name] != channel.safe for name, channel in self.wiring.outputs.items() if name in levels)
        try:
            self._named(self.link.drive, values)
        finally:
            if away:
                self.late.drove(self.clock.now_s)

    def read(self) -> dict[str, float]:
        """Its inputs, by channel; how long that took is kept."""
        begun_s = self.clock.now_s
        values = self._named(self.link.read)
        self.read_for_s.append(self.clock.now_s - begun_s)
        return {name: float(values[channel.terminal]) for name, channel in self.wiring.inputs.items()}

    def invalid_reasons(self) -> dict[str, str]:
        """Why inputs have no measurement, as far as the device says so."""
        reasons: Mapping[str, str] = getattr(self.link, "invalid_reasons", {})
        return (
            {name: reasons[c.terminal] for name, c in self.wiring.inputs.items() if c.terminal in reasons}
            if reasons
            else {}
        )

    def standing(self) -> dict[str, float]:
        """Where its outputs stand, by channel; at its safe value one that the device cannot be asked about."""
        if not self.wiring.outputs:
            return {}
        values = self._named(self.link.standing)
        found = {name: float(values.get(c.terminal, math.nan)) for name, c in self.wiring.outputs.items()}
        return {name: self.wiring.outputs[name].safe if math.isnan(at) else at for name, at in found.items()}

    def read_back(self) -> dict[str, ReadBack]:
        """What the device says of each of its outputs, or why it says nothing. Never raises."""
        watchdog_s = self.link.watchdog_s
        rescue = f"its own watchdog acts after {watchdog_s:g} s" if watchdog_s else ""
        late_s, doubt = self.late.left_s(self.clock.now_s), ""
        try:
            values = self._named(self.link.standing) if self.wiring.outputs else {}
            doubt = self.doubt(self.identity)
            answers = {terminal: _answer(float(value), rescue, doubt, late_s) for terminal, value in values.items()}
        except Exception as error:
            return dict.fromkeys(self.wiring.outputs, ReadBack(why=str(error), rescue=rescue))
        unasked = replace(CANNOT_BE_ASKED, late_s=late_s)
        return {name: answers.get(channel.terminal, unasked) for name, channel in self.wiring.outputs.items()}

    def _named(self, call: Callable[..., Any], *values: Any) -> Any:
        self.answers = False
        try:
            answer = call(*values)
        except HardwareError as error:
            self.late.lost()
            raise type(error)(f"{self.name}: {error}") from error
        except HilError:
            raise
        except WHATEVER as error:  # of a library, or a fault of the driver: it concerns this link alone
            self.late.lost()
            raise LinkError(f"{self.name}: {type(error).__name__}: {error}") from error
        self.answers = True
        return answer


def _answer(at: float, rescue: str, doubt: str, late_s: float) -> ReadBack:
    is_away = math.isnan(at)
    why = "the device says only that it is not at its safe value" if is_away else doubt
    return ReadBack(None if why else at, why=why, rescue=rescue, late_s=late_s, is_away=is_away and not doubt)
