"""`hil new device --from` and `hil describe`: from a maker's file to a description that says what it lacks."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import tomlkit
from typer.testing import CliRunner

from hil.bench.fault import BenchError
from hil.bench.read import read_bench
from hil.cli.app import assembled
from hil.description.find import descriptions
from hil.description.first import GAP, first_description, gaps
from hil.description.read import checked, read_description
from hil.errors import FileError, SettingError
from tests.commands import hil
from tests.described import EVERYTHING, written
from tests.unit.test_description_can import AMPLIFIER, DBC
from tests.unit.test_description_text import REGULATOR

TABLE = """\
Acme flow computer,,,,,,
Register,Name,Data type,Unit,Scale,Min,Max,R/W
40001,Flow rate,FLOAT32,l/min,,-500,500,R
40003,Oil temperature,INT16,°C,0.1,-50,150,R
40004,Totalizer,UDINT,l,1/100,,,R
40006,Set point,INT16,%,0.01,-100,100,R/W
40007,Mystery,BLOB,zorg,,,,R
"""
FROM_ONE = "addr;parameter;format;range\n0x0001;Pressure;u16;0-400\n0x0002;Pressure;s16;\n"


def test_a_table_becomes_a_description_and_what_it_lacks_is_marked(tmp_path):
    table = written(tmp_path, "acme.csv", TABLE)
    told = hil("new", "device", "--from", str(table), "--in", str(tmp_path))
    path = tmp_path / "acme.toml"
    text = path.read_text(encoding="utf-8")
    assert f"fill in {gaps(text)} gaps, then hil describe {path}" in told
    made = tomllib.loads(text)
    assert made["modbus"]["addresses"] == "40001"
    assert made["terminals"]["Flow rate"] == {
        "direction": "in", "unit": "l/min", "range": [-500, 500], "address": 40001, "type": "f32",
    }  # fmt: skip
    assert made["terminals"]["Oil temperature"]["unit"] == "degC"
    assert made["terminals"]["Totalizer"] | {} == {
        "direction": "in", "unit": "l", "address": 40004, "type": "u32", "slope": 0.01,
    }  # fmt: skip
    lines = text.splitlines()
    marked = [line for line in lines if GAP in line]
    for expected in ("# range = ", "ABCD, CDAB, BADC or DCBA", "may be written (r/w)", "'BLOB'", "'zorg' is no unit",
                     "[watchdog]", "summary"):  # fmt: skip
        assert any(expected in line for line in marked), expected
    with pytest.raises(BenchError) as error:  # what must be said is not guessed
        read_description(path)
    assert {re.search(r"terminals\.(.*?)\.range: is missing", fault) is not None for fault in error.value.faults} == {
        True
    }
    with pytest.raises(FileError, match="is there already"):
        hil("new", "device", "--from", str(table), "--in", str(tmp_path))


def test_a_table_that_counts_from_nobody_knows_where(tmp_path):
    text = first_description(written(tmp_path, "one.csv", FROM_ONE))
    assert 'addresses = "wire"   # GAP: from 0? This table begins at 1; counting from 1 is one too high' in text
    assert 'table = "holding"   # GAP: holding (function 3) or input (4)?' in text
    assert set(tomllib.loads(text)["terminals"]) == {"Pressure", "Pressure 2"}


@pytest.mark.parametrize(
    ("table", "name", "expected"),
    [  # as the manuals of an ADAM-6024, an ioLogik E1241 and a Promass print them
        ("ADDR 4X,Channel,Item,Attribute,Memo\n40001,0,AI Value,Read,\n40011,1,AO Value,R/W,\n", "AO Value 1",
         {"address": 40011, "type": "u16", "unit": "1"}),
        ("Reference,Address,Data Type,Description\n30017,0x0010,2 words,Scaled\n40001,0x0000,1 word,Write\n", "Scaled",
         {"address": 30017, "type": "u32", "unit": "1"}),
        ("Parameter\tRegister\tData type\tAccess\tUnit / selection\nFlow\t2007\tFloat\tRead\tkg/h\n", "Flow",
         {"table": "holding", "address": 2007, "type": "f32", "unit": "kg/h"}),
        ("Reference,Name\n30001,Flow\n", "Flow", {"address": 30001, "type": "u16", "unit": "1"}),
        # a row for several registers is several terminals, or one of two
        ("Address,Name,Type\n0x0000-0x0007,Channel 1-8 data,uint16\n", "Channel {n} data",
         {"count": 8, "first": 1, "unit": "1", "table": "holding", "address": 0, "type": "u16"}),
        ("Address,Name,Type\n100 to 107,Flow,float\n", "Flow {n}",
         {"count": 4, "first": 1, "unit": "1", "table": "holding", "address": 100, "type": "f32"}),
        ("Address,Name,Type\n30001 … 30002,Flow,float\n", "Flow",
         {"unit": "1", "address": 30001, "type": "f32"}),
        ("Address,Name,Type\n16~17,Flow,\n", "Flow",
         {"unit": "1", "table": "holding", "address": 16, "type": "u16"}),
    ],
)  # fmt: skip
def test_headings_as_manuals_print_them(tmp_path, table, name, expected):
    made = tomllib.loads(first_description(written(tmp_path, "manual.csv", table)))["terminals"]
    assert made[name] == {"direction": "in", "slope": 1.0} | expected and len(made) == table.count("\n") - 1


def test_an_address_that_is_not_understood_is_left_out_and_said(tmp_path):
    text = first_description(written(tmp_path, "a.csv", "Address,Name\n4x0000,Output\n7,Flow\n"))
    assert list(tomllib.loads(text)["terminals"]) == ["Flow"]
    assert "'Output' is left out: its address 4x0000 is not understood" in text


def test_a_filled_table_is_described_as_manuals_count(tmp_path):
    text = first_description(written(tmp_path, "acme.csv", TABLE))
    filled = re.sub(r"# range = \[0, 0\]", "range = [0, 1000]", text).replace(
        '"in"   # GAP: may be written', '"out"   #'
    )
    path = written(tmp_path, "acme.toml", filled)
    told = hil("describe", str(path))
    assert "| `Set point` | driven | % | -100 … 100 | holding 0x0005 (40006), s16, 0.01 a count |" in told
    assert "**It has no watchdog**" in told and "still marked in" in told


def test_an_eds_and_a_dbc_become_descriptions(tmp_path):
    (tmp_path / "there").mkdir()
    dbc = written(tmp_path / "there", "amplifier.dbc", DBC)
    hil("new", "device", "amp", "--from", str(dbc), "--in", str(tmp_path))
    text = (tmp_path / "amp.toml").read_text(encoding="utf-8")
    assert (tmp_path / "amplifier.dbc").exists() and 'signal = "Measured"' in text and "sent by Amplifier" in text
    assert read_description(tmp_path / "amp.toml").protocol == "can"
    eds = descriptions()["io-401"].with_suffix(".eds")
    made = tomllib.loads(first_description(eds))
    assert made["eds"] == "io-401.eds" and len(made["terminals"]) == 8
    assert [t["direction"] for t in made["terminals"].values()].count("out") == 4
    lines = tomllib.loads(first_description(eds.with_stem("dio-401")))["terminals"]
    assert [(name, t["count"], t["bit"]) for name, t in lines.items()] == [("di1.{n}", 8, 0), ("do1.{n}", 8, 0)]


def test_what_is_no_table_is_told(tmp_path):
    with pytest.raises(
        FileError, match="no heading with a name and an address; columns are known by these words: name: "
    ):
        first_description(written(tmp_path, "a.csv", "1,2\n3,4\n"))
    with pytest.raises(SettingError, match=r"an EDS or DCF \(\.eds, \.dcf\) or a DBC"):
        first_description(written(tmp_path, "a.pdf", ""))
    with pytest.raises(SettingError, match="a device is described from a file, not a plant"):
        hil("new", "plant", "--from", str(tmp_path / "a.csv"))
    with pytest.raises(SettingError, match="'' names no driver"):
        hil("new", "driver")


def test_faults_are_listed_before_the_end(tmp_path):
    path = written(
        tmp_path, "x.toml", EVERYTHING.replace("address = 40101", "address = 1").replace("gap = 2", "gap = -2")
    )
    result = CliRunner().invoke(assembled(), ["describe", str(path)])
    assert f"{path}:9: modbus.gap: " in result.output and isinstance(result.exception, FileError)


@pytest.mark.parametrize("name", descriptions())
def test_every_installed_description_survives_being_written(name, tmp_path):
    survives(descriptions()[name].read_text(encoding="utf-8"), descriptions()[name].parent)


@pytest.mark.parametrize("text", [EVERYTHING, REGULATOR, AMPLIFIER], ids=["modbus", "text", "can"])
def test_a_description_with_every_key_survives_being_written(text, tmp_path):
    written(tmp_path, "amplifier.dbc", DBC)
    survives(text, tmp_path)


def survives(text: str, folder: Path) -> None:
    """Write → read → write: what a description says is in its model, and nothing else."""

    def read(said: str) -> object:
        content = tomllib.loads(said)
        for key in {"dbc", "eds"} & set(content):
            content[key] = str(folder / Path(content[key]).name)
        found, faults = checked(content)
        assert faults == [] and found is not None
        return found

    first = read(text)
    again = tomlkit.dumps(first.model_dump(mode="json", exclude_none=True, exclude_unset=True))  # type: ignore[attr-defined]
    second = read(again)
    assert second == first
    assert tomlkit.dumps(second.model_dump(mode="json", exclude_none=True, exclude_unset=True)) == again  # type: ignore[attr-defined]


HOW_TO = Path(__file__).parents[2] / "docs" / "how-to" / "a-new-bench.md"


def test_the_files_of_the_how_to_have_no_faults(tmp_path):
    page = HOW_TO.read_text(encoding="utf-8")
    (table,) = re.findall(r"```\n(Address.*?)```", page, re.DOTALL)
    described, bench = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    first = first_description(written(tmp_path, "module.csv", table))
    assert f"fill in {gaps(first)} gaps" in page
    written(tmp_path, "acme.toml", described)
    assert "holding 0x000a (40011), u16, counts 0 … 4095" in hil("describe", str(tmp_path / "acme.toml"))
    path = written(tmp_path, "bench.toml", bench)
    assert "no faults" in hil("check", str(path))
    kept = read_bench(path).text  # what a run keeps of it
    assert kept.startswith(bench) and '# acme.toml:\n#   protocol = "modbus"' in kept
    assert tomllib.loads(kept) == tomllib.loads(bench)
