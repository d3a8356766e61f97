"""Sign a PDF: one PAdES signature over the whole file, which allows no change."""

from __future__ import annotations

import io

from hil.errors import InputError
from hil.passport.key import SigningKey, name_of

FIELD, REASON = "Passport", "valve-hil passport/1"
DIGEST = "sha256"


def signed(pdf: bytes, key: SigningKey) -> bytes:
    """The PDF with its signature.

    Raises:
        InputError: the key cannot sign.
    """
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.sign.fields import MDPPerm, SigSeedSubFilter
    from pyhanko.sign.signers import PdfSignatureMetadata, PdfSigner

    about = PdfSignatureMetadata(
        field_name=FIELD, md_algorithm=DIGEST, subfilter=SigSeedSubFilter.PADES, name=name_of(key.certificate),
        reason=REASON, certify=True, docmdp_permissions=MDPPerm.NO_CHANGES,
    )  # fmt: skip
    try:
        made = PdfSigner(about, _signer(key)).sign_pdf(IncrementalPdfFileWriter(io.BytesIO(pdf)))
    except Exception as error:  # pyHanko raises several unrelated types for a key that does not fit
        raise InputError(f"the key of {name_of(key.certificate)} cannot sign: {error}") from error
    return bytes(made.getvalue())


def _signer(key: SigningKey):  # type: ignore[no-untyped-def]
    from asn1crypto.keys import PrivateKeyInfo
    from asn1crypto.x509 import Certificate
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
    from pyhanko.sign.signers import SimpleSigner
    from pyhanko_certvalidator.registry import SimpleCertificateStore

    private = key.key.private_bytes(Encoding.DER, PrivateFormat.PKCS8, NoEncryption())
    own = Certificate.load(key.certificate.public_bytes(Encoding.DER))
    # The certificate alone: nothing would vouch for the bytes of others beside it.
    nothing_else = SimpleCertificateStore()  # type: ignore[no-untyped-call]
    return SimpleSigner(own, PrivateKeyInfo.load(private), nothing_else, embed_roots=False)
