"""Recordings that are shorter than a block of a tenth of a second."""

from __future__ import annotations

from dataclasses import replace

from hil.diagnosis.events.bursts import block_power, block_size
from hil.identification.preparation.experiment import Experiment
from tests.concealed import bound, nominal, records


def quick(times: float) -> Experiment:
    """A recording in so many times less time."""
    (e, *_) = bound(nominal(), records(seed=3))
    return replace(e, time_s=e.time_s / times, drive=replace(e.drive, interval_s=e.drive.interval_s / times))


def test_a_short_recording_has_several_blocks():
    e = quick(1e4)
    assert e.duration_s < 0.1
    assert len(block_power(e, e.output)) >= 20


def test_a_block_of_a_long_one_is_a_tenth_of_a_second():
    e = quick(1.0)
    assert block_size(e) == round(0.1 / e.drive.interval_s)
