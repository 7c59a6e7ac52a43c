"""Tests the Python package: it is installed with pip into a scratch folder, and its client talks to
a live server. Environment: STRIDEWIRE_ROOT, STRIDEWIRE_SERVER, STRIDEWIRE_CLIENT_LIBRARY."""

import ctypes
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from contextlib import redirect_stdout
from pathlib import Path

ROOT = Path(os.environ["STRIDEWIRE_ROOT"])
SERVER = os.environ["STRIDEWIRE_SERVER"]
SCRATCH = tempfile.TemporaryDirectory()


def install():
    """Installs the package as its README says, but into a folder. Builds in a copy, because
    setuptools writes into the folder of the sources."""
    source = Path(SCRATCH.name) / "source"
    target = Path(SCRATCH.name) / "installed"
    shutil.copytree(ROOT / "client_sdk/python", source)
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-build-isolation",
                    "--no-index", "--no-deps", "--target", target, source], check=True)
    sys.path.insert(0, str(target))


install()

import numpy as np  # noqa: E402

import stridewire  # noqa: E402
from stridewire import Foot, Interrupt, Outcome, StridewireError, _abi  # noqa: E402
from stridewire.plot import plot_walk  # noqa: E402


def start_server(address="127.0.0.1:0"):
    """Starts a server. Returns the process and its address."""
    process = subprocess.Popen(
        [SERVER, "--listen", address, "--http", "127.0.0.1:0", "--log-level", "warning"],
        stdout=subprocess.PIPE, text=True)
    ready = process.stdout.readline()
    return process, re.search(r"listen=(\S+)", ready).group(1)


def stop(server):
    server.terminate()
    server.wait()
    server.stdout.close()


class Layout(unittest.TestCase):
    """The ctypes structs match the C headers."""

    def setUp(self):
        self.header = "".join((ROOT / "client_sdk/c/include/stridewire" / name).read_text()
                              for name in ("client.h", "commands.h"))
        self.abi_test = (ROOT / "tests/unit/client_sdk/c_abi_test.c").read_text()

    def test_version(self):
        version = re.search(r"#define STRIDEWIRE_ABI_VERSION (\d+)", self.header).group(1)
        self.assertEqual(_abi.ABI_VERSION, int(version))

    def test_sizes_and_offsets(self):
        compared = 0
        for name, size in re.findall(r"^SIZE\((\w+), (\d+)\);", self.abi_test, re.M):
            if struct := getattr(_abi, name, None):
                self.assertEqual(ctypes.sizeof(struct), int(size), name)
        for name, field, offset in re.findall(r"^OFFSET\((\w+), (\w+), (\d+)\);", self.abi_test,
                                              re.M):
            if struct := getattr(_abi, name, None):
                self.assertEqual(getattr(struct, field).offset, int(offset), f"{name}.{field}")
                compared += 1
        structs = [each for each in vars(_abi).values()
                   if isinstance(each, type) and issubclass(each, ctypes.Structure)]
        self.assertEqual(compared, sum(len(struct._fields_) for struct in structs))

    def test_enums(self):
        for prefix, enum in (("EVENT", stridewire.EventType), ("OUTCOME", Outcome),
                             ("KIND", stridewire.Kind), ("FOOT", Foot),
                             ("POSE", stridewire.PoseKind)):
            values = dict(re.findall(rf"^  STRIDEWIRE_{prefix}_([A-Z_]+) = (\d+)", self.header,
                                     re.M))
            values = {name: number for name, number in values.items() if not name.endswith("MAX")}
            self.assertEqual({member.name: str(member.value) for member in enum}, values)


class Live(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server, cls.address = start_server()

    @classmethod
    def tearDownClass(cls):
        stop(cls.server)

    def test_example_of_the_readme(self):
        text = (ROOT / "client_sdk/python/README.md").read_text()
        example, drawing = re.findall(r"```python\n(.*?)```", text, re.S)
        self.assertIn("127.0.0.1:7420", example)
        names = {}
        output = io.StringIO()
        with redirect_stdout(output):
            exec(example.replace("127.0.0.1:7420", self.address), names)
        ended, root = output.getvalue().splitlines()
        self.assertRegex(ended, r"^COMPLETED after \d+ poses$")
        x, y, z = (float(number) for number in root.strip("[]").split())
        self.assertLess(abs(x), 0.05)
        self.assertGreater(y, 0.7)
        self.assertLess(abs(z - 2.0), 0.05)

        recording = names["recording"]
        self.assertGreater(len(recording.times_s), 60)
        self.assertTrue(np.all(np.diff(recording.times_s) > 0.0))
        lengths = np.linalg.norm(recording.rotations_xyzw, axis=-1)
        self.assertLess(np.abs(lengths - 1.0).max(), 1e-3)
        exec(drawing.replace("plot_walk(recording)", "picture = plot_walk(recording)"), names)
        strikes = [event for event in recording.events
                   if event.type == stridewire.EventType.FOOT_STRIKE]
        self.assertEqual(names["picture"]._repr_svg_().count("<circle"), len(strikes))
        self.assertGreater(len(strikes), 2)

    def test_joint_positions(self):
        with stridewire.Client(self.address) as client:
            world = client.join("joints")
            avatar = world.spawn((1.0, 0.0, 2.0))
            world.observe(stridewire.PoseMode.FULL)
            world.wait(world.stand(avatar, 0.2))
            recording = world.record(avatar, 0.3)
            skeleton = world.skeleton()
            positions = skeleton.joint_positions_m(recording.root_positions_m,
                                                   recording.rotations_xyzw)
            self.assertEqual(positions.shape, (len(recording.times_s), len(skeleton.names), 3))
            np.testing.assert_array_equal(positions[:, 0], recording.root_positions_m)
            # The avatar stands on the ground at (1, 2).
            self.assertLess(positions[..., 1].min(), 0.15)
            self.assertGreater(positions[..., 1].max(), 1.2)
            centre = positions[..., [0, 2]].mean(axis=(0, 1))
            self.assertLess(np.abs(centre - [1.0, 2.0]).max(), 0.3)
            # Every joint is as far from its parent as in the skeleton.
            bones = np.linalg.norm(positions[:, 1:] - positions[:, skeleton.parents[1:]], axis=-1)
            lengths = np.linalg.norm(skeleton.offsets_m[1:], axis=-1)
            self.assertLess(np.abs(bones - lengths).max(), 1e-4)

    def test_outcomes(self):
        with stridewire.Client(self.address) as client:
            world = client.join("outcomes")
            avatar = world.spawn()
            requests = {
                "completed": world.step(avatar, 0.5, foot=Foot.LEFT),
                "out of reach": world.step(avatar, 5.0),
                "replaced": world.stand(avatar, 100.0),
            }
            self.assertEqual(world.wait(requests["completed"]).outcome, Outcome.COMPLETED)
            rejected = world.wait(requests["out of reach"])
            self.assertEqual(rejected.outcome, Outcome.REJECTED)
            self.assertEqual(rejected.status, "out_of_range")
            self.assertGreater(rejected.nearest_length_m, 0.3)
            walk = world.walk_to(avatar, (0.0, 0.0, 9.0), interrupt=Interrupt.NOW,
                                 waypoints_m=[(0.0, 0.0, 4.0)], speed_m_s=1.2)
            self.assertEqual(world.wait(requests["replaced"]).outcome, Outcome.REPLACED)
            stand = world.stand(avatar, 1.0)
            world.cancel(avatar)
            self.assertEqual(world.wait(stand).outcome, Outcome.CANCELLED)
            self.assertEqual(world.wait(walk).outcome, Outcome.CANCELLED)
            jump = world.jump(avatar, 0.5, allow_nearest=True)
            world.teleport(avatar, (5.0, 0.0, 5.0))
            self.assertEqual(world.wait(jump).outcome, Outcome.CANCELLED)
            stand = world.stand(avatar, 100.0)
            world.remove(avatar)
            self.assertEqual(world.wait(stand).outcome, Outcome.REMOVED)
            with self.assertRaises(ValueError):
                world.wait(stand)

    def test_refusals(self):
        with stridewire.Client(self.address) as client:
            world = client.join("refusals")
            self.assertEqual(world.spawn(avatar=7), 7)
            for status, command in (
                    ("avatar_exists", lambda: world.spawn(avatar=7)),
                    ("no_such_avatar", lambda: world.teleport(8, (0.0, 0.0, 0.0))),
                    ("no_such_avatar", lambda: world.step(8, 0.5)),
                    ("out_of_range", lambda: world.stand(7, -1.0)),
                    ("no_movement", lambda: world.set_layer(7, "nothing")),
                    ("already_joined", lambda: client.join("refusals"))):
                with self.assertRaises(StridewireError) as caught:
                    command()
                self.assertEqual(caught.exception.status, status)
            observer = client.join("watched", observer=True)
            with self.assertRaises(StridewireError) as caught:
                observer.spawn()
            self.assertEqual(caught.exception.status, "not_allowed")

    def test_wrong_positions(self):
        with stridewire.Client(self.address) as client:
            world = client.join("positions")
            avatar = world.spawn()
            for call in (lambda: world.spawn((1.0, 2.0)),
                         lambda: world.teleport(avatar, (1.0, 2.0, 3.0, 4.0)),
                         lambda: world.step(avatar, at_m=(0.1, 0.4)),
                         lambda: world.walk_to(avatar, (0.0, 2.0)),
                         lambda: world.walk_to(avatar, (0.0, 0.0, 2.0),
                                               waypoints_m=[(0.0, 1.0)])):
                with self.assertRaisesRegex(ValueError, "3 numbers"):
                    call()

    def test_keeps_the_last_ends_of_requests(self):
        class SmallClient(stridewire.Client):
            MAX_EVENTS = 2

        with SmallClient(self.address) as client:
            world = client.join("ends")
            avatar = world.spawn()
            stands = [world.stand(avatar, 0.05) for _ in range(3)]
            self.assertEqual(world.wait(stands[2]).outcome, Outcome.COMPLETED)
            with self.assertRaises(ValueError):
                world.wait(stands[0])
            self.assertEqual(world.wait(stands[1]).outcome, Outcome.COMPLETED)

    def test_wait_ends_when_the_session_is_lost(self):
        first, address = start_server()
        self.addCleanup(stop, first)
        with stridewire.Client(address) as client:
            world = client.join("lost")
            stand = world.stand(world.spawn(), 100.0)
            first.kill()
            first.wait()
            second, _ = start_server(address)
            self.addCleanup(stop, second)
            with self.assertRaises(StridewireError) as caught:
                world.wait(stand, 30.0)
            self.assertEqual(caught.exception.status, "session_lost")
            with self.assertRaises(ValueError):
                world.wait(stand)

    def test_layers_and_movement_mode(self):
        with stridewire.Client(self.address) as client:
            world = client.join("layers")
            avatar = world.spawn()
            self.assertIn("wave", world.layers())
            world.set_layer(avatar, "wave")
            subscription = world.observe(stridewire.PoseMode.MOVEMENT, avatars=[avatar])
            recording = world.record(avatar, 0.5)
            self.assertEqual(world.avatars(), [avatar])
            self.assertGreater(len(recording.times_s), 5)
            self.assertIsNotNone(world.sample(avatar))
            world.stop_observing(subscription)
            with self.assertRaisesRegex(ValueError, "ids of avatars"):
                world.cancel(-1)
            world.leave()
            with self.assertRaises(StridewireError) as caught:
                world.leave()
            self.assertEqual(caught.exception.status, "no_such_world")

    def test_connection_errors(self):
        for address in ("localhost", "127.0.0.1:72956", "127.0.0.1:-1"):
            with self.assertRaises(ValueError):
                stridewire.Client(address)
        with self.assertRaises(StridewireError) as caught:
            stridewire.Client("127.0.0.1:1", timeout_s=0.5)
        self.assertEqual(caught.exception.status, "timeout")
        # The second of two servers answers.
        client = stridewire.Client(["127.0.0.1:1", self.address])
        connected = [event for event in client.poll_events()
                     if event.type == stridewire.EventType.CONNECTED]
        self.assertEqual([event.text for event in connected], [self.address])
        client.close()
        with self.assertRaises(StridewireError):
            client.poll_events()


if __name__ == "__main__":
    unittest.main()
