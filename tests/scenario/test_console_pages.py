"""The console's pages as an operator uses them, in a real browser, on a bench in real time."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from getpass import getuser
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

import hil
from hil.bench.read import read_bench
from tests.chromium import chromium, faults_of, serious
from tests.consoles import console, real_time_bench
from tests.links import free_port
from tests.waits import PATIENCE_S, until

pytestmark = pytest.mark.xdist_group("console")
PAGES = ("/bench?bench=real", "/run?bench=real", "/results", "/results/{run}", "/results/trend?serial=SN-1",
         "/live/{run}", "/diagnose")  # fmt: skip
_PATIENCE_MS = 1000.0 * PATIENCE_S
SHORT = {"frequencies": "4,5", "amplitudes": "10", "biases": "50", "measure_s": "300 ms"}


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def lab(tmp_path_factory, browser):
    folder = tmp_path_factory.mktemp("lab")
    real_time_bench(folder)
    for name in ("one", "two"):
        made = hil.run("step_response", "brevini-hpv41", folder / "runs" / name, serial="SN-1", operator="MK",
                       limits=["rise=..0.9 s"])  # fmt: skip
        assert made.findings.verdict == "pass"
    from hil.archive.archive import enter
    from hil.archive.place import archive_place

    enter(archive_place(str(folder / "runs")), [folder / "runs" / "one", folder / "runs" / "two"])
    with console(folder) as found:
        yield found


@pytest.fixture(scope="module")
def operator(browser, lab):
    """One browser of one operator: two would ask each other for the seat."""
    expect.set_options(timeout=_PATIENCE_MS)
    context = browser.new_context(viewport={"width": 1280, "height": 800}, base_url=lab.address, locale="en-GB")
    context.set_default_timeout(_PATIENCE_MS)
    yield context
    context.close()


@pytest.fixture
def page(operator):
    made = operator.new_page()
    faults = faults_of(made)
    yield made
    operator.set_offline(False)
    made.close()
    assert [fault for fault in faults if "Failed to load resource" not in fault] == []


def started(page: Page, serial: str = "SN-7", **settings: str) -> str:
    """Start a frequency response by the form; the name of its run."""
    page.goto("/run?bench=real&procedure=frequency_response")
    page.keyboard.type(f"{serial}\n")
    for name, text in settings.items():
        page.fill(f"#set-{name}", text)
    page.click("#start")
    page.wait_for_url("**/live/**")
    return page.url.rsplit("/", 1)[1]


def test_bench_tells_every_channel_and_reads_when_asked(page, lab):
    page.goto("/bench?bench=real")
    channels = read_bench(lab.folder / "real.toml").bench.channels
    rows = page.locator("#lines tr")
    expect(rows).to_have_count(len(channels))
    assert {text.strip() for text in page.locator("#lines td.num").all_inner_texts()} == {"–"}
    page.get_by_role("button", name="Read the inputs").click()
    pressure = page.get_by_role("row", name=re.compile("supply pressure.*"))
    expect(pressure.locator(".tag").first).to_have_text("ok")
    assert float(pressure.locator("td.num").first.inner_text()) == pytest.approx(100.0, abs=3.0)
    page.get_by_role("button", name="Read no longer").click()
    expect(pressure.first).to_contain_text("not being read")


def test_a_run_is_rehearsed_started_followed_and_stopped(page, lab):
    page.goto("/run?bench=real&procedure=frequency_response")
    expect(page.locator("#serial")).to_be_focused()
    page.keyboard.type("SN-7\nMK")
    assert page.input_value("#serial") == "SN-7"
    assert page.input_value("#operator") == "MK"
    for name, text in {**SHORT, "measure_s": "soon"}.items():
        page.fill(f"#set-{name}", text)
    wrong = page.locator('[data-setting="measure_s"]')
    expect(wrong.locator(".why")).to_contain_text("in s")
    page.click("#start")
    expect(wrong).to_have_class(re.compile("wrong"))
    assert "/run" in page.url
    page.fill("#set-measure_s", SHORT["measure_s"])
    page.click("#rehearse")
    expect(page.locator("#planned-text")).to_contain_text("within all limits")
    assert page.locator("#planned canvas").get_attribute("aria-label") == "command [%], -100 … 100"
    page.click("#start")
    page.wait_for_url("**/live/**")
    name = page.url.rsplit("/", 1)[1]
    expect(page.locator("#state")).to_have_text("running")
    flow = page.locator(".lane", has_text="flow").first.locator("b")
    expect(flow).to_have_text(re.compile(r"^\d{2}"))
    expect(page.locator("#bode-panel")).to_be_visible()
    expect(page.locator("#left")).to_have_text(re.compile("left|done|longer"))
    hold = page.locator("#hold")
    hold.click()
    expect(hold).to_have_text("Go on")
    expect(page.locator("#hold-said")).to_have_text(re.compile("hold"))
    hold.click()
    expect(hold).to_have_text("Hold")
    page.keyboard.press("F12")
    expect(page.locator("#stop")).to_contain_text("stop confirmed, outputs read back safe")
    expect(page.locator("#verdict-word")).to_have_text("Stopped")
    by_whom = rf"^Stopped by {getuser()} at \d\d:\d\d:\d\d, after \d+(\.\d)? s; outputs are safe \(read back\)\.$"
    expect(page.locator("#verdict-details")).to_have_text(re.compile(by_whom))
    expect(page.locator(".lane", has_text="command").first.locator("b")).to_have_text(re.compile(r"^0(\.0*)?$"))
    expect(page.locator("#rows")).to_contain_text("last recorded")
    assert hil.read(lab.runs / name).channels["command"].values[-1] == pytest.approx(0.0, abs=60.0)


def test_bench_shows_the_run_that_drives_it_and_a_killed_one_is_lost(page, lab):
    name = started(page, "SN-8")
    expect(page.locator("#state")).to_have_text("running")
    page.goto("/bench?bench=real")
    expect(page.locator("#reader")).to_have_text(name)
    expect(page.get_by_role("row", name=re.compile("^command daq"))).to_contain_text("driven")
    page.goto(f"/live/{name}")
    expect(page.locator("#state")).to_have_text("running")
    os.kill(int(str(lab.control(name)["pid"])), signal.SIGKILL)
    expect(page.locator("#verdict-word")).to_have_text("Lost")
    expect(page.locator("#underway")).to_contain_text("lost")
    expect(page.locator("#lanes")).to_have_class(re.compile("old"))


def test_a_page_without_its_server_says_that_it_is_old(page):
    page.goto("/bench?bench=real")
    page.context.set_offline(True)
    expect(page.locator("#offline")).to_be_visible()
    expect(page.locator("#lines tr.stale")).to_have_count(page.locator("#lines tr").count())
    page.context.set_offline(False)
    expect(page.locator("#offline")).to_be_hidden()
    page.evaluate("window.scrollTo(0, 0)")


def test_results_are_found_compared_and_followed(page):
    page.goto("/results")
    page.fill("#serial", "SN-1")
    page.get_by_role("button", name="Search").click()
    rows = page.locator("#chosen tbody tr")
    expect(rows).to_have_count(2)
    assert "pass SIMULATED" in " ".join(rows.first.inner_text().split())
    for box in page.locator("#chosen input[name=run]").all():
        box.check()
    page.get_by_role("button", name="Compare two").click()
    expect(page.frame_locator("iframe").locator("body")).to_contain_text("No value differs beyond its uncertainty.")
    expect(page.locator(".head .tag")).to_have_text("SIMULATED")
    dated = page.locator(".panel-head a").all_inner_texts()[:2]  # chosen from a list with the newest first
    assert [text.split()[0] for text in dated] == ["one", "two"]
    assert all(re.search(r"\(20\d\d-\d\d-\d\d \d\d:\d\d:\d\d [+-]", text) for text in dated)
    page.goto("/results/one")
    expect(page.locator(".head .tag")).to_have_text("SIMULATED")
    expect(page.locator(".across")).to_be_visible()
    word = page.locator(".verdict .word")
    expect(word).to_have_text("Pass")
    box = word.bounding_box()
    assert box["height"] > 60.0
    expect(page.frame_locator("iframe").locator("h1")).to_contain_text("Step response")
    page.keyboard.press("n")  # the same test, next unit
    page.wait_for_url("**/run?procedure=step_response&bench=brevini-hpv41&operator=MK&**")
    assert page.input_value("#serial") == ""
    page.goto("/results/trend?serial=SN-1")
    expect(page.locator("#trend")).to_be_visible()
    expect(page.locator("tbody .tag.bad")).to_have_count(2)
    expect(page.locator("main")).to_contain_text("No drift can be determined")


def test_the_form_of_a_diagnosis_chooses_the_model_of_the_run_or_none(page):
    page.goto("/diagnose")
    assert page.input_value("#model") == ""
    assert page.locator("#model").get_attribute("required") is not None
    page.goto("/diagnose?run=one")
    assert page.input_value("#model") == "hpv41-identified"  # the only one of the plant that the run says it is of
    expect(page.locator("li", has_text="one").first).to_contain_text("brevini-hpv41")
    expect(page.locator("#model option:checked")).to_have_text("hpv41-identified · brevini-hpv41")


def test_hostile_uploads_and_names_reach_no_file(page, lab):
    page.goto("/diagnose")
    page.select_option("#model", "hpv41-identified")
    page.set_input_files("#file", [{"name": "../../evil.exe", "mimeType": "text/csv", "buffer": b"MZ"}])
    page.get_by_role("button", name="Diagnose").click()
    expect(page.locator("#refused")).to_contain_text("no recording by its name")
    page.set_input_files("#file", [{"name": "../../../evil $(id).csv", "mimeType": "text/csv", "buffer": b"a,b\n"}])
    page.get_by_role("button", name="Diagnose").click()
    page.wait_for_url("**/jobs/**")
    expect(page.locator("#state")).to_have_text("refused")
    kept = list(lab.folder.rglob("*evil*"))
    assert [path.name for path in kept] == ["0-evil-id-.csv"]
    assert kept[0].is_relative_to(lab.folder / "state" / "console" / "uploads")
    secret = lab.folder / "secret.json"
    secret.write_text("{}", encoding="utf-8")
    for path in ("/results/..%2Freal.toml", "/live/..%2f..%2fetc",
                 "/passports/..%2F..%2Fsecret.json",
                 "/static/..%2fapp.py", "/static/%2e%2e/app.py", "/results/compared/..%2Fx.html"):  # fmt: skip
        assert page.request.get(path).status in (400, 404), path
    answer = page.request.post("/run/start", form={"procedure": "frequency_response", "bench": "../real"},
                               headers={"Origin": lab.address})  # fmt: skip
    assert answer.status in (400, 404)


def test_browsers_keep_scripts_by_their_contents_and_nothing_else(page):
    page.goto("/bench")
    script = page.locator('script[src*="/static/stop.js"]').get_attribute("src") or ""
    kept = [page.request.get(path).headers["cache-control"]
            for path in (script, "/static/stop.js", "/static/none.js?x", "/bench")]  # fmt: skip
    assert "immutable" in kept[0] and kept[1:] == ["no-store"] * 3


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_have_no_serious_finding_of_axe_and_fit_a_telephone(page, scheme):
    page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    found = {}
    for path in PAGES if scheme == "light" else PAGES[:3]:
        page.goto(path.format(run="one"))
        page.wait_for_timeout(150)
        found[path] = serious(page)
        if scheme == "light":
            page.set_viewport_size({"width": 400, "height": 800})
            wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            found[path] += [f"{wide} px wider than a telephone"] if wide > 0 else []
            page.set_viewport_size({"width": 1280, "height": 800})
    assert {path: faults for path, faults in found.items() if faults} == {}


def test_the_form_knows_last_bench_units_of_today_and_an_overdue_calibration(page, lab):
    text = (lab.folder / "real.toml").read_text(encoding="utf-8")
    dated = text.replace("date = 2026-03-02", "date = 2020-03-02, due = 2021-03-02", 1)
    assert dated != text
    (lab.folder / "overdue.toml").write_text(dated, encoding="utf-8")
    page.goto("/run?bench=overdue&procedure=step_response")
    expect(page.locator(".notice.bad", has_text="its calibration was due on 2021-03-02")).to_have_count(1)
    expect(page.locator(".today")).to_contain_text("SN-1 pass")
    page.fill("#limits", "rise=..0.2 s\nlap=0..")
    expect(page.locator('[data-setting="limits"] .why')).to_contain_text("limit 'lap': not measured here")
    page.fill("#note-order", "4711")
    page.select_option("#procedure", "flow_curve")
    page.wait_for_url("**procedure=flow_curve**")
    assert (page.input_value("#note-order"), page.input_value("#limits")) == ("4711", "")
    page.goto("/run")
    assert page.input_value("#bench") == "overdue"


def test_pages_speak_german_and_remember_it(page):
    page.goto("/bench?bench=real")
    page.get_by_role("link", name="DE", exact=True).click()
    expect(page.locator("nav")).to_contain_text("Prüfstand")
    expect(page.locator("#lines .tag").first).to_have_text("von keinem Lauf angesteuert")
    page.goto("/run?bench=real")
    assert page.locator("html").get_attribute("lang") == "de"
    expect(page.locator("#start")).to_have_text("Start")
    expect(page.locator("#rehearse")).to_have_text("Proben")
    page.goto("/run?bench=real&lang=en")
    expect(page.locator("#rehearse")).to_have_text("Rehearse")


def test_a_latched_trip_is_named_and_reset(page, lab):
    installed = Path(__file__).parents[2] / "sim_devices" / "benches" / "hpv41-modbus-tcp.toml"
    text = installed.read_text(encoding="utf-8").replace('name = "HPV41 on Modbus TCP"', 'name = "tripped"')
    (lab.folder / "tripped.toml").write_text(text, encoding="utf-8")
    kept = lab.folder / "state" / "trips" / "tripped.json"
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps({"over-pressure": "supply pressure 151 bar at 3.2 s"}), encoding="utf-8")
    page.goto("/bench?bench=tripped")
    expect(page.locator("#trips")).to_contain_text("tripped: over-pressure")
    expect(page.locator("#trips")).to_contain_text("151 bar")
    page.get_by_role("button", name="Reset over-pressure").click()
    page.get_by_role("alertdialog").get_by_role("button", name="Yes").click()
    expect(page.locator("#trips .trip")).to_have_count(0)
    assert json.loads(kept.read_text(encoding="utf-8")) == {}
    audit = next((lab.folder / "state").rglob("*audit*"))
    assert "over-pressure" in (audit if audit.is_file() else next(audit.iterdir())).read_text(encoding="utf-8")


def test_the_next_test_of_a_diagnosis_stands_ready_on_the_form(page, lab):
    folder = lab.folder / "state" / "console" / "diagnoses" / "diagnosis-20260101T000000-1"
    folder.mkdir(parents=True)
    friction = {"name": "friction", "probability": 0.98, "stage": "spool", "sentence": "The spool sticks.",
                "parameters": {"coulomb": {"value": 2.4, "std": 0.1, "unit": "%"}}}  # fmt: skip
    test = {
        "procedure": "step_response",
        "settings": {"levels": [0.0, 20.0]},
        "why": "It tells friction from backlash.",
    }
    told = {"verdict": "partly_explained", "effects": [friction], "next_test": test}
    told["other_plant"] = ["one is a run of the plant a, the model is of b: what a verdict names may be nothing but …"]
    (folder / "diagnosis.json").write_text(json.dumps(told), encoding="utf-8")
    (folder / "report.html").write_text("<h1>Diagnosis</h1>", encoding="utf-8")
    page.goto("/diagnose")
    page.get_by_role("link", name=folder.name).click()
    expect(page.locator(".verdict .word")).to_have_text("Partly explained")
    expect(page.get_by_role("row", name=re.compile("spool friction 98 %"))).to_contain_text("2.40 ± 0.20 %")
    policy = page.request.get(f"/diagnose/{folder.name}/report").headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script" not in policy
    page.get_by_role("link", name="Prepare the next test").click()
    expect(page.locator("#procedure")).to_have_value("step_response")
    expect(page.locator("#set-levels")).to_have_value("0,20")
    expect(page.locator(".notice").filter(has_text="tells friction")).to_be_visible()


@pytest.mark.alone
@pytest.mark.slow
def test_a_killed_run_is_shown_as_lost_within_a_second(page, lab):
    for serial in ("SN-20", "SN-21", "SN-22"):
        name = started(page, serial)
        expect(page.locator("#state")).to_have_text("running")
        word = page.locator("#verdict-word")
        begun_s = time.monotonic()
        os.kill(int(str(lab.control(name)["pid"])), signal.SIGKILL)
        until(lambda: word.text_content() == "Lost", 5.0, 0.01)  # noqa: B023
        assert time.monotonic() - begun_s < 1.0


@pytest.mark.alone
@pytest.mark.slow
def test_a_console_that_was_killed_and_started_again_shows_the_run_and_stops_it(browser, tmp_path):
    real_time_bench(tmp_path)
    port = free_port()
    context = browser.new_context(base_url=f"http://127.0.0.1:{port}", locale="en-GB")
    page = context.new_page()
    with console(tmp_path, port) as first:
        run = started(page, "SN-9", **{**SHORT, "frequencies": "0.5,1", "measure_s": "60 s"})
        samples = first.runs / run / "samples.f8"
        until(lambda: samples.exists() and samples.stat().st_size > 10_000)
        first.process.kill()
        expect(page.get_by_text("No connection to the console")).to_be_visible()
        before = samples.stat().st_size
        until(lambda: samples.stat().st_size > before)
        with console(tmp_path, port):
            expect(page.get_by_text("No connection to the console")).to_be_hidden()  # the page that was open
            expect(page.locator("body")).to_contain_text(f"ends {run}")
            page.keyboard.press("F12")
            expect(page.locator("body")).to_contain_text("stop confirmed, outputs read back safe")
            page.goto("/results")
            expect(page.locator("body")).to_contain_text("SN-9")
    context.close()
