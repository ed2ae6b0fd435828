"""Pages of an hour and of a minute at 120 Hz: bytes, first paint, interaction, memory.

The hour is made of real recordings repeated (CMU, where MOTIONARY_DATA has them), otherwise of
synthetic ones, and says which. Interaction is the time from a click or key to the frame that
shows it, in headless Chromium with WebGL in software: its renderer is told. Beside it stands a
page that does nothing but draw one ball with three.js, on the same machine under the same load.
"""

import os
import shutil
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

import motionary as mo
import motionary.reporting
from motionary.motion import GENERIC_JOINTS, Motion
from motionary.samples import synthetic_stream

RATE_HZ = 120.0
HOUR_S, MINUTE_S = 3600.0, 60.0
#: Bars of what is promised: bytes of an hour and a minute, seconds, milliseconds.
MOST_HOUR, MOST_MINUTE, MOST_PAINT_S, MOST_ANSWER_MS = 25e6, 3e6, 2.0, 100.0
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--use-gl=angle",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1280,720",
)  # fmt: skip
#: Milliseconds until the second frame after an action: the one that shows it is drawn then.
_ANSWER = """
const [action, done] = arguments, start = performance.now();
(new Function(action))();
requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now() - start)));
"""
_PRESS = "document.body.dispatchEvent(new KeyboardEvent('keydown', {{key: '{}', bubbles: true}}))"
_RENDERER = """
const gl = document.createElement("canvas").getContext("webgl2");
const info = gl && gl.getExtension("WEBGL_debug_renderer_info");
return info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "no WebGL";
"""
_PAINT = (
    "return (performance.getEntriesByName('first-contentful-paint')[0] || {}).startTime || null"
)


_BALL = """
const canvas = document.getElementById("ball"), scene = new THREE.Scene();
const renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
const camera = new THREE.PerspectiveCamera(40, 2, 0.05, 200);
const shape = new THREE.SphereGeometry(1, 14, 10), matter = new THREE.MeshLambertMaterial();
const ball = new THREE.InstancedMesh(shape, matter, 1);
scene.add(new THREE.AmbientLight(0xffffff, 2), ball);
camera.position.z = 3;
let moved = true;
addEventListener("keydown", () => (moved = true));
requestAnimationFrame(function draw() {
  requestAnimationFrame(draw);
  if (moved) renderer.render(scene, camera);
  moved = false;
});
"""


def main() -> None:
    """Write both pages, and measure the hour's in a browser where one is there."""
    with tempfile.TemporaryDirectory() as folder:
        hour, what = make_motion(HOUR_S)
        page = Path(folder) / "hour.html"
        start = time.perf_counter()
        mo.report(hour, page)
        print(
            f"  an hour at {RATE_HZ:g} Hz, {what}: written in {time.perf_counter() - start:.0f} s"
        )
        tell("bytes of the hour", page.stat().st_size / 1e6, MOST_HOUR / 1e6, "MB")
        minute = Path(folder) / "minute.html"
        mo.report(hour.cut(0, round(MINUTE_S * RATE_HZ)), minute)
        tell("bytes of a minute", minute.stat().st_size / 1e6, MOST_MINUTE / 1e6, "MB")
        measure_page(page, folder, bars=True)
        ball = Path(folder) / "ball.html"
        three = Path(motionary.reporting.__file__).parent / "page" / "three.min.js"
        ball.write_text(
            '<!doctype html><meta charset="utf-8"><p>ball</p><canvas id="ball" width="940" '
            f'height="450"></canvas><script>{three.read_text("utf-8")}{_BALL}</script>',
            encoding="utf-8",
        )
        print("  beside it, a page of one ball:")
        measure_page(ball, folder, bars=False)
        if hasattr(os, "getloadavg"):
            print(f"  {os.getloadavg()[0]:.1f} processes at work on {os.cpu_count()} processors")


def make_motion(length_s: float) -> tuple[Motion, str]:
    """A motion of so many seconds at 120 Hz, and what it is made of."""
    data = Path(os.environ.get("MOTIONARY_DATA", ""), "cmu")
    files = [data / f"{name}.amc" for name in ("86_01", "01_01", "49_08", "35_01")]
    if data.name and all(file.is_file() for file in files):
        motions, what = [mo.read(file) for file in files], "CMU repeated"
    else:
        motions, what = [synthetic_stream(("squat", "walk"), seed=1)[0]], "synthetic, repeated"
    part = np.concatenate([one.generic_positions() for one in motions])
    n_frames = round(length_s * RATE_HZ)
    positions = np.tile(part, (-(-n_frames // len(part)), 1, 1))[:n_frames]
    mapping = synthetic_stream(("squat",), seed=1)[0].mapping
    return Motion(GENERIC_JOINTS, positions, mo.Recording("hour", rate_hz=RATE_HZ), mapping), what


def measure_page(page: Path, folder: str, *, bars: bool) -> None:
    """First paint, interaction and memory of a page in Chromium, beside the bars if asked for."""
    browser, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not (browser and driver):
        print("  no Chromium with its driver: first paint and interaction are not measured")
        return
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for flag in (*FLAGS, f"--user-data-dir={folder}/profile"):
        options.add_argument(flag)
    chrome = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    try:
        chrome.get(page.as_uri())
        time.sleep(2)
        if bars:
            renderer = chrome.execute_script(_RENDERER)
            print(f"  renderer: {renderer}; flags {' '.join(FLAGS[-4:-1])}")
        paint, answer = (MOST_PAINT_S, MOST_ANSWER_MS) if bars else (None, None)
        tell("first paint", chrome.execute_script(_PAINT) / 1e3, paint, "s")
        actions = [
            _PRESS.format(key) for key in ("ArrowRight", "+", "End", "-", "Home", "ArrowLeft")
        ]
        chrome.set_script_timeout(30)
        answers = sorted(
            chrome.execute_async_script(_ANSWER, actions[i % len(actions)]) for i in range(60)
        )
        tell("interaction, median", statistics.median(answers), answer, "ms")
        tell("interaction, 95 %", answers[int(0.95 * len(answers))], answer, "ms")
        chrome.execute_cdp_cmd("Performance.enable", {})
        metrics = chrome.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
        heap = next(one["value"] for one in metrics if one["name"] == "JSHeapUsedSize")
        print(f"  {'heap of the script':<22} {heap / 1e6:9.1f} MB")
    finally:
        chrome.quit()


def tell(what: str, value: float, bar: float | None, unit: str) -> None:
    """One line: a number, beside its bar where it has one."""
    said = "" if bar is None else f" (bar {bar:g}){'' if value <= bar else '  MISSED'}"
    print(f"  {what:<22} {value:9.2f} {unit:<3}{said}")


if __name__ == "__main__":
    main()
