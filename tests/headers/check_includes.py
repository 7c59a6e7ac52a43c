#!/usr/bin/env python3
"""check_includes.py ROOT: checks which part of the project includes what.

  public headers   only the standard library, GLM and other public headers; at most 18 in core
  rooms            folders of core and server, in an order: a room includes only itself and the
                   rooms listed before it
  protocol         nothing of core but stridewire/base and base/, nothing of server or client
  client library   never stridewire::offline (its tools may)
"""

import pathlib
import re
import sys

PUBLIC_HEADERS_OF_CORE = 18
PUBLIC = re.compile(r"(stridewire/.*|glm/.*|[a-z_0-9]+(\.h)?)$")

# Bottom to top.
CORE_ROOMS = [
    "base",
    "runtime/skeleton", "runtime/terrain", "runtime/library", "runtime/movement", "runtime/pose",
    "runtime/weights", "runtime/plan", "runtime/avatar",
    "offline/base", "offline/capture", "offline/extract", "offline/build", "offline/builtin",
    "offline/complete",
    "offline/choreography", "offline/inspect",
]

SERVER_ROOMS = ["base", "net", "world", "session", "app"]

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')


def source_files(folder):
    return sorted(p for p in folder.rglob("*") if p.suffix in (".h", ".hpp", ".cpp", ".c"))


class Checker:
    def __init__(self, root):
        self.root = root
        self.include_count = 0
        self.failures = []

    def fail(self, path, text):
        self.failures.append(f"{path.relative_to(self.root)}: {text}")

    def includes(self, path):
        for line in path.read_text(encoding="utf-8").splitlines():
            match = INCLUDE.match(line)
            if match:
                self.include_count += 1
                yield match.group(1)

    def allow_only(self, folder, allowed, reason):
        for path in source_files(self.root / folder):
            for name in self.includes(path):
                if not allowed.match(name):
                    self.fail(path, f"includes {name}: {reason}")

    def forbid(self, folder, forbidden, reason):
        for path in source_files(self.root / folder):
            for name in self.includes(path):
                if re.match(forbidden, name):
                    self.fail(path, f"includes {name}: {reason}")

    def check_rooms(self, source_root, rooms):
        """Rooms are folders below `source_root`; headers are included by their path from there."""
        for path in source_files(self.root / source_root):
            folder = path.relative_to(self.root / source_root).parent.as_posix()
            if folder == ".":
                continue
            room = room_of(folder + "/", rooms)
            if room is None:
                self.fail(path, f"is in no room; rooms of {source_root}: {', '.join(rooms)}")
                continue
            for name in self.includes(path):
                other = room_of(name, rooms) if (self.root / source_root / name).exists() else None
                if other is not None and rooms.index(other) > rooms.index(room):
                    self.fail(path, f"includes {name}: room {room} is below {other}")


def room_of(path, rooms):
    return next((room for room in rooms if path.startswith(room + "/")), None)


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    checker = Checker(root)
    for folder in ("core/include", "protocol/include", "client_sdk/c/include",
                   "client_sdk/cpp/include"):
        checker.allow_only(folder, PUBLIC,
                           "public headers take only the standard library, GLM and one another")

    public = [p for p in (root / "core/include").rglob("*") if p.suffix in (".h", ".in")]
    if len(public) > PUBLIC_HEADERS_OF_CORE:
        checker.failures.append(f"core/include has {len(public)} public headers, "
                                f"{PUBLIC_HEADERS_OF_CORE} are allowed: move some to core/src")

    checker.check_rooms("core/src", CORE_ROOMS)
    checker.check_rooms("server/src", SERVER_ROOMS)

    above_core = r"stridewire/(protocol|server)/|stridewire/client|boost/|spdlog/"
    checker.forbid("core", above_core, "core knows no protocol, socket or log")
    for folder in ("core/include/stridewire/base", "core/src/base"):
        checker.forbid(folder, r"(stridewire/)?(runtime|offline)/", "base is the lowest room")
    for folder in ("core/include/stridewire/runtime", "core/src/runtime"):
        checker.forbid(folder, r"(stridewire/)?offline/", "the runtime never includes offline")
    for folder in ("protocol/include", "protocol/src"):
        checker.forbid(folder, r"(stridewire/)?(runtime|offline|server|client)/?",
                       "protocol uses only the base of core")
    for folder in ("client_sdk/c", "client_sdk/cpp", "client_sdk/src", "client_sdk/samples"):
        checker.forbid(folder, r"(stridewire/)?offline/", "the client library needs no builder")

    for failure in checker.failures:
        print(failure, file=sys.stderr)
    print(f"{checker.include_count} includes checked, {len(checker.failures)} wrong")
    return 1 if checker.failures or checker.include_count == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
