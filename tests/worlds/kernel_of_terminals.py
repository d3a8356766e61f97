"""Signals and serial ports of a world against Linux: one drawn script on both, and what each saw (see `kernel`)."""

from __future__ import annotations

import os
import pty
import random
import signal
import sys
import termios
import time
import tty
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from hil.system import System, system
from tests.worlds.serial_line import SerialLine, SerialPort
from tests.worlds.system import WorldSystem
from tests.worlds.tasks import Hub

_NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
_SOON_S = 0.03
_BAUD = 115200
Steps = tuple[tuple[str, int], ...]


def signal_script(seed: int) -> Steps:
    """What a program does with signals, and what is sent to it."""
    draw = random.Random(f"signals {seed}")
    does = ("hear", "hear", "ignore", "default", "block", "unblock", "send", "send", "send", "stop", "continue")
    steps = [("hear", int(number)) for number in _NUMBERS if draw.random() < 0.7]
    steps += [(draw.choice(does), int(draw.choice(_NUMBERS))) for _ in range(draw.randint(4, 12))]
    return (*steps, ("continue", 0), *(("unblock", int(number)) for number in _NUMBERS))


def _obey(on: Any, heard: list[int], what: str, number: int, blocked: set[int]) -> None:
    """A step of the program itself."""
    if what == "unblock":
        on.unblock([number])
    elif what == "block":
        blocked.add(number)
        on.blocking([number]).__enter__()
    else:
        handlers: dict[str, Any] = {
            "hear": lambda number, _frame: heard.append(int(number)), "ignore": signal.SIG_IGN,
            "default": signal.SIG_DFL,
        }  # fmt: skip
        on.handle(number, handlers[what])


def signals_on_linux(steps: Steps) -> tuple[list[int], int]:
    """What a program heard, in order, and with which status it ended, negative for a signal."""
    orders, order = os.pipe()
    answer, answers = os.pipe()
    if not (pid := os.fork()):
        _program(orders, answers)
    os.close(answers)
    heard: list[int] = []

    def say(step: bytes) -> None:
        """Hand over a step, and wait until it was done; a program that stands does it later."""
        with suppress(BrokenPipeError):
            os.write(order, step)
        heard[:] = os.read(answer, 100) or heard

    later: list[bytes] = []
    is_stopped = False
    for what, number in steps:
        if what in ("send", "stop", "continue"):
            sent = {"stop": signal.SIGSTOP, "continue": signal.SIGCONT}.get(what, number)
            is_stopped = {"stop": True, "continue": False}.get(what, is_stopped)
            with suppress(ProcessLookupError):
                os.kill(pid, sent)
            later, waiting = ([], later) if not is_stopped else (later, [])
            for step in waiting:
                say(step)
            if not is_stopped:
                say(b"report 0 ")
        else:
            step = f"{what} {number} ".encode()
            if is_stopped:
                later.append(step)
            else:
                say(step)
    say(b"end 0 ")
    _, status = os.waitpid(pid, 0)
    for descriptor in (orders, order, answer):
        os.close(descriptor)
    return [number for number in heard if number], os.waitstatus_to_exitcode(status)


def _program(orders: int, answers: int) -> None:
    """In the child: obey, and say after each step what was heard up to now."""
    try:
        real, heard, blocked, words = System(), list[int](), set[int](), b""
        signal.pthread_sigmask(signal.SIG_SETMASK, [])
        for number in _NUMBERS:
            signal.signal(number, signal.SIG_DFL)
        while True:
            while words.count(b" ") < 2:
                words += os.read(orders, 100)
            word, number, words = words.split(b" ", 2)
            if word == b"end":
                break
            if word != b"report":
                _obey(real, heard, word.decode(), int(number), blocked)
            os.write(answers, bytes([0, *heard]))
        os._exit(0)
    finally:
        os._exit(1)


def signals_in_world(steps: Steps) -> tuple[list[int], int]:
    """The same of a process of a world."""
    hub, heard = Hub(1, hurry=0.0), list[int]()
    standing = WorldSystem(hub, {}, {}, (0.0, 0.0))
    process, sender = standing.new_process("program"), standing.new_process("sender")
    process.handlers.clear()
    orders, blocked = standing.queue(), set[int]()

    def program() -> int:
        while True:
            what, number = orders.get()
            if what == "end":
                return 0
            _obey(standing, heard, what, number, blocked)

    def send() -> int:
        for what, number in steps:
            if what in ("send", "stop", "continue"):
                process.signal({"stop": signal.SIGSTOP, "continue": signal.SIGCONT}.get(what, number))
            else:
                orders.put((what, number))
            standing.sleep(_SOON_S)
        orders.put(("end", 0))
        return 0

    with system.replaced_by(standing):
        process.begin(program)
        sender.begin(send)
        hub.run(100.0, lambda: not standing.living)
    return heard, process.status if process.status is not None else 1000


def port_script(seed: int) -> Steps:
    """What goes over a serial port, and what is done with it."""
    draw = random.Random(f"port {seed}")
    does = ("say", "say", "read", "read", "waiting", "write", "write", "clear", "open anew")
    steps = [(draw.choice(does), draw.randint(1, 60)) for _ in range(draw.randint(4, 12))]
    pulled = [("pull", 0), *((draw.choice(("read", "write", "waiting")), 5) for _ in range(2))]
    return (*steps, ("read", 200), *(pulled if draw.random() < 0.3 else ()))


def _through(steps: Steps, opened: Callable[[], Any], say: Callable[[bytes], None], pull: Callable[[], None],
             wait: Callable[[float], None]) -> list[object]:  # fmt: skip
    """What every step came to."""
    seen: list[object] = []
    port = opened()
    for at, (what, much) in enumerate(steps):
        try:
            if what == "say":
                say(bytes([at + 1]) * much)
            elif what == "read":
                seen.append(bytes(port.read(much)))
            elif what == "waiting":
                seen.append(port.in_waiting)
            elif what == "write":
                port.write(bytes([at + 1]) * much)
            elif what == "clear":
                port.reset_input_buffer()
            elif what == "pull":
                pull()
            else:
                port.close()
                port = opened()
        except (OSError, termios.error):
            seen.append(f"{what} failed")
        wait(_SOON_S)
    with suppress(OSError, termios.error):
        port.close()
    return seen


def port_on_linux(steps: Steps) -> tuple[list[object], bytes]:
    """What a program saw on a pseudo-terminal, and what its other side received."""
    near, far = pty.openpty()
    tty.setraw(far)
    os.set_blocking(near, False)
    received = b""

    def wait(time_s: float) -> None:
        nonlocal received
        time.sleep(time_s)
        with suppress(OSError):
            received += os.read(near, 4096) if held else b""

    def opened() -> Any:
        return System().serial(os.ttyname(far), baudrate=_BAUD, parity="N", timeout=_SOON_S, exclusive=None)

    held = [near, far]

    def pull() -> None:
        while held:
            os.close(held.pop())

    seen = _through(steps, opened, lambda data: (os.write(near, data), None)[1], pull, wait)
    pull()
    return seen, received


def port_in_world(steps: Steps) -> tuple[list[object], bytes]:
    """The same on a line of a world."""
    hub, received, seen = Hub(1, hurry=0.0), bytearray(), list[object]()
    standing = WorldSystem(hub, {}, {}, (0.0, 0.0))
    line = standing.lines["/dev/null"] = SerialLine(hub, received.extend)
    line.delay_s = (1e-5, 5e-5)
    process = standing.new_process("program")

    def opened() -> SerialPort:
        return standing.serial("/dev/null", baudrate=_BAUD, parity="N", timeout=_SOON_S, exclusive=None)

    def main() -> int:
        seen.extend(_through(steps, opened, line.from_device, lambda: line.pull(100.0), standing.sleep))
        return 0

    with system.replaced_by(standing):
        process.begin(main)
        hub.run(100.0, lambda: not standing.living)
    return seen, bytes(received)


if sys.platform != "linux":
    raise ImportError("only Linux is what it is held against")
