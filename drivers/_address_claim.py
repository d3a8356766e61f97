"""An address on a J1939 bus, claimed and defended (SAE J1939-81, ISO 11783-5)."""

from __future__ import annotations

import uuid

CLAIMED, REQUEST = 0xEE00, 0xEA00
"""Parameter groups: address claimed, with the NAME; and the request for another group."""
NOBODY, EVERYBODY = 0xFE, 0xFF
"""Addresses: of one who could claim none, and of all."""
CLAIM_WAIT_S = 0.25
"""Nothing else is sent for so long after a claim."""
_PRIORITY = 6


def default_name() -> int:
    """A NAME for a test bench, in our choice of fields: every other controller goes before it.

    Industry group agriculture (2), function not available (255), no maker (2047), identity from this computer's network
    address; the address is not changed by itself.
    """
    return 2 << 60 | 0xFF << 40 | 0x7FF << 21 | uuid.getnode() & 0x1FFFFF


class AddressClaim:
    """One controller's claim to one address. The smaller NAME keeps it; whoever loses it falls silent.

    Attributes:
        address, name: ours.
        lost_to: the NAME that took the address away; None while it is ours.
    """

    def __init__(self, address: int, name: int) -> None:
        self.address, self.name = address, name
        self.lost_to: int | None = None

    def claim(self) -> tuple[int, bytes]:
        """The claim, or that no address could be claimed: identifier and data."""
        source = self.address if self.lost_to is None else NOBODY
        return _PRIORITY << 26 | CLAIMED << 8 | EVERYBODY << 8 | source, self.name.to_bytes(8, "little")

    def answer_to(self, identifier: int, data: bytes) -> tuple[int, bytes] | None:
        """What to send in answer to a message, None for nothing."""
        group, to, source = identifier >> 8 & 0x3FF00, identifier >> 8 & 0xFF, identifier & 0xFF
        if group == REQUEST and to in (self.address, EVERYBODY) and data[:3] == CLAIMED.to_bytes(3, "little"):
            return self.claim()
        if group != CLAIMED or source != self.address or len(data) != 8 or self.lost_to is not None:
            return None
        theirs = int.from_bytes(data, "little")
        if theirs <= self.name:  # the same NAME twice is a second program of ours
            self.lost_to = theirs
        return self.claim()
