"""Benches that tests drive, whose rig tells nobody how far it is."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from hil.bench.find import benches
from hil.bench.open import open_rig
from hil.bench.read import BenchFile, read_bench
from hil.bench.rig import BenchRig
from hil.daq.contract import Block, Daq, Waveform, joined
from hil.record.folder import read
from hil.record.recording import Recording
from hil.safety.guard import Guard
from hil.session.procedure import Procedure
from hil.session.setting import parse_settings


def silent_rig(
    bench: BenchFile | Path | str, run: Path, about: Mapping[str, Any] | None = None, **more: Any
) -> AbstractContextManager[BenchRig]:
    """The rig of a bench, of its file or of an installed one by its name."""
    if isinstance(bench, str):
        bench = benches()[bench]
    return open_rig(read_bench(bench) if isinstance(bench, Path) else bench, run, about or {}, lambda *_: None, **more)


def played(daq: Daq | Guard, waveform: Waveform, block_samples: int | None = None) -> Block:
    """What was read while this was driven."""
    return joined(list(daq.play(waveform, block_samples)))


def driven(procedure: Procedure, bench: BenchFile | Path | str, run: Path, given: Mapping[str, Any]) -> Recording:
    """What a procedure with these settings records."""
    values = parse_settings(procedure.settings, given)
    with silent_rig(bench, run, {"procedure": procedure.name, "settings": values}) as rig:
        procedure.run(rig, **values)
    return read(run)
