"""What `hil check --live` has seen of a bench, as text and as JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hil.cli.printed import printed
from hil.units import behind_a_number

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hil.bench.manual.live import Link, Live, Seen
    from hil.bench.read import BenchFile


def _text(file: BenchFile, live: Live, infeasible: Mapping[str, str]) -> str:
    """Links, inputs, rate, procedures, and what is not plausible."""
    wanted_hz = file.bench.sample_rate_hz
    slow = "" if live.rate_hz >= wanted_hz else f"; too slow for sample_rate_hz = {wanted_hz:g}"
    unseen = f", without {', '.join(live.unseen)}, which has outputs alone" if live.unseen else ""
    unseen += f", without {', '.join(live.silent)}, which does not answer" if live.silent else ""
    silent = [f"  link {name}: does not answer" for name in live.silent]
    lines = ["looked at live, no output opened:", *map(_link, live.links), *silent, *map(_input, live.inputs)]
    lines.append(f"  samples: up to {live.rate_hz:.4g} a second, driving counted like reading{unseen}{slow}")
    lines.append(
        f"  frequency response: up to {live.fastest_hz:.3g} Hz, so a −3 dB frequency below that can be measured"
    )
    lines += [f"  can run: {', '.join(name for name, why in infeasible.items() if not why) or 'nothing'}"]
    lines += [f"  cannot run {name}: {why}" for name, why in infeasible.items() if why]
    return "\n".join([*lines, *(f"warning: {text}" for text in live.remarks)])


def print_live(file: BenchFile, live: Live, infeasible: Mapping[str, str], as_json: bool) -> None:
    """Print what was seen, in words or by schema hil.live/1."""
    procedures = [{"name": name, "can_run": not why, "why": why} for name, why in infeasible.items()]
    document = {"schema": "hil.live/1", "bench": file.bench.name, "links": live.links, "inputs": live.inputs,
            "rate_hz": live.rate_hz, "fastest_hz": live.fastest_hz, "unseen": live.unseen,
            "silent": live.silent, "procedures": procedures, "warnings": live.remarks}  # fmt: skip
    printed(document, _text(file, live, infeasible), as_json)


def _link(link: Link) -> str:
    if link.latency_s is None:
        return f"  link {link.name}: samples timed by the device ({link.timing}), up to {link.rate_hz:.4g} a second"
    return (
        f"  link {link.name}: all inputs read in {1e3 * link.latency_s:.3g} ms, up to {link.rate_hz:.4g} times a second"
    )


def _input(seen: Seen) -> str:
    reading = seen.reading
    unit = behind_a_number(reading.unit)
    value = "no value" if reading.value is None or not math.isfinite(reading.value) else f"{reading.value:.5g}{unit}"
    noise = "cannot be told" if reading.noise is None else f"{reading.noise:.3g}{unit}"
    steps = "did not change" if seen.resolution is None else f"{seen.resolution:.3g}{unit}"
    return f"  input {reading.name}: {value}, noise {noise}, resolution {steps}, {reading.state}{_standstill(seen)}"


def _standstill(seen: Seen) -> str:
    if not seen.is_watched:
        return ""
    if seen.standstill_s is None:
        return "; its noise cannot tell a frozen reading from a rest"
    return f"; frozen is noticed after {seen.standstill_s:.2g} s"
