"""Write the pages of the reference that say what the program itself says: commands, plants, effects.

    python docs/generate.py

A test compares the pages with what this makes of the installed program, so they cannot be out of date.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import math
import os
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any
from unittest.mock import patch

from hil.catalog import entries
from hil.description.find import descriptions
from hil.description.page import names_of
from hil.description.read import Description, read_description
from hil.physics.compose import effects, plant
from hil.physics.effect import Effect, EffectParameter
from hil.physics.plant import Parameter, Plant
from hil.record.measured import RENAMED
from hil.session.procedure import load_procedure

REFERENCE = Path(__file__).parent / "reference"
NOTE = "<!-- Made by docs/generate.py from the program itself; edit it there. -->"


def main() -> None:
    """Write every page that differs."""
    for name, text in pages().items():
        path = REFERENCE / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"{path}: written")


def pages() -> dict[str, str]:
    """The generated pages by file name."""
    made = {"command-line.md": command_line(), "plants.md": plants_page(), "effects.md": effects_page(),
            "results.md": results_page(), "python.md": python_page(),
            "figures.md": figures_page(), "devices.md": devices_page()}  # fmt: skip
    return {name: "\n".join(lines).rstrip() + "\n" for name, lines in made.items()}


# -- devices -----------------------------------------------------------------------------------------------


def devices_page() -> Iterator[str]:
    """Every installed description, in a row each."""
    yield NOTE
    yield ""
    yield "# Described devices"
    yield ""
    yield (
        "What comes with the program. `hil describe NAME` prints the page of each: addresses, scales, what makes its "
        "outputs safe, and the manual it is written after. [Descriptions](descriptions.md) says how to write one for "
        "another device. None of them has run on the hardware."
    )
    yield from ("", "| `driver` | `model` | what it is | driven | read |", "|---|---|---|---|---|")
    found = {name: read_description(path) for name, path in descriptions().items()}
    for name, one in sorted(found.items(), key=lambda item: (item[1].protocol, item[0])):
        ways = (", ".join(terminals(one, way)) or "–" for way in ("out", "in"))
        yield f"| `{one.protocol}` | `{name}` | {one.summary} | {' | '.join(ways)} |"


def terminals(one: Description, way: str) -> Iterator[str]:
    """The terminals of one direction, with range and unit; neighbours that are alike together."""
    some = ((key, terminal) for key, terminal in one.terminals.items()
            if terminal.direction == way and not getattr(terminal, "sets", None))  # fmt: skip
    for (low, high, unit), alike in groupby(some, lambda item: (*item[1].range, item[1].unit)):
        names = ", ".join(names_of(key, terminal) for key, terminal in alike)
        yield f"{names} ({number(low)} … {number(high)}{'' if unit == '1' else f' {unit}'})"


# -- figures -----------------------------------------------------------------------------------------------


def figures_page() -> Iterator[str]:
    """Every declared quantity with its definition, each defined once."""
    yield "# Figures"
    yield ""
    yield (
        "What each figure means and how it is read; `hil run NAME --describe` prints the same. *Of the reading*: the "
        "meter's lag and half a hold of the command are in it, while frequency responses are without them. *Bound*: "
        "`<` or `>` where noise alone could make it. [bench]: in the bench's unit. "
        "[How often the stated intervals hold](../explanation/coverage.md). Names of earlier versions are read as "
        f"those of today: {', '.join(f'`{old}` is `{new}`' for old, new in RENAMED.items())}."
    )
    tables: dict[str, list[str]] = {}
    for entry in entries("procedures"):
        measured = load_procedure(entry.name).measurements
        if any(m.definition for m in measured):
            rows = {m.name: f"- `{m.name}` [{m.unit or 'bench'}]: {m.definition or m.meaning}" for m in measured}
            tables[entry.name] = [shortened(row) for row in rows.values()]
    owners = sorted(tables, key=lambda one: (one.startswith("efc_"), len(tables[one])))  # what runs others comes last
    for name in sorted(tables, key=lambda one: (one.startswith("efc_"), one)):
        before = owners[: owners.index(name)]
        whole = sorted((one for one in before if {*tables[one]} <= {*tables[name]}), key=lambda one: -len(tables[one]))
        owned_before = {owner: tables[owner] for owner in dict.fromkeys([*whole, *before])}
        own, as_of = stated_before(tables[name], owned_before)
        yield from ("", f"## `{name}`")
        yield from as_stated(as_of, owned_before)
        yield from ("", *own) if own else ()


def shortened(text: str) -> str:
    """A definition with the words that stand at the head of the page."""
    text = re.sub(r"Of the reading: [^.;]*; frequency responses are without them\.", "Of the reading.", text)
    return re.sub(r"`[<>]` where noise alone could make (it|the difference)\.", "Bound.", text)


def stated_before(rows: Sequence[str], stated: Mapping[str, Sequence[str]]) -> tuple[list[str], dict[str, list[str]]]:
    """The rows that no earlier table has, and the names of the others by the first table that has them.

    In another unit a row says the same; its unit then stands beside its name.
    """
    own: list[str] = []
    as_of: dict[str, list[str]] = {}
    for row in rows:
        same = (name for name, earlier in stated.items() if unitless(row) in map(unitless, earlier))
        if table := next(same, ""):
            head = row.split()[1] if row in stated[table] else row.partition(": ")[0].removeprefix("- ")
            as_of.setdefault(table, []).append(head)
        else:
            own.append(row)
    return own, as_of


def unitless(row: str) -> str:
    """A row without its unit."""
    return re.sub(r" \[.*?\]:", ":", row, count=1)


def as_stated(as_of: Mapping[str, Sequence[str]], stated: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """A line for the earlier tables that stand whole in this one, and for each of which it has some rows."""
    whole = [table for table, names in as_of.items() if len(names) == len(stated[table]) > 1]
    if whole:
        yield from ("", f"All of {', '.join(f'[`{table}`](#{table})' for table in whole)}.")
    for table, names in as_of.items():
        if table not in whole:
            yield from ("", f"As of [`{table}`](#{table}): {', '.join(names)}.")


# -- commands ----------------------------------------------------------------------------------------------


COMMON = ("--input", "--output", "--archive", "--language")
COMMANDS = """\
`hil COMMAND --help` says what each command and each option does, with units, defaults and limits. Results go to
stdout; progress and errors to stderr: a bar on a terminal, plain lines otherwise. An error is one line that names the
file, field or value, what was found and what is allowed; `hil --debug COMMAND …` adds the traceback.

| exit status | means |
|---|---|
| 0 | done; a verdict such as "mismatch" is a result, not a failure |
| 1 | a limit of a test was missed or nobody can tell whether it is met, or a driver check failed |
| 2 | bad input or usage; nothing was driven |
| 3 | hardware, link or storage failed, or anything else after something was driven; also any end with NOT SAFE |
| 130, 143, 129, 131 | stopped by Ctrl-C, SIGTERM, SIGHUP (a closed terminal), SIGQUIT; what was recorded is kept |
| 138 | stopped by the stop button of a console, or SIGUSR1: outputs jumped to their safe values |

*NOT SAFE* is said, and the status is 3, when an output is not known to be safe, whatever ended the run, Ctrl-C
included ([safety](../explanation/safety.md#what-is-known-of-an-output)).

A *recording* is any file or folder of [recordings](recordings.md), a *model* a [model file](model-file.md). A *bench*
is a [bench file](bench-file.md) or the name of an installed one. Commands that take recordings also take [the options
that say how a stranger's table is read](recordings.md#formats). `--json` prints the result for programs
([schemas](json.md)). Other options that several commands take:"""


def command_line() -> Iterator[str]:
    """The page of the command line: exit statuses, common options, what each command does."""
    yield from ("# The command line", "", NOTE, "", COMMANDS, "", "| option | |", "|---|---|")
    helps = options(said("compare", "--help"))
    yield from (f"| `{name}` | {helps[name]} |" for name in COMMON)
    yield from ("", "## Commands", "")
    yield from command_rows("hil")


def command_rows(command: str) -> Iterator[str]:
    """A row for a command, and for each command of a group."""
    text = said(*command.split()[1:], "--help")
    usage, _, rest = text.partition("\n\n")
    group = text.partition("Commands:\n")[2]
    if options(text).keys() - {"--help"} or not group:
        taken = usage.partition(command)[2].replace("[OPTIONS]", "").split()
        does = " ".join(rest.partition("\n\n")[0].split())
        yield f"- `{' '.join([command, *taken])}`: {does}"
    for line in group.splitlines():
        if line[2:3] != " ":
            yield from command_rows(f"{command} {line.split()[0]}")


def options(text: str) -> dict[str, str]:
    """What a help says of every option, by its name."""
    part = text.partition("\nOptions:\n")[2].partition("\n\n")[0] + "\n"
    found = re.findall(r"^  (--[\w-]+).*?  +(.*\n(?: {6,}.*\n)*)", part, re.M)
    return {name: " ".join(meaning.split()) for name, meaning in found}


def said(*arguments: str) -> str:
    """What `hil ARGUMENTS` prints."""
    from hil.__main__ import main as hil

    out = io.StringIO()
    with (
        patch.object(sys, "argv", ["hil", *arguments]),
        patch.dict(os.environ, {"COLUMNS": "100", "TERMINAL_WIDTH": "100"}),
        contextlib.redirect_stdout(out),
        contextlib.suppress(SystemExit),
    ):
        hil()
    return out.getvalue()


# -- plants and effects ------------------------------------------------------------------------------------


PLANTS = """\
What `hil identify --plant NAME` fits. Each parameter is given as *name [unit]: meaning; typical value (bounds of a
fit)*. Those that are *held* stay at their value unless `--free NAME` frees them. A column is found by its name;
`--input` and `--output` override it. Inner signals are used where they were recorded. Parameters that are *as of*
another plant have its unit, value, bounds and meaning.

Signals are inputs → output. Places are where effects may act, with stage (where it has another name) and unit.
*Merritt* is Hydraulic Control Systems, 1967."""


def plants_page() -> Iterator[str]:
    """The page of the plants: signals, parameters, places for effects."""
    yield from ("# Plants", "", NOTE, "", PLANTS)
    told: dict[str, list[str]] = {}
    heads: dict[str, str] = {}
    for entry in entries("plants"):
        found = plant(entry.name)
        yield from ("", f"## `{found.name}`", "", entry.summary, "")
        first = [f"Source: {of_merritt(found.source)}."] if found.source else []
        owned = [(heads.setdefault(head, found.name), head) for head in (*first, *signals_and_places(found))]
        for owner, some in groupby(owned, lambda one: one[0]):
            texts = [head for _, head in some]
            kinds = ", ".join(head.partition(":")[0] for head in texts)
            yield from texts if owner == found.name else [f"{kinds}: as of [`{owner}`](#{owner})."]
        yield from slowness(found)
        own, as_of = stated_before(parameter_rows(found.parameters), told)
        yield from as_stated(as_of, told)
        yield from ("", *own) if own else ()
        told[entry.name] = parameter_rows(found.parameters)


def signals_and_places(found: Plant) -> Iterator[str]:
    """What goes in and comes out of a plant, and where effects may act: by stage and unit."""
    inputs = ", ".join(f"`{signal.heading}`" for signal in found.inputs)
    inner = ", ".join(f"`{signal.heading}`" for signal in found.observed)
    yield f"Signals: {inputs} → `{found.output.heading}`{f'; inner {inner}' if inner else ''}."
    places = (
        f"{', '.join(f'`{name}`' for name in names)} ({unit if names == [stage] else f'{stage}, {unit}'})"
        for (stage, unit), hooks in groupby(found.hooks, lambda hook: (hook.stage, of_channel(hook.unit)))
        for names in [[hook.name for hook in hooks]]
    )
    yield f"Places: {'; '.join(places)}."


def slowness(found: Plant) -> Iterator[str]:
    """How much slower than a valve a plant is, where it is."""
    for times in sorted({hook.slower for hook in found.hooks} - {1.0}):
        yield f"Effects: times of the library × {number(times)}, rates ÷ {number(times)}."


def of_merritt(source: str) -> str:
    """A source with the book that most share by its author alone."""
    return source.replace("Merritt: Hydraulic Control Systems, 1967", "Merritt")


def of_channel(unit: str) -> str:
    """A unit of a page of equations, where it is that of a channel."""
    return unit.replace("{input}", "input").replace("{output}", "output")


def parameter_rows(parameters: Sequence[Parameter]) -> list[str]:
    """The parameters of a plant; those that are numbered in one row, with the first and the last typical value."""
    rows = []
    for name, some in groupby(parameters, lambda one: str(one.name.rstrip("0123456789"))):
        first, *others = some
        if others and all(one.fixed == first.fixed for one in others):
            last = others[-1]
            row = parameter_row(first)
            row = row.replace(f"`{first.name}`", f"`{first.name}` … `{last.name}`", 1)
            row = row.replace(
                f"; {number(first.typical)} (", f"; {number(first.typical)} … {number(last.typical)} (", 1
            )
            rows.append(row.replace(f" {first.name.removeprefix(name)} of", "s of"))
        else:
            rows += [parameter_row(one) for one in (first, *others)]
    return rows


def parameter_row(parameter: Parameter) -> str:
    """A parameter of a plant."""
    bounds = "held" if parameter.fixed else f"{number(parameter.low)} … {number(parameter.high)}"
    unit = of_channel(parameter.unit)
    return f"- `{parameter.name}` [{unit}]: {parameter.meaning}; {number(parameter.typical)} ({bounds})"


EFFECTS = """\
The library that a diagnosis screens. One definition (`hil/physics/effects/NAME.py`) makes the simulation, the fit,
the wording of the verdict and this page. Each parameter is given as *name [unit]: meaning; typical value (bounds,
null)*. At its *null* an effect does nothing; parameters without one are shapes, of any value meanwhile. FS is the
full scale of the effect's place in its [plant](plants.md), or of the *travel* there; model files have the unit of the
place. Times and rates are those of valves; a slower plant says by how much they differ. *Merritt* is Hydraulic
Control Systems, 1967."""


def effects_page() -> Iterator[str]:
    """The page of the effects: signature, equation, parameters, where each may sit."""
    yield from ("# Effects", "", NOTE, "", EFFECTS)
    yield from ("", "What each looks like in data:", "")
    for e in effects():
        title = "" if e.title == e.name.replace("_", " ") else f" {e.title}"
        yield f"- [`{e.name}`](#{e.name}){title}: {e.signature}"
    for effect in effects():
        yield from effect_section(effect)


def effect_section(effect: Effect) -> Iterator[str]:
    """One effect."""
    summary = next(entry.summary for entry in entries("effects") if entry.name == effect.name)
    summary = summary.removeprefix(f"{effect.name.replace('_', ' ').capitalize()}: ")
    summary = summary[:1].upper() + summary[1:]
    yield from ("", f"## {effect.name}", "", summary, "", "```text", effect.equation, "```", "")
    yield from (effect_parameter(parameter) for parameter in effect.parameters)
    yield ""
    yield f"At {', '.join(f'`{place}`' for place in sorted(effect.hooks))}. Source: {of_merritt(effect.source)}"


def effect_parameter(parameter: EffectParameter) -> str:
    """A parameter of an effect: unit, meaning, then typical value, bounds and null."""
    unit = parameter.unit.replace("{value}", "FS").replace("{motion}", "FS of travel")
    null = "" if parameter.null is None else f", null {number(parameter.null)}"
    bounds = f"{number(parameter.low)} … {number(parameter.high)}"
    meaning = (
        f"{parameter.meaning}; at its {parameter.telling} it is another effect"
        if parameter.telling
        else parameter.meaning
    )
    return f"- `{parameter.name}` [{unit}]: {meaning}; {number(parameter.typical)} ({bounds}{null})"


RESULTS = """\
`hil results RUN` hands on what the evaluation of a run found. `--json FILE` writes one document, below. `--csv FILE`
writes the values there and each curve beside it as STEM_NAME.csv. `--xlsx FILE` writes a spreadsheet with sheets for
values, transfer functions and each curve. FILE may be `-` for JSON and for the values as CSV. The run folder keeps
the document as `results.json` from the day of the run.

A number that does not exist is `null`. The unit of a pure number is `1`. Every `std` is a standard uncertainty (one
σ); limits are judged with twice that. A frequency response has `gain` in the response's per the command's unit, `raw
magnitude` in dB of that, and `magnitude` in dB over that at the reference. A document of another schema version is
refused.

```python
import json

document = json.load(open("results.json"))
for curve in document["curves"]:
    columns = [f"{column['name']} [{column['unit']}]" for column in curve["columns"]]
```"""


def results_page() -> Iterator[str]:
    """The page of the results: every field of their schema."""
    from hil.findings.results import schema

    made = schema()
    yield from ("# Results as data", "", NOTE, "", RESULTS)
    yield from schema_section(str(made["$id"]), made)
    for name, part in made["$defs"].items():
        yield from schema_section(name, part)


def schema_section(title: str, part: Mapping[str, Any]) -> Iterator[str]:
    """One object of a schema: what it is, its fields and their types."""
    yield from (
        "",
        f"## `{title}`",
        "",
        " ".join(part.get("description", "").split()),
        "",
    )
    for kind, fields in groupby(part["properties"].items(), lambda one: schema_type(one[1])):
        yield f"- {', '.join(f'`{name}`' for name, _ in fields)}: {kind}"


def schema_type(field: Mapping[str, Any]) -> str:
    """The type of a field in words."""
    if "$ref" in field:
        return f"`{field['$ref'].rsplit('/', 1)[-1]}`"
    if "anyOf" in field:
        return " or ".join(schema_type(one) for one in field["anyOf"])
    if "enum" in field or "const" in field:
        return " or ".join(f"`{value}`" for value in field.get("enum", [field.get("const")]))
    if field.get("type") == "array":
        return f"list of {schema_type(field['items'])}"
    return str(field.get("format") or field.get("type"))


PYTHON = """\
`import hil` offers the names below and imports none of them before it is used. They are what the commands do, as
functions on values: recordings, models, results. Each of these shows itself in a notebook; `Recording` and `Results`
have `.plot()` (a matplotlib figure) and `.to_pandas()`, recordings `.to_xarray()` too. Errors are
`hil.errors.HilError`, one sentence each. `help(hil.NAME)` explains each argument, with its unit, what
is returned and what is raised; the commands' words are in brackets.

Optional arguments that many functions share stand below by their name alone. `inputs` and `output` are names of
channels, `reading` is a `Reading` (how a table of a stranger is read), `budget_s` seconds of computing. `notes` and
`progress` are functions that are called with what is to be shown. A `Source` is a recording or its path."""

SHARED = frozenset({"inputs", "output", "reading", "budget_s", "notes", "progress"})


def _place(name: str) -> str:
    """Where a public name is imported from: most stand in `hil` too."""
    import hil

    return "hil" if name in hil.__all__ else "hil.api"


def python_page() -> Iterator[str]:
    """The page of the public interface: every name with its signature and what it is for."""
    from hil import api

    yield from ("# Python", "", NOTE, "", PYTHON, "", "```python", *_example(inspect.getdoc(api) or ""), "```")
    for name in sorted(api.__all__, key=str.lower):
        public = getattr(api, name)
        does = " ".join((inspect.getdoc(public) or "").partition("\n\n")[0].split())
        yield from ("", f"## `{_place(name)}.{name}`", "", does)
        if not inspect.isclass(public):
            yield from ("", "```text", *wrapped(f"{name}{signature_of(public)}"), "```")


def _example(doc: str) -> list[str]:
    """The indented lines of a docstring."""
    return [line[4:] for line in doc.splitlines() if line.startswith("    ") or not line.strip()][1:-1]


def signature_of(function: Any) -> str:
    """What a function takes, without types, and returns; of a default that is no plain value only that there is one."""
    found = inspect.signature(function)
    plain = str | int | float | tuple | bool | None
    given = [
        one.replace(annotation=one.empty, default=one.default if isinstance(one.default, plain) else Ellipsis)
        if one.default is not one.empty and one.name not in SHARED
        else one.replace(annotation=one.empty)
        for one in found.parameters.values()
    ]
    text = str(found.replace(parameters=given)).replace("Ellipsis", "...")
    for one in given:
        if one.name in SHARED and one.default is not one.empty:
            text = text.replace(str(one), one.name)
    return re.sub(r"-> '([^']*)'", r"-> \1", text)


def wrapped(text: str) -> list[str]:
    """Text in lines that fit a page."""
    return textwrap.wrap(text, 110, subsequent_indent="    ", break_long_words=False)


def number(value: float) -> str:
    """A number as a reader wants it."""
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return f"{value:g}".replace("-", "−")


if __name__ == "__main__":
    main()
