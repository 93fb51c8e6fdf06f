"""The architecture check must catch what it forbids, and pass what it allows."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

LINT = pathlib.Path(__file__).resolve().parents[2] / "script" / "lint"


def lint(files):
    """Runs the check over a tree of these files; returns exit status and complaints."""
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name, text in files.items():
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        (root / "alight").mkdir(exist_ok=True)
        done = subprocess.run(
            [sys.executable, LINT, "--architecture", "--root", root],
            capture_output=True, text=True)
        return done.returncode, done.stdout


HEADER = "#pragma once\n"


class Architecture(unittest.TestCase):
    def test_downward_arrows_pass(self):
        code, out = lint({
            "alight/base/a.h": HEADER,
            "alight/vision/b.h": HEADER + '#include "alight/base/a.h"\n',
            "alight/run/c.h": HEADER + '#include "alight/vision/b.h"\n',
        })
        self.assertEqual((code, out), (0, "lint: clean\n"))

    def test_upward_and_sideways_arrows_fail(self):
        for room, target in [("base", "geometry"), ("vision", "estimation"),
                             ("sim", "vision"), ("io", "eval"), ("mission", "io"),
                             ("eval", "io"), ("run", "apps")]:
            name = "apps/x.h" if target == "apps" else f"alight/{target}/x.h"
            include = name if target != "apps" else "alight/apps/x.h"
            code, out = lint({name: HEADER,
                              f"alight/{room}/y.cpp": f'\n#include "{include}"\n'})
            self.assertEqual(code, 1, (room, target, out))
            self.assertIn(f"alight/{room}/y.cpp:2:", out)

    def test_tests_obey_too(self):
        code, out = lint({"alight/sim/x.h": HEADER,
                          "alight/vision/test/y_test.cpp": '#include "alight/sim/x.h"\n'})
        self.assertEqual(code, 1, out)

    def test_brain_has_no_clock_thread_file_console_or_randomness(self):
        for line in ("#include <chrono>", "#include <thread>", "#include <fstream>",
                     "#include <iostream>", "#include <random>", "#include <cstdio>",
                     "  std::cerr << 1;", "  auto t = std::chrono::seconds(1);"):
            code, out = lint({"alight/mission/x.cpp": line + "\n"})
            self.assertEqual(code, 1, line)
            code, out = lint({"alight/run/x.cpp": line + "\n"})
            self.assertEqual(code, 0, line + out)

    def test_words_in_comments_are_free(self):
        code, out = lint({"alight/mission/x.cpp": "// never std::chrono\n"})
        self.assertEqual(code, 0, out)

    def test_unknown_rooms_and_missing_files_fail(self):
        self.assertEqual(lint({"alight/attic/x.h": HEADER})[0], 1)
        self.assertEqual(
            lint({"alight/run/x.cpp": '#include "alight/base/gone.h"\n'})[0], 1)


if __name__ == "__main__":
    unittest.main()
