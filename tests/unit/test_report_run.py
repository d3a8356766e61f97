"""The report of a run: whole, self-contained, escaped, the same bytes for the same run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil.errors import StorageError
from hil.record.measurement import Findings, Measurement
from hil.record.recording import Recording, recording
from hil.report.run_page import write_run_report
from tests.page import read_page


def a_recording(meta: dict | None = None) -> Recording:
    time_s = np.arange(5000) * 1e-3
    command = 50.0 * np.sin(2 * np.pi * time_s)
    return recording("runs/one", time_s, {"command [%]": command, "flow [l/min]": 0.7 * command}, meta)


def test_empty_findings_still_make_a_page(tmp_path: Path) -> None:
    write_run_report(a_recording(), Findings(), tmp_path / "report.html")
    page = read_page(tmp_path / "report.html")
    assert "No limits were given" in page.text
    assert page.drawings == 1


def test_values_stand_with_as_many_digits_as_are_known(tmp_path: Path) -> None:
    bandwidth = Measurement("bandwidth_3db", "Hz", "frequency of −3 dB", low=1.0)
    found = Findings((bandwidth.at("+50 ± 5 %").of(1.26912, 0.00612), bandwidth.at("−50 ± 5 %").of(0.9, 0.08)))
    write_run_report(a_recording(), found, tmp_path / "report.html")
    text = read_page(tmp_path / "report.html").text
    assert "+50 ± 5 % 1.269 ± 0.012 Hz ≥ 1 pass" in text
    assert "−50 ± 5 % 0.90 ± 0.16 Hz ≥ 1 cannot tell" in text


def test_hostile_names_stay_text(tmp_path: Path) -> None:
    hostile = "<script>alert(1)</script>&\"'"
    meta = {"valve": {"name": hostile}, "bench": hostile, "procedure": hostile, "settings": {hostile: hostile},
            "events": [{"event": hostile, "time_s": None, "row": 0, "details": {hostile: hostile}}]}  # fmt: skip
    found = Findings((Measurement(hostile, "1", hostile).of(1.0),), {hostile: {hostile: np.arange(9.0)}}, (hostile,))
    write_run_report(a_recording(meta), found, tmp_path / "report.html")
    page = read_page(tmp_path / "report.html")
    assert "script" not in page.tags
    assert hostile in page.text


def test_the_same_run_makes_the_same_bytes(tmp_path: Path) -> None:
    found = Findings(curves={"anything": {"x": np.arange(9.0), "y": np.arange(9.0) ** 2}})
    for name in ("a", "b"):
        write_run_report(a_recording(), found, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_page_that_cannot_be_written_is_a_named_error(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="report cannot be written"):
        write_run_report(a_recording(), Findings(), tmp_path / "nowhere" / "report.html")
