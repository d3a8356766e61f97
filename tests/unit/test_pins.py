"""Pins and their hashes say the same, hold what is asked for, and licences that ask for more are in NOTICE."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PINNED = re.compile(r"^([\w.-]+)(?:\[[\w,-]+\])?==([^\s;\\]+)", re.MULTILINE)


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def pins(text: str) -> dict[str, str]:
    return {plain(name): version for name, version in PINNED.findall(text)}


@pytest.mark.parametrize(
    ("file", "extras"), [("requirements.txt", ("dev",)), ("benchmarks/requirements.txt", ("bench",))]
)
def test_every_pin_has_hashes_and_is_that_of_the_constraints(file, extras):
    text, told = (ROOT / file).read_text("utf-8"), pins((ROOT / "constraints.txt").read_text("utf-8"))
    found = pins(text)
    assert found and {name: version for name, version in found.items() if told.get(name) != version} == {}
    for block in re.split(r"\n(?=\S)", text.strip()):
        assert "--hash=sha256:" in block, block
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    asked = [*project["dependencies"], *(one for extra in extras for one in project["optional-dependencies"][extra])]
    names = {plain(re.match(r"[\w.-]+", one)[0]) for one in asked} - {"valve-hil"}  # type: ignore[index]
    assert names <= set(found)


def test_licences_that_ask_for_more_are_named():
    notice = (ROOT / "NOTICE").read_text("utf-8")
    pinned = pins((ROOT / "requirements.txt").read_text("utf-8"))
    for one in distributions():
        name, told = one.metadata["Name"], one.metadata
        said = " ".join([told.get("License-Expression") or "", (told.get("License") or "")[:100],
                         *(told.get_all("Classifier") or [])])  # fmt: skip
        if plain(name) in pinned and re.search(r"GPL|MPL|Mozilla Public", said):
            assert re.search(rf"\b{re.escape(name)}\b", notice), f"{name}: {said[:80]}"
