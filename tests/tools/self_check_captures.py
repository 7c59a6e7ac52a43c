#!/usr/bin/env python3
"""Builds libraries from folders of captures and counts the verdicts of their self-checks.

    tests/tools/self_check_captures.py TOOL FOLDER

TOOL is the program stridewire-library. A library is built from every BVH file below FOLDER, from
every folder with more than one file, and with --mirror from every folder. Prints the number of
libraries, of refusals, and of verdicts per check, then the checks that failed. Exit code 1 if a
build ends without a report, or a refusal without a reason.
"""

import collections
import json
import pathlib
import subprocess
import sys
import tempfile


def builds(root):
    """Yields (name, files, options) of each library to build."""
    for folder in sorted({file.parent for file in root.rglob("*.bvh")}):
        files = sorted(folder.glob("*.bvh"))
        for file in files:
            yield str(file.relative_to(root)), [file], []
        name = str(folder.relative_to(root))
        if len(files) > 1:
            yield name, files, []
        yield f"{name} --mirror", files, ["--mirror"]


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    tool, root = sys.argv[1], pathlib.Path(sys.argv[2])
    verdicts = collections.Counter()
    failed, faulty = [], []
    libraries = refusals = 0
    with tempfile.TemporaryDirectory() as scratch:
        for name, files, options in builds(root):
            command = [tool, "build", "--json", "--out", f"{scratch}/library.swl", *options, *files]
            output = subprocess.run(command, capture_output=True, text=True, check=False).stdout
            try:
                report = json.loads(output)
            except json.JSONDecodeError:
                faulty.append(f"{name}: no report")
                continue
            if not report.get("library"):
                refusals += 1
                if not report.get("error"):
                    faulty.append(f"{name}: refused without a reason")
                continue
            libraries += 1
            for check in report["self_check"]["checks"]:
                verdicts[check["name"], check["verdict"]] += 1
                if check["verdict"] == "failed":
                    failed.append(f"{name}: {check['text']}")
    print(f"{libraries} libraries, {refusals} refusals")
    for (check, verdict), count in sorted(verdicts.items()):
        print(f"{check} {verdict}: {count}")
    print(*failed, *faulty, sep="\n")
    sys.exit(1 if faulty else 0)


main()
