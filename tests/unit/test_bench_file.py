"""Bench files: every fault at once, each with its line and what to do about it."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.bench.fault import BenchError
from hil.bench.find import benches, find_bench
from hil.bench.read import read_bench
from hil.errors import FileError, UnknownNameError

GOOD = benches()["brevini-hpv41"].read_text(encoding="utf-8")


def faults(tmp_path: Path, text: str) -> list[str]:
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BenchError) as caught:
        read_bench(path)
    return [fault.removeprefix(f"{path}:") for fault in caught.value.faults]


def line_of(text: str, part: str) -> int:
    return next(number for number, line in enumerate(text.splitlines(), 1) if part in line)


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new, 1)


@pytest.mark.parametrize(
    ("old", "new", "key", "says"),
    [
        ("sample_rate_hz = 1000", "sample_rate_hz = 0", "sample_rate_hz", "greater than 0; found 0"),
        ("settling_s = 2.0", "settling = 2.0", "valve.settling", "did you mean 'settling_s'?"),
        ('plant = "brevini-hpv41"', 'plant = "brevini"', "valve.plant", "no plant named 'brevini'"),
        ('plant = "brevini-hpv41"', 'plant = "gone.json"', "valve.plant", "no model file"),
        ('simulated = "in_process"', 'simulated = "nowhere"', "devices.daq.simulated", "no device named 'nowhere'"),
        ('simulated = "in_process"', 'driver = "a"\nsimulated = "b"', "devices.daq", "either driver"),
        ("skew_s = 14e-6 ", "skew_s = -1 ", "devices.daq.skew_s", "greater than or equal to 0"),
        ('terminal = "ao0"', 'terminal = "ao7"', "channels.command.terminal", "device 'daq' has no 'ao7'; it has: ao0"),
        ('terminal = "ao0"', 'terminal = "ai9"', "channels.command.terminal", "ai9 is an input"),
        ('terminal = "ai1"', 'terminal = "ai0"', 'channels."spool position".terminal', "carries 'flow' already"),
        ('terminal = "ai1"', 'terminal = "ao1"', 'channels."spool position".terminal', "say where it is safe"),
        ('unit = "l/min"', 'unit = "l/minn"', "channels.flow.unit", "unknown unit"),
        ("calibration = { slope = 25.0", "calibration = { slope = 0.0",
         'channels."supply pressure".calibration', "slope 0"),
        ("low = -100.0, high = 100.0", "low = -100.0, high = 120.0", "channels.command.limits.high",
         "120 % needs 12 V; ao0 gives -10 … 10 V"),
        ("low = -100.0, high = 100.0", "low = 5.0, high = 100.0", "channels.command.safe", "0 % is outside the limits"),
        ("safe = 0.0", "safe = 0.0\non = 101.0", "channels.command.on", "101 % is outside the limits"),
        ("settling_s = 2.0", "limits = { low = 1.0, high = 2.0 }", "valve.limits", "leaves out the safe value 0"),
        ("low = -100.0, high = 100.0", "low = 50.0, high = 40.0", "channels.command.limits", "must be below high"),
        ("longest_s = 120.0", "longest_s = 0", "channels.command.limits.dwell.0.longest_s", "greater than 0"),
        ("low = -100.0, high = 100.0,", "low = -100.0, high = 100.0, slew_per_s = 50.0,",
         "channels.command.ramp_to_safe_per_s", "200 is faster than limits.slew_per_s = 50"),
        ('role = "response"', 'role = "command"', "channels.flow.role", "'command' is the command already"),
        ("block_s = 1.0 ", "watchdog_s = false ", "protection.watchdog_s", "should be a number; found False"),
        ("high = 140.0", "high = true", "interlocks.over-pressure.high", "should be a number; found True"),
        ("for_s = 0.02", "for_s = inf", "interlocks.over-pressure.for_s", "should be a finite number; found inf"),
        ("low = -5.0, high = 5.0 }", 'low = "nan", high = 5.0 }', "interlocks.flow-without-command.only_while.low",
         "should be a finite number; found 'nan'"),
        ("skew_s = 14e-6 ", "skew_s = true ", "devices.daq.skew_s", "should be a number; found True"),
        ("date = 2026-03-02", "date = 0", "channels.command.calibration.date", "should be a date, such as 2026-03-02"),
        ("[valve]", "valve = 3\n[valve_]", "valve", "should be a table; found 3"),
        ("flow = { noise = 0.3 }", "flow = 0.3", "simulation.instruments.flow", "should be a table; found 0.3"),
        ('role = "response"\n', "", "channels", 'no channel has role = "response"'),
        ('channel = "supply pressure"\nhigh', 'channel = "pressure"\nhigh', "interlocks.over-pressure.channel",
         "no channel 'pressure'; there are: command, flow"),
        ("high = 140.0", "high = 400.0", "interlocks.over-pressure.high", "400 bar is not within what"),
        ("high = 140.0\n", "", "interlocks.over-pressure", "nothing is asked for"),
        ('action = "trip"', 'action = "panic"', "interlocks.over-pressure.action", "found 'panic'"),
        ('witness = "flow"', 'witness = "flwo"', "channels.command.witness", "no channel 'flwo'"),
        ('witness = "flow"', 'witness = "command"', "channels.command.witness", "'command' is an output"),
        ('safe = 0.0', 'safe = 0.0\nsettles_s = 2.0', "channels.command.settles_s", "only an input that is"),
        ('minus = "command"', 'minus = "comand"', "interlocks.command-not-obeyed.minus", "no channel 'comand'"),
        ("only_while = { channel = \"command\"", "only_while = { channel = \"x\"",
         "interlocks.flow-without-command.only_while.channel", "no channel 'x'"),
        ("fluid_temperature_c = 40.0", 'fluid_temperature_c = "hot"', "conditions.fluid_temperature_c", "found 'hot'"),
        ("[[instruments]]\n", '[[instruments]]\nchannel = "none"\n', "instruments.0.channel", "no channel 'none'"),
        ("seed = 1", "seed = -1", "simulation.seed", "greater than or equal to 0"),
        ("seed = 1", 'plant = "brevini"', "simulation.plant", "did you mean 'brevini-hpv41'?"),
        ("seed = 1", "parameters = { dead_time = 0.5 }", "simulation.parameters.dead_time",
         "0.5 s; allowed are 0 … 0.2"),
        ("seed = 1", 'effects = [{ name = "friction", hook = "force", parameters = { coulomb = -2 } }]',
         "simulation.effects.0.parameters.coulomb", "-2 %; allowed are 0"),
        ("seed = 1", "parameters = { dead_bnd = 3 }", "simulation.parameters.dead_bnd", "no parameter 'dead_bnd'"),
        ("seed = 1", 'effects = [{ name = "rust" }]', "simulation.effects.0.name", "takes no 'rust'; it takes: "),
        ("seed = 1", 'effects = [{ name = "dead_time", parameters = { x = 1 } }]',
         "simulation.effects.0", "'dead_time' fits more than one place; say hook"),
        ("flow = { noise = 0.3 }", "flow = { noice = 0.3 }", "simulation.instruments.flow.noice",
         "did you mean 'noise'?"),
        ('{ signal = "command" }', '{ signal = "voltage" }', 'simulation.instruments."command read-back"',
         "no signal 'voltage' of plant brevini-hpv41"),
        ('{ signal = "command" }', "{ value = 1.0, signal = \"flow\" }", 'simulation.instruments."command read-back"',
         "either a signal of the plant (signal = …) or a value"),
        ("flow = { noise = 0.3 }", "flw = { noise = 0.3 }", "simulation.instruments.flw", "no channel 'flw'"),
        ('unit = "l/min"', 'unit = "bar"', "simulation.instruments.flow", "unit 'bar' cannot be read as 'l/min'"),
        ("sample_rate_hz = 1000", "sample_rate_hz = 0.5", "protection.block_s",
         "at sample_rate_hz = 0.5 a sample comes each 2 s"),
        ("[protection]", "[protecton]", "protecton", "is not known here; there are: name, sample_rate_hz"),
    ],
)  # fmt: skip
def test_one_fault(tmp_path, old, new, key, says):
    text = changed(old, new)
    found = faults(tmp_path, text)
    lines = [fault for fault in found if f": {key}: " in fault and says in fault]
    assert lines, found
    line = text.splitlines()[int(lines[0].split(":")[0]) - 1] if lines[0][0].isdigit() else ""
    assert any(part.strip('"') in line for part in key.split(".")) or key in ("channels",), (line, lines[0])


@pytest.mark.parametrize("text", ["\ufeff" + GOOD, GOOD.replace("\n", "\r\n")], ids=["mark", "line ends"])
def test_a_file_as_windows_writes_it(tmp_path, text):
    path = tmp_path / "bench.toml"
    path.write_bytes(text.encode())
    assert read_bench(path).text.startswith(GOOD)


def test_missing_calibration_says_what_is_needed(tmp_path):
    line = next(line for line in GOOD.splitlines() if line.startswith("calibration = { slope = 25.0"))
    fault = next(fault for fault in faults(tmp_path, GOOD.replace(line, "")) if "ai2 gives V" in fault)
    assert fault.startswith(f"{line_of(GOOD, line) - 1}:")
    assert "ai2 gives V; for bar say calibration = { slope = … }, in bar per V" in fault


def test_all_faults_come_at_once_in_the_order_of_the_file(tmp_path):
    text = changed("sample_rate_hz = 1000", "sample_rate_hz = -5")
    for old, new in [("settling_s", "settle"), ("skew_s = 14e-6", "skw = 1"), ('"ai0"', '"ai99"'), ("140.0", "999.0"),
                     ("seed = 1", "parameters = { x = 1 }")]:  # fmt: skip
        text = text.replace(old, new, 1)
    found = faults(tmp_path, text)
    keys = [fault.split(": ")[1] for fault in found]
    assert keys == ["sample_rate_hz", "valve.settle", "devices.daq.skw", "channels.flow.terminal",
                    "interlocks.over-pressure.high", "simulation.parameters.x"]  # fmt: skip
    assert [int(fault.split(":")[0]) for fault in found] == sorted(int(fault.split(":")[0]) for fault in found)


def test_error_has_the_first_fault_and_the_number_of_others(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(changed("sample_rate_hz = 1000", "sample_rate_hz = -5\ncolour = 1"), encoding="utf-8")
    with pytest.raises(FileError, match=r"bench.toml:4: sample_rate_hz: .*\(and 1 more; `hil check` shows all\)"):
        read_bench(path)


def test_empty_file_says_what_belongs_in_it(tmp_path):
    found = " ".join(faults(tmp_path, ""))
    assert all(f"{key}: is missing" in found for key in ("name", "sample_rate_hz", "valve", "devices", "channels"))


def test_two_devices_that_time_themselves_are_refused(tmp_path):
    text = GOOD.replace("[channels.command]", '[devices.other]\nsimulated = "in_process"\n\n[channels.command]', 1)
    assert any("cannot share a bench with other devices" in fault for fault in faults(tmp_path, text))


def test_text_that_is_not_toml_names_the_line(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text('name = "a"\nvalve = ]\n', encoding="utf-8")
    with pytest.raises(FileError, match=r"not a bench file: .*line 2"):
        read_bench(path)


def test_model_file_is_looked_for_beside_the_bench_file(tmp_path):
    from hil.physics.model import save_model, typical_model

    save_model(typical_model("brevini-hpv41"), tmp_path / "valve.json")
    path = tmp_path / "bench.toml"
    path.write_text(changed('plant = "brevini-hpv41"', 'plant = "valve.json"'), encoding="utf-8")
    assert read_bench(path).devices["daq"].settings.simulation.plant == str(tmp_path / "valve.json")  # type: ignore[attr-defined]


def test_bench_by_path_or_bare_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find_bench("cummins-efc").name == "cummins-efc.toml"
    Path("cummins-efc").write_text("", encoding="utf-8")
    assert find_bench("cummins-efc") == Path("cummins-efc")
    with pytest.raises(UnknownNameError, match="did you mean 'brevini-hpv41'"):
        find_bench("brevini-hpv4")
    with pytest.raises(FileError, match="no such bench file"):
        find_bench("mine.toml")
