"""Which language the pages of this program are in: as `--language` says, else as the environment says.

Files for programs, and what is printed for scripts, are in English with a decimal point whatever is chosen.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from functools import wraps
from typing import ParamSpec, TypeVar

from hil.errors import SettingError
from hil.language.words import ENGLISH, languages, speaking, spoken

VARIABLE = "HIL_LANGUAGE"
_POSIX = ("LANGUAGE", "LC_ALL", "LC_MESSAGES", "LANG")  # in the order in which gettext reads them

_chosen: ContextVar[str] = ContextVar("chosen language", default="")
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


def choose(language: str) -> None:
    """Take a language for every page that is written from now on; empty leaves it to the environment.

    Raises:
        SettingError: it is not spoken.
    """
    if language and _short(language) not in languages():
        raise SettingError(f"--language {language}: {', '.join(languages())} are spoken")
    _chosen.set(_short(language))


def page_language(environment: Mapping[str, str] = os.environ) -> str:
    """The language of a page: that which is spoken already, the chosen one, or the environment's.

    Raises:
        SettingError: HIL_LANGUAGE names one that is not spoken; a user's locale that is not spoken is English.
    """
    if spoken() != ENGLISH:
        return spoken()
    return _chosen.get() or _of_environment(environment)


def in_page_language(write: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """A function that writes a page, in the language of pages."""

    @wraps(write)
    def written(*args: _Arguments.args, **named: _Arguments.kwargs) -> _Result:
        with speaking(page_language()):
            return write(*args, **named)

    return written


def _of_environment(environment: Mapping[str, str]) -> str:
    own = _short(environment.get(VARIABLE, ""))
    if own and own not in languages():
        raise SettingError(f"{VARIABLE}={own}: {', '.join(languages())} are spoken")
    if own:
        return own
    wanted = next((environment[name] for name in _POSIX if environment.get(name)), "")
    return next((short for one in wanted.split(":") if (short := _short(one)) in languages()), ENGLISH)


def _short(language: str) -> str:
    """`de` from `de_DE.UTF-8`."""
    return language.strip().replace("-", "_").partition(".")[0].partition("_")[0].casefold()
