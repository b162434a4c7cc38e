"""Scenes, simulators and frames. Units: mm, microseconds, MHz, dB; times of a scene in seconds."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypedDict

if sys.version_info >= (3, 11):
    from typing import Self
else:
    from typing_extensions import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

Want = Literal["iq", "envelope", "log", "rf", "labels"]

class Device(TypedDict):
    index: int
    name: str
    kind: str
    driver: str
    vulkan: str
    memory_bytes: int
    ray_query: bool
    usable: bool
    lacks: list[str]

class InsonifyError(Exception):
    """The simulator cannot do what it is told to: no device, no memory, too large a scene."""

class SceneError(InsonifyError):
    """A mistake in a scene, its settings or its files: place, cause and remedy, as the command line prints it."""

def devices() -> list[Device]:
    """The Vulkan devices of this machine. InsonifyError: there is no Vulkan loader."""

def make_dataset(
    plan: str | PathLike[str],
    output: str | PathLike[str],
    shard: tuple[int, int],
    resume: bool,
    check: bool,
    device: str | None,
    tracer: str,
    heard: Callable[[int, int], object],
) -> dict[str, Any]:
    """As insonify.make_dataset, which has the defaults."""

def save(
    path: str | PathLike[str],
    about: str,
    probe: dict[str, Any],
    x: ArrayLike,
    z: ArrayLike,
    poses: ArrayLike,
    times: Sequence[float],
    arrays: dict[str, NDArray[Any]],
    tissues: list[str],
) -> None:
    """As insonify.save, which gathers these facts of frames."""

def png(image: NDArray[np.uint8], pixel: float) -> bytes:
    """The PNG file of an image [H, W] whose pixels are `pixel` mm wide."""

def write(path: str | PathLike[str], bytes: bytes) -> None:
    """Writes the bytes as a file, whole or not at all."""

def save_film(
    path: str | PathLike[str],
    about: str,
    probe: dict[str, Any],
    extent: tuple[float, float, float, float],
    images: NDArray[np.uint8],
    ends: Sequence[float],
) -> None:
    """As insonify.save of a loop: images [N, H, W], each shown until its end, s from the beginning."""

def import_labels(
    voxels: NDArray[Any],
    size: list[int],
    affine: ArrayLike,
    frame: str,
    names: list[tuple[int, str]],
    folder: str,
    classes: str | None,
    look_at: str | None,
    around: str,
    spacing: list[float] | None,
    force: bool,
) -> tuple[str, list[str]]:
    """As insonify.import_labels, which has the defaults. Returns the scene file, and what is to be said of it."""

def driver_environment() -> list[tuple[str, str]]:
    """Variables that make Mesa's software driver compile in a third of the time; import sets them."""

def forked() -> None:
    """Lets this process end without its drivers, if it was forked from one that had opened a device. Called after each fork."""

def set_compiler(program: str, arguments: list[str]) -> None:
    """Names a program that compiles kernels in a process of its own, by compile_standard_input; import does."""

def run_command(arguments: Sequence[str]) -> int:
    """Runs the command line of these arguments, of which the first is the program's name, in this process, which is to end
    with the exit code that it returns. Wrong arguments, --help and --version end it at once."""

def compile_standard_input() -> int:
    """Compiles the kernel that standard input describes; returns the exit code."""

class Scene:
    """What is imaged: anatomy, tissues, probe and every setting of the manual (docs/scenes.md).

    Scene.load(path) reads a scene file. Scene(...) makes one of dictionaries with the tables of a scene file; a mesh
    may have `vertices` [N, 3] in mm and `triangles` [M, 3] in place of a file:

        Scene(
            probe={"preset": "linear", "depth": 40},
            tissues={"cyst": {"based_on": "water"}},
            background="liver",
            mesh={"cyst": {"tissue": "cyst", "vertices": v, "triangles": t}},
        )

    scene["imaging.gain"] reads a key, scene["imaging.gain"] = "20 dB" sets it, = None takes that back. Quantities are
    read as numbers in the unit that describe(key) names, angles as text; numbers and text with a unit are taken.
    Scenes are copied by copy.copy and sent to other processes by pickle.
    """

    def __init__(self, *, folder: str | PathLike[str] = ".", **tables: Any) -> None:
        """folder: where the files are that the tables name. SceneError: a mistake in them."""
    @staticmethod
    def load(path: str | PathLike[str], overrides: Mapping[str, Any] | None = None) -> Scene:
        """The scene of a file, or one that ships by its name ("abdomen"), with `overrides` as of `--set`. SceneError: a
        mistake, with file, line and remedy."""
    def save(self, path: str | PathLike[str]) -> None:
        """Writes the scene as a scene file: the text that it was made of, everything that was set, its pose, and meshes of arrays
        as files beside it. Not its time. SceneError, OSError: a file that cannot be written, and one that ships; ValueError:
        a mesh that was placed by place()."""
    def __getitem__(self, key: str) -> Any:
        """The value of a key; None where it is not set and has no default. KeyError: scene files have no such key."""
    def __setitem__(self, key: str, value: Any) -> None:
        """Sets a key. Keys of probe, simulation and imaging at once; others read the scene again. SceneError: a value
        that the key does not take; the scene is then as it was."""
    def __delitem__(self, key: str) -> None:
        """Takes back what was set by hand, as setting to None does."""
    def __contains__(self, key: object) -> bool:
        """True for a key that scene files have."""
    def __iter__(self) -> Iterator[str]:
        """The keys that were set by hand, in the order in which they were set."""
    def __len__(self) -> int:
        """Number of keys that were set by hand."""
    def items(self) -> list[tuple[str, Any]]:
        """The keys that were set by hand, with their values."""
    def get(self, key: str, default: Any = None) -> Any:
        """The value of a key; `default` where it is not set, or scene files have no such key."""
    def update(self, settings: Mapping[str, Any]) -> None:
        """Sets several keys, one after the other."""
    def __eq__(self, other: object) -> bool:
        ...
    def __copy__(self) -> Scene:
        """A scene of its own with the same anatomy, settings, pose, shapes and time; pickle makes one in another
        process, which reads the files again that the scene names."""
    def describe(self, key: str) -> dict[str, Any]:
        """unit, range, words (its choices), meaning and default of a key; default: None where there is none, or where it is
        not always the same, as that of a preset."""
    def level(self, number: int) -> dict[str, Any]:
        """The settings of level `number` of live quality: 0 is the scene's own, each further one costs two thirds of the one
        before, down to about a thirtieth. scene.update(scene.level(5)) sets them. IndexError: no such level."""
    @staticmethod
    def keys() -> list[str]:
        """All keys of scene files: `mesh.NAME.tissue` stands for those of every mesh."""
    @property
    def name(self) -> str:
        """The scene's title."""
    @property
    def warnings(self) -> list[str]:
        """What is to be said of the scene, its files and its arrays: open edges, triangles that are none, and the like."""
    @property
    def tissues(self) -> list[str]:
        """Names of the tissues, in the order of their numbers in labels."""
    @property
    def meshes(self) -> list[str]:
        """Names of the placed meshes, in the order of their numbers in labels."""
    time: float
    """The moment that is shown, s."""
    pose: NDArray[np.float64]
    """World from probe space [4, 4], mm: x lateral, y elevation, z depth, the origin in the middle of the face. Taken
    only if it is a rotation with a shift; what is read is a copy that cannot be written into."""
    def contact(self, pose: ArrayLike | None = None) -> dict[str, float] | None:
        """Contact of the probe's face with the skin, at `pose` or where the probe is: `share` of the face that is coupled, 0
        to 1, and `depth`, mm, that it is pushed in, the mean over the face. None of a scene without [contact]."""
    def pose_on_skin(
        self,
        pose: ArrayLike | None = None,
        *,
        by: ArrayLike = (0, 0),
        press: float = 1.5,
        upright: bool = False,
    ) -> NDArray[np.float64]:
        """The pose [4, 4] on the skin that `pose`, or the probe's own, is slid to: by `by` mm along the skin, lateral and
        elevation, turned with it as a hand turns; pressed in by `press` mm where it is deepest. upright: turned so that it
        looks along the skin's normal. The scene's own pose stays. ValueError: a scene without [contact], no skin there."""
    def set_vertices(self, mesh: str, vertices: ArrayLike) -> None:
        """Moves the vertices [N, 3] (mm) of a mesh that was made of arrays; its tissue moves along. The next frame
        shows it without reading or building anything anew."""
    def placement(self, mesh: str) -> NDArray[np.float64]:
        """World from object space [4, 4] of a mesh."""
    def place(self, mesh: str, world_from_object: ArrayLike | None) -> None:
        """Places a mesh, whatever motions the scene has for it; None gives it back to these."""

class Frame:
    """An image, and on request what it was made of.

    Arrays besides the image are those named in frame(want=...), or of the simulator's last frame any.
    L scanlines, K axial samples, an image of H rows and W columns.
    """

    @property
    def bmode(self) -> NDArray[np.uint8]:
        """Grey levels [H, W]; 0 outside the sector."""
    @property
    def sector(self) -> NDArray[np.bool_]:
        """True inside the sector [H, W]."""
    @property
    def iq(self) -> NDArray[np.complex64]:
        """Complex baseband before time-gain compensation, relative to a perfect mirror [L, K]."""
    @property
    def envelope(self) -> NDArray[np.float32]:
        """Envelope after time-gain compensation [L, K]."""
    @property
    def log(self) -> NDArray[np.float32]:
        """Log-compressed envelope, 0 black to 1 white [L, K]."""
    @property
    def rf(self) -> NDArray[np.float32]:
        """Radio-frequency lines before time-gain compensation [L, n K], n samples to each axial one."""
    @property
    def labels(self) -> dict[str, NDArray[Any]]:
        """Labels (docs/labels.md): of samples [L, K], of pixels [H, W] with `pixel_` before the name."""
    @property
    def legend(self) -> dict[str, Any]:
        """Meaning of the labels: names of tissues and meshes, units."""
    @property
    def probe(self) -> dict[str, Any]:
        """Settings of the probe by their keys (docs/scenes.md), in the units of Scene.describe; angles as text."""
    @property
    def pose(self) -> NDArray[np.float64]:
        """World from probe space [4, 4]."""
    @property
    def timings(self) -> dict[str, float]:
        """Milliseconds on the device by stage; of frames that were made together, the mean."""
    @property
    def took(self) -> float:
        """Milliseconds by the clock until the image was read, without Python's part; of frames that were made together,
        that of one of them."""
    @property
    def axes(self) -> dict[str, NDArray[np.float64]]:
        """Coordinates in probe space, mm: x [W] and z [H] of pixels' centres, depth [K] of samples, rf_depth [n K] of
        those of `rf`, origins and directions [L, 3] of scanlines."""
    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, lower and upper edge of the image, mm, as matplotlib's imshow takes them."""
    @property
    def sampling_frequency(self) -> float:
        """Rate of the samples of `rf`, MHz."""
    def save(self, path: str | PathLike[str]) -> None:
        """Writes the frame as a file, as insonify.save does: `frame.save("image.png")`."""
    def _repr_png_(self) -> bytes:
        """The image as PNG, for notebooks."""

class Simulator:
    def __new__(
        cls,
        scene: Scene,
        *,
        device: str | None = None,
        tracer: Literal["auto", "bvh", "ray-query"] = "auto",
        quality: Literal["draft", "standard", "reference"] | None = None,
        validate: bool = False,
    ) -> Self: ...
    def frame(
        self,
        pose: ArrayLike | None = None,
        time: float | None = None,
        seed: int | None = None,
        *,
        number: int = 0,
        want: Want | Sequence[Want] = (),
    ) -> Frame:
        """Simulates a frame of the scene as it is, or at another pose, time or seed; the scene stays as it was.

        number: of the frame in a loop, by which the noise of the receiver differs. want: arrays to be read with it.
        RuntimeError: the simulator is closed, or another thread has it. InsonifyError: the device fails.
        """
    def frames_at_once(
        self,
        count: int,
        poses: Sequence[ArrayLike] | None,
        time: float | None,
        seeds: Sequence[int] | None,
        *,
        number: int,
        want: Sequence[Want],
    ) -> list[Frame]:
        """Simulates `count` frames of the scene at one time, together; `Simulator.frames` is for everybody.

        What moved, labels say as if the anatomy had moved before each of them.
        """
    def coloured(
        self, mode: str, pose: ArrayLike | None, time: float | None, seed: int | None, number: int
    ) -> dict[str, Any]:
        """As Simulator.doppler, which has the defaults."""
    def spectral(self, pose: ArrayLike | None, time: float | None, seed: int | None, number: int) -> dict[str, Any]:
        """As Simulator.spectrum, which has the defaults."""
    @property
    def scene(self) -> Scene:
        """The scene that is simulated."""
    @property
    def device(self) -> str:
        """Name of the device."""
    @property
    def tracer(self) -> str | None:
        """The tracer; None before the first frame."""
    @property
    def notes(self) -> list[str]:
        """What was said about scene and device so far."""
    @property
    def validation_messages(self) -> list[str]:
        """Messages of Vulkan's validation layers."""
    def close(self) -> None:
        """Gives the device's memory back. Frames keep what was read of them."""
    def __enter__(self) -> Self: ...
    def __exit__(self, *exception: object) -> None: ...
