#!/usr/bin/env python3
"""Opens a report in headless Chromium, without network, and uses it as a reader does.

usage: check_report.py [--screenshots FOLDER] REPORT.html...

Fails on any error in the console, any request but the page itself, a file of 5 MB or more; with formed plies also
unless the 3D view draws in several colours and changes when it is dragged, turned by keys, asked for another field, for lines, for an earlier moment or without
its bodies, of two runs side by side both views move together, the first screen has its answers above the fold at 1280 x 800, and a defect is highlighted in the table, on the maps and in the view; of a study unless its table sorts, its marks lead to
their points and it fits a phone. Needs chromium, chromium-driver
and the package selenium. Exit code 0: all as it should be.
"""

import argparse
import json
import os
import pathlib
import shutil
import sys

from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait

LARGEST = 5_000_000
# Seconds that software WebGL may take for the first picture.
PATIENCE = 60

# Distinct colours (five bits a channel) of a canvas, and a number that changes with its picture.
LOOK = """
const canvas = arguments[0], gl = canvas.getContext('webgl');
const bytes = new Uint8Array(4 * canvas.width * canvas.height);
gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
const colours = new Set();
let mark = 0, covered = 0;
for (let i = 0; i < bytes.length; i += 4) {
  if (bytes[i + 3] === 0) continue;
  covered += 1;
  colours.add((bytes[i] >> 3) << 10 | (bytes[i + 1] >> 3) << 5 | bytes[i + 2] >> 3);
  mark = (Math.imul(mark, 31) + i + bytes[i] * 65536 + bytes[i + 1] * 256 + bytes[i + 2]) | 0;
}
return {colours: colours.size, covered: covered / (bytes.length / 4), mark};
"""
COLUMN = """
return [...document.querySelectorAll('table.points tbody tr')].map((row) => {
  const cell = row.cells[arguments[0]];
  return {text: cell.textContent.trim(), value: cell.dataset.value ?? null, place: row.dataset.place};
});
"""
SLIDE = "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'));"
FRAME = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done));"


def browser(dark=False, width=1400, scripts=True):
    """Chromium with WebGL in software, without a way out."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    arguments = [
        "--headless=new", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", f"--window-size={width},1000",
        "--host-resolver-rules=MAP * ~NOTFOUND", "--disable-background-networking", "--no-first-run",
        # A container's /dev/shm is small.
        "--disable-dev-shm-usage",
    ]
    if os.geteuid() == 0:
        arguments.append("--no-sandbox")
    if dark:
        arguments.append("--force-dark-mode")
    for argument in arguments:
        options.add_argument(argument)
    if not scripts:
        options.add_experimental_option("prefs", {"profile.managed_default_content_settings.javascript": 2})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    service = webdriver.ChromeService(executable_path=shutil.which("chromedriver"))
    return webdriver.Chrome(options=options, service=service)


class Page:
    """A report in a browser."""

    def __init__(self, driver, path):
        self.driver = driver
        self.address = path.resolve().as_uri()
        driver.get(self.address)

    def all(self, selector):
        return self.driver.find_elements(By.CSS_SELECTOR, selector)

    def look(self, canvas):
        """What a canvas shows now."""
        self.driver.execute_async_script(FRAME)
        return self.driver.execute_script(LOOK, canvas)

    def changes(self, canvases, what, act):
        """Does something and demands another picture in one of them at least; the first one's is given back."""
        before = [self.look(c) for c in canvases]
        act()
        after = [self.look(c) for c in canvases]
        same = [a["mark"] == b["mark"] for a, b in zip(after, before)]
        assert not all(same), f"the 3D view is the same after {what}"
        return after[0]

    def drag(self, canvas, x, y):
        ActionChains(self.driver, duration=50).click_and_hold(canvas).move_by_offset(x, y).release().perform()

    def to(self, element):
        self.driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)

    def press(self, element):
        """A click in the middle of an element, also of one that the browser takes for covered."""
        self.to(element)
        ActionChains(self.driver).move_to_element(element).click().perform()

    def quiet(self):
        """No error was told and nothing was asked for but the page."""
        told = [e for e in self.driver.get_log("browser") if e["level"] in ("SEVERE", "WARNING")]
        # Chromium's word on software WebGL, and on reading from it.
        told = [e for e in told if "GPU stall" not in e["message"] and "software WebGL" not in e["message"]]
        assert not told, f"the console says {told}"
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                url = message["params"]["request"]["url"]
                allowed = url.split("#")[0] == self.address or url.startswith(("data:", "blob:"))
                assert allowed, f"the page asked for {url}"


def check_view(page, section):
    """The 3D view of a study."""
    find = lambda selector: section.find_element(By.CSS_SELECTOR, selector)
    canvas = find("canvas")
    wait = WebDriverWait(page.driver, PATIENCE)
    wait.until(lambda _: find(".view3d").get_attribute("data-ready"), "the 3D view does not draw")
    assert not find(".without-3d").is_displayed(), find(".without-3d").text
    page.to(canvas)
    shown = page.look(canvas)
    assert shown["colours"] > 30 and shown["covered"] > 0.05, f"the 3D view shows {shown}"
    page.changes([canvas], "dragging", lambda: page.drag(canvas, 80, 20))
    page.changes([canvas], "an arrow key", lambda: canvas.send_keys(Keys.ARROW_LEFT))
    page.changes([canvas], "zooming", lambda: canvas.send_keys("+"))
    page.changes([canvas], "a standard view", find("button[data-elevation='90']").click)
    page.changes([canvas], "resetting", find("button[data-reset]").click)
    assert page.look(canvas)["mark"] == shown["mark"], "resetting does not bring the first view back"
    options = section.find_elements(By.CSS_SELECTOR, "option")
    assert options, "there is no field to choose"
    before, alike = page.look(canvas), []
    for option in options[1:]:
        option.click()
        now = page.look(canvas)
        assert now["colours"] > 1, f"{option.text} shows {now}"
        if now["mark"] == before["mark"]:
            alike.append(option.text)
        before = now
        bars = [b for b in section.find_elements(By.CSS_SELECTOR, ".legend3d") if b.is_displayed()]
        assert len(bars) == 1, f"{len(bars)} colour bars"
    # Two flags may be one pattern, as where nothing is sheared too far; of more the choice does nothing.
    assert len(alike) <= 1, f"choosing {alike} changes nothing in the 3D view"
    options[0].click()
    plain = page.look(canvas)["mark"]
    for box in section.find_elements(By.CSS_SELECTOR, "input[data-show='mesh'], input[data-show='edges'], input[data-show='fibres']"):
        what = box.get_attribute("data-show")
        page.changes([canvas], f"asking for {what}", box.click)
        box.click()
        assert page.look(canvas)["mark"] == plain, f"something of {what} is left when it is off again"
    for slider in section.find_elements(By.CSS_SELECTOR, "input[data-moment]"):
        at = lambda value: page.driver.execute_script(SLIDE, slider, value)
        page.changes([canvas], "going back in time", lambda: at(0))
        told = section.find_element(By.CSS_SELECTOR, "output").text
        assert told.endswith(" ms"), f"the moment is told as {told}"
        at(slider.get_attribute("max"))
        assert page.look(canvas)["mark"] == plain, "the end of the way is not what was shown at first"
    for box in section.find_elements(By.CSS_SELECTOR, "input[data-show='tool'], input[data-show='ply']"):
        box.click()
    assert page.look(canvas)["covered"] == 0, "something is left when all bodies are off"
    for box in section.find_elements(By.CSS_SELECTOR, "input[data-show='tool'], input[data-show='ply']"):
        box.click()
    return f"{shown['colours']} colours, {len(options)} fields"


def check_answer(page):
    """The first screen has its four answers above the fold, and its places lead to the maps."""
    try:
        size = {"width": 1280, "height": 800, "deviceScaleFactor": 1, "mobile": False}
        page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        for answer in page.all("#answer .answers > div"):
            bottom = page.driver.execute_script("return arguments[0].getBoundingClientRect().bottom + scrollY", answer)
            assert bottom <= 800, f"{answer.get_attribute('id')} ends at {bottom:.0f} of 800"
        assert len(page.all("#answer .answers > div h2")) == 4, "there are not four answers"
    finally:
        page.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    for place in page.all("#answer li.selectable")[:1]:
        page.press(place)
        assert page.all("tr.lit"), "a place of the first screen is not highlighted in the table"
        place.click()
    return "four answers"


def check_beside(page):
    """Two runs side by side: what is done to one view happens to the other."""
    canvases = page.all(".view3d canvas")
    for first, second in zip(canvases[::2], canvases[1::2]):
        page.to(second)
        page.changes([second], "turning the other view", lambda: first.send_keys(Keys.ARROW_LEFT))
        page.changes([first], "resetting the other view", lambda: second.send_keys("0"))
    selects = page.all(".view3d select")
    options = selects[0].find_elements(By.CSS_SELECTOR, "option")
    options[-1].click()
    shown = [s.find_element(By.CSS_SELECTOR, "option:checked").text for s in selects[:2]]
    assert shown[0] == shown[1], f"the views show {shown}"
    options[0].click()
    return f"{len(canvases)} linked views"


def check_defects(page):
    """Selecting defects in the table and on the maps."""
    rows = page.all("tr.selectable")
    # A study with several coarse runs has a view of each; a defect is in one of them.
    canvases = page.all(".view3d canvas")
    lit = lambda: page.all("tr.lit")
    for row in rows[:2] + rows[-1:]:
        page.changes(canvases, "a click on a row", lambda: page.press(row.find_element(By.CSS_SELECTOR, "th, td")))
        assert lit() == [row] and row.get_attribute("aria-selected") == "true", "the row is not highlighted"
        name = row.get_attribute("data-defect")
        marks = page.all(f"g.place.lit[data-defect='{name}']")
        assert marks and len(marks) == len(page.all("g.place.lit")), f"{name} is not highlighted on the maps"
    if rows:
        page.changes(canvases, "Escape", lambda: page.driver.switch_to.active_element.send_keys(Keys.ESCAPE))
        assert not lit(), "Escape leaves a row highlighted"
        page.changes(canvases, "Enter on a row", lambda: rows[0].send_keys(Keys.ENTER))
        assert lit() == rows[:1], "Enter does not select a row"
        rows[0].send_keys(Keys.ESCAPE)
        page.press(page.all(f"g.place[data-defect='{rows[-1].get_attribute('data-defect')}'] path")[-1])
        assert len(lit()) == 1, "a click on a map does not select a row"
    return f"{len(rows)} defects"


def check_study(page, path):
    """The table of a study sorts with the mouse and with keys, pictures follow, and every mark leads to its point."""
    heads = page.all("table.points thead th")
    # Of a column: text and value of each cell, and the place that its row leads to.
    column = lambda at: page.driver.execute_script(COLUMN, at)
    places = lambda: page.driver.execute_script("return [...document.querySelectorAll('article.point')].map((a) => a.id)")
    before = column(0)
    assert len(places()) == len(before), "not every point has its place"
    for at in range(1, len(heads)):
        button = heads[at].find_element(By.CSS_SELECTOR, "button")
        page.press(button)
        assert heads[at].get_attribute("aria-sort") == "ascending", "a click does not sort"
        up = [float(c["value"]) for c in column(at) if c["value"] is not None]
        assert up == sorted(up), f"column {at} is not sorted: {up}"
        button.send_keys(Keys.ENTER)
        assert heads[at].get_attribute("aria-sort") == "descending", "Enter does not sort"
        cells = column(at)
        assert [float(c["value"]) for c in cells if c["value"] is not None] == up[::-1], f"column {at} is not sorted downwards"
        # What has no value is last, whichever way.
        dashes = [c["text"] == "–" for c in cells]
        assert dashes == sorted(dashes), f"column {at} has its missing values in the middle"
        assert places() == [c["place"] for c in cells], "the pictures do not follow the table"
        assert page.all("#sorted")[0].get_attribute("textContent"), "the order is not told"
    page.press(heads[0].find_element(By.CSS_SELECTOR, "button"))
    assert column(0) == before, "the order of the study does not come back"
    marks = page.all("#responses svg a")
    # The last: of several that lie on each other the uppermost takes the click.
    for mark in marks[-1:]:
        ActionChains(page.driver).move_to_element(mark).perform()
        target = mark.get_dom_attribute("href").removeprefix("#")
        page.to(mark)
        ActionChains(page.driver).move_to_element(mark).click().perform()
        assert page.driver.current_url.endswith(target), "a mark does not lead to its point"
        name = page.driver.execute_script("return arguments[0].querySelector('title')?.textContent", mark)
        place = page.driver.execute_script("return document.getElementById(arguments[0]).querySelector('h3').textContent", target)
        assert name and name.split("\n")[0] == place, f"a mark is called {name} and leads to {place}"
    for select in page.all("#response"):
        options = select.find_elements(By.CSS_SELECTOR, "option")
        options[-1].click()
        shown = [r.get_attribute("data-response") for r in page.all("section.response") if r.is_displayed()]
        assert shown == [options[-1].get_attribute("value")], f"chosen is one response, shown are {shown}"
        options[0].click()
        assert all(r.is_displayed() for r in page.all("section.response")), "not all responses came back"
    narrow(path)
    return f"{len(before)} points, {len(marks)} marks"


def narrow(path):
    """On a phone nothing but tables goes beyond the screen, also without scripts."""
    for how in [{}, {"scripts": False}, {"dark": True}]:
        driver = browser(**how)
        try:
            size = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
            driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            page = Page(driver, path)
            width = page.all("html")[0].get_property("scrollWidth")
            assert width <= 390, f"{how}: the page is {width} wide on a screen of 390"
            hidden = [r for r in page.all("section.response") if not r.is_displayed()]
            assert not hidden, f"{how}: a response is hidden"
        finally:
            driver.quit()


def check(path, folder):
    """One report; gives what was seen in words."""
    size = path.stat().st_size
    assert size < LARGEST, f"{path} has {size} bytes"
    said = [f"{size / 1e6:.2f} MB"]
    driver = browser()
    try:
        page = Page(driver, path)
        for section in page.all("section[id^='view-']"):
            said.append(check_view(page, section))
        if page.all("#answer"):
            said.append(check_answer(page))
        if page.all("body.beside"):
            said.append(check_beside(page))
        elif page.all(".view3d"):
            said.append(check_defects(page))
        if page.all("table.points"):
            said.append(check_study(page, path))
        page.quiet()
    finally:
        driver.quit()
    if folder:
        screenshots(path, folder)
    return ", ".join(said)


def screenshots(path, folder):
    """The view with and without a defect, light, dark and narrow, and the page without scripts."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, how in [
        ("light", {}), ("dark", {"dark": True}), ("narrow", {"width": 520}), ("no-scripts", {"scripts": False}),
    ]:
        driver = browser(**how)
        try:
            page = Page(driver, path)
            picture = lambda what: driver.save_screenshot(str(folder / f"{path.stem}-{name}-{what}.png"))
            picture("top")
            for n, section in enumerate(page.all("section[id^='view-']")):
                if how.get("scripts", True):
                    view = section.find_element(By.CSS_SELECTOR, ".view3d")
                    WebDriverWait(driver, PATIENCE).until(lambda _: view.get_attribute("data-ready"))
                    driver.execute_async_script(FRAME)
                driver.execute_script("arguments[0].scrollIntoView()", section)
                picture(f"view-{n}")
            for n, row in enumerate(page.all("tr.selectable")[:3]):
                page.press(row.find_element(By.CSS_SELECTOR, "th, td"))
                driver.execute_async_script(FRAME)
                driver.execute_script("arguments[0].scrollIntoView()", page.all("section[id^='view-']")[0])
                picture(f"defect-{n}")
                page.to(page.all("g.place.lit path")[0])
                picture(f"defect-{n}-map")
        finally:
            driver.quit()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--screenshots", type=pathlib.Path, metavar="FOLDER")
    parser.add_argument("reports", type=pathlib.Path, nargs="+", metavar="REPORT.html")
    given = parser.parse_args()
    for path in given.reports:
        print(f"Chromium: {path}: {check(path, given.screenshots)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
