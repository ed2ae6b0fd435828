"""Does a page work in a real browser: play, zoom, reasons, corrections, and no network?

Skipped where Selenium, Chromium or its driver are not there.
"""

import csv
import json
import shutil
import time

import pytest

from motionary.labels import Label, LabelTrack
from motionary.models.library import TrainingOptions, learn_classes
from motionary.recording import Recording
from motionary.reporting import report
from motionary.samples import synthetic_stream

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
Keys = pytest.importorskip("selenium.webdriver.common.keys").Keys
CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="no Chromium with its driver")

ActionBuilder = pytest.importorskip(
    "selenium.webdriver.common.actions.action_builder"
).ActionBuilder
#: Of timeline.js, in pixels: what stands left of the axis, above the lanes, and a lane.
GUTTER, AXIS_ROW, LANE = 118, 24, 24

FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--use-gl=angle",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1280,720",
)  # fmt: skip


@pytest.fixture
def browser(tmp_path):
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={tmp_path / 'profile'}"):
        options.add_argument(flag)
    options.add_experimental_option("prefs", {"download.default_directory": str(tmp_path)})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


def wait_for(condition, seconds=10):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.05)
    raise AssertionError("waited in vain")


def find(browser, selector):
    return wait_for(lambda: browser.find_elements("css selector", selector))[0]


def now(axis):
    return float(axis.get_attribute("aria-valuenow"))


def at(browser, axis, part, y):
    """Place in the window of a part of the axis's length, so far below its top."""
    box = browser.execute_script("return arguments[0].getBoundingClientRect().toJSON()", axis)
    return round(box["x"] + GUTTER + part * (box["width"] - GUTTER - 8)), round(box["y"] + y)


def scrub_to(browser, axis, part):
    """Press on the axis above all lanes."""
    mouse = ActionBuilder(browser)
    mouse.pointer_action.move_to_location(*at(browser, axis, part, 8)).click()
    mouse.perform()


def drag_end(browser, axis, *, by):
    """Drag the end of the chosen label, in the lane below the one that it was copied from."""
    field = find(browser, "input[aria-label='End, seconds']")
    end, length = float(field.get_attribute("value")), float(axis.get_attribute("aria-valuemax"))
    x, y = at(browser, axis, end / length, AXIS_ROW + 1.5 * LANE)
    mouse = ActionBuilder(browser)
    mouse.pointer_action.move_to_location(x - 2, y).pointer_down().move_to_location(x + by, y)
    mouse.pointer_action.pointer_up()
    mouse.perform()
    moved = by * length / (axis.size["width"] - GUTTER - 8)
    wait_for(lambda: abs(float(field.get_attribute("value")) - end - moved) < 0.05)


def test_a_page_plays_explains_and_corrects_without_a_network(tmp_path, browser, examples):
    motion, _ = synthetic_stream(("squat", "kick_left"), seed=3, rate_hz=60.0)
    track = LabelTrack(Recording("stream"), (Label("squat", 1.0, 2.0),))
    library = learn_classes(examples, training=TrainingOptions())
    page = tmp_path / "page.html"
    report(motion.renamed("stream"), page, labels=track, library=library)
    browser.get(page.as_uri())

    axis = find(browser, "canvas.time-canvas")
    before = axis.get_attribute("aria-valuetext")
    find(browser, "button.play").click()
    wait_for(lambda: axis.get_attribute("aria-valuetext") != before)
    find(browser, "button.play").click()
    scrub_to(browser, axis, 0.5)
    wait_for(lambda: abs(now(axis) - motion.duration_s / 2) < 0.1)
    find(browser, "button[aria-label='Zoom in']").click()
    find(browser, "button[aria-label='The whole recording']").click()

    height = axis.size["height"]
    find(browser, "details.curves summary").click()
    boxes = browser.find_elements("css selector", "details.curves input")
    assert len(boxes) > 1
    boxes[-1].click()
    wait_for(lambda: axis.size["height"] != height)
    find(browser, "details.curves summary").click()

    find(browser, ".label-list button").click()
    wait_for(lambda: browser.find_elements("css selector", ".findings li"))
    assert "squat" in find(browser, ".why").text
    loop = find(browser, "button[aria-label='Loop the chosen part']")
    wait_for(lambda: loop.get_attribute("aria-pressed") == "true")
    times = [time.sleep(0.2) or now(axis) for _ in range(10)]
    assert max(times) - min(times) < 2.5
    find(browser, "button.play").click()

    correct = "button[aria-label='Make the labels of this lane editable']"
    if find(browser, correct).is_displayed():
        find(browser, correct).click()
    find(browser, ".label-list button").click()
    drag_end(browser, axis, by=40)
    name = find(browser, "input[aria-label='Name of the label']")
    # Emptied at once it would be put back: a label needs a name.
    name.send_keys(Keys.CONTROL, "a")
    name.send_keys("bend\t")
    find(browser, "button[aria-label^='Download the labels']").click()
    table = tmp_path / "labels.csv"
    wait_for(table.exists)
    first = next(csv.DictReader(table.read_text("utf-8-sig").splitlines()))
    assert (first["recording"], first["label"]) == ("stream", "bend")
    policy = find(browser, "meta[http-equiv='Content-Security-Policy']").get_attribute("content")
    assert "default-src 'none'" in policy
    assert "connect-src 'none'" in policy

    assert [e["message"] for e in browser.get_log("browser") if e["level"] == "SEVERE"] == []
    messages = [json.loads(e["message"])["message"] for e in browser.get_log("performance")]
    asked = {
        message["params"]["request"]["url"].split(":")[0]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    }
    assert not asked - {"file", "data", "blob", "chrome"}
