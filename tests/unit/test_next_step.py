"""After a run: why it did not pass, what to do now, and the same test of the next unit."""

from urllib.parse import parse_qs, urlsplit

import pytest

from hil.bench.find import benches
from hil.console.after import next_unit, reasons_of
from hil.console.site import Site
from hil.findings.results import Results
from hil.language.words import speaking
from hil.record.measurement import Findings, Measured, Measurement
from hil.report.results import next_step, verdict_box
from hil.session.procedure import load_procedure
from hil.session.setting import parse_settings

RISE = Measurement("rise", "ms", "from 10 % to 90 %", None, 100.0)


@pytest.mark.parametrize(
    ("found", "text"),
    [
        (RISE.of(140.0, 5.0), "find the cause, or set the unit aside"),
        (RISE.of(98.0, 5.0), "repeat the test or measure for longer"),
        (RISE.of(98.0, 0.1, calibration=5.0), "smaller calibration uncertainty"),
        (RISE.of(None), "see the notes"),
        (RISE.of(98.0, None), "see the notes"),
        (RISE.of(80.0, 0.0, relation=">"), "there is only a bound"),
    ],
)
def test_the_next_step_follows_from_what_keeps_a_value_open(found, text):
    step = next_step([found])
    assert text in step
    assert step.startswith("Next: ") and all(len(one.split()) <= 25 for one in step.split(". "))
    assert verdict_box(Findings((found,)), {})["next"] == step


def test_a_miss_goes_before_what_is_open_and_a_pass_needs_nothing():
    assert "set the unit aside" in next_step([RISE.of(98.0, 5.0), RISE.of(140.0, 5.0)])
    assert next_step(()) == ""
    assert verdict_box(Findings((RISE.of(50.0, 1.0),)), {})["next"] == ""


def test_a_value_that_would_pass_needs_the_test_to_end():
    (cut,) = Findings((RISE.of(50.0, 1.0),)).of_unfinished().measured
    assert "run the test to its end" in next_step([cut])


def test_the_console_gives_reasons_and_the_next_step_in_the_language_of_the_page():
    values = (
        Measured(name="rise", value=140.0, std=5.0, unit="ms", high=100.0, verdict="fail"),
        Measured(name="settling", value=50.0, std=5.0, unit="ms", high=100.0, verdict="pass"),
    )
    open_ = Measured(name="response", value=98.0, std=5.0, unit="ms", high=100.0, verdict="cannot tell")
    results = Results.model_construct(verdict="fail", values=(open_, *values))
    why, also, step = reasons_of(results)
    assert why.startswith("Fail: rise is 140 ± 10 ms, limit ≤ 100 ms")
    assert also.startswith("Cannot tell: response")
    assert step == next_step([RISE.of(140.0, 5.0)])
    with speaking("de"):
        assert reasons_of(results)[2].startswith("Weiter: ")
    assert reasons_of(Results.model_construct(verdict="pass", values=values[1:])) == []


def test_the_next_unit_has_the_same_test_and_no_serial(tmp_path):
    site = Site(tmp_path, tmp_path, tmp_path, tmp_path)
    procedure = load_procedure("flow_curve")
    settings = parse_settings(procedure.settings, {"cycle_s": "20", "half_speed": "no"})
    driven = str(benches()["brevini-hpv41"].resolve())
    limits = {"hysteresis": {"low": None, "high": 2.5}}
    meta = {"procedure": "flow_curve", "operator": "MK", "bench_path": driven, "settings": settings, "limits": limits,
            "notes": {"order": "4711", "shift": "late"}}  # fmt: skip
    address = urlsplit(next_unit(site, meta))
    asked = {key: value for key, (value,) in parse_qs(address.query).items()}
    assert address.path == "/run"
    assert (asked["procedure"], asked["bench"], asked["operator"]) == ("flow_curve", "brevini-hpv41", "MK")
    assert "serial" not in asked
    assert (asked["note.order"], asked["limits"]) == ("4711", "hysteresis=..2.5")
    typed = {key.removeprefix("set."): value for key, value in asked.items() if key.startswith("set.")}
    assert parse_settings(procedure.settings, typed) == settings
    assert next_unit(site, {**meta, "bench_path": "/gone.toml"}) == ""
    assert next_unit(site, {}) == ""
