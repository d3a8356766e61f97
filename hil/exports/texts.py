"""Transfer functions and parameters as text that Python, MATLAB and spreadsheets read."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence

from hil.errors import SettingError, option
from hil.exports.function import PLANT, function_of
from hil.findings.results import FittedFunction
from hil.findings.tables import FUNCTION_HEADS, coefficient_rows
from hil.physics.model import Model
from hil.physics.transfer_function import TransferFunction
from hil.record.csv_text import csv_text
from hil.record.plain import plain
from hil.record.simulated import SIMULATED, marked

FUNCTIONS_SCHEMA, PARAMETERS_SCHEMA = "hil.transfer-functions/1", "hil.parameters/1"
Row = tuple[str, float, float | None, str]


def functions_text(functions: Sequence[FittedFunction], form: str, *, simulated: bool | None = None) -> str:
    """Transfer functions as `python`, `matlab`, `json` or `csv`; `simulated` is None where nobody knows."""
    writers: Mapping[str, Callable[[Sequence[FittedFunction], bool | None], str]] = {
        "python": _python, "matlab": _matlab, "json": _json, "csv": _functions_csv,
    }  # fmt: skip
    return writers[form](functions, simulated)


def function_text(linear: TransferFunction, name: str, form: str) -> str:
    """A transfer function of which no uncertainty is known.

    Raises:
        SettingError: a form that there is not.
    """
    if form not in ("python", "matlab", "json", "csv"):
        raise SettingError(f"{option('to')} {form}: there are python, matlab, json and csv")
    one = FittedFunction(
        name=name, numerator=tuple(plain(linear.numerator)), denominator=tuple(plain(linear.denominator)),
        dead_time_s=linear.dead_time_s, unit="1", coefficients=(), covariance=(),
    )  # fmt: skip
    return functions_text([one], form)


def model_text(model: Model, name: str, form: str) -> str:
    """A model: its transfer function where it is one (a bent one is not), else its parameters and effects."""
    simulated = model.origin.get(SIMULATED)
    if model.plant == PLANT and not model.values.get("bend"):
        return functions_text([function_of(model, name)], form, simulated=simulated)
    rows = list(parameter_rows(model))
    if form == "json":
        parts = [{"name": n, "value": value, "std": std, "unit": unit} for n, value, std, unit in rows]
        return _dumped({"schema": PARAMETERS_SCHEMA, SIMULATED: simulated, "plant": model.plant, "parameters": parts})
    if form == "csv":
        return csv_text(("name", "value", "std", "unit", SIMULATED), ((*row, simulated) for row in rows))
    title = marked(f"Parameters of {model.plant}: value, standard uncertainty, unit.", simulated=simulated)
    if form == "python":
        body = "".join(f"    {n!r}: ({value!r}, {std!r}, {unit!r}),\n" for n, value, std, unit in rows)
        return f'"""{title}"""\n\nPLANT = {model.plant!r}\nPARAMETERS = {{\n{body}}}\n'
    lines = [
        f"p.{n.replace('.', '_').replace('-', '_')} = {value!r};  % {_pm(std)}{unit}\n" for n, value, std, unit in rows
    ]
    return f"% {title}\n" + "".join(lines)


def parameter_rows(model: Model) -> Iterable[Row]:
    """Every parameter of the plant, then those of each effect as `effect.hook.parameter`."""
    for name, found in model.parameters.items():
        yield name, found.value, found.std, found.unit
    for effect in model.effects:
        for name, found in effect.parameters.items():
            yield f"{effect.name}.{effect.hook}.{name}", found.value, found.std, found.unit


def _python(functions: Sequence[FittedFunction], simulated: bool | None) -> str:
    head = f'"""{_title(simulated)}"""\n\nFUNCTIONS = {{\n'
    parts = []
    for one in functions:
        covariance = [list(row) for row in one.covariance]
        parts.append(
            f"    {one.name!r}: {{\n"
            f"        'numerator': {list(one.numerator)!r},\n        'denominator': {list(one.denominator)!r},\n"
            f"        'dead_time_s': {one.dead_time_s!r},\n        'unit': {one.unit!r},\n"
            f"        'coefficients': {list(one.coefficients)!r},\n        'covariance': {covariance!r},\n    }},\n"
        )
    use = (
        "\n\ndef to_control(name, pade_order=3):\n"
        '    """The function for python-control; a dead time becomes a Padé approximation."""\n'
        "    import control\n\n"
        "    one = FUNCTIONS[name]\n"
        "    made = control.tf(one['numerator'], one['denominator'])\n"
        "    late = one['dead_time_s']\n"
        "    return made * control.tf(*control.pade(late, pade_order)) if late else made\n"
    )
    return head + "".join(parts) + "}\n" + use


def _title(simulated: bool | None) -> str:
    title = "Transfer functions: coefficients from the highest power of s down, time in seconds."
    return marked(title, simulated=simulated)


def _matlab(functions: Sequence[FittedFunction], simulated: bool | None) -> str:
    lines = [
        f"% {_title(simulated)}",
        "in_octave = exist('OCTAVE_VERSION', 'builtin') > 0;  % its tf holds no dead time: multiply by exp(-s T) there",
        "if in_octave",
        "  pkg load control",
        "end",
    ]
    for number, one in enumerate(functions, 1):
        covariance = "; ".join(" ".join(map(_matlab_number, row)) for row in one.covariance)
        lines += [
            f"% {one.name} [{one.unit}]",
            f"G{number} = tf({', '.join(map(_matlab_row, (one.numerator, one.denominator)))});",
            f"T{number} = {one.dead_time_s!r};  % dead time, s",
            "if ~in_octave",
            f"  G{number}.InputDelay = T{number};",
            "end",
            f"% covariance of {', '.join(one.coefficients) or 'nothing: no uncertainty is known'}",
            f"C{number} = [{covariance}];",
        ]
    return "\n".join(lines) + "\n"


def _json(functions: Sequence[FittedFunction], simulated: bool | None) -> str:
    parts = [one.model_dump() for one in functions]
    return _dumped({"schema": FUNCTIONS_SCHEMA, SIMULATED: simulated, "transfer_functions": parts})


def _functions_csv(functions: Sequence[FittedFunction], simulated: bool | None) -> str:
    return csv_text((*FUNCTION_HEADS, SIMULATED), ((*row, simulated) for row in coefficient_rows(functions)))


def _pm(std: float | None) -> str:
    return "" if std is None else f"± {std!r} "


def _matlab_row(values: Iterable[float]) -> str:
    return f"[{' '.join(map(repr, values))}]"


def _matlab_number(value: float | None) -> str:
    return "NaN" if value is None else repr(value)


def _dumped(content: Mapping[str, object]) -> str:
    return json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
