"""After a run: why it did not pass, what to do now, and the same test of the next unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from urllib.parse import urlencode

from hil.console.form import NOTES
from hil.console.site import Site
from hil.findings.collect import findings_of
from hil.findings.results import Results
from hil.report.results import next_step, reasons
from hil.session.limit import bench_limits, limit_text, limits_of
from hil.session.setting import value_text


def reasons_of(results: Results) -> list[str]:
    """A sentence for each value that keeps a run from passing, misses first, then what to do; empty for none."""
    findings = findings_of(results)
    return [*reasons(findings), *filter(None, [next_step(findings.open_or_missed)])]


def next_unit(site: Site, meta: Mapping[str, Any]) -> str:
    """The address of the form for the same test of another unit; empty where the bench is not here any more."""
    driven = str(meta.get("bench_path") or "")
    benches = [name for name, path in site.bench_files().items() if str(path.resolve()) == driven]
    if not benches or not meta.get("procedure"):
        return ""
    settings = {f"set.{name}": value_text(value) for name, value in (meta.get("settings") or {}).items()}
    stated = bench_limits(site.bench(benches[0]).bench, meta["procedure"])
    typed = [limit_text(name, limit) for name, limit in limits_of(meta).items() if limit != stated.get(name)]
    notes = {f"note.{name}": text for name, _ in NOTES if (text := (meta.get("notes") or {}).get(name))}
    asked = {"procedure": meta["procedure"], "bench": benches[0], "operator": meta.get("operator") or "", **settings,
             **notes, "limits": "\n".join(typed)}  # fmt: skip
    return f"/run?{urlencode(asked)}"
