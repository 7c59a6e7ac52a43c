#!/usr/bin/env python3
"""Counts the hand-written lines that describe the messages of the wire protocol, and the lines of
code of the web client.

    tests/tools/count_wire_lines.py            # prints the lines of each file and their sum

A file counts if a new field of a message may have to be added to it, or if it contains functions
that such code calls: the schema, message structs, encoders, decoders, checks, JSON and samples of
the test vectors, in C++ and TypeScript. All its lines count, with comments and empty lines.
Generated files and the generator do not count. The codecs of poses, framing and the public types of
the client libraries do not count either.

Lines of code are those with more than a comment.
"""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PATTERNS = {
    "schema": ["protocol/schema/*.fbs"],
    "message structs": ["protocol/include/stridewire/protocol/message*.h"],
    "encoders and decoders": [
        "protocol/include/stridewire/protocol/encoder.h", "protocol/src/encoder.cpp",
        "protocol/include/stridewire/protocol/decode.h", "protocol/src/decode.cpp",
        "protocol/src/codec_support.h"],
    "checks": ["protocol/include/stridewire/protocol/check.h", "protocol/src/check.cpp",
               "protocol/src/findings.h"],
    "JSON and vectors": ["protocol/tools/*.cpp", "protocol/tools/*.h"],
    "TypeScript": ["client_sdk/web/src/wire/*.ts", "client_sdk/web/test/support/to_json.ts"],
}


def lines_of_code(path):
    code = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.S)
    return sum(bool(re.sub(r"^\s*//.*", "", line).strip()) for line in code.splitlines())


def main():
    total = 0
    for part, patterns in PATTERNS.items():
        paths = sorted(path for pattern in patterns for path in ROOT.glob(pattern))
        if not paths:
            sys.exit(f"count_wire_lines.py: no files for {part}")
        print(part)
        for path in paths:
            lines = len(path.read_text(encoding="utf-8").splitlines())
            total += lines
            print(f"{lines:7}  {path.relative_to(ROOT)}")
    print(f"{total:7}  in total")
    code = sum(lines_of_code(path) for path in (ROOT / "client_sdk/web/src").rglob("*.ts"))
    print(f"{code:7}  lines of code in client_sdk/web/src")


if __name__ == "__main__":
    main()
