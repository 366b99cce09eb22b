"""Objects of the library on the host: models, posed photographs, a network's input, scenes."""
from __future__ import annotations

import ctypes as c
import os
from typing import Any, Iterable, Sequence

import numpy as np

from ._c import (UsageError, _Camera, _Gaussians, _InputInfo, _InputOptions, _MeshArrays, _MeshInfo, _ModelInfo, _ModelOptions, _OrbitOptions, _SceneDifference,
            _SceneEditOptions, _SceneEditResult, _SceneFile, _SceneFormat, _SceneInfo, _SceneSaveOptions, _SceneStatistics, _View,
            _call, _lib, _numbers, _whole)
from ._dlpack import _array, _ndarray, _pointer
from ._handles import _Handle, _given, _path, _saved, _take_text, _texts
from ._values import Camera, Gaussians, _PIXELS, _are_rows, _tell_rows


def _memory(data: Any) -> Any:
    """Returns a copy of bytes for C."""
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
        """Makes a model with random weights; `config`: "paper", "small", "tiny" or "micro"; `fields`: changes to it, "FIELD=VALUE"."""
        changes, count = _texts(fields, "fields")
        options = _ModelOptions(config=config, fields=changes, num_fields=count, seed=seed, system=system)
        handle = c.c_void_p()
        _call("model_init", c.byref(options), c.byref(handle))
        return cls(handle)

    @classmethod
    def from_bytes(cls, data: bytes) -> Model:
        """Loads a model from the bytes of a model file."""
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
        """Loads a transforms.json, a cameras.json, a COLMAP model, or a folder with one."""
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


def scene_formats() -> list[dict[str, Any]]:
    """The formats of scene files, each with name, title, endings, reads, writes, sh_degree, lossless, lost, opened_by."""
    out = []
    for index in range(_lib.vsplat_scene_format_count()):
        f = _SceneFormat()
        _call("scene_format_get", c.c_size_t(index), c.byref(f))
        texts = {name: getattr(f, name).decode() for name in ("name", "title", "endings", "lost", "opened_by")}
        out.append({**texts, "endings": texts["endings"].split(), "reads": bool(f.reads), "writes": bool(f.writes),
                    "sh_degree": f.sh_degree, "lossless": bool(f.lossless)})
    return out


def describe_scene_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """format, title, version (as the file states it, or ""), axes (of positions in the file, or "") and bytes of a scene file."""
    s = _SceneFile()
    _call("scene_file_describe", _path(path), c.byref(s))
    return {**{name: getattr(s, name).decode() for name in ("format", "title", "version", "axes")}, "bytes": s.bytes}


def _values_of(s: Any) -> dict[str, Any]:
    """The fields of a struct, arrays as numpy's."""
    values = {name: getattr(s, name) for name, *_ in s._fields_ if name != "size"}
    return {name: np.array(v) if isinstance(v, c.Array) else v for name, v in values.items()}


class Scene(_Handle):
    """Gaussians with the settings to draw them with. Belongs to no device."""

    _noun = "scene"

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Reads a scene of any format (scene_formats())."""
        handle = c.c_void_p()
        _call("scene_load", _path(path), c.byref(handle))
        return cls(handle)

    @classmethod
    def from_bytes(cls, data: bytes) -> Scene:
        """Loads a scene from the bytes of a file, in any format."""
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

    def edit(self, box: tuple[Sequence[float], Sequence[float]] | None = None, sphere: tuple[Sequence[float], float] | None = None,
             min_opacity: float = 0.0, max_size: float = 0.0, remove_floaters: bool = False, up: Sequence[float] | None = None, upright: bool = False,
             from_axes: str | None = None, to_axes: str | None = None, scale: float = 0.0, translation: Sequence[float] | None = None,
             sh_degree: int = -1) -> dict[str, Any]:
        """Removes Gaussians, in the scene's own coordinates: those outside `box` (low and high corner) and `sphere` (centre, radius), of a
        lower opacity, with a larger standard deviation, or alone in space. Then turns the scene `upright` (`up`: its up direction before
        that), changes its axes (three letters say where +x, +y and +z point, R or L, U or D, F or B; "RDF" unless given), scales and moves
        it, and changes the degree of its spherical harmonics (-1: as it is). Returns how many were removed, by reason, and whether the axes
        changed from one hand to the other."""
        options = _SceneEditOptions(min_opacity=min_opacity, max_size=max_size, remove_floaters=remove_floaters, upright=upright,
                                    from_axes=from_axes, to_axes=to_axes, scale=scale, sh_degree=sh_degree)
        if box is not None:
            options.has_box, options.box_low, options.box_high = 1, *(_numbers(corner, c.c_double, 3, "box") for corner in box)
        if sphere is not None:
            options.sphere_centre, options.sphere_radius = _numbers(sphere[0], c.c_double, 3, "sphere"), sphere[1]
        if up is not None:
            options.up = _numbers(up, c.c_double, 3, "up")
        if translation is not None:
            options.translation = _numbers(translation, c.c_double, 3, "translation")
        result = _SceneEditResult()
        _call("scene_edit", self, c.byref(options), c.byref(result))
        return {**_values_of(result), "mirrored": bool(result.mirrored)}

    def statistics(self) -> dict[str, Any]:
        """What its Gaussians are like: count, not_finite, transparent (opacity below 0.1), invisible (below 1/255), huge, distant, low, high,
        low_1, high_99 (bounds of the means, and percentiles), median_opacity, median_size, largest_size, bytes."""
        s = _SceneStatistics()
        _call("scene_get_statistics", self, c.byref(s))
        return _values_of(s)

    def difference(self, other: Scene) -> dict[str, Any]:
        """How far its values are from those of a scene of the same Gaussians: the largest difference of means, scales, rotations (degrees),
        opacities and sh, the root mean square of each (..._rms), and in_order, whether the Gaussians are in the same order."""
        s = _SceneDifference()
        _call("scene_get_difference", self, _given(other, Scene, "other"), c.byref(s))
        return {**_values_of(s), "in_order": bool(s.in_order)}

    def to_bytes(self, format: str = "ply", spz_version: int = 0) -> bytes:
        """The bytes of the file that save() writes, in the format of that name."""
        return _saved("scene_save_memory_with", self, c.byref(_SceneSaveOptions(format=format, spz_version=spz_version)))

    def losses(self, format: str) -> list[str]:
        """What a file in that format would lose of this scene, a sentence for each field."""
        pointer = c.c_char_p()
        _call("scene_get_losses", self, _path(format, "format"), c.byref(pointer))
        return _take_text(pointer).splitlines()

    @classmethod
    def from_arrays(cls, means: Any, scales: Any, rotations: Any, opacities: Any, sh: Any, near: float | None = None,
                    up: Sequence[float] | None = None, offset: Sequence[float] | None = None, like: Scene | None = None) -> Scene:
        """Makes a scene from arrays: [K, 3], [K, 3], [K, 4], [K], [K, S, 3], as in Gaussians. `like`: the scene that the values come from; near
        plane, up, offset, mirror, antialias and whether they are surfels are taken from it unless given. Without it: `near`: the near plane in world units
        (the usual one by default); `up` (unknown by default); `offset`: the means plus this are in the world (0, 0, 0 by default)."""
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

    def save(self, path: str | os.PathLike[str], format: str | None = None, spz_version: int = 0) -> None:
        """Writes the format of that name (scene_formats()), or that of the path's ending; `spz_version`: 2 to 4 (0: 4)."""
        _call("scene_save_with", self, _path(path), c.byref(_SceneSaveOptions(format=format, spz_version=spz_version)))

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
    def antialias(self) -> bool:
        """Whether it is made to be drawn with anti-aliasing."""
        return bool(self._info().antialias)

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


class Mesh(_Handle):
    """The surface of a scene as triangles with a colour at each vertex, from Device.mesh(). Belongs to no device."""

    _noun = "mesh"

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Copies: positions float64 [V, 3] in the world, normals float32 [V, 3], colours float32 [V, 3], triangles uint32 [T, 3]."""
        info = _MeshInfo()
        _call("mesh_get_info", self, c.byref(info))
        v, t = info.vertices, info.triangles
        out = np.empty((v, 3)), np.empty((v, 3), np.float32), np.empty((v, 3), np.float32), np.empty((t, 3), np.uint32)
        _call("mesh_get_arrays", self, c.byref(_MeshArrays(vertex_capacity=v, triangle_capacity=t, **{
            name: each.ctypes.data for name, each in zip(("positions", "normals", "colours", "triangles"), out)})))
        return out

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes .glb or .ply, by the ending."""
        _call("mesh_save", self, _path(path))


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
    if sh.shape[1] not in (1, 4, 9, 16, 25):
        raise UsageError(f"sh has {sh.shape[1]} functions: 1, 4, 9, 16 or 25 expected")
    return degree
