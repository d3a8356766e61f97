"""A model is drawn beside what it was fitted to or is compared with: samples, and tables of a frequency response."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil import api
from hil.errors import HilError
from hil.physics.transfer_function import TransferFunction
from hil.record.recording import recording
from hil.record.table.response_table import ResponseTable
from tests.page import read_page

TRUE = TransferFunction((60.0,), (1.0, 20.0), 0.01)


def table(path: Path) -> Path:
    f = np.geomspace(0.1, 10.0, 25)
    std = np.full(len(f), 0.002)
    noisy = TRUE.at(f) * np.exp(0.002 * np.random.default_rng(1).standard_normal(len(f)))
    api.write(ResponseTable("t", f, noisy, "l/min/%", gain_std=std, phase_std_rad=std), path)
    return path


def test_a_table_is_drawn_with_the_transfer_function_that_was_fitted_to_it(tmp_path, prints):
    source = table(tmp_path / "bode.csv")
    model, page = tmp_path / "m.json", tmp_path / "p.html"
    prints("identify", source, "--plant", "transfer-function", "--out", model, "--page", page)
    seen = read_page(page)
    assert seen.drawings == 1 and "bode.csv" in seen.text
    text = page.read_text(encoding="utf-8")
    assert "0 dB is a gain of 1 l/min/%" in text and "phase [°]" in text and "amplitude ratio [dB]" in text
    assert " / (s + " in text


def test_comparing_draws_table_and_samples(tmp_path, prints):
    source = table(tmp_path / "bode.csv")
    api.save_model(TRUE.to_model("command [%]", "flow [l/min]"), tmp_path / "m.json")
    time_s = 0.01 * np.arange(500)
    command = np.where(time_s > 1.0, 10.0, 0.0)
    made = recording("s", time_s, {"command [%]": command, "flow [l/min]": 3.0 * command + 0.1 * np.sin(time_s)})
    api.write(made, tmp_path / "steps.csv")
    page = tmp_path / "p.html"
    said = prints("compare", "--model", tmp_path / "m.json", source, tmp_path / "steps.csv", "--page", page)
    text = page.read_text(encoding="utf-8")
    assert text.count('<svg role="img"') == 2 and "measured − model" in text
    fit = next(line.split(" %")[0] for line in said.splitlines() if "fit" in line).strip()
    assert fit in text  # what the terminal says of the table stands on the page


def test_a_page_replaces_none_of_what_it_is_made_of(tmp_path, refused):
    source = table(tmp_path / "bode.csv")
    api.save_model(TRUE.to_model("command [%]", "flow [l/min]"), tmp_path / "m.json")
    before = source.read_bytes()
    refused("compare", "--model", tmp_path / "m.json", source, "--page", source)
    assert source.read_bytes() == before
    with pytest.raises(HilError):
        api.compare(tmp_path / "m.json", [source], page=tmp_path / "nowhere" / "p.html")
