#!/usr/bin/env python3
"""A tracked sequence as others read it, and the volume that they make of it.

    pip install SimpleITK==2.5.7 numpy
    insonify acquire scenes/phantom.toml --sweep tilt:20deg --frames 9 -o sweep.igs.mha
    insonify reconstruct sweep.igs.mha --spacing 0.7 --fill 0 -o volume.mha
    python tools/oracle/sequence.py sweep.igs.mha volume.mha

SimpleITK reads the frames and, as its dictionary of the header, poses, status and sector; the nearest
voxel of each pixel inside the sector takes the mean of what reaches it. Says how the voxels of the
volume compare; exits 1 unless all but 1 in 1000 agree to a grey level. (Pixels that fall on the border
between two voxels to the last bit may go either way.)
"""

import sys

import numpy as np
import SimpleITK as sitk


def matrix(image, key):
    return np.array(image.GetMetaData(key).split(), float).reshape(4, 4)


def main(sequence, volume):
    reader = sitk.ImageFileReader()
    reader.SetFileName(sequence)
    reader.ReadImageInformation()
    image = reader.Execute()
    for key in reader.GetMetaDataKeys():
        image.SetMetaData(key, reader.GetMetaData(key))
    frames = sitk.GetArrayFromImage(image)
    count, height, width = frames.shape
    made = sitk.ReadImage(volume)
    voxels = sitk.GetArrayFromImage(made).astype(float)
    shape = np.array(made.GetSize())
    y, x = np.mgrid[0:height, 0:width]
    inside = np.ones((height, width), bool)
    if "FanOriginPixel" in image.GetMetaDataKeys():
        pair = lambda key: np.array(image.GetMetaData(key).split(), float)
        origin, angles = pair("FanOriginPixel"), pair("FanAnglesDeg")
        start, stop = pair("FanRadiusStartPixel")[0], pair("FanRadiusStopPixel")[0]
        angle = np.degrees(np.arctan2(x - origin[0], y - origin[1]))
        radius = np.hypot(x - origin[0], y - origin[1])
        inside = (angle >= angles[0]) & (angle <= angles[1]) & (radius >= start) & (radius <= stop)
    pixels = np.stack([x[inside], y[inside], np.zeros(inside.sum()), np.ones(inside.sum())])
    sums, weights = np.zeros(shape.prod()), np.zeros(shape.prod())
    times = []
    for index, frame in enumerate(frames):
        prefix = f"Seq_Frame{index:04}_"
        for status in ["ProbeToTrackerTransformStatus", "ImageToProbeTransformStatus", "ImageStatus"]:
            assert image.GetMetaData(prefix + status) == "OK", status
        times.append(float(image.GetMetaData(prefix + "Timestamp")))
        pose = matrix(image, prefix + "ProbeToTrackerTransform")
        rotation = pose[:3, :3]
        assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9) and np.linalg.det(rotation) > 0
        calibration = matrix(image, prefix + "ImageToProbeTransform")
        assert np.linalg.det(calibration) > 0, "right-handed"
        place = np.linalg.inv(matrix(image, prefix + "ReferenceToTrackerTransform")) @ pose @ calibration
        points = (place @ pixels)[:3].T
        direction = np.array(made.GetDirection()).reshape(3, 3)
        at = (points - made.GetOrigin()) @ direction / made.GetSpacing()
        at = np.floor(at + 0.5 + 1 / 131072).astype(int)
        fits = ((at >= 0) & (at < shape)).all(1)
        at = at[fits] @ [1, shape[0], shape[0] * shape[1]]
        np.add.at(sums, at, frame[inside][fits])
        np.add.at(weights, at, 1)
    assert (np.diff(times) > 0).all(), "timestamps"
    mean = np.floor(np.divide(sums, weights, out=np.zeros_like(sums), where=weights > 0) + 0.5)
    off = np.abs(mean - voxels.ravel())
    share = (off <= 1).mean()
    print(f"{count} frames of {width} x {height}, {times[0]} to {times[-1]} s; {inside.mean():.1%} in the sector")
    print(f"voxels: {share:.4%} agree to a grey level, {(off == 0).mean():.4%} are equal, largest {off.max():.0f}")
    return 0 if share > 0.999 else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
