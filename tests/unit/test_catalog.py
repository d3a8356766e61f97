"""The folder is the catalog: every public module of a named package is an entry under its file name."""

import pytest

from hil.catalog import KINDS, Entry, entries, find
from hil.description.find import description_file, descriptions
from hil.errors import FileError, UnknownNameError
from hil.physics.compose import effects, kernel

MOISTURE = '''"""Moisture: a made-up effect of a stranger."""

from hil.physics.effect import Effect, EffectParameter, compiled


@compiled
def transform(value: float, share: float) -> float:
    """Less by a share."""
    return value * (1.0 - share)


EFFECT = Effect(
    name="moisture",
    title="moisture",
    hooks=("coil",),
    parameters=(EffectParameter("share", "1", 0.0, 0.1, 0.0, 0.9, "share lost"),),
    transform=transform,
    starts=lambda _seen: [{"share": 0.1}],
    equation="y = (1 - s)·u",
    signature="less gain",
    source="nobody, 2026",
    sentence="Moisture takes {share}.",
)
'''


@pytest.mark.parametrize("kind", KINDS)
def test_every_entry_has_a_summary_and_loads(kind):
    for entry in entries(kind):
        assert entry.summary, f"{entry.path}: the first line of its docstring is what `hil list` prints"
        assert entry.path.is_file()
        assert not entry.name.startswith("_")
        assert find(kind, entry.name) is entry
    assert [entry.name for entry in entries(kind)] == sorted(entry.name for entry in entries(kind))


@pytest.mark.parametrize("kind", ["plants", "effects"])
def test_entries_of_the_core_load(kind):
    for entry in entries(kind):
        assert entry.load().__name__ == entry.module


def test_dashes_and_underlines_are_the_same():
    assert find("plants", "brevini_hpv41").name == "brevini-hpv41"
    assert find("effects", "dead-time").name == "dead_time"


def test_a_name_that_nobody_has():
    with pytest.raises(
        UnknownNameError, match=r"no effect named 'fricton', did you mean 'friction'\? known: asymmetry"
    ):
        find("effects", "fricton")
    with pytest.raises(UnknownNameError, match="no plant named 'xyz'; known: brevini-hpv41, "):
        find("plants", "xyz")


def test_a_stranger_adds_an_effect_with_one_file(install_package):
    install_package("hil.effects", "damp", {"moisture.py": MOISTURE, "_helper.py": "raise RuntimeError\n"})
    assert "moisture" in [effect.name for effect in effects()]
    assert ("moisture", "coil") in [site.key for site in kernel("linear-axis").sites]
    assert find("effects", "moisture").summary == "Moisture: a made-up effect of a stranger."


def test_a_stranger_may_not_take_a_name_that_is_in_use(install_package):
    install_package("hil.effects", "rival", {"friction.py": MOISTURE})
    with pytest.raises(FileError, match=r"'friction' is provided twice: hil\.physics\.effects\.friction and rival\."):
        entries("effects")


def test_an_entry_that_lacks_a_package_says_which(install_package):
    install_package("hil.drivers", "needy", {"acme.py": '"""Acme."""\nimport acme_sdk\n'})
    entry = find("drivers", "acme")
    assert entry.summary == "Acme."  # listing it needs nothing
    with pytest.raises(FileError, match="driver 'acme' needs the package 'acme_sdk', which is not installed"):
        entry.load()


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ('raise ValueError("no licence")', "ValueError: no licence"),
        ("def (:", "SyntaxError: invalid syntax"),
        ("raise SystemExit(0)", "SystemExit: 0"),
        ("from . import gone", "ImportError: cannot import name 'gone'"),
    ],
)
def test_an_entry_that_throws_is_named(line, text, install_package):
    package = f"throws_{text.partition(':')[0].lower()}"  # imported once in this process
    install_package("hil.drivers", package, {"acme.py": f'"""Acme."""\n{line}\n'})
    with pytest.raises(FileError, match=rf"driver 'acme' \(.*acme\.py\) cannot be loaded: {text}"):
        find("drivers", "acme").load()


@pytest.mark.parametrize(
    ("value", "says"),
    [
        *((name, rf"'{name}' for drivers of the installed package 'throws' is not an import.*;")
          for name in ("no_such.drivers", "throws.drivers")),
        ("ghastly", "entry point 'ghastly' for drivers of .* 'throws' is not an importable package"),
    ],
)  # fmt: skip
def test_an_entry_point_that_names_nothing_or_what_throws_is_named(value, says, tmp_path, install_package):
    install_package("hil.drivers", "throws", {"__init__.py": "raise RuntimeError('broken')\n"})
    (tmp_path / "throws-1.0.dist-info" / "entry_points.txt").write_text(f"[hil.drivers]\nx = {value}\n")
    with pytest.raises(FileError, match=says):
        entries("drivers")


def test_a_summary_is_read_without_importing(tmp_path):
    path = tmp_path / "explosive.py"
    path.write_text('"""What it is.\n\nMore."""\nraise RuntimeError("imported")\n', encoding="utf-8")
    assert Entry("drivers", "explosive", "explosive", path).summary == "What it is."


def test_description_is_found_by_its_whole_name_alone():
    for name, path in descriptions().items():
        assert description_file(name) == path
    for name in ("../wago-750", "/etc/wago-750", "*", "wago\0750", "x" * 300, ""):
        with pytest.raises(UnknownNameError, match="no description named"):
            description_file(name)
