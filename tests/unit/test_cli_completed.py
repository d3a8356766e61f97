"""A shell completes names that are installed."""

from hil.cli.completed import benches_like, procedures_like


def test_names_that_begin_so_are_offered():
    assert procedures_like("freq") == ["frequency_response"]
    assert benches_like("hpv41-modbus") == ["hpv41-modbus-rtu", "hpv41-modbus-tcp"]
    assert benches_like("./my") == []
