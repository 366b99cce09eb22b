"""vsplat from Python: posed photographs in, Gaussians and pictures out, NumPy in and out.

A single file on libvsplat's C interface, by ctypes: nothing is compiled, and it serves every Python from 3.9 on. The library
is $VSPLAT_LIBRARY, else the one that this file was installed with, else the one beside an installed `vsplat` command, else
where the system looks. Only NumPy is needed; put the file's folder on PYTHONPATH.

    import vsplat
    device = vsplat.Device()                                # the first GPU, else the first device
    model = vsplat.Model.load()                             # the built-in model
    scene = device.reconstruct(model, vsplat.Views.load("photos").prepare(model))
    picture = device.render(scene, scene.orbit(8)[0])       # picture.colour: float32 [H, W, 3]
    scene.save("scene.ply")

Conventions are the library's: cameras have OpenCV axes (x right, y down, z forward) and pixel centres at +0.5, `w2c` is
[4, 4], world to camera; pictures are float32 [H, W, C], sRGB-encoded in 0 to 1; K Gaussians, S = (degree + 1)^2.
Arrays may be anything that NumPy takes, or that has __dlpack__ on the host's memory, as PyTorch's tensors: read where they
lie, where they are float32 without gaps; `out` is drawn into where it lies. What comes out are NumPy arrays, for
torch.from_dlpack(picture.colour) and the like. Buffer has values on the device, for programs with OpenCL of their own.
Failures are vsplat.Error, with the library's sentence and `status`. A Device, a stream of one (Device.stream) and what
is made with it are used by one thread at a time; while a call runs, other Python threads do.

Training, evaluation, data sets, contact sheets and camera paths are only in the C interface (vsplat/vsplat.h) and the
command."""
from __future__ import annotations

import atexit
import ctypes as c
import ctypes.util
import json
import math
import operator
import os
import pathlib
import shutil
import threading
import time
from dataclasses import dataclass, field
from typing import Any, Callable, Iterable, Sequence

import numpy as np

__all__ = ["Buffer", "Camera", "Device", "Error", "Gaussians", "Input", "Job", "Model", "Picture", "Scene", "UsageError", "Views", "compare",
           "devices", "version"]

Progress = Callable[[str, float], Any]
"""Told (stage, share done); returns False to stop."""


class Error(RuntimeError):
    """A failure in the library. `status`: "usage", "file", "format", "input", "device", "compile", "memory", "cancelled", "internal" or
    "busy"."""

    def __init__(self, status: str, text: str):
        super().__init__(text)
        self.status = status


class UsageError(Error, ValueError):
    """An Error of status "usage": a value that the call cannot take. (A value of a wrong type is a TypeError.)"""

    def __init__(self, text: str):
        super().__init__("usage", text)


# ------------------------------------------------------------------------------------------------------ the library


def _library() -> c.CDLL:
    names = [os.environ.get("VSPLAT_LIBRARY")]
    here, command = pathlib.Path(__file__).resolve(), shutil.which("vsplat")
    prefixes = [here.parents[3]] if here.parts[-4:-1] == ("share", "vsplat", "python") else []
    prefixes += [pathlib.Path(command).resolve().parent.parent] if command else []
    for prefix in prefixes:
        names += [str(p) for depth in ("lib*", "lib*/*") for p in sorted(prefix.glob(depth + "/libvsplat.so.?"))]
    names += [c.util.find_library("vsplat"), "libvsplat.so.1"]
    problem = None
    for name in filter(None, names):
        try:
            return c.CDLL(name)
        except OSError as e:
            problem = problem or e
    raise ImportError(f"libvsplat cannot be loaded ({problem}): VSPLAT_LIBRARY says where it is")


_lib = _library()
_lib.vsplat_last_error.restype = c.c_char_p
_lib.vsplat_status_name.restype = c.c_char_p
_lib.vsplat_version_string.restype = c.c_char_p
_f32 = c.POINTER(c.c_float)
_progress = c.CFUNCTYPE(c.c_int32, c.c_void_p, c.c_char_p, c.c_double)
_on_end = c.CFUNCTYPE(None, c.c_void_p, c.c_void_p)
_on_compile = c.CFUNCTYPE(None, c.c_void_p, c.c_char_p, c.c_int32)


def _call(name: str, *args: Any) -> None:
    status = getattr(_lib, "vsplat_" + name)(*args)
    if status:
        name, text = _lib.vsplat_status_name(status).decode(), _lib.vsplat_last_error().decode("utf-8", "replace")
        raise UsageError(text) if name == "usage" else Error(name, text)


_WHOLE = {t: (0 if t(-1).value > 0 else -(1 << 8 * c.sizeof(t) - 1), (1 << 8 * c.sizeof(t) - (t(-1).value < 0)) - 1)
          for t in (c.c_int32, c.c_int64, c.c_uint32, c.c_uint64, c.c_size_t)}


def _whole(value: Any, name: str, type_: Any = c.c_size_t) -> Any:
    """Checks an integer for C; ctypes alone would accept any, and drop the bits that do not fit."""
    least, most = _WHOLE[type_]
    try:
        number = operator.index(bool(value) if isinstance(value, np.bool_) else value)
    except TypeError:
        raise TypeError(f"{name} is {value!r}: a whole number expected") from None
    if not least <= number <= most:
        raise UsageError(f"{name} is {number}: {least} to {most} expected")
    return type_(number)


def _number(value: Any, name: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {value!r}: a number expected") from None


def _numbers(values: Any, type_: Any, count: int, name: str) -> Any:
    """`count` numbers as a C array."""
    try:
        given = list(values)
    except TypeError:
        raise TypeError(f"{name} is {values!r}: {count} numbers expected") from None
    if len(given) != count:
        raise UsageError(f"{name} has {len(given)} numbers: {count} expected")
    return (type_ * count)(*(_number(value, f"{name}[{i}]") for i, value in enumerate(given)))


def _bytes(text: str | bytes, name: str) -> bytes:
    """A string for C, where it ends at the first NUL."""
    if not isinstance(text, (str, bytes)):
        raise TypeError(f"{name} is {text!r}: a text expected")
    out = os.fsencode(text)
    if b"\0" in out:
        raise UsageError(f"{name} is {text!r}, which has a NUL character in it")
    return out


class _Struct(c.Structure):
    """A struct of the interface. It begins with its size; a newer or older library uses the fields that both know."""

    def __init__(self, **fields: Any):
        super().__init__(c.sizeof(type(self)))
        for name, value in fields.items():
            setattr(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        type_ = dict(self._fields_).get(name)
        if type_ in _WHOLE:
            value = _whole(value, name, type_)
        elif type_ in (c.c_float, c.c_double):
            value = _number(value, name)
        elif type_ is c.c_char_p and value is not None:
            value = _bytes(value, name)
        super().__setattr__(name, value)


class _OpenclHandles(_Struct):
    _fields_ = [("size", c.c_size_t), ("context", c.c_void_p), ("device", c.c_void_p), ("queue", c.c_void_p)]


class _OpenclPicture(_Struct):
    _fields_ = [("size", c.c_size_t), ("colour", c.c_void_p), ("alpha", c.c_void_p), ("depth", c.c_void_p), ("rgba", c.c_void_p),
                ("premultiplied", c.c_int32)]


class _OpenclGaussians(_Struct):
    _fields_ = [("size", c.c_size_t), ("means", c.c_void_p), ("scales", c.c_void_p), ("rotations", c.c_void_p), ("opacities", c.c_void_p),
                ("sh", c.c_void_p)]


class _DeviceInfo(_Struct):
    _fields_ = [("size", c.c_size_t), ("index", c.c_int32), ("platform", c.c_int32), ("device", c.c_int32), ("type", c.c_int),
                ("name", c.c_char * 256), ("vendor", c.c_char * 256), ("driver", c.c_char * 256), ("version", c.c_char * 256),
                ("platform_name", c.c_char * 256), ("memory", c.c_uint64), ("max_alloc", c.c_uint64), ("local_memory", c.c_uint64),
                ("max_work_group", c.c_uint64), ("compute_units", c.c_int32), ("event_profiling", c.c_int32), ("fp16", c.c_int32),
                ("fp64", c.c_int32), ("subgroups", c.c_int32), ("kernels", c.c_int)]


class _DeviceOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("device", c.c_char_p), ("kernels", c.c_int), ("gemm", c.c_int), ("max_memory_gib", c.c_double),
                ("on_compile", _on_compile), ("user", c.c_void_p), ("precision", c.c_int)]


class _PrepareOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("views", c.c_int32), ("launch", c.c_int32), ("progress", _progress), ("user", c.c_void_p)]


class _ModelOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("config", c.c_char_p), ("fields", c.POINTER(c.c_char_p)), ("num_fields", c.c_size_t),
                ("seed", c.c_uint64), ("encoder", c.c_char_p), ("system", c.c_char_p)]


class _ModelInfo(_Struct):
    _fields_ = [("size", c.c_size_t), ("image", c.c_int32), ("views", c.c_int32), ("max_views", c.c_int32), ("volume", c.c_int32),
                ("sh_degree", c.c_int32), ("max_gaussians", c.c_uint64), ("parameters", c.c_uint64), ("hash", c.c_int),
                ("use_views", c.c_int32)]


class _Camera(_Struct):
    _fields_ = [("size", c.c_size_t), ("width", c.c_int32), ("height", c.c_int32), ("fx", c.c_double), ("fy", c.c_double),
                ("cx", c.c_double), ("cy", c.c_double), ("w2c", c.c_double * 16), ("lens", c.c_int), ("lens_values", c.c_double * 8)]


class _View(_Struct):
    _fields_ = [("size", c.c_size_t), ("camera", _Camera), ("pixels", _f32), ("channels", c.c_int32), ("type", c.c_int),
                ("data", c.c_void_p), ("row_bytes", c.c_size_t), ("premultiplied", c.c_int32), ("data_bytes", c.c_size_t)]


class _InputOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("names", c.POINTER(c.c_char_p)), ("num_names", c.c_size_t), ("has_center", c.c_int32),
                ("center", c.c_double * 3), ("scale", c.c_double), ("auto_frame", c.c_int32), ("fit", c.c_int), ("force", c.c_int32),
                ("view_count", c.c_int32)]


class _InputInfo(_Struct):
    _fields_ = [("size", c.c_size_t), ("views", c.c_int32), ("image", c.c_int32), ("center", c.c_double * 3), ("scale", c.c_double),
                ("up", c.c_double * 3)]


class _SceneInfo(_Struct):
    _fields_ = [("size", c.c_size_t), ("count", c.c_uint64), ("sh_degree", c.c_int32), ("near_plane", c.c_double),
                ("has_mirror", c.c_int32), ("mirror", c.c_double * 3), ("skipped_not_finite", c.c_uint64),
                ("skipped_huge_scale", c.c_uint64), ("skipped_zero_rotation", c.c_uint64), ("up", c.c_double * 3),
                ("offset", c.c_double * 3), ("surfels", c.c_int32), ("detail_pixel", c.c_double), ("detail_middle", c.c_double * 3)]


class _Gaussians(_Struct):
    _fields_ = [("size", c.c_size_t), ("capacity", c.c_uint64), ("means", _f32), ("scales", _f32), ("rotations", _f32),
                ("opacities", _f32), ("sh", _f32)]


class _ReconstructOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("voxels", c.POINTER(c.c_int32)), ("num_voxels", c.c_size_t), ("selection", c.c_char_p),
                ("has_seed", c.c_int32), ("seed", c.c_uint64), ("near_plane", c.c_double), ("dump", c.c_char_p),
                ("assume_selected", c.c_double), ("progress", _progress), ("user", c.c_void_p), ("up", c.c_double * 3)]


class _RenderOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("background", c.c_float * 3), ("near_plane", c.c_double), ("progress", _progress),
                ("user", c.c_void_p), ("exact_tiles", c.c_int32), ("supersample", c.c_uint64)]


class _Picture(_Struct):
    _fields_ = [("size", c.c_size_t), ("capacity", c.c_uint64), ("colour", _f32), ("alpha", _f32), ("depth", _f32), ("data", c.c_void_p),
                ("type", c.c_int), ("channels", c.c_int32), ("row_bytes", c.c_size_t), ("premultiplied", c.c_int32), ("data_bytes", c.c_size_t),
                ("expected", _f32), ("median", _f32), ("normal", _f32), ("ids", c.POINTER(c.c_int32))]


class _JobOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("on_end", _on_end), ("user", c.c_void_p)]


class _Comparison(_Struct):
    _fields_ = [("size", c.c_size_t), ("psnr", c.c_double), ("ssim", c.c_double)]


class _RefineOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("start", c.c_int), ("scene", c.c_void_p), ("model", c.c_void_p), ("input", c.c_void_p),
                ("reconstruct", c.c_void_p), ("names", c.POINTER(c.c_char_p)), ("num_names", c.c_size_t), ("holdout", c.c_int),
                ("holdout_count", c.c_int32), ("holdout_names", c.POINTER(c.c_char_p)), ("num_holdout_names", c.c_size_t),
                ("steps", c.c_int64), ("seconds", c.c_double), ("max_gaussians", c.c_uint64), ("sh_degree", c.c_int32),
                ("longest", c.c_int32), ("freeze", c.c_uint32), ("seed", c.c_uint64), ("poses", c.c_int32), ("exposure", c.c_int32)]


class _RefineProgress(_Struct):
    _fields_ = [("size", c.c_size_t), ("phase", c.c_char * 32), ("step", c.c_int64), ("steps", c.c_int64), ("gaussians", c.c_uint64),
                ("loss", c.c_double), ("psnr", c.c_double), ("seconds_left", c.c_double)]


class _OrbitOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("count", c.c_int32), ("width", c.c_int32), ("height", c.c_int32), ("radius", c.c_double),
                ("has_elevation", c.c_int32), ("elevation", c.c_double), ("has_up", c.c_int32), ("up", c.c_double * 3)]


# ------------------------------------------------------------------------------------------------------------- DLPack


class _DLTensor(c.Structure):
    _fields_ = [("data", c.c_void_p), ("device_type", c.c_int32), ("device_id", c.c_int32), ("ndim", c.c_int32), ("code", c.c_uint8),
                ("bits", c.c_uint8), ("lanes", c.c_uint16), ("shape", c.POINTER(c.c_int64)), ("strides", c.POINTER(c.c_int64)),
                ("byte_offset", c.c_uint64)]


class _DLManagedTensor(c.Structure):
    _fields_ = [("tensor", _DLTensor), ("context", c.c_void_p), ("deleter", c.c_void_p)]


def _python(name: str, result: Any, *arguments: Any) -> Any:
    function = c.PYFUNCTYPE(result, *arguments)
    return function((name, c.pythonapi))


_capsule_is = _python("PyCapsule_IsValid", c.c_int, c.py_object, c.c_char_p)
_capsule_get = _python("PyCapsule_GetPointer", c.c_void_p, c.py_object, c.c_char_p)
_capsule_rename = _python("PyCapsule_SetName", c.c_int, c.py_object, c.c_char_p)
_deleter = c.PYFUNCTYPE(None, c.c_void_p)
_DL_NEW, _DL_USED = b"dltensor", b"used_dltensor"  # (a capsule keeps the pointer to its name)
_DL_HOST, _DL_OPENCL = (1, 3, 11), (4,)  # the types of devices whose memory the host reads; and OpenCL
_DL_DEVICES = {1: "the host", 2: "CUDA", 3: "CUDA's memory on the host", 4: "OpenCL", 7: "Vulkan", 8: "Metal", 9: "VPI", 10: "ROCm",
               11: "ROCm's memory on the host", 13: "CUDA's managed memory", 14: "oneAPI", 15: "WebGPU", 16: "Hexagon"}
_DL_KINDS = {0: "int", 1: "uint", 2: "float", 4: "bfloat", 5: "complex", 6: "bool"}


class _Taken:
    """A tensor that was taken out of a capsule; its memory is given back when this goes."""

    def __init__(self, value: Any, devices: tuple[int, ...], what: str):
        capsule = value if _is_capsule(value) else self._capsule_of(value, devices, what)
        if not _capsule_is(capsule, _DL_NEW):
            if _capsule_is(capsule, _DL_USED):
                raise UsageError(f"{what} is a DLPack capsule that was used before: each is taken once")
            raise TypeError(f"{what} gives no capsule with a DLPack tensor of version 0 (\"dltensor\")")
        self._address = None
        address = _capsule_get(capsule, _DL_NEW)
        managed = _DLManagedTensor.from_address(address)
        self.tensor = managed.tensor
        self._check(devices, what)  # while the capsule has it
        _capsule_rename(capsule, _DL_USED)
        self._address, self._delete = address, managed.deleter

    @staticmethod
    def _capsule_of(value: Any, devices: tuple[int, ...], what: str) -> Any:
        try:
            place = int(value.__dlpack_device__()[0]) if hasattr(value, "__dlpack_device__") else devices[0]
            capsule = value.__dlpack__() if place in devices else None
        except Exception as e:  # noqa: B902: whatever they raise for what they cannot give
            raise UsageError(f"{what} cannot be had by DLPack: {e}") from e
        if capsule is None:
            raise _wrong_device(place, devices, what)
        return capsule

    def _check(self, devices: tuple[int, ...], what: str) -> None:
        t = self.tensor
        if t.device_type not in devices:
            raise _wrong_device(t.device_type, devices, what)
        kind = f"{_DL_KINDS.get(t.code, 'kind ' + str(t.code))}{t.bits}{f'x{t.lanes}' if t.lanes != 1 else ''}"
        self.dtype = {"bool8": "bool"}.get(kind, kind)
        if self.dtype not in ("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float16", "float32", "float64"):
            raise TypeError(f"{what} holds {kind}: whole numbers, float16, float32 or float64 expected")
        if not 0 <= t.ndim <= 32 or t.ndim and not t.shape or any(t.shape[i] < 0 for i in range(t.ndim)):
            raise UsageError(f"{what} is a DLPack tensor of {t.ndim} dimensions whose shape is missing or negative")
        self.shape = tuple(t.shape[:t.ndim]) if t.ndim else ()
        itemsize, packed = np.dtype(self.dtype).itemsize, []
        for n in reversed(self.shape):
            packed.insert(0, packed[0] * max(self.shape[len(self.shape) - len(packed)], 1) if packed else itemsize)
        self.strides = tuple(t.strides[i] * itemsize for i in range(t.ndim)) if t.strides and t.ndim else tuple(packed)
        self.is_packed = 0 in self.shape or all(n == 1 or have == want for n, have, want in zip(self.shape, self.strides, packed))
        if not t.data and 0 not in self.shape:
            raise UsageError(f"{what} is a DLPack tensor without memory")

    @property
    def __array_interface__(self) -> dict[str, Any]:
        data = (self.tensor.data or 0) + self.tensor.byte_offset
        return {"shape": self.shape, "typestr": np.dtype(self.dtype).str, "data": (data, False), "strides": self.strides, "version": 3}

    def __del__(self):
        if getattr(self, "_address", None) and self._delete and _lib is not None:
            _deleter(self._delete)(self._address)


def _is_capsule(value: Any) -> bool:
    return type(value).__name__ == "PyCapsule"


def _wrong_device(found: int, wanted: tuple[int, ...], what: str) -> UsageError:
    names = [_DL_DEVICES.get(each, f"a device of DLPack type {each}") for each in (found, wanted[0])]
    return UsageError(f"{what} is in memory of {names[0]}: memory of {names[1]} expected")


def _ndarray(values: Any, what: str) -> np.ndarray:
    """As an array: the same memory where it has __dlpack__ or is a DLPack capsule."""
    if isinstance(values, np.ndarray):
        return values
    if isinstance(values, Buffer):
        raise TypeError(f"{what} is a vsplat.Buffer: an array on the host expected, as its numpy() gives one")
    if _is_capsule(values) or hasattr(values, "__dlpack__"):
        taken = _Taken(values, _DL_HOST, what)
        return np.asarray(taken) if 0 not in taken.shape else np.empty(taken.shape, taken.dtype)
    return np.asarray(values)


def _array(values: Any, shape: Sequence[int | None], what: str) -> np.ndarray:
    """float32, contiguous, of that shape (None: any size)."""
    given = _ndarray(values, what)
    try:
        out = np.ascontiguousarray(given, dtype=np.float32).reshape(given.shape)  # (it makes [1] of a number)
    except (TypeError, ValueError):
        raise TypeError(f"{what} holds {given.dtype}: numbers expected") from None
    if out.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, out.shape)):
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise UsageError(f"{what} has the shape {list(out.shape)}: [{wanted}] expected")
    return out


def _pointer(array: np.ndarray | None) -> Any:
    return array.ctypes.data_as(_f32) if array is not None else None


def _path(path: str | os.PathLike[str] | None, name: str = "path") -> bytes | None:
    return None if path is None else _bytes(os.fspath(path), name)


def _texts(texts: Iterable[str], name: str) -> tuple[Any, int]:
    if isinstance(texts, (str, bytes)):
        raise TypeError(f"{name} is {texts!r}: a list of texts expected")
    encoded = [_bytes(text, f"{name}[{i}]") for i, text in enumerate(texts)]
    return (c.c_char_p * len(encoded))(*encoded), len(encoded)


def _given(value: Any, kind: type, name: str) -> Any:
    """Checks that `name` is an instance of its class: C would take any pointer in its place."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} is a {type(value).__name__}: a vsplat.{kind.__name__} expected")
    return value


def _saved(name: str, *args: Any) -> bytes:
    """The bytes of the file that vsplat_{name} writes."""
    pointer, size = c.c_void_p(), c.c_size_t()
    _call(name, *args, c.byref(pointer), c.byref(size))
    try:
        return c.string_at(pointer, size.value)
    finally:
        _lib.vsplat_text_free(pointer)


def _take_text(pointer: c.c_char_p) -> str:
    try:
        return pointer.value.decode()
    finally:
        _lib.vsplat_text_free(pointer)


class _Telling:
    """A progress function for C. An exception in it ends the call, and is raised again after it."""

    def __init__(self, told: Progress | None):
        self.problem: BaseException | None = None

        def tell(_user: Any, stage: bytes, done: float) -> int:
            try:
                return 0 if told(stage.decode(), done) is False else 1
            except BaseException as e:  # noqa: B902: KeyboardInterrupt, too
                self.problem = e
                return 0

        self.function = _progress(tell) if told else _progress()

    def call(self, name: str, *args: Any) -> None:
        try:
            _call(name, *args)
        except Error:
            if self.problem:
                raise self.problem from None
            raise


_jobs: set[Job] = set()  # unfinished jobs, kept alive with the memory that they write
_jobs_lock = threading.Lock()


os.register_at_fork(after_in_child=_jobs.clear)  # they belong to the parent


@atexit.register
def _end_jobs() -> None:
    """Runs before the interpreter exits, since jobs call into it."""
    with _jobs_lock:
        left = list(_jobs)
    for job in left:
        job.cancel()
    for job in left:
        job.wait()


class _Handle:
    """A counted handle, released with its last owner."""

    _noun: str

    def __init__(self, handle: c.c_void_p):
        if not isinstance(handle, c.c_void_p) or not handle:
            raise TypeError(f"a vsplat.{type(self).__name__} is not made of a {type(handle).__name__}: its class methods and those of Device make "
                            "it")
        self._as_parameter_ = handle

    def __del__(self):
        handle = getattr(self, "_as_parameter_", None)
        if handle and _lib is not None:  # (None: the interpreter is shutting down)
            getattr(_lib, f"vsplat_{self._noun}_release")(handle)

    def __reduce__(self):
        raise TypeError(f"a vsplat.{type(self).__name__} can be neither copied nor pickled")


# ------------------------------------------------------------------------------------------------------------- values


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
            raise UsageError(f"a camera at {list(eye_)} looking at {list(at)} with {list(up_)} up: two places, and a direction that does not "
                                 "lie along the view, expected")
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
        """That of `colour`; the other arrays have theirs."""
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


def version() -> str:
    return _lib.vsplat_version_string().decode()


def _info(s: _DeviceInfo) -> dict[str, Any]:
    out = {name: getattr(s, name) for name, *_ in s._fields_ if name not in ("size", "kernels")}
    types = {1: "cpu", 2: "gpu", 3: "accelerator"}
    return {k: v.decode("utf-8", "replace") if isinstance(v, bytes) else v for k, v in out.items()} | {"type": types.get(s.type, "other")}


def devices() -> list[dict[str, Any]]:
    """Every OpenCL device: name, vendor, driver, memory (bytes), type, ..."""
    count = c.c_size_t()
    _call("device_count", c.byref(count))
    out = []
    for i in range(count.value):
        info = _DeviceInfo()
        _call("device_describe", c.c_size_t(i), c.byref(info))
        out.append(_info(info))
    return out


def compare(picture: Any, truth: Any) -> tuple[float, float]:
    """PSNR in dB and SSIM of [H, W, 3], values clamped to 0 to 1; SSIM is NaN if a side is under 11 pixels."""
    first = _array(picture, (None, None, 3), "picture")
    second = _array(truth, first.shape, "truth")
    out = _Comparison()
    _call("compare", _pointer(first), _pointer(second), c.c_int32(first.shape[1]), c.c_int32(first.shape[0]), c.byref(out), None)
    return out.psnr, out.ssim


# ------------------------------------------------------------------------------------------------------------ handles


def _memory(data: Any) -> Any:
    """A copy of bytes for C."""
    held = bytes(memoryview(data))
    return (c.c_char * len(held)).from_buffer_copy(held)


class Model(_Handle):
    """A network's weights and configuration. Belongs to no device."""

    _noun = "model"

    @classmethod
    def load(cls, path: str | os.PathLike[str] | None = None) -> Model:
        """Reads a model file; None: the built-in model."""
        handle = c.c_void_p()
        _call("model_load", _path(path), c.byref(handle))
        return cls(handle)

    @classmethod
    def random(cls, config: str = "paper", seed: int = 0, system: str = "vsplat", fields: Iterable[str] = ()) -> Model:
        """A model with random weights; `config`: "paper", "small", "tiny" or "micro"; `fields`: changes to it, "FIELD=VALUE"."""
        changes, count = _texts(fields, "fields")
        options = _ModelOptions(config=config, fields=changes, num_fields=count, seed=seed, system=system)
        handle = c.c_void_p()
        _call("model_init", c.byref(options), c.byref(handle))
        return cls(handle)

    @classmethod
    def from_bytes(cls, data: bytes) -> Model:
        """A model from the bytes of a model file."""
        handle, held = c.c_void_p(), _memory(data)
        _call("model_load_memory", held, c.c_size_t(len(held)), c.byref(handle))
        return cls(handle)

    def save(self, path: str | os.PathLike[str]) -> None:
        _call("model_save", self, _path(path))

    def to_bytes(self) -> bytes:
        """The bytes of the model file that save() writes."""
        return _saved("model_save_memory", self, c.c_int(1))

    @property
    def info(self) -> dict[str, int]:
        """image (pixels along an edge), views, max_views, volume, sh_degree, max_gaussians, parameters, use_views"""
        s = _ModelInfo()
        _call("model_get_info", self, c.byref(s))
        return {name: getattr(s, name) for name, *_ in s._fields_ if name not in ("size", "hash")}


class Views(_Handle):
    """Posed photographs, in files or in memory. Belongs to no device."""

    _noun = "views"

    @classmethod
    def load(cls, path: str | os.PathLike[str], pictures: str | os.PathLike[str] | None = None) -> Views:
        """A transforms.json, a cameras.json, a COLMAP model, or a folder with one."""
        handle = c.c_void_p()
        _call("views_load", _path(path), _path(pictures, "pictures"), c.byref(handle))
        return cls(handle)

    @classmethod
    def from_arrays(cls, pictures: Sequence[Any], cameras: Sequence[Camera]) -> Views:
        """`pictures`: [H, W, 3], or [H, W, 4] with straight alpha, each as large as its camera's; 0 to 1, or uint8 0 to 255."""
        if len(pictures) != len(cameras):
            raise UsageError(f"{len(pictures)} pictures and {len(cameras)} cameras: as many of both expected")
        kept, views = [], (_View * len(cameras))()
        for i, (picture, camera) in enumerate(zip(pictures, cameras)):
            values = _ndarray(picture, f"pictures[{i}]")
            views[i] = _View(camera=_given(camera, Camera, f"cameras[{i}]")._struct())
            if values.dtype.name not in _PIXELS or values.shape[:2] != (camera.height, camera.width) or not _are_rows(values):
                values = values / np.float32(255) if values.dtype == np.uint8 else values
                values = _array(values, (camera.height, camera.width, None), f"pictures[{i}]")
            _tell_rows(views[i], values)
            kept.append(values)
        handle = c.c_void_p()
        _call("views_create", views, c.c_size_t(len(views)), c.byref(handle))
        return cls(handle)

    def __len__(self) -> int:
        count = c.c_size_t()
        _call("views_count", self, c.byref(count))
        return count.value

    def prepare(self, model: Model, names: Sequence[str] | None = None, center: Sequence[float] | None = None,
                scale: float = 0.0, auto_frame: bool = False, view_count: int = 0, force: bool = False) -> Input:
        """Chooses views, places the object's cube and prepares the pictures for the network. `center`, `scale`: the cube in the world,
        if not the file's or, with `auto_frame`, estimated; `names`: the views to take, the reference view first."""
        options = _InputOptions(scale=scale, auto_frame=auto_frame, view_count=view_count, force=force)
        if names is not None:
            options.names, options.num_names = _texts(names, "names")
        if center is not None:
            options.has_center, options.center = 1, _numbers(center, c.c_double, 3, "center")
        handle = c.c_void_p()
        _call("input_prepare", _given(model, Model, "model"), self, c.byref(options), c.byref(handle))
        return Input(handle)


class Input(_Handle):
    """The chosen views as the network sees them. Belongs to no device."""

    _noun = "input"

    def _info(self) -> _InputInfo:
        s = _InputInfo()
        _call("input_get_info", self, c.byref(s))
        return s

    def __len__(self) -> int:
        return self._info().views

    @property
    def center(self) -> np.ndarray:
        """[3], centre of the cube in the world."""
        return np.array(self._info().center)

    @property
    def scale(self) -> float:
        """The cube's edge in world units."""
        return self._info().scale

    @property
    def up(self) -> np.ndarray | None:
        """[3], up direction in the world; None: unknown."""
        return _known(self._info().up)

    def camera(self, index: int) -> Camera:
        s = _Camera()
        _call("input_get_camera", self, _whole(index, "index"), c.byref(s))
        return Camera._of(s)

    def picture(self, index: int) -> np.ndarray:
        """float32 [image, image, 3]"""
        edge = self._info().image
        out = np.empty((edge, edge, 3), np.float32)
        _call("input_get_picture", self, _whole(index, "index"), _pointer(out), c.c_size_t(out.size))
        return out

    def orbit(self, count: int, width: int = 512, height: int = 512) -> list[Camera]:
        """Cameras on a circle about the object, at the input views' distance and elevation."""
        return _orbit("input", self, _OrbitOptions(count=count, width=width, height=height))


def _orbit(of: str, handle: _Handle, options: _OrbitOptions) -> list[Camera]:
    cameras = c.c_void_p()
    _call(f"cameras_orbit_{of}", handle, c.byref(options), c.byref(cameras))
    try:
        out = []
        for i in range(options.count):
            s = _Camera()
            _call("cameras_get", cameras, c.c_size_t(i), c.byref(s))
            out.append(Camera._of(s))
        return out
    finally:
        _lib.vsplat_cameras_release(cameras)


class Scene(_Handle):
    """Gaussians with the settings to draw them with. Belongs to no device."""

    _noun = "scene"

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Reads a 3DGS PLY, or one of surfels."""
        handle = c.c_void_p()
        _call("scene_load", _path(path), c.byref(handle))
        return cls(handle)

    @classmethod
    def from_bytes(cls, data: bytes) -> Scene:
        """A scene from the bytes of a PLY file."""
        handle, held = c.c_void_p(), _memory(data)
        _call("scene_load_memory", held, c.c_size_t(len(held)), None, c.byref(handle))
        return cls(handle)

    @classmethod
    def of(cls, *placed: Scene | tuple[Scene, Any]) -> Scene:
        """Combines several scenes, each in place or moved as by append(): Scene.of(a, (b, transform)) draws as one picture."""
        handle = c.c_void_p()
        _call("scene_create", c.byref(_SceneInfo()), c.byref(_Gaussians()), c.byref(handle))
        out = cls(handle)
        for each in placed:
            out.append(*(each if isinstance(each, tuple) else (each,)))
        return out

    def append(self, other: Scene, transform: Any = None) -> None:
        """Adds the Gaussians of another scene, moved by `transform` [4, 4] in the world: a rotation times a scale, and a
        translation."""
        _call("scene_append", self, _given(other, Scene, "other"), None if transform is None else _matrix(transform))

    def transform(self, transform: Any) -> None:
        """Moves the whole scene by [4, 4]."""
        _call("scene_transform", self, _matrix(transform))

    def remove(self, which: Any) -> None:
        """Removes Gaussians: bool [K], or their indices."""
        given, count = np.asarray(which), len(self)
        if given.dtype == bool:
            removed = given.astype(np.uint8)
        else:
            removed = np.zeros(count, np.uint8)
            for index in given.ravel().tolist():
                at = _whole(index, "which").value
                if at >= count:
                    raise UsageError(f"which names Gaussian {at}: the scene has {count}")
                removed[at] = 1
        removed = np.ascontiguousarray(removed.ravel())
        _call("scene_remove", self, removed.ctypes.data_as(c.POINTER(c.c_uint8)), c.c_size_t(removed.size))

    def crop(self, low: Sequence[float], high: Sequence[float]) -> None:
        """Keeps the Gaussians whose means lie between the two corners of a box in the world."""
        _call("scene_crop", self, _numbers(low, c.c_double, 3, "low"), _numbers(high, c.c_double, 3, "high"))

    def to_bytes(self) -> bytes:
        """The bytes of the PLY that save() writes."""
        return _saved("scene_save_memory", self)

    @classmethod
    def from_arrays(cls, means: Any, scales: Any, rotations: Any, opacities: Any, sh: Any, near: float | None = None,
                    up: Sequence[float] | None = None, offset: Sequence[float] | None = None, like: Scene | None = None) -> Scene:
        """[K, 3], [K, 3], [K, 4], [K], [K, S, 3], as in Gaussians. `like`: the scene that the values come from; near plane, up, offset,
        mirror and whether they are surfels are taken from it unless given. Without it: `near`: the near plane, world units (the usual
        one by default); `up` (unknown by default); `offset`: the means plus this are in the world (0, 0, 0 by default)."""
        arrays = _gaussians_of(means, scales, rotations, opacities, sh)
        info = _given(like, Scene, "like")._info() if like is not None else _SceneInfo()
        info.count, info.sh_degree = len(arrays.means), _degree_of(arrays.sh)
        info.near_plane = info.near_plane if near is None else near
        for name, value in (("up", up), ("offset", offset)):
            if value is not None:
                setattr(info, name, _numbers(value, c.c_double, 3, name))
        handle = c.c_void_p()
        _call("scene_create", c.byref(info), c.byref(arrays._struct(info.count)), c.byref(handle))
        return cls(handle)

    def update(self, means: Any = None, scales: Any = None, rotations: Any = None, opacities: Any = None, sh: Any = None) -> None:
        """Replaces values of the same Gaussians; those that are None stay unchanged."""
        info = self._info()
        k, given = info.count, {"means": means, "scales": scales, "rotations": rotations, "opacities": opacities, "sh": sh}
        shapes = {"means": (k, 3), "scales": (k, 3), "rotations": (k, 4), "opacities": (k,), "sh": (k, (info.sh_degree + 1) ** 2, 3)}
        arrays = Gaussians(**{name: None if v is None else _array(v, shapes[name], name) for name, v in given.items()})
        _call("scene_update", self, c.byref(arrays._struct(k)))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a standard 3DGS PLY."""
        _call("scene_save", self, _path(path))

    def _info(self) -> _SceneInfo:
        s = _SceneInfo()
        _call("scene_get_info", self, c.byref(s))
        return s

    def __len__(self) -> int:
        return self._info().count

    @property
    def sh_degree(self) -> int:
        return self._info().sh_degree

    @property
    def offset(self) -> np.ndarray:
        """[3]: the means plus this are in the world."""
        return np.array(self._info().offset)

    @property
    def near(self) -> float:
        """The near plane, world units."""
        return self._info().near_plane

    @property
    def up(self) -> np.ndarray | None:
        """[3], up direction in the world; None: unknown."""
        return _known(self._info().up)

    @property
    def surfels(self) -> bool:
        """Whether the Gaussians are flat: scales[:, 2] is 0."""
        return bool(self._info().surfels)

    def arrays(self) -> Gaussians:
        """Copies of all values: from_arrays(*vars(scene.arrays()).values(), like=scene) is the same scene."""
        info = self._info()
        out = Gaussians._empty(info.count, info.sh_degree)
        _call("scene_get_gaussians", self, c.byref(out._struct(info.count)))
        return out

    def orbit(self, count: int, width: int = 512, height: int = 512) -> list[Camera]:
        """Cameras on a circle about the visible part of the scene."""
        return _orbit("scene", self, _OrbitOptions(count=count, width=width, height=height))


def _matrix(transform: Any) -> Any:
    values = np.asarray(transform, dtype=np.float64)
    if values.shape != (4, 4):
        raise UsageError(f"transform has the shape {list(values.shape)}: [4, 4] expected")
    return (c.c_double * 16)(*values.ravel())


def _known(direction: Any) -> np.ndarray | None:
    out = np.array(direction)
    return out if out.any() else None


def _gaussians_of(means: Any, scales: Any, rotations: Any, opacities: Any, sh: Any) -> Gaussians:
    first = _array(means, (None, 3), "means")
    k = len(first)
    return Gaussians(first, _array(scales, (k, 3), "scales"), _array(rotations, (k, 4), "rotations"),
                     _array(opacities, (k,), "opacities"), _array(sh, (k, None, 3), "sh"))


def _degree_of(sh: np.ndarray) -> int:
    degree = int(np.sqrt(sh.shape[1])) - 1
    if sh.shape[1] not in (1, 4, 9, 16):
        raise UsageError(f"sh has {sh.shape[1]} functions: 1, 4, 9 or 16 expected")
    return degree


class _Pretended:
    """NumPy makes the capsule, and what frees it, of an array in place of a Buffer's memory, which it never reads."""

    def __init__(self, buffer: Buffer):
        self.buffer = buffer
        self.__array_interface__ = {"shape": buffer.shape, "typestr": buffer.dtype.str, "data": (buffer.cl_mem, False), "version": 3}


class Buffer:
    """Values in an OpenCL buffer of a device's context, for programs that have OpenCL of their own. It exchanges with them by `cl_mem`, and
    through DLPack (kDLOpenCL, whose data is a cl_mem) in both directions; the memory stays until the last who has it has gone.

    Nobody waits for another's queue: what others write here is to be finished before the library reads it. The library's own calls return
    when they are finished."""

    def __init__(self, device: Device, shape: Sequence[int], dtype: Any = "float32"):
        """A new one, of "float32" or "uint8"; what is in it is undefined."""
        self._begin(_given(device, Device, "device"), tuple(_whole(n, "shape").value for n in shape), dtype)
        if self._size == 0:
            raise UsageError(f"shape is {list(self.shape)}: OpenCL has no empty buffers")
        error = c.c_int32()
        self.cl_mem = _cl("clCreateBuffer", c.c_void_p)(c.c_void_p(device.opencl[0]), c.c_uint64(1), c.c_size_t(self._size), None, c.byref(error))
        _cl_check(error.value, f"making a buffer of {self._size} bytes")
        self._owned = True

    def _begin(self, device: Device, shape: tuple[int, ...], dtype: Any, name: str = "dtype") -> None:
        self.device, self.shape, self._owned, self._kept = device, shape, False, None
        self.dtype = np.dtype(dtype)
        if self.dtype not in (np.float32, np.uint8):
            raise TypeError(f"{name} is {self.dtype}: float32 or uint8 expected")
        self._size = _whole(math.prod(shape) * self.dtype.itemsize, "the buffer's size in bytes").value

    @classmethod
    def from_cl_mem(cls, device: Device, cl_mem: int, shape: Sequence[int], dtype: Any = "float32") -> Buffer:
        """Another's buffer, which is retained: `cl_mem` as a number (pyopencl's int_ptr)."""
        self = cls.__new__(cls)
        self._begin(_given(device, Device, "device"), tuple(_whole(n, "shape").value for n in shape), dtype)
        self.cl_mem = _whole(cl_mem, "cl_mem").value
        if not self.cl_mem:
            raise UsageError("cl_mem is 0: a buffer expected")
        there = c.c_size_t()
        _cl_call("clGetMemObjectInfo", "asking for a buffer's size", c.c_void_p(self.cl_mem), c.c_uint32(0x1102), c.c_size_t(c.sizeof(there)),
                 c.byref(there), None)
        if there.value < self._size:
            raise UsageError(f"cl_mem is a buffer of {there.value} bytes: {self._size} expected for {self.dtype} {list(self.shape)}")
        _cl_call("clRetainMemObject", "retaining a buffer", c.c_void_p(self.cl_mem))
        self._owned = True
        return self

    @classmethod
    def from_dlpack(cls, device: Device, value: Any) -> Buffer:
        """What has __dlpack__ on OpenCL, or a DLPack capsule of that: the same memory. It is to lie in the device's context, and without
        gaps."""
        return cls._of(_given(device, Device, "device"), _Taken(value, _DL_OPENCL, "value"), "value")

    @classmethod
    def _of(cls, device: Device, taken: _Taken, name: str) -> Buffer:
        if not taken.is_packed:
            raise UsageError(f"{name} has strides of {list(taken.strides)} bytes for {taken.dtype} {list(taken.shape)}: memory without gaps expected")
        self = cls.__new__(cls)
        self._begin(device, taken.shape, taken.dtype, name)
        self._kept, self.cl_mem = taken, taken.tensor.data
        if taken.tensor.byte_offset:
            region, error = (c.c_size_t * 2)(taken.tensor.byte_offset, self._size), c.c_int32()
            self.cl_mem = _cl("clCreateSubBuffer", c.c_void_p)(c.c_void_p(self.cl_mem), c.c_uint64(0), c.c_uint32(0x1220), region, c.byref(error))
            _cl_check(error.value, f"taking the part of {name} that begins {taken.tensor.byte_offset} bytes into its buffer")
            self._owned = True
        return self

    def __del__(self):
        if getattr(self, "_owned", False) and _lib is not None:
            _cl("clReleaseMemObject", c.c_int32)(c.c_void_p(self.cl_mem))

    def __reduce__(self):
        raise TypeError("a vsplat.Buffer can be neither copied nor pickled")

    def __dlpack_device__(self) -> tuple[int, int]:
        return _DL_OPENCL[0], self.device.info["index"]

    def __dlpack__(self, *, stream: Any = None, max_version: Any = None, dl_device: Any = None, copy: Any = None) -> Any:
        if stream is not None:
            raise UsageError(f"stream is {stream!r}: DLPack has none for OpenCL")
        if copy or dl_device is not None and tuple(dl_device) != self.__dlpack_device__():
            raise BufferError("a vsplat.Buffer gives the memory that it has: no copy, and none on another device")

        capsule = np.asarray(_Pretended(self)).__dlpack__()
        tensor = _DLManagedTensor.from_address(_capsule_get(capsule, _DL_NEW)).tensor
        tensor.device_type, tensor.device_id = self.__dlpack_device__()
        return capsule

    def numpy(self) -> np.ndarray:
        """A copy on the host."""
        out = np.empty(self.shape, self.dtype)
        self._transfer("clEnqueueReadBuffer", "reading a buffer", out)
        return out

    def write(self, values: Any) -> None:
        """Copies values of this shape and type into it."""
        given = np.ascontiguousarray(_ndarray(values, "values"), dtype=self.dtype)
        if given.shape != self.shape:
            raise UsageError(f"values has the shape {list(given.shape)}: {list(self.shape)} expected")
        self._transfer("clEnqueueWriteBuffer", "writing a buffer", given)

    def _transfer(self, name: str, doing: str, array: np.ndarray) -> None:
        _cl_call(name, doing, c.c_void_p(self.device.opencl[2]), c.c_void_p(self.cl_mem), c.c_uint32(1), c.c_size_t(0), c.c_size_t(self._size),
                 c.c_void_p(array.ctypes.data), c.c_uint32(0), None, None)


def _cl(name: str, result: Any) -> Any:
    """A function of the OpenCL that the library is linked with."""
    function = getattr(_lib, name)
    function.restype = result
    return function


def _cl_check(error: int, doing: str) -> None:
    if error:
        raise Error("device", f"{doing}: OpenCL's error {error}")


def _cl_call(name: str, doing: str, *args: Any) -> None:
    _cl_check(_cl(name, c.c_int32)(*args), doing)


def _on_device(device: Device, value: Any, name: str) -> Buffer:
    """A Buffer, or what has __dlpack__ on OpenCL as one."""
    if isinstance(value, Buffer):
        return value
    if not (_is_capsule(value) or hasattr(value, "__dlpack__")):
        raise TypeError(f"{name} is a {type(value).__name__}: a vsplat.Buffer, or what has __dlpack__ on OpenCL, expected")
    return Buffer._of(device, _Taken(value, _DL_OPENCL, name), name)


def _cl_mem(value: Any, shape: Sequence[int], dtype: str, device: Device, name: str, kept: list[Any]) -> int | None:
    """That of what is given, which has that shape and goes to `kept`."""
    if value is None:
        return None
    kept.append(_on_device(device, value, name))
    if kept[-1].shape != tuple(shape) or kept[-1].dtype != dtype:
        raise UsageError(f"{name} holds {kept[-1].dtype} {list(kept[-1].shape)}: {dtype} {list(shape)} expected")
    return kept[-1].cl_mem


class Device(_Handle):
    """An open OpenCL device, or a stream of one. One thread at a time may use it; another thread uses a stream() of it."""

    _noun = "device"

    def __init__(self, device: str | int = "", kernels: str = "auto", max_memory_gib: float = 0.0, precision: str = "fp32"):
        """`device`: an index (0, "0"), platform:device ("0:1"), a type ("cpu", "gpu", "acc") or a part of a name; "": $VSPLAT_DEVICE, else
        the first GPU, else the first device. `precision`: fp32 or mixed (vsplat/device.h)."""
        flavours = {"auto": 0, "cpu": 1, "gpu": 2}
        if kernels not in flavours:
            raise UsageError(f"kernels is {kernels!r}: auto, cpu or gpu expected")
        options = _DeviceOptions(device=_bytes(str(device), "device"), kernels=flavours[kernels], max_memory_gib=max_memory_gib,
                                 precision=_precision(precision))
        handle = c.c_void_p()
        _call("device_open", c.byref(options), c.byref(handle))
        super().__init__(handle)

    @classmethod
    def beside(cls, context: int, device: int, queue: int = 0, max_memory_gib: float = 0.0, precision: str = "fp32") -> Device:
        """On a program's own OpenCL: its cl_context, cl_device_id and, where the library is to enqueue there, its cl_command_queue, in order;
        as numbers (pyopencl's int_ptr)."""
        handles = _OpenclHandles(context=_whole(context, "context").value, device=_whole(device, "device").value,
                                 queue=_whole(queue, "queue").value)
        options = _DeviceOptions(max_memory_gib=max_memory_gib, precision=_precision(precision))
        handle = c.c_void_p()
        _call("opencl_open", c.byref(handles), c.byref(options), c.byref(handle))
        out = cls.__new__(cls)
        _Handle.__init__(out, handle)
        return out

    @property
    def opencl(self) -> tuple[int, int, int]:
        """Its cl_context, cl_device_id and cl_command_queue, as numbers; they live as long as it does."""
        handles = _OpenclHandles()
        _call("opencl_get_handles", self, c.byref(handles))
        return handles.context, handles.device, handles.queue

    def stream(self) -> Device:
        """A stream of the same device, for another thread; programs and weights are shared."""
        handle = c.c_void_p()
        _call("stream_create", self, c.byref(handle))
        out = Device.__new__(Device)
        _Handle.__init__(out, handle)
        return out

    @property
    def info(self) -> dict[str, Any]:
        s = _DeviceInfo()
        _call("device_get_info", self, c.byref(s))
        return _info(s)

    def cancel(self) -> None:
        """Stops the call that is using the device; callable from any thread. That call raises Error("cancelled")."""
        _call("device_cancel", self)

    def trim(self) -> None:
        """Frees device memory that is cached for the next call."""
        _call("device_trim", self)

    def prepare(self, model: Model, views: int = 0, launch: bool = False, progress: Progress | None = None) -> None:
        """Compiles and uploads what a reconstruction will need; with `launch`, also runs one with grey pictures."""
        told = _Telling(progress)
        options = _PrepareOptions(views=views, launch=launch, progress=told.function)
        told.call("device_prepare", self, _given(model, Model, "model"), c.byref(options))

    def reconstruct(self, model: Model, views: Input, seed: int | None = None, voxels: Any = None,
                    progress: Progress | None = None) -> Scene:
        """Runs one forward pass. `voxels`: int32, ascending, replaces the network's selection."""
        told = _Telling(progress)
        options = _ReconstructOptions(has_seed=seed is not None, seed=seed or 0, progress=told.function)
        if voxels is not None:
            options.voxels, options.num_voxels = _voxels(voxels)
        handle = c.c_void_p()
        told.call("reconstruct", self, _given(model, Model, "model"), _given(views, Input, "views"), c.byref(options), c.byref(handle))
        return Scene(handle)

    def refine(self, views: Views, start: Scene | Model, steps: int = 0, seconds: float = 0.0, longest: int = 512, max_gaussians: int = 0,
               poses: bool = False, exposure: bool = False, seed: int = 0, progress: Progress | None = None) -> Scene:
        """Fits a scene to the views' photographs and measures it on held-out views: it is never worse than its start. `start`: a scene,
        or the model that makes one from the views; `steps`, `max_gaussians`: 0: by the number of views; `seconds`: 0: no limit;
        `longest`: longer side of the pictures in pixels (0: unscaled). An exception in `progress` ends the fit; if it returns False,
        the result is the best scene so far."""
        if not isinstance(start, Scene):
            _given(start, Model, "start, which is no vsplat.Scene,")
        options = _RefineOptions(start=0 if isinstance(start, Scene) else 1, steps=steps, seconds=seconds, longest=longest, sh_degree=-1,
                                 max_gaussians=max_gaussians, poses=poses, exposure=exposure, seed=seed)
        setattr(options, "scene" if isinstance(start, Scene) else "model", start._as_parameter_)
        handle = c.c_void_p()
        _call("refinement_create", self, _given(views, Views, "views"), c.byref(options), c.byref(handle))
        try:
            more, told = c.c_int32(1), _RefineProgress()
            while more.value:
                _call("refinement_step", handle, c.byref(told) if progress else None, c.byref(more))
                if progress and progress(told.phase.decode(), told.step / max(told.steps, 1)) is False:
                    _call("refinement_stop", handle)
                    break
            out = c.c_void_p()
            _call("refinement_get_scene", handle, c.byref(out))
            return Scene(out)
        finally:
            _lib.vsplat_refinement_release(handle)

    def render(self, scene: Scene, camera: Camera, background: Sequence[float] = (1, 1, 1), near: float = 0.0,
               colour: bool = True, alpha: bool = True, depth: bool = True, supersample: int = 0, out: np.ndarray | None = None,
               premultiplied: bool = False, also: Iterable[str] = ()) -> Picture:
        """Draws the scene; `near`: the near plane, world units (0: the scene's); `supersample`: samples along a pixel's edge (0: chosen
        by the scene; render_backward() is for 1).

        `out`: an array that also receives the picture, in a program's pixel format: uint8, float16 or float32, [H, W, 3] over the
        background, or [H, W, 4] without it, with alpha straight or `premultiplied`. It may be a part of a larger frame, as in
        device.render(scene, camera, colour=False, alpha=False, depth=False, out=frame[:480, :640]).

        `also`: additional planes of the picture, among "expected", "median", "normal" and "ids"."""
        seen_from = _given(camera, Camera, "camera")._struct()
        picture, struct = _new_picture(camera, (colour, alpha, depth), also, out, premultiplied, "out")
        _call("render", self, _given(scene, Scene, "scene"), c.byref(seen_from), c.byref(_render_options(background, near, supersample)),
              c.byref(struct))
        return picture

    def reconstruct_async(self, model: Model, views: Input, seed: int | None = None, voxels: Any = None, progress: Progress | None = None,
                          on_end: Callable[[Job], Any] | None = None) -> Job:
        """reconstruct() as a job whose result is the scene. `progress` and `on_end` are called on the device's job thread."""
        told = _Telling(progress)
        options = _ReconstructOptions(has_seed=seed is not None, seed=seed or 0, progress=told.function)
        if voxels is not None:
            options.voxels, options.num_voxels = _voxels(voxels)
        given = _given(model, Model, "model"), _given(views, Input, "views")
        return Job._begin("reconstruct_async", (self, *given, c.byref(options)), told, on_end, None)

    def render_async(self, scene: Scene, cameras: Sequence[Camera], background: Sequence[float] = (1, 1, 1), near: float = 0.0,
                     colour: bool = True, alpha: bool = True, depth: bool = True, supersample: int = 0,
                     out: Sequence[np.ndarray] | None = None, premultiplied: bool = False, also: Iterable[str] = (),
                     progress: Progress | None = None, on_end: Callable[[Job], Any] | None = None) -> Job:
        """render() from each camera, as a job whose result is a list of pictures. `out`: an array for each of them."""
        if out is not None and len(out) != len(cameras):
            raise UsageError(f"out has {len(out)} arrays: one for each of the {len(cameras)} cameras expected")
        told, also = _Telling(progress), tuple(also)
        options = _render_options(background, near, supersample)
        options.progress = told.function
        seen_from, structs, pictures = (_Camera * len(cameras))(), (_Picture * len(cameras))(), []
        for i, camera in enumerate(cameras):
            seen_from[i] = _given(camera, Camera, f"cameras[{i}]")._struct()
            picture, structs[i] = _new_picture(camera, (colour, alpha, depth), also, out[i] if out is not None else None, premultiplied, f"out[{i}]")
            pictures.append(picture)
        arguments = self, _given(scene, Scene, "scene"), seen_from, c.c_size_t(len(cameras)), c.byref(options), structs
        return Job._begin("render_async", arguments, told, on_end, pictures, out)

    def render_backward(self, scene: Scene, camera: Camera, colour: Any = None, alpha: Any = None, depth: Any = None,
                        background: Sequence[float] = (1, 1, 1), near: float = 0.0) -> tuple[Gaussians, np.ndarray]:
        """Converts gradients of a loss by the picture ([H, W, 3], [H, W], [H, W]; None: zeros) to gradients by the Gaussians and by the
        camera's pose, float64 [6]: (omega, tau) at 0 of exp([omega, tau]) times w2c."""
        seen_from, size = _given(camera, Camera, "camera")._struct(), (camera.height, camera.width)
        by = Picture(None if colour is None else _array(colour, (*size, 3), "colour"),
                     None if alpha is None else _array(alpha, size, "alpha"), None if depth is None else _array(depth, size, "depth"))
        info = _given(scene, Scene, "scene")._info()
        out, pose = Gaussians._empty(info.count, info.sh_degree), np.empty(6)
        _call("render_backward", self, scene, c.byref(seen_from), c.byref(_render_options(background, near)),
              c.byref(_picture_of(by, camera)), c.byref(out._struct(info.count)), pose.ctypes.data_as(c.POINTER(c.c_double)))
        return out, pose

    def render_to_buffers(self, scene: Scene, camera: Camera, background: Sequence[float] = (1, 1, 1), near: float = 0.0, supersample: int = 0,
                          colour: Any = None, alpha: Any = None, depth: Any = None, rgba: Any = None, premultiplied: bool = False) -> None:
        """render() into memory on the device: Buffers of float32 [H, W, 3], [H, W], [H, W] and uint8 [H, W, 4] (without the background), or
        what has __dlpack__ on OpenCL. Returns when the picture is there."""
        seen_from, size, kept = _given(camera, Camera, "camera")._struct(), (camera.height, camera.width), []
        picture = _OpenclPicture(premultiplied=bool(premultiplied))
        for name, value, shape, dtype in (("colour", colour, (*size, 3), "float32"), ("alpha", alpha, size, "float32"),
                                          ("depth", depth, size, "float32"), ("rgba", rgba, (*size, 4), "uint8")):
            setattr(picture, name, _cl_mem(value, shape, dtype, self, name, kept))
        self._finishing("opencl_render", _given(scene, Scene, "scene"), c.byref(seen_from),
                        c.byref(_render_options(background, near, supersample)), c.byref(picture))

    def render_backward_to_buffers(self, scene: Scene, camera: Camera, out: Gaussians, colour: Any = None, alpha: Any = None, depth: Any = None,
                                   background: Sequence[float] = (1, 1, 1), near: float = 0.0) -> None:
        """render_backward() from gradients in memory on the device into such memory: what `out` has, shaped as Gaussians says (of surfels
        `scales` is [K, 2])."""
        seen_from, size, kept = _given(camera, Camera, "camera")._struct(), (camera.height, camera.width), []
        info, by = _given(scene, Scene, "scene")._info(), _OpenclPicture()
        for name, value, shape in (("colour", colour, (*size, 3)), ("alpha", alpha, size), ("depth", depth, size)):
            setattr(by, name, _cl_mem(value, shape, "float32", self, name, kept))
        to = _OpenclGaussians(**{name: _cl_mem(getattr(_given(out, Gaussians, "out"), name), shape, "float32", self, f"out.{name}", kept)
                                 for name, shape in _shapes_there(info, 2 if info.surfels else 3).items()})
        self._finishing("opencl_render_backward", scene, c.byref(seen_from), c.byref(_render_options(background, near)), c.byref(by), c.byref(to))

    def scene_from_buffers(self, means: Any, scales: Any, rotations: Any, opacities: Any, sh: Any, like: Scene | None = None) -> Scene:
        """Scene.from_arrays() of values in memory on the device: read, checked and copied."""
        info, kept, handle = _given(like, Scene, "like")._info() if like is not None else _SceneInfo(), [], c.c_void_p()
        first = _on_device(self, sh, "sh")
        if len(first.shape) != 3:
            raise UsageError(f"sh has the shape {list(first.shape)}: [any, any, 3] expected")
        info.count, info.sh_degree = first.shape[0], _degree_of(first)
        given = {"means": means, "scales": scales, "rotations": rotations, "opacities": opacities, "sh": first}
        struct = _OpenclGaussians(**{name: _cl_mem(given[name], shape, "float32", self, name, kept)
                                     for name, shape in _shapes_there(info, 3).items()})
        _call("opencl_scene_create", self, c.byref(info), c.byref(struct), c.c_uint32(0), None, c.byref(handle))
        return Scene(handle)

    def scene_buffers(self, scene: Scene) -> Gaussians:
        """Where the scene lies on the device, as Buffers; `scales` of surfels is [K, 2]. Others may read and change it on the device's queue
        until another scene is drawn, or the device is trimmed; what is drawn next shows the change, and store_buffers() takes it over."""
        info, struct = _given(scene, Scene, "scene")._info(), _OpenclGaussians()
        if info.count == 0:
            raise UsageError("the scene has no Gaussians, and no buffers")
        _call("opencl_scene_buffers", self, scene, c.byref(struct))
        return Gaussians(**{name: Buffer.from_cl_mem(self, getattr(struct, name), shape)
                            for name, shape in _shapes_there(info, 2 if info.surfels else 3).items()})

    def store_buffers(self, scene: Scene) -> None:
        """Reads what scene_buffers() gave back into the scene."""
        _call("opencl_scene_store", self, _given(scene, Scene, "scene"))

    def _finishing(self, name: str, *args: Any) -> None:
        event = c.c_void_p()
        _call(name, self, *args, c.c_uint32(0), None, c.byref(event))
        try:
            _cl_call("clWaitForEvents", "waiting for the device", c.c_uint32(1), c.byref(event))
        finally:
            _cl("clReleaseEvent", c.c_int32)(event)

    def profile(self, on: bool) -> None:
        """Starts or stops recording every kernel's time."""
        _call("device_profile", self, c.c_int32(bool(on)))

    def profile_page(self) -> str:
        """The recording as one self-contained HTML page."""
        text = c.c_char_p()
        _call("device_profile_text", self, 4, c.byref(text))
        return _take_text(text)

    def profile_rows(self) -> dict[str, Any]:
        """The recording: {"device", "driver", "wall_s", "wall", "peak_bytes", "kernels": [...], "stages": [...], "host": [...]}"""
        text = c.c_char_p()
        _call("device_profile_text", self, 1, c.byref(text))
        return json.loads(_take_text(text))


def _precision(name: str) -> int:
    precisions = {"fp32": 0, "mixed": 1}
    if name not in precisions:
        raise UsageError(f"precision is {name!r}: fp32 or mixed expected")
    return precisions[name]


def _shapes_there(info: _SceneInfo, scales: int) -> dict[str, tuple[int, ...]]:
    k = info.count
    return {"means": (k, 3), "scales": (k, scales), "rotations": (k, 4), "opacities": (k,), "sh": (k, (info.sh_degree + 1) ** 2, 3)}


class Job(_Handle):
    """A call that runs beside the program, on its device's job thread, one after the other. While a device has jobs, other calls that
    use it raise Error("busy"). A job keeps alive what it needs. Jobs that have not ended when the program exits are cancelled."""

    _noun = "job"
    _STATES = {1: "queued", 2: "running", 3: "done", 4: "failed", 5: "cancelled"}

    @classmethod
    def _begin(cls, name: str, arguments: tuple[Any, ...], told: _Telling, on_end: Callable[[Job], Any] | None, pictures: Any,
               *kept: Any) -> Job:
        self = cls.__new__(cls)
        self._told, self._pictures, self._kept, self._on_end_problem = told, pictures, (arguments, kept), None
        self._over, self._ends_on, begun = threading.Event(), None, threading.Event()

        def ended(_user: Any, _job: Any) -> None:
            begun.wait()
            self._ends_on = threading.get_ident()
            try:
                if on_end:
                    on_end(self)
            except BaseException as e:  # noqa: B902: result() raises it
                self._on_end_problem = e
            finally:
                self._kept, self._ends_on = None, None
                self._over.set()
                with _jobs_lock:
                    _jobs.discard(self)

        self._ended = _on_end(ended)
        handle = c.c_void_p()
        with _jobs_lock:
            _jobs.add(self)
        try:
            _call(name, *arguments, c.byref(_JobOptions(on_end=self._ended)), c.byref(handle))
            _Handle.__init__(self, handle)
        except BaseException:
            with _jobs_lock:
                _jobs.discard(self)
            raise
        finally:
            begun.set()
        return self

    def __del__(self):
        if getattr(self, "_as_parameter_", None) and _lib is not None:  # the callback for its end is freed with this
            _lib.vsplat_job_wait(self, c.c_double(-1), c.byref(c.c_int()))
        super().__del__()

    @property
    def state(self) -> str:
        """ "queued", "running", "done", "failed" or "cancelled"."""
        return self.wait(0)

    def wait(self, seconds: float | None = None) -> str:
        """Waits until the job has ended and `on_end` has returned, or for so many seconds. Returns its state then."""
        state, until = c.c_int(), float("inf") if seconds is None else time.monotonic() + _number(seconds, "seconds")
        while True:  # in short intervals, so that Ctrl-C is handled
            _call("job_wait", self, c.c_double(min(max(until - time.monotonic(), 0.0), 0.1)), c.byref(state))
            is_over = self._over.is_set() or self._ends_on == threading.get_ident()
            if is_over and state.value > 2 or time.monotonic() >= until:
                return self._STATES[state.value]

    def cancel(self) -> None:
        """Asks the job to stop; callable from any thread."""
        _call("job_cancel", self)

    def result(self) -> Any:
        """Waits, and returns the scene or the pictures. Raises what the call would have raised, or what `on_end` has raised."""
        self.wait()
        out = c.c_void_p()
        self._told.call("job_result", self, c.byref(out))
        if self._on_end_problem:
            raise self._on_end_problem
        return Scene(out) if self._pictures is None else self._pictures


def _voxels(voxels: Any) -> tuple[Any, int]:
    chosen = np.asarray(voxels)
    if chosen.size and chosen.dtype.kind not in "iu" or chosen.ndim != 1:
        raise TypeError(f"voxels has the shape {list(chosen.shape)} and holds {chosen.dtype}: a list of whole numbers expected")
    if chosen.size and not 0 <= chosen.min() <= chosen.max() < 1 << 31:
        raise UsageError(f"voxels holds {chosen.min()} to {chosen.max()}: numbers from 0 on expected")
    kept = np.ascontiguousarray(chosen, dtype=np.int32)
    return kept.ctypes.data_as(c.POINTER(c.c_int32)), kept.size


def _render_options(background: Sequence[float], near: float, supersample: int = 1) -> _RenderOptions:
    return _RenderOptions(background=_numbers(background, c.c_float, 3, "background"), near_plane=near, supersample=supersample)


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
    """Whether [H, W, C] lies as the library takes it: without gaps, but for those between rows."""
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
