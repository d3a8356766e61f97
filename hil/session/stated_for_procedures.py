"""What a bench file states for procedures, held against the procedures themselves."""

from __future__ import annotations

from collections.abc import Iterator

from hil.bench.base import text_of
from hil.bench.fault import Fault, bench_error
from hil.bench.file import Bench
from hil.bench.read import BenchFile
from hil.errors import SettingError
from hil.session.limit import bench_limits, checked_limits
from hil.session.procedure import load_procedure
from hil.session.setting import parse_settings


def check_stated(found: BenchFile) -> None:
    """Raises `BenchError`: a preset with a setting, or an acceptance with a quantity, that its procedure refuses."""
    if faults := [*_presets(found.bench), *_acceptance(found.bench)]:
        raise bench_error(found.path, text_of(found.path), faults)


def _presets(bench: Bench) -> Iterator[Fault]:
    for name, presets in bench.presets.items():
        known = load_procedure(name).settings
        for preset, settings in presets.items():
            for setting, value in settings.items():
                try:
                    parse_settings(known, {setting: value})
                except SettingError as error:
                    yield Fault(("presets", name, preset, setting), str(error))


def _acceptance(bench: Bench) -> Iterator[Fault]:
    for name in bench.acceptance:
        measured = load_procedure(name).measurements
        for quantity, limit in bench_limits(bench, name).items():
            try:
                checked_limits(measured, {quantity: limit})
            except SettingError as error:
                yield Fault(("acceptance", name, quantity), str(error))
