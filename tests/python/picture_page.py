"""Takes a picture of a page as a reader sees it first, 1400 px wide, light.

    python picture_page.py CHROMIUM PAGE PICTURE.png
"""

import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from chromium import launched

chromium, page_file, picture = sys.argv[1], Path(sys.argv[2]).resolve(), Path(sys.argv[3])
with sync_playwright() as playwright:
    browser = launched(playwright, chromium)
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.goto(page_file.as_uri())
    page.screenshot(path=picture)
    browser.close()
