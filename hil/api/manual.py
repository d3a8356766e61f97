"""A bench by hand: one output, what every input reads, a channel against a reference; and the demonstration."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Generator, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hil.api.bench import bench_of
from hil.api.callbacks import NOTHING, Notes, unsaid
from hil.errors import LinkError, SettingError, UnknownNameError, option, options_of
from hil.record.run_folder.progress import Progress, quiet
from hil.session.several import several

if TYPE_CHECKING:
    from hil.bench.manual.reading import Reading
    from hil.bench.read import BenchFile
    from hil.safety.outputs import Outputs
    from hil.session.calibration import Calibrated
    from hil.session.demo import Demonstration
    from hil.session.outcome import Outcome


@options_of("python")
def jog(
    bench: str | Path | BenchFile,
    channel: str,
    value: float,
    out: str | Path,
    *,
    for_s: float = 2.0,
    serial: str = "",
    operator: str = "",
    notes: Mapping[str, str] = NOTHING,
    resets: str | Iterable[str] = (),
    wanted: Callable[[], bool] = lambda: True,
    progress: Progress = quiet,
    outputs: Outputs | None = None,
) -> Outcome:
    """Bring one output to a value and back through the guard, recorded as a run (`hil jog`).

    Args:
        bench: bench file, or the name of an installed one, or what was read from it.
        channel: the output.
        value: where it goes, in its unit.
        out: run folder to make.
        for_s: how long it stands there.
        serial: serial number of the unit.
        operator: who does it.
        notes: what else is to be known.
        resets: interlocks whose trips are forgotten first.
        wanted: asked every tenth of a second; the output goes back as soon as it says no.
        progress: called with how far it is.
        outputs: kept up to what is known of the outputs, for somebody who asks for it when this failed.

    Raises:
        SettingError: the channel is an input, or the time is no time.
        RangeError: the value is outside the output's limits; nothing was driven.
    """
    from hil.session.labels import labels_of
    from hil.session.manual_output import output_of, to_be_ended
    from hil.session.procedure import load_procedure
    from hil.session.run import run_procedure

    file, procedure = bench_of(bench), load_procedure("jog")
    output_of(file, channel)
    if not for_s > 0.0:
        raise SettingError(f"for_s {for_s:g}: a time longer than 0 s was expected")
    labels = labels_of(serial, operator, [f"{k}={v}" for k, v in notes.items()])
    return run_procedure(
        to_be_ended(procedure, wanted), file, {"value": value, "for_s": for_s}, Path(out), progress, several(resets),
        output_states=outputs, labels=labels, commanding=channel,
    )  # fmt: skip


@options_of("python")
def watch(
    bench: str | Path | BenchFile, channels: Collection[str] = (), *, every_s: float = 0.5, seconds: float = math.inf
) -> Generator[Sequence[Reading]]:
    """What every input of a bench reads, again and again, without an output being opened (`hil watch`).

    Args:
        bench: bench file, or the name of an installed one, or what was read from it.
        channels: only these inputs.
        every_s: so long is looked for each answer, 0.05 to 60 s.
        seconds: the end.

    Yields:
        A reading of each input: raw value, value, noise, age, and in words whether it can be believed.

    Raises:
        SettingError: times beyond what is allowed, or a channel that is an output.
        LinkError: at the end, when a device did not answer.
    """
    from hil.bench.manual.inputs import inputs_of
    from hil.safety.interrupt import terminable

    if not 0.05 <= every_s <= 60.0:
        raise SettingError(f"every {every_s:g} s: 0.05 … 60 s is allowed")
    if not seconds > 0.0:
        raise SettingError(f"seconds {seconds:g}: more than 0 was expected")
    with terminable(), inputs_of(bench_of(bench), channels) as looked:
        for _ in range(math.ceil(min(seconds / every_s, 1e12) - 1e-9)):
            yield looked.look(every_s)
        if looked.failures:
            raise LinkError("; ".join(looked.failures.values()))


@options_of("python")
def calibrate(
    bench: str | Path | BenchFile,
    channel: str,
    reference: str = "",
    answered: Callable[[], float | None] | None = None,
    *,
    certificate: str | Path = "",
    table: str = "",
    points: int = 5,
    between: tuple[float, float] | None = None,
    reference_uncertainty: float | None = None,
    operator: str = "",
    valid_days: int = 365,
    out: str | Path = "",
    ask: Notes = unsaid,
    outputs: Outputs | None = None,
) -> Calibrated:
    """Slope and offset of a channel against a reference (`hil calibrate`).

    The `write()` of what is returned changes the bench file. An input is averaged for a second at each point, with no
    output opened; an output is driven through the guard and held until the answer is there. A certificate has the
    points in it: nothing is opened.

    Args:
        bench: bench file, or what was read from it.
        channel: an input or an output.
        reference: what it is compared with, in words.
        answered: asked for what the reference reads, in the channel's unit; None while nobody has answered.
        certificate: instead of both, the sensor's Digital Calibration Certificate (PTB's DCC, XML): a table whose
            quantities are `basic_referenceValue` and `basic_measuredValue`, in the channel's unit or the terminal's.
        table: its name, where there are several.
        points: at how many places.
        between: where an output goes; its limits when not given.
        reference_uncertainty: expanded (k = 2), of each of the reference's readings.
        operator: who calibrates.
        valid_days: it is due again after so long.
        out: run folder of an output.
        ask: told each question.
        outputs: kept up to what is known of the outputs.

    Raises:
        UnknownNameError: no such channel.
        SettingError: a point without a measurement, an output without a run folder, or both or neither of reference and
            certificate.
        FileError: no such certificate or table, or a quantity that the channel does not have.
    """
    from hil.safety.outputs import Outputs as Known
    from hil.session.calibration import calibrated, certified, input_points, output_points, targets_of
    from hil.session.labels import labels_of

    file, labels = bench_of(bench), labels_of("", operator, [])
    if channel not in file.bench.channels:
        raise UnknownNameError("channel", channel, file.bench.channels)
    if bool(certificate) == bool(reference):
        raise SettingError(
            f"either {option('reference')}, which is read beside the channel, or {option('certificate')}"
        )
    if certificate:
        if reference_uncertainty is not None or between is not None or str(out):
            raise SettingError(
                f"{option('certificate')} has its points and their uncertainty in it, and nothing is driven"
            )
        return certified(file, channel, Path(certificate), table, labels.operator, valid_days)
    if answered is None:
        raise SettingError("who tells what the reference reads (answered)?")
    if not file.bench.channels[channel].is_output:
        found = input_points(file, channel, points, ask, answered)
    elif not str(out):
        raise SettingError(f"'{channel}' is an output, which is driven: a run folder is needed (out)")
    else:
        targets = targets_of(file, channel, points, between)
        found = output_points(file, channel, targets, ask, answered, Path(out), outputs or Known(), labels)
    std = None if reference_uncertainty is None else 0.5 * abs(reference_uncertainty)
    return calibrated(file, channel, found, reference, std, labels.operator, valid_days)


@options_of("python")
def demo(out: str | Path, *, progress: Progress = quiet) -> Demonstration:
    """Test and identify a valve on the simulated bench, meet recordings that conceal an effect, diagnose (`hil demo`).

    Args:
        out: folder to make, with everything that the job leaves.
        progress: called with how far it is.
    """
    from hil.session.demo import demonstrate

    return demonstrate(Path(out), progress)
