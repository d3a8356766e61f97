"""Matrix products that stay on one thread.

A threaded BLAS turns a product of a tenth of a millisecond into a hundred when other work keeps the cores
busy (measured: 0.8 ms against 140 ms for one sine fit), and a bench is busy while it records. `einsum` sums by itself.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import Any, cast

import numpy as np
from threadpoolctl import ThreadpoolController

from hil.arrays import Array


def rows_by_rows(a: Array, b: Array) -> Array:
    """a·bᵀ; shape (r, c) from (r, n) and (c, n). For few, long rows."""
    return cast(Array, np.einsum("ij,kj->ik", a, b))


def rows_by_columns(a: Array, b: Array) -> Array:
    """a·b; shape (r, n) from (r, c) and (c, n). For a small inner size."""
    return cast(Array, np.einsum("ik,kj->ij", a, b))


def one_blas_thread() -> AbstractContextManager[Any]:
    """Keep BLAS to one thread meanwhile: fits multiply small matrices, in threads of their own."""
    return cast(AbstractContextManager[Any], _libraries().limit(limits=1, user_api="blas"))


@cache
def _libraries() -> ThreadpoolController:
    """The BLAS of numpy and that of scipy: looked for once, which takes longer than many a fit."""
    import scipy.linalg  # noqa: F401 # what is not loaded cannot be found

    return ThreadpoolController()
