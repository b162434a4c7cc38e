"""The command line of the package."""

import signal
import subprocess
import sys

import pytest

import insonify


def command(*arguments, folder):
    """What `python -m insonify` of these arguments returns and writes."""
    return subprocess.run([sys.executable, "-m", "insonify", *map(str, arguments)], cwd=folder, capture_output=True, text=True)


def test_it_says_what_the_program_says(program, tmp_path):
    for arguments, code in [(["check", "phantom"], 0), (["check", "nobody.toml"], 1), (["render"], 2), (["--version"], 0)]:
        ours = command(*arguments, folder=tmp_path)
        other = subprocess.run([program, *arguments], cwd=tmp_path, capture_output=True, text=True)
        assert (ours.returncode, ours.stdout, ours.stderr) == (other.returncode, other.stdout, other.stderr), arguments
        assert ours.returncode == code


def test_a_sweep_is_acquired_and_reconstructed(tmp_path):
    scene = insonify.Scene(background="liver", probe={"preset": "linear", "depth": 30, "scanlines": 32, "samples": 256, "elevation_layers": 1}, simulation={"paths": 2}, imaging={"image_height": 96})
    scene.save(tmp_path / "block.toml")
    made = command("acquire", "block.toml", "--sweep", "linear:4mm", "--frames", 5, "-o", "sweep.igs.mha", folder=tmp_path)
    assert made.returncode == 0, made.stderr
    again = command("reconstruct", "sweep.igs.mha", "--reference", "Tracker", "--spacing", "0.5", "-o", "volume.mha", folder=tmp_path)
    assert again.returncode == 0, again.stderr
    # Five frames, 1 mm from each other, in voxels of half of that.
    assert " x 9 voxels" in again.stdout or " x 9 x " in again.stdout, again.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="skipped: no such signal")
def test_an_interrupt_ends_it(tmp_path):
    asked = [sys.executable, "-m", "insonify", "serve", "phantom", "--igtl-port", "0"]
    process = subprocess.Popen(asked, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert process.stdout is not None and process.stdout.readline()
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == -signal.SIGINT
