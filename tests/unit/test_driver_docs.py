"""The reference of drivers says every setting, model and quirk; the how-to's driver works."""

from __future__ import annotations

import re
import socket
import threading
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from hil.bench.find import benches
from hil.catalog import entries
from hil.daq.channel import InputChannel, Wiring
from hil.daq.conformance import CHECKS
from hil.errors import DeviceLostError, LinkError
from sim_devices._quirks import Quirks

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "reference" / "drivers.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", [entry.name for entry in entries("drivers")])
def test_every_setting_and_model_is_in_the_reference(name: str) -> None:
    module = next(entry for entry in entries("drivers") if entry.name == name).load()
    words = set(re.findall(r"[\w-]+", PAGE))
    assert f"## `{name}`" in PAGE
    assert set(module.Settings.model_fields) | set(getattr(module, "MODELS", ())) <= words


def test_every_quirk_and_bench_is_in_the_reference() -> None:
    words = set(re.findall(r"[\w-]+", PAGE))
    assert set(Quirks.model_fields) <= words
    assert {name for name in benches() if name.startswith("hpv41-")} <= words
    assert f"{len(CHECKS)} checks" in PAGE


@pytest.fixture
def gauge() -> Any:
    (code,) = re.findall(r"```python\n(.*?)```", (DOCS / "how-to" / "add-a-driver.md").read_text("utf-8"), re.DOTALL)
    module = ModuleType("gauge")
    module.__dict__["__name__"] = "gauge"
    import sys

    sys.modules["gauge"] = module  # where pydantic looks for the names of annotations
    exec(compile(code, "add-a-driver.md", "exec"), module.__dict__)
    yield module
    del sys.modules["gauge"]


def test_the_driver_of_the_how_to(gauge: Any) -> None:
    wiring = Wiring({}, {"p": InputChannel("p", "pressure", "value", "bar", 0.0, 400.0)})
    answers = [b"12.5\n", b"nonsense\n", b"13.5\n"]

    def serve(listener: socket.socket) -> None:
        while answers:
            client, _ = listener.accept()
            with client:
                while answers and client.recv(64):
                    client.sendall(answers.pop(0))

    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=serve, args=(listener,))
        thread.start()
        settings = gauge.Settings(host="127.0.0.1", port=listener.getsockname()[1])
        assert list(gauge.faults(settings)) == []
        link = gauge.open_link(settings, wiring)
        assert link.read() == {"pressure": 12.5}
        with pytest.raises(LinkError, match="no pressure"):
            link.read()
        assert link.read() == {"pressure": 13.5}
        link.close()
        thread.join()
    with pytest.raises(DeviceLostError):
        gauge.open_daq(gauge.Settings(host="127.0.0.1", port=1), wiring)
