"""A corrected model replaces the nominal one only where it is better on what no fit has seen."""

from __future__ import annotations

import numpy as np

from hil.diagnosis.never_worse import by_sign_changes


def test_gains_in_every_block_are_no_chance() -> None:
    assert by_sign_changes(np.ones(6)) == 1.0 / 64.0
    assert by_sign_changes(np.ones(5)) == 1.0 / 32.0


def test_as_many_losses_as_gains_are() -> None:
    assert by_sign_changes(np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])) > 0.5
    assert by_sign_changes(np.array([9.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0])) > 0.4


def test_many_blocks_are_drawn() -> None:
    rng = np.random.default_rng(1)
    assert by_sign_changes(rng.normal(1.0, 1.0, 40)) < 0.01
    assert by_sign_changes(rng.normal(-1.0, 1.0, 40)) > 0.9
