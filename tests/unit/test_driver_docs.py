"""The reference of drivers says every setting, model and quirk; the driver of the guide works."""

from __future__ import annotations

import re
import socket
import threading
from pathlib import Path

import pytest
from pydantic import BaseModel

from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.bench.twin import subject
from hil.catalog import entries, find
from hil.daq.channel import Wiring
from hil.daq.conformance import CHECKS, examine
from hil.description import ascii_module as module_words
from hil.description import can as can_words
from hil.description import canopen as canopen_words
from hil.description import modbus as modbus_words
from hil.description import text as text_words
from hil.description.find import descriptions
from hil.errors import DeviceLostError, LinkError
from sim_devices import kit
from sim_devices.kit import Quirks
from tests.channels import inputs
from tests.links import moved

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "reference" / "drivers.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", [entry.name for entry in entries("drivers")])
def test_every_setting_and_model_is_in_the_reference(name):
    module = next(entry for entry in entries("drivers") if entry.name == name).load()
    words = set(re.findall(r"[\w-]+", PAGE))
    assert f"## `{name}`" in PAGE
    assert set(module.Settings.model_fields) | set(getattr(module, "MODELS", ())) <= words


def test_every_key_of_a_description_is_in_its_reference():
    page = (DOCS / "reference" / "descriptions.md").read_text(encoding="utf-8")
    words = set(re.findall(r"\w+", page))
    kinds = [
        kind
        for module in (modbus_words, text_words, module_words, can_words, canopen_words)
        for kind in vars(module).values()
    ]
    shown = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)]
    assert len(shown) > 8
    assert {key for kind in shown for key in kind.model_fields} <= words
    devices = (DOCS / "reference" / "devices.md").read_text(encoding="utf-8")
    assert {name for name in descriptions() if f"`{name}`" not in devices} == set()


def test_every_quirk_and_bench_is_in_the_reference():
    words = set(re.findall(r"[\w-]+", PAGE))
    assert set(Quirks.model_fields) <= words
    on_links = {name for name, path in benches().items() if not read_bench(path).is_simulated}
    assert {name for name in on_links if name.startswith("hpv41-")} <= words
    assert f"{len(CHECKS)} checks" in PAGE


PAGE_OF_THE_GUIDE = (DOCS / "how-to" / "add-a-driver.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE_OF_THE_GUIDE, re.DOTALL)


@pytest.fixture
def guide(install_package, tmp_path):
    """The driver, the twin and the bench of the guide, word for word, installed; yields the bench file."""
    driver, twin = blocks("python")
    install_package("hil.drivers", "g_drivers", {"gauge.py": driver})
    install_package("hil.sim_devices", "g_devices", {"gauge.py": twin})
    (told,) = (block for block in blocks("toml") if "[devices.gauge]" in block)
    bench = benches()["hpv41-modbus-tcp"].read_text(encoding="utf-8")
    place = bench.index('[channels."supply pressure"]'), bench.index("[interlocks.over-pressure]")
    path = tmp_path / "bench.toml"
    path.write_text(moved(bench[: place[0]] + told + bench[place[1] :], tmp_path), encoding="utf-8")
    return path


def test_the_driver_of_the_guide_passes_every_check_on_the_twin_of_the_guide(guide):
    with subject(read_bench(guide), guide.parent, "gauge") as examined:
        results = list(examine(examined))
    assert {r.check: r.text for r in results if r.verdict == "broken"} == {}
    passed = {r.check for r in results if r.verdict == "passed"}
    assert {"reads_what_is_there", "does_not_believe_half_an_answer", "says_that_no_answer_came"} <= passed


def test_the_driver_of_the_guide_when_the_gauge_goes_away(guide):
    driver = find("drivers", "gauge").load()
    wiring = Wiring({}, inputs({"p": "pressure"}, "bar", 0.0, 400.0))
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve():
            client, _ = listener.accept()
            client.recv(64)
            client.sendall(b"12.5\n")
            client.recv(64)
            listener.close()
            client.close()

        thread = threading.Thread(target=serve)
        thread.start()
        link = driver.open_link(driver.Settings(address=f"127.0.0.1:{listener.getsockname()[1]}"), wiring)
        assert link.read() == {"pressure": 12.5}
        with pytest.raises(LinkError, match="no pressure"):
            link.read()
        with pytest.raises(DeviceLostError):
            link.read()
        link.close()
        thread.join()


def test_every_name_of_the_kit_is_explained():
    page = str(kit.__doc__)
    assert [name for name in kit.__all__ if name not in page and not getattr(kit, name).__doc__] == []
