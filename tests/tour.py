"""A tour of every procedure on every shipped bench with its defaults: `python -m tests.tour [BENCH...] [--out DIR]`.

Each either gives results that make sense, or says in one line why it cannot here, with the exit status of the
contract. One line of output for each; what does not hold is said below it, and the exit status is 1 then. On two idle
cores this takes about an hour, so it is a script and no test. Benches on links have no device behind them here and must
say so.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

from hil.bench.find import benches
from hil.catalog import entries
from hil.cli import app

_ALLOWED = {0, 1, 2, 3}
_SILLY = re.compile(r"\d(?:e-|·10⁻)(?:1[2-9]|[2-9]\d|¹[²³⁴⁵⁶⁷⁸⁹]|[²³⁴⁵⁶⁷⁸⁹][⁰¹²³⁴⁵⁶⁷⁸⁹])|\bnan\b")


def main() -> int:
    """Go round; returns 1 when something is neither a result nor a reason."""
    parser = argparse.ArgumentParser(prog="python -m tests.tour")
    parser.add_argument("benches", nargs="*", default=sorted(benches()))
    parser.add_argument("--procedures", nargs="*", default=sorted(entry.name for entry in entries("procedures")))
    parser.add_argument("--out", type=Path, help="Keep the run folders here.")
    asked = parser.parse_args()
    place = asked.out or Path(tempfile.mkdtemp(prefix="tour-"))
    bad = 0
    for bench in asked.benches:
        for procedure in asked.procedures:
            folder = place / bench / procedure
            began = time.monotonic()
            status, out, err = _command("run", procedure, "--bench", bench, "--serial", "T-1", "--out", str(folder))
            wrong = list(_wrong(status, out, err, folder))
            bad += bool(wrong)
            told = _last(err) if status > 1 else _told(folder)
            took = f"{time.monotonic() - began:6.1f} s"
            print(f"{bench:24} {procedure:24} {status} {took}  {told}", *wrong, sep="\n    WRONG: ", flush=True)
    if asked.out is None:
        shutil.rmtree(place)
    return int(bad > 0)


def _command(*arguments: str) -> tuple[int, str, str]:
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["hil", *arguments]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        status = app.main()
    return status, out.getvalue(), err.getvalue()


def _wrong(status: int, out: str, err: str, folder: Path) -> Iterator[str]:
    """What does not hold, a line each."""
    if status not in _ALLOWED:
        yield f"exit status {status}"
    if "Traceback" in err:
        yield "a traceback"
    if status > 1:
        lines = [line for line in err.splitlines() if line.startswith("hil: ")]
        if len(lines) != 1:
            yield f"{len(lines)} lines say why: {lines}"
        return
    if silly := _SILLY.search(out):
        yield f"prints {silly.group(0)!r}"
    found = _results(folder)
    if not found["values"]:
        yield "measured nothing"
    elif all(value["value"] is None for value in found["values"]) and "note: " not in out:
        yield "determined nothing, and says not why"
    yield from (f"{value['name']} is {value['value']}" for value in found["values"] if not _is_number(value["value"]))


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and math.isfinite(value))


def _told(folder: Path) -> str:
    found = _results(folder)
    known = sum(value["value"] is not None for value in found["values"])
    return f"{known} of {len(found['values'])} values, verdict {found['verdict']}"


def _results(folder: Path) -> Mapping[str, Any]:
    found: Mapping[str, Any] = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    return found


def _last(err: str) -> str:
    lines: Sequence[str] = [line for line in err.splitlines() if line.startswith("hil: ")]
    return lines[-1] if lines else err[-200:]


if __name__ == "__main__":
    sys.exit(main())
