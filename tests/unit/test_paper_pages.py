"""The pages about the papers hold what the commands print now."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
NUMBER = re.compile(r"[−-]?\d+(?:\.\d+)?(?:e[+−-]?\d+)?")


def _papers():
    spec = importlib.util.spec_from_file_location("docs_papers", DOCS / "papers.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _numbers(text):
    return [float(found.replace("−", "-")) for found in NUMBER.findall(text)]


def test_every_table_is_what_the_commands_give():
    papers = _papers()
    for name, table in papers.made().items():
        text = (papers.PAGES / name).read_text(encoding="utf-8")
        there = text.partition(papers.BEGIN)[2].partition(papers.END)[0].strip()
        assert NUMBER.sub("", there) == NUMBER.sub("", table), f"run: python docs/papers.py ({name})"
        assert _numbers(there) == pytest.approx(_numbers(table), rel=5e-3, abs=1e-3), (
            f"run: python docs/papers.py ({name})"
        )
