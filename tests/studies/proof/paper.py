"""`python -m tests.studies.proof.paper`: the HPV41 paper's own mismatch, diagnosed.

The six published models differ by amplitude and sign, and one mean model serves none well. Recordings are made from
the six (stepped sines of the paper, flow over its value at 0.1 Hz on a straight metering edge, noise of 0.3 l/min); the
nominal valve is fitted to recordings of the mean model; the diagnosis says what it lacks.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import typer

from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import Experiment, for_model
from hil.physics.model import Model, Value, typical_model
from hil.physics.published import tordal
from hil.physics.simulate import Drive, simulate
from hil.physics.transfer_function import TransferFunction
from hil.record.recording import Array, Recording, recording
from hil.session.diagnosis import write_diagnosis

RATE_HZ, NOISE_LPM = 250.0, 0.3
SLOPE = tordal.FULL_FLOW_LPM / (100.0 - tordal.DEAD_BAND_LPM)
_SETTLING_S, _LEAST_S, _LEAST_PERIODS = 2.0, 3.0, 2


def stepped_sine(amplitude: float) -> Array:
    """The paper's frequencies one after another, without a jump, in % about the bias."""
    phase, parts = 0.0, [np.zeros(round(_SETTLING_S * RATE_HZ))]
    for frequency in tordal.FREQUENCIES_HZ:
        count = round(max(_LEAST_S, _LEAST_PERIODS / frequency) * RATE_HZ)
        turn = 2.0 * np.pi * frequency / RATE_HZ
        parts.append(amplitude * np.sin(phase + turn * np.arange(count)))
        phase += turn * count
    return np.concatenate(parts)


def recorded(name: str, model: TransferFunction, amplitude: float, bias: float, seed: int) -> Recording:
    """A recording of a published model about a bias, its static gain that of the metering edge."""
    sine = stepped_sine(amplitude)
    time_s = np.arange(len(sine)) / RATE_HZ
    gain = model.dc_gain
    answer = simulated(model, sine)
    level = np.sign(bias) * SLOPE * (abs(bias) - tordal.DEAD_BAND_LPM)
    flow = level + SLOPE / gain * answer
    flow += NOISE_LPM * np.random.default_rng(seed).standard_normal(len(flow))
    return recording(name, time_s, {"command [%]": bias + sine, "flow [l/min]": flow})


def simulated(model: TransferFunction, sine: Array) -> Array:
    """The answer of a published model to a command held from sample to sample."""
    as_model = model.to_model(tordal.INPUT, tordal.OUTPUT)
    drive = Drive(sine[None, :], 0.0, 1.0 / RATE_HZ, 0.0)
    answer: Array = simulate(as_model.definition, as_model.values, drive)[0]
    return answer


def mean_valve() -> Model:
    """The nominal model: the plant with a straight edge, fitted to the mean model on both sides."""
    start = typical_model("brevini-hpv41")
    known = {
        "curve_exponent": 1.0, "sensor_lag": 0.008,
        "dead_band": tordal.DEAD_BAND_LPM, "full_flow": tordal.FULL_FLOW_LPM,
    }  # fmt: skip
    values = {n: Value(known.get(n, v.value), v.unit) for n, v in start.parameters.items()}
    mean = [recorded(f"mean {bias:+g}", tordal.MEAN_MODEL, 10.0, bias, 7) for bias in (50.0, -50.0)]
    straight = replace(start, parameters=values)
    return fit_plant(straight, [for_model(straight, each) for each in mean]).model


def six(model: Model) -> list[Experiment]:
    """The six runs as experiments."""
    return [for_model(model, recorded(run.name, run.transfer_function, run.amplitude, run.bias, k))
            for k, run in enumerate(tordal.RUNS)]  # fmt: skip


def diagnosed(which: tuple[str, ...] = ()) -> Diagnosed:
    """The diagnosis of all six runs, or of those named."""
    model = mean_valve()
    return diagnose(model, [e for e in six(model) if not which or e.name in which])


def main(
    out: Path = typer.Option(Path("proof/paper"), help="Folder for the diagnosis and its report."),
    only: str = typer.Option("", help="Runs that take part, separated by commas; all if empty."),
) -> None:
    """Diagnose the paper's own mismatch."""
    found = diagnosed(tuple(name for name in only.split(",") if name))
    write_diagnosis(found, out)
    print(found.diagnosis.as_text())


if __name__ == "__main__":
    typer.run(main)
