"""Benchmarks run seldom: that what they take from the product is still there is looked at each time."""

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
OURS = ("hil", "drivers", "procedures", "sim_devices", "tests")


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_what_a_benchmark_imports_of_ours_exists(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not (isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in OURS):
            continue
        module = import_module(node.module)
        missing = [
            n.name for n in node.names if not hasattr(module, n.name) and not find_spec(f"{node.module}.{n.name}")
        ]
        assert missing == [], f"{node.module} has no {missing}"
