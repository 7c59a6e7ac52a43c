"""Tests the C# package: mcs compiles it, and mono runs it with a live server. Environment:
STRIDEWIRE_ROOT, STRIDEWIRE_SERVER, STRIDEWIRE_CLIENT_LIBRARY, MCS, MONO."""

import json
import os
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

ROOT = Path(os.environ["STRIDEWIRE_ROOT"])
PACKAGE = ROOT / "client_sdk/unity"
TESTS = ROOT / "tests/integration/unity"


def compile_cs(output, *sources):
    """Compiles a program from these files and those of the package."""
    # Version 6 is the newest that mcs knows by number. Unity 2021 has version 9.
    subprocess.run([os.environ["MCS"], "-langversion:6", "-unsafe", "-warnaserror",
                    f"-out:{output}", *sources, *sorted(PACKAGE.glob("Runtime/*.cs"))], check=True)


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.scratch = Path(cls.folder.name)
        # The name without a version, as in an installation.
        shutil.copy(os.environ["STRIDEWIRE_CLIENT_LIBRARY"],
                    cls.scratch / "libstridewire-client.so")
        cls.server = subprocess.Popen(
            [os.environ["STRIDEWIRE_SERVER"], "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0",
             "--log-level", "warning"], stdout=subprocess.PIPE, text=True)
        ready = cls.server.stdout.readline()
        cls.port = re.search(r"listen=127.0.0.1:(\d+)", ready).group(1)
        cls.program = cls.scratch / "client_test.exe"
        compile_cs(cls.program, TESTS / "client_test.cs", TESTS / "unity_engine.cs",
                   PACKAGE / "Samples~/Humanoid/HumanoidAvatar.cs")

    @classmethod
    def tearDownClass(cls):
        cls.server.terminate()
        cls.server.wait()
        cls.server.stdout.close()
        cls.folder.cleanup()

    def run_program(self, program, *arguments):
        """Runs a program and returns its output."""
        run = subprocess.run(
            [os.environ["MONO"], "--debug", program, *arguments], text=True, timeout=120,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            env={**os.environ, "LD_LIBRARY_PATH": str(self.scratch)})
        self.assertEqual(run.returncode, 0, run.stdout)
        return run.stdout

    def test_layout(self):
        abi_test = (ROOT / "tests/unit/client_sdk/c_abi_test.c").read_text()
        expected = {f"{struct} {size}" for struct, size in re.findall(
            r"^SIZE\((\w+), (\d+)\);", abi_test, re.M)}
        expected |= {f"{struct}.{field} {offset}" for struct, field, offset in re.findall(
            r"^OFFSET\((\w+), (\w+), (\d+)\);", abi_test, re.M)}
        actual = set(self.run_program(self.program, "layout").splitlines())
        # C# has no arrays of structs in structs: legs_0 and legs_1 are the array `legs`.
        actual = {line.replace("legs_0", "legs") for line in actual if "legs_1" not in line}
        enums = {line for line in expected if line.split(" ")[0] in self.enum_names()}
        self.assertEqual(actual, expected - enums)

    def enum_names(self):
        text = "".join((ROOT / "client_sdk/c/include/stridewire" / name).read_text()
                       for name in ("client.h", "commands.h", "status.h"))
        return set(re.findall(r"^typedef enum (\w+)", text, re.M))

    def test_live(self):
        for group in ("requests", "poses", "errors", "lifetime", "sample"):
            with self.subTest(group):
                self.assertIn("passed", self.run_program(self.program, group, self.port))

    def test_program_of_the_readme(self):
        text = (PACKAGE / "README.md").read_text()
        source = re.search(r"```csharp\n(.*?)```", text, re.S).group(1)
        self.assertIn("7420", source)
        (self.scratch / "walk.cs").write_text(source.replace("7420", self.port))
        compile_cs(self.scratch / "walk.exe", self.scratch / "walk.cs")
        output = self.run_program(self.scratch / "walk.exe")
        x, y, z = (float(number) for number in re.fullmatch(
            r"Completed at \((.*), (.*), (.*)\)\n", output).groups())
        self.assertLess(abs(x), 0.05)
        self.assertGreater(y, 0.7)
        self.assertLess(abs(z - 2.0), 0.05)

    def test_package_files(self):
        manifest = json.loads((PACKAGE / "package.json").read_text())
        for sample in manifest["samples"]:
            self.assertTrue((PACKAGE / sample["path"]).is_dir())
        # Unity ignores files of installed packages that have no .meta file.
        files = {path for path in PACKAGE.rglob("*") if path.suffix != ".meta"
                 and "Samples~" not in path.parts}
        metas = {path.with_suffix("") for path in PACKAGE.rglob("*.meta")}
        self.assertEqual(files, metas)
        guids = [re.search(r"^guid: ([0-9a-f]{32})$", path.read_text(), re.M).group(1)
                 for path in PACKAGE.rglob("*.meta")]
        self.assertEqual(len(guids), len(set(guids)))


if __name__ == "__main__":
    unittest.main()
