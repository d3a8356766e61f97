"""Compile to machine code, stored under a hash of all sources of the truth.

numba's own store is keyed on the one file a function stands in; after an edit of a helper elsewhere it would
hand out the old result, and a truth that lies about its own law is worth nothing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
import platformdirs


@cache
def _store() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    return str(platformdirs.user_cache_path("valve-hil") / "truth" / digest.hexdigest()[:16])


@contextmanager
def _storing() -> Iterator[None]:
    # the place is read when a function is decorated; other users of numba in this process keep theirs
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = _store()
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


@cache
def compiled(function: Callable[..., Any], signature: Any) -> Callable[..., Any]:
    """Return `function` compiled for `signature`; the second call and the second process find it ready.

    A division by zero gives an infinity, as in numpy: to look for one before each division took a third of the time.
    """
    with _storing():
        return numba.njit(signature, cache=True, error_model="numpy")(function)  # type: ignore[no-any-return]
