"""A sensor's certificate as a channel's calibration: what is read of it, and what is refused."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from hil import api
from hil.bench.manual.certificate import unit_of
from hil.bench.read import read_bench
from hil.errors import FileError, SettingError
from hil.units import scale_and_offset
from tests.links import bench_text

WIDTH_2_1 = "<si:expandedUncXMLList><si:uncertaintyXMLList>{}</si:uncertaintyXMLList><si:coverageFactorXMLList>2"
WIDTH_2_1 += "</si:coverageFactorXMLList></si:expandedUncXMLList>"
WIDTH_2_2 = "<si:measurementUncertaintyUnivariateXMLList><si:expandedMUXMLList><si:valueExpandedMUXMLList>{}"
WIDTH_2_2 += "</si:valueExpandedMUXMLList><si:coverageFactorXMLList>2</si:coverageFactorXMLList></si:expandedMUXMLList>"
WIDTH_2_2 += "</si:measurementUncertaintyUnivariateXMLList>"


def column(kind: str, values: str, unit: str, width: str = "") -> str:
    """A quantity with a list of values."""
    inside = f"<si:valueXMLList>{values}</si:valueXMLList><si:unitXMLList>{unit}</si:unitXMLList>{width}"
    return f'<dcc:quantity refType="{kind}"><si:realListXMLList>{inside}</si:realListXMLList></dcc:quantity>'


def certificate(folder: Path, *tables: str) -> Path:
    """A certificate of a flow meter with these tables of results."""
    results = "".join(
        f"<dcc:result><dcc:name><dcc:content>table {k}</dcc:content></dcc:name><dcc:data><dcc:list>{one}</dcc:list>"
        "</dcc:data></dcc:result>"
        for k, one in enumerate(tables, 1)
    )
    path = folder / "sensor.xml"
    path.write_text(
        '<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si">'
        "<dcc:administrativeData><dcc:coreData><dcc:uniqueIdentifier>K-4711</dcc:uniqueIdentifier>"
        "<dcc:endPerformanceDate>2026-05-04</dcc:endPerformanceDate></dcc:coreData><dcc:calibrationLaboratory>"
        "<dcc:contact><dcc:name><dcc:content>Flow Lab</dcc:content></dcc:name></dcc:contact>"
        "</dcc:calibrationLaboratory></dcc:administrativeData><dcc:measurementResults><dcc:measurementResult>"
        f"<dcc:results>{results}</dcc:results></dcc:measurementResult></dcc:measurementResults>"
        "</dcc:digitalCalibrationCertificate>",
        encoding="utf-8",
    )
    return path


def bench(folder: Path) -> Path:
    """The HPV41's bench, whose flow meter gives 0 to 5 V."""
    path = folder / "bench.toml"
    path.write_text(bench_text("brevini-hpv41"), encoding="utf-8")
    return path


@pytest.mark.parametrize("width", [WIDTH_2_1, WIDTH_2_2])
def test_volts_beside_a_reference_are_the_line(tmp_path, width):
    """Reference in m³/s, 1e-3 m³/s = 60 l/min: 1 V stands for 10.1 l/min, and 0.5 l/min at 0 V; U = 0.12 l/min."""
    volts = "-8 -4 0 4 8"
    reference = " ".join(f"{(10.1 * float(v) + 0.5) / 60e3:.12g}" for v in volts.split())
    cubic = r"\metre\tothe{3}\second\tothe{-1}"
    table = column("basic_measuredValue", volts, r"\volt")
    table += column("basic_referenceValue", reference, cubic, width.format("2e-6"))
    found = api.calibrate(bench(tmp_path), "flow", certificate=certificate(tmp_path, table), valid_days=730)
    assert found.entry.slope == pytest.approx(10.1) and found.entry.offset == pytest.approx(0.5)
    assert found.entry.uncertainty == pytest.approx(0.12, rel=0.5) and found.entry.uncertainty >= 0.12
    assert (found.entry.date, found.entry.due) == (dt.date(2026, 5, 4), dt.date(2028, 5, 3))
    assert found.entry.source == "DCC K-4711, Flow Lab"


def test_indications_of_the_channel_itself_went_through_its_line(tmp_path):
    file = bench(tmp_path)
    before = read_bench(file).bench.channels["flow"].line
    table = column("basic_measuredValue", "-40 0 40", r"\litre\minute\tothe{-1}")
    table += column("basic_referenceValue", "-42 0 42", r"\litre\per\minute", WIDTH_2_1.format("0.1"))
    found = api.calibrate(file, "flow", certificate=certificate(tmp_path, table))
    assert found.line.slope == pytest.approx(1.05 * before.slope)
    assert found.line.offset == pytest.approx(1.05 * before.offset, abs=1e-9)


def test_the_command_writes_it_and_asks_for_nothing_else(tmp_path, command_line, refused):
    file = bench(tmp_path)
    one = column("basic_measuredValue", "-5 0 5", r"\volt")
    one += column("basic_referenceValue", "-51 0 51", r"\litre\minute\tothe{-1}", WIDTH_2_2.format("0.2"))
    command = ["calibrate", file, "flow", "--certificate", certificate(tmp_path, one, one), "--yes"]
    assert "holds the tables 'table 1', 'table 2'; name one" in refused(*command)
    found = command_line(*command, "--table", "table 2")
    assert found.status == 0 and "as the stated uncertainties make it" in found.out, found
    entry = read_bench(file).bench.channels["flow"]
    assert entry.calibration is not None and entry.calibration.slope == pytest.approx(10.2)
    refused(*command, "--reference", "meter 3")


VOLTS, REFERENCE = column("basic_measuredValue", "1 2 3", r"\volt"), "10 20 30"


@pytest.mark.parametrize(
    ("measured", "values", "width", "said"),
    [
        (column("basic_measuredValue", "1 2", r"\volt"), REFERENCE, "", "2 indications for 3 values of the reference"),
        (column("basic_measuredValue", "1 2 3", r"\kelvin"), REFERENCE, "", r"is in \\kelvin, which is not V or"),
        (column("basic_nominalValue", "1 2 3", r"\volt"), REFERENCE, "", "it has basic_nominalValue, basic_reference"),
        (VOLTS, "10 nan 30", "", "basic_referenceValue: nan is no value"),
        (VOLTS, "10 ten 30", "", "basic_referenceValue: could not convert string to float: 'ten'"),
        (VOLTS, REFERENCE, WIDTH_2_1.format("0.1 0.2"), "2 uncertainties or coverage factors for 3 values"),
        (VOLTS, REFERENCE, WIDTH_2_1.format("0.1").replace(">2<", ">0<"), "referenceValue: a coverage factor of 0"),
    ],
)  # fmt: skip
def test_what_does_not_fit_or_is_no_number_is_named(measured, values, width, said, tmp_path):
    table = measured + column("basic_referenceValue", values, r"\litre\minute\tothe{-1}", width)
    with pytest.raises(FileError, match=said):
        api.calibrate(bench(tmp_path), "flow", certificate=certificate(tmp_path, table))


def test_tables_of_one_name_are_two(tmp_path):
    table = VOLTS + column("basic_referenceValue", "10 20 30", r"\litre\minute\tothe{-1}")
    path = certificate(tmp_path, table, table)
    path.write_text(path.read_text("utf-8").replace("table 2", "table 1"), "utf-8")
    with pytest.raises(FileError, match="holds the tables 'table 1', 'table 1 2'"):
        api.calibrate(bench(tmp_path), "flow", certificate=path)
    with pytest.raises(SettingError, match="has its points and their uncertainty in it"):
        api.calibrate(bench(tmp_path), "flow", certificate=path, table="table 1", reference_uncertainty=0.2)


def test_neither_or_no_certificate_is_refused(tmp_path):
    file = bench(tmp_path)
    (tmp_path / "page.xml").write_text("<html/>", encoding="utf-8")
    with pytest.raises(FileError, match="is no Digital Calibration Certificate"):
        api.calibrate(file, "flow", certificate=tmp_path / "page.xml")
    with pytest.raises(SettingError, match="either reference"):
        api.calibrate(file, "flow")


@pytest.mark.parametrize(
    ("d_si", "unit"),
    [(r"\milli\bar", "mbar"), (r"\litre\minute\tothe{-1}", "l/min"), (r"\metre\tothe{3}\per\hour", "m^3/h"),
     (r"\degreecelsius", "°C"), (r"\kilo\pascal", "kPa"), (r"\newton\metre", "Nm")],
)  # fmt: skip
def test_units_are_those_of_d_si(d_si, unit):
    assert scale_and_offset(unit_of(d_si), unit) == pytest.approx((1.0, 0.0))
