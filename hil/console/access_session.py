"""Sessions: a signed cookie that says who somebody is; nothing is kept in the server."""

from __future__ import annotations

import hashlib
import secrets
from dataclasses import dataclass
from pathlib import Path

from hil.console.access_accounts import Account, Accounts
from hil.errors import FileError
from hil.record.state import OWNER_ALONE, keep, state_path

LASTS_S = 12 * 3600


@dataclass(frozen=True, slots=True)
class Session:
    """Somebody at a browser.

    Attributes:
        id: of the browser's session.
        name: of the account; empty where nobody has logged in.
        mark: of the password with which they did: another password ends the session.
    """

    id: str
    name: str = ""
    mark: str = ""


class Sessions:
    """Signs sessions, and reads them; the key is made at first use, and nobody but its owner reads it."""

    def __init__(self) -> None:
        from itsdangerous import URLSafeTimedSerializer

        self._signer = URLSafeTimedSerializer(_key(state_path("console", "session", ".key")), "hil console")

    def begun(self, name: str = "", account: Account | None = None) -> Session:
        """A new session: of an account that was shown to be somebody's, or of nobody."""
        return Session(secrets.token_urlsafe(16), name, mark_of(account) if account else "")

    def signed(self, session: Session) -> str:
        """As the cookie has it."""
        return str(self._signer.dumps([session.id, session.name, session.mark]))

    def read(self, cookie: str) -> Session | None:
        """The session of a cookie; None when it is not ours, was changed, or is too old."""
        from itsdangerous import BadData

        try:
            payload = self._signer.loads(cookie, max_age=LASTS_S)
        except BadData:
            return None
        return Session(*map(str, payload)) if isinstance(payload, list) and len(payload) == 3 else None


def account_of(session: Session, accounts: Accounts) -> Account | None:
    """The account of a session, as long as it exists and has the password with which the session began."""
    account = accounts.all().get(session.name)
    return account if account is not None and secrets.compare_digest(mark_of(account), session.mark) else None


def mark_of(account: Account) -> str:
    """What changes with the password, and does not tell it."""
    return hashlib.sha256(account.password.encode()).hexdigest()[:32]


def _key(path: Path) -> str:
    try:
        if not path.exists():
            keep(path, secrets.token_hex(32), mode=OWNER_ALONE)
        key = path.read_text(encoding="ascii").strip()
        readable = path.stat().st_mode & 0o077
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: the key of the sessions cannot be read: {error}") from None
    if len(key) < 32 or readable:
        raise FileError(f"{path}: not a key, or others may read it; remove it, and a new one is made")
    return key
