"""For whom a certificate vouches, at which time, and from when on it does no longer."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from hil.errors import FileError
from hil.passport.key import fingerprint, name_of
from hil.record.state import state_folder
from hil.untrusted import read_text

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

REVOKED_FILE = "revoked.txt"
_LINE = re.compile(
    r"(?P<fingerprint>(?:[0-9a-f]{2}[ :]?){32})[ :]*\s(?P<date>\d{4}-\d\d-\d\d\S*)(?P<why>.*)", re.IGNORECASE
)
_CLOCKS = timedelta(days=1)  # two computers that mean the same moment: a time zone that was set wrong


@dataclass(frozen=True, slots=True)
class Revoked:
    """From when on signatures of a certificate are not trusted, and why."""

    since: datetime
    why: str = ""


Revocations = Mapping[str, Revoked]
"""By the SHA-256 of the certificate, as `hil.passport.key.fingerprint` says it."""


def read_revocations(path: Path | None) -> dict[str, Revoked]:
    """Revoked certificates of a file: on each line a SHA-256, a date or time, and why; `#` begins a comment.

    Args:
        path: of the file; else `revoked.txt` in this computer's state folder, which need not be there.

    Raises:
        FileError: it cannot be read, or a line is none of these.
    """
    own = path or state_folder() / REVOKED_FILE
    if path is None and not own.is_file():
        return {}
    try:
        lines = read_text(own).splitlines()
    except (OSError, ValueError) as error:
        raise FileError(f"{own}: revoked certificates cannot be read: {error}") from None
    return dict(_revoked(line, f"{own}: line {number}") for number, line in enumerate(lines, 1) if _is_entry(line))


def _is_entry(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _revoked(line: str, where: str) -> tuple[str, Revoked]:
    found = _LINE.fullmatch(line.strip())
    try:
        if found is None:
            raise ValueError("64 hexadecimal digits and a date were expected")
        digits = re.sub("[ :]", "", found["fingerprint"]).lower()
        return " ".join(re.findall("....", digits)), Revoked(moment_of(found["date"]), found["why"].strip())
    except ValueError as error:
        raise FileError(
            f"{where}: {error}: SHA-256 of a certificate, a date as 2026-11-25, and why, were expected"
        ) from None


def moment_of(text: str) -> datetime:
    """A date, from its first moment in UTC on, or a time; without an offset it is in UTC.

    Raises:
        ValueError: neither.
    """
    found = datetime.fromisoformat(text)
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def is_authority(certificate: Certificate) -> bool:
    """Whether it may vouch for others: an authority by its basic constraints, allowed to sign certificates."""
    from cryptography.x509 import BasicConstraints, KeyUsage

    extensions = {type(one.value): one.value for one in certificate.extensions}
    constraints, usage = extensions.get(BasicConstraints), extensions.get(KeyUsage)
    vouches = isinstance(constraints, BasicConstraints) and constraints.ca
    return vouches and (not isinstance(usage, KeyUsage) or usage.key_cert_sign)


def fault_in_time(
    path: Sequence[Certificate], signed: datetime | None, revocations: Revocations, received: datetime | None
) -> str:
    """Why a signature does not count at the time at which it was made; empty where it does.

    Args:
        path: the signer's certificate, then those who vouch for it.
        signed: when, as the signer's computer said.
        revocations: of certificates.
        received: when the reader had the file at the latest; None where he does not say.
    """
    if signed is None:
        return "it does not say when it was signed"
    if signed > datetime.now(UTC) + _CLOCKS:
        return f"signed on {signed.isoformat()}, a time that has not come: its signer's clock is wrong, or he lies"
    if received is not None and signed > received + _CLOCKS:
        return f"signed on {signed.isoformat()}, after it was received on {received.isoformat()}"
    leaf = path[0]
    if not leaf.not_valid_before_utc <= signed <= leaf.not_valid_after_utc:
        return (
            f"signed on {signed.isoformat()}, when the certificate did not hold: it does from "
            f"{leaf.not_valid_before_utc.isoformat()} to {leaf.not_valid_after_utc.isoformat()}"
        )
    faults = (_revocation(one, revocations.get(fingerprint(one)), signed, received) for one in path)
    return next(filter(None, faults), "")


def _revocation(one: Certificate, revoked: Revoked | None, signed: datetime, received: datetime | None) -> str:
    if revoked is None or (received is not None and received < revoked.since):
        return ""
    why = f" ({revoked.why})" if revoked.why else ""
    since = f"the certificate of {name_of(one)} is revoked from {revoked.since.isoformat()} on{why}"
    if signed >= revoked.since:
        return f"{since}, and the file was signed on {signed.isoformat()}"
    return (
        f"{since}; that the file was signed before, on {signed.isoformat()}, is the word of whoever has the key: say "
        "--received DATE if it was in your hands before"
    )
