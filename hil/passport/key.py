"""The key that signs: a lab's own, or one made at first use that this machine trusts."""

from __future__ import annotations

import os
import socket
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from hil.errors import FileError, option, reading, reason
from hil.record.durable import write_whole
from hil.record.state import OWNER_ALONE, state_folder
from hil.untrusted import read_small

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.types import PrivateKeyTypes
    from cryptography.x509 import Certificate

PASSPHRASE = "HIL_KEY_PASSPHRASE"
OWN_KEY, OWN_CERTIFICATE = "passport-key.pem", "passport-certificate.pem"
_YEARS = 30  # a passport is read as long as the valve lives


@dataclass(frozen=True, slots=True)
class SigningKey:
    """A private key with its certificate."""

    key: PrivateKeyTypes
    certificate: Certificate


def signing_key(path: Path | None) -> SigningKey:
    """The lab's key, else this machine's own; that is made when there is none.

    Raises:
        FileError: the file holds no key with its certificate, or needs another passphrase.
    """
    if path is not None:
        return read_key(path)
    own = state_folder() / OWN_KEY
    if not own.is_file():
        _make_own(own)
    return read_key(own)


def read_key(path: Path) -> SigningKey:
    """A key with its certificate, from one PEM or PKCS #12 file; `HIL_KEY_PASSPHRASE` opens a locked one.

    Raises:
        FileError: it is not that, or the passphrase is wrong.
    """
    from cryptography.hazmat.primitives.serialization import pkcs12

    passphrase = os.environ.get(PASSPHRASE, "").encode() or None
    with reading(path, "the key cannot be read"):
        content = read_small(path)
    try:
        if b"-----BEGIN" in content:
            return _from_pem(content, passphrase)
        key, certificate, _ = pkcs12.load_key_and_certificates(content, passphrase)
        if key is None or certificate is None:
            raise ValueError("no key with its certificate in it")
        return _matching(SigningKey(key, certificate))
    except (ValueError, TypeError) as error:
        raise FileError(
            f"{path}: a private key and its certificate were expected, PEM or PKCS #12 (a passphrase in {PASSPHRASE}): "
            f"{reason(error):.160}"
        ) from None


def read_certificates(path: Path) -> list[Certificate]:
    """Certificates of a PEM or DER file.

    Raises:
        FileError: there is none in it.
    """
    from cryptography import x509

    with reading(path, "the certificate cannot be read"):
        content = read_small(path)
    try:
        if b"-----BEGIN CERTIFICATE" in content:
            return x509.load_pem_x509_certificates(content)
        return [x509.load_der_x509_certificate(content)]
    except ValueError:
        raise FileError(f"{path}: no certificate, PEM or DER, was found in it") from None


def own_certificates() -> list[Certificate]:
    """What this machine trusts by itself: the certificate of its own key."""
    own = state_folder() / OWN_CERTIFICATE
    return read_certificates(own) if own.is_file() else []


def fingerprint(certificate: Certificate) -> str:
    """SHA-256 in groups of four: `ab12 cd34 …`."""
    from cryptography.hazmat.primitives.hashes import SHA256

    digits = certificate.fingerprint(SHA256()).hex()
    return " ".join(digits[i : i + 4] for i in range(0, len(digits), 4))


def name_of(certificate: Certificate) -> str:
    """The signer's common name, else everything that the certificate says of him."""
    from cryptography.x509.oid import NameOID

    names = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(names[0].value) if names else certificate.subject.rfc4514_string()


def _from_pem(content: bytes, passphrase: bytes | None) -> SigningKey:
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    first, *_ = x509.load_pem_x509_certificates(content)
    return _matching(SigningKey(load_pem_private_key(content, passphrase), first))


def _matching(found: SigningKey) -> SigningKey:
    from cryptography.hazmat.primitives.asymmetric import ec, rsa

    if not isinstance(found.key, rsa.RSAPrivateKey | ec.EllipticCurvePrivateKey):
        raise ValueError("a key of RSA or an elliptic curve (ECDSA) signs a passport")
    if found.key.public_key() != found.certificate.public_key():
        raise ValueError("its first certificate is of another key")
    return found


def _make_own(path: Path) -> None:
    """A key with a certificate that it signs itself; nobody but its owner may read it."""
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
    from cryptography.x509.oid import NameOID

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"valve-hil on {socket.gethostname()}"[:64])])
    now = datetime.now(UTC)
    usage = x509.KeyUsage(True, True, False, False, False, False, False, False, False)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(minutes=5))
        .not_valid_after(now + timedelta(days=365.25 * _YEARS))
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .sign(key, SHA256())
    )
    public = certificate.public_bytes(Encoding.PEM)
    private = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        (path.parent / OWN_CERTIFICATE).write_bytes(public)
        write_whole(path, private + public, OWNER_ALONE)
    except OSError as error:
        raise FileError(
            f"{path}: the key of this machine cannot be kept: {error.strerror}; give one by {option('key')}"
        ) from None
