"""Whether every byte of a signed PDF is one that the signature covers, or one that could not be another.

A PDF signature covers the file but for its own field. What may stand in that field is fixed here: capital hexadecimal
digits, one certificate, one signature in the form in which it is written, and zeros after it.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from typing import Any

from hil.errors import reason
from hil.passport.sign import DIGEST, REASON

_RANGE = re.compile(rb"/ByteRange \[0 (\d+) (\d+) (\d+)\] *")
_START, _STOP = b"%PDF-", b"%%EOF\n"
MARKS = (REASON.encode(), f"<pdf:Keywords>{REASON}</pdf:Keywords>".encode())


class ChangedError(Exception):
    """The file is not as it was signed; says where."""


@dataclass(frozen=True, slots=True)
class Seal:
    """What is in the field of the signature: its certificate (DER), and where the field begins and ends."""

    certificate: bytes
    field: tuple[int, int]


def is_passport(content: bytes) -> bool:
    """Whether the bytes say of themselves that they are a passport, in at least one of two places."""
    return any(mark in content for mark in MARKS)


def seal_of(content: bytes) -> Seal:
    """The seal of a file in which nothing stands that it does not cover.

    Raises:
        ChangedError: something does.
    """
    if not content.startswith(_START):
        raise ChangedError("something stands before its header")
    if not content.endswith(_STOP):
        raise ChangedError("something stands after its end mark, or that is cut off")
    begin, end = _field(content)
    text = content[begin + 1 : end - 1]
    if content[begin : begin + 1] != b"<" or content[end - 1 : end] != b">" or re.fullmatch(b"[0-9A-F]+", text) is None:
        raise ChangedError("the field of the signature holds more than its digits")
    certificate, digest = _contents(bytes.fromhex(text.decode()))
    if hashlib.new(DIGEST, content[:begin] + content[end:]).digest() != digest:
        raise ChangedError("its content is not what was signed")
    return Seal(certificate, (begin, end))


def _field(content: bytes) -> tuple[int, int]:
    found = _RANGE.match(content, max(0, content.rfind(b"/ByteRange")))
    if found is None:
        raise ChangedError("no signature is found in it")
    begin, end, rest = (int(number) for number in found.groups())
    if not 0 < begin < end < len(content) or end + rest != len(content):
        raise ChangedError("the signature does not cover the whole file")
    return begin, end


def _contents(padded: bytes) -> tuple[bytes, bytes]:
    """(certificate, digest of the file) of the signature in the field."""
    from asn1crypto import cms, tsp  # noqa: F401 # tsp adds attributes to cms, too late once one was looked up there

    try:
        found = cms.ContentInfo.load(padded, strict=False)
        length = len(found.dump())
        rebuilt, certificate, digest = _rebuilt(found["content"])
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise ChangedError(f"its signature cannot be read: {reason(error):.100}") from None
    if rebuilt != padded[:length]:
        raise ChangedError("its signature is not in the form in which it is written")
    if any(padded[length:]):
        raise ChangedError("something stands in the padding of its signature")
    return certificate, digest


def _rebuilt(found: Any) -> tuple[bytes, bytes, bytes]:
    """The signature written anew from what the signature itself vouches for."""
    from asn1crypto import cms
    from asn1crypto.core import OctetString

    (chosen,), (info,) = found["certificates"], found["signer_infos"]
    certificate = chosen.chosen
    attributes = info["signed_attrs"]
    (digest,) = next(one["values"] for one in attributes if one["type"].native == "message_digest")
    algorithm = cms.DigestAlgorithm({"algorithm": DIGEST})
    signer = cms.SignerInfo({
        "version": "v1",
        "sid": cms.SignerIdentifier({"issuer_and_serial_number": cms.IssuerAndSerialNumber(
            {"issuer": certificate.issuer, "serial_number": certificate.serial_number})}),
        "digest_algorithm": algorithm,
        "signed_attrs": cms.CMSAttributes.load(bytes([0x31]) + attributes.dump()[1:]),
        "signature_algorithm": _algorithm(certificate),
        "signature": OctetString(info["signature"].native),
    })  # fmt: skip
    signed = cms.SignedData({
        "version": "v1", "digest_algorithms": [algorithm], "encap_content_info": {"content_type": "data"},
        "certificates": [certificate], "signer_infos": [signer],
    })  # fmt: skip
    whole = cms.ContentInfo({"content_type": "signed_data", "content": signed})
    return whole.dump(), certificate.dump(), digest.native


def _algorithm(certificate: Any) -> Any:
    """The signature algorithm that goes with the key of a certificate."""
    from asn1crypto.algos import SignedDigestAlgorithm

    kind = certificate.public_key.algorithm
    name = {"ec": f"{DIGEST}_ecdsa", "rsa": f"{DIGEST}_rsa"}[kind]
    return SignedDigestAlgorithm({"algorithm": name})
