"""Products that stay on one thread."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from hil.signals.products import one_blas_thread, rows_by_columns, rows_by_rows


def blas_threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_blas_keeps_to_one_thread_meanwhile_and_only_then():
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        with one_blas_thread():
            assert blas_threads() == {1}
        assert blas_threads() == before


def test_products_are_those_of_numpy():
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((3, 500)), rng.standard_normal((4, 500))
    assert np.allclose(rows_by_rows(a, b), a @ b.T)
    c = rng.standard_normal((3, 2))
    assert np.allclose(rows_by_columns(c, b[:2]), c @ b[:2])
