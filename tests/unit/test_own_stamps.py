"""Recordings over a link: every sample was read at a time of its own, and what is identified does not depend on it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hil.identification.frequency.bandwidth import phase_crossing
from hil.identification.frequency.best_linear_approximation import best_linear_approximation
from hil.identification.frequency.frequency_response import from_table
from hil.identification.frequency.measuring_chain import MeasuringChain, corrected
from hil.identification.frequency.rational import Form
from hil.identification.frequency.sine_segments import frequency_responses
from hil.identification.frequency.transfer_function import fit_form
from hil.identification.papers.first_order import first_order
from hil.identification.preparation.experiment import experiment
from hil.identification.step.step_estimate import measured_steps
from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate
from hil.physics.transfer_function import transfer_function
from hil.record.recording import Array, Recording, recording
from hil.signals.multisine import odd_multisine
from hil.signals.stepped_sine import sine
from procedures._recorded import chain_of, reading_of
from procedures._steady_sine import Patience, Tone, listen

MODEL = transfer_function([40.0], [1.0, 12.0, 50.0], 0.02)
RATE_HZ, FINE = 100.0, 20
SAMPLING = {"timing": "polled", "read_at": 0.0, "delay_channels": {"flow": "delay of meter"}}


def values() -> dict[str, float]:
    return plant("transfer-function").typical | MODEL.to_parameters()


def linked(command: Array, *, late_s: Array | float = 0.0, seed: int = 3, **meta: object) -> Recording:
    """A command held from stamp to stamp, and its response read 1 ms later, in two samples of five 9 ms later."""
    planned_s = np.arange(len(command)) / RATE_HZ
    time_s = planned_s + late_s
    delay_s = np.where(np.random.default_rng(seed).random(len(command)) < 0.4, 0.009, 0.001)
    fine_s = np.arange(FINE * (len(command) + 10)) / (FINE * RATE_HZ)
    held = command[np.clip(np.searchsorted(time_s, fine_s + 1e-9, side="right") - 1, 0, len(command) - 1)]
    flow = simulate(plant("transfer-function"), values(), Drive(held[None, :], math.nan, fine_s[1]))[0]
    read = np.interp(time_s + delay_s, fine_s, flow)
    columns = {"command [%]": command, "flow [l/min]": read, "delay of meter [s]": delay_s}
    roles = {"command": "command", "response": "flow"}
    return recording("linked", time_s, columns, {"sampling": SAMPLING, "roles": roles, **meta})


def median_only(run: Recording) -> Recording:
    """The same with one delay for all samples."""
    delay_s = float(np.median(run.values("delay of meter")))
    sampling = {"timing": "polled", "read_at": 0.0, "delay_s": {"flow": delay_s}, "delays_s": {"flow": delay_s}}
    return replace(run, meta={**run.meta, "sampling": sampling})


def test_stamps_of_a_channel_are_those_of_its_link():
    run = linked(np.linspace(0.0, 1.0, 40))
    assert np.array_equal(run.stamps("flow"), run.time_s + run.values("delay of meter"))
    assert run.stamps("command") is run.time_s
    assert median_only(run).stamps("flow") is run.time_s
    assert np.array_equal(run.rows(10, 5).stamps("flow"), run.stamps("flow")[10:15])


def test_frequency_response_uses_the_stamps_of_each_sample():
    frequencies = (0.5, 1.3, 2.0, 3.0)
    run = linked(np.concatenate([sine(f, 10.0, RATE_HZ, max(6, math.ceil(6 * f)), bias=50.0) for f in frequencies]))
    errors = []
    for told in (run, median_only(run)):
        (response,) = frequency_responses(told, "command", "flow")
        valve = corrected(response, chain_of(told))
        errors.append(np.abs(valve.response / MODEL.at(valve.frequency_hz) - 1.0))
    assert errors[0].max() < 0.004
    assert errors[1][-1] > 0.04


def test_command_that_comes_late_is_held_half_an_interval_on_the_whole():
    stalls = np.zeros(2000)
    for k in range(50, 1900, 190):  # 60 ms late, then on time again by samples at twice the rate
        stalls[k : k + 12] = np.linspace(0.06, 0.005, 12)
    run = linked(np.concatenate([sine(f, 10.0, RATE_HZ, 20, bias=50.0) for f in (2.0, 2.0)]), late_s=stalls)
    (response,) = frequency_responses(
        replace(run, meta={**run.meta, "parts": [{"kind": "sine", "first": 100, "count": 1900, "frequency_hz": 2.0,
                                                  "amplitude": 10.0, "bias": 50.0}]}),
        "command", "flow",
    )  # fmt: skip
    chain = chain_of(run)
    assert chain.hold_s == pytest.approx(1.0 / RATE_HZ, rel=0.02)
    valve = corrected(response, chain)
    assert abs(valve.response[0] / MODEL.at(valve.frequency_hz)[0] - 1.0) < 0.01


def test_step_counts_from_the_command_to_the_reading():
    run = linked(np.repeat([0.0, 50.0], [50, 150]))
    plain, shifted = (measured_steps(told, "command", "flow")[0].figures for told in (run, median_only(run)))
    fine = np.repeat([0.0, 50.0], [1, 20000])
    step = simulate(plant("transfer-function"), values(), Drive(fine[None, :], math.nan, 1e-4))[0]
    exact = 1e-4 * (int(np.argmax(step >= 0.9 * step[-1])) - 1)
    assert plain.response_s == pytest.approx(exact, abs=0.004)
    assert plain.response_s - shifted.response_s > 0.001


def test_multisine_takes_out_the_mean_delay():
    wave = odd_multisine(0.5, 4.0, 0.5, RATE_HZ, 10.0, seed=1)
    command = np.tile(wave.period, 5) + 50.0
    part = {**wave.as_part(), "first": 0, "count": len(command), "bias": 50.0}
    run = linked(command, parts=[part])
    (found,) = best_linear_approximation(run, "command", "flow", settle_periods=2)
    valve = corrected(found.response, chain_of(run))
    delay_deg = np.degrees(np.angle(valve.response / MODEL.at(valve.frequency_hz)))
    assert np.abs(delay_deg).max() < 3.0
    assert "on average" in found.response.corrections[0]


def test_first_order_model_knows_when_the_response_was_read():
    run = linked(np.repeat([0.0, 1.0], [1, 199]))
    flow = 2.0 * -np.expm1(-np.maximum(run.stamps("flow") - 1.0 / RATE_HZ, 0.0) / 0.3)
    made = replace(run, channels={**run.channels, "flow": replace(run.channels["flow"], values=flow)})
    exact, rough = (
        100.0 - first_order(one, "command", "flow", integrates=False).fit_percent for one in (made, median_only(made))
    )
    assert exact < 0.2 * rough


def test_simulated_samples_are_read_when_the_recorded_ones_were():
    run = linked(np.repeat([0.0, 50.0, 20.0, 70.0], 60))
    bound = experiment(run, plant("transfer-function"), "command", "flow")
    answer = bound.respond(plant("transfer-function"), values())[0]
    assert np.abs(answer - bound.output).max() < 0.002 * np.ptp(bound.output)
    assert bound.reading_known and bound.reading_at(0.5) is bound
    rough = experiment(median_only(run), plant("transfer-function"), "command", "flow")
    off = rough.respond(plant("transfer-function"), values())[0] - rough.output
    assert np.abs(off).max() > 0.01 * np.ptp(rough.output)


def test_chain_says_how_the_response_was_read_and_how_sure():
    run = linked(np.linspace(0.0, 1.0, 400))
    chain = chain_of(run)
    mean_s = float(np.mean(run.values("delay of meter")))
    assert (chain.skew_s, chain.read_at_s) == (0.0, 0.0)
    assert chain.read_std_s == pytest.approx(mean_s / math.sqrt(6.0))
    assert f"{1e3 * mean_s:.3g} ms (standard deviation" in reading_of(run, chain)
    assert "read 1 ms after" in reading_of(median_only(run), chain_of(median_only(run)))


def test_uncertain_delay_is_the_dead_times_and_no_other_parameters():
    frequency_hz = np.linspace(0.2, 5.0, 25)
    exact = MODEL.at(frequency_hz)
    table = from_table("lines", frequency_hz, 20.0 * np.log10(np.abs(exact)), np.degrees(np.angle(exact)))
    sure = replace(table, covariance=np.eye(2) * (1e-3 * np.abs(exact[:, None, None])) ** 2)
    unsure = corrected(sure, MeasuringChain(read_std_s=0.002))
    before, after = (fit_form(one, Form(2, 0, dead_time=True)) for one in (sure, unsure))
    assert after.coefficient_std[:-1] == pytest.approx(before.coefficient_std[:-1], rel=1e-3)
    assert after.coefficient_std[-1] == pytest.approx(math.hypot(before.coefficient_std[-1], 0.002), rel=1e-3)
    plain, moved = (phase_crossing(one, -90.0) for one in (sure, unsure))
    later = replace(sure, response=sure.response * np.exp(-2j * np.pi * frequency_hz * 0.002))
    shift_hz = abs(phase_crossing(later, -90.0).frequency_hz - plain.frequency_hz)
    assert moved.std_hz == pytest.approx(math.hypot(plain.std_hz, shift_hz), rel=0.05)


class Echo:
    """A rig whose response is its command, on a host that stalls for 0.4 s every 1.3 s and then catches up."""

    response = SimpleNamespace(name="flow")

    def __init__(self) -> None:
        self.marked: list[int] = []

    def stream(self, pieces: Iterable[Array], rate_hz: float) -> Iterator[Recording]:
        begun = 0
        for piece in pieces:
            k = begun + np.arange(len(piece))
            late_s = np.maximum(0.4 - 0.5 / rate_hz * (k % 130), 0.0)
            yield recording("piece", k / rate_hz + late_s, {"flow [l/min]": piece})
            begun += len(piece)

    def mark(self, samples: int, _part: Mapping[str, Any]) -> None:
        self.marked.append(samples)


def test_sine_that_a_stalling_host_squeezes_is_listened_to_all_the_same():
    rig: Any = Echo()
    course: Any = SimpleNamespace(rate_hz=RATE_HZ, heard=lambda _piece, _text: None, say=lambda _text: None)
    patience = Patience(settling_s=0.4, periods=2, seconds=2.0, tolerance=0.005, longest_wait_s=2.0)
    heard = listen(rig, course, Tone(1.0, 10.0, 50.0), patience, 0.0, "")
    assert rig.marked == [200]
    assert abs(heard.response) == pytest.approx(1.0, abs=0.3)


def test_an_inner_channel_of_two_values_that_was_read_late_is_no_error():
    t = np.arange(400) / RATE_HZ
    command = np.where(t % 2.0 < 1.0, 40.0, 0.0)
    spool = np.where(command > 0.0, 30.0, 0.0)  # as a coarse switch gives it: no noise anywhere
    columns = {"command [%]": command, "flow [l/min]": 0.4 * command, "spool position [%]": spool}
    sampling = {"timing": "clocked", "read_at": 0.0, "delay_s": {"flow": 0.0, "spool position": 2.8e-5}}
    bound = experiment(recording("coarse", t, columns, {"sampling": sampling}), plant("brevini-hpv41"))
    assert list(bound.observed) == ["spool position"]
