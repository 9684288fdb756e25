"""Opens a run's page in Chromium as a reader would, and says as JSON what happened.

    python browse_report.py CHROMIUM PAGE FOLDER [looked_at]

Pictures of the page (1400 px wide and light, 390 px wide and dark), of its head, and the print as A4 PDF are left in FOLDER. A page that is
only looked at is neither used nor printed.
"""

import json
import sys
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

from chromium import VIEWS, launched, serious_findings, watched

chromium, page_file, folder = sys.argv[1], Path(sys.argv[2]).resolve(), Path(sys.argv[3])
console, requests, serious = [], [], []
result = {}


def opened(browser, width, height, scheme):
    page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
    watched(page, console, requests)
    page.goto(page_file.as_uri())
    page.wait_for_selector("html[data-drawn=true]")
    return page


def use_and_print(browser):
    page = opened(browser, 1400, 1000, "light")
    page.screenshot(path=folder / "report.png")
    ticks = lambda: page.locator("#map-plot g[data-mark='x-axis tick label'] text").all_text_contents()
    before = ticks()
    page.locator("#map-plot svg").hover()
    page.keyboard.down("Control")
    page.mouse.wheel(0, -600)
    page.keyboard.up("Control")
    page.wait_for_timeout(400)
    result["zoomed"] = before and ticks() != before
    page.click("#whole")
    result["whole_again"] = ticks() == before
    count = lambda selector: page.locator(selector).count()
    result["title"] = page.title()
    result["points"] = count("#map-plot .point")
    result["eta_points"] = count("#eta-plot .point")
    result["paths"] = count("#map-plot g[data-mark=line] path")
    result["jumps"] = count("#plan-plot g[data-mark=arrow] path")
    page.uncheck("input[value=contours]")
    result["paths_without_contours"] = count("#map-plot g[data-mark=line] path")
    page.check("input[value=repeats]")
    result["points_with_repeats"] = count("#map-plot .point")
    # Repeats lie on their points, and the uppermost takes the pointer.
    page.uncheck("input[value=repeats]")
    point = page.locator("#map-plot .point").nth(3)
    point.hover()
    page.wait_for_selector("#map-plot g[aria-label=tip] text")
    result["tip"] = page.locator("#map-plot g[aria-label=tip]").text_content()
    step = point.get_attribute("data-step")
    point.click()
    result["clicked"], result["chosen"] = step, page.input_value("#step-choice")
    result["step_plots"] = count("#step-plots svg")
    result["step_words"] = page.text_content("#step-words")
    table = page.locator("#points table.data").first
    column = lambda: [float(text) for text in table.locator("tbody tr td:nth-child(5)").all_text_contents()]
    head = table.locator("thead th:nth-child(5) button")
    head.click()
    result["sorted_up"] = column()
    head.click()
    result["sorted_down"] = column()
    # What a table's button copies is what is pasted elsewhere: as many rows and columns as the table has.
    page.evaluate("""() => { const into = document.createElement('textarea'); into.id = 'paste'; document.body.append(into); }""")
    result["copied"], result["tables"] = [], count("main table")
    for index in range(result["tables"]):
        of = page.locator("main table").nth(index)
        # Some tables are folded away.
        of.evaluate("table => table.closest('details')?.setAttribute('open', '')")
        of.locator("button.copy").click()
        page.wait_for_timeout(50)
        page.focus("#paste")
        page.keyboard.press("Control+A")
        page.keyboard.press("Control+V")
        rows = page.input_value("#paste").split("\n")
        result["copied"].append([len(rows) == of.locator("tr").count(), len(rows[-1].split("\t")) == of.locator("tr").last.locator("td, th").count()])
    page.evaluate("document.getElementById('paste').remove()")
    # By keyboard alone.
    page.focus("#step-choice")
    page.keyboard.press("ArrowDown")
    result["by_keyboard"] = page.input_value("#step-choice") != step
    page.close()
    # Printed as it is opened, not as a user has left it.
    page = opened(browser, 1400, 1000, "dark")
    # A button in a head would keep the head from being repeated on the next sheet.
    page.emulate_media(media="print")
    result["heads_repeated"] = page.evaluate(
        "[...document.querySelectorAll('main thead button')].every(button => getComputedStyle(button).display === 'contents')"
    )
    page.emulate_media(media=None)
    page.pdf(path=folder / "report.pdf", format="A4", landscape=True)


with sync_playwright() as playwright:
    browser = launched(playwright, chromium)
    for width, height, scheme in VIEWS:
        page = opened(browser, width, height, scheme)
        page.screenshot(path=folder / f"report-{width}-{scheme}.png", full_page=True)
        serious.extend(serious_findings(Axe(), page, f"{width} {scheme}"))
        # Tables may be wider than a phone, the page may not.
        result[f"overflow_{width}_{scheme}"] = page.evaluate(
            "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        )
        result["heads_without_sorting"] = page.locator("main thead th:not(:empty):not(:has(button))").count()
        page.close()
    if sys.argv[4:] != ["looked_at"]:
        use_and_print(browser)
    browser.close()

result.update(console=console, serious=serious, requests=[url for url in requests if url != page_file.as_uri()])
json.dump(result, sys.stdout)
