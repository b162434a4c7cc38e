#!/usr/bin/env python3
"""Small volumes written by others, and what others read from them, for tests/volumes.rs.

    pip install SimpleITK==2.5.7 pydicom==3.0.2 pillow numpy
    python tools/oracle/volumes.py            # writes tests/volumes/

SimpleITK writes MetaImage, NRRD and NIfTI and reads each back: its voxels, origin, spacing and
direction are what is expected. pydicom writes enhanced ultrasound volumes; expected are its own
decoded pixels and the geometry that was put in. Values are random with a fixed seed.
"""

import io
import json
import pathlib

import numpy as np
import pydicom
import SimpleITK as sitk
from PIL import Image
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.encaps import encapsulate
from pydicom.sequence import Sequence
from pydicom.uid import (DeflatedExplicitVRLittleEndian, ExplicitVRBigEndian, ExplicitVRLittleEndian,
                         ImplicitVRLittleEndian, JPEGBaseline8Bit, RLELossless)

OUT = pathlib.Path(__file__).resolve().parents[2] / "tests" / "volumes"
SIZE = (5, 4, 3)
RANDOM = np.random.default_rng(20)


def rotation(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


DIRECTIONS = {
    "axial": np.eye(3),
    "coronal": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float),
    "sagittal": np.array([[0, 0, -1], [1, 0, 0], [0, -1, 0]], float),
    "mirrored": np.diag([-1.0, 1, 1]),
    "oblique": rotation((1, 2, 3), 0.7),
    "oblique2": rotation((3, -1, 2), -2.1) @ np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float),
}
TYPES = {
    "u8": np.uint8, "i8": np.int8, "u16": np.uint16, "i16": np.int16,
    "u32": np.uint32, "i32": np.int32, "f32": np.float32, "f64": np.float64,
}
# Every type, direction and way to write at least once.
FILES = [
    ("u8", "axial", "mha", True), ("i16", "oblique", "mha", True), ("u16", "mirrored", "mha", False),
    ("f32", "oblique2", "mha", False), ("f64", "coronal", "mha", True), ("i8", "sagittal", "mhd", True),
    ("u32", "oblique", "mhd", False),
    ("u8", "oblique2", "nrrd", True), ("i16", "sagittal", "nrrd", False), ("u16", "oblique", "nrrd", True),
    ("f32", "coronal", "nrrd", False), ("i32", "mirrored", "nhdr", False), ("f64", "oblique", "nhdr", True),
    ("u8", "coronal", "nii", False), ("i16", "oblique", "nii", False), ("u16", "axial", "nii.gz", True),
    ("f32", "oblique2", "nii.gz", True), ("i32", "mirrored", "nii", False), ("f64", "sagittal", "nii.gz", True),
]


def values(name):
    kind, shape = TYPES[name], SIZE[::-1]
    if np.issubdtype(kind, np.floating):
        return RANDOM.normal(0, 300, shape).astype(kind)
    info = np.iinfo(kind)
    # Beyond 24 bits a value would be rounded to single precision.
    low, high = max(info.min, -2**24), min(info.max, 2**24)
    return RANDOM.integers(low, high, shape, endpoint=True).astype(kind)


def entry(array, spacing, origin, direction, by):
    return {
        "by": by,
        "size": list(array.shape[::-1]),
        "spacing": [float(v) for v in spacing],
        "origin": [float(v) for v in origin],
        "direction": [float(v) for v in np.asarray(direction).ravel()],
        "values": [float(f"{np.float32(v):.9g}") for v in array.ravel()],
    }


def simpleitk(expected):
    for kind, direction, extension, compressed in FILES:
        image = sitk.GetImageFromArray(values(kind))
        image.SetSpacing((0.31, 0.47, 1.9))
        image.SetOrigin((-12.25, 31.5, 107.625))
        image.SetDirection(DIRECTIONS[direction].ravel().tolist())
        name = f"{kind}_{direction}.{extension}"
        sitk.WriteImage(image, str(OUT / name), compressed)
        read = sitk.ReadImage(str(OUT / name))
        expected[name] = entry(sitk.GetArrayFromImage(read), read.GetSpacing(), read.GetOrigin(),
                               read.GetDirection(), "SimpleITK " + sitk.Version_VersionString())


def dicom(name, array, syntax, frames=None, color=None):
    """An enhanced ultrasound volume; its planes are stored from the last to the first."""
    z, y, x = array.shape[:3]
    direction = DIRECTIONS["oblique"]
    spacing, origin = (0.25, 0.5, 0.75), np.array([3.5, -20.25, 40.125])
    meta = FileMetaDataset()
    meta.TransferSyntaxUID = syntax
    meta.MediaStorageSOPClassUID = "1.2.840.10008.5.1.4.1.1.6.2"
    meta.MediaStorageSOPInstanceUID = "2.25.1"
    data = FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128,
                       is_implicit_VR=syntax == ImplicitVRLittleEndian,
                       is_little_endian=syntax != ExplicitVRBigEndian)
    data.SOPClassUID, data.SOPInstanceUID = meta.MediaStorageSOPClassUID, "2.25.1"
    data.Modality, data.PatientName = "US", "Phantom"
    data.Rows, data.Columns, data.NumberOfFrames = y, x, z
    data.SamplesPerPixel = 3 if color else 1
    data.PhotometricInterpretation = color or "MONOCHROME2"
    if color:
        data.PlanarConfiguration = 0
    bits = 8 * array.dtype.itemsize
    data.BitsAllocated, data.BitsStored, data.HighBit = bits, bits, bits - 1
    data.PixelRepresentation = int(np.issubdtype(array.dtype, np.signedinteger))
    measures, orientation, shared = Dataset(), Dataset(), Dataset()
    measures.PixelSpacing, measures.SliceThickness = [spacing[1], spacing[0]], spacing[2]
    orientation.ImageOrientationVolume = [*direction[:, 0], *direction[:, 1]]
    shared.PixelMeasuresSequence = Sequence([measures])
    shared.PlaneOrientationVolumeSequence = Sequence([orientation])
    data.SharedFunctionalGroupsSequence = Sequence([shared])
    groups = []
    for k in range(z):
        position, group = Dataset(), Dataset()
        position.ImagePositionVolume = [*(origin + direction[:, 2] * spacing[2] * (z - 1 - k))]
        group.PlanePositionVolumeSequence = Sequence([position])
        groups.append(group)
    data.PerFrameFunctionalGroupsSequence = Sequence(groups)
    if frames is not None:
        data.PixelData = encapsulate(frames)
    else:
        swap = syntax == ExplicitVRBigEndian
        data.PixelData = (array.byteswap() if swap else array).tobytes()
        data["PixelData"].VR = "OB" if bits == 8 else "OW"
    path = OUT / name
    if syntax == RLELossless:
        meta.TransferSyntaxUID = ExplicitVRLittleEndian
        data.compress(RLELossless)
    data.save_as(path, enforce_file_format=True)
    read = pydicom.dcmread(path).pixel_array
    if color:
        read = np.rint(read @ np.array([0.299, 0.587, 0.114]))
    return entry(read[::-1], spacing, origin, direction, "pydicom " + pydicom.__version__)


def main():
    OUT.mkdir(exist_ok=True)
    expected = {}
    simpleitk(expected)
    for name, kind, syntax in [
        ("explicit_u8.dcm", "u8", ExplicitVRLittleEndian), ("implicit_i16.dcm", "i16", ImplicitVRLittleEndian),
        ("big_u16.dcm", "u16", ExplicitVRBigEndian), ("deflated_i16.dcm", "i16", DeflatedExplicitVRLittleEndian),
        ("rle_u8.dcm", "u8", RLELossless), ("rle_i16.dcm", "i16", RLELossless),
    ]:
        expected[name] = dicom(name, values(kind), syntax)
    rgb = RANDOM.integers(0, 255, (*SIZE[::-1], 3), endpoint=True).astype(np.uint8)
    expected["rgb.dcm"] = dicom("rgb.dcm", rgb, ExplicitVRLittleEndian, color="RGB")
    # Smooth planes, so that decoders of JPEG agree to a grey level.
    y, x = np.mgrid[0:12, 0:16]
    grey = np.stack([(9 * x + 5 * y + 20 * k) for k in range(2)]).astype(np.uint8)
    frames = []
    for plane in grey:
        packed = io.BytesIO()
        Image.fromarray(plane).save(packed, "JPEG", quality=90)
        frames.append(packed.getvalue())
    expected["jpeg.dcm"] = dicom("jpeg.dcm", grey, JPEGBaseline8Bit, frames)
    text = json.dumps(expected, indent=0, separators=(",", ":")).replace(".0,", ",").replace(".0\n", "\n")
    # One line per volume, so that a difference can be seen.
    text = text.replace("\n", "").replace('},"', '},\n"')
    (OUT / "expected.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
