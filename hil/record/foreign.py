"""Files of kinds that are not read: what each is, by its first bytes or its ending, and what to export instead."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path
from typing import BinaryIO

from hil.errors import FileError, reason
from hil.record.exchange.comtrade import CHANNELS
from hil.record.gathered import whole

_LONGEST = 128
_TEXT = "export CSV"
_BEGINNINGS = {
    b"%PDF": ("a PDF", "it shows samples and holds none; ask for the file that it was printed from"),
    b"\x89PNG": ("a picture", "ask for the file that it was drawn from"),
    b"\xff\xd8\xff": ("a picture", "ask for the file that it was drawn from"),
    b"|CF,": ("a FAMOS file of imc", f"{_TEXT} or MDF4 from FAMOS"),
    b"SQLite format 3": ("an SQLite database", f"{_TEXT}, one row for each stamp"),
    b"ARROW1": ("an Arrow or Feather file", f"write Parquet, or {_TEXT}"),
    b"#ROSBAG": ("a ROS bag", f"{_TEXT} from PlotJuggler"),
    b"\xd4\xc3\xb2\xa1": ("a capture of network packets", f"{_TEXT} of the decoded signals"),
    b"\x0a\x0d\x0d\x0a": ("a capture of network packets", f"{_TEXT} of the decoded signals"),
    b"Rar!": ("a RAR archive", "unpack it"),
    b"7z\xbc\xaf\x27\x1c": ("a 7-Zip archive", "unpack it"),
    b"SIMPLE  =": ("a FITS file", _TEXT),
    b"***BUSMASTER": ("a CAN log of BUSMASTER", "convert it to ASC there, and put its DBC beside"),
    b"@ TEXT @": ("a trace of CarBus Analyzer", "save the log as ASC or candump, and put its DBC beside"),
    b"PathFileType": ("a table of marker positions", f"{_TEXT} with one row of headings"),
    b"Origin Time ": ("an accelerogram of K-NET, several samples on a line", f"{_TEXT}, one sample on a line"),
    b"$date": ("a dump of logic signals (VCD)", f"{_TEXT}, one row for each stamp"),
    b"$GP": ("a log of a satellite receiver (NMEA 0183)", f"{_TEXT} of its positions"),
    b"~V": ("a well log over depth (LAS)", f"{_TEXT} of what lies over time"),
    b"* Sea-Bird": ("a recording of Sea-Bird (CNV)", f"{_TEXT}, with headings"),
    b"<html": ("a web page", "save it as XLSX or CSV"),
    b"<?xml": ("an XML file", "export CSV, TDMS or MDF4"),
    b"{": ("a JSON file", _TEXT),
}
_WITHIN = {
    b", SLIST, ": ("a list of samples without stamps, several on a line", "export TSPAIR, or CSV"),
    b"WAVEDESC": ("a waveform of LeCroy", "save it as ASCII at the scope"),
    b"FMT, 128, 89, FMT,": ("a flight log of ArduPilot", f"{_TEXT} of one of its messages, as mavlogdump does"),
}
_ENDINGS = {
    (".dxd", ".dxz", ".d7d", ".d7z"): ("a recording of Dewesoft", f"{_TEXT}, MAT or MDF4 from DewesoftX"),
    (".wfm", ".isf", ".trc"): ("a scope's own waveform file", "save as CSV, at the scope or in its maker's program"),
    (".tdm", ".tdx"): ("a recording of DIAdem", "save it as TDMS"),
    (".raw",): ("a raw file of FAMOS or of a circuit simulator", f"{_TEXT} there"),
    (".bin",): ("a program's own binary file", f"{_TEXT}, MAT, TDMS or MDF4 from that program"),
    (".svd", ".svdx", ".tcscope"): ("a recording of TwinCAT Scope", f"{_TEXT} from its export wizard"),
    (".trace", ".scope"): ("a drive's own trace", _TEXT),
    (".sie", ".rsp", ".rpc", ".tim", ".drv"): ("a fatigue rig's recording", f"{_TEXT} or MAT from its program"),
    (".s1p", ".s2p", ".s3p", ".s4p", ".cti"): (
        "a table of scattering parameters",
        f"{_TEXT} of one over another: frequency, and real and imaginary part",
    ),
    (".arff",): ("a table of Weka", f"{_TEXT} there"),
    (".tsf",): ("a set of series", f"{_TEXT} of one, with its stamps"),
    (".influx", ".lp"): ("InfluxDB's line protocol", f"{_TEXT}, one row for each stamp"),
    (".pdf", ".docx", ".doc", ".pptx"): ("a document", "ask for the file that its figures were drawn from"),
    (".mldatx", ".slx"): ("a file of Simulink", "save the signals as a MAT file"),
    (".jpg", ".jpeg", ".gif", ".bmp", ".svg"): ("a picture", "ask for the file that it was drawn from"),
    (".json", ".yaml", ".yml", ".xml"): ("a file of settings or objects", _TEXT),
    (".npy", ".npz", ".pkl", ".pickle"): ("arrays of Python", "write CSV, HDF5 or Parquet from there"),
}


def check_read(path: Path, file: BinaryIO, *, by_ending: bool) -> None:
    """Raise `FileError` for a file of a kind that is known, and not read.

    Args:
        path: of it.
        file: it, open.
        by_ending: whether its ending counts as well, since no reader has it.
    """
    start = os.pread(file.fileno(), _LONGEST, 0)
    described = path.with_suffix(".cfg")
    if path.suffix.lower() == ".dat" and described.is_file() and CHANNELS.match(whole(described)):
        raise FileError(f"{path}: holds the samples of a COMTRADE recording; give {described.name}, which describes it")
    if by_ending and start.startswith(b"PK\x03\x04"):
        raise FileError(f"{path}: {_packed(file)}")
    found = next((kind for beginning, kind in _BEGINNINGS.items() if start.startswith(beginning)), None)
    found = found or next((kind for part, kind in _WITHIN.items() if part in start), None)
    if found is None and by_ending:
        found = next((kind for endings, kind in _ENDINGS.items() if path.name.lower().endswith(endings)), None)
    if found is not None:
        raise FileError(f"{path}: is {found[0]}, which is not read; {found[1]}")


def _packed(file: BinaryIO) -> str:
    """What is said of an archive: what it holds, and to unpack it."""
    try:
        with zipfile.ZipFile(file) as archive:
            names = [one.filename for one in archive.infolist() if not one.is_dir()]
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        return f"is a damaged ZIP archive: {reason(error)}"
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"is a ZIP archive of {', '.join(names[:3]) or 'nothing'}{more}; unpack it and give one of its files"
