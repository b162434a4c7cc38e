"""Data sets from Python and from clusters: always the same bytes."""

import hashlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import ROOT, chosen

import insonify

EXAMPLES = ROOT / "python/examples"

PLAN = """
title = "Small"
seed = 3
quality = "draft"
formats = ["folder"]
samples_per_part = 2
[draw]
imaging.image_height = 64
imaging.gain = {{ uniform = ["0 dB", "6 dB"] }}
probe.scanlines = 32
probe.samples = 256
probe.elevation_layers = 1
simulation.paths = 1
[[scene]]
name = "phantom"
file = "{file}"
samples = {samples}
[scene.pose]
lateral = {{ uniform = ["-10 mm", "10 mm"] }}
"""


def written(folder, samples=8):
    plan = folder / "plan.toml"
    plan.write_text(PLAN.format(file=ROOT / "scenes/phantom.toml", samples=samples))
    return plan


def content(folder):
    """Every file of the samples, by its hash."""
    files = [path for path in sorted((folder / "folder").rglob("*")) if path.is_file()]
    return {path.relative_to(folder): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A plan, and its data set made in one go."""
    folder = tmp_path_factory.mktemp("whole")
    plan = written(folder)
    heard = []
    made = insonify.make_dataset(plan, folder / "set", tracer="bvh", heard=lambda *news: heard.append(news))
    assert made["made"] == made["samples"] == 8 and made["kept"] == 0 and made["parts"] == 4
    assert heard == [(i + 1, 8) for i in range(8)]
    assert Path(made["sheet"]).exists() and made["classes"]
    return plan, folder / "set"


def test_shards_alone_are_the_bytes_of_the_whole(whole, tmp_path):
    plan, folder = whole
    for index in (2, 0, 1):
        insonify.make_dataset(plan, tmp_path / "set", shard=(index, 3), resume=True, tracer="bvh")
    assert content(tmp_path / "set") == content(folder) and len(content(folder)) == 24


def test_what_the_listener_raises_ends_the_run_and_it_goes_on(whole, tmp_path):
    plan, folder = whole

    def stop(done, samples):
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        insonify.make_dataset(plan, tmp_path / "set", tracer="bvh", heard=stop)
    made = insonify.make_dataset(plan, tmp_path / "set", tracer="bvh", resume=True)
    assert made["kept"] >= 4 and made["kept"] + made["made"] == 8
    assert content(tmp_path / "set") == content(folder)


def test_mistakes_are_found_before_any_frame(tmp_path):
    plan = written(tmp_path)
    plan.write_text(plan.read_text().replace('"6 dB"', '"600 dB"'))
    with pytest.raises(insonify.SceneError, match=r"(?s)plan.toml:9.*between -200 and 200 dB"):
        insonify.make_dataset(plan, tmp_path / "set")
    assert not (tmp_path / "set").exists()
    plan = written(tmp_path)
    with pytest.raises(ValueError, match=r"the last \(n - 1, n\)"):
        insonify.make_dataset(plan, tmp_path / "set", shard=(3, 3))
    assert insonify.make_dataset(plan, tmp_path / "set", check=True)["samples"] == 8
    assert not (tmp_path / "set").exists()


def test_the_array_script_makes_the_same_bytes(whole, program, tmp_path):
    plan, folder = whole
    command = [EXAMPLES / "slurm_dataset.sh", plan, tmp_path / "set"]
    for task in (5, 4):
        slurm = {"TASK_ID": task, "TASK_MIN": 4, "TASK_MAX": 5, "TASK_COUNT": 2}
        names = {f"SLURM_ARRAY_{name}": str(value) for name, value in slurm.items()}
        environment = {**os.environ, **names, "INSONIFY": str(program), "INSONIFY_VALIDATE": ""}
        subprocess.run(command, check=True, env=environment, capture_output=True)
    made = content(tmp_path / "set")
    # The program takes the device's best tracer, on a software driver the same.
    assert made.keys() == content(folder).keys()
    if chosen()["kind"] == "cpu":
        assert made == content(folder)
    gaps = {**os.environ, "SLURM_ARRAY_TASK_ID": "4", "SLURM_ARRAY_TASK_MIN": "0", "SLURM_ARRAY_TASK_MAX": "4", "SLURM_ARRAY_TASK_COUNT": "3"}
    refused = subprocess.run(command, env=gaps, capture_output=True, text=True)
    assert refused.returncode == 2 and "gaps" in refused.stderr


def children(process):
    """Process ids below a process, and their names."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                name, fields = (entry / "stat").read_text().rsplit(")", 1)
                found[int(entry.name)] = (int(fields.split()[1]), name.split("(", 1)[1])
            except (OSError, IndexError):
                continue
    below, grown = {process}, True
    while grown:
        more = {pid for pid, (parent, _) in found.items() if parent in below} - below
        below |= more
        grown = bool(more)
    return {pid: found[pid][1] for pid in below if pid in found}


def test_ray_repeats_what_a_killed_worker_had(tmp_path):
    pytest.importorskip("ray", reason="skipped: no ray")
    plan = written(tmp_path, samples=24)
    command = [sys.executable, EXAMPLES / "ray_dataset.py", plan, tmp_path / "set", "--shards", "6", "--workers", "2"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "python"), "RAY_USAGE_STATS_ENABLED": "0"}
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
        killed = None
        while killed is None and run.poll() is None:
            busy = [pid for pid, name in children(run.pid).items() if name.startswith("ray::shard")]
            # A worker that has begun a sample.
            if busy and any((tmp_path / "set").rglob("*.png")):
                os.kill(busy[0], signal.SIGKILL)
                killed = busy[0]
            time.sleep(0.05)
        said = run.communicate()[0]
    assert run.returncode == 0, said
    assert killed is not None, said
    assert "6/6 shards, 24 samples" in said
    insonify.make_dataset(plan, tmp_path / "once")
    assert content(tmp_path / "set") == content(tmp_path / "once") and len(content(tmp_path / "once")) == 72
