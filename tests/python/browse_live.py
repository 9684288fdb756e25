"""Looks on at a run through its live page in Chromium, stops it with a button, and says as JSON what happened.

    python browse_live.py CHROMIUM FOLDER MAPPER run CAMPAIGN --out RUNS --pace 60

Pictures of the page (1400 px wide and light, 390 px wide and dark) and of its head are left in FOLDER.
"""

import atexit
import json
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

from chromium import VIEWS, launched, serious_findings, watched

chromium, folder, command = sys.argv[1], Path(sys.argv[2]), sys.argv[3:]
console, serious, requests, result = [], [], [], {}

run = subprocess.Popen(
    [*command, "--live=127.0.0.1:0", "--progress", "json", "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
)
# Whatever goes wrong here, the run does not outlive it.
atexit.register(run.kill)
url, events, heard = None, [], threading.Event()


def listen():
    """The messages of the program itself, each with the time at which it was printed."""
    global url
    for line in run.stderr:
        found = re.match(r"live page: (\S+)", line)
        if found:
            url = found[1]
            heard.set()
        elif line.startswith("{"):
            events.append((time.time(), json.loads(line)))
    heard.set()


listener = threading.Thread(target=listen, daemon=True)
listener.start()
output = []
reader = threading.Thread(target=lambda: output.append(run.stdout.read()), daemon=True)
reader.start()
heard.wait(60)
assert url, "no address was printed"


def status(path, method="GET", **headers):
    """What the server answers to a request that is not the page's."""
    try:
        return urllib.request.urlopen(urllib.request.Request(url + path, method=method, headers=headers), timeout=5).status
    except urllib.error.HTTPError as error:
        return error.code


own = url.rstrip("/")
result["refused"] = {
    "another page's button": status("ask/safe", "POST", Origin="http://evil.example"),
    "a button of no page": status("ask/safe", "POST"),
    "another page's eyes": status("events", Origin="http://evil.example"),
    "another name": status("events", Host="evil.example"),
    "another path": status("recording.mcap"),
    "another method": status("", "PUT", Origin=own),
    "another button": status("ask/anything", "POST", Origin=own),
}

SEEN = """() => {
  window.seen = {};
  new MutationObserver(() => {
    for (const row of document.querySelectorAll('#points tr')) window.seen[row.dataset.step] ??= Date.now() / 1000;
  }).observe(document.getElementById('points'), { childList: true });
}"""


def opened(browser, width, height, scheme):
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
    page = watched(context.new_page(), console, requests)
    page.goto(url)
    page.wait_for_selector("html[data-connected=true]")
    page.wait_for_selector("#readings tr")
    return context, page


def until(page, holds, seconds=60):
    """Waits as `wait_for_function` does, which a page that forbids `eval` refuses, and returns what held."""
    end = time.time() + seconds
    while not (held := page.evaluate(holds)):
        assert time.time() < end, f"{holds}: {page.text_content('main')[:2000]}"
        page.wait_for_timeout(20)
    return held


def press(page, button):
    page.click(f"button[data-ask={button}]")
    page.wait_for_selector("#sure[open]")
    page.click("#yes")


with sync_playwright() as playwright:
    browser = launched(playwright, chromium)
    context, page = opened(browser, 1400, 1000, "light")
    page.evaluate(SEEN)
    since = time.time()
    points = lambda: page.locator("#points tr").count()
    # Rows that come while the page looks on: the program reported at that time that it had identified them.
    until(page, f"document.querySelectorAll('#points tr').length >= {points() + 2}")
    seen = {int(step): at for step, at in page.evaluate("window.seen").items()}
    at = {event["step"]: when for when, event in events if event["event"] == "point_estimated"}
    result["seconds_to_be_seen"] = [max(0.0, seen[step] - at[step]) for step in seen if at.get(step, 0) > since]
    until(page, "document.querySelectorAll('#map-plot .point').length >= 1")
    # The run is held, so that the step does not end while the rest is looked at.
    press(page, "hold")
    until(page, "document.querySelector('#where').textContent.startsWith('Held')")
    until(page, "document.querySelector('#events').textContent.includes('the step is held')")
    result["held_at"] = page.text_content("#phase")
    for width, height, scheme in VIEWS:
        other, small = opened(browser, width, height, scheme)
        small.screenshot(path=folder / f"live-{width}-{scheme}.png", full_page=True)
        if (width, scheme) == (1400, "light"):
            small.screenshot(path=folder / "live.png")
        serious.extend(serious_findings(Axe(), small, f"{width} {scheme}"))
        result[f"overflow_{width}_{scheme}"] = small.evaluate(
            "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        )
        other.close()
    result["still_held_at"] = page.text_content("#phase")
    before = points()
    page.reload()
    until(page, f"document.querySelectorAll('#points tr').length >= {before}")
    result["points_before_reload"], result["points_after_reload"] = before, points()
    # A program that is stopped is as silent as one whose cable was pulled; complaints of that are the browser's own.
    complaints = len(console)
    run.send_signal(signal.SIGSTOP)
    page.wait_for_selector("html[data-connected=false]", timeout=20_000)
    result["shown_alone"] = page.text_content("#connection")
    run.send_signal(signal.SIGCONT)
    page.wait_for_selector("html[data-connected=true]", timeout=20_000)
    del console[complaints:]
    result["points_after_loss"] = points()
    press(page, "go-on")
    until(page, f"document.querySelectorAll('#points tr').length > {before}")
    # Contours stand as soon as two lines have two points each. They are drawn again with every point, so they are counted where they were seen.
    result["contours"] = until(page, "document.querySelectorAll('#map-plot .contour path').length")
    page.screenshot(path=folder / "live-contours.png", full_page=True)
    press(page, "stop")
    until(page, "document.querySelector('#phase').textContent === 'The run has ended'")
    result["connection"] = page.text_content("#connection")
    page.wait_for_timeout(200)
    browser.close()

result["exit"] = run.wait(60)
reader.join(10)
listener.join(10)
result["console"] = console
result["serious"] = serious
result["elsewhere"] = [url_ for url_ in requests if not url_.startswith(url)]
result["recorded"] = [event["message"] for _, event in events if event["event"] == "reported"]
result["run"] = json.loads(output[0])
result["run"]["points"] = len(result["run"]["points"])
json.dump(result, sys.stdout)
