"""Somebody sets the time of day while a device is waited for: nothing waits longer than without."""

import os
import threading
import time
import tty

import pytest

from drivers import modbus
from hil.daq.channel import Wiring
from hil.errors import DeviceLostError, LinkError
from tests.channels import outputs


@pytest.fixture
def silent_line():
    """A serial line on which nobody answers."""
    master, slave = os.openpty()
    tty.setraw(slave)
    yield os.ttyname(slave)
    os.close(slave)
    os.close(master)


def test_answer_that_is_missing_on_a_serial_line(silent_line, monkeypatch):
    settings = modbus.Settings(model="wago-750", transport="rtu", address=silent_line, timeout_s=1.0)
    wiring = Wiring(outputs(["ao0"]), {})
    wall, stepped = time.time, threading.Event()
    monkeypatch.setattr(time, "time", lambda: wall() - (300.0 if stepped.is_set() else 0.0))
    threading.Timer(0.1, stepped.set).start()
    begun_s = time.monotonic()
    with pytest.raises((LinkError, DeviceLostError)):
        modbus.open_link(settings, wiring).standing()
    assert stepped.is_set() and time.monotonic() - begun_s < 150.0, "it waited until that time had come again"
