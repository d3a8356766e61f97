"""`hil export`: a model, or the transfer functions of a run, for another tool."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from hil.fmu.variables import Variables

_TEXTS = ("python", "matlab", "json", "csv")
_FORMS = (*_TEXTS, "c", "fmu")


def command(
    source: Path = typer.Argument(..., metavar="MODEL.json|RUN", help="Model file, or run folder."),
    to: str = typer.Option(..., "--to", metavar="|".join(_FORMS), help="For which tool."),
    out: str = typer.Option("-", "--out", metavar="FILE", help="File to write; `-` is stdout."),
    part: str = typer.Option("", "--part", metavar="NAME", help="Of a run: transfer functions with this in the name."),
    fmi: str = typer.Option("3", "--fmi", metavar="2|3", help="Version of FMI."),
    step_s: float | None = typer.Option(
        None, "--step", metavar="S", help="Internal step of C and FMU; the plant's own."
    ),
    effects: list[str] = typer.Option(
        [], "--effect", metavar="NAME@HOOK", help="Also bring this effect, switched off, for fault injection."
    ),
    platforms: str = typer.Option(
        "", "--platform", metavar="NAME,...", help="Binaries for these; default: this machine."
    ),
    sources_only: bool = typer.Option(False, "--sources-only", help="An FMU without binaries."),
) -> None:
    """Hand a model or the transfer functions of a run on to another tool.

    `c` is one C99 file, `fmu` a co-simulation FMU that needs no Python; it is run and compared with `hil simulate`.
    """
    from hil.cli.places import check_file
    from hil.errors import SettingError

    if to not in _FORMS:
        raise SettingError(f"--to {to}: not known; there are: {', '.join(_FORMS)}")
    if to not in _TEXTS:
        bring = _Simulation(fmi, step_s, effects, platforms, sources_only)
        typer.echo(bring.write(source, to, out))
        return
    text = _of_run(source, part, to) if source.is_dir() else _of_model(source, part, to)
    if out == "-":
        typer.echo(text, nl=False)
    else:
        check_file(Path(out), [source])
        Path(out).write_text(text, encoding="utf-8")


@dataclass(frozen=True)
class _Simulation:
    """How a model becomes C or an FMU, as it was typed."""

    fmi: str
    step_s: float | None
    effects: list[str]
    platforms: str
    sources_only: bool

    def write(self, source: Path, to: str, out: str) -> str:
        """Write it; returns what to tell the user."""
        from hil.cli.places import check_file
        from hil.errors import SettingError
        from hil.fmu.build import write_c
        from hil.fmu.variables import variables_of
        from hil.physics.model import load_model

        if out == "-":
            raise SettingError(f"--to {to}: name a file, --out FILE.{to}")
        if self.step_s is not None and not self.step_s > 0.0:
            raise SettingError(f"--step {self.step_s:g}: must be above 0 s")
        target = Path(out)
        check_file(target, [source])
        also = [(name, hook) for name, _, hook in (text.partition("@") for text in self.effects)]
        variables = variables_of(load_model(source), also, self.step_s)
        if to == "c":
            write_c(variables, target)
            return f"{target}: {variables.plant.title} in C99, {len(variables.parameters)} parameters"
        return self._fmu(variables, target)

    def _fmu(self, variables: Variables, target: Path) -> str:
        from hil.errors import SettingError
        from hil.fmu.build import own_platform, write_fmu
        from hil.fmu.examine import examine

        if self.fmi not in ("2", "3"):
            raise SettingError(f"--fmi {self.fmi}: there are 2 and 3")
        asked = [name.strip() for name in self.platforms.split(",") if name.strip()] or None
        built = write_fmu(variables, target, "2" if self.fmi == "2" else "3", [] if self.sources_only else asked)
        said = [f"{target}: FMI {self.fmi}, {', '.join(built.platforms) or 'sources only'}"]
        if own_platform() in built.platforms:
            said.append(f"differs from `hil simulate` by at most {examine(target, variables):.1g} of full scale")
        else:
            said.append("not run: it has no binary for this machine")
        return "\n".join([*said, *(f"note: {note}" for note in built.notes)])


def _of_model(source: Path, part: str, to: str) -> str:
    from hil.errors import SettingError
    from hil.export.texts import model_text
    from hil.physics.model import load_model

    if part:
        raise SettingError(f"--part {part}: only a run has parts; {source} is a model")
    return model_text(load_model(source), source.stem, to)


def _of_run(source: Path, part: str, to: str) -> str:
    from hil.errors import SettingError
    from hil.export.texts import functions_text
    from hil.session.results import results_of_run

    every = results_of_run(source).transfer_functions
    chosen = [one for one in every if part in one.name]
    if not chosen:
        known = "; ".join(one.name for one in every) or "none"
        raise SettingError(f"{source}: no transfer function with '{part}' in its name; there are: {known}")
    return functions_text(chosen, to)
