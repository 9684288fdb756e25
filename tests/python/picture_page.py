"""Takes a picture of a page as a reader sees it first, 1400 px wide, light.

    python picture_page.py CHROMIUM PAGE PICTURE.png
"""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

chromium, page_file, picture = shutil.which(sys.argv[1]), Path(sys.argv[2]).resolve(), Path(sys.argv[3])
with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.goto(page_file.as_uri())
    page.screenshot(path=picture)
    browser.close()
