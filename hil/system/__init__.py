"""The seam between what acts on a bench and the operating system: the rooms that act use nothing of it but this."""

from __future__ import annotations

import atexit
import ctypes
import os
import select
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from datetime import UTC, datetime
from io import FileIO
from queue import SimpleQueue
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from hil.child import Process
    from hil.system.parent import Parent

Handler = Callable[[int, FrameType | None], object] | int | None
_T = TypeVar("_T")
_NOBODY = struct.pack("HHQ", socket.AF_UNSPEC, 0, 0)
_UNACKNOWLEDGED = 0x5411  # SIOCOUTQ


class System:
    """Clocks, threads, processes, signals, connections and writing to the disk.

    Run, guard, watchdog, recorder and drivers do nothing of that but through `hil.system.system`. A value with the same
    methods can stand in for it (`replaced_by`): the tests run the same code in a world of their own, in virtual time.
    """

    now_s = staticmethod(time.monotonic)
    sleep = staticmethod(time.sleep)
    pid = staticmethod(os.getpid)
    thread_id = staticmethod(threading.get_native_id)
    sync = staticmethod(os.fsync)
    handler_of = staticmethod(signal.getsignal)
    raise_signal = staticmethod(signal.raise_signal)
    not_at_exit = staticmethod(atexit.unregister)

    def __init__(self) -> None:
        self._of_process: dict[type, Any] = {}

    def utc(self) -> datetime:
        """The date and time of day."""
        return datetime.now(UTC)

    def awake_or_asleep_s(self) -> float | None:
        """A clock that goes on while the computer sleeps; None where there is none."""
        boottime = getattr(time, "CLOCK_BOOTTIME", None)  # Linux; elsewhere nothing tells
        return None if boottime is None else time.clock_gettime(boottime)

    def thread(self, run: Callable[..., object], *arguments: Any, name: str = "hil") -> threading.Thread:
        """A thread that is not begun yet; it keeps no process from ending."""
        return threading.Thread(target=run, args=arguments, name=name, daemon=True)

    def later(self, after_s: float, do: Callable[[], object]) -> threading.Timer:
        """Does something after a time, unless it is cancelled; not begun yet."""
        timer = threading.Timer(after_s, do)
        timer.daemon = True
        return timer

    def is_this_thread(self, thread: threading.Thread) -> bool:
        """Whether it is the one that asks."""
        return thread is threading.current_thread()

    def is_main_thread(self) -> bool:
        """Whether signals are handled in the thread that asks."""
        return threading.current_thread() is threading.main_thread()

    def lock(self) -> AbstractContextManager[Any]:
        """Held by one thread at a time."""
        return threading.Lock()

    def rlock(self) -> Any:
        """Held by one thread at a time, as often as it likes."""
        return threading.RLock()

    def event(self) -> threading.Event:
        """Set and waited for by several."""
        return threading.Event()

    def queue(self) -> SimpleQueue[Any]:
        """What one thread hands to another."""
        return SimpleQueue()

    def of_process(self, kind: type[_T]) -> _T:
        """The one value of its kind in this process, made when it is asked for first."""
        if kind not in self._of_process:
            self._of_process[kind] = kind()
        return self._of_process[kind]  # type: ignore[no-any-return]

    def at_exit(self, do: Callable[[], object]) -> None:
        """Do it when the process ends in order."""
        atexit.register(do)

    def leave(self, status: int) -> None:
        """End this process at once: nothing of it is done any more."""
        os._exit(status)

    def child(self, module: str, arguments: Sequence[str], environment: Mapping[str, str], **how: Any) -> Process[Any]:
        """A process of ours, as `hil.child.child` starts it."""
        from hil.child import child

        return child(module, arguments, environment, **how)

    def parent(self, pid: int) -> Parent[Any]:
        """The program that started this process, as it is heard and answered."""
        from hil.system.parent import Parent

        return Parent(pid)

    def handle(self, number: int, handler: Handler) -> None:
        """What becomes of a signal; from the main thread."""
        signal.signal(number, handler)

    def interrupt_main_thread(self, number: int) -> bool:
        """Send a signal to the main thread, also where it waits; whether it can be."""
        main = threading.main_thread().ident
        if main is None or not hasattr(signal, "pthread_kill"):
            return False
        signal.pthread_kill(main, number)
        return True

    @contextmanager
    def blocking(self, numbers: Collection[int]) -> Iterator[None]:
        """Signals that are not delivered inside; what is started there is born with that."""
        if not hasattr(signal, "pthread_sigmask"):
            yield
            return
        before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def unblock(self, numbers: Collection[int]) -> None:
        """Deliver them again."""
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)

    def addresses(self, host: str, port: int) -> list[Any]:
        """Family, kind, protocol and place of each TCP address of a computer. Raises `OSError`."""
        return [found[:3] + found[4:] for found in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)]

    def new_socket(self, family: int, kind: int, protocol: int) -> socket.socket:
        """A socket."""
        return socket.socket(family, kind, protocol)

    def is_readable(self, held: socket.socket, wait_s: float) -> bool:
        """Whether something has come on a socket, also its end, waited for so long. Raises `OSError`."""
        ready, _, _ = select.select([held], [], [], wait_s)
        return bool(ready)

    def unacknowledged(self, held: socket.socket) -> int:
        """How many bytes were sent that the other side has not acknowledged; 0 where nothing tells."""
        try:
            import fcntl

            return int(struct.unpack("i", fcntl.ioctl(held.fileno(), _UNACKNOWLEDGED, b"\0" * 4))[0])
        except (ImportError, OSError, ValueError):  # not told here, or closed
            return 0

    def forget(self, held: socket.socket) -> None:
        """Have the kernel throw away all that it still holds of a connection, whoever else has the socket."""
        ctypes.CDLL(None).connect(held.fileno(), _NOBODY, len(_NOBODY))

    def serial(self, url: str, **speech: Any) -> Any:
        """A port of pyserial."""
        import serial

        return serial.serial_for_url(url, **speech)

    def can_bus(self, **which: Any) -> Any:
        """A bus of python-can."""
        import can

        return can.Bus(**which)

    def visa(self, name: str, timeout_s: float) -> Any:
        """A resource of VISA by pyvisa-py, which waits by itself on what it opens; looked for so long."""
        from pyvisa import ResourceManager

        return ResourceManager("@py").open_resource(name, open_timeout=max(1, round(1000.0 * timeout_s)))

    def serve(self, listener: Callable[[], _T], _service: object) -> _T:
        """A listener of `hil.bench.stop`, in an event loop of its own, which is not seen through here."""
        return listener()

    def write(self, file: FileIO, data: memoryview) -> int:
        """Write to a file what it takes at once; how many bytes that were."""
        return file.write(data) or 0

    def lock_file(self, path: str) -> Any:
        """A file that one process at a time may hold; not acquired."""
        from filelock import FileLock

        return FileLock(path, timeout=0)

    @contextmanager
    def replaced_by(self, other: object) -> Iterator[None]:
        """Inside, whoever asks this one is answered by another."""
        names = [name for name in dir(System) if not name.startswith("_") and name != "replaced_by"]
        before = dict(vars(self))
        vars(self).update({name: getattr(other, name) for name in names})
        try:
            yield
        finally:
            vars(self).clear()
            vars(self).update(before)


system = System()
