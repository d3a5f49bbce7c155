#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests which sources scripts/check-tidy --changed checks, in a small tree of sources."""

import importlib.machinery
import importlib.util
import pathlib
import sys
import tempfile
import unittest
import unittest.mock

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
sys.dont_write_bytecode = True
sys.path.insert(0, str(SCRIPTS))
LOADER = importlib.machinery.SourceFileLoader("check_tidy", str(SCRIPTS / "check-tidy"))
check_tidy = importlib.util.module_from_spec(importlib.util.spec_from_loader("check_tidy", LOADER))
sys.modules["check_tidy"] = check_tidy
LOADER.exec_module(check_tidy)
source_batches = check_tidy.source_batches

NAMES = ["base/lens.cpp", "base/panel.cpp"]
TREE = {
    ".clang-tidy": "Checks: a\n",
    "base/lens.cpp": '#include "base/lens.h"\nint pitch = 3;\n',
    "base/lens.h": '#include "base/units.h"\n',
    "base/panel.cpp": '#include "panel.h"\n',
    "base/panel.h": "// Describes a panel.\n",
    "base/units.h": "// Names units.\n",
}


class Changed(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        self.version = "Debian LLVM version 14.0.6\n"
        for name, text in TREE.items():
            self.write(name, text)
        for module in (check_tidy, source_batches):
            patch = unittest.mock.patch.object(module, "ROOT", self.root)
            patch.start()
            self.addCleanup(patch.stop)
        (self.root / "scripts").mkdir()
        check_tidy.write_digests(self.digests())

    def write(self, name, text):
        path = self.root / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def digests(self):
        """Returns the digests as a new run of the script computes them."""
        for remembered in (check_tidy.content_digest, source_batches.names_in, source_batches.headers_of):
            remembered.cache_clear()
        answer = unittest.mock.Mock(stdout=self.version)
        with unittest.mock.patch.object(check_tidy.subprocess, "run", return_value=answer):
            return check_tidy.digests_of(NAMES)

    def changed(self):
        return check_tidy.changed_sources(self.digests())[0]

    def test_recorded_sources_are_not_checked(self):
        self.assertEqual(self.changed(), [])

    def test_a_changed_source_is_checked(self):
        self.write("base/lens.cpp", "int pitch = 4;\n")
        self.assertEqual(self.changed(), ["base/lens.cpp"])

    def test_sources_that_include_a_changed_header_are_checked(self):
        self.write("base/panel.h", "// Describes another panel.\n")
        self.assertEqual(self.changed(), ["base/panel.cpp"])

    def test_headers_that_headers_include_count(self):
        self.write("base/units.h", "// Names more units.\n")
        self.assertEqual(self.changed(), ["base/lens.cpp"])

    def test_a_source_that_is_not_recorded_is_checked(self):
        digests = self.digests()
        del digests["base/panel.cpp"]
        check_tidy.write_digests(digests)
        self.assertEqual(self.changed(), ["base/panel.cpp"])

    def test_another_version_or_list_of_checks_checks_all(self):
        self.version = "Debian LLVM version 15.0.0\n"
        self.assertEqual(self.changed(), NAMES)
        self.version = "Debian LLVM version 14.0.6\n"
        self.write(".clang-tidy", "Checks: b\n")
        self.assertEqual(self.changed(), NAMES)

    def test_without_a_record_all_are_checked(self):
        (self.root / check_tidy.DIGESTS).unlink()
        self.assertEqual(self.changed(), NAMES)


if __name__ == "__main__":
    unittest.main()
