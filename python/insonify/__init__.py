"""Real-time ultrasound simulation: anatomy in, B-mode images, IQ and labels out, on any Vulkan device.

    import insonify
    scene = insonify.Scene.load("scenes/phantom.toml")
    scene["imaging.gain"] = "20 dB"
    with insonify.Simulator(scene, quality="draft") as simulator:
        image = simulator.frame().bmode          # uint8 [height, width]

Units: mm, microseconds, MHz, dB; times of a scene in seconds. docs/python.md has the whole.
"""

import os as _os

from . import _insonify

# Mesa's software driver reads them when the first device is opened.
for _name, _value in _insonify.driver_environment():
    _os.environ[_name] = _os.fspath(_value)

from ._insonify import Frame, InsonifyError, Scene, SceneError, devices  # noqa: E402
from .datasets import make_dataset  # noqa: E402
from .files import save  # noqa: E402
from .simulator import Frames, Simulator  # noqa: E402

__version__ = _insonify.__version__
__all__ = ["Frame", "Frames", "InsonifyError", "Scene", "SceneError", "Simulator", "devices", "make_dataset", "save"]
