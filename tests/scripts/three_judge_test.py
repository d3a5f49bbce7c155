#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests scripts/three-judge/draw-pictures with a stand-in for the browser and for three.js."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import textwrap
import unittest
import unittest.mock

ROOT = pathlib.Path(__file__).resolve().parents[2]
DRAW = ROOT / "scripts/three-judge/draw-pictures"

# The stand-in reads what the page reads and answers by the model's content: it draws, fails, ends or hangs.
BROWSER = """\
    #!/usr/bin/env python3
    import json, sys, time, urllib.error, urllib.request
    url = sys.argv[-1].rstrip("/")

    def get(path, data=None):
        with urllib.request.urlopen(url + path, data) as answer:
            return answer.read()

    assert b"page.js" in get("/")
    assert get("/three/build/three.module.js") == b"export {};"
    for secret in ("/three/../secret", "/model/0/../secret", "/model/9/a.glb", "/draw-pictures/x", "/../fetch-models"):
        try:
            get(secret)
            sys.exit("readable: " + secret)
        except urllib.error.HTTPError as error:
            assert error.code == 404, error
    while (job := json.loads(get("/next"))) is not None:
        model = get(job["model_url"]).decode()
        picture = get(job["environment_url"]) + model.encode()
        if model == "end":
            sys.exit(1)
        if model == "hang":
            time.sleep(600)
        if model == "bare":
            assert get(job["model_url"].upper().replace("MODEL", "model", 1)) == b"bare"
            get(f"/missing/{job['number']}", b"dark%20wood.png")
        if model == "bad":
            get(f"/failed/{job['number']}", b"a bad\\nmodel")
        else:
            get(f"/drawn/{job['number']}", picture)
    time.sleep(600)
"""


class DrawPictures(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.folder = pathlib.Path(self.scratch.name)
        (self.folder / "node_modules/three/build").mkdir(parents=True)
        (self.folder / "node_modules/three/build/three.module.js").write_text("export {};")
        (self.folder / "node_modules/secret").write_text("secret")
        (self.folder / "models").mkdir()
        (self.folder / "studio.hdr").write_text("studio ")
        self.browser = self.folder / "browser"
        self.write_browser(textwrap.dedent(BROWSER))

    def write_browser(self, text):
        self.browser.write_text(text)
        self.browser.chmod(0o700)

    def draw(self, contents, *more):
        """Draws one job per content and returns the result with the texts of pictures and reasons."""
        jobs = []
        for n, content in enumerate(contents):
            model = self.folder / f"models/model {n}.glb"
            model.write_text(content)
            jobs.append({"model": str(model), "picture": str(self.folder / f"{n}.png"), "width": 8, "height": 8,
                         "environment": str(self.folder / "studio.hdr"), "environment_ahead": [0, 0, -1]})
        (self.folder / "jobs.json").write_text(json.dumps(jobs))
        result = subprocess.run([sys.executable, DRAW, "--browser", self.browser, *more, self.folder / "jobs.json"],
                                capture_output=True, text=True, timeout=250)
        answers = []
        for n in range(len(contents)):
            picture, reason = self.folder / f"{n}.png", self.folder / f"{n}.png.txt"
            self.assertFalse(picture.exists() and reason.exists())
            answers.append(picture.read_text() if picture.exists() else reason.read_text() if reason.exists() else None)
        return result, answers

    def test_writes_pictures_and_the_reasons_of_failures(self):
        result, answers = self.draw(["one", "bad", "three"])
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(answers, ["studio one", "a bad model\n", "studio three"])
        self.assertEqual(len(result.stdout.splitlines()), 3)

    def test_names_pictures_that_are_missing(self):
        result, answers = self.draw(["bare"])
        self.assertEqual(answers, ["studio bare"], result.stderr)
        self.assertIn("model 0.glb: no picture dark wood.png\n", result.stdout)

    def test_goes_on_after_a_browser_that_ends(self):
        result, answers = self.draw(["end", "two", "end"])
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(answers, ["the browser ended\n", "studio two", "the browser ended\n"])

    def test_goes_on_after_a_browser_that_hangs(self):
        result, answers = self.draw(["hang", "hang"], "--limit", "0.5")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(answers, ["no picture after 0.5 s, the limit\n"] * 2)

    def test_gives_up_a_browser_that_does_not_run_the_page(self):
        self.write_browser("#!/bin/sh\nexit 1\n")
        result, answers = self.draw(["one", "two"])
        self.assertEqual(result.returncode, 1)
        self.assertIn("the page does not run", result.stderr)
        self.assertEqual(answers, [None, None])

    def test_finds_three_in_node_path(self):
        elsewhere = self.folder / "elsewhere"
        (self.folder / "node_modules").rename(elsewhere)
        with unittest.mock.patch.dict(os.environ, {"NODE_PATH": f"/none:{elsewhere}"}):
            result, answers = self.draw(["one"])
        self.assertEqual(answers, ["studio one"], result.stderr)

    def test_names_what_is_missing(self):
        result, _ = self.draw(["one"], "--three", self.folder)
        self.assertEqual(result.returncode, 1)
        self.assertIn("no three.js", result.stderr)
        self.assertEqual(self.draw([])[0].returncode, 0)


if __name__ == "__main__":
    unittest.main()
