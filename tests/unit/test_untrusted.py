"""Files of others: regular files below a root, text of bounded size and depth."""

import os
import shutil
import socket
import time
from threading import get_native_id

import pytest

from hil.errors import FileError
from hil.passport.issue import Wanted, issue
from hil.passport.key import signing_key
from hil.record.run_folder.seal import SEAL_FILE
from hil.session.outcome import REPORT_FILE
from hil.session.results import report_again
from hil.untrusted import (
    MOST_LEVELS,
    is_regular,
    open_untrusted,
    parse_json,
    parse_toml,
    read_json,
    read_untrusted,
    read_untrusted_json,
)
from tests.passports import run_of

pytestmark = pytest.mark.usefixtures("unprinted")


def begins(text: str) -> str:
    """The name of a case whose text is long."""
    return repr(text[:12])


WRITTEN = ("results.json", REPORT_FILE, SEAL_FILE)


@pytest.fixture
def root(tmp_path):
    (tmp_path / "secret").write_text("secret")
    folder = tmp_path / "run"
    (folder / "inner").mkdir(parents=True)
    (folder / "inner/file.json").write_text('{"a": 1}')
    return folder


def test_read_untrusted_reads_a_file_below_its_root(root):
    assert read_untrusted_json(root, "inner/file.json") == {"a": 1}
    assert is_regular(root, "inner/file.json")
    assert not is_regular(root, "inner")
    with pytest.raises(FileNotFoundError):
        open_untrusted(root, "inner/other.json")


@pytest.mark.parametrize("name", ["../secret", "/etc/passwd", "inner/../../secret", "", "."])
def test_open_untrusted_refuses_a_name_that_leads_out(root, name):
    with pytest.raises(FileError, match="leads out of its folder"):
        open_untrusted(root, name)


def test_open_untrusted_follows_no_link(root):
    (root / "file").symlink_to(root.parent / "secret")
    (root / "folder").symlink_to(root.parent)
    (root / "dangling").symlink_to("nowhere")
    for name in ("file", "folder/secret", "dangling"):
        with pytest.raises(FileError, match="a link, and links are not followed"):
            open_untrusted(root, name)
        assert not is_regular(root, name)


def test_open_untrusted_follows_a_link_that_is_the_root(root):
    (root.parent / "link").symlink_to(root)
    assert read_untrusted(root.parent / "link", "inner/file.json") == b'{"a": 1}'


def test_open_untrusted_waits_for_nothing(root):
    os.mkfifo(root / "pipe")
    begun = time.process_time()
    with pytest.raises(FileError, match="a pipe"):
        open_untrusted(root, "pipe")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(os.path.relpath(root / "socket"))
        with pytest.raises(FileError, match="a socket"):
            open_untrusted(root, "socket")
    with pytest.raises(FileError, match="a folder"):
        open_untrusted(root, "inner")
    with pytest.raises(FileError, match="a device"):
        open_untrusted("/dev", "zero")
    assert time.process_time() - begun < 1


def test_open_untrusted_refuses_what_is_too_large(root):
    (root / "large").write_bytes(b"x" * 101)
    assert len(read_untrusted(root, "large", 101)) == 101
    with pytest.raises(FileError, match="has 101 bytes; at most 100 bytes are read"):
        read_untrusted(root, "large", 100)
    with (root / "sparse").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(FileError, match="has 1100 GB"):
        open_untrusted(root, "sparse")
    with pytest.raises(FileError, match="holds 0 bytes"):
        open_untrusted(root, "sparse", 1 << 50)


@pytest.mark.parametrize(
    ("parse", "texts", "says"),
    [
        (parse_json, ["[" * 100_000, '{"a":' * 100_000, "[" * 65 + "]" * 65, '{"a":' * 65 + "1" + "}" * 65],
         "JSON nested more than 64 deep"),
        (parse_json, [r'{"a": ["\ud800"]}', rb'{"\uDC00x": 1}', b'"\xed\xa0\x80"'],
         r"JSON was expected: .*can't (en|de)code"),  # half a character
        (parse_json, ["1" * 310, '{"a": [-1e309]}', "[NaN]", '{"a": -Infinity}', f'["a", {10**308 * 2}]'],
         "JSON was expected"),  # what no float holds
        (parse_json, [b"", b"\xff\xfe\xfd", b"{", b"1" * 5000, b"\x00" * 10], "JSON was expected"),
        (parse_toml, ["a = " + "[" * 100_000, "a = " + "{a = " * 100_000, "a=" + "[" * 65 + "]" * 65],
         "TOML nested more than 64 deep"),
    ],
    ids=["deep", "half a character", "no float", "no JSON", "deep TOML"],
)  # fmt: skip
def test_what_cannot_be_parsed_is_said_with_its_place(parse, texts, says):
    for text in texts:
        with pytest.raises(FileError, match=f"here: {says}"):
            parse(text, "here")


def test_parse_json_reads_what_is_no_deeper():
    assert parse_json("[" * MOST_LEVELS + "]" * MOST_LEVELS, "here")
    assert parse_json("1", "here") == 1


def test_parse_json_reads_both_halves():
    assert parse_json(r'"\ud83d\ude00"', "here") == "\U0001f600" == parse_json('"\U0001f600"'.encode(), "here")


def test_parse_json_reads_long_and_large_numbers():
    text = "9" * 400
    assert parse_json(f'["{text}", 1e308, {10**307}, 0.{text}, 1e-999]', "here")[:2] == [text, 1e308]


LONG_KEYS = ("a." * 50_000 + "a = 1", "[" + "a." * 50_000 + "a]", "x = [1]\n" + '"a". ' * 50_000 + "a = 1",
             "x = {" + "'a'." * 50_000 + "a = 1}")  # fmt: skip
NO_TOML = ("a" * 200_000, '"' * 200_001, "a " * 100_000, "'a' " * 50_000, "a = " + "1" * 5000)


@pytest.mark.parametrize("text", [*LONG_KEYS, *NO_TOML], ids=begins)
def test_parse_toml_refuses_a_dotted_key_and_what_is_none_at_once(text):
    begun = time.process_time()
    says = r"line \d: a key of more than 64 parts" if text in LONG_KEYS else ""
    with pytest.raises(FileError, match=f"^here: {says}"):
        parse_toml(text, "here")
    assert time.process_time() - begun < 2  # 200 s in the parser


def test_parse_toml_reads_versions_and_addresses_in_text():
    assert parse_toml('a.b.c = "1.2.3.4.5.6"', "here") == {"a": {"b": {"c": "1.2.3.4.5.6"}}}


def test_read_json_waits_for_no_pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match="a pipe"):
        read_json(tmp_path / "pipe")


@pytest.mark.parametrize("partly", [False, True], ids=["in its place", "while it is written"])
def test_report_again_writes_through_no_link_and_into_no_pipe(tmp_path, partly, stranger):
    """A run folder of somebody else: its names lead to files of who evaluates it, or nowhere."""
    own = tmp_path / "own file"
    own.write_text("mine")
    links, pipes = run_of(tmp_path), tmp_path / "pipes"
    (links / SEAL_FILE).unlink()
    shutil.copytree(links, pipes)
    for name in WRITTEN[:-1] if not partly else WRITTEN:  # the seal is read too, and refused
        for place in (f"{name}.part", f"{name}.{os.getpid()}-{get_native_id()}.part") if partly else (name,):
            for folder in (links, pipes):
                (folder / place).unlink(missing_ok=True)
            (links / place).symlink_to(own)
            os.mkfifo(pipes / place)
    for folder in (links, pipes):
        report_again(folder)
        assert all(is_regular(folder, name) for name in WRITTEN)
    assert own.read_text() == "mine"


def test_passport_is_not_written_through_a_link(tmp_path, stranger):
    own = tmp_path / "own file"
    own.write_text("mine")
    (tmp_path / "unit.pdf").symlink_to(own)
    (tmp_path / "unit.pdf.part").symlink_to(own)
    issue([run_of(tmp_path)], tmp_path / "unit.pdf", signing_key(None), Wanted(identify=False))
    assert own.read_text() == "mine" and is_regular(tmp_path, "unit.pdf")
