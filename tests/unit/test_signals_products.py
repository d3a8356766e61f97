"""Products that stay on one thread."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from hil.signals.products import in_parts, one_blas_thread, rows_by_columns, rows_by_rows, triangular


def blas_threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_blas_keeps_to_one_thread_meanwhile_and_only_then():
    one_blas_thread()  # loads scipy's BLAS, which would not be limited below if it came later
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


def test_least_squares_on_the_triangle_of_parts_are_those_on_all_rows():
    rows = np.random.default_rng(4).standard_normal((10_000, 4))

    made = triangular(rows[part] for part in in_parts(len(rows)))

    assert np.allclose(made.T @ made, rows.T @ rows)
    assert np.allclose(np.linalg.lstsq(made[:, :3], made[:, 3])[0], np.linalg.lstsq(rows[:, :3], rows[:, 3])[0])
