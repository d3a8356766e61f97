"""One page: a template of this package with its style inside, escaped, written whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec

from hil.errors import storing
from hil.extras import lacking, of_extra
from hil.language.choice import in_page_language
from hil.language.words import _, plural, spoken
from hil.record.durable import write_whole
from hil.report.number import limits_text, number, unit_text, with_uncertainty
from hil.stderr import write
from hil.version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment

_Arguments = ParamSpec("_Arguments")
_WAITS_S = 1.0  # for a terminal that takes nothing


def page(make: Callable[_Arguments, None]) -> Callable[_Arguments, None]:
    """A function that makes a page, in the language of pages; one line where a library for pages is missing."""

    @wraps(make)
    def made(*args: _Arguments.args, **named: _Arguments.kwargs) -> None:
        try:
            in_page_language(make)(*args, **named)
        except ModuleNotFoundError as error:
            if not (library := of_extra(error)):
                raise
            write(f"hil: no page is made, which needs {lacking(library)}\n", _WAITS_S)

    return made


def write_page(template: str, path: Path, *, simulated: bool = False, **values: Any) -> None:
    """Render a template and write it; across what is `simulated` stands that it is.

    Raises:
        StorageError: the page cannot be written.
    """
    text = render(template, simulated=simulated, **values)
    with storing(path, "the report cannot be written", "; the recording is kept"):
        write_whole(path, text)


def render(template: str, *, simulated: bool = False, **values: Any) -> str:
    """A template of this package with its values; everything that is not markup of our own is escaped."""
    page = templates("hil.report", ".").get_template(template)
    return page.render(simulated=simulated, style=_style(), version=__version__, language=spoken(), **values)


@cache
def templates(package: str, folder: str) -> Environment:
    """The templates of a package: escaped, every value asked for must be there, in our words and numbers."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader(package, folder), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, extensions=["jinja2.ext.i18n"],
    )  # fmt: skip
    environment.install_gettext_callables(_, plural, newstyle=False)  # type: ignore[attr-defined]
    environment.filters.update(number=number, unit=unit_text)
    environment.globals.update(with_uncertainty=with_uncertainty, limits_text=limits_text)
    return environment


@cache
def _style() -> str:
    return files("hil.report").joinpath("style.css").read_text(encoding="utf-8")
