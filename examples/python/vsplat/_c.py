"""libvsplat through ctypes: the library, its structs, calls and errors."""
from __future__ import annotations

import ctypes as c
import ctypes.util
import operator
import os
import pathlib
import shutil
import sys
from typing import Any

import numpy as np


class Error(RuntimeError):
    """A failure in the library. `status`: "usage", "file", "format", "input", "device", "compile", "memory", "cancelled", "internal" or
    "busy"."""

    def __init__(self, status: str, text: str):
        super().__init__(text)
        self.status = status


class UsageError(Error, ValueError):
    """An Error with status "usage": a value that the call does not accept. (A value of a wrong type is a TypeError.)"""

    def __init__(self, text: str):
        super().__init__("usage", text)


def _use_packed_driver(library: str) -> None:
    """What cmake/bundle.sh packs contains PoCL, which is used if the machine has no OpenCL driver. For the command its `pocl/environment`
    does the same."""
    folders = pathlib.Path(library).resolve().parents
    found = [(folder, driver) for folder in folders[:3] for driver in sorted(folder.glob("pocl/lib/*/libpocl.so.*"))]
    if not found:
        return
    (folder, driver), given = found[0], os.environ
    if not (given.get("OCL_ICD_VENDORS") or given.get("OCL_ICD_FILENAMES") or any(pathlib.Path("/etc/OpenCL/vendors").glob("*.icd"))):
        given["OCL_ICD_VENDORS"] = str(driver)
        print("vsplat: this machine has no OpenCL driver (nothing in /etc/OpenCL/vendors): uses PoCL, which came along, on the processor", file=sys.stderr)
    if given.get("OCL_ICD_VENDORS") == str(driver):  # it links kernels
        given["PATH"] = os.pathsep.join(filter(None, [given.get("PATH"), str(folder / "pocl/bin")]))
        given["LIBRARY_PATH"] = os.pathsep.join(
            filter(None, [given.get("LIBRARY_PATH"), *(str(folder / name) for name in ("pocl/link", "libc", "libcxx"))]))


def _library() -> c.CDLL:
    names = [os.environ.get("VSPLAT_LIBRARY")]
    here, command = pathlib.Path(__file__).resolve().parent, shutil.which("vsplat")
    prefixes = [here.parents[3]] if here.parts[-4:-1] == ("share", "vsplat", "python") else []
    prefixes += [here / "bundle"]  # of a wheel
    prefixes += [pathlib.Path(command).resolve().parent.parent] if command else []
    for prefix in prefixes:
        names += [str(p) for depth in ("lib*", "lib*/*") for p in sorted(prefix.glob(depth + "/libvsplat.so.?"))]
    names += [c.util.find_library("vsplat"), "libvsplat.so.1"]
    problem = None
    for name in filter(None, names):
        try:
            library = c.CDLL(name)
            _use_packed_driver(name)
            return library
        except OSError as e:
            problem = problem or e
    raise ImportError(f"libvsplat cannot be loaded ({problem}): VSPLAT_LIBRARY says where it is")


_lib = _library()
_lib.vsplat_last_error.restype = c.c_char_p
_lib.vsplat_status_name.restype = c.c_char_p
_lib.vsplat_version_string.restype = c.c_char_p
_lib.vsplat_scene_format_count.restype = c.c_size_t
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
    """Returns `count` numbers as a C array."""
    try:
        given = list(values)
    except TypeError:
        raise TypeError(f"{name} is {values!r}: {count} numbers expected") from None
    if len(given) != count:
        raise UsageError(f"{name} has {len(given)} numbers: {count} expected")
    return (type_ * count)(*(_number(value, f"{name}[{i}]") for i, value in enumerate(given)))


def _choice(value: Any, name: str, choices: tuple[str, ...]) -> int:
    """Returns an enumerator's number, its place in `choices`."""
    if value not in choices:
        raise UsageError(f"{name} is {value!r}: {', '.join(choices)} expected")
    return choices.index(value)


def _bytes(text: str | bytes, name: str) -> bytes:
    """Returns a string for C, which ends at the first NUL."""
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


def _name_options() -> None:
    """Messages call options as the functions here do."""
    names = {"vsplat_model_init": "Model.random()", "vsplat_model_load": "Model.load()", "vsplat_views_load": "pictures",
             "vsplat_device_options.max_memory_gib": "max_memory_gib", "vsplat_fit_options.longest": "longest",
             "vsplat_fit_options.max_gaussians": "max_gaussians", "vsplat_model_options.fields": "fields",
             "vsplat_reconstruct_options.seed": "seed", "vsplat_render_options.supersample": "supersample",
             **{f"vsplat_device_options.{name}": name for name in ("device", "kernels", "precision")},
             **{f"vsplat_input_options.{name}": name for name in ("auto_frame", "center", "force", "names", "scale", "view_count")}}
    texts = c.c_char_p * len(names)
    _call("option_names_set", texts(*map(str.encode, names)), texts(*map(str.encode, names.values())), c.c_size_t(len(names)))


_name_options()


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
                ("center", c.c_double * 3), ("scale", c.c_double), ("auto_frame", c.c_int32), ("crop", c.c_int), ("force", c.c_int32),
                ("view_count", c.c_int32)]


class _InputInfo(_Struct):
    _fields_ = [("size", c.c_size_t), ("views", c.c_int32), ("image", c.c_int32), ("center", c.c_double * 3), ("scale", c.c_double),
                ("up", c.c_double * 3)]


class _SceneInfo(_Struct):
    _fields_ = [("size", c.c_size_t), ("count", c.c_uint64), ("sh_degree", c.c_int32), ("near_plane", c.c_double),
                ("has_mirror", c.c_int32), ("mirror", c.c_double * 3), ("skipped_not_finite", c.c_uint64),
                ("skipped_huge_scale", c.c_uint64), ("skipped_zero_rotation", c.c_uint64), ("up", c.c_double * 3),
                ("offset", c.c_double * 3), ("surfels", c.c_int32), ("detail_pixel", c.c_double), ("detail_middle", c.c_double * 3),
                ("antialias", c.c_int32)]


class _SceneFormat(_Struct):
    _fields_ = [("size", c.c_size_t), ("name", c.c_char_p), ("title", c.c_char_p), ("endings", c.c_char_p), ("reads", c.c_int32),
                ("writes", c.c_int32), ("sh_degree", c.c_int32), ("lossless", c.c_int32), ("lost", c.c_char_p), ("opened_by", c.c_char_p)]


class _SceneEditOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("has_box", c.c_int32), ("box_low", c.c_double * 3), ("box_high", c.c_double * 3),
                ("sphere_radius", c.c_double), ("sphere_centre", c.c_double * 3), ("min_opacity", c.c_double), ("max_size", c.c_double),
                ("remove_floaters", c.c_int32), ("up", c.c_double * 3), ("upright", c.c_int32), ("from_axes", c.c_char_p),
                ("to_axes", c.c_char_p), ("scale", c.c_double), ("translation", c.c_double * 3), ("sh_degree", c.c_int32)]


class _SceneEditResult(_Struct):
    _fields_ = [("size", c.c_size_t), *((name, c.c_uint64) for name in ("count", "outside_box", "outside_sphere", "below_opacity", "above_size", "floaters")),
                ("mirrored", c.c_int32)]


class _SceneKeepVisibleOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("max_gaussians", c.c_uint64), ("cameras", c.c_void_p), ("num_cameras", c.c_size_t),
                ("progress", _progress), ("user", c.c_void_p)]


class _SceneMeshOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("cameras", c.c_void_p), ("num_cameras", c.c_size_t), ("voxels", c.c_int32), ("max_triangles", c.c_uint64),
                ("least_part", c.c_double), ("has_center", c.c_int32), ("center", c.c_double * 3), ("scale", c.c_double), ("depth", c.c_int),
                ("progress", _progress), ("user", c.c_void_p)]


class _MeshInfo(_Struct):
    _fields_ = [("size", c.c_size_t), ("triangles", c.c_uint64), ("textures", c.c_uint64), ("vertices", c.c_uint64)]


class _MeshArrays(_Struct):
    _fields_ = [("size", c.c_size_t), ("vertex_capacity", c.c_uint64), ("triangle_capacity", c.c_uint64),
                *((name, c.c_void_p) for name in ("positions", "normals", "colours", "triangles"))]


class _SceneFile(_Struct):
    _fields_ = [("size", c.c_size_t), ("format", c.c_char_p), ("title", c.c_char_p), ("version", c.c_char * 32), ("axes", c.c_char * 8),
                ("bytes", c.c_uint64)]


class _SceneStatistics(_Struct):
    _fields_ = [("size", c.c_size_t), *((name, c.c_uint64) for name in ("count", "not_finite", "transparent", "invisible", "huge", "distant")),
                *((name, c.c_double * 3) for name in ("low", "high", "low_1", "high_99")),
                *((name, c.c_double) for name in ("median_opacity", "median_size", "largest_size")), ("bytes", c.c_uint64)]


class _SceneDifference(_Struct):
    _fields_ = [("size", c.c_size_t), ("in_order", c.c_int32),
                *((name + end, c.c_double) for name in ("means", "scales", "rotations", "opacities", "sh") for end in ("", "_rms"))]


class _SceneSaveOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("format", c.c_char_p), ("spz_version", c.c_int32)]


class _Gaussians(_Struct):
    _fields_ = [("size", c.c_size_t), ("capacity", c.c_uint64), ("means", _f32), ("scales", _f32), ("rotations", _f32),
                ("opacities", _f32), ("sh", _f32)]


class _ReconstructOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("voxels", c.POINTER(c.c_int32)), ("num_voxels", c.c_size_t), ("selection", c.c_char_p),
                ("has_seed", c.c_int32), ("seed", c.c_uint64), ("near_plane", c.c_double), ("dump", c.c_char_p),
                ("assume_selected", c.c_double), ("progress", _progress), ("user", c.c_void_p), ("up", c.c_double * 3)]


class _RenderOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("background", c.c_float * 3), ("near_plane", c.c_double), ("progress", _progress),
                ("user", c.c_void_p), ("exact_tiles", c.c_int32), ("supersample", c.c_uint64), ("antialias", c.c_int)]


class _Picture(_Struct):
    _fields_ = [("size", c.c_size_t), ("capacity", c.c_uint64), ("colour", _f32), ("alpha", _f32), ("depth", _f32), ("data", c.c_void_p),
                ("type", c.c_int), ("channels", c.c_int32), ("row_bytes", c.c_size_t), ("premultiplied", c.c_int32), ("data_bytes", c.c_size_t),
                ("expected", _f32), ("median", _f32), ("normal", _f32), ("ids", c.POINTER(c.c_int32))]


class _JobOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("on_end", _on_end), ("user", c.c_void_p)]


class _Comparison(_Struct):
    _fields_ = [("size", c.c_size_t), ("psnr", c.c_double), ("ssim", c.c_double), ("psnr_cc", c.c_double)]


class _FitOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("start", c.c_int), ("scene", c.c_void_p), ("model", c.c_void_p), ("input", c.c_void_p),
                ("reconstruct", c.c_void_p), ("names", c.POINTER(c.c_char_p)), ("num_names", c.c_size_t), ("holdout", c.c_int),
                ("holdout_count", c.c_int32), ("holdout_names", c.POINTER(c.c_char_p)), ("num_holdout_names", c.c_size_t),
                ("steps", c.c_int64), ("seconds", c.c_double), ("max_gaussians", c.c_uint64), ("sh_degree", c.c_int32),
                ("longest", c.c_int32), ("freeze", c.c_uint32), ("seed", c.c_uint64), ("poses", c.c_int32), ("exposure", c.c_int32),
                ("checkpoint", c.c_char_p), ("resume", c.c_int32), ("near_plane", c.c_double), ("extent", c.c_int), ("quality", c.c_int),
                ("antialias", c.c_int32), ("density", c.c_int), ("consolidate", c.c_double), ("background", c.c_int),
                ("background_colour", c.c_float * 3), ("masks", c.c_int), ("invert_masks", c.c_int32), ("depth", c.c_int),
                ("depth_weight", c.c_float)]


class _FitProgress(_Struct):
    _fields_ = [("size", c.c_size_t), ("phase", c.c_char * 32), ("step", c.c_int64), ("steps", c.c_int64), ("gaussians", c.c_uint64),
                ("loss", c.c_double), ("psnr", c.c_double), ("seconds_left", c.c_double)]


class _OrbitOptions(_Struct):
    _fields_ = [("size", c.c_size_t), ("count", c.c_int32), ("width", c.c_int32), ("height", c.c_int32), ("radius", c.c_double),
                ("has_elevation", c.c_int32), ("elevation", c.c_double), ("has_up", c.c_int32), ("up", c.c_double * 3)]


def version() -> str:
    return _lib.vsplat_version_string().decode()


def _info(s: _DeviceInfo) -> dict[str, Any]:
    out = {name: getattr(s, name) for name, *_ in s._fields_ if name not in ("size", "kernels")}
    types = {1: "cpu", 2: "gpu", 3: "accelerator"}
    return {k: v.decode("utf-8", "replace") if isinstance(v, bytes) else v for k, v in out.items()} | {"type": types.get(s.type, "other")}


def devices() -> list[dict[str, Any]]:
    """Describes every OpenCL device: name, vendor, driver, memory (bytes), type, ..."""
    count = c.c_size_t()
    _call("device_count", c.byref(count))
    out = []
    for i in range(count.value):
        info = _DeviceInfo()
        _call("device_describe", c.c_size_t(i), c.byref(info))
        out.append(_info(info))
    return out
