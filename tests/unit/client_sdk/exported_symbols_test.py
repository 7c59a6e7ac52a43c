"""Checks that the shared client library exports the functions of the C headers and nothing else.

exported_symbols_test.py LIBRARY NM HEADER...
"""

import re
import subprocess
import sys
import unittest

LIBRARY, NM, *HEADERS = sys.argv[1:]


def headers():
    """Returns the text of the C headers without comments."""
    text = ""
    for header in HEADERS:
        with open(header, encoding="utf-8") as file:
            text += re.sub(r"//[^\n]*", "", file.read())
    return text


def exported():
    """Returns the global symbols that the library defines: their names by kind."""
    output = subprocess.run(
        [NM, "-D", "--defined-only", "--extern-only", "--with-symbol-versions", LIBRARY],
        check=True, capture_output=True, text=True).stdout
    names = {}
    for line in output.splitlines():
        _, kind, name = line.split()
        names.setdefault(kind, set()).add(name)
    return names


class ExportedSymbols(unittest.TestCase):
    def test_are_the_functions_of_the_headers(self):
        declared = set(re.findall(r"\b(stridewire_\w+)\(", headers()))
        self.assertGreater(len(declared), 30)
        version = re.search(r"#define STRIDEWIRE_ABI_VERSION (\d+)", headers()).group(1)
        node = f"STRIDEWIRE_{version}"
        names = exported()
        self.assertEqual(names.pop("T"), {f"{name}@@{node}" for name in declared})
        # The version itself is an absolute symbol.
        self.assertEqual({name.split("@")[0] for name in names.pop("A")}, {node})
        self.assertEqual(names, {})

    def test_have_the_version_of_the_soname(self):
        version = re.search(r"#define STRIDEWIRE_ABI_VERSION (\d+)", headers()).group(1)
        with open(LIBRARY, "rb") as file:
            self.assertIn(f"\0libstridewire-client.so.{version}\0".encode(), file.read())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
