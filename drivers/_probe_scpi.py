"""Which instrument answers on a line: `*IDN?`, and nothing else is sent."""

from __future__ import annotations

from pydantic import Field, PositiveFloat, PositiveInt

from drivers._line import Line, SerialSettings
from hil.daq.probe import Found
from hil.description.text import ENDS, End
from hil.errors import LinkError
from hil.record.run_folder.progress import Progress
from hil.strict import Strict

_PARTS = ("maker", "model", "serial", "version")


class Options(Strict):
    """What beside the address may be said.

    Attributes:
        address: a serial port, `usb:…` or `socket://host:port`, as in bench files.
        baud, end, echo: of the line, and of what is sent.
        timeout_s: an answer that takes longer counts as none.
    """

    address: str
    baud: PositiveInt = 115200
    end: End = "LF"
    echo: bool = False
    timeout_s: PositiveFloat = Field(default=1.0, le=60.0)


def who(options: Options, progress: Progress) -> list[Found]:
    """The instrument, if one answers."""
    progress(0.0, "*IDN?")
    reached = {**options.model_dump(exclude={"end"}), "longest_reply_s": options.timeout_s}
    end = ENDS[options.end]
    line = Line(SerialSettings.model_validate(reached), end, end, driver="probe")
    try:
        text = line.ask_first("*IDN?").strip()
    except LinkError as error:
        if type(error) is not LinkError or "echoes" in str(error):
            raise
        return []
    finally:
        line.close()
    parts = [part.strip() for part in text.split(",")]
    answers = dict(zip(_PARTS, parts, strict=True)) if len(parts) == len(_PARTS) else {"answer": text}
    return [Found(options.address, answers)]
