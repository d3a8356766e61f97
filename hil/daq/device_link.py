"""What every device on a link goes through, written once: a driver adds what its protocol says.

Its states stand in docs/explanation/safety.md.
"""

# ruff: noqa: B027 - most hooks are what few protocols need
from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence

from hil.daq.channel import Wiring
from hil.errors import LinkError, SettingError
from hil.system import system
from hil.units import behind_a_number

READ_BACK_EVERY_S = 0.5  # another master, or a device that restarted, is noticed so soon
_LATEST_S = 2.0  # on a line that has become slow; one that stays so ends the run before
_SLOW, _SHORTEST_S = 3.0, 0.005


class DeviceWatchdog:
    """A device makes its outputs safe by itself when nothing is asked of it for `time_s`; with None it does not.

    Many devices take commands again afterwards and say nothing, so the driver keeps the time.

    Attributes:
        keep_alive_s: what stands is driven again so often in a pause; None: not needed.
    """

    def __init__(self, time_s: float | None, device: str = "device") -> None:
        self.time_s, self._device = time_s, device
        self.keep_alive_s = None if time_s is None else time_s / 3.0
        self._begun_s = self._heard_s = system.now_s()

    def heard(self) -> None:
        """The device has answered, or was told, where it does not answer.

        A program that stood still may have done so also between a request and its answer: what counts is when it began.
        """
        self._heard_s = self._begun_s

    def begin(self, is_driven: bool) -> None:
        """Something is to be said to the device: raise when it must have expired since it heard something last.

        It is raised until outputs are told to be safe.

        Args:
            is_driven: whether an output stands away from its safe value, and is to go on so.

        Raises:
            LinkError: nothing was said for longer than its time.
        """
        self._begun_s = system.now_s()
        silent_s = self._begun_s - self._heard_s
        if is_driven and self.time_s is not None and silent_s > self.time_s:
            raise LinkError(
                f"nothing was asked for {silent_s:.3g} s, longer than its watchdog of {self.time_s:g} s: the "
                f"{self._device} makes its outputs safe then"
            )


class ReadBackTimes:
    """When a device is asked where its outputs stand, beside the readings that interlocks wait for.

    The question takes an answer more. On a line whose answers suddenly take several times as long as before it would
    hold back the next readings just when they are late already.
    """

    def __init__(self) -> None:
        self._usual_s, self._took_s = math.inf, 0.0

    def took(self, took_s: float) -> None:
        """The inputs were read in so long."""
        self._took_s = took_s
        self._usual_s = min(self._usual_s, max(took_s, _SHORTEST_S))

    def is_due(self, checked_s: float) -> bool:
        """Whether outputs are to be read back again, after they were at this time of `system.now_s`."""
        slow = self._took_s > _SLOW * self._usual_s
        return system.now_s() - checked_s > (_LATEST_S if slow else READ_BACK_EVERY_S)


def stands_as_driven(at: float, driven: Sequence[float], within: float) -> bool:
    """Whether an output stands where it was driven: the one place where both meet.

    Args:
        at: where the device holds it; NaN, at no number, is nowhere that it was driven.
        driven: where it was driven of late; nothing is known of one that was not.
        within: how far from there it may be.
    """
    return not driven or min(driven) - within <= at <= max(driven) + within


class DeviceLink(ABC):
    """A device on its link (see `hil.daq.link.Link`): opened, made ready, driven, read, compared.

    A driver provides `standing` and `close`, and what follows below; it calls `_open` at the end of its `__init__`.
    What was driven is compared with what the device holds while inputs are read, at least each half second. A
    difference, also of an output that is not at a number any more, is an error.

    Args:
        wiring: the channels in use.
        watchdog_s: the device makes its outputs safe when it hears nothing for so long; None: it does not.
        expires_to: where its watchdog puts outputs, if that is always the same and known.
        close: by terminal, how far an output may be held from where it was driven; exactly there if not said.
        device: what it is called in errors.
        longest_reply_s: after an answer that did not come nothing is believed for so long (`_failed`).
        reports_each_s: how often a device says by itself where its outputs are held; it then may say otherwise for
            `longest_reply_s`, and what was driven within the time of three messages is no difference. 0: it is asked.

    Raises:
        SettingError: its watchdog would put an output elsewhere than at its safe value.

    Attributes:
        invalid_reasons: why inputs had no measurement when they were read last, by terminal.
    """

    _why_moved = "the device restarted, its watchdog expired, it does not obey, or another program drives it"
    _identity = ""
    _remedy = "take watchdog_s away, or "
    _forgiving = True  # whether safe values are told also to a device that could not be made ready

    def __init__(
        self, wiring: Wiring, watchdog_s: float | None = None, *, expires_to: float | None = None,
        close: Mapping[str, float] | None = None, device: str = "device", longest_reply_s: float = 0.0,
        reports_each_s: float = 0.0,
    ) -> None:  # fmt: skip
        for name, channel in wiring.outputs.items() if watchdog_s is not None and expires_to is not None else ():
            if abs((expires_to or 0.0) - channel.safe) > 1e-9:
                raise SettingError(
                    f"watchdog_s: when it expires the {device} puts {channel.terminal} at {expires_to:g} "
                    f"{channel.unit}, but '{name}' is safe at {channel.safe:g} {channel.unit}; {self._remedy}connect "
                    f"the valve so that {expires_to:g} {channel.unit} is safe"
                )
        self._wiring, self._close = wiring, close or {}
        self._watchdog = DeviceWatchdog(watchdog_s, device)
        self.watchdog_s: float | None = watchdog_s
        self.keep_alive_s: float | None = self._watchdog.keep_alive_s
        self._safe = {c.terminal: c.safe for c in wiring.outputs.values()}
        self._terminals_read = {c.terminal for c in wiring.inputs.values()}
        self._units = {c.terminal: c.unit for c in wiring.outputs.values()}
        self._commanded = dict(self._safe)
        self._driven: dict[str, list[tuple[float, float]]] = {}
        self._away_s: dict[str, tuple[float, float]] = {}
        self._reports_each_s, self._longest_reply_s = reports_each_s, longest_reply_s
        self._quiet_until_s = 0.0
        self._seen: set[str] = set()
        self.invalid_reasons: dict[str, str] = {}
        self._read_back_times, self._checked_s = ReadBackTimes(), system.now_s()

    @property
    def identity(self) -> str:
        """What the device says that it is; empty where it does not."""
        return self._identity

    @abstractmethod
    def standing(self) -> Mapping[str, float]:
        """Where outputs stand, as the device answers now; those that cannot be asked are left out."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the device. May be called twice."""

    @abstractmethod
    def _identified(self) -> str:
        """Connect, and what the device says that it is; nothing is written to it yet."""

    def _recognise(self, identity: str) -> None:
        """Raise `LinkError` where it is not what the bench file says; it is no other one than was opened before."""

    def _make_ready(self) -> None:
        """Faults cleared, watchdog armed, outputs obeying, from their safe values on. Called where any is in use."""

    def _opened(self, identity: str) -> None:
        """The last step of opening."""

    @property
    def _is_clean(self) -> bool:
        """Whether the next answer can only be that to the next request."""
        return True

    def _tell_blindly(self, values: Mapping[str, float]) -> None:
        """Send outputs while a late answer may still come: a safe value shall not wait for the line to be clean."""

    @abstractmethod
    def _put(self, values: Mapping[str, float]) -> Iterable[tuple[str, float]]:
        """Drive outputs; each with the level that the device then holds, once it has acknowledged, where it does."""

    def _look(self) -> None:
        """Raise `LinkError` for what the device has said by itself, before its inputs are read."""

    def _forget(self) -> None:
        """Throw away what came while nothing was believed."""

    @abstractmethod
    def _measured(self) -> Mapping[str, float]:
        """Every input in use now, by terminal; `_none` for one without a measurement."""

    def _look_at_outputs(self) -> None:
        """Raise `LinkError` where outputs do not obey, before they are compared."""

    def _held(self) -> Mapping[str, float]:
        """The demand that the device holds for each output; one that it says nothing of now is left out."""
        return self.standing()

    def _named(self, name: str, level: float) -> str:
        """A level of an output in words."""
        return f"{level:.6g}{behind_a_number(self._units.get(name, '1'))}"

    def drive(self, values: Mapping[str, float]) -> None:
        """Put outputs at these values, and return when the device has acknowledged, where it does.

        Raises:
            LinkError: also when its watchdog must have expired meanwhile, so that outputs stand elsewhere.
        """
        if not self._is_clean:
            self._tell_blindly(values)
        commanded = {**self._commanded, **values}
        self._watchdog.begin(self._safe not in (self._commanded, commanded))
        self._commanded = commanded
        for name, level in self._put(values):
            self._driven[name] = [*self._recent(name), (system.now_s(), level)]

    def read(self) -> Mapping[str, float]:
        """Every input, NaN where it has no measurement; now and then also whether outputs still stand as driven."""
        self._look()
        self._watchdog.begin(self._commanded != self._safe)
        if (wait_s := self._quiet_until_s - system.now_s()) > 0.0:  # what is late on its way says nothing about now
            system.sleep(wait_s)
            self._forget()
        self._quiet_until_s = 0.0
        begun_s, self.invalid_reasons = system.now_s(), {}
        readings = self._measured()
        if lacking := self._terminals_read - readings.keys():
            raise LinkError(f"its driver gives no reading of {', '.join(sorted(lacking))}, which is in use")
        self._seen |= readings.keys()
        self._read_back_times.took(system.now_s() - begun_s)
        if self._driven and (self._reports_each_s or self._read_back_times.is_due(self._checked_s)):
            self._outputs_stand()
        return readings

    def _open(self) -> None:
        """The device that is meant is made ready; another one, and one that fails, is let go of."""
        try:
            self._identity = identity = self._identified()
            self._wiring.refuse_another(identity)
            self._recognise(identity)
            if self._wiring.outputs and self._forgiving:
                with self._wiring.forgiving():
                    self._make_ready()
            elif self._wiring.outputs:
                self._make_ready()
            self._opened(identity)
        except BaseException:
            self.close()
            raise

    def _none(self, name: str, why: str) -> float:
        """NaN for an input without a measurement, and why.

        Raises:
            LinkError: it has had none from the first on, and something is to be run: a dead sensor, or the bench file
                is wrong.
        """
        if name not in self._seen and not self._wiring.looked_at:
            raise LinkError(f"{name} reads no measurement from the first on: {why}")
        self.invalid_reasons[name] = why
        return math.nan

    def _failed(self, text: str) -> LinkError:
        """After an answer that did not come nothing is believed for a while."""
        self._quiet_until_s = system.now_s() + self._longest_reply_s
        return LinkError(text)

    def _outputs_stand(self) -> None:
        self._look_at_outputs()
        self._checked_s = now_s = system.now_s()
        patience_s = max(self._longest_reply_s, 3.0 * self._reports_each_s) if self._reports_each_s else 0.0
        for name, stands in self._held().items():
            levels = [level for _, level in self._recent(name)]
            first_s, last_s = self._away_s.get(name, (now_s, -math.inf))
            if stands_as_driven(stands, levels, self._close.get(name, 0.0)):
                if now_s - last_s > patience_s:  # one who pulls now and then is found too
                    self._away_s.pop(name, None)
                continue
            self._away_s[name] = first_s, now_s
            if now_s - first_s >= patience_s:
                raise LinkError(
                    f"{name} stands at {self._named(name, stands)}, not at {self._named(name, levels[-1])} as it was "
                    f"driven: {self._why_moved}"
                )

    def _recent(self, name: str) -> list[tuple[float, float]]:
        """When and where an output was driven, since when the device may still tell of it."""
        driven, since_s = self._driven.get(name, []), system.now_s() - 3.0 * self._reports_each_s
        latest = max((i for i, (at_s, _) in enumerate(driven) if at_s <= since_s), default=0)
        return driven[latest:]
