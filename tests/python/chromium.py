"""Chromium as these scripts drive it."""

import shutil

# Width, height and scheme: each width and each scheme once. What is too wide depends on the width, contrast on the scheme.
VIEWS = [(1400, 1000, "light"), (390, 844, "dark")]


def launched(playwright, name):
    """The browser of this name on PATH."""
    # Tests may run as root, where Chromium has no sandbox.
    return playwright.chromium.launch(executable_path=shutil.which(name), args=["--no-sandbox", "--disable-gpu"])


def watched(page, console, requests):
    """The page; its console messages and its requests are kept."""
    page.on("console", lambda message: console.append(message.text))
    page.on("pageerror", lambda error: console.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    return page


def serious_findings(axe, page, where):
    """What axe-core finds serious or critical, in words."""
    # `region`, the dearest rule on a page with long tables, is a moderate one.
    options = {"resultTypes": ["violations"], "rules": {"region": {"enabled": False}}}
    violations = axe.run(page, options=options).response["violations"]
    grave = [violation for violation in violations if violation["impact"] in ("serious", "critical")]
    return [f"{where}: {violation['id']}: {violation['nodes'][0]['html'][:200]}" for violation in grave]
