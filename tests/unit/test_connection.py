"""Connections that are given up: nothing that was sent on them arrives later, when packets were lost meanwhile."""

from __future__ import annotations

import os
import select
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from hil.system.tcp import close, close_in_children, connect
from tests.lost_packets import lost
from tests.waits import until

pytestmark = pytest.mark.skipif(not hasattr(os, "register_at_fork"), reason="no fork here")
OUTAGE_S, AFTER_S = 0.5, 2.0  # a closed socket of the system's own sends again within 0.8 s of these


@contextmanager
def pair(timeout_s: float = 0.2) -> Iterator[tuple[socket.socket, socket.socket, socket.socket]]:
    """A connection of ours, its other side, and the listener."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        made = connect("127.0.0.1", listener.getsockname()[1], timeout_s)
        with made, listener.accept()[0] as other:
            other.settimeout(0.05)
            yield made, other, listener


def received(other: socket.socket, for_s: float) -> bytes:
    came, until_s = b"", time.monotonic() + for_s
    while time.monotonic() < until_s:
        with suppress(TimeoutError):
            try:
                more = other.recv(100)
            except ConnectionResetError:
                break
            if not more:
                break
            came += more
    return came


def given_up(made: socket.socket) -> None:
    close(made)


def given_up_beside_a_child(made: socket.socket) -> None:
    child = os.fork()
    if child == 0:
        time.sleep(OUTAGE_S + AFTER_S)
        os._exit(0)
    close(made)


def left_to_its_time_out(made: socket.socket) -> None:
    time.sleep(OUTAGE_S)
    made.close()


@pytest.mark.parametrize("how", [given_up, given_up_beside_a_child, left_to_its_time_out])
def test_what_was_sent_on_a_connection_that_was_given_up_does_not_arrive(how):
    with pair() as (made, other, listener):
        with lost(other, listener):
            made.sendall(b"old write")
            how(made)
            time.sleep(OUTAGE_S)
        assert received(other, AFTER_S) == b""


def test_nothing_arrives_from_a_process_that_was_killed_though_its_child_lives():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        program = os.fork()
        if program == 0:
            made = connect("127.0.0.1", listener.getsockname()[1], 5.0)
            made.recv(1)
            if os.fork():
                made.sendall(b"old write")
            time.sleep(2.0 * OUTAGE_S + AFTER_S)
            os._exit(0)
        with listener.accept()[0] as other:
            other.settimeout(0.05)
            with lost(other, listener):
                other.sendall(b"!")
                time.sleep(OUTAGE_S)
                os.kill(program, signal.SIGKILL)
                os.waitpid(program, 0)
                time.sleep(OUTAGE_S)
            assert received(other, AFTER_S) == b""


def test_what_was_sent_in_order_arrives_though_it_is_closed_at_once():
    with pair() as (made, other, _):
        made.sendall(b"safe")
        close(made, 1.0)
        assert received(other, AFTER_S) == b"safe"


def test_no_forked_child_holds_what_is_closed_in_children():
    reading, writing = os.pipe()
    held = os.fdopen(writing, "wb", buffering=0)
    close_in_children(held)
    child = os.fork()
    if child == 0:
        time.sleep(30.0)
        os._exit(0)
    try:
        held.close()
        until(lambda: select.select([reading], [], [], 0.0)[0])
        assert os.read(reading, 1) == b""
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(reading)
