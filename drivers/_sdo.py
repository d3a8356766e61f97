"""SDO transfers with a node of CANopen: the library's, with frames sent and heard by whoever asks."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from queue import Empty
from types import SimpleNamespace
from typing import Any

from hil.errors import HardwareError, LinkError
from hil.system import system


class Sdo:
    """The SDO server of a node.

    Args:
        node: its number.
        timeout_s: an answer that takes longer counts as none.
        send: a frame with an 11-bit identifier.
        receive: hands what comes within a time to `take`, and returns with the first that is anybody's there.
    """

    def __init__(
        self, node: int, timeout_s: float, send: Callable[[int, bytes], None], receive: Callable[[float], None]
    ) -> None:
        from canopen import ObjectDictionary
        from canopen.sdo.client import SdoClient

        self.node, self._receive, self._answers = node, receive, deque[bytes]()
        client: Any = SdoClient(0x600 + node, 0x580 + node, ObjectDictionary())  # type: ignore[no-untyped-call]
        self._client = client
        client.RESPONSE_TIMEOUT = timeout_s
        client.network = SimpleNamespace(send_message=lambda identifier, data: send(identifier, bytes(data)))
        client.responses = self

    def take(self, identifier: int, data: bytes) -> bool:
        """Take in a frame that came; whether it is an answer of this server."""
        is_answer = identifier == 0x580 + self.node
        self._answers += [data] * is_answer
        return is_answer

    def transfer(self, kind: str, index: int, sub: int, *data: bytes) -> bytes:
        """An `upload` or `download`.

        Raises:
            LinkError: it is refused, or no valid answer comes; of object 1000, by which a node is looked for, the
                library's `SdoCommunicationError`.
            DeviceLostError: the bus is gone.
        """
        from canopen import SdoAbortedError, SdoCommunicationError

        try:
            answer: bytes = getattr(self._client, kind)(index, sub, *data)
        except SdoAbortedError as error:
            raise LinkError(f"object {index:04X}.{sub}: {kind} refused, abort code {error.code:#010x}") from None
        except HardwareError:
            raise
        except Exception as error:  # whatever the library makes of what came
            if index == 0x1000 and isinstance(error, SdoCommunicationError):
                raise
            raise LinkError(f"object {index:04X}.{sub}: {error or type(error).__name__}") from error
        return answer

    def empty(self) -> bool:
        """Of the library's queue, before each request: what came until then is no answer to it."""
        self._receive(0.0)
        self._answers.clear()
        return True

    def get(self, *, timeout: float, **_how: object) -> bytes:
        """Of the library's queue: the next answer."""
        until_s = system.now_s() + timeout
        while not self._answers and (left_s := until_s - system.now_s()) > 0.0:
            self._receive(left_s)
        if not self._answers:
            raise Empty
        return self._answers.popleft()
