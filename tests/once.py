"""What takes seconds to make and is the same for every test is made by one worker and handed to the others."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from filelock import FileLock

SHARED = "HIL_TESTS_SHARED"
"""The folder that the workers of a run have in common; a program that is no test has none."""
_T = TypeVar("_T")


def once(name: str, make: Callable[[], _T]) -> _T:
    """What `make` gives, made once in a run of the tests by the worker that asks first."""
    if SHARED not in os.environ:
        return make()
    path = Path(os.environ[SHARED], f"{name}.pickle")
    with FileLock(f"{path}.lock"):
        if not path.exists():
            path.write_bytes(pickle.dumps(make()))
    made: _T = pickle.loads(path.read_bytes())
    return made
