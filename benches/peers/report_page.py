#!/usr/bin/env python3
"""Opens the page of a run in headless Chromium, from its file, and uses its switches.

    benches/peers/report_page.py RUN [--work FOLDER] [--chromium PROGRAM] [--figure]

Checks: nothing is fetched, no error on the console, no script, one layer is shown at a time and each when it is chosen,
the hatching can be switched off, the page fits 800 pixels. --figure writes docs/figures/report.png. Writes
benches/results/report_page.txt. Without Chromium it prints a line and ends. Playwright comes from PyPI into FOLDER/venv
(default target/viewer).
"""
import argparse
import os
import pathlib
import shutil
import sys

from viewer import ROOT, Checks, environment, figure


def use(page, checks, asked, errors):
    switches = page.locator(".layers input[type=radio]")
    shown = lambda: page.eval_on_selector_all(".stack figure", "all => all.map(f => getComputedStyle(f).display)")
    checks.check(switches.count() >= 5, "the page has five layers or more")
    right = True
    for number in range(switches.count()):
        page.locator(f"label[for=layer{number}]").click()
        right &= [i for i, display in enumerate(shown()) if display != "none"] == [number]
    checks.check(right, "each switch shows its layer and no other")
    page.locator("label[for=layer0]").click()
    hatching = page.locator(".hatching")
    was = hatching.is_visible()
    page.locator("label[for=hatched]").click()
    checks.check(was and not hatching.is_visible(), "the hatching of filled cells can be switched off")
    page.locator("label[for=hatched]").click()
    size = page.eval_on_selector(".layer0 img", "i => [i.naturalWidth, i.naturalHeight]")
    over = page.eval_on_selector(".hatching", "i => [i.naturalWidth, i.naturalHeight]")
    checks.check(size == over and min(size) > 10, "the hatching lies on the map cell by cell")
    page.set_viewport_size({"width": 800, "height": 900})
    fits = page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    checks.check(fits, "the page fits 800 pixels")
    page.set_viewport_size({"width": 1180, "height": 1400})
    checks.check(page.locator("script").count() == 0, "the page has no script")
    checks.check([url for url in asked if not url.startswith(("file:", "data:"))] == [], "nothing is fetched")
    checks.check(errors == [], f"no error on the console{': ' + '; '.join(errors) if errors else ''}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path, metavar="RUN")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target/viewer")
    parser.add_argument("--chromium", default=shutil.which("chromium"))
    parser.add_argument("--figure", action="store_true")
    arguments = parser.parse_args()
    if not arguments.chromium:
        print("skipped: there is no chromium")
        return
    python = environment(arguments.work)
    if pathlib.Path(sys.prefix).resolve() != (arguments.work / "venv").resolve():
        os.execv(python, [python, *sys.argv])
    from playwright.sync_api import sync_playwright

    checks, asked, errors = Checks(), [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=arguments.chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1180, "height": 1400})
        page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
        page.on("request", lambda request: asked.append(request.url))
        page.goto((arguments.run.resolve() / "report/report.html").as_uri())
        use(page, checks, asked, errors)
        page.mouse.move(0, 0)
        page.evaluate("scrollTo(0, 0)")
        figure(page, "report.png", arguments.figure)
        browser.close()
    (ROOT / "benches/results/report_page.txt").write_text("\n".join(checks.lines) + "\n")
    sys.exit(checks.failed > 0)


if __name__ == "__main__":
    main()
