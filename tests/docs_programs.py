"""Programs of `docs`, which is no package, and the numbers in what they write."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

DOCS = Path(__file__).parents[1] / "docs"
NUMBER = re.compile(r"[−-]?\d+(?:\.\d+)?(?:e[+−-]?\d+)?")


def program(name: str) -> ModuleType:
    """A program by its name without the ending."""
    spec = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def numbers(text: str) -> list[float]:
    """Every number in a text."""
    return [float(found.replace("−", "-")) for found in NUMBER.findall(text)]
