"""Devices, their computations, and jobs."""
from __future__ import annotations

import ctypes as c
import json
import threading
import time
from typing import Any, Callable, Iterable, Sequence

import numpy as np

from ._c import (UsageError, _Camera, _DeviceInfo, _DeviceOptions, _FitOptions, _FitProgress, _JobOptions, _OpenclGaussians, _OpenclHandles,
            _OpenclPicture, _Picture, _PrepareOptions, _ReconstructOptions, _RenderOptions, _SceneInfo, _SceneKeepVisibleOptions, _SceneMeshOptions, _bytes, _call, _choice, _info, _lib, _number,
            _numbers, _on_end, _whole)
from ._dlpack import _array
from ._handles import Progress, _Handle, _Reporter, _given, _jobs, _jobs_lock, _take_text
from ._values import Camera, Gaussians, Picture, _new_picture, _picture_of
from ._scenes import Input, Mesh, Model, Scene, Views, _degree_of
from ._buffers import Buffer, _cl, _cl_call, _cl_mem, _on_device


class Device(_Handle):
    """An open OpenCL device, or a stream of one. One thread at a time may use it; another thread uses a stream() of it."""

    _noun = "device"

    def __init__(self, device: str | int = "", kernels: str = "auto", max_memory_gib: float = 0.0, precision: str = "fp32"):
        """`device`: an index (0, "0"), platform:device ("0:1"), a type ("cpu", "gpu", "acc") or a part of a name; "": $VSPLAT_DEVICE, else
        the first GPU, else the first device. `precision`: fp32, mixed or auto (vsplat/device.h)."""
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
        """Opens a device on a program's own OpenCL: its cl_context, its cl_device_id and, if the library shall enqueue there, its in-order
        cl_command_queue; as numbers (pyopencl's int_ptr)."""
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
        """The device's cl_context, cl_device_id and cl_command_queue, as numbers; they live as long as the device."""
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
        report = _Reporter(progress)
        options = _PrepareOptions(views=views, launch=launch, progress=report.function)
        report.call("device_prepare", self, _given(model, Model, "model"), c.byref(options))

    def reconstruct(self, model: Model, views: Input, seed: int | None = None, voxels: Any = None,
                    progress: Progress | None = None) -> Scene:
        """Runs one forward pass. `voxels`: int32, ascending, replaces the network's selection."""
        report = _Reporter(progress)
        options = _ReconstructOptions(has_seed=seed is not None, seed=seed or 0, progress=report.function)
        if voxels is not None:
            options.voxels, options.num_voxels = _voxels(voxels)
        handle = c.c_void_p()
        report.call("reconstruct", self, _given(model, Model, "model"), _given(views, Input, "views"), c.byref(options), c.byref(handle))
        return Scene(handle)

    def fit(self, views: Views, start: Scene | Model | None = None, steps: int = 0, seconds: float = 0.0, longest: int = -1, max_gaussians: int = 0,
               poses: bool = False, exposure: bool = False, antialias: bool = False, seed: int = 0, progress: Progress | None = None,
               strategy: str = "mcmc", consolidate: float = 0.0, background: Sequence[float] | str = "auto", masks: str = "object",
               invert_masks: bool = False, extent: str = "object", quality: str = "draft", near_plane: float = 0.0,
               depth: str = "none", depth_weight: float = 0.1) -> Scene:
        """Fits a scene to the views' photographs and measures it on held-out views: it is never worse than its start. `start`: a scene,
        the model that makes one from the views, or None: their sparse points, or random ones; `extent`: "object", "scene" for all that
        the pictures show, or "auto"; `quality`: "draft", "normal" or "high", for steps and size; `near_plane`: 0: the start's;
        `antialias`: fits it for drawing at any size; `steps`, `max_gaussians`: 0: by the number of views; `seconds`: 0: no limit;
        `longest`: longer side of the pictures in pixels (0: unscaled); `strategy`: "mcmc" adds Gaussians where opaque ones are, "error"
        splits those that cover the pictures' errors; `consolidate`: share of the Gaussians that stays for the last quarter of the steps
        (0: half of an object's). `background`, where transmittance is left: "auto", a colour (three numbers from 0 to 1), "random" or
        "sky"; `masks`, what is outside them: "object" (nothing) or "ignore" (takes no part); `depth`, what
        drawn depths are compared with: "metric", "relative" or "inverse", the depth pictures that the list names, or "points", COLMAP's
        points, with `depth_weight` (vsplat_fit_options). An exception in `progress` ends the fit; if it returns
        False, the result is the best scene so far."""
        if start is not None and not isinstance(start, Scene):
            _given(start, Model, "start, which is no vsplat.Scene,")
        options = _FitOptions(start=4 if start is None else 0 if isinstance(start, Scene) else 1, steps=steps, seconds=seconds, longest=longest, sh_degree=-1,
                                 max_gaussians=max_gaussians, poses=poses, exposure=exposure, antialias=antialias, seed=seed,
                                 density=_choice(strategy, "strategy", ("mcmc", "error")), consolidate=consolidate,
                                 extent=_choice(extent, "extent", ("object", "scene", "auto")),
                                 quality=_choice(quality, "quality", ("draft", "normal", "high")), near_plane=near_plane)
        plain = not isinstance(background, str)
        options.background = 1 if plain else (0, 2, 3)[_choice(background, "background", ("auto", "random", "sky"))]
        if plain:
            options.background_colour = _numbers(background, c.c_float, 3, "background")
        options.masks, options.invert_masks = _choice(masks, "masks", ("object", "ignore")), invert_masks
        options.depth = _choice(depth, "depth", ("none", "metric", "relative", "inverse", "points"))
        options.depth_weight = depth_weight
        if start is not None:
            setattr(options, "scene" if isinstance(start, Scene) else "model", start._as_parameter_)
        handle = c.c_void_p()
        _call("fit_create", self, _given(views, Views, "views"), c.byref(options), c.byref(handle))
        try:
            more, report = c.c_int32(1), _FitProgress()
            while more.value:
                _call("fit_step", handle, c.byref(report) if progress else None, c.byref(more))
                if progress and progress(report.phase.decode(), report.step / max(report.steps, 1)) is False:
                    _call("fit_stop", handle)
                    break
            out = c.c_void_p()
            _call("fit_get_scene", handle, c.byref(out))
            return Scene(out)
        finally:
            _lib.vsplat_fit_release(handle)

    refine = fit  # its earlier name

    def render(self, scene: Scene, camera: Camera, background: Sequence[float] = (1, 1, 1), near: float = 0.0,
               colour: bool = True, alpha: bool = True, depth: bool = True, supersample: int = 0, out: np.ndarray | None = None,
               premultiplied: bool = False, also: Iterable[str] = (), antialias: bool | None = None) -> Picture:
        """Draws the scene; `near`: the near plane, world units (0: the scene's); `supersample`: samples along a pixel's edge (0: chosen
        by the scene; render_backward() is for 1); `antialias`: whether what is smaller than a pixel fades instead of growing (None: as
        the scene says).

        `out`: an array that also receives the picture, in a program's pixel format: uint8, float16 or float32, [H, W, 3] over the
        background, or [H, W, 4] without it, with alpha straight or `premultiplied`. It may be a part of a larger frame, as in
        device.render(scene, camera, colour=False, alpha=False, depth=False, out=frame[:480, :640]).

        `also`: additional planes of the picture, among "expected", "median", "normal" and "ids"."""
        seen_from = _given(camera, Camera, "camera")._struct()
        picture, struct = _new_picture(camera, (colour, alpha, depth), also, out, premultiplied, "out")
        _call("render", self, _given(scene, Scene, "scene"), c.byref(seen_from), c.byref(_render_options(background, near, supersample, antialias)), c.byref(struct))
        return picture

    def keep_visible(self, scene: Scene, max_gaussians: int, cameras: Sequence[Camera] | None = None) -> None:
        """Keeps the Gaussians of the scene that are most visible, by their blending weights summed over pictures from `cameras` (None: 24 about
        the scene)."""
        options = _SceneKeepVisibleOptions(max_gaussians=max_gaussians)
        if cameras is not None:
            held = (_Camera * len(cameras))(*(_given(each, Camera, "cameras")._struct() for each in cameras))
            options.cameras, options.num_cameras = c.cast(held, c.c_void_p), len(cameras)
        _call("scene_keep_visible", self, _given(scene, Scene, "scene"), c.byref(options))

    def mesh(self, scene: Scene, cameras: Sequence[Camera] | None = None, voxels: int = 256, max_triangles: int = 0, least_part: float = 0.01,
             center: Sequence[float] | None = None, scale: float = 0.0, depth: str = "median", progress: Progress | None = None) -> Mesh:
        """The surface of the scene as triangles, seen from `cameras` (None: 48 all around it). `voxels`: along the longest edge of the box around
        the surface, or of the cube at `center` with the edge `scale`; `max_triangles`: 0: no limit; `least_part`: connected parts with a smaller share
        of the largest part's area are left out; `depth`: "median" or "expected"."""
        report = _Reporter(progress)
        options = _SceneMeshOptions(voxels=voxels, max_triangles=max_triangles, least_part=least_part, scale=scale,
                                    depth=_choice(depth, "depth", ("median", "expected")), progress=report.function)
        if center is not None:
            options.has_center, options.center = 1, _numbers(center, c.c_double, 3, "center")
        if cameras is not None:
            held = (_Camera * len(cameras))(*(_given(each, Camera, "cameras")._struct() for each in cameras))
            options.cameras, options.num_cameras = c.cast(held, c.c_void_p), len(cameras)
        handle = c.c_void_p()
        report.call("mesh_from_scene", self, _given(scene, Scene, "scene"), c.byref(options), c.byref(handle))
        return Mesh(handle)

    def reconstruct_async(self, model: Model, views: Input, seed: int | None = None, voxels: Any = None, progress: Progress | None = None,
                          on_end: Callable[[Job], Any] | None = None) -> Job:
        """reconstruct() as a job whose result is the scene. `progress` and `on_end` are called on the device's job thread."""
        report = _Reporter(progress)
        options = _ReconstructOptions(has_seed=seed is not None, seed=seed or 0, progress=report.function)
        if voxels is not None:
            options.voxels, options.num_voxels = _voxels(voxels)
        given = _given(model, Model, "model"), _given(views, Input, "views")
        return Job._begin("reconstruct_async", (self, *given, c.byref(options)), report, on_end, None)

    def render_async(self, scene: Scene, cameras: Sequence[Camera], background: Sequence[float] = (1, 1, 1), near: float = 0.0,
                     colour: bool = True, alpha: bool = True, depth: bool = True, supersample: int = 0,
                     out: Sequence[np.ndarray] | None = None, premultiplied: bool = False, also: Iterable[str] = (),
                     progress: Progress | None = None, on_end: Callable[[Job], Any] | None = None) -> Job:
        """render() from each camera, as a job whose result is a list of pictures. `out`: an array for each of them."""
        if out is not None and len(out) != len(cameras):
            raise UsageError(f"out has {len(out)} arrays: one for each of the {len(cameras)} cameras expected")
        report, also = _Reporter(progress), tuple(also)
        options = _render_options(background, near, supersample)
        options.progress = report.function
        seen_from, structs, pictures = (_Camera * len(cameras))(), (_Picture * len(cameras))(), []
        for i, camera in enumerate(cameras):
            seen_from[i] = _given(camera, Camera, f"cameras[{i}]")._struct()
            picture, structs[i] = _new_picture(camera, (colour, alpha, depth), also, out[i] if out is not None else None, premultiplied, f"out[{i}]")
            pictures.append(picture)
        arguments = self, _given(scene, Scene, "scene"), seen_from, c.c_size_t(len(cameras)), c.byref(options), structs
        return Job._begin("render_async", arguments, report, on_end, pictures, out)

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
        """render() into memory on the device: Buffers of float32 [H, W, 3], [H, W], [H, W] and uint8 [H, W, 4] (without the background), or objects
        with __dlpack__ on OpenCL. Returns when the picture is complete."""
        seen_from, size, kept = _given(camera, Camera, "camera")._struct(), (camera.height, camera.width), []
        picture = _OpenclPicture(premultiplied=bool(premultiplied))
        for name, value, shape, dtype in (("colour", colour, (*size, 3), "float32"), ("alpha", alpha, size, "float32"),
                                          ("depth", depth, size, "float32"), ("rgba", rgba, (*size, 4), "uint8")):
            setattr(picture, name, _cl_mem(value, shape, dtype, self, name, kept))
        self._finishing("opencl_render", _given(scene, Scene, "scene"), c.byref(seen_from),
                        c.byref(_render_options(background, near, supersample)), c.byref(picture))

    def render_backward_to_buffers(self, scene: Scene, camera: Camera, out: Gaussians, colour: Any = None, alpha: Any = None, depth: Any = None,
                                   background: Sequence[float] = (1, 1, 1), near: float = 0.0) -> None:
        """render_backward() between gradients in memory on the device: writes the arrays of `out`, shaped as in Gaussians (for surfels `scales`
        is [K, 2])."""
        seen_from, size, kept = _given(camera, Camera, "camera")._struct(), (camera.height, camera.width), []
        info, by = _given(scene, Scene, "scene")._info(), _OpenclPicture()
        for name, value, shape in (("colour", colour, (*size, 3)), ("alpha", alpha, size), ("depth", depth, size)):
            setattr(by, name, _cl_mem(value, shape, "float32", self, name, kept))
        to = _OpenclGaussians(**{name: _cl_mem(getattr(_given(out, Gaussians, "out"), name), shape, "float32", self, f"out.{name}", kept)
                                 for name, shape in _shapes_there(info, 2 if info.surfels else 3).items()})
        self._finishing("opencl_render_backward", scene, c.byref(seen_from), c.byref(_render_options(background, near)), c.byref(by), c.byref(to))

    def scene_from_buffers(self, means: Any, scales: Any, rotations: Any, opacities: Any, sh: Any, like: Scene | None = None) -> Scene:
        """Scene.from_arrays() for values in memory on the device, which are read, checked and copied."""
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
        """Returns the scene's memory on the device, as Buffers; `scales` of surfels is [K, 2]. Other programs may read and change it on the
        device's queue until another scene is drawn or the device is trimmed. Drawing shows the change; store_buffers() copies it to the scene."""
        info, struct = _given(scene, Scene, "scene")._info(), _OpenclGaussians()
        if info.count == 0:
            raise UsageError("the scene has no Gaussians, and no buffers")
        _call("opencl_scene_buffers", self, scene, c.byref(struct))
        return Gaussians(**{name: Buffer.from_cl_mem(self, getattr(struct, name), shape)
                            for name, shape in _shapes_there(info, 2 if info.surfels else 3).items()})

    def store_buffers(self, scene: Scene) -> None:
        """Reads the buffers of scene_buffers() back into the scene."""
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
    precisions = {"fp32": 0, "mixed": 1, "auto": 2}
    if name not in precisions:
        raise UsageError(f"precision is {name!r}: fp32, mixed or auto expected")
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
    def _begin(cls, name: str, arguments: tuple[Any, ...], report: _Reporter, on_end: Callable[[Job], Any] | None, pictures: Any,
               *kept: Any) -> Job:
        self = cls.__new__(cls)
        self._reporter, self._pictures, self._kept, self._on_end_problem = report, pictures, (arguments, kept), None
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
        if getattr(self, "_as_parameter_", None) and _lib is not None:  # frees the callback for its end, too
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
        self._reporter.call("job_result", self, c.byref(out))
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


def _render_options(background: Sequence[float], near: float, supersample: int = 1, antialias: bool | None = None) -> _RenderOptions:
    return _RenderOptions(background=_numbers(background, c.c_float, 3, "background"), near_plane=near, supersample=supersample,
                          antialias=0 if antialias is None else 1 if antialias else 2)
