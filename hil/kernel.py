"""Compiled functions that can be made ready before they are needed: compiling one takes a second, loading it a part."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])

_kernels: list[tuple[Any, tuple[str, ...]]] = []


def kernel(*signatures: str, **options: Any) -> Callable[[F], F]:
    """Mark a function as compiled by numba (cached, without the interpreter's lock).

    Args:
        signatures: of the arguments that it will be called with, as numba writes them: `f8[:,::1](f8[:,::1])`.
        options: of `numba.njit` besides.
    """

    def marked(function: F) -> F:
        compiled = njit(cache=True, nogil=True, **options)(function)
        _kernels.append((compiled, signatures))
        return cast(F, compiled)

    return marked


def compile_kernels() -> None:
    """Compile every kernel of the modules imported so far, or load it from the cache."""
    for compiled, signatures in _kernels:
        for signature in signatures:
            compiled.compile(signature)
