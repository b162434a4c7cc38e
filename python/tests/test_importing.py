"""Label maps of arrays made into scenes."""

import warnings

import numpy as np
import pytest

import insonify


def balls(dtype=np.int64):
    """A body of 1, in it a ball of 5 and one of 7, voxels of 2 mm; first axis to the patient's right in RAS."""
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in (50, 40, 30)), indexing="ij"), -1)
    out = np.zeros((50, 40, 30), dtype)
    out[np.linalg.norm((grid - [25, 20, 15]) / [22, 17, 13], axis=-1) < 1] = 1
    out[np.linalg.norm(grid - [15, 20, 15], axis=-1) < 6] = 5
    out[np.linalg.norm(grid - [35, 20, 15], axis=-1) < 4] = 7
    return out


AFFINE = np.diag([2.0, 2.0, 2.0, 1.0])
AFFINE[:3, 3] = [-50, -40, 100]
NAMES = {1: "body", 5: "liver_segment", 7: "gallbladder"}


@pytest.mark.parametrize("dtype", [np.int64, np.uint16, np.float64, np.uint8])
def test_an_array_becomes_a_scene(tmp_path, dtype):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = insonify.import_labels(balls(dtype), AFFINE, NAMES, folder=tmp_path / "made")
    assert scene.meshes == ["skin", "liver_segment", "gallbladder"]
    assert {scene[f"mesh.{name}.tissue"] for name in ("liver_segment", "gallbladder")} == {"liver", "bile"}
    with insonify.Simulator(scene, quality="draft") as simulator:
        assert simulator.frame().bmode.max() > 60


def test_it_lies_where_the_affine_says(tmp_path):
    def place(name, **how):
        folder = tmp_path / name
        insonify.import_labels(balls(), AFFINE, NAMES, folder=folder, **how)
        text = (folder / "meshes/liver-segment.obj").read_text()
        return np.array([line.split()[1:4] for line in text.splitlines() if line.startswith("v ")], float).mean(0)

    ras = AFFINE[:3, :3] @ [15, 20, 15] + AFFINE[:3, 3]
    assert np.allclose(place("ras"), ras * [-1, -1, 1], atol=0.1)
    assert np.allclose(place("lps", frame="lps"), ras, atol=0.1)


def test_what_is_to_be_said_is_warned_of(tmp_path):
    with pytest.warns(UserWarning, match="3 structures had no tissue"):
        insonify.import_labels(balls(), AFFINE, folder=tmp_path / "nameless")
    with pytest.warns(UserWarning, match="spleen: has no voxel"):
        insonify.import_labels(balls(), AFFINE, {**NAMES, 9: "spleen"}, folder=tmp_path / "more")
    with pytest.warns(UserWarning, match="liver: 7.2 ml, and adults have 1400 to 1800 ml"):
        insonify.import_labels(balls(), AFFINE, {**NAMES, 5: "liver"}, folder=tmp_path / "small")
    # A sequence begins with what 0 is called.
    listed = ["background", "body", "a", "b", "c", "liver_segment", "d", "gallbladder"]
    with pytest.warns(UserWarning, match="d: has no voxel"):
        scene = insonify.import_labels(balls(), AFFINE, listed, folder=tmp_path / "listed")
    assert "gallbladder" in scene.meshes


def test_mistakes(tmp_path):
    def refuse(error, match, array=None, affine=AFFINE, names=NAMES, **how):
        with pytest.raises(error, match=match):
            insonify.import_labels(balls() if array is None else array, affine, names, folder=tmp_path / "no", **how)
        assert not (tmp_path / "no/scene.toml").exists()

    refuse(ValueError, "three axes", np.zeros((4, 4)))
    refuse(TypeError, "complex", balls(complex))
    refuse(ValueError, "from -1", balls() - 1)
    refuse(ValueError, "to 16777216", balls() * 0 + 2**24)
    refuse(insonify.SceneError, "an image and no label map", balls(float) * 0.37)
    refuse(insonify.SceneError, "every voxel is 0", balls() * 0)
    refuse(ValueError, "affine", affine=np.zeros((4, 4)) + [0, 0, 0, 1] * np.array([[0], [0], [0], [1]]))
    refuse(ValueError, "transposed", affine=AFFINE.T)
    refuse(ValueError, "frame is", frame="itk")
    refuse(ValueError, "classes is", classes="total")
    refuse(ValueError, "around: unknown tissue", around="fatt")
    refuse(ValueError, "spacing: ", spacing=0.0)
    refuse(insonify.SceneError, "pancreas", look_at="pancreas")
    insonify.import_labels(balls(), AFFINE, NAMES, folder=tmp_path)
    with pytest.raises(FileExistsError, match="force=True"):
        insonify.import_labels(balls(), AFFINE, NAMES, folder=tmp_path)
    insonify.import_labels(balls(), AFFINE, NAMES, folder=tmp_path, force=True)
