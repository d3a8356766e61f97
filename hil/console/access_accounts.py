"""Who has an account at the console, with which role; passwords are kept as argon2 hashes."""

from __future__ import annotations

import json
import re
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from filelock import FileLock
from pydantic import ValidationError

from hil.errors import FileError, SettingError, UnknownNameError, storing
from hil.record.state import OWNER_ALONE, keep, state_path
from hil.strict import Strict
from hil.untrusted import read_json

if TYPE_CHECKING:
    from argon2 import PasswordHasher

Role = Literal["viewer", "operator", "engineer"]
ROLES: tuple[Role, ...] = get_args(Role)
SHORTEST, LONGEST = 10, 1024  # characters of a password; hashing a long one takes long
_NAME = re.compile(r"^\w[\w.@ -]{0,63}$")
_NOBODY = "nobody's password: it takes as long to refuse a name that does not exist"


class Account(Strict):
    """An account: `viewer` looks, `operator` drives, `engineer` also changes what others are judged by."""

    role: Role
    password: str


class Accounts:
    """The accounts of a file, read anew whenever somebody asks: one that is removed is out at once.

    Args:
        path: of the file; only its owner reads it (mode 0600).
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path or state_path("console", "accounts", ".json")

    def all(self) -> dict[str, Account]:
        """Each account by name.

        Raises:
            FileError: the file cannot be read, or others can read it: nobody is let in then.
        """
        try:
            readable = self._path.stat().st_mode & 0o077
            content = read_json(self._path)
            found = {str(name): Account.model_validate(fields) for name, fields in content.items()}
        except FileNotFoundError:
            return {}
        except (OSError, FileError, AttributeError, ValidationError) as error:
            raise FileError(f"{self._path}: not a file of accounts: {str(error).splitlines()[0]}") from None
        if readable:
            raise FileError(f"{self._path}: others may read or write it; `chmod 600 {self._path}`")
        return found

    def add(self, name: str, role: str, password: str) -> None:
        """A new account, or another role and password for one that exists.

        Raises:
            SettingError: a name, role or password that is not allowed.
            StorageError: the file cannot be written.
        """
        if not _NAME.match(name):
            raise SettingError(f"NAME {name!r:.80}: letters, digits, and . @ - or spaces inside, at most 64")
        if role not in ROLES:
            raise SettingError(f"--role {role}: one of {', '.join(ROLES)}")
        if not SHORTEST <= len(password) <= LONGEST:
            raise SettingError(f"the password has {len(password)} characters; {SHORTEST} to {LONGEST} are allowed")
        made = Account.model_validate({"role": role, "password": _hasher().hash(password)})
        with self._locked():
            self._write({**self.all(), name: made})

    def remove(self, name: str) -> None:
        """Take an account away.

        Raises:
            UnknownNameError: there is none of that name.
            StorageError: the file cannot be written.
        """
        with self._locked():
            known = self.all()
            if name not in known:
                raise UnknownNameError("account", name, known)
            del known[name]
            self._write(known)

    def verified(self, name: str, password: str) -> Account | None:
        """The account that somebody has shown to be theirs; takes a tenth of a second, whatever comes of it."""
        from argon2.exceptions import Argon2Error, InvalidHashError

        account = self.all().get(name)
        hashed = account.password if account else _nobody()
        with suppress(Argon2Error, InvalidHashError):
            if len(password) <= LONGEST and _hasher().verify(hashed, password):
                return account
        return None

    def _locked(self) -> FileLock:
        with storing(self._path):
            self._path.parent.mkdir(parents=True, exist_ok=True)
        return FileLock(self._path.with_suffix(".lock"), timeout=10.0)

    def _write(self, accounts: dict[str, Account]) -> None:
        content = {name: account.model_dump() for name, account in sorted(accounts.items())}
        keep(self._path, json.dumps(content, indent=1, ensure_ascii=False) + "\n", mode=OWNER_ALONE)


@cache
def _hasher() -> PasswordHasher:
    from argon2 import PasswordHasher

    return PasswordHasher()


@cache
def _nobody() -> str:
    return _hasher().hash(_NOBODY)
