"""A passport that unpacks to gigabytes: of a signer who is not known it is asked about, or refused."""

from __future__ import annotations

import io
import os
import pty
import subprocess
import sys
from pathlib import Path

import pikepdf
import pytest

from hil.catalog import entries
from hil.errors import FileError
from hil.passport import verify as verifying
from hil.passport.contents import LargeError, files_inside, lay_out
from hil.passport.issue import Wanted, issue
from hil.passport.key import signing_key
from tests.conftest import STRANGER
from tests.passports import run_of


def _made(attachments: dict[str, bytes]) -> bytes:
    pdf, made = pikepdf.new(), io.BytesIO()
    pdf.add_blank_page()
    for name, content in attachments.items():
        pdf.attachments[name] = pikepdf.AttachedFileSpec(pdf, content, filename=name)
    pdf.save(made, compress_streams=True)
    return made.getvalue()


def test_files_inside_stops_at_what_is_allowed():
    made = _made({"a.txt": bytes(600_000), "b.txt": bytes(600_000)})
    assert len(made) < 10_000
    assert sum(len(inside) for _, inside in files_inside(made)) == 1_200_000
    with pytest.raises(LargeError, match="its files unpack to more than"):
        list(files_inside(made, 1_000_000))
    assert [str(name) for name, _ in files_inside(made, 700_000, "b.*")] == ["b.txt"]


def test_a_pipe_is_no_passport(tmp_path):
    os.mkfifo(tmp_path / "pipe.pdf")
    with pytest.raises(FileError, match=r"pipe\.pdf: is a pipe; only regular files"):
        verifying.verify_file(tmp_path / "pipe.pdf", verifying.Trust())


def test_lay_out_writes_nothing_of_what_is_too_large(tmp_path):
    with pytest.raises(LargeError):
        lay_out(_made({"a.txt": b"1", "b.txt": bytes(600_000)}), tmp_path / "out", 1000)
    assert not (tmp_path / "out").exists()


def test_files_inside_refuses_another_packing():
    made = _made({"a.txt": b"1" * 100})
    with pikepdf.open(io.BytesIO(made)) as pdf:
        stream = pdf.attachments["a.txt"].get_file().obj
        stream.write(b"80000180", filter=pikepdf.Name("/RunLengthDecode"))
        changed = io.BytesIO()
        pdf.save(changed)
    with pytest.raises(FileError, match="packed as /RunLengthDecode"):
        list(files_inside(changed.getvalue()))


@pytest.fixture
def strange(tmp_path, monkeypatch):
    """A passport by a key that this computer does not know; its run unpacks to more than a stranger's may."""
    monkeypatch.syspath_prepend(str(STRANGER))  # whose procedure the run is of
    entries.cache_clear()
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path / "theirs"))
    issue([run_of(tmp_path)], tmp_path / "unit.pdf", signing_key(None), Wanted(identify=False))
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path / "ours"))
    monkeypatch.setattr(verifying, "STRANGERS_BYTES", 2000)
    monkeypatch.chdir(tmp_path)
    yield tmp_path / "unit.pdf"
    monkeypatch.undo()
    entries.cache_clear()


def test_open_of_an_unknown_signer_has_a_limit(strange, command_line, prints):
    for words in ([], ["--most", "0.001"]):
        status, _, err = command_line("open", "unit.pdf", "--out", "out", *words)
        assert status == 2 and len(err.splitlines()) == 1
        assert err.startswith("hil: unit.pdf: its files unpack to more than")
        assert "its signer is not known here; nothing was written" in err
        assert not Path("out").exists()
    assert strange.exists()
    prints("open", "unit.pdf", "--out", "out", "--most", "10")
    assert Path("out/runs/run/run.json").exists()


@pytest.mark.parametrize(("answer", "status"), [(b"y\n", 0), (b"n\n", 2)])
def test_open_asks_at_a_terminal(strange, answer, status):
    program = (
        "import sys; from hil.passport import verify; verify.STRANGERS_BYTES = 2000\n"
        "from hil.cli.app import main; sys.argv[1:] = ['open', 'unit.pdf', '--out', 'out']; sys.exit(main())"
    )
    ours, theirs = pty.openpty()
    os.write(ours, answer)
    done = subprocess.run([sys.executable, "-c", program], stdin=theirs, stdout=subprocess.PIPE, stderr=theirs)
    os.close(theirs)
    seen = os.read(ours, 4096)
    os.close(ours)
    assert done.returncode == status and b"its signer is not known here; lay out all" in seen
    assert (strange.parent / "out").exists() is (status == 0)
