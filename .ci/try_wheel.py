"""Build the wheel, install it into an empty environment and use it in an empty folder, as without the checkout.

    python .ci/try_wheel.py

What counts is what the wheel holds: `hil` must come from it and list everything. Alone it runs a simulated and a Modbus
bench and identifies, and names the extras of what it does not make; with two of them it does the demonstration and
finds its fixture for pytest. The long description must lead nowhere that only the checkout has.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_KEPT = ("README.md", "LICENSE", "pyproject.toml", "hil", "drivers", "sim_devices", "procedures")
_LISTED = {"drivers": "modbus", "devices": "in_process", "procedures": "frequency_response", "plants": "brevini-hpv41",
           "effects": "friction"}  # fmt: skip
_TEST = """
def test_it_answers(bench):
    with bench.rig() as rig:
        assert rig.ramp_to(50.0).values("flow", "l/min")[-1] > 10.0
"""


def main() -> None:
    """Build, look at and try the wheel."""
    with tempfile.TemporaryDirectory(prefix="wheel-") as name:
        folder = Path(name)
        wheel = built(folder)
        check_description(wheel)
        use(wheel, folder)
    print(f"{wheel.name}: builds, installs alone and works in an empty folder")


def built(folder: Path) -> Path:
    """The wheel of a copy: a build in the checkout would find what earlier ones left there."""
    source = folder / "source"
    source.mkdir()
    for name in _KEPT:
        whole = ROOT / name
        if whole.is_dir():
            shutil.copytree(whole, source / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(whole, source / name)
    run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, source])
    (wheel,) = folder.glob("*.whl")
    return wheel


def check_description(wheel: Path) -> None:
    """No link of the long description is relative: on a package index it would be dead."""
    with zipfile.ZipFile(wheel) as archive:
        (metadata,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        text = archive.read(metadata).decode("utf-8")
    links = re.findall(r"\]\(([^)\s]+)\)", text)
    dead = [link for link in links if not link.startswith(("https://", "#"))]
    if dead or "Classifier: " not in text:
        raise SystemExit(f"{wheel.name}: links that lead nowhere from a package index: {', '.join(dead) or 'none'}; "
                         "or no classifiers")  # fmt: skip


def use(wheel: Path, folder: Path) -> None:
    """In an environment that holds nothing else, from a folder that holds nothing; extras come at the end."""
    empty, place = folder / "environment", folder / "empty"
    place.mkdir()
    run([sys.executable, "-m", "venv", empty])
    programs = empty / "bin"
    hil = programs / "hil"
    install(programs, wheel)
    print(run([programs / "python", "-m", "pip", "list"], place))
    where = run([programs / "python", "-P", "-c", "import hil; print(hil.__file__)"], place)
    if not Path(where.strip()).is_relative_to(empty):
        raise SystemExit(f"hil came from {where.strip()}, not from the wheel")
    for kind, expected in _LISTED.items():
        if expected not in run([hil, "list", kind], place):
            raise SystemExit(f"hil list {kind}: '{expected}' is not in the wheel")
    run([hil, "check", "cummins-efc-acceptance"], place)
    output = run([hil, "run", "step_response", "--bench", "hpv41-lab", "--out", "steps"], place)
    for extra in ("pages", "archive"):
        if output.count(f"valve-hil[{extra}]") != 1:
            raise SystemExit(f"hil run without the extra '{extra}' does not name it once:\n{output}")
    run([hil, "identify", "steps", "--plant", "brevini-hpv41", "--out", "model.json"], place)
    with served([hil, "devices", "cummins-efc-modbus"], place):
        run([hil, "run", "leakage_check", "--bench", "cummins-efc-modbus", "--out", "leakage"], place)
    install(programs, f"{wheel}[pages,archive]", "pytest")
    run([hil, "demo", "--out", "demo"], place)
    if not (place / "demo" / "report.html").is_file():
        raise SystemExit("hil demo wrote no demo/report.html")
    (place / "test_bench.py").write_text(_TEST, encoding="utf-8")
    run([programs / "python", "-m", "pytest", "-q"], place)


def install(programs: Path, *wanted: str | Path) -> None:
    """Install packages as pinned."""
    python = programs / "python"
    run([python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", *wanted])
    run([python, "-m", "pip", "check"])


@contextmanager
def served(command: list[str | Path], folder: Path) -> Iterator[None]:
    """Devices that answer meanwhile."""
    with subprocess.Popen(command, cwd=folder, env=bare(), text=True, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE) as devices:  # fmt: skip
        try:
            while line := devices.stdout.readline():
                if line.startswith("simulated"):
                    break
            yield
        finally:
            devices.terminate()


def run(command: list[str | Path], folder: Path | None = None) -> str:
    """Run a program; what it says, shown where it fails."""
    done = subprocess.run(command, cwd=folder, env=bare(), text=True, stdin=subprocess.DEVNULL, check=False,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}: exit status {done.returncode}\n{done.stdout}")
    return done.stdout


def bare() -> dict[str, str]:
    """The environment without what leads Python elsewhere."""
    return {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}


if __name__ == "__main__":
    main()
