"""What the measuring chain adds to a frequency response, whether that is allowed, and how to take it out.

ISO 10770-2 cl. 6.2: measuring equipment must not change the measured value by more than 1 %, in amplitude or
by phase shift. As a change of the complex response, 1 % is 0.087 dB or 0.57°.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.language.note import Note
from hil.record.recording import Array, Complex

ALLOWED_SHARE = 0.01


@dataclass(frozen=True, slots=True)
class MeasuringChain:
    """Everything between the command as recorded and the output as recorded that is not the valve.

    Attributes:
        sensor_lag_s: time constant of the output's sensor, first order.
        skew_s: how much later the output is converted than its stamp says (multiplexer).
        hold_s: interval over which the command is held between updates; 0 for a continuous command.
        read_at_s: how long after the command's update the output is read (`read_at` times the interval).
        read_std_s: standard uncertainty of when it is read, the same in every sample.
    """

    sensor_lag_s: float = 0.0
    skew_s: float = 0.0
    hold_s: float = 0.0
    read_at_s: float = 0.0
    read_std_s: float = 0.0

    def at(self, frequency_hz: Array) -> Complex:
        """Its complex gain: recorded response = response of the valve × this."""
        s = 2j * math.pi * np.asarray(frequency_hz, dtype=np.float64)
        late = np.exp(s * (self.skew_s + self.read_at_s - self.hold_s / 2.0))  # reading later looks like a lead
        held = np.sinc(np.asarray(frequency_hz) * self.hold_s)
        return late * held / (1.0 + s * self.sensor_lag_s)


@dataclass(frozen=True, slots=True)
class ChainCheck:
    """The chain's own effect against the 1 % rule, per frequency.

    Attributes:
        frequency_hz, amplitude_change, phase_deg: shape (n,); the change as a share, −0.01 is 1 % too small.
        broken_from_hz: lowest frequency at which the rule is broken; None when it holds everywhere.
    """

    frequency_hz: Array
    amplitude_change: Array
    phase_deg: Array
    broken_from_hz: float | None

    @property
    def sentence(self) -> Note:
        """For the report."""
        if self.broken_from_hz is None:
            return Note("The measuring chain changes the response by less than 1 % at every frequency.")
        worst = int(np.argmax(np.abs(self.phase_deg)))
        return Note(
            "The measuring chain changes the response by more than 1 % from {from_hz:g} Hz on ({amplitude:+.1f} %, "
            "{phase_deg:+.1f}° at {worst_hz:g} Hz). Correct for it or use a faster sensor.",
            from_hz=self.broken_from_hz, amplitude=100 * self.amplitude_change[worst],
            phase_deg=self.phase_deg[worst], worst_hz=self.frequency_hz[worst],
        )  # fmt: skip


def check_chain(chain: MeasuringChain, frequency_hz: Array) -> ChainCheck:
    """Hold the chain against the 1 % rule, amplitude and phase each by itself."""
    gain = chain.at(frequency_hz)
    amplitude, phase = np.abs(gain) - 1.0, np.unwrap(np.angle(gain))
    broken = (np.abs(amplitude) > ALLOWED_SHARE) | (np.abs(phase) > ALLOWED_SHARE)
    first = float(frequency_hz[np.argmax(broken)]) if broken.any() else None
    return ChainCheck(frequency_hz, amplitude, np.degrees(phase), first)


def corrected(response: FrequencyResponse, chain: MeasuringChain) -> FrequencyResponse:
    """The valve's own response: the chain divided out, what is not known of it added to the uncertainty."""
    note = (
        f"measuring chain taken out: sensor lag {1e3 * chain.sensor_lag_s:g} ms, skew {1e3 * chain.skew_s:g} ms, "
        f"hold {1e3 * chain.hold_s:g} ms, read {1e3 * chain.read_at_s:g} ms after the update"
    )
    valve = response.divided_by(chain.at(response.frequency_hz), note)
    return replace(valve, delay_std_s=math.hypot(response.delay_std_s, chain.read_std_s))
