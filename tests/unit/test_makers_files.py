"""EDS and DBC files as makers really write them come in; what of them cannot be understood is said."""

import os
import tomllib

import pytest

from drivers._can_messages import Received
from drivers._pdo_mapping import pdos_for
from hil.bench.fault import BenchError
from hil.description.can import database
from hil.description.canopen import dictionary
from hil.description.find import descriptions
from hil.description.first import GAP, first_description
from hil.description.read import read_description
from hil.errors import FileError
from sim_devices._eds import objects_of
from tests.described import written

EDS = """\
; Drucktransmitter, Messumformer für Öl
[FileInfo]
FileName=odd.eds
[DeviceInfo]
VendorName=Öl GmbH
VendorNumber=
BaudRate_10=
NrOfRXPDO=2
NrOfTXPDO=1
CompactPDO=3
stray text
[Comments]
Lines=3
Line1=one line of the three
[DummyUsage]
Dummy0005=0x1
[1000]
parametername=Device type
DATATYPE=0007
AccessType=RO
DefaultValue=0x00020194
[1018sub1]
ParameterName=Vendor
ObjectType=7
DataType=7
AccessType=ro
DefaultValue=10h
[6423]
ParameterName=Interrupt
DataType=0x0001
AccessType=rw
PDOMapping=1
[7130]
ParameterName=AI input PV
ObjectType=8
CompactSubObj=3
DataType=0x0003
AccessType=ro
PDOMapping=1
LowLimit=0x8000
HighLimit=0x7FFF
[7130Name]
NrOfEntries=1
2=Rücklauf
[2100SUB1]
ParameterName=Temperature
DataType=0x00A0
AccessType=rww
PDOMapping=1
Unit=degC
Factor=0.1
[A0sub1]
DefaultValue=0x0003
[2200]
ParameterName=Half
[2300]
ParameterName=Hidden
DataType=0x0006
AccessType=ro
[2300]
DataType=0x0007
"""
DCF = """\
[DeviceInfo]
[DeviceCommissioning]
nodeid=0AH
[1800]
ObjectType=9
[1800sub1]
DataType=7
DefaultValue=0x180 + $NodeID + 0x80000000
[1A00]
ObjectType=9
[1A00sub0]
DataType=5
DefaultValue=1
[1A00sub1]
DataType=7
DefaultValue=0x21000010
[1801]
ObjectType=9
[1801sub1]
DataType=7
DefaultValue=$NODEID+0x280
ParameterValue=0x1F0
[1A01]
ObjectType=9
[1A01sub0]
DataType=5
DefaultValue=1
[1A01sub1]
DataType=7
DefaultValue=0x22000010
[2100]
ParameterName=A
DataType=3
AccessType=ro
[2200]
ParameterName=B
DataType=3
AccessType=ro
"""
DBC = """\
VERSION ""
BO_ 2566834688 Pressures: 8 Pump
 SG_ Supply : 7|16@0- (.01,-.5) [-20|400] "bar" Bench
 SG_ Oil : 16|8@1+ (1,-40) [-40|210] "°C" Bench
BO_ 419385573 Forgotten: 8 Pump
 SG_ Flow : 0|32@1- (1,0) [0|0] "l/min" Bench
BO_ 1075054137 Nothing: 8 Pump
 SG_ X : 0|8@1+ (1,0) [0|0] "" Bench
BO_ 100 Paged: 8 Pump
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" Bench
 SG_ One m1 : 8|16@1- (0.1,0) [0|0] "bar" Bench
 SG_ Two m2 : 8|16@1- (0.1,0) [0|0] "bar" Bench
BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ Loose : 0|8@1+ (1,0) [0|0] "" Bench
CM_ SG_ "of no signal; with an end in it"
CM_ BO_ 100 "two
lines";
SIG_VALTYPE_ 419385573 Flow : 1;
SIG_VALTYPE_ 100 Gone : 1;
VAL_ 2566834688 Oil 255 "Not available" 254 "Sensor error"
VAL_ 100 Gone 1 "x" ;
"""
SENT = """\
protocol = "can"
summary = "x"
dbc = "odd.dbc"
{values}
[terminals.One]
direction = "out"
range = [0, 9]
message = "Paged"
signal = "One"
"""


def test_an_eds_with_the_faults_of_the_trade_is_read(tmp_path):
    path = tmp_path / "odd.eds"
    path.write_bytes(EDS.encode("cp1252"))
    objects = dictionary(str(path))
    assert objects[0x1000, 0].default == 0x00020194
    assert objects[0x1018, 1].default == 0x10, "a member without its head, 10h"
    assert [objects[0x7130, sub].name for sub in (1, 2, 3)] == ["AI input PV1", "Rücklauf", "AI input PV3"]
    assert objects[0x7130, 3].low == -32768
    assert objects[0x2100, 1].data_type == 3, "a type of the file's own stands for INTEGER16"
    assert objects[0x2300, 0].data_type == 6, "of what stands twice the first counts"
    assert set(objects.left_out) == {
        "line 11: no KEY=VALUE", "line 61: DataType stands twice, '0x0006' counts", "[2200] has no DataType",
    }  # fmt: skip


def test_a_node_reads_no_pipe_for_an_eds(tmp_path):
    os.mkfifo(tmp_path / "node.eds")
    with pytest.raises(FileError, match=r"node\.eds: is a pipe; only regular files"):
        objects_of(str(tmp_path / "node.eds"), 1)


def test_what_an_eds_does_not_say_is_marked(tmp_path):
    path = tmp_path / "odd.eds"
    path.write_bytes(EDS.encode("cp1252"))
    text = first_description(path)
    made = tomllib.loads(text)["terminals"]
    assert set(made) == {"AI input PV 1", "AI input PV Rücklauf 2", "AI input PV 3", "object 2100 Temperature 1"}
    assert made["object 2100 Temperature 1"] == {
        "direction": "out", "unit": "degC", "object": "2100.1", "slope": 0.1,
    }  # fmt: skip
    for said in (
        "# not understood: [2200] has no DataType", "# 6423.0 Interrupt: data type 0x01, which is not read",
        "# 1 more object is in no PDO", f"range = [-32768, 32767]   {GAP} the limits of its counts",
    ):  # fmt: skip
        assert said in text, said


def test_pdos_that_an_eds_only_counts_are_there(tmp_path):
    path = tmp_path / "odd.eds"
    path.write_bytes(EDS.encode("cp1252"))
    (pdo,) = pdos_for(dictionary(str(path)), 5, [(0x7130, 1), (0x7130, 2)], "sent")
    assert (pdo.identifier, pdo.places, pdo.as_file) == (0x185, ((0x7130, 1), (0x7130, 2)), False)
    (pdo,) = pdos_for(dictionary(str(path)), 5, [(0x2100, 1)], "received")
    assert pdo.identifier == 0x205


def test_a_dcf_says_its_node_and_values_go_before_defaults(tmp_path):
    objects = dictionary(str(written(tmp_path, "node.dcf", DCF)))
    assert objects.node_id == 10
    first, second = pdos_for(objects, 10, [(0x2100, 0), (0x2200, 0)], "sent")
    assert (first.identifier, second.identifier) == (0x18A, 0x1F0)


def test_a_file_without_a_section_is_no_eds(tmp_path):
    with pytest.raises(FileError, match="not an EDS or DCF: no \\[section\\] in it"):
        dictionary(str(written(tmp_path, "a.eds", "nothing\n")))


def test_an_eds_without_an_object_for_a_pdo_has_those_that_can_be_asked_for(tmp_path):
    text = "[DeviceInfo]\n[1000]\nParameterName=Type\nDataType=7\n"
    with pytest.raises(FileError, match="no object with a number beyond those of communication"):
        first_description(written(tmp_path, "none.eds", text))
    own = "[3000]\nParameterName=Temperature\nDataType=6\nUnit=degC\n"
    said = first_description(written(tmp_path, "some.eds", text + own))
    assert "# None of its objects can be in a PDO" in said
    assert tomllib.loads(said)["terminals"]["Temperature"]["object"] == "3000.0"


def test_a_dbc_with_the_faults_of_the_trade_is_read(tmp_path):
    path = written(tmp_path, "odd.dbc", DBC)
    found = database(str(path))
    assert [message.name for message in found.messages] == ["Pressures", "Forgotten", "Paged"]
    forgotten = found.get_message_by_name("Forgotten")
    assert forgotten.is_extended_frame and forgotten.frame_id == 419385573 and forgotten.signals[0].is_float
    supply = found.get_message_by_name("Pressures").get_signal_by_name("Supply")
    assert (supply.scale, supply.offset, supply.unit) == (0.01, -0.5, "bar")
    assert set(found.left_out) == {
        "Forgotten: 0x18ff50e5 has more than 11 bits and is taken for a 29-bit identifier",
        "message Nothing: no identifier can be 0x40140639",
        "SIG_VALTYPE_ of Gone: there is no such signal in message 100",
        "VAL_ of Gone: there is no such signal in message 100",
    }
    text = first_description(path)
    made = tomllib.loads(text)["terminals"]
    assert set(made) == {"Supply", "Oil", "Flow", "One", "Two"} and made["Oil"]["unit"] == "degC"
    assert made["Oil"]["invalid"] == {"255": "Not available", "254": "Sensor error"}
    assert f"# values = {{ Page = 0 }}   {GAP} where the bench sends it: which of its pages" in text


def test_counts_that_a_dbc_names_are_no_measurement_and_say_so(tmp_path):
    written(tmp_path, "odd.dbc", DBC)
    text = first_description(tmp_path / "odd.dbc").replace("# range = [0, 0]", "range = [0, 9]")
    told = read_description(written(tmp_path, "odd.toml", text))
    received = Received(told.database.get_message_by_name("Pressures"), told.about("Pressures"), False)
    oil, supply = told.terminals["Oil"], told.terminals["Supply"]
    received.take(bytes([0xFF, 0xF6, 254, 0, 0, 0, 0, 0]), 0.0)
    assert received.value(oil, 0.0) != received.value(oil, 0.0) and received.why_none(oil) == "Sensor error"
    assert received.value(supply, 0.0) == pytest.approx(-0.6) and not received.why_none(supply)
    received.take(bytes([0xFF, 0xF6, 100, 0, 0, 0, 0, 0]), 0.0)
    assert received.value(oil, 0.0) == 60.0 and not received.why_none(oil)


def test_a_page_that_the_file_does_not_have_is_passed_over(tmp_path):
    path = written(tmp_path, "odd.dbc", DBC)
    paged = database(str(path)).get_message_by_name("Paged")
    told = read_description(
        written(tmp_path, "odd.toml", first_description(path).replace("# range = [0, 0]", "range = [0, 9]"))
    )
    received = Received(paged, told.about("Paged"), False)
    received.take(bytes([1, 10, 0, 0, 0, 0, 0, 0]), 0.0)
    received.take(bytes([77, 99, 9, 0, 0, 0, 0, 0]), 0.1)
    assert received.value(told.terminals["One"], 0.2) == 1.0


@pytest.mark.parametrize(
    ("values", "wrong"),
    [
        ("", r"Paged has pages, told apart by Page: say under \[messages.Paged\] values = { Page = … }, one of 1, 2"),
        ("[messages.Paged]\nvalues = { Page = 3 }", "Paged has pages"),
        ("[messages.Paged]\nvalues = { Page = 2 }", "One is not on the page that values choose; it is on 1"),
    ],
)
def test_a_message_with_pages_is_sent_as_one_of_them(tmp_path, values, wrong):
    written(tmp_path, "odd.dbc", DBC)
    with pytest.raises(BenchError, match=wrong):
        read_description(written(tmp_path, "sent.toml", SENT.format(values=values)))


def test_a_message_whose_page_is_said_is_sent(tmp_path):
    written(tmp_path, "odd.dbc", DBC)
    read_description(written(tmp_path, "right.toml", SENT.format(values="[messages.Paged]\nvalues = { Page = 1 }")))


def test_a_dbc_without_signals_says_so(tmp_path):
    with pytest.raises(FileError, match="no message with a signal in it"):
        first_description(written(tmp_path, "empty.dbc", 'CM_ "IMPORT other.dbc"\n'))


def test_each_input_of_a_row_has_a_flag_of_its_own():
    terminals = read_description(descriptions()["adam-6024"]).by_name
    assert {flag.address for flag in terminals["ai0"].status} == {20}
    assert {flag.address for flag in terminals["ai5"].status} == {25}, "40026, as the manual has it"
