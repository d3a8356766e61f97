"""Build an FMU's binaries, pack the archive, and hold what comes out against this program's own simulation."""

from __future__ import annotations

import importlib.util
import platform
import re
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from hil.child import finished, python
from hil.errors import InputError, storing
from hil.fmu.description import FmiVersion, description, identifier
from hil.fmu.source import Source, source_of
from hil.fmu.validation import resources
from hil.fmu.variables import Variables
from hil.record.durable import write_named

_FLAGS = (
    "-std=c99",
    "-O3",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-w",
    "-shared",
    "-fPIC",
    "-s",
    "-fvisibility=hidden",
)
_C_HEAD = """\
/* {title}.

   #include "{file}" in one file of a program, then

       Model m;
       model_start(&m);
       m.u[0] = 20.0;
       if (model_step(&m, 0.001)) an output is no number any more;
       m.y[0] is the first output at that time, in s

   u: {inputs}. y: {outputs}. Own step {step_s:g} s.
   model_set(&m, place, value) changes a parameter. Both return 0 when done.
   Parameters in their order: {names}. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunknown-pragmas"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-variable"
#pragma GCC diagnostic ignored "-Wunused-but-set-variable"
#endif
"""
_HEADERS = (
    "fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h",
    "fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Platform:
    """Where an FMU runs: its folders in FMI 2 (none: not in it) and 3, its suffix, and zig's name for it."""

    folder2: str
    folder3: str
    suffix: str
    zig: str

    def folder(self, version: FmiVersion) -> str:
        """The folder of its binaries."""
        return self.folder2 if version == "2" else self.folder3


PLATFORMS = {
    "linux64": Platform("linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
    "win64": Platform("win64", "x86_64-windows", ".dll", "x86_64-windows-gnu"),
    "darwin64": Platform("darwin64", "x86_64-darwin", ".dylib", "x86_64-macos"),
    "darwin-arm64": Platform("", "aarch64-darwin", ".dylib", "aarch64-macos"),
    "linux-arm64": Platform("", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
}


def own_platform() -> str:
    """The name of the platform that this program runs on; empty when it is none of `PLATFORMS`."""
    arm = platform.machine().lower() in ("arm64", "aarch64")
    system = {"linux": "linux", "win32": "win", "darwin": "darwin"}.get(sys.platform, "")
    name = f"{system}-arm64" if arm else f"{system}64"
    return name if name in PLATFORMS else ""


@dataclass(frozen=True, slots=True)
class Built:
    """What was written: the platforms that it has binaries for, and sentences for the user."""

    platforms: tuple[str, ...]
    notes: tuple[str, ...]


def write_c(variables: Variables, out: Path) -> None:
    """Write a model as one C99 file: the equations, `model_start`, `model_set`, `model_step`.

    Raises:
        UntranslatableError: the model has no C form.
        StorageError: the file cannot be written.
    """
    names = ", ".join(variable.name for variable in variables.parameters)
    inputs = ", ".join(signal.heading for signal in variables.inputs)
    outputs = ", ".join(signal.heading for signal in variables.outputs)
    head = _C_HEAD.format(
        title=variables.plant.title, file=out.name, inputs=inputs, outputs=outputs, names=names, step_s=variables.step_s
    )
    core = (files("hil.fmu") / "core.c").read_text(encoding="utf-8")
    with storing(out):
        write_named(out, head + source_of(variables).text + core)


def write_fmu(variables: Variables, out: Path, version: FmiVersion, platforms: Sequence[str] | None = None) -> Built:
    """Write a model as an FMU for co-simulation, with its sources.

    Args:
        variables: of the model.
        out: the archive to write.
        version: of FMI.
        platforms: names in `PLATFORMS`; this machine's when None, none at all when empty: sources alone.

    Raises:
        InputError: fmpy is not installed, a platform is not known, or there is no compiler for it.
        UntranslatableError: the model has no C form.
        StorageError: the archive cannot be written.
    """
    source = source_of(variables)
    notes = [] if source.is_tunable else [f"parameters of the plant are fixed in this FMU: {source.why}"]
    if platforms is None:
        platforms = [own_platform()] if _compiler(own_platform()) else []
        notes += [] if platforms else ["no C compiler on this machine: the FMU holds sources alone"]
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        _write_sources(work, source)
        libraries = {name: _compiled(work, identifier(variables), name) for name in _checked(platforms, version)}
        with storing(out):
            _pack(out, variables, source, version, work, libraries)
    return Built(tuple(libraries), tuple(notes))


def _checked(platforms: Sequence[str], version: FmiVersion) -> list[str]:
    for name in platforms:
        if name not in PLATFORMS:
            raise InputError(f"--platform {name}: not known; there are: {', '.join(PLATFORMS)}")
        if not PLATFORMS[name].folder(version):
            raise InputError(f"platform {name}: FMI {version} has no folder for it; FMI 3 has")
    return list(platforms)


def _write_sources(work: Path, source: Source) -> None:
    headers = _header_folder()
    for name in _HEADERS:
        shutil.copy(headers / name, work)
    for name in ("core.c", "fmi.c"):
        (work / name).write_bytes((files("hil.fmu") / name).read_bytes())
    (work / "model.h").write_text(source.text, encoding="utf-8")
    wrapper = (work / "fmi.c").read_text(encoding="utf-8")
    (work / "refusals.h").write_text(
        _refusals(wrapper, (headers / "fmi3FunctionTypes.h").read_text()), encoding="utf-8"
    )


def _header_folder() -> Path:
    found = importlib.util.find_spec("fmpy")
    if found is None or found.origin is None:
        raise InputError("FMUs need fmpy, which brings FMI's headers: pip install 'valve-hil[fmu]'")
    return Path(found.origin).parent / "c-code"


def _refusals(wrapper: str, types: str) -> str:
    """Every function of FMI 3.0 that the wrapper does not have, as one that returns an error."""
    have = set(re.findall(r"\b(fmi3\w+)\(", wrapper))
    plain = re.sub(r"/\*.*?\*/", "", types, flags=re.S)
    found = re.findall(r"typedef\s+fmi3Status\s+(fmi3\w+)TYPE\s*\((.*?)\);", plain, flags=re.S)
    lines = [
        f"fmi3Status {name}({' '.join(given.split())}) {{ return fmi3Error; }}"
        for name, given in found
        if name not in have
    ]
    return "/* Functions of FMI 3.0 that this model has no use for. */\n" + "\n".join(lines) + "\n"


def _compiler(name: str) -> list[str]:
    """The command that compiles for a platform; empty when there is none."""
    if not name:
        return []
    if name == own_platform() and (cc := shutil.which("cc")):
        return [cc]
    if importlib.util.find_spec("ziglang"):
        return python("ziglang", "cc", "-target", PLATFORMS[name].zig)
    return []


def _compiled(work: Path, name: str, target: str) -> Path:
    command = _compiler(target)
    if not command:
        raise InputError(
            f"platform {target}: no compiler for it here; pip install 'valve-hil[fmu-cross]', or --sources-only"
        )
    library = work / target / f"{name}{PLATFORMS[target].suffix}"
    library.parent.mkdir()
    link = [] if target == "win64" else ["-lm"]
    run = finished([*command, *_FLAGS, "-o", str(library), str(work / "fmi.c"), *link])
    if run.returncode:
        raise InputError(f"--platform {target}: {command[0]} failed: {' '.join(run.stderr.split())[-300:]}")
    return library


def _pack(
    out: Path, variables: Variables, source: Source, version: FmiVersion, work: Path, libraries: dict[str, Path]
) -> None:
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description(variables, source, version))
        for path in sorted(work.glob("*.[ch]")):
            archive.write(path, f"sources/{path.name}")
        if version == "3":
            archive.writestr("sources/buildDescription.xml", _BUILD.format(name=identifier(variables)))
        for name, text in resources(variables).items():
            archive.writestr(name, text)
        for name, library in libraries.items():
            archive.write(library, f"binaries/{PLATFORMS[name].folder(version)}/{library.name}")


_BUILD = """\
<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{name}">
    <SourceFileSet language="C99"><SourceFile name="fmi.c"/></SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
"""
