"""Recordings of others: none reaches outside its file, and none takes more memory or time than a recording needs.

What each reader refuses is in docs/reference/recordings.md.
"""

from __future__ import annotations

import gzip
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from hil.errors import FileError
from hil.record.read import read_recording, write_recording
from hil.record.recording import recording

SECRET = "the session key of the console is 7f3a91"
TIME_S = np.arange(len(SECRET)) * 0.01


def _begun(path: Path, **how: Any) -> h5py.File:
    file = h5py.File(path, "w", **how)
    file.create_dataset("time", data=TIME_S).attrs["unit"] = "s"
    return file


def called_matlab(path: Path) -> None:
    """The head of a MATLAB 7.3 file before the HDF5 in it."""
    head = b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + struct.pack("<H", 0x0200) + b"IM"
    path.write_bytes(head.ljust(512, b"\0") + path.read_bytes()[512:])


def external(file: h5py.File, folder: Path) -> None:
    file.create_dataset("flow", shape=TIME_S.shape, dtype="u1", external=[(str(folder / "secret"), 0, len(SECRET))])


def external_in_a_group(file: h5py.File, folder: Path) -> None:
    external(file.create_group("a/b"), folder)


def link(file: h5py.File, folder: Path) -> None:
    file["flow"] = h5py.ExternalLink(str(folder / "target.h5"), "/values")


def link_behind_a_soft_one(file: h5py.File, folder: Path) -> None:
    file["#refs#/away"] = h5py.ExternalLink(str(folder / "target.h5"), "/")
    file["flow"] = h5py.SoftLink("/#refs#/away/values")


def virtual(file: h5py.File, folder: Path) -> None:
    layout = h5py.VirtualLayout(shape=TIME_S.shape, dtype="f8")
    layout[:] = h5py.VirtualSource(str(folder / "target.h5"), "values", shape=TIME_S.shape)
    file.create_virtual_dataset("flow", layout)


def virtual_without_end(file: h5py.File, folder: Path) -> None:
    layout = h5py.VirtualLayout(shape=(0,), dtype="f8", maxshape=(None,))
    source = h5py.VirtualSource(str(folder / "target.h5"), "values", shape=(0,), maxshape=(None,))
    layout[: h5py.h5s.UNLIMITED] = source[: h5py.h5s.UNLIMITED]
    file.create_virtual_dataset("flow", layout)


def huge(file: h5py.File, _: Path) -> None:
    file.create_dataset("flow", shape=(10**11,), dtype="f8", chunks=(10**6,), compression="gzip")


def huge_text(file: h5py.File, _: Path) -> None:
    file.create_dataset("flow", shape=(10**4,), dtype="S100000000", chunks=(1,))


def cycle(file: h5py.File, _: Path) -> None:
    file.create_group("a")["b"] = file["/"]


def doubled(file: h5py.File, _: Path) -> None:
    """Each group holds the next one twice: 2^60 ways to the last."""
    group = file
    for _ in range(60):
        inner = group.create_group("a")
        group["b"] = inner
        group = inner


def deep(file: h5py.File, _: Path) -> None:
    group = file
    for _ in range(3000):
        group = group.create_group("a")


def held_twice_by_a_soft_link(file: h5py.File, _: Path) -> None:
    file.create_group("a")["up"] = h5py.SoftLink("/")


OUTSIDE = {
    external: "dataset '/flow' has its samples in another file",
    external_in_a_group: "dataset '/a/b/flow' has its samples in another file",
    link: "'/flow' is a link to another file",
    link_behind_a_soft_one: "'/#refs#/away' is a link to another file",
    virtual: "dataset '/flow' is made of other datasets",
    virtual_without_end: "dataset '/flow' is made of other datasets",
    huge: "dataset '/flow' says that it holds 100000000000 values (800 GB); ",
    huge_text: "dataset '/flow' says that it holds 10000 values (1e+03 GB); ",
    cycle: "group '/a/b' is one that stands elsewhere in the file too",
    doubled: "/a/b' is one that stands elsewhere in the file too",
    deep: "groups more than 64 deep",
    held_twice_by_a_soft_link: "no rows",
}
KINDS: dict[str, dict[str, Any]] = {".h5": {}, ".mat": {"userblock_size": 512}, ".nc.h5": {}}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "secret").write_text(SECRET)
    with h5py.File(tmp_path / "target.h5", "w") as target:
        target.create_dataset("values", data=TIME_S * 1.5, maxshape=(None,))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("suffix", KINDS)
@pytest.mark.parametrize("make", OUTSIDE, ids=lambda make: make.__name__)
def test_hdf5_does_not_reach_outside_itself(make, suffix, folder, refused):
    path = folder / f"made{suffix}"
    with _begun(path, **KINDS[suffix]) as file:
        if suffix == ".nc.h5":
            file.attrs["_NCProperties"] = "version=2,netcdf=4.9.2,hdf5=1.14.3"
        make(file, folder)
    if suffix == ".mat":
        called_matlab(path)
    err = refused("convert", path.name, "out.csv")
    assert err.startswith(f"hil: {path.name}: ") and OUTSIDE[make] in err, err
    assert not (folder / "out.csv").exists()


def test_diagnose_reads_no_other_file(folder, refused):
    with _begun(folder / "made.h5") as file:
        external(file, folder)
    assert "has its samples in another file" in refused("diagnose", "--model", "efc-good", "made.h5", "--out", "d")


def test_hdf5_with_links_within_is_read(folder):
    with _begun(folder / "made.h5") as file:
        file.create_dataset("a/flow", data=np.ones(len(TIME_S))).attrs["unit"] = "l/min"
        file["soft"], file["nowhere"] = h5py.SoftLink("/a/flow"), h5py.SoftLink("/b")
        file["hard"] = file["a/flow"]
    assert set(read_recording(folder / "made.h5").channels) >= {"soft", "hard"}


def _rows(count: int = 50) -> Any:
    return recording("r", np.arange(count) * 0.1, {"flow [l/min]": np.arange(count) * 1.0})


def test_mdf_takes_nothing_from_an_attachment_outside(folder):
    import asammdf

    (folder / "valve-hil.json").write_text('{"meta": {"serial": "of another file"}}')
    signal_ = asammdf.Signal(samples=TIME_S, timestamps=TIME_S, name="flow", unit="l/min")
    with asammdf.MDF(version="4.10") as file:
        file.append([signal_])
        file.attach(b"{}", file_name="valve-hil.json", embedded=False)
        file.save(folder / "made.mf4")
    with pytest.raises(FileError, match=r"made.mf4: attachment 'valve-hil.json' lies in another file"):
        read_recording(folder / "made.mf4")


def test_mdf_with_entities_in_its_remarks_ends_at_once(folder, command_line):
    import asammdf

    entities = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 12))
    bomb = f'<!DOCTYPE x [<!ENTITY e0 "{"x" * 1000}">{entities}]><HDcomment><TX>&e11;</TX></HDcomment>'
    inside = '<!DOCTYPE x [<!ENTITY s SYSTEM "file://{}">]><HDcomment><TX>&s;</TX></HDcomment>'
    for comment in (bomb, inside.format(folder / "secret")):
        signal_ = asammdf.Signal(samples=TIME_S, timestamps=TIME_S, name="flow", unit="l/min", comment=comment)
        with asammdf.MDF(version="4.10") as file:
            file.append([signal_], comment=comment)
            file.header.comment = comment
            file.save(folder / "made.mf4", overwrite=True)
        status, _, err = command_line("convert", "made.mf4", "out.csv")
        assert status in (0, 2) and SECRET not in err
        assert status or SECRET not in (folder / "out.csv").read_text()


def test_tdms_takes_nothing_from_an_index_beside_it(folder):
    write_recording(_rows(), folder / "made.tdms")
    (folder / "made.tdms_index").write_text(SECRET)
    assert len(read_recording(folder / "made.tdms")) == 50


def test_tdms_that_says_it_is_huge_is_refused(folder):
    write_recording(_rows(50), folder / "made.tdms")
    content = (folder / "made.tdms").read_bytes()
    assert content.count(struct.pack("<Q", 50)) >= 2
    (folder / "made.tdms").write_bytes(content.replace(struct.pack("<Q", 50), struct.pack("<Q", 1 << 50)))
    assert len(read_recording(folder / "made.tdms")) == 50  # as many as there are


def test_matlab_that_says_it_is_huge_is_refused(folder):
    write_recording(_rows(50), folder / "made.mat")
    content = (folder / "made.mat").read_bytes()
    dimensions, huge_ones = struct.pack("<ii", 50, 1), struct.pack("<ii", 1 << 30, 1 << 30)
    assert dimensions in content
    (folder / "made.mat").write_bytes(content.replace(dimensions, huge_ones))
    with pytest.raises(FileError, match=r"made\.mat: "):
        read_recording(folder / "made.mat")


def _mat(path: Path, *variables: bytes) -> None:
    head = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + struct.pack("<H", 0x0100) + b"IM"
    path.write_bytes(head + b"".join(variables))


def _element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def _variable(kind: int, rows: int, name: bytes) -> bytes:
    shape = _element(5, struct.pack("<ii", rows, 1))
    return _element(6, struct.pack("<II", kind, 0)) + shape + _element(1, name)


def mat_that_unpacks_to_much_more(path: Path) -> None:
    size, block = 1 << 30, bytes(1 << 24)
    head = _variable(6, size // 8, b"flow") + struct.pack("<II", 9, size)
    packer = zlib.compressobj(1)
    packed = packer.compress(struct.pack("<II", 14, len(head) + size) + head)
    packed += b"".join(packer.compress(block) for _ in range(size // len(block))) + packer.flush()
    _mat(path, struct.pack("<II", 15, len(packed)) + packed)


def mat_of_many_cells(path: Path) -> None:
    _mat(path, _element(14, _variable(1, 1 << 28, b"c")))


def mat_of_hdf5_that_is_filled(path: Path) -> None:
    with _begun(path, userblock_size=512) as file:
        file.create_dataset("flow", shape=(4 * 10**7,), dtype="f8", chunks=(10**6,), compression="gzip")
    called_matlab(path)


def h5_of_many_that_are_filled(path: Path) -> None:
    with _begun(path) as file:
        for i in range(5):
            file.create_dataset(f"flow {i}", shape=(10**7,), dtype="f8", chunks=(10**6,))


def ring(path: Path, block: bytes, offset: int = 24, kind: str = "<Q", version: str = "4.10") -> None:
    """An MDF file in which a link of a block leads back to the block itself."""
    import asammdf

    with asammdf.MDF(version=version) as file:
        file.append([asammdf.Signal(samples=TIME_S, timestamps=TIME_S, name="flow", unit="l/min")])
        file.save(path, overwrite=True)
    content = bytearray(path.read_bytes())
    at = content.index(block)
    struct.pack_into(kind, content, at + offset, at)
    path.write_bytes(content)


def parquet_that_repeats_one_value(path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    column = pa.DictionaryArray.from_arrays(np.zeros(2 * 10**7, dtype="i1"), pa.array([0.0]))
    pq.write_table(pa.table({"time [s]": column, "flow": column}), path)


def parquet_that_repeats_a_long_text(path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    texts = pa.DictionaryArray.from_arrays(np.zeros(10**5, dtype="i1"), pa.array(["x" * 10**5]))
    pq.write_table(pa.table({"time [s]": np.arange(1e5), "remark": texts}), path)


def xlsx_of_one_row_again_and_again(path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    openpyxl.Workbook().save(plain := path.with_name("plain.xlsx"))
    with zipfile.ZipFile(plain) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            if name != "xl/worksheets/sheet1.xml":
                new.writestr(name, old.read(name))
                continue
            start, end = re.split(rb"<sheetData ?/>|<sheetData></sheetData>", old.read(name))
            with new.open(name, "w") as sheet:
                sheet.write(start + b"<sheetData>")
                for _ in range(200):
                    sheet.write(b"<row><c><v>1</v></c></row>" * 50_000)
                sheet.write(b"</sheetData>" + end)


BOMBS: dict[str, Callable[[Path], None]] = {
    "mat, unpacks to much more": mat_that_unpacks_to_much_more, "mat, many cells": mat_of_many_cells,
    "mat, HDF5 that is filled": mat_of_hdf5_that_is_filled, "h5, many that are filled": h5_of_many_that_are_filled,
    "mf4, groups are a ring": lambda path: ring(path, b"##DG"),
    "mf4, channel groups are a ring": lambda path: ring(path, b"##CG"),
    "mf4, channels are a ring": lambda path: ring(path, b"##CN"),
    "mdf, channels are a ring": lambda path: ring(path, b"CN", 4, "<I", "3.30"),
    "parquet, repeats one value": parquet_that_repeats_one_value,
    "parquet, repeats a long text": parquet_that_repeats_a_long_text,
    "xlsx, one row again and again": xlsx_of_one_row_again_and_again,
}  # fmt: skip


@pytest.mark.parametrize("bomb", BOMBS)
def test_what_needs_far_more_than_it_stores_is_refused(bomb, folder):
    path = folder / f"made.{bomb.partition(',')[0]}"
    BOMBS[bomb](path)
    with pytest.raises(FileError, match=rf"^{path}: .* may unpack to \S+ MB on this computer.*$"):
        read_recording(path)


WITHOUT_LANDLOCK = """
import ctypes, struct, sys
from hil.cli.app import main
libc = ctypes.CDLL(None, use_errno=True)
number, answer, allowed = 444, 0x00050000 | 38, 0x7FFF0000  # landlock_create_ruleset, ENOSYS, everything else
rules = b"".join(struct.pack("HBBI", *rule) for rule in (
    (0x20, 0, 0, 0), (0x15, 0, 1, number), (0x06, 0, 0, answer), (0x06, 0, 0, allowed),
))
table = ctypes.create_string_buffer(rules)
program = struct.pack("HxxxxxxP", 4, ctypes.addressof(table))
if libc.prctl(38, 1, 0, 0, 0) or libc.prctl(22, 2, ctypes.create_string_buffer(program), 0, 0):
    sys.exit(77)
if libc.syscall(number, None, ctypes.c_size_t(0), 1) != -1 or ctypes.get_errno() != 38:
    sys.exit(78)
"""


def _without_landlock(program: str, *words: str) -> subprocess.CompletedProcess[str]:
    """A program on a kernel that answers as one without Landlock does."""
    done = subprocess.run([sys.executable, "-c", WITHOUT_LANDLOCK + program, *words], capture_output=True, text=True)
    if done.returncode == 77:
        pytest.skip("this kernel filters no calls of the system")
    return done


def test_a_kernel_without_landlock_refuses_the_same_and_says_so(folder):
    makes = (external, link, virtual, huge)
    for make in makes:
        with _begun(folder / f"{make.__name__}.h5") as file:
            make(file, folder)
    write_recording(_rows(), folder / "sound.h5")
    converts = """
for name in sys.argv[1:]:
    sys.argv = ["hil", "convert", f"{name}.h5", f"{name}.csv"]
    print(main(), flush=True)
"""
    done = _without_landlock(converts, "sound", *(make.__name__ for make in makes))
    assert done.stdout.split()[-4:] == ["2"] * 4, done.stdout
    assert "has no Landlock" in done.stderr and all(OUTSIDE[make] in done.stderr for make in makes), done.stderr
    assert [path.name for path in folder.glob("*.csv")] == ["sound.csv"]


def test_a_kernel_without_landlock_opens_nothing(folder):
    opens = """
from hil.record.confined_reader import confine
print(confine(0))
try: open(sys.argv[1])
except OSError as error: print(error.strerror)
"""
    done = _without_landlock(opens, str(folder / "secret"))
    assert done.stdout == "False\nToo many open files\n", done.stderr


def test_a_compressed_text_that_unpacks_to_much_more_is_refused(folder, refused):
    head = gzip.compress(b"time [s],flow [l/min]\n0,1\n0.1,2\n")
    (folder / "made.csv.gz").write_bytes(head + gzip.compress(b"0" * (1 << 20)) * 300)
    err = refused("convert", "made.csv.gz", "out.csv")
    assert "unpacks to more than is read; 315.7 kB may unpack to 268.4 MB on this computer" in err


def test_a_text_that_is_one_line_is_refused(folder):
    (folder / "made.csv").write_bytes(b"a" * (1 << 20))
    with pytest.raises(FileError, match="its first line is longer than 65536 bytes"):
        read_recording(folder / "made.csv")


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".lvm", ".h5", ".mat", ".mf4", ".tdms", ".parquet", ".mcap"])
def test_what_is_no_file_is_not_waited_for(suffix, folder):
    os.mkfifo(folder / f"pipe{suffix}")
    with pytest.raises(FileError, match=f"pipe{suffix}: is a pipe; only regular files"):
        read_recording(folder / f"pipe{suffix}")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(f"socket{suffix}")
        with pytest.raises(FileError, match=f"socket{suffix}: is a socket"):
            read_recording(f"{folder}/socket{suffix}")
    with (folder / f"sparse{suffix}").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(FileError, match=f"sparse{suffix}: has 1100 GB; at most"):
        read_recording(folder / f"sparse{suffix}")


def _in_confinement(program: str, *words: str) -> str:
    start = "import os, sys\nfrom hil.record.confined_reader import confine\nprint(confine(0))\n"
    done = subprocess.run([sys.executable, "-c", start + program, *words], capture_output=True, text=True)
    return done.stdout + done.stderr


def test_confine_leaves_nothing_to_open(folder):
    program = """
import socket
for flags in (os.O_RDONLY, os.O_WRONLY | os.O_CREAT):
    try: os.open(sys.argv[1], flags)
    except OSError: print("refused")
try: os.listdir("/")
except OSError: print("refused")
try: os.execv("/bin/sh", ["sh", "-c", "echo executed"])
except PermissionError: print("refused")
"""
    told_ = _in_confinement(program, str(folder / "secret"))
    if told_.startswith("False"):
        pytest.skip("this kernel has no Landlock")
    assert told_ == "True\n" + "refused\n" * 4


def test_confine_bounds_memory_and_writing(folder):
    program = """
handle = int(sys.argv[1])
try: bytearray(1 << 30)
except MemoryError: print("refused")
import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
try: os.write(handle, b"x")
except OSError: print("refused")
"""
    with (folder / "out").open("wb") as file:
        start = "import os, sys\nfrom hil.record.confined_reader import confine\nconfine(0)\n"
        done = subprocess.run(
            [sys.executable, "-c", start + program, str(file.fileno())],
            pass_fds=[file.fileno()], capture_output=True, text=True,
        )  # fmt: skip
    assert done.stdout == "refused\nrefused\n", done.stderr


def _readers() -> list[int]:
    """Process numbers of the reader that this program has started."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            is_reader = b"hil.record.confined_reader" in (process / "cmdline").read_bytes()
            parent = int((process / "stat").read_text().rpartition(")")[2].split()[1])
        except (OSError, IndexError):
            continue
        found += [int(process.name)] if is_reader and parent == os.getpid() else []
    return found


def test_many_files_need_one_reader_and_one_that_was_ended_is_started_anew(folder):
    write_recording(_rows(), folder / "made.h5")
    assert len(read_recording(folder / "made.h5")) == 50
    (reader,) = _readers()
    os.kill(reader, signal.SIGKILL)
    os.waitid(os.P_PID, reader, os.WEXITED | os.WNOWAIT)
    for _ in range(3):
        assert len(read_recording(folder / "made.h5")) == 50
    assert len(_readers()) == 1


def test_what_is_shared_and_odd_comes_back(folder):
    with h5py.File(folder / "made.h5", "w") as file:
        file["time"], file["flow"] = TIME_S, np.ones(len(TIME_S), ">f4")
        file["remark"] = np.array(["a"] * len(TIME_S), dtype=h5py.string_dtype())
        file["both"] = np.ones(len(TIME_S), dtype=[("x", "f8"), ("y", "S3")])
    found = read_recording(folder / "made.h5")
    assert found.values("flow").tolist() == [1.0] * len(TIME_S)
    assert any("remark" in sentence for sentence in found.meta["assumed"])


@pytest.mark.parametrize("suffix", [".csv.gz", ".csv", ".lvm", ".h5", ".mat", ".mf4", ".tdms", ".parquet", ".mcap"])
def test_a_damaged_file_is_refused_or_read(suffix, folder):
    """Cut off, overwritten, and with large numbers where sizes stand: drawn, the same each time."""
    path, drawn = folder / f"made{suffix}", np.random.default_rng(7)
    if suffix == ".lvm":
        head = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\nChannels\t1\n***End_of_Header***\n"
        path.write_text(f"{head}X_Value\tflow\n0.0\t1.0\n0.1\t2.0\n")
    else:
        write_recording(_rows(), path)
    sound = path.read_bytes()
    for _ in range(12):
        first, last = sorted(drawn.integers(0, len(sound), 2))
        for made in (sound[:first], sound[:first] + b"\xff" * 8 + sound[first + 8 :], sound[:first] + sound[last:]):
            path.write_bytes(made)
            with suppress(FileError):
                read_recording(path)
