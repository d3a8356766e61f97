"""What reading outputs back while driving costs each link, as `hil check` prints it."""

import json

import pytest

from hil.cli.commands import check

NO_REQUESTS, BESIDE = "no requests to read outputs back", "requests a second to read outputs back"


@pytest.mark.parametrize(
    ("bench", "per_s"),
    [
        ("hpv41-modbus-tcp", {"io": 2.0}),
        ("hpv41-mixed", {"valve": 2.0}),
        ("cummins-efc-modbus", {"amplifier": 2.0}),  # the current, with carrier and dither
        ("hpv41-j1939", {"valve": 0.0}),  # it reports them by itself
        ("hpv41-usb-6211", {}),
        ("brevini-hpv41", {}),
    ],
)
def test_check_prints_a_line_for_each_link_that_drives(bench, per_s, capsys):
    check.command(bench, strict=False, live=False, reference="", archive="", as_json=False)
    lines = [line for line in capsys.readouterr().out.splitlines() if BESIDE in line or NO_REQUESTS in line]
    assert [line.split(":")[0].strip() for line in lines] == list(per_s)
    assert all(f"at most {each:g} {BESIDE}" in line if each else NO_REQUESTS in line
               for line, each in zip(lines, per_s.values(), strict=True))  # fmt: skip
    check.command(bench, strict=False, live=False, reference="", archive="", as_json=True)
    assert json.loads(capsys.readouterr().out)["read_back_requests_per_s"] == per_s
