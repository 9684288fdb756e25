"""Uses the workbench in Chromium: signs in, searches, tags, compares; says as JSON what it saw.

    python browse_studio.py CHROMIUM FOLDER URL

Pictures of the pages (1400 px wide and light, 390 px wide and dark) are left in FOLDER.
"""

import json
import sys
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

from chromium import VIEWS, launched, serious_findings, watched

chromium, folder, url = sys.argv[1], Path(sys.argv[2]), sys.argv[3]
origin = url.split("#")[0]
console, serious, requests, result = [], [], [], {}

with sync_playwright() as playwright:
    browser = launched(playwright, chromium)
    context = browser.new_context(viewport={"width": 1400, "height": 1000}, color_scheme="light")
    page = watched(context.new_page(), console, requests)
    # The first answer asks for the token, which browsers report as an error.
    page.goto(url)
    page.wait_for_selector("#runs tbody tr")
    console.clear()
    result["address_has_token"] = "token" in page.url
    rows = lambda: page.locator("#runs tbody tr").count()
    result["listed"] = rows()

    def search(words):
        page.fill("input[name=words]", words)
        page.press("input[name=words]", "Enter")
        page.wait_for_load_state()

    search("before turbo_a")
    result["found"] = rows()
    # A tag and a comment, by keyboard alone.
    page.focus("#runs tbody a")
    page.keyboard.press("Enter")
    page.wait_for_selector("#comment")
    page.fill("input[name=tags]", "cold, reference")
    page.fill("#comment", "after the rework")
    page.focus("text=Keep")
    page.keyboard.press("Enter")
    page.wait_for_selector("#comment")
    result["comment"] = page.input_value("#comment")
    result["by_keyboard"] = page.input_value("input[name=tags]") == "cold, reference"
    of_run = page.url
    with page.expect_download() as download:
        page.click("a[download]:text-is('csv')")
    result["downloaded"] = download.value.suggested_filename
    page.click("nav a")
    page.select_option("select[name=tag]", "cold")
    page.click("text=Search")
    page.wait_for_load_state()
    result["tagged"] = rows()
    search("nothing has this")
    result["empty"] = page.text_content("#empty")
    page.click("text=Show all")
    page.wait_for_selector("#runs tbody tr")
    for box in page.locator("input[name=run]").all():
        box.check()
    page.click("text=Compare the chosen runs")
    page.wait_for_selector("svg")
    of_comparison = page.url
    # A table for each further run, that of the most different one first; the last columns are the shares of places that differ.
    result["shares"] = page.locator("table:has(th:text('eta differs'))").evaluate_all(
        "tables => tables.map(table => [...table.tBodies[0].rows].map(row => Math.max(row.cells[8].textContent, row.cells[9].textContent)))"
    )
    words = page.locator("svg").first.text_content()
    result["legend"] = [name in words for name in ["before", "after", "third"]]
    for width, height, scheme in VIEWS:
        context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme, storage_state=page.context.storage_state()
        )
        other, over = watched(context.new_page(), console, requests), []
        for name, place in [("list", origin), ("run", of_run), ("comparison", of_comparison)]:
            other.goto(place)
            other.screenshot(path=folder / f"{name}-{width}-{scheme}.png", full_page=True)
            serious.extend(serious_findings(Axe(), other, f"{name} {width} {scheme}"))
            over.append(other.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))
        result[f"overflow_{width}_{scheme}"] = over
        context.close()
    browser.close()

result["console"] = console
result["serious"] = serious
result["elsewhere"] = [request for request in requests if not request.startswith(origin)]
json.dump(result, sys.stdout)
