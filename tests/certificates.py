"""Keys with certificates that somebody issued, for signatures and for connections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import NameOID

NOW = datetime.now(UTC)
DAY = timedelta(days=1)
LONG = (NOW - 900 * DAY, NOW + 900 * DAY)


@dataclass(frozen=True)
class Holder:
    """A key and its certificate."""

    key: Any
    certificate: x509.Certificate

    @property
    def certificate_pem(self) -> bytes:
        """As in a file."""
        return self.certificate.public_bytes(Encoding.PEM)

    @property
    def key_pem(self) -> bytes:
        """As in a file, without a passphrase."""
        return self.key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def holder(
    name: str, by: Holder | None = None, *, authority: bool = False, valid: Sequence[datetime] = LONG,
    bare: bool = False, key: Any = None, host: str = "",
) -> Holder:  # fmt: skip
    """A key whose certificate somebody issued, or it itself; `bare`: without the extensions that say what it may."""
    key, subject = key or ec.generate_private_key(ec.SECP256R1()), x509.Name([
        x509.NameAttribute(NameOID.COMMON_NAME, name)
    ])  # fmt: skip
    made = x509.CertificateBuilder().subject_name(subject).public_key(key.public_key())
    made = made.issuer_name(by.certificate.subject if by else subject).serial_number(x509.random_serial_number())
    made = made.not_valid_before(valid[0]).not_valid_after(valid[1])
    if not bare:
        usage = x509.KeyUsage(not authority, not authority, False, False, False, authority, authority, False, False)
        made = made.add_extension(x509.BasicConstraints(authority, None), True).add_extension(usage, True)
    if host:
        made = made.add_extension(x509.SubjectAlternativeName([x509.DNSName(host)]), critical=False)
    return Holder(key, made.sign(by.key if by else key, SHA256()))
