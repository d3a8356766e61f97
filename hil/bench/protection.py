"""What a bench file says about limits and interlocks, as the guard takes it."""

from __future__ import annotations

import math

from hil.bench.file import EMERGENCY_STOP, Bench, InterlockEntry, OutputLimits
from hil.safety.envelope import Dwell, Envelope
from hil.safety.interlock import Band, Interlock
from hil.safety.protection import Protection
from hil.safety.witness import SETTLES_S, Witness
from hil.units import in_base_units


def protection_of(bench: Bench, rate_hz: float) -> Protection:
    """Limits, ramps and interlocks of a bench, in engineering units; the guard itself plays at `rate_hz`."""
    ramps = {name: channel.ramp_to_safe_per_s for name, channel in bench.channels.items()}
    return Protection(
        rate_hz=rate_hz,
        envelopes=envelopes_of(bench),
        ramps_per_s={name: ramp for name, ramp in ramps.items() if ramp is not None},
        interlocks=[
            *(interlock_of(name, entry, bench) for name, entry in bench.interlocks.items()),
            *emergency_stops(bench),
        ],
        block_s=bench.protection.block_s,
        patience_s=bench.protection.patience_s,
        witnesses=witnesses_of(bench),
        shutdown_order=bench.protection.shutdown_order,
    )


def witnesses_of(bench: Bench) -> dict[str, Witness]:
    """The input that answers to each output: as the file names it, else the response to the command."""
    found = {}
    for name, channel in bench.channels.items():
        if by := channel.witness or (_response_at_rest(bench) if channel.role == "command" else ""):
            entry = bench.channels[by]
            uncertainty = 0.0 if entry.calibration is None else entry.calibration.uncertainty or 0.0
            found[name] = Witness(by, bool(channel.witness), uncertainty, entry.settles_s or SETTLES_S)
    return found


def _response_at_rest(bench: Bench) -> str:
    """The response, where it returns with the command; a place does not, whether a cylinder travels or is held."""
    response = bench.roles["response"]
    stays = bench.valve.integrates or in_base_units(bench.channels[response].unit)[2] == {"m": 1}
    return "" if stays else response


def envelopes_of(bench: Bench) -> dict[str, Envelope]:
    """The limits of every output that has some; those of the command are tightened by the valve's own."""
    found = {name: envelope_of(c.limits) for name, c in bench.channels.items() if c.limits is not None}
    if bench.valve.limits is not None:
        valve = envelope_of(bench.valve.limits)
        command = bench.roles["command"]
        found[command] = found[command].tightened(valve) if command in found else valve
    return found


def envelope_of(limits: OutputLimits) -> Envelope:
    """Limits as the guard takes them."""
    dwells = tuple(Dwell(dwell.level, dwell.longest_s) for dwell in limits.dwell)
    return Envelope(limits.low, limits.high, limits.slew_per_s or math.inf, dwells)


def emergency_stops(bench: Bench) -> list[Interlock]:
    """The witnesses of the hardware's own stop. Each trips: after it, somebody resets by name before anything moves."""
    return [
        Interlock(name, "trip", Band(name, low=channel.open_below), is_emergency_stop=True)
        for name, channel in bench.channels.items()
        if channel.role == EMERGENCY_STOP
    ]


def interlock_of(name: str, entry: InterlockEntry, bench: Bench) -> Interlock:
    """An interlock, its raw limits (live zero) brought to the channel's unit."""
    line = bench.channels[entry.channel].line
    raw = line.range_of(
        -math.inf if entry.raw_low is None else entry.raw_low, math.inf if entry.raw_high is None else entry.raw_high
    )
    low = max(raw[0], -math.inf if entry.low is None else entry.low)
    high = min(raw[1], math.inf if entry.high is None else entry.high)
    condition = entry.only_while
    only_while = None if condition is None else Band(condition.channel, condition.low, condition.high)
    return Interlock(
        name, entry.action, Band(entry.channel, low, high, entry.minus), entry.for_s, only_while, entry.stale_s
    )
