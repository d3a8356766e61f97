"""README and the tutorials as they are read: every command from an empty folder, what is shown beside what is printed.

    python -m tests.tutorial [PAGE.md ...]

Each command goes to a shell, as a reader would type it, in a home of its own; nothing of the checkout is in the folder.
`make tutorial` runs this in CI, with the diagnoses that are too long for `make test`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorial").glob("*.md"))]
ELSEWHERE = ("source", "make", "pip", "hil console")
"""Beginnings of commands that install or wait for a browser; `make wheel` and the console have tests of their own."""


def steps(page: Path) -> Iterator[tuple[str, list[str]]]:
    """Commands of the `console` blocks, each with the lines of output that are shown below it."""
    blocks = re.findall(r"^```console\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    for block in blocks:
        command, shown = "", list[str]()
        for line in block.splitlines():
            if line.startswith("$ "):
                if command:
                    yield command, shown
                command, shown = line.removeprefix("$ "), []
            else:
                shown.append(line)
        yield command, shown


def alike(shown: str, printed: str) -> bool:
    """Whether a line is what was printed, numbers to the last digit: they have no more than their ± leaves.

    `…` stands for anything; how many blanks there are is nobody's concern.
    """
    pattern = ".*".join(re.escape(part) for part in " ".join(shown.split()).split("…"))
    return re.fullmatch(pattern, " ".join(printed.split())) is not None


def wrong(shown: list[str], printed: list[str]) -> list[str]:
    """Lines that are shown and were not printed."""
    return [line for line in shown if line.strip() != "…" and not any(alike(line, other) for other in printed)]


def followed(page: Path, folder: Path) -> list[str]:
    """What went otherwise than the page says, with the command; empty when all is as shown."""
    environment = {
        **os.environ, "HOME": str(folder / "home"), "HIL_STATE_DIR": str(folder / "home" / "state"),
        "HIL_LANGUAGE": "en",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }  # fmt: skip
    environment.pop("HIL_ARCHIVE", None)
    (folder / "home").mkdir()
    work = folder / "work"
    work.mkdir()
    for command, shown in steps(page):
        if command.startswith(ELSEWHERE):
            continue
        done = subprocess.run(
            command,
            shell=True,
            cwd=work,
            env=environment,
            capture_output=True,
            encoding="utf-8",
            stdin=subprocess.DEVNULL,
        )
        if done.returncode:
            return [f"{command}: exit status {done.returncode}: {done.stderr.strip().splitlines()[-1:]}"]
        if missing := wrong(shown, done.stdout.splitlines()):
            return [f"{command}: not printed: {line}" for line in missing]
    return []


def main() -> int:
    """Follow every page; the exit status says whether all is as shown."""
    found = 0
    for page in map(Path, sys.argv[1:]) if sys.argv[1:] else PAGES:
        with tempfile.TemporaryDirectory(prefix="hil-tutorial-") as folder:
            said = followed(page, Path(folder))
        print(f"{page.name}: {'; '.join(said) or 'every command does what is shown'}", flush=True)
        found += len(said)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
