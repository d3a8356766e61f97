"""What a user named is written whole: on a full disk the file before it stays, and nothing lies beside it."""

import errno

import numpy as np
import pytest

import hil
from hil.errors import StorageError
from hil.physics.model import typical_model
from hil.record import durable
from hil.record.csv_text import write_table
from hil.record.table.response_table import ResponseTable


def model(path):
    hil.save_model(typical_model("brevini-hpv41"), path)


def c_source(path):
    hil.export(typical_model("brevini-hpv41"), "c", out=path)


def table(path):
    write_table(["frequency [Hz]"], [[1.0]], path)


def response(path):
    hil.write(ResponseTable("r", np.array([1.0, 2.0]), np.array([1.0, 0.5j]), "1"), path)


@pytest.fixture(params=[(model, "m.json"), (c_source, "m.c"), (table, "t.csv"), (response, "r.csv")],
                ids=["model", "C source", "table", "frequency response"])  # fmt: skip
def written(request, tmp_path):
    """What writes a file, and where one stands already."""
    write, name = request.param
    (tmp_path / name).write_text("the one before", encoding="utf-8")
    return write, tmp_path / name


def full(*_args):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_leaves_the_file_before(written, monkeypatch):
    write, path = written
    monkeypatch.setattr(durable, "write_at", full)
    with pytest.raises(StorageError, match=f"{path.name}: .*No space left"):
        write(path)
    assert path.read_text(encoding="utf-8") == "the one before"
    assert [one.name for one in path.parent.iterdir()] == [path.name]


def test_a_link_is_written_through(written):
    write, path = written
    link = path.with_name(f"link{path.suffix}")
    link.symlink_to(path)
    write(link)
    assert link.is_symlink() and path.read_bytes() != b"the one before"


def test_what_an_analysis_leaves_stands_whole_too(command_line, tmp_path, monkeypatch, prints):
    path = tmp_path / "open.json"
    asked = ("analyse", "loop", "--numerator", "1", "--denominator", "1,2", "--out", path)
    prints(*asked)
    before = path.read_bytes()
    monkeypatch.setattr(durable, "write_at", full)
    status, _, error = command_line(*asked)
    assert status == 3 and f"{path}: cannot be written: No space left" in error
    assert path.read_bytes() == before
