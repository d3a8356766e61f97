"""One exchange with a device on each link: our driver beside the bare library that it stands on.

    python benchmarks/links.py [TURNS]

The devices are simulated in one other process, on loopback or pseudo terminals. Driver and bare library take turns with
the same device and put the same requests on the line, as one sample of a polled loop does: output driven, inputs
read. The bare library believes whatever comes; the driver looks for expired watchdogs, late and implausible answers,
and, twice a second, whether outputs still stand. Times are medians by the clock on the wall.

On J1939 nobody waits for an answer, so that exchange is the computer's own time, with a pause before each that is not
counted.
"""

from __future__ import annotations

import logging
import socket
import string
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from table import Row, show

from hil.bench.read import BenchFile, read_bench

TURNS, TURN_S, WARM_UP = 4, 0.15, 10
PAUSE_S = 1e-3

Exchange = Callable[[], object]


class Way(NamedTuple):
    """One way of talking to a device."""

    name: str
    opened: Callable[[], AbstractContextManager[Exchange]]
    pause_s: float = 0.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def served() -> Iterator[BenchFile]:
    """The devices of links.toml, in a process of their own, until the end."""
    with tempfile.TemporaryDirectory() as folder:
        text = string.Template((Path(__file__).parent / "links.toml").read_text(encoding="utf-8"))
        path = Path(folder, "links.toml")
        ports = {f"{name}_port": free_port() for name in ("tcp", "canopen", "j1939")}
        path.write_text(text.substitute(folder=folder, **ports), encoding="utf-8")
        command = [sys.executable, "-m", "hil", "devices", str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                if not any("simulated" in line for line in process.stdout or ()):
                    raise SystemExit("the simulated devices did not start")
                yield read_bench(path)
            finally:
                process.terminate()


def driver(file: BenchFile, name: str) -> Callable[[], AbstractContextManager[Exchange]]:
    """What one sample of a polled loop does over our driver."""

    @contextmanager
    def opened() -> Iterator[Exchange]:
        device = file.devices[name]
        wiring = device.wiring(file.bench.channels)
        levels = {channel.terminal: 1.0 for channel in wiring.outputs.values()}
        with closing(device.module.open_link(device.settings, wiring)) as link:

            def exchange() -> object:
                if levels:
                    link.drive(levels)
                return link.read()

            yield exchange

    return opened


def modbus(file: BenchFile, name: str) -> Callable[[], AbstractContextManager[Exchange]]:
    @contextmanager
    def opened() -> Iterator[Exchange]:
        from pymodbus.client import ModbusSerialClient, ModbusTcpClient

        address = file.devices[name].settings.address
        host, _, port = address.rpartition(":")
        client: Any = ModbusTcpClient(host, port=int(port)) if host else ModbusSerialClient(address, baudrate=115200)
        client.connect()
        with closing(client):

            def exchange() -> object:
                client.write_registers(0, [3277], device_id=1)
                return client.read_input_registers(0, count=3, device_id=1)

            yield exchange

    return opened


def serial_lines(file: BenchFile, name: str, requests: list[bytes], end: bytes) -> Iterator[Way]:
    """Answers read byte by byte, as pyserial's `read_until` does, and all at once."""
    import serial

    def whole(port: Any) -> bytes:
        answer = b""
        while not answer.endswith(end):
            answer += port.read(max(1, port.in_waiting))
        return answer

    def way(read: Callable[[Any], object]) -> Callable[[], AbstractContextManager[Exchange]]:
        @contextmanager
        def opened() -> Iterator[Exchange]:
            with serial.Serial(file.devices[name].settings.address, 115200, timeout=1.0) as port:

                def exchange() -> object:
                    return [read(port) for request in requests if port.write(request)]

                yield exchange

        return opened

    yield Way("pyserial, what is waiting at once", way(whole))
    yield Way("pyserial, read_until", way(lambda port: port.read_until(end)))


def can_bus(file: BenchFile, name: str) -> Any:
    import can

    host, _, port = file.devices[name].settings.address.removeprefix("socketcand:").rpartition(":")
    return can.Bus(interface="socketcand", channel="can0", host=host, port=int(port), tcp_tune=True)


def canopen_pdo(file: BenchFile) -> Callable[[], AbstractContextManager[Exchange]]:
    """Heartbeat, set point and SYNC out, actual value back."""

    @contextmanager
    def opened() -> Iterator[Exchange]:
        import can

        told = [(0x77F, b"\x05"), (0x501, struct.pack("<Hhh", 7, 164, 0)), (0x080, b"")]
        frames = [can.Message(arbitration_id=i, data=data, is_extended_id=False) for i, data in told]
        bus = can_bus(file, "canopen")

        def exchange() -> object:
            for frame in frames:
                bus.send(frame)
            while (came := bus.recv(1.0)) is None or came.arbitration_id != 0x181:
                pass
            return came

        try:
            yield exchange
        finally:
            bus.shutdown()

    return opened


@contextmanager
def canopen_node(file: BenchFile) -> Iterator[Any]:
    import canopen

    network = canopen.Network(can_bus(file, "canopen"))
    network.NOTIFIER_CYCLE = 0.05
    network.connect()
    try:
        yield network.add_node(1, canopen.ObjectDictionary())
    finally:
        network.disconnect()


def driver_sdo(file: BenchFile) -> Callable[[], AbstractContextManager[Exchange]]:
    @contextmanager
    def opened() -> Iterator[Exchange]:
        device = file.devices["canopen"]
        with closing(device.module.open_link(device.settings, device.wiring(file.bench.channels))) as link:
            yield link.standing

    return opened


def canopen_sdo(file: BenchFile) -> Callable[[], AbstractContextManager[Exchange]]:
    @contextmanager
    def opened() -> Iterator[Exchange]:
        with canopen_node(file) as node:
            yield lambda: node.sdo.upload(0x6300, 1)

    return opened


def j1939(file: BenchFile) -> Callable[[], AbstractContextManager[Exchange]]:
    """A flow command out; whatever has come is taken in."""

    @contextmanager
    def opened() -> Iterator[Exchange]:
        import can

        data = bytes([2, 0xFF, 0x31, *[0xFF] * 5])
        command = can.Message(arbitration_id=3 << 26 | 0xFE31 << 8 | 0x26, data=data, is_extended_id=True)
        bus = can_bus(file, "j1939")

        def exchange() -> object:
            bus.send(command)
            newest = None
            while (came := bus.recv(0.0)) is not None:
                newest = came
            return newest

        try:
            yield exchange
        finally:
            bus.shutdown()

    return opened


def links(file: BenchFile) -> dict[str, list[Way]]:
    """By what is exchanged: our way first."""
    scpi = [b"SOUR:VOLT 1.00000,(@204);:SYST:ERR?\n", b"MEAS:VOLT:DC? (@101);:MEAS:VOLT:DC? (@102);:SYST:ERR?\n"]
    ours = {name: Way("hil driver", driver(file, name)) for name in file.devices}
    return {
        "Modbus TCP: write 1 register, read 3": [ours["tcp"], Way("pymodbus", modbus(file, "tcp"))],
        "Modbus RTU, pseudo terminal: write 1 register, read 3": [ours["rtu"], Way("pymodbus", modbus(file, "rtu"))],
        "SCPI, pseudo terminal: set 1 output, measure 2 inputs": [
            ours["scpi"], *serial_lines(file, "scpi", scpi, b"\n"),
        ],
        "ASCII module, pseudo terminal: read 8 inputs": [
            ours["ascii"], *serial_lines(file, "ascii", [b"#01\r"], b"\r"),
        ],
        "CANopen: set point, SYNC, actual value (PDO)": [ours["canopen"], Way("python-can", canopen_pdo(file))],
        "CANopen: one object (SDO)": [Way("hil driver", driver_sdo(file)), Way("canopen", canopen_sdo(file))],
        "J1939: flow command, the estimate that has come": [
            ours["j1939"]._replace(pause_s=PAUSE_S), Way("python-can", j1939(file), PAUSE_S),
        ],
    }  # fmt: skip


def timed(exchange: Exchange, pause_s: float) -> list[float]:
    """Seconds of each exchange, for a turn."""
    for _ in range(WARM_UP):
        exchange()
    taken_s, until_s = [], time.perf_counter() + TURN_S
    while time.perf_counter() < until_s:
        if pause_s:
            time.sleep(pause_s)
        begun_s = time.perf_counter()
        exchange()
        taken_s.append(time.perf_counter() - begun_s)
    return taken_s


def rows(ways: list[Way], turns: int) -> Iterator[Row]:
    taken_s: dict[str, list[float]] = {way.name: [] for way in ways}
    for _ in range(turns):
        for way in ways:
            with way.opened() as exchange:
                taken_s[way.name] += timed(exchange, way.pause_s)
    for name, each_s in taken_s.items():
        p99_ms = 1e3 * float(np.percentile(each_s, 99))
        yield Row(
            name, 1e3 * float(np.median(each_s)), f"{len(each_s) / sum(each_s):.0f} a second; p99 {p99_ms:.3g} ms"
        )


def main() -> None:
    logging.getLogger("can").setLevel(logging.CRITICAL)  # python-can tells of every frame that comes in two pieces
    turns = int(sys.argv[1]) if len(sys.argv) > 1 else TURNS
    with served() as file:
        for what, ways in links(file).items():
            show(f"one exchange on a link: {what}", rows(ways, turns))


if __name__ == "__main__":
    main()
