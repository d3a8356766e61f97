"""A passport: made, read back by other libraries, checked, opened; and what is refused."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path
from xml.etree.ElementTree import fromstring

import pikepdf
import pytest
from pypdf import PdfReader

from hil.catalog import entries
from hil.errors import FileError, SettingError
from hil.passport.contents import lay_out
from hil.passport.issue import Wanted, issue
from hil.passport.key import read_certificates, read_key, signing_key
from hil.passport.unit import read_unit_runs
from hil.passport.verify import SignatureStatus, Trust, opened, verify
from hil.record.folder import read
from hil.record.state import state_folder
from tests.certificates import holder
from tests.conftest import STRANGER
from tests.passports import run_of

# on one worker: its passport is issued once
pytestmark = [pytest.mark.xdist_group("passport"), pytest.mark.usefixtures("lab")]

WITHOUT_MODEL = Wanted(identify=False)
SPACE = {"dcc": "https://ptb.de/dcc", "si": "https://ptb.de/si"}


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A folder with the state of a computer, on which the procedure of the runs is installed."""
    folder = tmp_path_factory.mktemp("lab")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(STRANGER))
        patch.setenv("HIL_STATE_DIR", str(folder / "state"))
        entries.cache_clear()
        yield folder
    entries.cache_clear()


@pytest.fixture(scope="module")
def made(lab):
    """A passport that nobody changes, beside its run."""
    issue([run_of(lab)], lab / "unit.pdf", signing_key(None), WITHOUT_MODEL)
    return lab / "unit.pdf"


def own() -> list[object]:
    return read_certificates(state_folder() / "passport-certificate.pem")


def test_after_signing_it_is_still_pdf_a_3b_with_everything_that_asks_for(made):
    with pikepdf.open(made) as pdf:
        with pdf.open_metadata() as xmp:
            assert (xmp["pdfaid:part"], xmp["pdfaid:conformance"]) == ("3", "B")
        (intent,) = pdf.Root.OutputIntents
        assert intent.S == "/GTS_PDFA1" and len(intent.DestOutputProfile.read_bytes()) > 128
        fonts = [o for o in pdf.objects if isinstance(o, pikepdf.Dictionary) and o.get("/Type") == "/FontDescriptor"]
        assert fonts
        for font in fonts:
            assert any(key in font for key in ("/FontFile", "/FontFile2", "/FontFile3")), font.FontName
        relations = {str(one.UF): str(one.AFRelationship) for one in pdf.Root.AF}
        assert relations["certificate.xml"] == relations["passport.json"] == "/Data"
        assert relations["runs/run/samples.f8"] == "/Source"
        assert set(relations) == set(pdf.attachments)
        assert "/Encrypt" not in pdf.trailer


def test_checksums_inside_are_those_of_the_files(made):
    import hashlib

    with pikepdf.open(made) as pdf:
        said = json.loads(pdf.attachments["passport.json"].get_file().read_bytes())
        assert said["schema"] == "hil.passport/1" and said["serial"] == "SN-7" and said["verdict"] == "pass"
        assert len(said["files"]) == len(pdf.attachments) - 1
        for one in said["files"]:
            inside = pdf.attachments[one["name"]].get_file().read_bytes()
            assert hashlib.sha256(inside).hexdigest() == one["sha256"]


def test_the_digital_certificate_says_the_same_in_si_units(made):
    with pikepdf.open(made) as pdf:
        root = fromstring(pdf.attachments["certificate.xml"].get_file().read_bytes())
    assert root.get("schemaVersion") == "3.2.1"
    real = root.find(".//si:real", SPACE)
    assert real is not None
    assert float(real.findtext("si:value", "", SPACE)) == pytest.approx(50.0 / 60000.0)
    assert real.findtext("si:unit", "", SPACE) == r"\metre\tothe{3}\second\tothe{-1}"
    assert float(real.findtext("si:expandedUnc/si:uncertainty", "", SPACE)) == pytest.approx(1.0 / 60000.0, rel=1e-6)
    assert [one.text for one in root.iterfind(".//dcc:conformity", SPACE)] == ["pass", "pass"]


def test_who_signed_is_known_on_his_own_machine_and_nowhere_else(made, tmp_path):
    content = made.read_bytes()
    (certificate,) = own()
    assert verify(content, Trust([certificate])).outcome is SignatureStatus.SOUND
    stranger = verify(content, Trust())
    assert stranger.outcome is SignatureStatus.UNKNOWN_SIGNER and stranger.exit_status == 1
    assert len(stranger.fingerprint.replace(" ", "")) == 64


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: b"\n" + c, "before its header"),
        (lambda c: c + b"\n", "after its end mark"),
        (lambda c: c + c[-700:], "whole file"),
        (lambda c: c[:-200], "end mark"),
        (lambda c: c[: (i := c.rfind(b"0>\n/ByteRange"))] + b"1" + c[i + 1 :], "padding"),
        (lambda c: c.replace(b"/Contents <3082", b"/Contents <308 ", 1), "digits"),
    ],
)
def test_what_the_signature_does_not_cover_is_found(made, change, says):
    changed = verify(change(made.read_bytes()), Trust(own()))
    assert changed.outcome is SignatureStatus.CHANGED and says in changed.sentence


def test_a_title_changed_by_an_update_is_found(made):
    from pyhanko.pdf_utils.generic import NameObject, TextStringObject
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

    update, again = IncrementalPdfFileWriter(io.BytesIO(made.read_bytes())), io.BytesIO()
    update.root[NameObject("/Lang")] = TextStringObject("de")
    update.update_root()
    update.write(again)
    assert again.getvalue().startswith(made.read_bytes()) and len(again.getvalue()) > made.stat().st_size
    assert verify(again.getvalue(), Trust(own())).outcome is SignatureStatus.CHANGED


@pytest.mark.parametrize("content", [b"", b"%PDF-1.7\n%%EOF\n", b"PK\x03\x04"])
def test_what_is_no_passport_is_called_that(content):
    assert verify(content, Trust()).exit_status == 2


def test_openssl_takes_the_signature_too(made, tmp_path):
    """By a program that shares no code with the signer."""
    from hil.passport.seal import seal_of

    content = made.read_bytes()
    begin, end = seal_of(content).field
    padded = bytes.fromhex(content[begin + 1 : end - 1].decode())
    (tmp_path / "cms.der").write_bytes(padded[: 4 + int.from_bytes(padded[2:4], "big")])
    (tmp_path / "covered").write_bytes(content[:begin] + content[end:])
    line = ["openssl", "cms", "-verify", "-binary", "-inform", "DER", "-in", "cms.der", "-content", "covered",
            "-CAfile", str(state_folder() / "passport-certificate.pem"), "-purpose", "any", "-out", "out"]  # fmt: skip
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_lab_key_of_a_lab_authority_is_known_by_the_authority(tmp_path):
    authority, lab = _lab(tmp_path)
    out = tmp_path / "unit.pdf"
    issue([run_of(tmp_path)], out, read_key(lab), WITHOUT_MODEL)
    assert verify(out.read_bytes(), Trust(read_certificates(authority))).outcome is SignatureStatus.SOUND
    assert verify(out.read_bytes(), Trust()).outcome is SignatureStatus.UNKNOWN_SIGNER


def test_opened_it_gives_back_run_folders_that_read(made, tmp_path):
    content, found = opened(made)
    assert found.is_as_signed
    (run,) = lay_out(content, tmp_path / "laid")
    assert read(run).meta["operator"] == "A. Muster"
    assert (run / "samples.f8").read_bytes() == (made.parent / "run" / "samples.f8").read_bytes()
    assert (tmp_path / "laid" / "passport.pdf").read_bytes() == content
    with pytest.raises(FileError, match="there already"):
        lay_out(content, tmp_path / "laid")


@pytest.mark.parametrize("name", ["../out.txt", "/etc/out.txt", "a/../../out.txt", "C:\\out.txt", "a//b", "a\nb"])
def test_no_name_inside_leads_out_of_the_folder(tmp_path, name):
    pdf = pikepdf.new()
    pdf.add_blank_page()
    pdf.attachments[name] = pikepdf.AttachedFileSpec(pdf, b"x", filename=name)
    made = io.BytesIO()
    pdf.save(made)
    with pytest.raises(FileError, match="no path inside"):
        lay_out(made.getvalue(), tmp_path / "laid")
    assert not (tmp_path / "laid").exists() and not (tmp_path / "out.txt").exists()


def test_names_are_left_out_of_every_file_inside(tmp_path):
    out = tmp_path / "unit.pdf"
    issue([run_of(tmp_path)], out, signing_key(None), Wanted(names=False, identify=False))
    with pikepdf.open(out) as pdf:
        for name, one in pdf.attachments.items():
            assert b"Muster" not in one.get_file().read_bytes(), name
    (run,) = lay_out(out.read_bytes(), tmp_path / "laid")
    assert "operator" not in read(run).meta


def test_runs_of_two_units_or_of_none_are_refused(tmp_path):
    with pytest.raises(SettingError, match="SN-7, SN-8"):
        read_unit_runs([run_of(tmp_path, name="a"), run_of(tmp_path, "SN-8", name="b")])
    with pytest.raises(SettingError, match="--serial"):
        read_unit_runs([run_of(tmp_path, "", name="c")])


def test_several_runs_have_the_worst_verdict_of_all(tmp_path):
    unit = read_unit_runs([run_of(tmp_path, name="later", hour=11, gain=70.0), run_of(tmp_path, name="first")])
    assert unit.verdict == "fail"
    assert [run.folder.name for run in unit.runs] == ["first", "later"]


def test_a_passed_run_beside_one_that_was_stopped_passes_nowhere_in_the_file(tmp_path):
    stopped = run_of(tmp_path, name="stopped", hour=11, outcome="tripped: over-pressure", limited=False)
    out = tmp_path / "unit.pdf"
    found = issue([run_of(tmp_path, name="first"), stopped], out, signing_key(None), WITHOUT_MODEL)
    assert found.unit.verdict == "cannot tell" and not found.unit.finished
    with pikepdf.open(out) as pdf:
        texts = {name: attached.get_file().read_bytes() for name, attached in pdf.attachments.items()}
    (conformity, *_), (content, *_) = (
        [one.text for one in fromstring(texts["certificate.xml"]).iterfind(f".//dcc:statements//dcc:{tag}", SPACE)]
        for tag in ("conformity", "declaration/dcc:content")
    )
    assert conformity != "pass" and content is not None
    assert content.startswith("cannot tell") and "did not end as planned" in content
    assert json.loads(texts["passport.json"])["verdict"] == "cannot tell"


def test_where_nothing_was_judged_values_begin_on_page_one_and_each_page_says_its_number(made, tmp_path):
    found = issue([run_of(tmp_path, limited=False)], tmp_path / "unit.pdf", signing_key(None), WITHOUT_MODEL)
    assert found.unit.verdict is None
    judged, unjudged = (
        [page.extract_text() for page in PdfReader(path).pages] for path in (made, tmp_path / "unit.pdf")
    )
    assert len(unjudged) == len(judged) - 1
    for pages in (judged, unjudged):
        assert all(f"page {n} of {len(pages)}" in text for n, text in enumerate(pages, 1))


def test_page_one_says_why_there_is_no_model(tmp_path):
    found = issue([run_of(tmp_path)], tmp_path / "unit.pdf", signing_key(None))
    assert "names no plant" in found.understood.says and "--model" in found.understood.says


def test_the_key_of_this_machine_is_made_once_and_read_by_its_owner_only():
    first, second = signing_key(None), signing_key(None)
    assert first.certificate == second.certificate
    assert (state_folder() / "passport-key.pem").stat().st_mode & 0o077 == 0


def test_a_file_without_a_key_is_refused_by_name(tmp_path):
    path = tmp_path / "key.pem"
    path.write_text("nothing")
    with pytest.raises(FileError, match="HIL_KEY_PASSPHRASE"):
        read_key(path)


def _lab(folder: Path) -> tuple[Path, Path]:
    """(certificate of an authority, PKCS #12 file of a lab whose certificate it signed)."""
    from cryptography.hazmat.primitives.asymmetric import rsa
    from cryptography.hazmat.primitives.serialization import NoEncryption, pkcs12

    root = holder("Authority", authority=True)
    lab = holder("Lab 12", root, key=rsa.generate_private_key(65537, 2048))
    (folder / "authority.pem").write_bytes(root.certificate_pem)
    packed = pkcs12.serialize_key_and_certificates(b"lab", lab.key, lab.certificate, None, NoEncryption())
    (folder / "lab.p12").write_bytes(packed)
    return folder / "authority.pem", folder / "lab.p12"


def test_a_plant_named_as_an_installed_model_is_found(tmp_path):
    from dataclasses import replace

    from hil.passport.identified import understood
    from hil.passport.unit import Unit

    run = read_unit_runs([run_of(tmp_path)]).runs[0]
    valve = {"name": "EFC", "serial": "SN-7", "plant": "efc-good"}  # of another valve: nothing is fitted here
    named = replace(run, recording=replace(run.recording, meta={**run.recording.meta, "valve": valve}))
    says = understood(Unit("SN-7", (named,)), True, None, lambda _done, _text: None).says
    assert "could not be identified from these runs" in says and "no plant named" not in says


def test_a_program_that_has_verified_can_sign(tmp_path):
    sample = Path(__file__).parents[1] / "samples" / "8f99e50"
    program = (
        "from pathlib import Path; import sys\n"
        "from hil.passport.issue import Wanted, issue\n"
        "from hil.passport.key import signing_key\n"
        "from hil.passport.verify import own_trust, verify\n"
        "sample, out = map(Path, sys.argv[1:])\n"
        "verify((sample / 'passport.pdf').read_bytes(), own_trust())\n"
        "issue([sample / 'runs' / 'spring'], out, signing_key(None), Wanted(identify=False))\n"
    )
    command = [sys.executable, "-c", program, str(sample), str(tmp_path / "made.pdf")]
    ended = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
