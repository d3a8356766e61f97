"""Matrix products that stay on one thread.

A threaded BLAS turns a product of a tenth of a millisecond into a hundred when other work keeps the cores
busy (measured: 0.8 ms against 140 ms for one sine fit), and a bench is busy while it records. `einsum` sums by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from functools import cache, reduce
from typing import Any, cast

import numpy as np
from threadpoolctl import ThreadpoolController

from hil.arrays import Array

_PART = 4096


def rows_by_rows(a: Array, b: Array) -> Array:
    """a·bᵀ; shape (r, c) from (r, n) and (c, n). For few, long rows."""
    return cast(Array, np.einsum("ij,kj->ik", a, b))


def rows_by_columns(a: Array, b: Array) -> Array:
    """a·b; shape (r, n) from (r, c) and (c, n). For a small inner size."""
    return cast(Array, np.einsum("ik,kj->ij", a, b))


def in_parts(count: int) -> Iterator[slice]:
    """So many rows in parts that a processor keeps at hand."""
    return (slice(first, min(first + _PART, count)) for first in range(0, count, _PART))


def triangular(parts: Iterable[Array]) -> Array:
    """R of the QR of many rows that come in parts, shape (n, k) each; shape (k, k) of k rows or more.

    It is that of each part beneath the R before it. Least squares on it are those on all rows, without a copy of them.
    """
    return reduce(lambda r, rows: cast(Array, np.linalg.qr(np.vstack([r, rows]), "r")), parts)


def one_blas_thread() -> AbstractContextManager[Any]:
    """Keep BLAS to one thread meanwhile: fits multiply small matrices, in threads of their own."""
    return cast(AbstractContextManager[Any], _libraries().limit(limits=1, user_api="blas"))


@cache
def _libraries() -> ThreadpoolController:
    """The BLAS of numpy and that of scipy: looked for once, which takes longer than many a fit."""
    import scipy.linalg  # noqa: F401 # what is not loaded cannot be found

    return ThreadpoolController()
