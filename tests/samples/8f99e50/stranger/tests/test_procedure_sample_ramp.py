"""The procedure sample_ramp on a simulated bench: what it measures is what the plant does."""

from __future__ import annotations

from pathlib import Path

from hil.bench.find import find_bench
from hil.bench.open import open_rig
from hil.bench.read import read_bench
from hil.record.folder import read
from hil.session.procedure import load_procedure


def test_levels_of_the_simulated_valve(tmp_path: Path) -> None:
    procedure = load_procedure("sample_ramp")
    bench = read_bench(find_bench("brevini-hpv41"))
    about = {"procedure": "sample_ramp", "settings": {"levels": (40.0, 60.0), "hold_s": 0.2}}
    with open_rig(bench, tmp_path / "run", about, lambda _done, _text: None) as rig:
        procedure.run(rig, **about["settings"])
    low, high = procedure.evaluate(read(tmp_path / "run")).measured
    assert 0.0 < low.value < high.value < 100.0  # l/min; say what the valve of your bench does
