"""Run the frequency-response test over every link in wall-clock time and write its section of the page of links.

python -m tests.link_page
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.errors import LinkError
from hil.identification.frequency.sine_segments import frequency_responses
from hil.identification.frequency.transfer_function import TransferFunctionFit
from hil.record.read import read_recording
from hil.record.recording import Array, Recording
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure
from procedures._recorded import roles_of
from procedures._response import evaluated
from tests.bench_files import bench_file
from tests.fault_page import write_section
from tests.links import PATIENT, devices_of, moved

TITLE = "The frequency response over each link"
LINKS = {
    "hpv41-modbus-tcp": "Modbus TCP",
    "hpv41-modbus-rtu": "Modbus RTU",
    "hpv41-serial": "Serial",
    "hpv41-canopen": "CANopen",
    "hpv41-mixed": "Mixed",
}
FORM = {"poles": 3, "zeros": 0, "dead_time": True}  # what the simulated valve is for small amplitudes
WHOLE = {
    "frequencies": (0.1, 0.3, 0.5, 0.7, 1.1, 1.5, 2.1, 2.9, 3.7, 4.9), "amplitudes": (20.0,), "biases": (50.0,),
    "rate_hz": 100.0, **FORM,
}  # fmt: skip
WAITS = tuple(
    (f'driver = "{name}"\n', f'driver = "{name}"\ntimeout_s = 1.0\n') for name in ("modbus", "ascii_module", "scpi")
)
RATE_HZ = 1000.0  # of the direct test, in virtual time
RESUMED = 4  # so often a run is begun or resumed
CLEAR = 2.0  # standard uncertainties beyond which a deviation is named
HEAD = """\
<!-- Made by `python -m tests.link_page` from what it measures. -->

`frequency_response` on the benches `hpv41-modbus-tcp`, `-modbus-rtu`, `-serial` (ASCII module and SCPI scanner),
`-canopen`, `-mixed` (CANopen, Modbus TCP, serial). It drives {count} sines of {lowest:g} … {highest:g} Hz,
±{amplitude:g} % about {bias:g} %, {rate:g} samples a second, in wall-clock time. *Direct* is the same on the
simulated DAQ `brevini-hpv41`, in virtual time at {direct_rate:g} samples a second. Both have the noise of their
sensors and a transfer function of three poles and a dead time. Devices speak the real protocols over loopback, pseudo
terminals and a CAN hub. The machine: {machine}.

- *Delay* is from the update of the output to the reading of the response; *skew* is between inputs of one sample, in
  ms. A sample that begins more than half an interval late is *late*.
- A figure over a link is what `hil run` reports: each sample counts from when it was really read. ± is one standard
  uncertainty. It holds noise, what no linear model explains, and that nobody knows where within its exchange a device
  acts.
- Behind it stands the difference to the direct figure over both standard uncertainties together. In brackets it is
  that of the same recording as if every input had been read when the output was updated.
- The gain of the spool position is in % per %. Time-outs are 1 s here (CANopen: 0.25 s).
"""


@dataclass(frozen=True)
class Figure:
    """A figure of the valve with its standard uncertainty."""

    name: str
    unit: str
    value: float
    std: float

    def off_by(self, other: Figure) -> float:
        """The difference in standard uncertainties of both."""
        return (self.value - other.value) / float(np.hypot(self.std, other.std))


@dataclass(frozen=True)
class Seen:
    """What a run over a link brought: figures as reported and without the link's correction, by name; and the link."""

    corrected: Mapping[str, Figure]
    uncorrected: Mapping[str, Figure]
    recording: Recording


def direct(response: str, folder: Path, settings: Mapping[str, Any] = MappingProxyType(WHOLE)) -> dict[str, Figure]:
    """The figures of the simulated DAQ in virtual time, with a channel as the response."""
    roles = {"flow": {"role": None}, response: {"role": "response"}}
    path = bench_file(folder / "direct.toml", "brevini-hpv41", channels=roles)
    procedure = load_procedure("frequency_response")
    run_procedure(procedure, read_bench(path), {**settings, "rate_hz": RATE_HZ}, folder / "direct")
    return figures(read_recording(folder / "direct"))


def over(bench: str, folder: Path, settings: Mapping[str, Any] = MappingProxyType(WHOLE)) -> Seen:
    """The same over the links of a bench, its devices in a process of their own."""
    text = benches()[bench].read_text(encoding="utf-8")
    for old, new in (*PATIENT, *WAITS):
        text = text.replace(old, new)
    path = folder / "linked.toml"
    path.write_text(moved(text, folder), encoding="utf-8")
    with devices_of(path):
        recording = read_recording(_finished(read_bench(path), folder, settings))
    return Seen(figures(recording), figures(uncorrected(recording)), recording)


def _finished(file: BenchFile, folder: Path, settings: Mapping[str, Any]) -> Path:
    """The folder of the whole run; where an answer did not come in time, it is resumed at its next sine."""
    procedure = load_procedure("frequency_response")
    out = folder / "linked"
    for again in range(RESUMED):
        try:
            if again:
                run_procedure(procedure, file, {}, folder / f"linked {again}", resume=out)
                return folder / f"linked {again}"
            run_procedure(procedure, file, settings, out)
            return out
        except LinkError as error:
            print(error, flush=True)
            out = folder / f"linked {again}" if again else out
    raise AssertionError(f"{file.bench.name}: broken off {RESUMED} times")


def uncorrected(recording: Recording) -> Recording:
    """The recording as if it did not know when its inputs were read."""
    told = ("delay_channels", "delays_s", "delay_s")
    sampling = {name: value for name, value in recording.meta["sampling"].items() if name not in told}
    return replace(recording, meta={**recording.meta, "sampling": sampling})


def figures(recording: Recording) -> dict[str, Figure]:
    """What the evaluation of the procedure makes of a recording, by name."""
    command, response = roles_of(recording)
    (one,) = evaluated(recording, frequency_responses(recording, command.name, response.name))
    gain, amplitude, phase, _ = one.measured()
    assert one.fit is not None and gain.value and amplitude.value and phase.value
    found = [
        Figure("gain", f"{response.unit} per {command.unit}", gain.value, gain.std or 0.0),
        Figure("−3 dB bandwidth", "Hz", amplitude.value, amplitude.std or 0.0),
        Figure("−90° bandwidth", "Hz", phase.value, phase.std or 0.0),
        *_of_the_model(one.fit),
    ]
    return {figure.name: figure for figure in found}


def _of_the_model(fit: TransferFunctionFit) -> Iterator[Figure]:
    """Natural frequency and damping of the pole pair, the pilot's time constant, the dead time."""
    names = (
        ("natural frequency", "Hz", 1.0),
        ("damping ratio", "1", 1.0),
        ("time constant", "ms", 1e3),
        ("dead time", "ms", 1e3),
    )

    def physical(parameters: Array) -> Array:
        _, first, second, lag, dead_time = parameters
        return np.array([0.5 / np.pi / np.sqrt(second), 0.5 * first / np.sqrt(second), lag, dead_time])

    values = physical(fit.parameters)
    stds = np.sqrt(np.diag(fit.propagated(physical)))
    for (name, unit, scale), value, std in zip(names, values, stds, strict=True):
        yield Figure(name, unit, scale * float(value), scale * float(std))


def main() -> None:
    """Measure and write."""
    os.environ.setdefault("HIL_STATE_DIR", tempfile.mkdtemp())
    references: dict[str, dict[str, Figure]] = {}
    found: dict[str, Seen] = {}
    for bench, title in LINKS.items():
        with tempfile.TemporaryDirectory() as name:
            found[title] = over(bench, Path(name))
            response = roles_of(found[title].recording)[1].name
            if response not in references:
                references[response] = direct(response, Path(name))
            print(link_row(title, found[title].recording), flush=True)
    apart = [one for title, seen in found.items() for one in far(title, seen, references[_response(seen)])]
    later_ms = [s.corrected["dead time"].value - references[_response(s)]["dead time"].value for s in found.values()]
    tables = "\n".join([*_links(found), "", *_figures(found, references), ""])
    write_section(TITLE, "\n".join([_head(), tables, _short(apart, later_ms)]))


def _response(seen: Seen) -> str:
    return roles_of(seen.recording)[1].name


def _links(found: Mapping[str, Seen]) -> Iterator[str]:
    heads = ("link", "response", "samples a second", "latency", "delay", "at most", "skew", "late")
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)
    yield from (link_row(title, seen.recording) for title, seen in found.items())


def _figures(found: Mapping[str, Seen], references: Mapping[str, Mapping[str, Figure]]) -> Iterator[str]:
    """A row for each figure: the direct one of each response, then each link with how far it is off."""
    heads = ["figure", *(f"direct, {response}" for response in references), *found]
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)
    for name, figure in next(iter(references.values())).items():
        cells = [f"{name} [{figure.unit}]", *(told(plain[name]) for plain in references.values())]
        for seen in found.values():
            plain, over_link = references[_response(seen)][name], seen.corrected[name]
            off, uncorrected_off = over_link.off_by(plain), seen.uncorrected[name].off_by(plain)
            cells.append(f"{told(over_link)}; {off:+.1f} ({uncorrected_off:+.1f})")
        yield f"| {' | '.join(cells)} |"


def link_row(title: str, recording: Recording) -> str:
    """Rate, latency, delay and skew of a link in ms, as the header of the run and its samples say; late samples."""
    sampling = recording.meta["sampling"]
    response = roles_of(recording)[1].name
    delays_s = {name: recording.values(name) for name in dict.fromkeys(sampling["delay_channels"].values())}
    own_s = delays_s[sampling["delay_channels"][response]]
    means_s = [float(values.mean()) for values in delays_s.values()]
    late = sum(event["details"]["count"] for event in recording.meta["events"] if event["event"] == "late samples")
    skew = f"{1e3 * (max(means_s) - min(means_s)):.2f}" if len(means_s) > 1 else "–"
    broken = sum(event["event"] == "resumed" for event in recording.meta["events"])
    return (
        f"| {title} | {response} | {sampling['highest_rate_hz']:.0f} | {1e3 * sampling['latency_s']:.2f} | "
        f"{1e3 * own_s.mean():.2f} ± {1e3 * own_s.std():.2f} | {1e3 * own_s.max():.1f} | {skew} | "
        f"{late} of {len(recording)}{f', resumed {broken} times' if broken else ''} |"
    )


def told(figure: Figure) -> str:
    """Value ± standard uncertainty, as many digits as that has two of."""
    digits = max(0, 1 - int(np.floor(np.log10(figure.std))))
    return f"{figure.value:.{digits}f} ± {figure.std:.{digits}f}"


def far(title: str, seen: Seen, plain: Mapping[str, Figure]) -> Iterator[str]:
    """Figures that are further from the direct ones than their uncertainties explain."""
    for name, figure in seen.corrected.items():
        if abs(off := round(figure.off_by(plain[name]), 1)) > CLEAR:
            yield f"{title}: {name} {off:+.1f}"


def _head() -> str:
    frequencies = WHOLE["frequencies"]
    return HEAD.format(
        count=len(frequencies), lowest=frequencies[0], highest=frequencies[-1], amplitude=WHOLE["amplitudes"][0],
        bias=WHOLE["biases"][0], rate=WHOLE["rate_hz"], direct_rate=RATE_HZ,
        machine=f"{os.cpu_count()} cores, load {os.getloadavg()[1]:.1f} over the last five minutes",
    )  # fmt: skip


def _short(apart: list[str], later_ms: list[float]) -> str:
    figures_told = "; ".join(apart) if apart else "none"
    dead_times = ", ".join(f"{value:+.1f}" for value in later_ms)
    return f"""\
### What falls short

- Figures off by more than {CLEAR:g} standard uncertainties: {figures_told}. By chance one or two of 35 would be.
- Dead times over the links, in the order above, less the direct one: {dead_times} ms. A host that is woken late
  after an answer has come counts half of that wait as delay of the reading.
- Where within its exchange a device acts is most of the uncertainty of dead time and −90° bandwidth on a slow line. A
  device that always acts at one end of it is off by up to the delay.
- A host that stalls within a sine disturbs it, and the uncertainty holds that as far as the residuals show it.
- Outputs that lie on several links have one stamp, in the middle of driving them all.
- The uncertainty of fits in time does not hold that of the stamps; a multisine is corrected by the mean delay alone.
"""


if __name__ == "__main__":
    main()
