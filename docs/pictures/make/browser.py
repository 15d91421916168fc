"""Pictures of the HTML pages that Plyflow writes, taken with headless Chromium as tests/report does."""

import functools
import io
import os
import pathlib
import shutil

import numpy as np
from PIL import Image
from selenium import webdriver
from selenium.webdriver.support.ui import WebDriverWait

import runs
import spar
import style

# Seconds that software WebGL may take for the first picture.
PATIENCE = 60


def chromium(width: int, height: int, scale: float):
    """Chromium with WebGL in software, without a way out. `scale`: pixels of the picture for one of the page."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    arguments = ["--headless=new", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", f"--window-size={width},{height}",
                 "--host-resolver-rules=MAP * ~NOTFOUND", "--disable-background-networking", "--no-first-run", "--disable-dev-shm-usage",
                 "--hide-scrollbars", f"--force-device-scale-factor={scale}"]
    if os.geteuid() == 0:
        arguments.append("--no-sandbox")
    for argument in arguments:
        options.add_argument(argument)
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(executable_path=shutil.which("chromedriver")))


def photograph(page: pathlib.Path, name: str, width: int, height: int, prepare, scale: float = 1.5):
    """A picture of a page, after `prepare` has been called with the driver and has brought the right place into view."""
    driver = chromium(width, height, scale)
    try:
        driver.get(page.resolve().as_uri())
        prepare(driver)
        driver.execute_async_script("const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done));")
        picture = Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB")
    finally:
        driver.quit()
    return style.save_pixels(np.asarray(picture), name)


def page(place: tuple[str, ...], name: str) -> pathlib.Path:
    """The report of a run. What differs from run to run (times, hosts) is not in the part that is photographed."""
    path = runs.STORE / f"{name}.html"
    runs.plyflow("report", *place, "--output", str(path))
    return path


# Brings the heading with a text to the upper edge.
TO_HEADING = """
const heading = [...document.querySelectorAll('h2, h3, h4')].find((h) => h.textContent.trim().startsWith(arguments[0]));
window.scrollTo(0, heading.getBoundingClientRect().top + window.scrollY - 12);
"""


def report():
    """The 3D view of the demo's report."""
    def prepare(driver):
        WebDriverWait(driver, PATIENCE).until(lambda d: d.find_element("css selector", ".view3d").get_attribute("data-ready"))
        driver.execute_script(TO_HEADING, "Formed plies in 3D")
    return photograph(page(spar.demo(), "report"), "report", 900, 880, prepare)


# Of the first pictures of the guide, which shows the same text.
LIMITS = """
limits:
  wrinkle_height: 3 mm
  wrinkle_length: 40 mm
  bridging_gap: 3 mm
  shear_negative: -50 deg
  places:
    - {name: top, rectangle: {length: 300 mm, width: 100 mm}, wrinkle_height: 1 mm}
    - {ply: ply_2, bridging_gap: 5 mm}
"""


@functools.cache
def with_limits() -> pathlib.Path:
    """The report of the coarse variant of the demo with limits, which are no part of a key: the run of the coarse variant serves."""
    file = runs.workflows() / "joggle-spar" / "workflow-coarse.yaml"
    limited = file.with_name("with-limits.yaml")
    limited.write_text(file.read_text() + LIMITS)
    return page(runs.run("joggle-spar/with-limits"), "report-limits")


def report_answer():
    """The first screen of a report with limits."""
    return photograph(with_limits(), "report-answer", 1280, 880, lambda driver: None, scale=1)


def report_limits():
    """The table of limits, with who has looked."""
    return photograph(with_limits(), "report-limits", 1280, 660, lambda driver: driver.execute_script(TO_HEADING, "Limits"), scale=1)


def choose(driver, field: str, *lines: str):
    """In the first 3D view: colours by a field, and lines on request."""
    driver.execute_script("""
const view = document.querySelector('.view3d'), select = view.querySelector('select');
select.value = [...select.options].find((o) => o.textContent.startsWith(arguments[0])).value;
select.dispatchEvent(new Event('change'));
for (const box of view.querySelectorAll('input[data-show]')) if (arguments[1].includes(box.parentElement.textContent.trim())) box.click();
""", field, list(lines))


def report_fibres():
    """The 3D view of the coarse spar: how far the first fibre family has turned, with its lines."""
    def prepare(driver):
        WebDriverWait(driver, PATIENCE).until(lambda d: d.find_element("css selector", ".view3d").get_attribute("data-ready"))
        choose(driver, "Fibre deviation, family 1", "Fibres 1")
        driver.execute_script(TO_HEADING, "Formed plies in 3D")
    return photograph(with_limits(), "report-fibres", 760, 640, prepare, scale=1)


def report_inputs():
    """Ply book and tool of the coarse spar."""
    return photograph(with_limits(), "report-inputs", 1060, 880, lambda driver: driver.execute_script(TO_HEADING, "What went in"), scale=1)


# The friction between plies, before and after.
CHANGE = tuple(f"{step}.scene.friction.fabric_fabric=0.2" for step in ("coarse", "local"))


def report_beside():
    """Two runs of the coarse spar side by side: what differs, and the limits."""
    with_limits()
    file, *store = runs.run("joggle-spar/with-limits")
    change = [word for value in CHANGE for word in ("--set", value)]
    runs.plyflow("run", file, *store, *change, "--no-report", "--quiet")
    other = [word for value in CHANGE for word in ("--beside-set", value)]
    path = runs.STORE / "report-beside.html"
    runs.plyflow("report", file, *store, "--beside", file, *other, "--output", str(path))
    return photograph(path, "report-beside", 1160, 740, lambda driver: None, scale=1)


def study():
    """The page of a study: the largest shear over the ply's angle and size, as a map."""
    def prepare(driver):
        driver.execute_script(TO_HEADING, "shear (deg) over angle and size")
    return photograph(page(runs.run("kinematic/angles-with-map"), "study"), "study", 900, 760, prepare)
