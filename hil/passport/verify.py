"""Check a passport: that nothing in it was changed, and who signed it."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING

from hil.errors import FileError, marked
from hil.passport.contents import files_inside
from hil.passport.key import fingerprint, name_of, own_certificates
from hil.passport.seal import ChangedError, is_passport, seal_of
from hil.record.header import HEADER_FILE
from hil.record.simulated import is_simulated

if TYPE_CHECKING:
    from cryptography.x509 import Certificate


class Soundness(IntEnum):
    """What came of it; the exit status of `hil verify`."""

    SOUND = 0
    CHANGED = 1
    UNKNOWN_SIGNER = 1 << 8  # told apart here; its exit status is that of a changed file
    NO_PASSPORT = 2


@dataclass(frozen=True, slots=True)
class Verified:
    """The outcome in one sentence, with the signer where the signature is his.

    `simulated`: whether a run inside was made on a simulated valve; said of files that are as they were signed.
    """

    outcome: Soundness
    sentence: str
    signer: str = ""
    fingerprint: str = ""
    simulated: bool = False

    @property
    def exit_status(self) -> int:
        """0 sound and signer known, 1 changed or signer unknown, 2 no passport."""
        return 1 if self.outcome is Soundness.UNKNOWN_SIGNER else int(self.outcome)

    @property
    def is_as_signed(self) -> bool:
        """Whether nothing was changed, whoever signed."""
        return self.outcome in (Soundness.SOUND, Soundness.UNKNOWN_SIGNER)


def verify_file(path: Path, trusted: Sequence[Certificate]) -> Verified:
    """Check a file.

    Raises:
        FileError: it cannot be read.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from None
    return verify(content, trusted)


def verify(content: bytes, trusted: Sequence[Certificate]) -> Verified:
    """Check the bytes of a file.

    Args:
        content: of the file.
        trusted: certificates of known signers, or of those who vouch for them.
    """
    from cryptography import x509

    if not is_passport(content):
        return Verified(Soundness.NO_PASSPORT, "no passport of this program")
    try:
        seal = seal_of(content)
        certificate = x509.load_der_x509_certificate(seal.certificate)
        known = _validated(content, seal.field, certificate, trusted)
    except ChangedError as error:
        return Verified(Soundness.CHANGED, f"changed since it was signed: {error}")
    except Exception as error:  # a broken PDF makes its reader raise anything; whatever it is, the file is not sound
        return Verified(Soundness.CHANGED, f"cannot be read as it was signed: {type(error).__name__}")
    who = name_of(certificate), fingerprint(certificate), _of_simulated_runs(content)
    if not known:
        said = "unchanged since it was signed, by a signer who is not known here"
        return Verified(Soundness.UNKNOWN_SIGNER, said, *who)
    return Verified(Soundness.SOUND, "unchanged since it was signed, by a known signer", *who)


def _of_simulated_runs(content: bytes) -> bool:
    """Whether the header of a run inside says that it is simulated."""
    headers = (json.loads(inside) for name, inside in files_inside(content) if name.match(f"runs/*/{HEADER_FILE}"))
    return any(is_simulated(header.get("meta") or {}) for header in headers)


def _validated(
    content: bytes, field: tuple[int, int], certificate: Certificate, trusted: Sequence[Certificate]
) -> bool:
    """Whether the signer is known, by pyHanko's own validator.

    Raises:
        ChangedError: the validator does not find the signature sound.
    """
    from pyhanko.pdf_utils.reader import PdfFileReader
    from pyhanko.sign.validation import validate_pdf_signature
    from pyhanko.sign.validation.status import SignatureCoverageLevel

    signatures = PdfFileReader(io.BytesIO(content), strict=True).embedded_signatures
    if len(signatures) != 1 or list(signatures[0].byte_range) != [0, *field, len(content) - field[1]]:
        raise ChangedError("it holds another signature than the one that covers it")
    status = validate_pdf_signature(signatures[0], _trust(certificate, trusted, signatures[0].self_reported_timestamp))
    if not (status.intact and status.valid and status.coverage is SignatureCoverageLevel.ENTIRE_FILE):
        raise ChangedError("its signature does not fit")
    return bool(status.trusted)


def _trust(certificate: Certificate, trusted: Sequence[Certificate], moment):  # type: ignore[no-untyped-def]
    """What the validator may trust: a known certificate itself, or those who vouch for it.

    At the time that the signer states: a passport outlives the certificate that signed it.
    """
    from asn1crypto.x509 import Certificate as Parsed
    from cryptography.hazmat.primitives.serialization import Encoding
    from pyhanko_certvalidator import ValidationContext

    roots = [certificate] if certificate in trusted else trusted
    parsed = [Parsed.load(one.public_bytes(Encoding.DER)) for one in roots]
    return ValidationContext(trust_roots=parsed, allow_fetching=False, moment=moment, best_signature_time=moment)


def opened(path: Path) -> tuple[bytes, Verified]:
    """The bytes of a passport that is as it was signed, whoever signed it.

    Raises:
        FileError: no passport, or one that was changed (exit status 1).
    """
    found = verify_file(path, own_certificates())
    if not found.is_as_signed:
        error = FileError(f"{path}: {found.sentence}; nothing was taken from it")
        marked(error, found.exit_status, "")
        raise error
    return path.read_bytes(), found
