"""How long the page of a run takes until it is drawn and answers, opened from disk in a browser that has not seen it.

    mapper run campaigns/turbo_a.yaml --out runs
    target/python-env/bin/python benches/page_interactive.py chromium runs/turbo_a-*/report.html

Needs the packages of tests/python/requirements.txt. For each page its size and, ms, middle and worst of `--rounds` rounds, each in a new browser: from the
start of the navigation until all is drawn and answers, and from the choice of another step until its transient is on the screen.
"""

import argparse
import statistics
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "python"))
from chromium import launched  # noqa: E402

# The page says of itself when all is drawn.
WATCH = """
new MutationObserver((_, observer) => {
  if (document.documentElement.dataset.drawn !== "true") return;
  observer.disconnect();
  window.drawnAt = performance.now();
}).observe(document, { attributes: true, subtree: true, attributeFilter: ["data-drawn"] });
"""
CHOOSE = """() => new Promise((done) => {
  const choice = document.querySelector("#step-choice");
  const before = document.body.innerHTML.length, asked = performance.now();
  choice.selectedIndex = Math.floor(choice.options.length / 2);
  choice.dispatchEvent(new Event("change"));
  // Behind the next picture of the screen.
  requestAnimationFrame(() => setTimeout(() => done([performance.now() - asked, document.body.innerHTML.length !== before])));
})"""


def opened(browser, page_file):
    """Milliseconds until all is drawn, milliseconds that another step takes, and whether that changed anything."""
    context = browser.new_context(viewport={"width": 1400, "height": 1000})
    page = context.new_page()
    page.add_init_script(WATCH)
    page.goto(page_file.as_uri())
    page.wait_for_selector("html[data-drawn=true]")
    drawn = page.evaluate("window.drawnAt")
    answered, changed = page.evaluate(CHOOSE)
    context.close()
    return drawn, answered, changed


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("chromium")
    parser.add_argument("pages", nargs="+", type=Path)
    parser.add_argument("--rounds", type=int, default=11)
    arguments = parser.parse_args()
    print("| page | kB | drawn, ms | another step drawn, ms |\n|---|---:|---:|---:|")
    with sync_playwright() as playwright:
        for page_file in arguments.pages:
            rounds = []
            for _ in range(arguments.rounds):
                browser = launched(playwright, arguments.chromium)
                rounds.append(opened(browser, page_file.resolve()))
                browser.close()
            if not all(changed for *_, changed in rounds):
                raise SystemExit(f"{page_file}: another step drew nothing")
            drawn, answered = [[times[k] for times in rounds] for k in (0, 1)]
            spread = lambda times: f"{statistics.median(times):.0f} (worst {max(times):.0f})"
            print(f"| {page_file.parent.name} | {page_file.stat().st_size / 1000:.0f} | {spread(drawn)} | {spread(answered)} |")


if __name__ == "__main__":
    main()
