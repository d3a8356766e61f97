"""What the twin of a stranger's device is made of (docs/how-to/add-a-driver.md); nothing else here is for strangers.

A twin is a module of the same name as its driver, in a package that an entry point of the group `hil.sim_devices`
names. It says how the device is served; `Twin` makes of that what a bench file can name:

    def serve(settings, side, behave): ...    # a `Served`: one of the servers below, or your own
    _twin = Twin("NAME", serve, example="127.0.0.1:1502", free="127.0.0.1:0")
    Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq

and has `quirks` and `world` from here. By what it speaks:

- registers on Modbus TCP or RTU: `Table` of `Place`s, its `Timer`, `serve_registers`; an address space of your own is a
  class of `Registers`, which refuses (`Refused`) what yours leaves out
- lines of text on a serial port or TCP: `TextDevice`, `serve_text`
- frames on CAN: `Node`, `CanServer`, `Frame`
- any other bytes: a class with the methods of `Device`, and `TcpServer` or `PtyServer`

Behind every one of them is a `Side`: the terminals of the device, with the plant of the bench behind them. `Quirks` are
what the checks spoil answers with; the servers here do that by themselves.
"""

from sim_devices._can_bus import CanServer, Frame, Node
from sim_devices._field import Side
from sim_devices._lines_of_text import TextDevice, serve_text
from sim_devices._modbus_frames import Refused, Registers
from sim_devices._modbus_table import Place, Table, Timer, serve_registers
from sim_devices._quirks import Behaviour, Quirks
from sim_devices._stream import Device, PtyServer, StreamServer, TcpServer
from sim_devices._twin import Serve, Served, Twin, TwinSettings, quirks, world

__all__ = [
    "Behaviour",
    "CanServer",
    "Device",
    "Frame",
    "Node",
    "Place",
    "PtyServer",
    "Quirks",
    "Refused",
    "Registers",
    "Serve",
    "Served",
    "Side",
    "StreamServer",
    "Table",
    "TcpServer",
    "TextDevice",
    "Timer",
    "Twin",
    "TwinSettings",
    "quirks",
    "serve_registers",
    "serve_text",
    "world",
]
