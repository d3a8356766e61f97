"""CAN for simulated devices: one process has python-can's virtual bus, several meet at a small hub on TCP."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, Protocol

from sim_devices._field import Side
from sim_devices._listener import Listener
from sim_devices._quirks import Behaviour, Quirks

_TICK_S = 0.01
# A client reads the answer to its last command by itself; frames that came right behind it would spoil it.
_ANSWER_ALONE_S = 0.05
Frame = tuple[int, bytes]
"""Identifier (above 0x7FF: 29 bit) and data."""


class Node(Protocol):
    """A device on a bus: it is told of every frame, and of time.

    Attributes:
        answers_by_itself: its readings come without being asked for, so quirks spoil those.
    """

    answers_by_itself: bool

    def on_frame(self, identifier: int, data: bytes) -> Iterator[Frame]:
        """What it sends in answer to a frame."""
        ...

    def tick(self) -> Iterator[Frame]:
        """What it sends by itself; called all the time."""
        ...

    def restart(self) -> None:
        """Be as after power-on."""
        ...


class Hub:
    """A bus of TCP connections in the protocol of socketcand: what one sends the others receive.

    Raises:
        FileError: the port is taken by something else.
    """

    def __init__(self, host: str, port: int) -> None:
        self._listener = Listener(host, port)
        self.host, self.port = self._listener.host, self._listener.port
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._members: dict[socket.socket, float] = {}  # and from when on they may be told of frames
        self._threads: list[threading.Thread] = []
        self._start(self._accept)

    def close(self) -> None:
        """End the bus. May be called twice."""
        self._ended.set()
        self._listener.close()
        with self._lock:
            members, self._members = list(self._members), {}
        for member in members:
            with suppress(OSError):
                member.shutdown(socket.SHUT_RDWR)
            member.close()
        for thread in self._threads:
            thread.join(2.0)

    def _start(self, run: Any, *args: object) -> None:
        thread = threading.Thread(target=run, args=args, name="hil-can-hub", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _accept(self) -> None:
        for member in self._listener.clients():
            member.settimeout(None)
            try:
                member.sendall(b"< hi >")
            except OSError:  # it only looked whether somebody listens here
                member.close()
                continue
            self._start(self._serve, member)

    def _serve(self, member: socket.socket) -> None:
        received = b""
        while not self._ended.is_set():
            try:
                more = member.recv(4096)
            except OSError:
                break
            if not more:
                break
            *commands, received = (received + more).split(b">")
            for command in commands:
                self._obey(member, command.decode("ascii", "replace").strip(" <").split())
            if len(received) > 4096:
                received = b""
        with self._lock:
            self._members.pop(member, None)
        member.close()

    def _obey(self, member: socket.socket, words: list[str]) -> None:
        if words[:1] == ["open"]:
            self._tell(member, b"< ok >")
        elif words[:1] == ["rawmode"]:
            with self._lock:
                self._members[member] = time.monotonic() + _ANSWER_ALONE_S
                self._tell(member, b"< ok >")
        elif words[:1] == ["send"] and (frame := _frame(words)):
            with self._lock:
                others = [(other, ready_s) for other, ready_s in self._members.items() if other is not member]
            for other, ready_s in others:
                time.sleep(max(ready_s - time.monotonic(), 0.0))
                self._tell(other, frame)

    def _tell(self, member: socket.socket, text: bytes) -> None:
        with suppress(OSError):
            member.sendall(text)


def _frame(words: list[str]) -> bytes:
    """What the others are told of a `send`, nothing if it makes no sense."""
    try:
        data = bytes(int(word, 16) for word in words[3:])
        identifier = int(words[1], 16)
        if len(data) != int(words[2], 16) or len(data) > 8 or not 0 <= identifier < 1 << 29:
            return b""
    except (ValueError, IndexError):
        return b""
    return f"< frame {words[1]} 0.000000 {data.hex().upper()} >".encode("ascii")


_HUBS: dict[str, tuple[Hub, int]] = {}


class CanServer:
    """A node on a bus, in threads of its own.

    Attributes:
        where: the bus, as a driver names it.
        behaviour: its quirks.
        node: what answers; side: its terminals.

    Args:
        node: the device.
        side: its terminals.
        quirks: at the start.
        address: `virtual:NAME`, `socketcand:HOST:PORT` (a hub is made there), or what python-can knows.
    """

    def __init__(self, node: Node, side: Side, quirks: Quirks, address: str) -> None:
        import can

        self.behaviour = Behaviour(quirks)
        self.node, self.side = node, side
        interface, _, channel = address.partition(":")
        self._hub = ""
        if interface == "socketcand":
            address, host, port = _hub_at(channel)
            self._hub = address
            self._bus = can.Bus(interface=interface, channel="can0", host=host, port=port, tcp_tune=True)
        else:
            self._bus = can.Bus(interface=interface, channel=channel)
        self.where = address
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._threads = [threading.Thread(target=run, name="hil-node", daemon=True) for run in (self._hear, self._tick)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Leave the bus. May be called twice."""
        if self._ended.is_set():
            return
        self._ended.set()
        for thread in self._threads:
            thread.join(2.0)
        self._bus.shutdown()
        if self._hub:
            _leave_hub(self._hub)

    def _hear(self) -> None:
        import can

        while not self._ended.is_set():
            try:
                message = self._bus.recv(0.1)
            except can.CanError:
                return
            if message is not None and not message.is_error_frame:
                with self._lock:
                    answers = list(self.node.on_frame(message.arbitration_id, bytes(message.data)))
                if answers:
                    self._reply(answers)

    def _reply(self, answers: list[Frame]) -> None:
        quirks = self.behaviour.next_answer()
        self.side.quirks = quirks
        if quirks.reboot:
            with self._lock:
                self.node.restart()
            return
        if quirks.late_s and self._ended.wait(quirks.late_s):
            return
        for identifier, data in answers:
            sent = self.behaviour.mangled(data, quirks)
            if sent or not data:
                self._send(identifier, sent)

    def _tick(self) -> None:
        while not self._ended.wait(_TICK_S):
            with self._lock:
                frames = list(self.node.tick())
            if frames and self.node.answers_by_itself:
                self._reply(frames)
            elif not self.behaviour.quirks.silent:
                for frame in frames:
                    self._send(*frame)

    def _send(self, identifier: int, data: bytes) -> None:
        import can

        with suppress(can.CanError, OSError):
            self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=identifier > 0x7FF))


def serve_node(node: Node, settings: Mapping[str, Any], side: Side, quirks: Quirks) -> CanServer:
    """Serve a node on the bus that a driver's settings name."""
    return CanServer(node, side, quirks, str(settings["address"]))


def _hub_at(channel: str) -> tuple[str, str, int]:
    """The hub at HOST:PORT, made by the first node there; its address, host and port."""
    address = f"socketcand:{channel}"
    if address not in _HUBS:
        host, _, port = channel.rpartition(":")
        hub = Hub(host, int(port))
        address = f"socketcand:{hub.host}:{hub.port}"
        _HUBS[address] = (hub, 0)
    hub, nodes = _HUBS[address]
    _HUBS[address] = (hub, nodes + 1)
    return address, hub.host, hub.port


def _leave_hub(address: str) -> None:
    hub, nodes = _HUBS.pop(address)
    if nodes > 1:
        _HUBS[address] = (hub, nodes - 1)
    else:
        hub.close()
