"""Lines of keys in a TOML text."""

import pytest

from hil.bench.lines import line_at, lines_of

TEXT = """\
name = "a"  # line 1

[devices.daq]
note = '''
[not.a.table]
'''
rate = 5

[channels."supply pressure"]
limits = {
  low = 1 } # an inline table on one line
""".replace("{\n  low", "{ low")

LISTS = """\
values = [
  1,
  2,
]
after = 1
[[instruments]]
name = "x"

[[instruments]]
name = "y"
a.b.c = 1
"""


@pytest.mark.parametrize(
    ("place", "line"),
    [(("name",), 1), (("devices",), 3), (("devices", "daq", "note"), 4), (("devices", "daq", "rate"), 7),
     (("channels", "supply pressure", "limits", "low"), 10)],
)  # fmt: skip
def test_key_stands_where_its_statement_begins(place, line):
    assert lines_of(TEXT)[place] == line
    assert ("not", "a", "table") not in lines_of(TEXT)


@pytest.mark.parametrize(
    ("place", "line"),
    [(("values",), 1), (("values", 1), 1), (("after",), 5), (("instruments", 0), 6), (("instruments", 0, "name"), 7),
     (("instruments", 1, "name"), 10), (("instruments", 1, "a", "b", "c"), 11)],
)  # fmt: skip
def test_arrays_and_dotted_keys(place, line):
    assert lines_of(LISTS)[place] == line


def test_what_is_missing_is_told_where_it_is_missed():
    lines = lines_of(TEXT)
    assert line_at(lines, ("devices", "daq", "driver")) == 3
    assert line_at(lines, ("valve",)) is None
