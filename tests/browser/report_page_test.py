#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests the page of calibration reports (calib/report/report.html) in Chromium: what its script draws.

Usage: tests/browser/report_page_test.py BUILD_FOLDER

Leaves screenshots to look at in BUILD_FOLDER/browser/screenshots.
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

CHROMIUM = os.environ.get("CHROMIUM", "/usr/bin/chromium")
LIMIT_S = 120


def chromium(page, *arguments):
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", *arguments,
               page.as_uri()]
    return subprocess.run(command, check=True, timeout=LIMIT_S, capture_output=True, text=True).stdout


def drawn(page):
    """Returns the page's elements and texts, without its scripts, styles and data."""
    return re.sub(r"<(script|style|noscript).*?</\1>", "", chromium(page, "--dump-dom"), flags=re.S)


def check(html, contains=(), lacks=(), counts=()):
    problems = [f"lacks {part!r}" for part in contains if part not in html]
    problems += [f"contains {part!r}" for part in lacks if part in html]
    problems += [f"{html.count(part)} of {part!r}, expected {count}"
                 for part, count in counts if html.count(part) != count]
    return problems


def main(build):
    screenshots = build / "browser" / "screenshots"
    screenshots.mkdir(parents=True, exist_ok=True)
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run([build / "tests/browser/write_reports", folder], check=True)
        bad = '<td class="bad"'
        cases = {
            # Four maps, the local one, two colour bars and the spot.
            "sample": dict(
                contains=["<strong>Calibrated</strong>", "7.7012301 \u00b1 0.0000042",
                          "at the top right of the panel", "(L_bw - L_bb) / (L_wb - L_bb)", "6.2 %",
                          "Passed.", "no manual focus", "<title>Calibration of desk</title>",
                          "2026-03-01T12:34:56Z", "viewer 10 mm nearer or farther"],
                lacks=["not known", "NaN", "undefined"], counts=[(bad, 0), ("<canvas", 8)]),
            "limits": dict(contains=["Missed."], counts=[(bad, 3)]),
            "unknown": dict(
                contains=["not known", "No place was kept aside", "<title>Calibration of desk</title>",
                          "&lt;b&gt;bold&lt;/b&gt;"],
                lacks=["are correlated", "<b>bold", "NaN", "undefined"], counts=[("<canvas", 3)]),
            "empty": dict(contains=["<strong>Not calibrated</strong>", "without a name"],
                          lacks=["NaN", "undefined"]),
        }
        for page, expected in cases.items():
            problems = check(drawn(folder / f"{page}.html"), **expected)
            print(f"{'failed' if problems else 'passed'}: report {page}", *problems, sep="\n  ")
            failed += bool(problems)
            chromium(folder / f"{page}.html", "--window-size=1000,3600",
                     f"--screenshot={screenshots / f'report-{page}.png'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1]).resolve()))
