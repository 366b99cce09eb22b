"""Cameras, pictures and Gaussians: plain values with NumPy arrays."""
from __future__ import annotations

import ctypes as c
from dataclasses import dataclass, field
from typing import Any, Iterable, Sequence

import numpy as np

from ._c import UsageError, _Camera, _Comparison, _Gaussians, _Picture, _View, _call, _whole
from ._dlpack import _array, _is_capsule, _ndarray, _pointer
from ._handles import _saved


@dataclass
class Camera:
    """A pinhole camera: pixels, and `w2c` [4, 4], a rigid transform from the world to OpenCV axes."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    w2c: np.ndarray = field(default_factory=lambda: np.eye(4))

    @classmethod
    def looking_at(cls, target: Sequence[float], eye: Sequence[float], up: Sequence[float] = (0, -1, 0), width: int = 512,
                   height: int = 512, fov: float = 50.0) -> Camera:
        """`fov`: degrees across the width. `up`, in the world, points up in the picture: use Scene.up if it is known; the default suits
        most of COLMAP's worlds."""
        at, eye_, up_ = np.asarray(target, float), np.asarray(eye, float), np.asarray(up, float)
        x = np.cross(at - eye_, up_)
        if not np.linalg.norm(x) > 1e-9 * np.linalg.norm(at - eye_) * np.linalg.norm(up_):
            raise UsageError(f"a camera at {list(eye_)} looking at {list(at)} with {list(up_)} up: two different places, and an upward "
                                 "direction that is not along the view, expected")
        z = (at - eye_) / np.linalg.norm(at - eye_)
        x /= np.linalg.norm(x)
        rotation = np.stack([x, np.cross(z, x), z])
        w2c = np.eye(4)
        w2c[:3, :3], w2c[:3, 3] = rotation, -rotation @ eye_
        f = 0.5 * width / np.tan(np.radians(fov) / 2)
        return cls(width, height, f, f, width / 2, height / 2, w2c)

    def _struct(self) -> _Camera:
        w2c = np.asarray(self.w2c, dtype=np.float64)
        if w2c.shape != (4, 4):
            raise UsageError(f"Camera.w2c has the shape {list(w2c.shape)}: [4, 4] expected")
        return _Camera(width=self.width, height=self.height, fx=self.fx, fy=self.fy, cx=self.cx, cy=self.cy,
                       w2c=(c.c_double * 16)(*w2c.ravel()))

    @classmethod
    def _of(cls, s: _Camera) -> Camera:
        return cls(s.width, s.height, s.fx, s.fy, s.cx, s.cy, np.array(s.w2c).reshape(4, 4))


_FORMATS = {"png": 1, "exr": 2, "exr-raw": 3, "jpeg": 4, "png-alpha": 5}


@dataclass
class Picture:
    """A drawn picture; arrays that were not requested are None."""

    colour: np.ndarray | None  # float32 [H, W, 3] over the background; may exceed 1
    alpha: np.ndarray | None  # float32 [H, W]
    depth: np.ndarray | None  # float32 [H, W]: sum of weight x camera z
    expected: np.ndarray | None = None  # float32 [H, W]: depth / alpha, 0 where alpha is 0
    median: np.ndarray | None = None  # float32 [H, W]: camera z where half of the light is absorbed, 0 if nowhere
    normal: np.ndarray | None = None  # float32 [H, W, 3]: sum of weight x normal, in camera axes, facing the camera
    ids: np.ndarray | None = None  # int32 [H, W]: index of the nearest Gaussian, -1: none

    def __dlpack__(self, **how: Any) -> Any:
        """The size of `colour`; the other arrays have their own."""
        return self._colour().__dlpack__(**how)

    def __dlpack_device__(self) -> tuple[int, int]:
        return self._colour().__dlpack_device__()

    def _colour(self) -> np.ndarray:
        if self.colour is None:
            raise UsageError("the picture has no colour")
        return self.colour

    def to_bytes(self, format: str = "png") -> bytes:
        """The bytes of a picture file: "png", "jpeg" (both colour only), "png-alpha" (with alpha; drawn over black), "exr", "exr-raw"
        (all three planes)."""
        if format not in _FORMATS:
            raise UsageError(f"format is {format!r}: {', '.join(_FORMATS)} expected")
        height, width = self._colour().shape[:2]
        arrays = {name: None if (a := getattr(self, name)) is None else _array(a, (height, width, 3) if name == "colour" else (height, width), name)
                  for name in ("colour", "alpha", "depth")}
        struct = _Picture(capacity=height * width, **{name: _pointer(a) for name, a in arrays.items()})
        return _saved("picture_save_memory", c.byref(struct), _whole(width, "width", c.c_int32), _whole(height, "height", c.c_int32),
                      _FORMATS[format])


@dataclass
class Gaussians:
    """float32 arrays of K Gaussians, or gradients by them; arrays that are not wanted are None."""

    means: np.ndarray | None  # [K, 3] relative to Scene.offset
    scales: np.ndarray | None  # [K, 3] standard deviations; the third of a surfel is 0
    rotations: np.ndarray | None  # [K, 4] quaternions w, x, y, z
    opacities: np.ndarray | None  # [K] in 0 to 1
    sh: np.ndarray | None  # [K, S, 3] colour = max(0, 0.5 + basis . sh)

    @classmethod
    def _empty(cls, count: int, sh_degree: int) -> Gaussians:
        shapes = (count, 3), (count, 3), (count, 4), (count,), (count, (sh_degree + 1) ** 2, 3)
        return cls(*(np.empty(shape, np.float32) for shape in shapes))

    def _struct(self, count: int) -> _Gaussians:
        names = ("means", "scales", "rotations", "opacities", "sh")
        return _Gaussians(capacity=count, **{name: _pointer(getattr(self, name)) for name in names})


def _compared(picture: Any, truth: Any) -> _Comparison:
    first = _array(picture, (None, None, 3), "picture")
    second = _array(truth, first.shape, "truth")
    out = _Comparison()
    _call("compare", _pointer(first), _pointer(second), c.c_int32(first.shape[1]), c.c_int32(first.shape[0]), c.byref(out), None)
    return out


def compare(picture: Any, truth: Any) -> tuple[float, float]:
    """PSNR in dB and SSIM of [H, W, 3], values clamped to 0 to 1; SSIM is NaN if a side is under 11 pixels."""
    out = _compared(picture, truth)
    return out.psnr, out.ssim


def psnr_cc(picture: Any, truth: Any) -> float:
    """PSNR in dB of [H, W, 3] after colour correction: the affine map of colours that brings `picture` nearest to `truth` by the squared
    error, clamped to 0 to 1."""
    return _compared(picture, truth).psnr_cc


_PIXELS = {"float32": 0, "float16": 1, "uint8": 2}


def _new_picture(camera: Camera, wanted: tuple[bool, bool, bool], also: Iterable[str], out: np.ndarray | None, premultiplied: bool,
                 name: str) -> tuple[Picture, _Picture]:
    """Arrays for the wanted planes, and the C struct that points to them."""
    size = (camera.height, camera.width)
    names = [each for each, is_wanted in zip(("colour", "alpha", "depth"), wanted) if is_wanted]
    for each in (also,) if isinstance(also, str) else also:
        if each not in ("expected", "median", "normal", "ids"):
            raise UsageError(f"also has {each!r}: expected, median, normal and ids are what it may have")
        names.append(each)
    arrays = {each: np.empty((*size, 3) if each in ("colour", "normal") else size, np.int32 if each == "ids" else np.float32) for each in names}
    picture = Picture(**{**{"colour": None, "alpha": None, "depth": None}, **arrays})
    struct = _picture_of(picture, camera)
    for each in ("expected", "median", "normal"):
        setattr(struct, each, _pointer(getattr(picture, each)))
    if picture.ids is not None:
        struct.ids = picture.ids.ctypes.data_as(c.POINTER(c.c_int32))
    if out is None:
        return picture, struct
    if not isinstance(out, np.ndarray) and (_is_capsule(out) or hasattr(out, "__dlpack__")):
        out = picture._kept = _ndarray(out, name)
    if not isinstance(out, np.ndarray) or out.dtype.name not in _PIXELS:
        raise TypeError(f"{name} is a {type(out).__name__}{f' of {out.dtype}' if isinstance(out, np.ndarray) else ''}: a numpy.ndarray of uint8, "
                        "float16 or float32 expected")
    if out.ndim != 3 or out.shape[:2] != size or out.shape[2] not in (3, 4):
        raise UsageError(f"{name} has the shape {list(out.shape)}: [{size[0]}, {size[1]}, 3 or 4] expected")
    if not out.flags.writeable or not _are_rows(out):
        raise UsageError(f"{name} has strides of {list(out.strides)} bytes{'' if out.flags.writeable else ' and is read-only'}: an array that may "
                         "be written, with the pixels of a row side by side and the rows one below the other, expected")
    _tell_rows(struct, out)
    struct.premultiplied = bool(premultiplied)
    return picture, struct


def _are_rows(array: np.ndarray) -> bool:
    """Whether [H, W, C] has the layout that the library accepts: without gaps, except between rows."""
    if array.ndim != 3:
        return False
    row, pixel, value = array.strides
    return value == array.itemsize and pixel == array.shape[2] * value and (row >= array.shape[1] * pixel or array.shape[0] == 1)


def _tell_rows(struct: _Picture | _View, array: np.ndarray) -> None:
    height, width, channels = array.shape
    row, pixel, _ = array.strides
    struct.data, struct.type, struct.channels = array.ctypes.data, _PIXELS[array.dtype.name], channels
    struct.row_bytes = row if height > 1 else 0
    struct.data_bytes = (height - 1) * row + width * pixel


def _picture_of(picture: Picture, camera: Camera) -> _Picture:
    return _Picture(capacity=camera.width * camera.height, colour=_pointer(picture.colour), alpha=_pointer(picture.alpha),
                    depth=_pointer(picture.depth))
