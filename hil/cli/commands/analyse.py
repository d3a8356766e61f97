"""`hil analyse`: the calculations of the three papers on a recording of one's own."""

from __future__ import annotations

import math
import shlex
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from hil.cli.options import Json, Part, argument, option
from hil.cli.places import check_file
from hil.cli.printed import printed
from hil.cli.reading import takes_reading, teller
from hil.errors import FileError, SettingError, storing
from hil.record.reading import Reading

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.physics.model import Model
    from hil.physics.transfer_function import TransferFunction
    from hil.record.recording import Recording

group = typer.Typer(
    help="The calculations of the papers behind the valves, on a recording of one's own.", no_args_is_help=True
)

_print_result = partial(printed, indent=1)
_Input = option("", "--input", "NAME", "Command; a run says it, as does a file of two channels.")
_Output = option("", "--output", "NAME", "Response, likewise.")


@group.command("step")
@takes_reading
def step(
    recording: Path | None = argument(None, "RECORDING", "Recording with steps of the command."),
    input_name: str = _Input,
    output_name: str = _Output,
    rise: float | None = option(None, "--rise", "S", "Instead of a recording: rise time."),
    settling: float | None = option(None, "--settling", "S", "Instead of one: settling time."),
    band: float = option(2.0, "--band", "%", "Of the change, within which it counts as settled."),
    beside: Path | None = option(
        None, "--beside", "TABLE|RUN", "Measured frequency response to hold the models against."
    ),
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Two first-order models and a second-order one from rise and settling time: eqs 9 to 22 of the HPV41 paper."""
    from hil import api

    read = None if recording is None else _read(recording, reading)
    found = api.step_models(
        read, rise_s=rise, settling_s=settling, input=input_name, output=output_name, beside=beside, band=band / 100.0
    )
    _print_result([one.as_dict() for one in found], "\n".join(one.as_text() for one in found), as_json)


@group.command("sines")
@takes_reading
def sines(
    recordings: list[Path] = argument(..., "RECORDING...", "Stepped sines, in one file or several."),
    input_name: str = _Input,
    output_name: str = _Output,
    out: Path | None = option(None, "--out", "TABLE.csv", "Table for `hil identify`, one each."),
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Magnitude and phase of stepped sines, with uncertainty: eqs 1 to 6 of the HPV41 paper."""
    from hil import api

    found = api.frequency_response([_read(one, reading) for one in recordings], input=input_name, output=output_name)
    text = found.as_text()
    if out is not None:
        for path in found.files(out):
            check_file(path, recordings)
        written = found.write(out)
        text += "".join(f"\nnext: hil identify {shlex.quote(str(path))} --plant transfer-function" for path in written)
    _print_result(found.as_dict(), text, as_json)


@group.command("flow")
@takes_reading
def flow(
    recordings: list[Path] = argument(..., "RECORDING...", "Slow sweeps up and down."),
    input_name: str = _Input,
    output_name: str = _Output,
    degree: int = option(9, "--degree", min=1, max=30, help="Of the polynomial."),
    neutral: float = option(0.0, "--neutral", "U", "Command from which both sides go."),
    out: Path | None = option(None, "--out", "CURVE.csv", "Curve for `hil analyse compose`."),
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Flow curve of slow sweeps: dead band, hysteresis, gains, polynomial and spline: figure 6 of the HPV41 paper."""
    from hil import api

    read = [_read(one, reading) for one in recordings]
    found = api.flow_curve(read, input=input_name, output=output_name, degree=degree, neutral=neutral)
    text = found.as_text()
    if out is not None:
        check_file(out, recordings)
        found.write(out)
        text += f"\n{out}: the curve; `hil analyse compose` makes a model of it"
    _print_result(found.as_dict(), text, as_json)


@group.command("classes")
@takes_reading
def classes(
    valves: list[Path] = argument(
        ..., "GOOD BAD|TABLE.csv", "Two folders of recordings of one test; or a row for each valve."
    ),
    output_name: str = option("", "--output", "NAME", "Channel that is compared."),
    judge: list[Path] = option([], "--judge", "RECORDING", "A valve whose class is asked."),
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Classes learnt from good and bad valves: accepted bad and refused good, each with exact 95 % limits."""
    from hil import api
    from hil.session.class_analysis import GOOD

    if len(valves) == 1 and not valves[0].is_dir():
        found = api.learn_classes(valves[0])
    elif len(valves) == 2:
        valves = sorted(valves, key=lambda folder: folder.name.casefold() not in GOOD)
        good, bad = (_folder(one, reading) for one in valves)
        others = [_read(one, reading) for one in judge]
        found = api.learn_classes(good, bad, others, output=output_name, names=(valves[0].name, valves[1].name))
    else:
        raise SettingError(f"{len(valves)} named; two folders are needed, the good valves' first, or one table")
    _print_result(found.as_dict(), found.as_text(), as_json)


@group.command("compose")
def compose(
    curve: Path = argument(..., "CURVE", "Run of flow_curve, or CSV: command, flow."),
    responses: list[Path] = argument(
        ...,
        "RESPONSE...",
        "Tables of a frequency response or runs, averaged; one MODEL.json; or cummins-efc, brevini-hpv41.",
    ),
    out: Path = option(..., "--out", "MODEL.json", "Model to write."),
    poles: int = option(3, "--poles", min=1, max=3, help="Of the dynamics."),
    zeros: int = option(1, "--zeros", min=0, max=1, help="Of the dynamics."),
    dead_time: bool = option(False, "--dead-time/--no-dead-time", help="Whether they have one."),
    weights: str = option("", "--weights", "relative|uniform", "Of lines without uncertainty."),
    part: Part = "",
    as_json: Json = False,
) -> None:
    """A measured flow curve and a mean transfer function as one model: section 8 and figure 17 of the HPV41 paper."""
    from hil import api
    from hil.physics.measured_curve import MEASURED
    from hil.session.analyses import model_to_linearise

    check_file(out, [curve, *responses])
    if len(responses) == 1 and (responses[0].suffix == ".json" or str(responses[0]) in MEASURED):
        dynamics = model_to_linearise(responses[0])
    else:
        mean = api.average(responses, normalised=True, part=part)
        dynamics = api.identify(
            [mean], "transfer-function", poles=poles, zeros=zeros, dead_time=dead_time, weights=weights
        ).model
    made = api.compose(curve, dynamics)
    api.save_model(made, out)
    text, document = _dynamics(dynamics)
    document = {"schema": "hil.composed/1", "file": out, "input": made.input, "output": made.output, **document}
    _print_result(document, f"{out}: {made.input} → {made.output}\n  {text}", as_json)


def _dynamics(model: Model) -> tuple[str, dict[str, Any]]:
    """The dynamics of a composed model, in words and as JSON values."""
    from dataclasses import asdict

    from hil.physics.formula import formula
    from hil.session.analyses import linear_of

    if model.plant != "transfer-function":
        return f"dynamics of {model.plant}; `hil identify --plant` refines them", {"dynamics": model.plant}
    linear = linear_of(model, "the dynamics")
    return f"dynamics {formula(linear)}", asdict(linear)


@group.command("corners")
def corners(
    table: Path = argument(..., "TABLE|RUN", "Frequency response."),
    poles: int = option(..., "--poles", min=1, help="Real poles."),
    zeros: int = option(0, "--zeros", min=0, help="Real zeros."),
    part: Part = "",
    out: str = option("", "--out", "FILE", "Also write the transfer function, as --to says."),
    to: str = option("json", "--to", "python|matlab|json|csv", "For which tool."),
    as_json: Json = False,
) -> None:
    """Real corners from a Bode magnitude by its asymptotes: eqs 3.1 to 3.6 of the EFC thesis."""
    from hil.session.analyses import corners_of, corners_text
    from hil.session.sources import tables_of

    fit = corners_of(tables_of([table], part=part)[0], poles, zeros)
    found = {
        "schema": "hil.corners/1", "gain": fit.model.dc_gain, "poles_rad_s": fit.poles_rad_s,
        "zeros_rad_s": fit.zeros_rad_s, "poles_std_rad_s": fit.pole_stds, "zeros_std_rad_s": fit.zero_stds,
        "rms_db": fit.rms_db, "asymptotic_misfit": fit.asymptotic_misfit,
        "misfit": fit.misfit, "numerator": fit.model.numerator, "denominator": fit.model.denominator,
    }  # fmt: skip
    _write(out, to, "corners", fit.model)
    _print_result(found, corners_text(fit), as_json)


@group.command("recursive")
@takes_reading
def recursive(
    recording: Path = argument(..., "RECORDING", "Recording with even stamps."),
    poles: int = option(..., "--poles", min=0, help="Coefficients a1 …"),
    inputs: int = option(..., "--inputs", min=1, help="Coefficients b0 …"),
    delay: int = option(0, "--delay", min=0, help="Samples by which the input is late."),
    difference: bool = option(False, "--difference", help="Of changes from sample to sample, as eq. 3.7."),
    memory: float = option(1.0, "--memory", "λ", "Weight of a sample that is one older."),
    exponential: bool = option(False, "--exponential", help="Forget everywhere, as eq. 3.15."),
    prior: float = option(1e3, "--prior", "STD", "Standard deviation before the first: √P(0)."),
    path: Path | None = option(None, "--path", "FILE", "Parameters after each sample, .csv."),
    input_name: str = _Input,
    output_name: str = _Output,
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Recursive least squares, sample by sample: eqs 3.7 to 3.15 of the EFC thesis."""
    from hil.identification.papers.recursive_least_squares import ArxForm
    from hil.session.analyses import channels_of, estimated_online

    read = _read(recording, reading)
    found = estimated_online(
        read, *channels_of(read, input_name, output_name), ArxForm(poles, inputs, delay, difference), memory=memory,
        forgetting="exponential" if exponential else "directional", prior_std=prior,
    )  # fmt: skip
    if path is not None:
        found.write_path(path)
    _print_result(found.as_dict(), found.as_text(), as_json)


@group.command("process")
@takes_reading
def process(
    recording: Path = argument(..., "RECORDING", "Recording of one slow sine, or of a step."),
    integrates: bool = option(False, "--integrates", help="The response goes on while the command stands."),
    skip: float = option(0.0, "--skip", "S", "At the beginning, not judged.", min=0.0),
    out: str = option("", "--out", "FILE", "Also write the transfer function, as --to says."),
    to: str = option("json", "--to", "python|matlab|json|csv", "For which tool."),
    input_name: str = _Input,
    output_name: str = _Output,
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Process model, first order, P1 or P1I: what one sine determines; section 5 of the SP08-47C paper."""
    from dataclasses import asdict

    from hil.identification.papers.first_order import first_order
    from hil.session.analyses import channels_of

    read = _read(recording, reading)
    command, response = channels_of(read, input_name, output_name)
    found = first_order(read, command, response, integrates=integrates, skip_s=skip)
    _write(out, to, "process model", found.model)
    note = found.note(read.channel(command).unit, read.channel(response).unit)
    _print_result({"schema": "hil.process-model/1", **asdict(found)}, str(note), as_json)


@group.command("loop")
def loop(
    model: Path | None = argument(None, "MODEL.json", "Closed loop, a transfer function."),
    numerator: str = option("", "--numerator", "B,…", "Instead of a model, highest power first."),
    denominator: str = option("", "--denominator", "A,…", "Likewise."),
    sensor: Path | None = option(None, "--sensor", "MODEL.json", "C of the loop; 1 without one."),
    feedback: bool = option(False, "--feedback", help="The sensor stands in the feedback, not the forward path."),
    close: float | None = option(
        None, "--close", "K_TK", "Close the loop instead, eq 8: gain of the feedback, per unit of output."
    ),
    out: str = option("", "--out", "FILE", "Also write the loop that was found, as --to says."),
    to: str = option("json", "--to", "python|matlab|json|csv", "For which tool."),
    as_json: Json = False,
) -> None:
    """The plant of a closed loop, or with --close the loop of a plant: eqs 8 and 10 to 12 of the SP08-47C paper."""
    from hil.identification.papers.closed_loop import UNITY, closed_with_gain, opened
    from hil.physics.formula import formula
    from hil.physics.model import load_model
    from hil.session.analyses import linear_of, ratio

    if (model is None) == (not numerator or not denominator):
        raise SettingError("name a model of the closed loop, or say --numerator B,… and --denominator A,…")
    given = linear_of(load_model(model), str(model)) if model else ratio(_numbers(numerator), _numbers(denominator))
    if close is not None:
        if sensor is not None or feedback:
            raise SettingError("--close closes a loop over a gain; --sensor and --feedback open one")
        loop, notes = closed_with_gain(given, close)
        content = {"schema": "hil.closed-loop/1", **_ratio_and_poles(loop), "notes": notes}
        _write(out, to, "closed loop", loop)
        _print_result(content, _loop_text("closed", formula(loop), loop, notes), as_json)
        return
    by = UNITY if sensor is None else linear_of(load_model(sensor), str(sensor))
    found = opened(given, by, "feedback" if feedback else "forward")
    content = {
        "schema": "hil.open-loop/1", **_ratio_and_poles(found.model),
        "unstable_poles": [{"re": p.real, "im": p.imag} for p in found.unstable_poles],
        "closed_at_rest": found.rest, "notes": found.notes,
    }  # fmt: skip
    _write(out, to, "open loop", found.model)
    _print_result(content, _loop_text("open", formula(found.model), found.model, found.notes), as_json)


def _ratio_and_poles(model: TransferFunction) -> dict[str, Any]:
    poles = [{"re": p.real, "im": p.imag} for p in model.poles]
    return {"numerator": model.numerator, "denominator": model.denominator, "poles": poles}


def _loop_text(kind: str, ratio: str, model: TransferFunction, notes: Sequence[str]) -> str:
    from hil.physics.formula import root_text

    poles = ", ".join(map(root_text, model.poles))
    rows = [f"{kind} loop {ratio}", f"  poles {poles} rad/s, gain at rest {model.dc_gain:.5g}"]
    return "\n".join([*rows, *(f"  note: {note}" for note in notes)])


@group.command("error")
@takes_reading
def error(
    recording: Path = argument(..., "RECORDING", "Pressure of a step to 1.4 or 1.6 A, from the step on."),
    reference: Path = option(..., "--reference", "RECORDING", "Pressure of a good valve."),
    level: str = option(..., "--level", "low|high", "1.4 A or 1.6 A."),
    output_name: str = option("pressure", "--output", "NAME", "Channel of the pressure."),
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Deviation from reference steps, its crisp class and degrees: eqs 4.1 to 4.7 of the EFC thesis."""
    from hil.session.analyses import error_between

    if level not in ("low", "high"):
        raise SettingError(f"--level {level}: there are low (1.4 A) and high (1.6 A)")
    measured, good = (_read(p, reading) for p in (recording, reference))
    found = error_between(measured, good, "low" if level == "low" else "high", output_name)
    _print_result(found.as_dict(), found.as_text(), as_json)


def _read(path: Path, reading: Reading) -> Recording:
    from hil.session.sources import notes_on, samples_of

    found = samples_of(path, reading)
    for note in notes_on([found]):
        teller(aside=True)(note)
    return found


def _folder(folder: Path, reading: Reading) -> list[Recording]:
    """The recordings in a folder, one for each valve, by name."""
    if not folder.is_dir():
        raise FileError(f"{folder}: no folder; the recordings of a class lie in one, each of one valve")
    return [_read(one, reading) for one in sorted(folder.iterdir()) if not one.name.startswith(".")]


def _numbers(text: str) -> list[float]:
    with suppress(ValueError):
        found = [float(part) for part in text.split(",")]
        if all(map(math.isfinite, found)):
            return found
    raise SettingError(f"'{text}': coefficients are numbers between commas, the highest power first")


def _write(out: str, to: str, name: str, model: TransferFunction) -> None:
    if out:
        from hil.exports.texts import function_text
        from hil.record.durable import write_named

        text = function_text(model, name, to)
        check_file(Path(out))
        with storing(Path(out)):
            write_named(Path(out), text)
