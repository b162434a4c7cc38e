"""Real-time ultrasound simulation: anatomy in, B-mode images, IQ and labels out, on any Vulkan device.

    import insonify
    scene = insonify.Scene.load("scenes/phantom.toml")
    scene["imaging.gain"] = "20 dB"
    with insonify.Simulator(scene, quality="draft") as simulator:
        image = simulator.frame().bmode          # uint8 [height, width]

Units: mm, microseconds, MHz, dB; times of a scene in seconds. docs/python.md has the whole.
"""

import os as _os
import sys as _sys

from . import _insonify

# Where a process is forked from one that has opened a device, its end waits for no driver.
if hasattr(_os, "register_at_fork"):
    _os.register_at_fork(after_in_child=_insonify.forked)

# Mesa's software driver reads them when the first device is opened.
for _name, _value in _insonify.driver_environment():
    _os.environ[_name] = _os.fspath(_value)

# A fault of a driver's compiler shall end a process of its own and not this one. An application that embeds Python may
# name itself as the interpreter, and would only open another window.
if _os.path.basename(_sys.executable or "").lower().startswith("python"):
    _insonify.set_compiler(_sys.executable, ["-c", f"""
import sys
sys.path.insert(0, {_os.path.dirname(_os.path.dirname(_os.path.abspath(__file__)))!r})
from insonify import _insonify
sys.exit(_insonify.compile_standard_input())
"""])

from . import poses  # noqa: E402
from ._insonify import Frame, InsonifyError, Scene, SceneError, devices  # noqa: E402
from .datasets import make_dataset  # noqa: E402
from .doppler import Doppler, Spectrum  # noqa: E402
from .files import save  # noqa: E402
from .importing import import_labels  # noqa: E402
from .simulator import Frames, LoopFrame, Simulator  # noqa: E402

__version__ = _insonify.__version__
__all__ = [
    "Doppler",
    "Frame",
    "Frames",
    "InsonifyError",
    "LoopFrame",
    "Scene",
    "SceneError",
    "Simulator",
    "Spectrum",
    "devices",
    "import_labels",
    "make_dataset",
    "poses",
    "save",
]
