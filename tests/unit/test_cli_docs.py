"""The documentation is true: generated pages are up to date, links lead somewhere, code and commands run."""

from __future__ import annotations

import ast
import json
import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import pytest

from hil.__main__ import main
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.catalog import find
from hil.physics.compose import effects, kernel, plant
from hil.physics.model import load_model
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure
from tests.docs_programs import DOCS, program
from tests.tutorial import alike

ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.rglob("*.md"))]
WITH_COMMANDS = [ROOT / "README.md", *sorted((DOCS / "tutorial").glob("*.md")), *sorted((DOCS / "how-to").glob("*.md"))]
Follow = Callable[[str, str, str], None]


def test_generated_pages_are_up_to_date():
    generated = program("generate").pages()
    assert {"command-line.md", "plants.md", "effects.md"} <= generated.keys()
    for name, text in generated.items():
        assert (DOCS / "reference" / name).read_text(encoding="utf-8") == text, f"{name}: run python docs/generate.py"


@pytest.mark.parametrize("name", sorted(path.stem for path in DOCS.glob("*.py")))
def test_programs_of_the_documentation_are_loaded(name):
    assert callable(program(name).main)


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ +(.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for target in re.findall(r"(?:\]\(|<img src=\")([^)\s\"]+)", page.read_text(encoding="utf-8")):
        if target.startswith(("http", "mailto:")):
            continue
        file, _, anchor = target.partition("#")
        found = (page.parent / file).resolve() if file else page
        assert found.exists(), target
        assert not anchor or anchor in anchors(found), target


def test_the_map_of_the_code_is_that_of_the_code():
    rooms, _, after = (DOCS / "explanation" / "architecture.md").read_text("utf-8").partition("## What a command runs")
    package = ROOT / "hil"
    there = [path.relative_to(package) for path in package.rglob("*") if path.suffix == ".py" or path.is_dir()]
    tops = {path.parts[0].removesuffix(".py") for path in there} - {"__init__", "__main__", "__pycache__"}
    assert tops - set(re.findall(r"`(\w+)`", rooms)) == set()
    known = [f"/{path.with_suffix('')}" for path in there]
    named = set(re.findall(r"`([a-z_/]+)`", after.partition("\n## ")[0]))
    assert len(named) > 20
    assert {name for name in named if not any(path.endswith(f"/{name}") for path in known)} == set()


# -- code --------------------------------------------------------------------------------------------------


def fenced(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


@pytest.fixture
def follow(install_package):
    """Puts the code of a how-to into a package of its own and installs it for one test."""

    def followed(group, module, page):
        package = f"acme_{group.rpartition('.')[2]}"
        (code,) = fenced(DOCS / "how-to" / page, "python")
        (declared,) = fenced(DOCS / "how-to" / page, "toml")
        assert f'"{group}"' in declared and f'"{package}"' in declared and f"holds {module}.py" in declared
        install_package(group, package, {f"{module}.py": code})

    return followed


def test_the_effect_of_the_how_to(follow):
    follow("hil.effects", "edge_wear", "add-an-effect.md")
    effect = find("effects", "edge_wear").load().EFFECT
    assert effect in effects()
    assert ("edge_wear", "opening") in [site.key for site in kernel("brevini-hpv41").sites]
    assert effect.transform.py_func(50.0, 0.0, 5.0) == 50.0
    assert effect.transform.py_func(1.0, 0.3, 5.0) > 1.2
    (example,) = fenced(DOCS / "how-to" / "add-an-effect.md", "json")
    (shown,) = json.loads("{" + example + "}")["effects"]
    assert set(shown["parameters"]) == {parameter.name for parameter in effect.parameters}


def test_the_plant_of_the_how_to(follow):
    follow("hil.plants", "relief_valve", "add-a-plant.md")
    found = plant("relief-valve")
    compiled = kernel("relief-valve")
    assert {hook.name for hook in found.hooks} == {site.hook.name for site in compiled.sites}
    assert compiled.states == tuple(found.states)
    steady = found.coefficients(found.typical, float("inf"))
    assert list(steady) == list(compiled.coefficients)


def test_the_procedure_of_the_how_to(follow, tmp_path):
    follow("hil.procedures", "level_check", "add-a-procedure.md")
    procedure = load_procedure("level_check")
    bench = read_bench(benches()["brevini-hpv41"])
    outcome = run_procedure(procedure, bench, {"levels": "40,80", "hold_s": "0.5"}, tmp_path / "run")
    found = {measured.name: measured for measured in outcome.findings.measured}
    assert set(found) == {"level, 40", "spread, 40", "level, 80", "spread, 80"}
    assert found["level, 80"].value > found["level, 40"].value > 1.0
    assert found["level, 80"].unit == "l/min"


def test_the_model_file_of_the_reference(tmp_path):
    (example,) = fenced(DOCS / "reference" / "model-file.md", "json")
    (tmp_path / "model.json").write_text(example, encoding="utf-8")
    model = load_model(tmp_path / "model.json")
    assert model.effects[0].name == "friction"
    assert model.values["full_flow"] == plant("brevini-hpv41").typical["full_flow"]


def test_every_field_of_a_diagnosis_is_in_the_reference():
    tree = ast.parse((ROOT / "hil" / "diagnosis" / "diagnosis.py").read_text(encoding="utf-8"))
    written = {
        name.value
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef) and function.name in ("as_dict", "_finding", "_where")
        for name in ast.walk(function)
        if isinstance(name, ast.Constant) and isinstance(name.value, str) and name.value.isidentifier()
    }
    page = (DOCS / "reference" / "diagnosis-file.md").read_text(encoding="utf-8")
    told = set(re.findall(r"[\w]+", " ".join(re.findall(r"`([^`]+)`", page))))
    assert "verdict" in written
    assert written <= told


# -- commands ----------------------------------------------------------------------------------------------


def commands(page: Path) -> list[str]:
    """Every `hil …` line of the fenced blocks of a page."""
    lines = [line for block in fenced(page, "(?:console|sh|text)?") for line in block.splitlines()]
    return [line.removeprefix("$ ") for line in lines if line.startswith(("$ hil ", "hil "))]


def said(words: list[str]) -> int:
    """Run the command line; gives its exit status."""
    with patch.object(sys, "argv", words), pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def test_arguments_are_named_in_capitals_and_bracketed_once():
    usages = [row.split("`")[1] for row in program("generate").command_rows("hil")]
    assert [usage for usage in usages if "[[" in usage or re.search(r"{[a-z]+}", usage)] == []


EVERY = [(page, line) for page in WITH_COMMANDS for line in commands(page)]


@pytest.mark.parametrize(("page", "line"), EVERY, ids=[line for _, line in EVERY])
def test_every_command_shown_exists_with_its_options(page, line, capsys):
    words = shlex.split(line, comments=True)[1:]
    assert said(["hil", *words[:1], "--help"]) == 0
    told = capsys.readouterr().out
    if words[0] == "run" and words[1] not in ("level_check", "PROCEDURE"):
        procedure = load_procedure(words[1])
        given = [words[i + 1].partition("=")[0] for i, word in enumerate(words) if word == "--set"]
        assert set(given) <= set(procedure.settings)
    for option in (word.partition("=")[0] for word in words[1:] if word.startswith("--")):
        assert option in told, f"{page.name}: {line}"


def test_alike():
    assert alike("  fit   99.1 %  run", "fit 99.1 %  run")
    assert not alike("  fit   99.1 %  run", "  fit   99.2 %  run")
    assert not alike("rise 319.6 ± 3.0 …", "rise 319.7 ± 3.0 ms")
    assert not alike("  fit   99.1 %  run", "  fit   99.1 %  other")
    assert alike("note: …", "note: anything at all")


def test_every_schema_is_on_the_page_of_json():
    page = (DOCS / "reference" / "json.md").read_text(encoding="utf-8")
    sources = [path.read_text(encoding="utf-8") for path in (ROOT / "hil").rglob("*.py")]
    written = {name for text in sources for name in re.findall(r'"(hil\.[a-z-]+/\d+)"', text)}
    told = set(re.findall(r"^\| `(hil\.[a-z-]+/\d+)`", page, re.M))
    assert len(told) > 15
    assert written == told
