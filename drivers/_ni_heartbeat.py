"""A digital line that changes for as long as the program lives, for a relay that drops out when it stands still."""

from __future__ import annotations

from typing import Any

from hil.system import system


class Heartbeat:
    """A line of an NI device that changes again and again, in a thread of its own.

    Args:
        line: as NI MAX names it.
        every_s: it changes so often.
    """

    def __init__(self, line: str, every_s: float) -> None:
        self._line, self._every_s = line, every_s
        self._ended = system.event()
        self._failure: Exception | None = None
        self._thread: Any = None

    @property
    def beats(self) -> bool:
        """Whether it changes."""
        return self._thread is not None and self._thread.is_alive()

    def begin(self) -> None:
        """Let it change from now on."""
        import nidaqmx

        if self.beats:
            return
        task = nidaqmx.Task()
        try:
            task.do_channels.add_do_chan(self._line)
            task.write(True, auto_start=True)  # here, so that a line that cannot be driven is found at once
        except BaseException:
            task.close()
            raise
        self._ended.clear()
        self._thread = system.thread(self._beat, task, name="hil-heartbeat")
        self._thread.start()

    def end(self) -> None:
        """Let it stand still, off."""
        self._ended.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()

    def check(self) -> None:
        """Raise what ended it, if something did."""
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _beat(self, task: Any) -> None:
        level = True
        try:
            while not self._ended.wait(self._every_s):
                level = not level
                task.write(level, auto_start=True)
            task.write(False, auto_start=True)
        except Exception as error:  # told with the next block; without edges the relay drops out
            self._failure = error
        finally:
            task.close()
