"""A transfer function is stated only where the lines bear it out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from hil.identification.frequency.frequency_response import from_table
from hil.identification.frequency.linear_evidence import doubts, unresolved
from hil.identification.frequency.order_choice import fit_transfer_function
from hil.identification.frequency.rational import Form
from hil.identification.frequency.transfer_function import fit_form
from hil.physics.transfer_function import TransferFunction, transfer_function
from hil.record.measurement import Findings, Limit, Measured
from hil.record.recording import recording
from procedures import frequency_response

LINES_HZ = np.arange(25) * 0.2 + 0.1
TWO_POLES = transfer_function([60.0], np.polymul([0.1, 1.0], [0.05, 1.0]))


def noisy(model: TransferFunction, noise: float = 0.01, frequency_hz=LINES_HZ, seed: int = 1):
    """Lines of a model with complex noise, a share of the largest gain, and its covariance."""
    h = model.at(frequency_hz)
    std = noise * float(np.abs(h).max()) / math.sqrt(2.0)
    rng = np.random.default_rng(seed)
    table = from_table("lines", frequency_hz, 20 * np.log10(np.abs(h)), np.degrees(np.unwrap(np.angle(h))))
    covariance = np.broadcast_to(std**2 * np.eye(2), (len(h), 2, 2)).copy()
    return replace(
        table, response=h + std * (rng.normal(size=len(h)) + 1j * rng.normal(size=len(h))), covariance=covariance
    )


def test_a_response_that_is_linear_has_no_doubt():
    fit = fit_transfer_function(noisy(TWO_POLES))
    assert doubts(fit) == ()
    assert np.sort(fit.model.poles.real) == pytest.approx([-20.0, -10.0], rel=0.1)


FAR_PAIR = transfer_function([3.0], np.polymul([0.2, 1.0], [1.0 / 600.0**2, 2.4 / 600.0, 1.0]).tolist())


@pytest.mark.parametrize(
    ("model", "form", "says"),
    [
        (transfer_function([3.0], [0.2, 1.0]), Form(2, 0), "a pole lies beyond 10 times the highest line, 4.9 Hz"),
        (FAR_PAIR, Form(3, 0), "a pole lies beyond 10 times the highest line, 4.9 Hz"),
        (transfer_function([3.0], [30.0, 1.0]), Form(1, 0), "a pole lies below a tenth of the lowest line, 0.1 Hz"),
        (transfer_function([3.0], [8.0, 1.0]), Form(1, 0), "no line comes near its gain at rest; the nearest"),
        (transfer_function([3.0], [0.2, 1.0]), Form(1, 0, dead_time=True), "the interval of dead time is wider"),
    ],
)
def test_what_no_line_says_anything_of_is_named(model, form, says):
    found = unresolved(fit_form(noisy(model, 0.001), form))
    assert sum(text.startswith(says) for text in found) == 1, found


@pytest.mark.parametrize(
    ("noise", "says"), [(0.6, ("its fit is ", "where 80 % are asked for")), (10.0, ("it fits no better than a const",))]
)
def test_a_poor_fit_is_none(noise, says):
    fit = replace(fit_form(noisy(TWO_POLES, 0.001), Form(2, 0)), fit_percent={0.6: 63.0, 10.0: -60.0}[noise])
    (text,) = doubts(fit)
    assert all(part in text for part in says) and "-60" not in text
    assert (doubts(fit, 50.0) == ()) is (noise < 1.0)


def test_evidence_prefers_a_form_that_the_lines_bear_out():
    fast = noisy(transfer_function([3.0], np.polymul([0.2, 1.0], [1e-4, 1.0])), 0.002)
    assert unresolved(fit_transfer_function(fast)) == ()


def sines(noise: float, limits: dict | None = None, poles: int | None = None) -> Findings:
    """Findings of stepped sines through the two poles, with so much noise on the flow."""
    rate_hz, tones = 500.0, (0.3, 0.8, 1.5, 2.5, 4.0, 6.0, 9.0)
    rng, parts, command, flow = np.random.default_rng(4), [], [], []
    for frequency_hz in tones:
        turn = 2.0 * math.pi * frequency_hz * np.arange(round(6.0 * rate_hz / frequency_hz)) / rate_hz
        h = TWO_POLES.at(np.array([frequency_hz]))[0]
        parts.append({"kind": "sine", "frequency_hz": frequency_hz, "amplitude": 10.0, "bias": 0.0, "steady": True,
                      "first": sum(map(len, command)), "count": len(turn)})  # fmt: skip
        command.append(10.0 * np.sin(turn))
        flow.append(10.0 * abs(h) * np.sin(turn + np.angle(h)) + noise * rng.normal(size=len(turn)))
    settings = {"poles": poles, "zeros": None, "dead_time": None, "correct_chain": False}
    channels = {"command [%]": np.concatenate(command), "flow [l/min]": np.concatenate(flow)}
    roles = {"command": "command", "response": "flow"}
    meta = {"parts": parts, "settings": settings, "limits": limits or {}, "roles": roles}
    time_s = np.arange(len(channels["command [%]"])) / rate_hz
    return frequency_response.evaluate(recording("sines", time_s, channels, meta))


def found(findings: Findings, name: str) -> Measured:
    (one,) = (m for m in findings.measured if m.quantity == name)
    return one


def test_a_model_that_is_borne_out_stands_on_the_page():
    findings = sines(1.0)
    assert (found(findings, "model_fit").value or 0.0) > 98.0
    assert findings.curves["responses"][0]["model"] is not None


def test_fewer_poles_stand_where_the_lines_bear_out_only_those():
    findings = sines(1.0, poles=4)
    (model,) = (curve["model"] for curve in findings.curves["responses"])
    assert model is not None and (found(findings, "model_fit").value or 0.0) > 98.0
    assert any("4 poles are not borne out" in note for note in findings.notes)


def test_a_poor_fit_gives_a_sentence_and_a_bound_and_no_table():
    findings = sines(15000.0, {"model_fit": {"low": 70.0, "high": None}})
    fit, distortion = found(findings, "model_fit"), found(findings, "thd")
    assert (fit.relation, fit.value) == ("<", 70.0)
    assert findings.judged({"model_fit": Limit(70.0)}).verdict == "fail"
    assert findings.curves["responses"][0]["model"] is None
    assert any("no linear model" in note and "where 70 % are asked for" in note for note in findings.notes)
    assert distortion.value is None or distortion.relation == "<"


def test_noise_alone_is_no_linear_model():
    rng = np.random.default_rng(0)
    lines = noisy(TWO_POLES, 0.5)
    noise = rng.normal(size=(2, len(lines)))
    assert doubts(fit_transfer_function(replace(lines, response=noise[0] + 1j * noise[1])))
