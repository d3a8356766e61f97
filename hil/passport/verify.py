"""Check a passport: that nothing in it was changed, and who signed it."""

from __future__ import annotations

import io
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING

from hil.errors import FileError, marked
from hil.passport.contents import STRANGERS_BYTES, files_inside
from hil.passport.key import fingerprint, name_of, own_certificates
from hil.passport.revoked import Revocations, fault_in_time, is_authority, read_revocations
from hil.passport.seal import ChangedError, is_passport, seal_of
from hil.record.gathered import whole
from hil.record.run_folder.header import HEADER_FILE
from hil.record.simulated import is_simulated
from hil.untrusted import MOST_BYTES, parse_json

if TYPE_CHECKING:
    from cryptography.x509 import Certificate


_HEADERS = f"runs/*/{HEADER_FILE}"


class SignatureStatus(IntEnum):
    """What came of it; the exit status of `hil verify`."""

    SOUND = 0
    CHANGED = 1
    UNKNOWN_SIGNER = 1 << 8  # kept apart here; the exit status of these is that of a changed file
    NOT_VALID_THEN = 2 << 8
    NO_PASSPORT = 2


@dataclass(frozen=True, slots=True)
class Verified:
    """The outcome in one sentence, with the signer where the signature is his.

    `signed_utc`: when, as the signer's computer said. `simulated`: whether a run inside was made on a simulated valve.
    """

    outcome: SignatureStatus
    sentence: str
    signer: str = ""
    fingerprint: str = ""
    simulated: bool = False
    signed_utc: datetime | None = None

    @property
    def exit_status(self) -> int:
        """0 sound and signer known, 1 changed or signer unknown, 2 no passport."""
        return min(int(self.outcome), 1) if self.outcome is not SignatureStatus.NO_PASSPORT else 2

    @property
    def most_bytes(self) -> float:
        """What its files may unpack to, all together, unless somebody says otherwise."""
        return math.inf if self.is_sound else STRANGERS_BYTES

    @property
    def is_sound(self) -> bool:
        """Whether nothing was changed, and the signer is known."""
        return self.outcome is SignatureStatus.SOUND

    @property
    def is_as_signed(self) -> bool:
        """Whether nothing was changed, whoever signed, and whenever."""
        return self.outcome not in (SignatureStatus.CHANGED, SignatureStatus.NO_PASSPORT)


@dataclass(frozen=True, slots=True)
class Trust:
    """What its reader knows of signers.

    Attributes:
        certificates: of known signers, and of authorities that vouch for them.
        revocations: of certificates that hold no longer.
        received: when the reader had the file at the latest, by his own records; None where he does not say.
    """

    certificates: Sequence[Certificate] = ()
    revocations: Revocations = field(default_factory=dict)
    received: datetime | None = None


def own_trust() -> Trust:
    """What this computer trusts by itself."""
    return Trust(own_certificates(), read_revocations(None))


def verify_file(path: Path, trust: Trust) -> Verified:
    """Check a file.

    Raises:
        FileError: it cannot be read.
    """
    return verify(whole(path), trust)


def verify(content: bytes, trust: Trust) -> Verified:
    """Check the bytes of a file."""
    from cryptography import x509

    if not is_passport(content):
        return Verified(SignatureStatus.NO_PASSPORT, "no passport of this program")
    try:
        seal = seal_of(content)
        certificate = x509.load_der_x509_certificate(seal.certificate)
        issuers, signed_utc = _validated(content, seal.field, certificate, trust.certificates)
        who = name_of(certificate), fingerprint(certificate), _of_simulated_runs(content), signed_utc
    except ChangedError as error:
        return Verified(SignatureStatus.CHANGED, f"changed since it was signed: {error}")
    except Exception as error:  # a broken PDF makes its reader raise anything; whatever it is, the file is not sound
        return Verified(SignatureStatus.CHANGED, f"cannot be read as it was signed: {type(error).__name__}")
    if issuers is None:
        statement = "unchanged since it was signed, by a signer who is not known here"
        return Verified(SignatureStatus.UNKNOWN_SIGNER, statement, *who)
    if fault := fault_in_time([certificate, *issuers], signed_utc, trust.revocations, trust.received):
        statement = f"unchanged since it was signed, by a known signer, but {fault}"
        return Verified(SignatureStatus.NOT_VALID_THEN, statement, *who)
    return Verified(SignatureStatus.SOUND, "unchanged since it was signed, by a known signer", *who)


def _of_simulated_runs(content: bytes) -> bool:
    """Whether the header of a run inside says that it is simulated."""
    try:
        found = [parse_json(inside, str(name)) for name, inside in files_inside(content, MOST_BYTES, _HEADERS)]
    except FileError:
        return False
    return any(is_simulated(header.get("meta") or {}) for header in found if isinstance(header, dict))


def _validated(
    content: bytes, field: tuple[int, int], certificate: Certificate, trusted: Sequence[Certificate]
) -> tuple[Sequence[Certificate] | None, datetime | None]:
    """(who vouches for the signer, None where nobody does; when he says that he signed), by pyHanko's own validator.

    Raises:
        ChangedError: the validator does not find the signature sound.
    """
    from cryptography import x509
    from pyhanko.pdf_utils.reader import PdfFileReader
    from pyhanko.sign.validation import validate_pdf_signature
    from pyhanko.sign.validation.status import SignatureCoverageLevel

    logging.getLogger("pyhanko").setLevel(logging.CRITICAL + 1)  # it writes a trace for each unknown signer
    signatures = PdfFileReader(io.BytesIO(content), strict=True).embedded_signatures
    if len(signatures) != 1 or list(signatures[0].byte_range) != [0, *field, len(content) - field[1]]:
        raise ChangedError("it holds another signature than the one that covers it")
    moment = signatures[0].self_reported_timestamp
    status = validate_pdf_signature(signatures[0], _context(certificate, trusted, moment))
    if not (status.intact and status.valid and status.coverage is SignatureCoverageLevel.ENTIRE_FILE):
        raise ChangedError("its signature does not fit")
    if certificate in trusted:
        return (), moment
    if not status.trusted or status.validation_path is None:
        return None, moment
    path = status.validation_path.iter_certs(include_root=True)
    return [x509.load_der_x509_certificate(one.dump()) for one in path], moment


def _context(certificate: Certificate, trusted: Sequence[Certificate], moment):  # type: ignore[no-untyped-def]
    """What the validator may trust: a known certificate itself, or authorities; another signer vouches for nobody.

    At the time that the signer states: a passport outlives the certificate that signed it.
    """
    from asn1crypto.x509 import Certificate as Parsed
    from cryptography.hazmat.primitives.serialization import Encoding
    from pyhanko_certvalidator import ValidationContext

    roots = [certificate] if certificate in trusted else filter(is_authority, trusted)
    parsed = [Parsed.load(one.public_bytes(Encoding.DER)) for one in roots]
    return ValidationContext(trust_roots=parsed, allow_fetching=False, moment=moment, best_signature_time=moment)


def opened(path: Path) -> tuple[bytes, Verified]:
    """The bytes of a passport that is as it was signed, whoever signed it.

    Raises:
        FileError: no passport, or one that was changed (exit status 1).
    """
    content = whole(path)
    found = verify(content, own_trust())
    if not found.is_as_signed:
        error = FileError(f"{path}: {found.sentence}; nothing was taken from it")
        marked(error, found.exit_status, "")
        raise error
    return content, found
