"""Do pages work in a real browser: play, zoom, reasons, corrections, judging, and no network?

Skipped where Selenium, Chromium or its driver are not there.
"""

import csv
import json
import shutil
import time

import pytest

from cli_cases import CLASSES
from motionary import learn, search
from motionary.labels import Label, LabelTrack
from motionary.live import LivePeople, PageServer, write_lines
from motionary.models.library import TrainingOptions, learn_classes
from motionary.recording import Recording
from motionary.reporting import (
    Judging,
    report,
    report_comparison,
    report_hits,
    report_library,
)
from motionary.retrieval.search import QueryExpansion
from motionary.samples import synthetic_motion, synthetic_stream

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
Keys = pytest.importorskip("selenium.webdriver.common.keys").Keys
CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="no Chromium with its driver")

ActionBuilder = pytest.importorskip(
    "selenium.webdriver.common.actions.action_builder"
).ActionBuilder
HOSTILE = "<img src=x onerror='alert(1)'>"
#: Of timeline.js, in pixels: what stands left of the axis, above the lanes, and a lane.
GUTTER, AXIS_ROW, LANE = 118, 24, 24

FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--use-gl=angle",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1280,720",
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("browser")


@pytest.fixture(scope="module")
def browser(folder):
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(flag)
    options.add_experimental_option("prefs", {"download.default_directory": str(folder)})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def motions():
    made = {
        f"{name} {i}": synthetic_motion(name, seed=i, rate_hz=30.0)
        for name in CLASSES[:2]
        for i in (0, 1)
    }
    return {name: motion.renamed(name) for name, motion in made.items()}


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


def test_a_page_plays_explains_and_corrects_without_a_network(folder, browser, examples):
    motion, _ = synthetic_stream(("squat", "kick_left"), seed=3, rate_hz=60.0)
    track = LabelTrack(Recording("stream"), (Label("squat", 1.0, 2.0),))
    library = learn_classes(examples, training=TrainingOptions())
    page = folder / "page.html"
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
    times = [time.sleep(0.2) or now(axis) for _ in range(6)]
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
    table = folder / "labels.csv"
    wait_for(table.exists)
    first = next(csv.DictReader(table.read_text("utf-8-sig").splitlines()))
    assert (first["recording"], first["label"]) == ("stream", "bend")
    check_quiet(browser)


def check_quiet(browser):
    """No error, no request, and a policy that allows none."""
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
    assert "file" in asked
    assert not asked - {"file", "data", "blob", "chrome"}


def check_plays(browser):
    """A gallery plays when it opens, draws its bodies, and stands still when it is told to."""
    slider = find(browser, "input[aria-label='Moment']")
    wait_for(lambda: find(browser, "canvas.grid-canvas").is_displayed())
    times = {wait_for(lambda: find(browser, ".cell-time").text) for _ in range(3)}
    wait_for(lambda: times.add(find(browser, ".cell-time").text) or len(times) > 3)
    find(browser, "button.play").click()
    assert slider.get_attribute("value") == (time.sleep(0.1) or slider.get_attribute("value"))


def test_hits_play_and_are_judged(folder, browser, motions):
    named = {HOSTILE: motions["squat 1"].renamed(HOSTILE), "squat 0": motions["squat 0"]}
    found = search(motions["squat 0"], list(named.values()), expansion=QueryExpansion(hits=0))
    judging = Judging("motionary search takes --like 'a b.bvh'", range(1, len(found) + 1))
    page = folder / "hits.html"
    report_hits(found, named, page, query=motions["squat 0"], judging=judging, title=HOSTILE)
    browser.get(page.as_uri())
    check_plays(browser)
    assert find(browser, "h1").text == HOSTILE
    titles = [one.text for one in browser.find_elements("css selector", ".cell h3")]
    assert any(HOSTILE in title for title in titles)
    find(browser, "button[aria-label='Hit 1 is right']").click()
    find(browser, "button[aria-label='Hit 2 is wrong']").click()
    command = find(browser, ".judging code").text
    assert command == f"{judging.command} --relevant 1 --irrelevant 2"
    find(browser, ".judging button").click()
    wait_for(lambda: find(browser, ".judging [role='status']").text)
    find(browser, "button[aria-label='Hit 2 is wrong']").click()
    assert find(browser, ".judging code").text == f"{judging.command} --relevant 1"
    check_quiet(browser)


def test_classes_play_beside_what_they_ask_for(folder, browser, motions):
    examples = {name: [one for key, one in motions.items() if name in key] for name in CLASSES[:2]}
    page = folder / "classes.html"
    report_library(learn(examples, keep_examples=True), page, recordings=motions)
    browser.get(page.as_uri())
    check_plays(browser)
    bars = browser.find_elements("css selector", ".template-bars button")
    last = max(
        bars, key=lambda bar: float(bar.get_attribute("style").split("left: ")[1].split("%")[0])
    )
    start = float(last.get_attribute("style").split("left: ")[1].split("%")[0])
    browser.execute_script("arguments[0].click()", last)
    slider = find(browser, "input[aria-label='Moment']")
    wait_for(lambda: abs(float(slider.get_attribute("value")) - 10 * start) < 2)
    before = find(browser, ".cell h3").text
    find(browser, "select[aria-label='Class']").send_keys(Keys.ARROW_DOWN)
    wait_for(lambda: find(browser, ".cell h3").text != before)
    check_quiet(browser)


def test_two_recordings_play_in_step_and_say_where_they_differ(folder, browser, motions):
    page = folder / "compared.html"
    report_comparison(motions["squat 0"], motions["squat 1"].renamed(HOSTILE), page)
    browser.get(page.as_uri())
    assert "lasts" in find(browser, ".why .lines li").text
    find(browser, ".label-list button").click()
    wait_for(lambda: "holds for" in find(browser, ".why").text)
    names = wait_for(lambda: browser.find_elements("css selector", ".body-name"))
    assert len(names) == 2
    before = [name.text for name in names]
    wait_for(lambda: all(name.text != old for name, old in zip(names, before, strict=True)))
    check_quiet(browser)


def test_labels_are_begun_in_a_page_without_any(folder, browser, motions):
    page = folder / "bare.html"
    report(motions["squat 0"], page)
    browser.get(page.as_uri())
    before = set(folder.glob("labels*.csv"))
    find(browser, "button[aria-label='Begin a lane of labels']").click()
    find(browser, "button[aria-label^='Add a label']").click()
    name = find(browser, "input[aria-label='Name of the label']")
    wait_for(lambda: name.get_attribute("value") == "new")
    find(browser, "button[aria-label^='Download the labels']").click()
    (table,) = wait_for(lambda: set(folder.glob("labels*.csv")) - before)
    (row,) = csv.DictReader(table.read_text("utf-8-sig").splitlines())
    assert (row["recording"], row["label"]) == ("squat 0", "new")
    check_quiet(browser)


def test_a_live_page_grows_with_poses_and_labels(browser):
    pytest.importorskip("websockets")
    library = learn({"squat": [synthetic_motion("squat", seed=seed) for seed in range(4)]})
    stream, _ = synthetic_stream(("squat",), seed=4, rate_hz=30.0)
    head, *poses = write_lines(stream)
    people, page = LivePeople(library), PageServer(0, tell=pytest.fail)

    def push(lines):
        for line in lines:
            events = people.push(line, sender="a")
            if people.pose:
                page.show(people.pose)
            for event in events:
                page.send_event(event.as_json())

    push([head, *poses[:10]])
    browser.get(f"http://127.0.0.1:{page.port}/")
    axis = find(browser, ".time-canvas")
    wait_for(lambda: find(browser, ".bar h1").text == "sender a")
    push(poses[10:120])
    wait_for(lambda: now(axis) > 3.9)
    shown = "return [...document.querySelectorAll('.label-list button')].map((b) => b.innerText)"
    choose = (
        "const s = document.querySelector('[aria-label=Lane]'); s.selectedIndex = arguments[0];"
        "s.dispatchEvent(new Event('change'))"
    )
    browser.execute_script(choose, 1)
    wait_for(lambda: any("squat" in text for text in browser.execute_script(shown)))
    push(poses[120:])
    for event in people.finish():
        page.send_event(event.as_json())
    browser.execute_script(choose, 0)
    [text] = wait_for(lambda: browser.execute_script(shown))
    assert text.startswith("squat")
    # Who looks back stays there; who asks for it sees again what happens now.
    browser.execute_script("document.querySelector('.label-list button').click()")
    wait_for(lambda: "Final." in find(browser, ".why").text)
    assert find(browser, ".live").get_attribute("aria-pressed") == "false"
    find(browser, ".live").click()
    wait_for(lambda: now(axis) > 4.8)
    # Who comes later is told of what was.
    browser.refresh()
    wait_for(lambda: browser.execute_script(shown) == [text])
    assert not [one for one in browser.get_log("browser") if one["level"] == "SEVERE"]
    page.close()
    wait_for(lambda: "not connected" in find(browser, ".bar").text)
