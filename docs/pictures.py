"""Make the pictures that the documentation shows: `python -m docs.pictures`, from the project's folder.

The page of `hil demo` is photographed; a console is started in a folder of its own, on the simulated HPV41 by the wall
clock, and used as the tutorial describes it, both in headless Chromium.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, FloatRect, Page

from hil.session.demo import demonstrate
from tests.chromium import chromium
from tests.consoles import console, real_time_bench
from tests.waits import until

PICTURES = Path(__file__).parent / "pictures"
_SIZE = {"width": 1180, "height": 760}
_PAGE = {"width": 1100, "height": 866}  # a page's head and its first drawing
_TEXT: FloatRect = {"x": 94, "y": 30, "width": 914, "height": 836}  # of it, without margins
_PATIENCE_MS = 120_000
_LIMITS = "\n[acceptance.step_response]\nrise = { high = 900.0 }\nsettling = { high = 2000.0 }\n"


def main() -> None:
    """Make all of them."""
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="hil-demo-") as folder, chromium() as browser:
        demo(browser, demonstrate(Path(folder) / "demo", lambda _done, _text: None).report)
    with tempfile.TemporaryDirectory(prefix="hil-lab-") as folder, chromium() as browser:
        bench = real_time_bench(Path(folder), "hpv41")
        text = bench.read_text(encoding="utf-8").replace("[conditions]", f"{_LIMITS}\n[conditions]", 1)
        bench.write_text(text, encoding="utf-8")
        with console(Path(folder)) as lab:
            day(browser, lab.address)


def demo(browser: Browser, report: Path) -> None:
    """The first screen of what `hil demo` writes."""
    page = browser.new_page(viewport=_PAGE)
    page.goto(report.as_uri())
    taken(page, "demo", _TEXT)


def day(browser: Browser, address: str) -> None:
    """What an operator does, a picture at each step."""
    context = browser.new_context(viewport=_SIZE, base_url=address, locale="en-GB")
    context.set_default_timeout(_PATIENCE_MS)
    page = context.new_page()
    run = prepared(
        page, "frequency_response", frequencies="0.5,1,2,3,4,5", amplitudes="5,10", biases="50", measure_s="1 s"
    )
    page.click("#rehearse")
    page.wait_for_selector("#planned canvas")
    page.locator("#planned").scroll_into_view_if_needed()
    taken(page, "console-rehearsed")
    run()
    until(lambda: page.evaluate("bode.length") >= 9, 120.0, 0.2)
    page.click("[data-window='0']")
    page.set_viewport_size({**_SIZE, "height": 1180})
    taken(page, "console-live")
    page.set_viewport_size(_SIZE)
    beside = context.new_page()
    beside.goto("/bench")
    beside.wait_for_selector("#lines .tag.good")
    taken(beside, "console-bench")
    beside.close()
    page.keyboard.press("F12")
    page.wait_for_selector("#stop .confirmed")
    page.wait_for_selector("#verdict:not([hidden])")
    taken(page, "console-stopped")
    for _ in range(2):
        prepared(page, "step_response")()
        page.wait_for_selector("#verdict.good")
    taken(page, "console-verdict")
    page.goto("/results")
    taken(page, "console-results")
    dark = browser.new_context(
        viewport={"width": 400, "height": 780}, base_url=address, color_scheme="dark", locale="en-GB"
    )
    telephone = dark.new_page()
    telephone.goto("/bench?bench=hpv41&lang=de")
    telephone.wait_for_selector("#lines tr")
    taken(telephone, "console-telephone")


def prepared(page: Page, procedure: str, **settings: str) -> Callable[[], None]:
    """Fill the form of a run; starting it is what is returned."""
    page.goto(f"/run?bench=hpv41&procedure={procedure}")
    page.keyboard.type("SN-0042\nMK")
    for name, text in settings.items():
        page.fill(f"#set-{name}", text)

    def start() -> None:
        page.click("#start")
        page.wait_for_url("**/live/**")

    return start


def taken(page: Page, name: str, part: FloatRect | None = None) -> None:
    """A picture, or a part of it, in few colours, so that it is small."""
    page.wait_for_timeout(700)
    path = PICTURES / f"{name}.png"
    page.screenshot(path=path, clip=part)
    with Image.open(path) as picture:
        picture.convert("RGB").quantize(96, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main()
