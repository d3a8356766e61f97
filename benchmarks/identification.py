"""Identification against its peers: time as a ratio, error against the Cramér–Rao bound.

    python benchmarks/identification.py [DRAWS]

Sine fit: 5 s at 10 kS/s, offset 50, amplitude 10, noise 1, as a bench samples the HPV41.
Transfer function: the 25 lines of table 1 (10 %) of the HPV41 paper with 1 % noise; python-control fits
nothing to frequency data, so it gets a recording in time, and so do we. Needs the extra `bench`.
"""

from __future__ import annotations

import math
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `hil` itself does; peers gain by it too

import numpy as np
from numpy.typing import NDArray
from scipy.signal import max_len_seq
from table import Row, milliseconds, show

from hil.identification.frequency.frequency_response import FrequencyResponse, from_table
from hil.identification.frequency.order_choice import fit_transfer_function
from hil.identification.frequency.rational import Form
from hil.identification.frequency.transfer_function import fit_form
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.physics.model import typical_model
from hil.physics.published.tordal import FREQUENCIES_HZ, RUNS
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Recording, recording
from hil.signals.sine_fit import sine_fit

Array = NDArray[np.float64]

TRUTH = RUNS[1]
COEFFICIENTS = np.array([TRUTH.b1, TRUTH.b0, TRUTH.a2, TRUTH.a1, TRUTH.a0])


def main() -> None:
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    warnings.simplefilter("ignore")  # peers warn about what they are asked to do
    for title, rows in (
        ("sine of known frequency, 50 000 samples", sine_rows(1.7, draws)),
        ("sine of known frequency, half a period", sine_rows(0.1, draws)),
        ("estimator variance over the bound (2000 samples, harmonics 1 to 5)", variance_rows(50 * draws)),
        ("transfer function from 25 lines", transfer_function_rows(draws)),
        ("transfer function from 20 s in time", time_rows(3)),
    ):
        show(title, rows)


# -- sine fits ---------------------------------------------------------------------------------------------


def wave(t: Array, offset: float, amplitude: float, frequency: float, phase: float) -> Array:
    return offset + amplitude * np.sin(2 * np.pi * frequency * t + phase)


def sine_rows(frequency_hz: float, draws: int) -> Iterator[Row]:
    """Time per fit, and rms error of the amplitude over its bound with the frequency known."""
    from lmfit.models import ConstantModel, SineModel
    from scipy.optimize import curve_fit

    t = np.arange(50_000) / 10_000.0
    rng = np.random.default_rng(1)
    clean = wave(t, 50.0, 10.0, frequency_hz, 0.4)
    recordings = [clean + rng.normal(size=len(t)) for _ in range(max(draws // 4, 10))]
    known = sine_fit(t, recordings[0], frequency_hz, harmonics=1)
    bound = replace(known, covariance=known.bound).amplitude_std

    def by_curve_fit(y: Array) -> float:
        start = [y.mean(), math.sqrt(2) * y.std(), frequency_hz, 0.0]
        return abs(curve_fit(wave, t, y, p0=start)[0][1])

    def by_lmfit(y: Array) -> float:
        model = SineModel() + ConstantModel()
        start = model.make_params(
            amplitude=math.sqrt(2) * y.std(), frequency=2 * np.pi * frequency_hz, shift=0.0, c=y.mean()
        )
        return abs(model.fit(y, start, x=t).params["amplitude"].value)

    peers: list[tuple[str, Callable[[Array], float], int]] = [
        ("hil sine_fit", lambda y: sine_fit(t, y, frequency_hz, harmonics=1).amplitude, len(recordings)),
        ("scipy curve_fit, frequency known to start", by_curve_fit, len(recordings)),
        ("lmfit SineModel + ConstantModel", by_lmfit, 8),
    ]
    if frequency_hz > 1.0:
        peers.insert(
            1, ("hil sine_fit, harmonics 1 to 5", lambda y: sine_fit(t, y, frequency_hz).amplitude, len(recordings))
        )
    for name, fit, count in peers:
        errors = np.array([fit(y) - 10.0 for y in recordings[:count]])
        rms = float(np.sqrt(np.mean(errors**2)))
        yield Row(
            name, milliseconds(lambda fit=fit: fit(recordings[0])), f"{rms / bound:6.2f} × bound of known frequency"
        )


def variance_rows(draws: int) -> Iterator[Row]:
    """Variance of amplitude and phase over many draws against the Cramér–Rao bound."""
    t = np.arange(2000) / 1000.0
    rng = np.random.default_rng(2)
    clean = wave(t, 50.0, 10.0, 1.7, 0.4)
    fits = [sine_fit(t, clean + rng.normal(size=len(t)), 1.7) for _ in range(draws)]
    phasors = np.array([fit.phasor for fit in fits])
    exact = np.mean([fit.bound[1:3, 1:3].trace() / fit.residual_std**2 for fit in fits[:5]])
    ratio = (np.var(phasors.real) + np.var(phasors.imag)) / exact
    ms = milliseconds(lambda: sine_fit(t, clean, 1.7))
    yield Row(f"hil sine_fit, {draws} draws", ms, f"{ratio:.3f} ± {1 / math.sqrt(draws):.3f}; bar 1.02")


# -- transfer functions ------------------------------------------------------------------------------------


def lines(seed: int | None) -> FrequencyResponse:
    """Table 1, 10 %, with 1 % complex noise and the covariance that goes with it."""
    frequency_hz = np.array(FREQUENCIES_HZ)
    h = TRUTH.transfer_function.at(frequency_hz)
    table = from_table("lines", frequency_hz, 20 * np.log10(np.abs(h)), np.degrees(np.angle(h)))
    noise = np.zeros(len(h), dtype=complex)
    if seed is not None:
        rng = np.random.default_rng(seed)
        noise = (rng.normal(size=len(h)) + 1j * rng.normal(size=len(h))) / math.sqrt(2)
    covariance = np.eye(2) * ((0.01 * np.abs(h)) ** 2 / 2)[:, None, None]
    return replace(table, response=h * (1 + 0.01 * noise), covariance=covariance)


def by_vector_fitting(response: FrequencyResponse) -> Array:
    """scikit-rf: one real pole and one pair, residues to polynomials."""
    import skrf

    network = skrf.Network(f=response.frequency_hz, s=response.response[:, None, None], f_unit="hz")
    fit = skrf.vectorFitting.VectorFitting(network)
    fit.vector_fit(n_poles_real=1, n_poles_cmplx=1, fit_constant=False, fit_proportional=False)
    poles, residues = fit.poles, fit.residues[0]
    both = [(p, r) for p, r in zip(poles, residues, strict=True)]
    both += [(p.conjugate(), r.conjugate()) for p, r in both if abs(p.imag) > 0]
    below = np.real(np.poly([p for p, _ in both]))
    above = sum(r * np.poly([q for q, _ in both if q != p]) for p, r in both)
    return np.concatenate((np.real(above)[-2:], below[1:]))


def by_aaa(response: FrequencyResponse) -> Array:
    """scipy AAA, three poles; its residues to polynomials."""
    from scipy.interpolate import AAA

    s = 2j * np.pi * response.frequency_hz
    fit = AAA(np.concatenate((s, s.conj())), np.concatenate((response.response, response.response.conj())), max_terms=4)
    below = np.poly(fit.poles())
    above = sum(r * np.poly(np.delete(fit.poles(), i)) for i, r in enumerate(fit.residues()))
    return np.concatenate((np.real(above)[-2:], np.real(below)[1:]))


def transfer_function_rows(draws: int) -> Iterator[Row]:
    """Time per fit, and rms error of the five coefficients over their bounds."""
    bound = fit_form(lines(None), Form(3, 1)).coefficient_std
    responses = [lines(seed) for seed in range(draws)]
    peers: list[tuple[str, Callable[[FrequencyResponse], Array]]] = [
        ("hil fit_form, 3 poles 1 zero", lambda r: fit_form(r, Form(3, 1)).coefficients),
        ("scikit-rf VectorFitting, 3 poles", by_vector_fitting),
        ("scipy AAA, 3 poles", by_aaa),
    ]
    for name, fit in peers:
        errors = np.array([fit(response) - COEFFICIENTS for response in responses]) / bound
        rms = np.sqrt(np.mean(errors**2, axis=0))
        ms = milliseconds(lambda fit=fit: fit(responses[0]))
        yield Row(name, ms, f"{rms.min():.2f} … {rms.max():.2f} × bound")
    form = fit_transfer_function(responses[0]).form
    ms = milliseconds(lambda: fit_transfer_function(responses[0]), 3)
    delay = "a" if form.dead_time else "no"
    note = f"chose {form.poles} poles, {form.zeros} zero, {delay} dead time"
    yield Row("hil, form by evidence", ms, note)


def bench_recording() -> Recording:
    """A second at rest, then 20 s of a binary sequence, at 100 S/s with 1 % noise."""
    command = np.concatenate((np.zeros(100), np.repeat(2.0 * max_len_seq(8)[0] - 1.0, 8)[:2000]))
    model = TRUTH.model
    output = simulate(model.definition, model.values, Drive(command[None, :], math.nan, 0.01))[0]
    noisy = output + 0.01 * np.random.default_rng(3).normal(size=len(output))
    return recording("bench", np.arange(len(command)) / 100.0, {"u [1]": command, "y [1]": noisy})


def time_rows(repeats: int) -> Iterator[Row]:
    """Rms error of the frequency response over the paper's lines, from the same recording in time."""
    import control

    made = bench_recording()
    u, y = made.values("u"), made.values("y")
    frequency_hz = np.array(FREQUENCIES_HZ)
    exact = TRUTH.transfer_function.at(frequency_hz)
    definition = plant("transfer-function")

    def ours() -> Any:
        from hil.physics.transfer_function import from_parameters

        fit = fit_plant(typical_model("transfer-function"), [experiment(made, definition, "u", "y")])
        return from_parameters(fit.model.values).at(frequency_hz)

    def markov_and_era() -> Any:
        impulse = control.markov(y[None, :], u[None, :], 150, dt=0.01)
        system = control.eigensys_realization(impulse, 3, m=70, n=70, dt=0.01)[0]
        held = np.exp(-1j * np.pi * frequency_hz * 0.01) * np.sinc(frequency_hz * 0.01)
        return control.ss2tf(system)(np.exp(2j * np.pi * frequency_hz * 0.01)) / held

    for name, fit in (
        ("hil identify, structure by evidence", ours),
        ("python-control markov + era, order 3 given", markov_and_era),
    ):
        error = np.linalg.norm(fit() - exact) / np.linalg.norm(exact)
        yield Row(name, milliseconds(fit, repeats), f"{100 * error:.2f} % of the response")


if __name__ == "__main__":
    main()
