"""docs/python.md: every block runs, in order, in a folder beside `scenes`; its figures are those that it draws.

INSONIFY_BLESS=1 writes the figures again.
"""

import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT
from PIL import Image

PAGE = ROOT / "docs/python.md"
FIGURES = ROOT / "docs/python"


def blocks(text):
    """The Python of a page: its fenced blocks, each at the line where the page has it, so that errors name it."""
    out = []
    for found in re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        before = text[: found.start(1)].count("\n")
        out += [""] * (before - len(out)) + found[1].splitlines()
    return "\n".join(out) + "\n"


def shown(text):
    """Names of the figures of a page."""
    return re.findall(r"^!\[.+\]\(python/(\w+\.png)\)$", text, re.MULTILINE)


def thumbnail(path):
    """A picture as 24 x 24 grey levels, 0 to 1, in which grain and letters of other fonts make no difference."""
    return np.asarray(Image.open(path).convert("L").resize((24, 24), Image.Resampling.BOX)) / 255


def alike(made, kept):
    """True if two figures have the same size and show much the same."""
    sizes = [Image.open(path).size for path in (made, kept)]
    return sizes[0] == sizes[1] and np.abs(thumbnail(made) - thumbnail(kept)).mean() < 0.03


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder in which the page's blocks have run, by a process of their own."""
    folder = tmp_path_factory.mktemp("docs")
    (folder / "scenes").symlink_to(ROOT / "scenes")
    (folder / "page.py").write_text(blocks(PAGE.read_text()))
    environment = {**os.environ, "MPLBACKEND": "Agg", "PYTHONWARNINGS": "error::SyntaxWarning"}
    run = subprocess.run([sys.executable, "page.py"], cwd=folder, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    (folder / "said.txt").write_text(run.stdout)
    return folder


def test_every_block_runs_and_every_figure_is_what_it_draws(folder):
    names = shown(PAGE.read_text())
    assert len(names) >= 7 and len(set(names)) == len(names)
    if os.environ.get("INSONIFY_BLESS"):
        FIGURES.mkdir(exist_ok=True)
        for name in names:
            # Few colours: a page is read over slow lines, too.
            Image.open(folder / name).convert("RGB").quantize(128).save(FIGURES / name, optimize=True)
    assert sorted(names) == sorted(path.name for path in FIGURES.iterdir()), "INSONIFY_BLESS=1 writes what is missing"
    for name in names:
        assert (FIGURES / name).stat().st_size < 150_000, name
        assert thumbnail(folder / name).std() > 0.02, f"{name} is blank"
        assert alike(folder / name, FIGURES / name), f"{name} is another picture; INSONIFY_BLESS=1 writes it"


def test_the_blocks_say_what_the_page_says(folder):
    said = (folder / "said.txt").read_text()
    assert "unknown field `gian`" in said and "did you mean `gain`?" in said
    noise = float(re.search(r"signal to noise of speckle: ([\d.]+)", said)[1])
    # Some hundred resolution cells.
    assert abs(noise - 1.91) < 0.25, said
    found = re.search(r"enhancement: ([\d.]+) dB, by the formula ([\d.]+) dB, over the aperture ([\d.]+) dB", said)
    seen, formula, aperture = map(float, found.groups())
    assert abs(seen - formula) < 0.1 and formula > 5, said
    assert 0.85 * formula < aperture < formula, said
    assert "6 samples of" in said and "(1, 150, 200)" in said
    for file in ("sweep.uff", "sweep.hdf5"):
        assert (folder / file).stat().st_size > 100_000


def test_another_figure_is_noticed(folder, tmp_path):
    names = shown(PAGE.read_text())
    for one, other in zip(names, names[1:]):
        assert not alike(folder / one, folder / other)
    turned = tmp_path / "turned.png"
    shutil.copy(folder / names[0], turned)
    Image.open(turned).rotate(180).save(turned)
    assert not alike(turned, folder / names[0])


def test_blocks_keep_their_lines():
    assert blocks("a\n```python\nx = 1\n```\n\n```sh\nls\n```\n```python\ny\n```\n") == "\n\nx = 1\n\n\n\n\n\n\ny\n"


def test_the_examples_are_typed(folder):
    """By mypy --strict, as a user's own code beside them may be."""
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--cache-dir", str(ROOT / "target/mypy"), "page.py"]
    environment = {**os.environ, "MYPYPATH": str(ROOT / "python")}
    run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
