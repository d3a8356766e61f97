"""Progress as plain lines: at once, or once the work has lasted a while."""

from __future__ import annotations

import time

import hil
from hil.cli.progress import shown


def test_short_work_prints_no_line_and_longer_work_what_it_does(capsys):
    with shown(5.0) as progress:
        progress(0.5, "reading")
    assert capsys.readouterr().err == ""
    with shown(0.5) as progress:  # long enough that the first text is in time on any machine
        progress(0.0, "reading a.csv")
        time.sleep(0.8)
        progress(0.5, "a.csv: the model beside 3 samples")
    assert capsys.readouterr().err == "  0%  reading a.csv\n 50%  a.csv: the model beside 3 samples\n"


def test_a_comparison_says_what_it_reads_and_simulates(tmp_path):
    path = tmp_path / "a.csv"
    rows = "".join(f"{i / 100},{i % 40},{(i % 40) / 2}\n" for i in range(200))
    path.write_text(f"time [s],u [V],y [V]\n{rows}", encoding="utf-8")
    model = hil.typical_model("transfer-function")
    told: list[tuple[float, str]] = []
    hil.compare(model, [path], inputs=["u"], output="y", progress=lambda done, text: told.append((done, text)))
    assert [done for done, _ in told] == sorted(done for done, _ in told)
    assert told[0][1] == f"reading {path}" and "200 samples" in told[1][1]
