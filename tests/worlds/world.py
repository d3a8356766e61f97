"""One run in a world, from before the bench is opened until nothing late can arrive, and what was said of it."""

from __future__ import annotations

import errno
import io
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from greenlet import getcurrent
from serial.tools import list_ports

from hil.bench import watchdog
from hil.bench.ending import LEAVES_S, LastWord, accounted
from hil.bench.open import open_rig
from hil.bench.read import BenchFile, read_bench
from hil.errors import exit_status_of, with_notes
from hil.record.recording import Array, Recording
from hil.safety.interrupt import ended_by, terminable
from hil.safety.operator import Operator
from hil.safety.outputs import Outputs
from hil.system import system
from hil.system.tcp import not_for_children
from tests.worlds.can_bus import CanBus, OnABus, Valve
from tests.worlds.devices import Coupler
from tests.worlds.network import Cable
from tests.worlds.nodes import Driver, Node
from tests.worlds.processes import Process
from tests.worlds.schedule import DEVICES, Fault, Schedule
from tests.worlds.serial_line import Amplifier, Controller, Module, OnALine, Source
from tests.worlds.system import STEP_S, WorldSystem
from tests.worlds.tasks import Hub, Task

NEAR = 0.6  # % of full scale: nearer than that an output stands at its safe value
LATE_S = 1.0  # nothing that has left this computer arrives later (see `hil.daq.link.DIRECT_S`)
LONGEST_S = 400.0  # no world goes on for longer
WATCHED_S = 30.0  # so long outputs are looked at once everybody has gone
WATCHDOG_S = 1.5  # longer than a run is silent while one device gives no answer
RAMP_PER_S, RATE_HZ = 140.0, 20.0
IDENTITIES = {"io": "WAGO 750-352 A1", "aux": "WAGO 750-352 B2"}
BENCH = """\
name = "world"
sample_rate_hz = {rate}
[valve]
name = "none"
plant = "brevini-hpv41"
settling_s = 0.2
[devices.io]
driver = "modbus"
model = "wago-750"
address = "10.0.0.1:502"{armed}
[devices.aux]
driver = "modbus"
model = "wago-750"
address = "10.0.0.2:502"{armed}
[channels.command]
role = "command"
device = "io"
terminal = "ao0"
unit = "%"
calibration = {{ slope = 10.0 }}
safe = 0.0
witness = "flow"
limits = {{ low = -100.0, high = 100.0 }}{ramp}
[channels.flow]
role = "response"
device = "io"
terminal = "ai0"
unit = "l/min"
calibration = {{ slope = 10.0 }}
[channels.enable]
device = "aux"
terminal = "ao0"
unit = "V"
safe = 0.0
on = 5.0
limits = {{ low = 0.0, high = 10.0 }}
[channels."supply pressure"]
device = "aux"
terminal = "ai1"
unit = "bar"
calibration = {{ slope = 25.0 }}
[interlocks.over-pressure]
channel = "supply pressure"
high = 140.0
for_s = 0.02
action = "trip"
[channels."emergency stop"]
role = "emergency stop"
device = "aux"
terminal = "ai2"
unit = "V"
pressed_below = 2.0
[interlocks.low-pressure]
channel = "supply pressure"
low = 40.0
for_s = 0.02
action = "hold"
[protection]
block_s = {block}
patience_s = 20.0
watchdog_s = {watchdog}
"""
THIRD_BENCH = """
[channels.pilot]
device = "third"
terminal = "{terminal}"
unit = "{unit}"
safe = 0.0
on = {on}
limits = {{ low = 0.0, high = {high}, slew_per_s = {high} }}
[devices.third]
address = "{address}"
timeout_s = {timeout_s}
longest_reply_s = 0.25
"""
PORT, BUS = "/dev/null", "can0"  # a port must be there, and nothing of this one is touched
THIRD: dict[str, tuple[dict[str, object], str]] = {
    "module": ({"terminal": "ao0", "unit": "V", "on": 5.0, "high": 10.0, "address": PORT},
               'driver = "ascii_module"\nmodel = "adam-4024"\nmodule = 1\nbaud = 38400'),
    "source": ({"terminal": "current", "unit": "A", "on": 1.5, "high": 3.0, "address": PORT},
               'driver = "scpi"\nmodel = "dc-source"\npause_s = 0.005'),
    "amplifier": ({"terminal": "ao", "unit": "V", "on": 5.0, "high": 10.0, "address": PORT},
                  """driver = "modbus"
transport = "rtu"
baud = 38400
[devices.third.description]
summary = "an amplifier that must be enabled"
source = "tests/worlds/serial_line.py"
modbus = {addresses = "wire"}
watchdog = {arm = [{address = 10, value = "{tenths}"}], expires_to = 0.0}
safe_mode = {status = {table = "coil", address = 16}, clear = {table = "coil", address = 32}}
enable = {write = [{address = 11, value = 1}], ready = {table = "input", address = 5, bit = 0}, \
disable = [{address = 11, value = 0}]}
faults = {flags = [{table = "input", address = 6, bit = 0, means = "it is too hot"}], \
clear = [{address = 12, value = 1}]}
[devices.third.description.terminals.ao]
direction = "out"
unit = "V"
range = [0.0, 10.0]
address = 0
table = "holding"
slope = 0.001
[devices.third.description.terminals.ai]
direction = "in"
unit = "V"
range = [0.0, 11.0]
address = 0
table = "input"
slope = 0.001
"""),
    "controller": ({"terminal": "set point", "unit": "l/min", "on": 50.0, "high": 100.0, "address": PORT},
                   'driver = "text"\nmodel = "alicat-mc"\nbaud = 38400'),
    "node": ({"terminal": "ao1", "unit": "V", "on": 5.0, "high": 10.0, "address": f"socketcan:{BUS}"},
             'driver = "canopen"\nmodel = "io-401"\nnode = 5'),
    "driver": ({"terminal": "demand", "unit": "V", "on": 5.0, "high": 10.0, "address": f"socketcan:{BUS}"},
               f"""driver = "can"
[devices.third.description]
summary = "a driver of a valve, by its messages"
source = "tests/worlds/nodes.py"
dbc = "{Path(__file__).with_name("pilot.dbc")}"
watchdog = {{time_s = 0.3, expires_to = 0.0}}
[devices.third.description.messages.Command]
every_s = 0.1
counter = "Count"
checksum = {{signal = "Sum", kind = "sum"}}
[devices.third.description.messages.State]
every_s = 0.02
timeout_s = 0.3
counter = "Count"
checksum = {{signal = "Sum", kind = "sum"}}
[devices.third.description.terminals.demand]
direction = "out"
unit = "V"
range = [0.0, 10.0]
message = "Command"
signal = "Demand"
read_back = {{message = "State", signal = "Held"}}
close = 0.002
[devices.third.description.terminals.output]
direction = "in"
unit = "V"
range = [0.0, 11.0]
message = "State"
signal = "Output"
"""),
    "valve": ({"terminal": "flow command", "unit": "%", "on": 40.0, "high": 100.0, "address": f"socketcan:{BUS}"},
              'driver = "j1939_valve"'),
}  # fmt: skip
THIRD_READS = {"source": ("coil current", "A"), "amplifier": ("ai", "V"), "valve": ("estimated flow", "%"),
               "controller": ("mass flow", "l/min"), "node": ("ai1", "V"), "driver": ("output", "V")}  # fmt: skip
OUTPUTS = {"command": "io", "enable": "aux"}
PILOT = "pilot"
UNITS = {"command": "%", "enable": "V"}
FULL_SCALE = {"command": 100.0, "enable": 10.0}
SIGNALS = {"int": signal.SIGINT, "term": signal.SIGTERM, "hup": signal.SIGHUP, "kill": signal.SIGKILL}


@dataclass
class Word:
    """Something that was said of outputs, by whom and when.

    Attributes:
        safe: the outputs that are called safe, each with the instant since when.
        states: of all of them, where they are told.
    """

    by: str
    at_s: float
    safe: dict[str, float]
    text: str = ""
    states: dict[str, str] = field(default_factory=dict)


@dataclass
class Ran:
    """What came of a schedule.

    Attributes:
        status: of the run; None: it never ended.
        words: everything that was said.
        changes: of each output, as its device has them.
        took: the faults that took effect, each with the phase that the run was in; took_s: when.
        broken: every invariant that does not hold.
        blocks: how many were driven.
        asked: commands that the procedure asked for, in order; handed: what it was handed back of command and flow.
        errors: that ended the run, or another program that wanted its bench: kinds and texts.
        stops, holds: what each service said to who pressed that.
    """

    schedule: Schedule
    status: int | None = None
    words: list[Word] = field(default_factory=list)
    said: list[tuple[float, str, str]] = field(default_factory=list)
    changes: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    took: list[tuple[Fault, str]] = field(default_factory=list)
    took_s: list[float] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)
    laws: set[str] = field(default_factory=set)
    blocks: int = 0
    asked: list[Array] = field(default_factory=list)
    errors: list[tuple[type[BaseException], str]] = field(default_factory=list)
    handed: list[tuple[Array, Array]] = field(default_factory=list)
    calls: int = 0
    ended_s: float = 0.0
    pokes: dict[str, list[float]] = field(default_factory=dict)
    stops: list[Stop] = field(default_factory=list)
    holds: list[Hold] = field(default_factory=list)


class Stop(NamedTuple):
    """Somebody pressed stop at `asked_s`, and had this answer at `answered_s`; `is_done`: it was the last one."""

    asked_s: float
    answered_s: float
    is_done: bool
    answer: dict[str, Any]


class Hold(NamedTuple):
    """Somebody asked for a hold, and for its end, and read how the run stands to it just before that."""

    asked_s: float
    released_s: float
    state: str


_files: dict[str, BenchFile] = {}


def _bench(schedule: Schedule) -> BenchFile:
    """The bench as a process reads it: its devices are not known yet."""
    text = BENCH.format(
        armed="\nwatchdog_s = 1.0" if schedule.armed else "", watchdog=WATCHDOG_S, rate=RATE_HZ, block=schedule.block_s,
        ramp=f"\nramp_to_safe_per_s = {RAMP_PER_S}" if schedule.ramped else "",
    )  # fmt: skip
    text += _third(schedule) if schedule.third else ""
    if text not in _files:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "bench.toml")
            path.write_text(text, encoding="utf-8")
            _files[text] = read_bench(path)
    file = _files[text]
    return replace(file, devices={name: replace(device) for name, device in file.devices.items()})


def _third(schedule: Schedule) -> str:
    about, how = THIRD[schedule.third]
    has_own = schedule.armed and schedule.third in ("module", "amplifier", "node")
    timeout_s = 0.25 if schedule.third in ("valve", "driver") else 0.1
    channels = THIRD_BENCH.format(**about, timeout_s=timeout_s) + ("watchdog_s = 1.0\n" if has_own else "") + how
    if schedule.third in THIRD_READS:
        terminal, unit = THIRD_READS[schedule.third]
        channels += f'\n[channels."pilot reads"]\ndevice = "third"\nterminal = "{terminal}"\nunit = "{unit}"\n'
    return channels


class World:
    """The run, its watchdog, its devices and what happens to them.

    Args:
        schedule: what happens.
        folder: where the run folder is written.
    """

    def __init__(self, schedule: Schedule, folder: Path) -> None:
        self.schedule, self.folder = schedule, folder
        self.hub = Hub(schedule.seed, schedule.hurry)
        self.ran = Ran(schedule, pokes={name: [] for name in (*DEVICES, "third")})
        self.cables = {name: Cable(self.hub, (1e-4, 1e-3)) for name in DEVICES}
        pressure = round(100.0 / 25.0 / 10.0 * 0x7FFF)
        self.couplers = {
            name: Coupler(self.hub, cable, IDENTITIES[name], pressure) for name, cable in self.cables.items()
        }
        self.strangers: dict[str, Coupler] = {}
        hosts = {("10.0.0.1", 502): self.couplers["io"].host, ("10.0.0.2", 502): self.couplers["aux"].host}
        self.system = WorldSystem(self.hub, hosts, {"hil.bench.watchdog": watchdog.main}, (0.2, 1.0))
        self.third = _THIRDS[schedule.third](self.hub) if schedule.third else None
        if isinstance(self.third, OnABus):
            self.system.buses[BUS] = self.third.line
        elif self.third is not None:
            self.system.lines[PORT] = self.third.line
        third = {} if self.third is None else {"third": self.third}
        self.devices: dict[str, Coupler | OnALine | OnABus] = {**self.couplers, **third}
        self.outputs, self.units = dict(OUTPUTS), dict(UNITS)
        if self.third is not None:
            self.outputs[PILOT], self.units[PILOT] = "third", str(THIRD[schedule.third][0]["unit"])
        for device in self.devices.values() if schedule.away else ():
            device.put(35.0)
        self.run = self.system.new_process("run")
        self.phase = "opening"
        self.moved = False
        self.after: Process | None = None
        self.reads_wrong = False  # a sector of what was written, from now on
        self.begun_s: dict[str, float] = {}
        self.swallowed_s = 0.0  # when its procedure heard first that something had ended the run
        self.stderr = _Stderr(self)

    def go(self) -> Ran:
        """Let it all happen."""
        self.couplers["io"].watchers.append(self._moved)
        with self._in_place():
            self.run.begin(self._main)
            self.run.held.append(lambda: self._begins("making safe"))
            self._begins("opening")
            self.hub.run(LONGEST_S, lambda: not self.system.living)
            self.ran.ended_s, self.ran.calls = self.hub.now_s, self.hub.calls
            if not self.system.living:
                self.hub.run(self.hub.now_s + WATCHED_S)
                self._come_after()
            self.hub.leave()
        self.ran.status = self.run.status
        self.ran.changes = {name: self.devices[device].changes for name, device in self.outputs.items()}
        return self.ran

    @contextmanager
    def _in_place(self) -> Iterator[None]:
        state = {"HIL_STATE_DIR": str(self.folder / "state"), "HIL_LANGUAGE": "en"}
        with (
            system.replaced_by(self.system), patch.dict(os.environ, state), patch.object(sys, "stderr", self.stderr),
            patch.object(watchdog, "read_bench", lambda _path: _bench(self.schedule)),
            patch.object(list_ports, "comports", list),
        ):  # fmt: skip
            yield

    def _main(self) -> int:
        known, file = _Known(lambda: self._begins("making safe")), _bench(self.schedule)
        known.announce = lambda text: self.say("run", text)

        def said(error: BaseException) -> int:
            known.mark(error)
            self.ran.errors.append((type(error), str(error)))
            self.say("run", with_notes(error))
            self._word("run", known)
            return exit_status_of(error)

        word = LastWord(said)
        try:
            with (
                accounted(known), terminable(),
                open_rig(file, self.folder / "run", {}, lambda *_: None, (), None, known, "", Operator(), None, word)
                as rig,
            ):  # fmt: skip
                self._begins("driving")
                self._procedure(rig)
        except BaseException as error:
            return word.say(ended_by(error))
        self.say("run", known.text)
        self._word("run", known)
        return 0

    def _procedure(self, rig: Any) -> None:
        kind = self.schedule.procedure
        up = np.linspace(0.0, 70.0, 20)

        def play(command: Array) -> None:
            self.ran.asked.append(command)
            self._handed(rig.play(command))

        def stream(commands: list[Array]) -> Iterator[None]:
            self.ran.asked += commands
            yield from map(self._handed, rig.stream(commands))

        def stand() -> None:
            for _ in range(10):
                play(np.full(10, 70.0))
                self.ran.blocks += 5

        if kind == "stays":
            try:
                play(up)
                stand()
            except BaseException:
                self.swallowed_s = self.hub.now_s
                system.sleep(2.0 * LEAVES_S)
            return
        if kind == "swallows":
            for _ in range(4):
                try:
                    play(up)
                    stand()
                except BaseException:
                    self.swallowed_s = self.swallowed_s or self.hub.now_s
                    system.sleep(0.1)
            return
        play(up)
        if kind == "steps":
            for level in (20.0, -40.0, 70.0, 0.0, 70.0):
                play(np.full(20, level))
                self.ran.blocks += 10
        elif kind == "leaves early":
            for _ in stream([np.full(10, 70.0)] * 20):
                self.ran.blocks += 5
            for _ in stream([np.full(10, 50.0)] * 20):
                break
        else:
            stand()
        if kind == "raises":
            raise ValueError("a fault of the procedure")
        if kind == "exits":
            sys.exit(5)
        if kind == "blocks":
            system.sleep(3.0)

    def _handed(self, recording: Recording) -> None:
        self.ran.handed.append((recording.channels["command"].values, recording.channels["flow"].values))

    def say(self, by: str, text: str) -> None:
        self.ran.said.append((self.hub.now_s, by, text))

    def _word(self, by: str, known: Outputs) -> None:
        safe = {name: self.hub.now_s for name, output in known.by_name.items() if str(output.state) == "safe"}
        states = {name: str(output.state) for name, output in known.by_name.items()}
        self.moved = known.moved
        self.ran.words.append(Word(by, self.hub.now_s, safe, known.text, states))

    def _begins(self, phase: str) -> None:
        if phase in self.begun_s or (phase == "making safe" and self.phase == "opening"):
            return
        self.begun_s[phase] = self.hub.now_s
        self.phase = phase
        for fault in self.schedule.faults:
            if fault.phase == phase:
                self.hub.after(fault.after_s, lambda fault=fault: self._happen(fault))  # type: ignore[misc]

    def _moved(self) -> None:
        if self.phase == "making safe" and abs(self.devices["io"].percent) < NEAR:
            self._begins("closing")

    def _happen(self, fault: Fault) -> None:
        if not self.system.living:
            return
        self.ran.took.append((fault, self.phase))
        self.ran.took_s.append(self.hub.now_s)
        kind, after = fault.kind, self.hub.after
        if kind in SIGNALS:
            self.run.signal(SIGNALS[kind])
        elif kind == "pause":
            self.run.signal(signal.SIGSTOP)
            after(fault.lasts_s, lambda: self.run.signal(signal.SIGCONT))
        elif kind.startswith("wd "):
            self._to_watchdog(kind.removeprefix("wd "), fault.lasts_s)
        elif kind == "stop":
            self._press("stop", fault.lasts_s)
        elif kind == "hold run":
            self._press("hold", fault.lasts_s)
        elif kind == "second":
            self._second()
        elif kind == "sleep":
            self._sleep(fault.lasts_s)
        elif kind == "fork":
            self._fork(fault.lasts_s)
        elif kind in _OF_DISK:
            self._for_a_while(fault, self.system.disk, *_OF_DISK[kind], 0)
        elif kind == "clock":
            self._for_a_while(fault, self.system, "stepped_s", self.hub.draw.choice((-STEP_S, STEP_S)), 0.0)
        elif kind == "power":
            self._cut_power()
        elif kind == "sector":
            self.reads_wrong = True
        elif kind == "switch":
            for cable in self.cables.values():
                self._for_a_while(fault, cable, "is_out", True, False)
        elif fault.device == "third":
            self._to_third(fault)
        else:
            self._to_coupler(fault, self.cables[fault.device], self.couplers[fault.device])

    def _for_a_while(self, fault: Fault, thing: object, name: str, value: object, after: object) -> None:
        setattr(thing, name, value)
        self.hub.after(fault.lasts_s, lambda: setattr(thing, name, after))

    def _to_coupler(self, fault: Fault, cable: Cable, device: Coupler) -> None:
        for_a_while = partial(self._for_a_while, fault)
        match fault.kind:
            case "hold":
                cable.holds_s = 0.9 * LATE_S
                for_a_while(cable, "holds_chance", 0.2, 0.0)
            case "double":
                for_a_while(cable, "doubles", 0.3, 0.0)
            case "slow line":
                for_a_while(cable, "delay_s", (0.01, 0.15), (1e-4, 1e-3))
            case "crowd":
                for_a_while(device.host, "most", 0, device.host.most)
            case "reset":
                device.hang_up()
            case "over":
                for_a_while(self.couplers["aux"], "pressure", round(0.6 * 0x7FFF), round(0.4 * 0x7FFF))
            case "low":
                for_a_while(self.couplers["aux"], "pressure", round(0.1 * 0x7FFF), round(0.4 * 0x7FFF))
            case "pressed":
                for_a_while(self.couplers["aux"], "contact", 0, 0x7FFF // 2)
            case "sticks":
                for_a_while(self.couplers["io"], "stuck", self.couplers["io"].holding[0], None)
            case "swap":
                says = self.hub.draw.choice(
                    ("WAGO 750-352 C3", "WAGO 750-352 C3", "")
                )  # some say nothing of themselves
                stranger = self.strangers[fault.device] = Coupler(self.hub, cable, says)
                device.host.is_on = False
                for end in device.host.ends:
                    end.gone(None)
                stranger.host = device.host
                device.host.is_on, device.host.taken = True, stranger.taken
            case _:
                self._to_any(fault, cable, device)

    def _to_third(self, fault: Fault) -> None:
        for_a_while, device = partial(self._for_a_while, fault), self.third
        assert device is not None
        line = device.line
        usual_s = line.delay_s
        match fault.kind:
            case "hold" if isinstance(line, CanBus):
                for_a_while(line, "delay_s", (0.0, 0.2), usual_s)
            case "hold":
                for_a_while(line, "late_chance", 0.2, 0.0)
            case "slow line":
                for_a_while(line, "delay_s", (0.005, 0.05), usual_s)
            case "double":
                for_a_while(line, "doubles", 0.05, 0.0)
            case "passive":
                for_a_while(line, "is_passive", True, False)
            case "garble" | "echo":
                name, value = ("garbles", 0.05) if fault.kind == "garble" else ("echoes", True)
                for_a_while(line, name, value, type(value)())
            case "reset" if isinstance(line, CanBus):
                for_a_while(line, "is_off", True, False)
            case "reset":
                line.pull(fault.lasts_s)
            case "fails" if isinstance(device, Amplifier | Valve):
                device.fail(True)
                self.hub.after(fault.lasts_s, partial(device.fail, False))
            case "claims" if isinstance(device, Valve):
                device.take_address()
            case _:
                self._to_any(fault, line, device)

    def _to_any(self, fault: Fault, line: object, device: Coupler | OnALine | OnABus) -> None:
        """What happens alike to every device and to every way to it."""
        match fault.kind:
            case "out":
                self._for_a_while(fault, line, "is_out", True, False)
            case "lose":
                self._for_a_while(fault, line, "loses", 0.05, 0.0)
            case "deaf" | "mute" | "lies":
                self._for_a_while(fault, device, fault.kind, True, False)
            case "slow":
                self._for_a_while(fault, device, "slow_s", 0.08, 0.0)
            case "restart":
                device.restart(fault.lasts_s)
            case "poke":
                self.ran.pokes[fault.device].append(self.hub.now_s)
                device.put(28.0)

    @property
    def watchdog(self) -> Process | None:
        """The watchdog process, where one was started."""
        return next((one for one in self.system.processes if one.name == "hil.bench.watchdog"), None)

    @property
    def watchdog_ended_s(self) -> float:
        """When it was gone."""
        return self.watchdog.ended_s if self.watchdog else 0.0

    def _to_watchdog(self, kind: str, lasts_s: float) -> None:
        if (process := self.watchdog) is None:
            return
        process.signal({"term": signal.SIGTERM, "kill": signal.SIGKILL, "pause": signal.SIGSTOP}[kind])
        if kind == "pause":
            self.hub.after(lasts_s, lambda: process.signal(signal.SIGCONT))

    def _press(self, what: str, lasts_s: float) -> None:
        for process, service in self.system.services.values():
            if process.lives:
                process.tasks.append(self.hub.spawn(partial(self._pressed, service, what, lasts_s), process, "person"))

    def _pressed(self, service: Any, what: str, lasts_s: float) -> None:
        if what == "hold":
            asked_s = self.hub.now_s
            service.ask_to_hold(True)
            system.sleep(lasts_s)
            self.ran.holds.append(Hold(asked_s, self.hub.now_s, service.hold))
            service.ask_to_hold(False)
            return
        asked_s, asked, until_s = system.now_s(), service.stop("a person"), self.hub.now_s + 0.85
        while not asked.done() and self.hub.now_s < until_s:
            system.sleep(0.005)
        status = asked.result() if asked.done() else service.status
        self.ran.stops.append(Stop(asked_s, self.hub.now_s, asked.done(), status.answer(asked_s)))
        if status.is_confirmed:
            safe = {name: self.hub.now_s for name, output in status.outputs.items() if str(output.state) == "safe"}
            self.ran.words.append(Word("stop", self.hub.now_s, safe))

    def _second(self, name: str = "second") -> Process:
        """Another program wants the same bench."""
        process = self.system.new_process(name)

        def main() -> int:
            known = Outputs()
            try:
                with (
                    accounted(known),
                    open_rig(
                        _bench(self.schedule), self.folder / name, {}, lambda *_: None, output_states=known
                    ) as rig,
                ):
                    rig.play(np.zeros(5))
            except BaseException as error:
                self.ran.errors.append((type(error), str(error)))
                return exit_status_of(error)
            return 0

        process.begin(main)
        return process

    def _come_after(self) -> None:
        """Where an interlock has tripped, the next program wants the bench."""
        if any("then reset it with --reset" in text for _, by, text in self.ran.said if by == "run"):
            for path in self.folder.glob("state/trips/*.json") if self.reads_wrong else ():
                path.write_bytes(self.hub.draw.randbytes(path.stat().st_size))
            self.after = self._second("after")
            self.hub.run(self.hub.now_s + WATCHED_S, lambda: not self.system.living)

    def _sleep(self, lasts_s: float) -> None:
        """The computer sleeps: nothing runs, the devices go on."""
        awake = [process for process in self.system.processes if process.lives and not process.is_stopped]
        for process in awake:
            process.is_stopped = True
        began_s = self.hub.now_s

        def wake() -> None:
            self.system.asleep_s += self.hub.now_s - began_s
            for process in awake:
                process.signal(signal.SIGCONT)

        self.hub.after(lasts_s, wake)

    def _fork(self, lasts_s: float) -> None:
        """The procedure forks a child, which holds what nobody has closed there."""
        held = [one for one in self.run.sockets if one not in not_for_children]
        for one in held:
            one.holders += 1

        def end() -> None:
            for one in held:
                one.holders -= 1
                if not one.holders and one.end is not None:
                    one.end.close()

        self.hub.after(lasts_s, end)

    def _cut_power(self) -> None:
        """Of this computer; its devices have another supply."""
        for process in self.system.processes:
            process.die(-signal.SIGKILL)
        self.system.disk.cut(self.folder)


_THIRDS: dict[str, type[OnALine | OnABus]] = {
    "module": Module, "source": Source, "amplifier": Amplifier, "controller": Controller, "valve": Valve, "node": Node,
    "driver": Driver,
}  # fmt: skip
_OF_DISK = {"disk full": ("fails", errno.ENOSPC), "disk gone": ("fails", errno.EIO), "disk slow": ("slow_s", 0.3)}


class _Known(Outputs):
    """Tells when it begins to be made safe."""

    def __init__(self, begins: Callable[[], None]) -> None:
        super().__init__()
        self._begins = begins

    def make_safe(self, *about: Any, **more: Any) -> None:
        self._begins()
        super().make_safe(*about, **more)


class _Stderr(io.TextIOBase):
    """What each process says: of a child whose parent reads it, through its pipe."""

    def __init__(self, world: World) -> None:
        self._world = world

    def write(self, text: str) -> int:
        task = getcurrent()
        process = task.owner if isinstance(task, Task) else None
        if process is not None and text.strip():
            self._world.say(process.name, text.strip())
        return len(text)


def one(schedule: Schedule, judge: Callable[[World, Ran], None]) -> Ran:
    """A world, from its beginning to its end."""
    folder = Path(tempfile.mkdtemp(prefix="world-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    try:
        world = World(schedule, folder)
        ran = world.go()
        judge(world, ran)
        return ran
    finally:
        shutil.rmtree(folder, ignore_errors=True)
