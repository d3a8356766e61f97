"""A stop that was pressed where no run could hear it yet: a file beside the run folders, which every run heeds."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from hil.errors import FileError, storing
from hil.language.note import Note
from hil.record.durable import write_whole
from hil.safety.interrupt import Halted
from hil.untrusted import read_untrusted_json

_FILE = "stop-pressed.json"
MOST_BYTES = 65_536  # of what runs and consoles leave for each other


class Press(BaseModel):
    """Stop is pressed: until it is released, no run drives that records into this folder.

    Attributes:
        at_utc: when.
        account: who was logged in where it was pressed; empty where nobody was.
        runs: that were starting then. It releases itself when they are over; without any, somebody has to.
    """

    model_config = ConfigDict(frozen=True)

    at_utc: datetime
    account: str = ""
    runs: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class StopSwitch:
    """The switch of a folder of runs.

    Attributes:
        folder: in which the runs lie.
    """

    folder: Path

    @property
    def pressed(self) -> Press | None:
        """What is known of the press; None while it is released. A file that cannot be read is a press."""
        try:
            return Press.model_validate(read_untrusted_json(self.folder, _FILE, MOST_BYTES))
        except FileNotFoundError:
            return None
        except (OSError, FileError, ValidationError):
            return Press(at_utc=datetime.now(UTC))

    def press(self, account: str, runs: tuple[str, ...] = ()) -> Press:
        """Press it.

        Raises:
            StorageError: it cannot be written.
        """
        made = Press(at_utc=datetime.now(UTC), account=account, runs=runs)
        path = self.folder / _FILE
        with storing(path):
            self.folder.mkdir(parents=True, exist_ok=True)
            write_whole(path, made.model_dump_json())
        return made

    def release(self) -> None:
        """Release it; also where it is not pressed.

        Raises:
            StorageError: the file cannot be removed.
        """
        with storing(self.folder / _FILE, "cannot be removed"):
            (self.folder / _FILE).unlink(missing_ok=True)

    def text(self, press: Press) -> Note:
        """What keeps a run from starting, in one line."""
        by = f" by {press.account}" if press.account else ""
        return Note(
            "stop is pressed since {time}; release it at the console, or remove {file}",
            time=f"{press.at_utc:%Y-%m-%d %H:%M:%S} UTC{by}", file=str(self.folder / _FILE),
        )  # fmt: skip

    def check(self) -> None:
        """Raise `Halted` while it is pressed."""
        press = self.pressed
        if press is not None:
            halted = Halted()
            halted.args = (self.text(press),)
            raise halted
