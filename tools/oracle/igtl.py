#!/usr/bin/env python3
"""A client that nobody here wrote against `insonify serve` and `insonify view`, and messages of its making.

    python3 -m venv venv
    venv/bin/pip install pyigtl==0.3.4
    venv/bin/python tools/oracle/igtl.py serve target/debug/insonify scenes/phantom.toml
    venv/bin/python tools/oracle/igtl.py view target/debug/insonify scenes/phantom.toml
    venv/bin/python tools/oracle/igtl.py vectors      # the messages of tests/igtl/vectors.rs

`serve` starts the program on a free port of this machine, moves the probe by TRANSFORM messages, and
holds the images that arrive against what they have to be: size, pixel size, where their first pixel
lies, and that a moved probe sees something else and one that is back the same again. `view` does the same with the window, on a virtual
display of its own (Xvfb): the picture on the display has to move with the images. Lengths in mm.
"""

import os
import re
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np
import pyigtl

# A small frame: this is about messages.
SMALL = ["--set", "probe.scanlines=64", "--set", "probe.samples=512", "--set", "probe.elevation_layers=1",
         "--set", "imaging.image_height=200", "--set", "tracker.device=ProbeToReference"]


def turned(degrees, shift):
    """About z, then shifted."""
    angle = np.radians(degrees)
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    matrix[:3, 3] = shift
    return matrix


def image_at(client, matrix):
    """The image that is taken at a pose, and the pose that comes with it."""
    client.send_message(pyigtl.TransformMessage(matrix, device_name="ProbeToReference"))
    end = time.monotonic() + 60
    while time.monotonic() < end:
        pose = client.wait_for_message("ProbeToWorld", timeout=60)
        image = client.wait_for_message("BMode", timeout=60)
        assert pose is not None and image is not None, "nothing arrives"
        # The first image is taken before the probe has moved.
        if np.allclose(pose.matrix, matrix, atol=1e-4):
            return image
    raise AssertionError("the probe has not moved")


def check_place(image, matrix):
    """Left and right of the image lie as far from the probe's axis; rows go down, away from it."""
    _, rows, columns = image.image.shape
    place = np.linalg.inv(matrix) @ image.ijk_to_world_matrix
    pitch = place[0, 0]
    expected = np.zeros((3, 3))
    expected[0, 0] = expected[2, 1] = pitch
    expected[1, 2] = place[1, 2]
    assert np.allclose(place[:3, :3], expected, atol=1e-4), place
    assert place[1, 2] < 0, "the third axis makes a right-handed system"
    assert abs(place[0, 3] + pitch * (columns - 1) / 2) < 1e-3, place
    assert abs(place[1, 3]) < 1e-3, place
    # 160 mm of depth along the middle, and what the edges of the fan lie behind it.
    height = pitch * rows
    assert 160 < height < 175, height
    assert -15 < place[2, 3] < 0, place
    return pitch


def command(program, kind, scene):
    return [program, kind, scene, "--igtl-port", "0", "--quality", "draft", *SMALL]


def connect(server):
    line = server.stdout.readline()
    port = int(re.search(r"127\.0\.0\.1:(\d+)", line).group(1))
    return pyigtl.OpenIGTLinkClient("127.0.0.1", port)


def serve(program, scene):
    server = subprocess.Popen(command(program, "serve", scene), stdout=subprocess.PIPE, text=True)
    try:
        client = connect(server)
        home, away = turned(0, [0, 0, 0]), turned(30, [8, 0, 5])
        images = [image_at(client, pose) for pose in (home, away, home)]
        for image, pose in zip(images, (home, away, home)):
            assert image.image.dtype == np.uint8 and image.image.shape[:2] == (1, 200), image.image.shape
            assert image.world_coordinate_system == "ras"
            pitch = check_place(image, pose)
        pixels = [image.image.astype(int) for image in images]
        # Electronic noise is another in each frame; anatomy is not.
        moved = np.abs(pixels[0] - pixels[1]).mean()
        back = np.abs(pixels[0] - pixels[2]).mean()
        assert moved > 4 * back and moved > 2, (moved, back)
        client.stop()
        print(f"passed: {pixels[0].shape[2]} x {pixels[0].shape[1]} pixels of {pitch:.3f} mm; "
              f"mean change {moved:.1f} moved, {back:.2f} back again")
    finally:
        server.terminate()
        server.wait()


class Display:
    """An X server without a screen, whose picture is a file (XWD)."""

    SIZE = (1280, 720)

    def __init__(self, folder):
        read, write = os.pipe()
        screen = "%dx%dx24" % self.SIZE
        self.process = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", screen, "-fbdir", folder,
                                         "-nolisten", "tcp"], pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        self.name = ":" + os.read(read, 16).decode().strip()
        self.file = os.path.join(folder, "Xvfb_screen0")

    def image(self):
        """Left part of the picture, where the image is: rows, columns, colours."""
        data = open(self.file, "rb").read()
        # XWD: lengths of header and line, number of colours, each a big-endian word.
        header, line, colours = (int.from_bytes(data[at:at + 4], "big") for at in (0, 48, 76))
        pixels = np.frombuffer(data, np.uint8, offset=header + 12 * colours)
        pixels = pixels[:line * self.SIZE[1]].reshape(self.SIZE[1], line)[:, :4 * self.SIZE[0]]
        return pixels.reshape(*self.SIZE[::-1], 4)[60:660, 60:880, :3].astype(int)

    def settled(self):
        """The picture once it has not changed for a second."""
        last = self.image()
        while True:
            time.sleep(1)
            now = self.image()
            if (now == last).all():
                return now
            last = now


def without_display():
    return {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}


def view(program, scene):
    with tempfile.TemporaryDirectory() as folder:
        display = Display(folder)
        # Slicer and pyigtl send a pose when it changes: a still one is not lost.
        window = subprocess.Popen([*command(program, "view", scene), "--validate", "--set", "tracker.timeout=3600"],
                                  stdout=subprocess.PIPE, text=True,
                                  env={"DISPLAY": display.name, **without_display()})
        try:
            client = connect(window)
            poses = [turned(0, [0, 0, 0]), turned(30, [8, 0, 5]), turned(0, [0, 0, 0])]
            images, shown = [], []
            for pose in poses:
                images.append(image_at(client, pose))
                shown.append(display.settled())
                check_place(images[-1], pose)
            pixels = [image.image.astype(int) for image in images]
            for what, (home, away, back) in (("images", pixels), ("window", shown)):
                moved, same = np.abs(home - away).mean(), np.abs(home - back).mean()
                assert moved > 4 * same and moved > 2, (what, moved, same)
                print(f"{what}: mean change {moved:.1f} moved, {same:.2f} back again")
            # A stream as a tracker sends it: what arrives is counted, and the window does not fall behind.
            began, received = time.monotonic(), 0
            for i in range(300):
                client.send_message(pyigtl.TransformMessage(turned(i / 10, [0, 0, 0]), device_name="ProbeToReference"))
                received += sum(message.message_type == "IMAGE" for message in client.get_latest_messages())
                time.sleep(1 / 60)
            took = time.monotonic() - began
            last = turned(29.9, [0, 0, 0])
            while not np.allclose(client.wait_for_message("ProbeToWorld", timeout=60).matrix, last, atol=1e-4):
                pass
            behind = time.monotonic() - began - took
            print(f"stream: 300 poses in {took:.1f} s, {received} images seen, the last pose's {behind:.1f} s later")
            client.stop()
        finally:
            window.send_signal(signal.SIGTERM)
            window.wait()
            display.process.terminate()
            display.process.wait()


def vectors():
    matrix = np.array([[0, -1, 0, 10.5], [1, 0, 0, -20.25], [0, 0, 1, 30.125], [0, 0, 0, 1]])
    plain = pyigtl.TransformMessage(matrix, device_name="ProbeToReference", timestamp=1234567890.5)
    told = pyigtl.TransformMessage(matrix, device_name="ProbeToReference", timestamp=1234567890.5)
    told.header_version, told.message_id = 2, 7
    told.metadata = {"TransformStatus": "OK", "Operator": "A. B."}
    place = np.diag([0.5, 0.25, 2, 1.0])
    place[:3, 3] = [1, 2, 3]
    image = pyigtl.ImageMessage(np.arange(6, dtype=np.uint8).reshape(1, 2, 3), place, "ras",
                                timestamp=1234567890.5, device_name="BMode")
    text = pyigtl.StringMessage("hello", device_name="Note", timestamp=1234567890.5)
    for name, message in (("TRANSFORM", plain), ("TRANSFORM_2", told), ("IMAGE", image), ("STRING", text)):
        packed = message.pack().hex()
        lines = "\\\n     ".join(packed[i:i + 88] for i in range(0, len(packed), 88))
        print(f'const {name}: &str =\n    "{lines}";')


if __name__ == "__main__":
    {"serve": serve, "view": view, "vectors": vectors}[sys.argv[1]](*sys.argv[2:])
