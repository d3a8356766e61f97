"""Compiled functions that can be made ready before they are needed: compiling one takes a second, loading it a part.

numba itself, a third of what a short command imports, comes when the first of them is called.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

_kernels: list[tuple[Compiled, tuple[str, ...]]] = []


class Compiled:
    """A function that numba compiles when it is first called, by itself or by another compiled one.

    Attributes:
        py_func: the function as it is written.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func, self._options = function, options

    @cached_property
    def dispatcher(self) -> Any:
        """What numba makes of it."""
        from numba import njit

        try:
            return njit(**self._options)(self.py_func)
        except RuntimeError:  # a service's user has no home and may not write here: compiled by each program
            return njit(**{**self._options, "cache": False})(self.py_func)

    def __call__(self, *arguments: Any) -> Any:
        """What the function returns."""
        return self.dispatcher(*arguments)

    @property
    def _numba_type_(self) -> Any:
        """By this name numba asks what a global of another compiled function is."""
        from numba import typeof

        return typeof(self.dispatcher)  # type: ignore[no-untyped-call]


def kernel(*signatures: str, **options: Any) -> Callable[[F], F]:
    """Mark a function as compiled by numba (cached, without the interpreter's lock) before a bench is driven.

    Args:
        signatures: of the arguments that it will be called with, as numba writes them: `f8[:,::1](f8[:,::1])`.
        options: of `numba.njit` besides.
    """

    def marked(function: F) -> F:
        made = Compiled(function, {"cache": True, "nogil": True, **options})
        _kernels.append((made, signatures))
        return cast(F, made)

    return marked


def compile_kernels() -> None:
    """Compile every kernel of the modules imported so far, or load it from the cache."""
    for made, signatures in _kernels:
        for signature in signatures:
            made.dispatcher.compile(signature)
