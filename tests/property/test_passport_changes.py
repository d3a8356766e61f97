"""One byte of a passport changed, at any place, to any other value: always found.

`python -m tests.property.test_passport_changes 10000` does it so often.
"""

from __future__ import annotations

import os
import random
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from hil.passport.issue import Wanted, issue
from hil.passport.key import own_certificates, signing_key
from hil.passport.seal import seal_of
from hil.passport.verify import Trust, verify
from tests.passports import installed, run_of


def not_found(folder: Path, count: int, seed: int) -> list[tuple[int, int]]:
    """(place, new value) of every change that was not found; half of them in the field of the signature."""
    out, dice = folder / "unit.pdf", random.Random(seed)
    issue([run_of(folder)], out, signing_key(None), Wanted(identify=False))
    content, trusted = out.read_bytes(), Trust(own_certificates())
    assert verify(content, trusted).exit_status == 0
    begin, end = seal_of(content).field
    missed = []
    for i in range(count):
        place = dice.randrange(begin, end) if i % 2 else dice.randrange(len(content))
        value = (content[place] + dice.randrange(1, 256)) % 256
        if verify(content[:place] + bytes([value]) + content[place + 1 :], trusted).exit_status == 0:
            missed.append((place, value))
    return missed


@pytest.mark.usefixtures("stranger")
def test_one_byte_that_was_changed_is_always_found(tmp_path, own_state):
    assert not_found(tmp_path, 300, 1) == []


if __name__ == "__main__":
    installed()
    with TemporaryDirectory() as place:
        os.environ["HIL_STATE_DIR"] = f"{place}/state"
        asked = int(sys.argv[1])
        print(f"{asked} changes, not found: {not_found(Path(place), asked, 2)}")
