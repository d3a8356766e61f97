"""Whose signature counts, and when: authorities, leaves, clocks, expired and revoked certificates, changed files."""

from __future__ import annotations

import io
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import pikepdf
import pytest

from hil.errors import FileError, InputError, SettingError
from hil.passport.issue import Wanted, issue
from hil.passport.key import SigningKey, fingerprint, signing_key
from hil.passport.revoked import Revoked, read_revocations
from hil.passport.sign import signed
from hil.passport.verify import SignatureStatus, Trust, verify
from tests.certificates import DAY, NOW, Holder, holder
from tests.passports import run_of

pytestmark = pytest.mark.xdist_group("signers")  # on one worker: its passport is issued once


def key_of(who: Holder) -> SigningKey:
    return SigningKey(who.key, who.certificate)


@pytest.fixture(scope="module")
def unsigned(tmp_path_factory):
    """The pages of a passport before they are signed."""
    from tests.conftest import STRANGER

    folder, kept = tmp_path_factory.mktemp("unit"), []
    with pytest.MonkeyPatch.context() as patch:
        from hil.catalog import entries

        patch.syspath_prepend(str(STRANGER))
        patch.setenv("HIL_STATE_DIR", str(folder / "state"))
        entries.cache_clear()
        patch.setattr("hil.passport.issue.signed", lambda pdf, key: kept.append(pdf) or signed(pdf, key))
        issue([run_of(folder)], folder / "unit.pdf", signing_key(None), Wanted(identify=False))
    entries.cache_clear()
    return kept[0]


@pytest.fixture
def at(monkeypatch):
    """Sign at another time, as a computer with another clock does."""

    def sign(pdf, who, moment):
        with monkeypatch.context() as clock:
            clock.setattr("pyhanko.sign.signers.pdf_signer.datetime", _clock(moment))
            return signed(pdf, key_of(who))

    return sign


def _clock(moment: datetime):
    class Clock(datetime):
        @classmethod
        def now(cls, tz=None):
            return moment.astimezone(tz)

    return Clock


def said(found, *words: str) -> bool:
    return all(word in found.sentence for word in words)


# -- who vouches for whom ----------------------------------------------------------------------------------


@pytest.mark.parametrize("bare", [False, True])
def test_a_leaf_that_is_trusted_vouches_for_itself_alone(unsigned, bare):
    leaf = holder("Lab 12", bare=bare)
    under = holder("Somebody", leaf)
    if not bare:
        assert verify(signed(unsigned, key_of(leaf)), Trust([leaf.certificate])).outcome is SignatureStatus.SOUND
    found = verify(signed(unsigned, key_of(under)), Trust([leaf.certificate]))
    assert found.outcome is SignatureStatus.UNKNOWN_SIGNER and found.exit_status == 1


def test_an_authority_vouches_through_those_between_and_a_leaf_between_does_not(unsigned):
    root = holder("Root", authority=True)
    between, leaf = holder("Between", root, authority=True), holder("Leaf", root)
    lab, under = holder("Lab 12", between), holder("Somebody", leaf)
    assert verify(signed(unsigned, key_of(lab)), Trust([root.certificate])).outcome is SignatureStatus.UNKNOWN_SIGNER
    for trusted in ([root, between], [between], [lab]):
        trust = Trust([one.certificate for one in trusted])
        assert verify(signed(unsigned, key_of(lab)), trust).outcome is SignatureStatus.SOUND
    trust = Trust([root.certificate, leaf.certificate])
    assert verify(signed(unsigned, key_of(under)), trust).outcome is SignatureStatus.UNKNOWN_SIGNER


def test_another_key_under_the_name_of_a_known_one_is_unknown(unsigned, caplog):
    known, other = holder("Lab 12"), holder("Lab 12")
    assert verify(signed(unsigned, key_of(other)), Trust([known.certificate])).outcome is SignatureStatus.UNKNOWN_SIGNER
    assert not caplog.records  # a record that nobody handles is a trace on the terminal


# -- when --------------------------------------------------------------------------------------------------


def test_the_time_of_a_signature_is_told(unsigned):
    lab = holder("Lab 12")
    found = verify(signed(unsigned, key_of(lab)), Trust([lab.certificate]))
    assert found.signed_utc is not None and abs(found.signed_utc - datetime.now(UTC)) < timedelta(minutes=5)


def test_a_signature_from_2099_is_not_sound_and_says_its_time(unsigned, at):
    lab = holder("Lab 12", valid=(NOW - DAY, datetime(2120, 1, 1, tzinfo=UTC)))
    found = verify(at(unsigned, lab, datetime(2099, 1, 1, tzinfo=UTC)), Trust([lab.certificate]))
    assert found.outcome is SignatureStatus.NOT_VALID_THEN and found.exit_status == 1 and found.is_as_signed
    assert said(found, "2099-01-01", "has not come")


@pytest.mark.parametrize(
    ("valid", "outcome"),
    [
        ((NOW - 900 * DAY, NOW - 10 * DAY), SignatureStatus.SOUND),  # signed while it held, read when it does no longer
        ((NOW - 900 * DAY, NOW - 50 * DAY), SignatureStatus.NOT_VALID_THEN),
        ((NOW - 20 * DAY, NOW + 900 * DAY), SignatureStatus.NOT_VALID_THEN),
    ],
)
@pytest.mark.parametrize("by_authority", [False, True])
def test_an_expired_certificate_counts_for_the_time_in_which_it_held(unsigned, at, valid, outcome, by_authority):
    root = holder("Root", authority=True)
    lab = holder("Lab 12", root if by_authority else None, valid=valid)
    trust = Trust([(root if by_authority else lab).certificate])
    found = verify(at(unsigned, lab, NOW - 30 * DAY), trust)
    assert found.exit_status == (0 if outcome is SignatureStatus.SOUND else 1)
    assert by_authority or (
        found.outcome is outcome and (outcome is SignatureStatus.SOUND or said(found, "did not hold"))
    )


def test_nobody_signs_with_a_certificate_that_has_expired(tmp_path, stranger):
    lab = holder("Lab 12", valid=(NOW - 20 * DAY, NOW - DAY))
    with pytest.raises(InputError, match=r"own check says: .* did not hold"):
        issue([run_of(tmp_path)], tmp_path / "unit.pdf", key_of(lab), Wanted(identify=False))
    assert not (tmp_path / "unit.pdf").exists()


@pytest.mark.parametrize(
    ("received", "outcome"),
    [(None, 1), (NOW - 25 * DAY, 0), (NOW - 5 * DAY, 1), (NOW - 40 * DAY, 1)],
    ids=["nobody says", "before it was revoked", "after it was revoked", "before it was signed"],
)
@pytest.mark.parametrize("whose", ["the signer's", "the authority's"])
def test_a_key_is_revoked_from_a_date_on(unsigned, at, received, outcome, whose):
    root = holder("Root", authority=True)
    lab = holder("Lab 12", root)
    revoked = {fingerprint((lab if whose == "the signer's" else root).certificate): Revoked(NOW - 10 * DAY, "stolen")}
    found = verify(at(unsigned, lab, NOW - 30 * DAY), Trust([root.certificate], revoked, received))
    assert found.exit_status == outcome, found.sentence
    if received is None:
        assert said(found, "revoked from", "(stolen)", "is the word of whoever has the key", "--received")
    late = verify(at(unsigned, lab, NOW - 2 * DAY), Trust([root.certificate], revoked, NOW))
    assert late.exit_status == 1 and said(late, "revoked from", "signed on")


def test_revoked_certificates_are_read_from_a_file_that_says_where_it_is_wrong(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path))
    assert read_revocations(None) == {}
    digits = fingerprint(holder("Lab 12").certificate)
    colons = ":".join(digits.replace(" ", "")[i : i + 2].upper() for i in range(0, 64, 2))
    for written in (digits, digits.replace(" ", ""), colons):
        (tmp_path / "revoked.txt").write_text(f"# lost keys\n\n{written} 2026-12-01 laptop stolen\n")
        assert read_revocations(None) == {digits: Revoked(datetime(2026, 12, 1, tzinfo=UTC), "laptop stolen")}
    for wrong in ("ab12 2026-12-01", digits, f"{digits} yesterday", f"{digits} 2026-13-01"):
        (tmp_path / "revoked.txt").write_text(f"# lost keys\n{wrong}\n")
        with pytest.raises(FileError, match=r"revoked\.txt: line 2: "):
            read_revocations(None)


def test_at_the_prompt_a_revoked_key_needs_a_date_of_ones_own(tmp_path, unsigned, at, own_state, command_line):
    lab = holder("Lab 12")
    (tmp_path / "lab.pem").write_bytes(lab.certificate_pem)
    (tmp_path / "unit.pdf").write_bytes(at(unsigned, lab, NOW - 30 * DAY))
    (tmp_path / "revoked").write_text(f"{fingerprint(lab.certificate)} {NOW - 10 * DAY:%Y-%m-%d} stolen\n")

    def status(*more):
        ended = command_line("verify", tmp_path / "unit.pdf", "--trust", tmp_path / "lab.pem", *more)
        return ended.status, ended.out + ended.err

    assert status()[0] == 0
    found, words = status("--revoked", str(tmp_path / "revoked"))
    assert found == 1 and "stolen" in words and "as the signer's computer said" in words
    assert status("--revoked", str(tmp_path / "revoked"), "--received", f"{NOW - 20 * DAY:%Y-%m-%d}")[0] == 0
    assert status("--received", "yesterday")[0] == 2
    (tmp_path / "state").mkdir(exist_ok=True)
    (tmp_path / "revoked").rename(tmp_path / "state" / "revoked.txt")
    assert status()[0] == 1


# -- a file that was changed after it was signed ----------------------------------------------------------


def swapped(content: bytes) -> bytes:
    """Attachments exchanged by an update at the end of the file, which leaves the signed bytes as they are."""
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

    writer = IncrementalPdfFileWriter(io.BytesIO(content))
    names = writer.root["/Names"]["/EmbeddedFiles"]
    table = names["/Names"] if "/Names" in names else names["/Kids"][0]["/Names"]
    first, second = table.raw_get(1), table.raw_get(3)
    table[1], table[3] = second, first
    writer.update_container(table)
    out = io.BytesIO()
    writer.write(out)
    return out.getvalue()


def rewritten(content: bytes) -> bytes:
    """Opened and saved by another program, with an attachment taken out."""
    with pikepdf.open(io.BytesIO(content)) as pdf:
        del pdf.attachments["certificate.xml"]
        out = io.BytesIO()
        pdf.save(out)
        return out.getvalue()


def signed_again(content: bytes) -> bytes:
    """A second signature by somebody else, in a field of its own."""
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.sign.signers import PdfSignatureMetadata, sign_pdf

    from hil.passport.sign import _signer

    about = PdfSignatureMetadata(field_name="Second", md_algorithm="sha256")
    writer = IncrementalPdfFileWriter(io.BytesIO(content))
    try:
        return sign_pdf(writer, about, _signer(key_of(holder("Somebody")))).getvalue()
    except Exception:  # the first one allows no change, and pyHanko keeps to that: add the bytes of an update instead
        return content + b"\n1 0 obj\n<< >>\nendobj\n%%EOF\n"


@pytest.mark.parametrize("change", [swapped, rewritten, signed_again, lambda content: content + content])
def test_a_file_that_was_changed_is_not_sound(unsigned, change):
    lab = holder("Lab 12")
    content = signed(unsigned, key_of(lab))
    other = change(content)
    assert other != content
    assert verify(other, Trust([lab.certificate])).outcome is SignatureStatus.CHANGED


def test_the_signature_of_another_passport_does_not_fit(unsigned):
    lab = holder("Lab 12")
    content, other = signed(unsigned, key_of(lab)), signed(unsigned.replace(b"%PDF-1.7", b"%PDF-1.7 "), key_of(lab))
    from hil.passport.seal import seal_of

    (begin, end), (first, last) = seal_of(content).field, seal_of(other).field
    mixed: Sequence[bytes] = (content[:begin], other[first:last], content[end:])
    assert verify(b"".join(mixed), Trust([lab.certificate])).outcome is SignatureStatus.CHANGED


def test_power_without_a_model_is_refused_before_a_run_is_read(tmp_path):
    with pytest.raises(SettingError, match="leave out --no-model"):
        issue([tmp_path / "nowhere"], tmp_path / "unit.pdf", signing_key(None), Wanted(identify=False, power=True))
