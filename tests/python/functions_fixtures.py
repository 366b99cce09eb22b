"""Valid values for every parameter of the C interface: handles, files, and others by their names.

A parameter whose name and type are not known here is an Unknown: a new function needs an entry."""
import ctypes as c
import json
import os
import pathlib
import sys

from c_headers import Headers, Unknown, set_field

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cli"))
GOLDEN = pathlib.Path(__file__).resolve().parents[1] / "golden"
# Whether long calls run to their end.
WHOLE = os.environ.get("VSPLAT_FUNCTIONS") == "whole"
OK = 0
EDGE = 16  # pixels of the views
ROOM = 1 << 14  # floats of every array
GAUSSIANS = 3
EDITS = ("scene_append", "scene_transform", "scene_remove", "scene_crop", "scene_edit", "scene_keep_visible")


class Api:
    """The library, with its headers' declarations."""

    def __init__(self):
        self.headers = Headers()
        self.functions = self.headers.bind(c.CDLL(os.environ["VSPLAT_LIBRARY"]))

    def call(self, name, *arguments):
        status = self.functions[name](*arguments)
        if status:
            raise RuntimeError(f"making what the test needs, {name} ended with {self.status(status)}: {self.last_error()}")

    def made(self, name, *arguments):
        out = c.c_void_p()
        self.call(name, *arguments, c.byref(out))
        return out.value

    def last_error(self):
        return self.functions["vsplat_last_error"]().decode()

    def status(self, status):
        return self.functions["vsplat_status_name"](status).decode()

    def struct(self, name, **values):
        return self.headers.struct(name, **values)


def texts(*all_):
    """const char* const*"""
    return (c.c_char_p * len(all_))(*(str(t).encode() for t in all_))


def floats(value=0.5):
    return (c.c_float * ROOM)(*([value] * ROOM))


def train_config():
    return json.dumps({"model": "micro", "steps": 1, "warmup": 0, "log_every": 1, "sheet_every": 0, "checkpoint_every": 1}).encode()


class Handles:
    """One handle of each kind, made when first requested. `orphans`: releases at once what each was made from."""

    def __init__(self, api, files, orphans=False):
        self.api, self.files, self.orphans, self.all, self.temporary = api, files, orphans, {}, []
        self.opened = api.made("vsplat_device_open", None)
        self.alive = []

    def __getitem__(self, kind):
        if kind not in self.all:
            self.all[kind] = self.make(kind)
        return self.all[kind]

    def release(self, kind, handle):
        self.api.functions[f"{kind}_release"](handle)

    def make(self, kind):
        if not hasattr(self, kind):
            raise Unknown(f"a handle of a kind that tests/python/functions_fixtures.py does not make: {kind}")
        outer, self.temporary = self.temporary, []
        out = getattr(self, kind)()
        for each in self.temporary:
            self.release(*each)
        self.temporary = outer
        return out

    def part(self, kind):
        """Makes the objects that another is made from."""
        if not self.orphans:
            return self[kind]
        out = self.make(kind)
        self.temporary.append((kind, out))
        return out

    def vsplat_device(self):
        return self.api.made("vsplat_stream_create", self.opened)

    def orphan_device(self):
        """Replaces the opened device by a stream of it."""
        stream = self["vsplat_device"]
        self.release("vsplat_device", self.opened)
        self.opened = stream

    def vsplat_model(self):
        return self.api.made("vsplat_model_init", c.byref(self.api.struct("vsplat_model_options", config=b"micro", seed=3)))

    def vsplat_views(self):
        views = (self.api.headers.structs["vsplat_view"] * 2)()
        pixels = (c.c_float * (EDGE * EDGE * 3))(*((i * 7919 % 101) / 101 for i in range(EDGE * EDGE * 3)))
        for i in range(2):
            views[i] = self.api.struct("vsplat_view")
            views[i].camera = camera(self.api, i)
            views[i].pixels = c.addressof(pixels)
        out = self.api.made("vsplat_views_create", views, 2)
        if self.orphans:
            pixels[:] = [9.0] * len(pixels)  # the call has copied them, as the header says
        return out

    def vsplat_input(self):
        return self.api.made("vsplat_input_prepare", self.part("vsplat_model"), self.part("vsplat_views"), None)

    def reconstruction(self, **values):
        options = self.api.struct("vsplat_reconstruct_options", num_voxels=GAUSSIANS, **values)
        set_field(options, "voxels", (c.c_int32 * GAUSSIANS)(3, 21, 40))  # whatever a random network selects
        return options

    def vsplat_scene(self):
        return self.api.made("vsplat_reconstruct", self.part("vsplat_device"), self.part("vsplat_model"), self.part("vsplat_input"),
                             c.byref(self.reconstruction()))

    def made_of_values(self):
        """Makes another scene."""
        info = self.api.struct("vsplat_scene_info", count=GAUSSIANS)
        return self.api.made("vsplat_scene_create", c.byref(info), c.byref(gaussians(self.api, GAUSSIANS)))

    def buffer(self, name):
        """Makes a separate cl_mem for each name."""
        if name not in self.all:
            theirs = self.api.struct("vsplat_opencl_handles")
            self.api.call("vsplat_opencl_get_handles", self["vsplat_device"], c.byref(theirs))
            create = c.CDLL("libOpenCL.so.1").clCreateBuffer
            create.restype, create.argtypes = c.c_void_p, [c.c_void_p, c.c_uint64, c.c_size_t, c.c_void_p, c.c_void_p]
            self.all[name] = create(theirs.context, 1, 4 * ROOM, None, None)  # CL_MEM_READ_WRITE
        return self.all[name]

    def surfels(self):
        """Makes a scene of surfels."""
        arrays = gaussians(self.api, GAUSSIANS)
        flat = (c.c_float * (3 * GAUSSIANS))(*([0.1, 0.1, 0] * GAUSSIANS))
        set_field(arrays, "scales", flat)
        info = self.api.struct("vsplat_scene_info", count=GAUSSIANS, surfels=1)
        return self.api.made("vsplat_scene_create", c.byref(info), c.byref(arrays))

    def vsplat_cameras(self):
        return self.api.made("vsplat_cameras_orbit_input", self.part("vsplat_input"), None)

    def vsplat_mesh(self):
        return self.api.made("vsplat_mesh_procedural", 1, 1)

    def surface(self):
        """Makes a mesh of a scene."""
        scene = self.made_of_values()
        self.temporary.append(("vsplat_scene", scene))
        return self.api.made("vsplat_mesh_from_scene", self.part("vsplat_device"), scene,
                             c.byref(self.api.struct("vsplat_scene_mesh_options", voxels=16)))

    def vsplat_dataset(self):
        return self.api.made("vsplat_dataset_open", texts(self.files.set), 1)

    def vsplat_sheet(self):
        out = self.api.made("vsplat_sheet_create", None)
        self.api.call("vsplat_sheet_add", out, c.byref(picture(self.api)), EDGE, EDGE)
        return out

    def vsplat_animation(self):
        out = self.api.made("vsplat_animation_create", None)
        self.api.call("vsplat_animation_add", out, c.byref(picture(self.api)), EDGE, EDGE)
        return out

    def fit(self):
        return self.api.struct("vsplat_fit_options", scene=self.part("vsplat_scene"), steps=100000)

    def vsplat_fit(self):
        return self.api.made("vsplat_fit_create", self.part("vsplat_device"), self.part("vsplat_views"), c.byref(self.fit()))

    def vsplat_job(self):
        out = self.api.made("vsplat_reconstruct_async", self.part("vsplat_device"), self.part("vsplat_model"), self.part("vsplat_input"),
                            c.byref(self.reconstruction()), None)
        self.api.call("vsplat_job_wait", out, -1.0, c.byref(c.c_int()))
        return out

    def vsplat_evaluation(self):
        return self.api.made("vsplat_evaluate", self.part("vsplat_device"), self.part("vsplat_model"), self.part("vsplat_dataset"),
                             c.byref(self.api.struct("vsplat_evaluate_options", sheet=1)))


class Files:
    """Files and folders for path parameters, made with the library."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.set, self.photos, self.run = self.folder / "set", self.folder / "photos", self.folder / "run"
        self.mesh, self.model, self.scene = self.folder / "mesh.obj", self.folder / "model.safetensors", self.folder / "scene.ply"
        self.texture = self.folder / "texture.png"
        self.checkpoint = GOLDEN / "lara_micro.ckpt"
        self.outputs = 0

    def make(self, api, handles):
        path = lambda p: str(p).encode()
        self.mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 3/2 2/3\nf 1/1 2/2 4/3\nf 1/1 4/2 3/3\nf 2/1 3/2 4/3\n")
        options = api.struct("vsplat_mesh_views_options", views=8, pixels=EDGE)
        api.call("vsplat_mesh_write_views", handles["vsplat_mesh"], c.byref(options), path(self.set / "object"))
        api.call("vsplat_model_save", handles["vsplat_model"], path(self.model))
        api.call("vsplat_input_save", handles["vsplat_input"], path(self.photos))
        api.call("vsplat_scene_save", handles["vsplat_scene"], path(self.scene))
        api.call("vsplat_picture_save", c.byref(picture(api)), EDGE, EDGE, 1, path(self.texture))
        run = api.struct("vsplat_train_options", data=texts(self.set), num_data=1, output=path(self.run))
        api.call("vsplat_train", handles["vsplat_device"], train_config(), c.byref(run), None)

    def output(self):
        """An existing folder, and a path in it that does not exist."""
        self.outputs += 1
        folder = self.folder / f"out-{self.outputs}"
        folder.mkdir()
        return folder / "made"


def camera(api, behind=0):
    out = api.struct("vsplat_camera", width=EDGE, height=EDGE, fx=20.0, fy=20.0, cx=EDGE / 2, cy=EDGE / 2)
    out.w2c[0] = out.w2c[10] = -1 if behind else 1
    out.w2c[11] = 2
    return out


def picture(api):
    return api.struct("vsplat_picture", capacity=ROOM // 3, colour=floats(), alpha=floats(), depth=floats())


def gaussians(api, count):
    """Values that fit any scene, with extra capacity."""
    out = api.struct("vsplat_gaussians", capacity=count)
    for field, value in (("means", 0.1), ("scales", 0.1), ("rotations", 0.5), ("opacities", 0.5), ("sh", 0.1)):
        set_field(out, field, floats(value))
    return out


class Values:
    """Makes a function's arguments for ctypes; `device` replaces that of the handles."""

    PATHS = {"cameras_load": "photos", "cameras_load_with": "photos", "views_load": "photos", "views_load_with": "photos", "mesh_load": "mesh", "model_load": "model", "model_import": "checkpoint",
             "model_inspect": "model", "model_verify": "model", "scene_load": "scene", "scene_load_with": "scene", "scene_file_describe": "scene",
             "picture_file_size": "texture", "picture_file_lens": "texture", "cameras_load_picture": "texture", "cameras_get_picture_size": "texture"}
    WRITERS = ("_save", "_save_as", "_save_jpeg", "_save_cameras", "_save_selection", "_save_sheet", "_write", "_report")
    NUMBERS = {"num_events": 1, "seconds": 0.0, "seconds_ago": 0.0, "selected": 0.5, "thickness": 0.1, "count": 1, "height": EDGE, "width": EDGE, "on": 0,
               "pictures": 1, "quality": 90, "sh_degree": 0, "side": EDGE, "use_views": 1, "passes": 1, "merge_cell": 0.5, "fit_epochs": 1, "view": 0, "views": 1, "capacity": ROOM,
               "exit_code": 3, "index": 0, "num_devices": 1, "num_paths": 1, "num_runs": 1, "num_views": 2, "gaussians": 100, "seed": 1, "status": 0,
               "dtype": 1, "format": 1, "which": 0}

    def __init__(self, api, files, handles):
        self.api, self.files, self.handles = api, files, handles

    def of(self, function):
        """Returns the arguments, and the empty folders that the function may write into."""
        first = self.files.outputs
        out = [self.value(function, p) for p in function.parameters]
        if function.name.endswith("_release"):  # an additional reference, which the call releases
            self.api.functions[function.name.replace("_release", "_retain")](out[0])
        return out, [self.files.folder / f"out-{i + 1}" for i in range(first, self.files.outputs)]

    def value(self, function, p):
        name, short = function.name, function.name[len("vsplat_"):]
        structs, api = self.api.headers.structs, self.api
        if p.base in api.headers.handles and not p.stars:
            if name == "vsplat_scene_surfels_to_gaussians":
                self.handles.all["surfels"] = self.handles.all.get("surfels") or self.handles.surfels()
                return self.handles["surfels"]
            if short in EDITS and p.name == "scene":  # the call changes it
                return self.handles.made_of_values()
            if name == "vsplat_mesh_from_scene" and p.base == "vsplat_scene":  # a random network may show no surface
                return self.handles.made_of_values()
            if name in ("vsplat_mesh_save", "vsplat_mesh_get_arrays"):  # only of a scene's mesh
                self.handles.all["surface"] = self.handles.all.get("surface") or self.handles.make("surface")
                return self.handles["surface"]
            if p.base == "vsplat_animation":  # finished once it is saved
                return self.handles.make(p.base)
            if name == "vsplat_device_profile_get":
                self.record(self.handles[p.base])
            return self.handles[p.base]
        if p.name.startswith("out_") and p.is_pointer and not p.const:
            if p.base in structs:
                return api.struct(p.base)
            return c.create_string_buffer(b"\x5a" * (4 * ROOM), 4 * ROOM)
        if p.base in structs and p.stars == 1 and p.const:
            return self.struct(name, p)
        if p.base == "char" and p.stars == 1:
            return self.text(short, p)
        if p.base == "char" and p.stars == 2 and p.const:
            return texts(*{"fields": ["vsplat_device_options.device"], "files": ["0000.png"], "names": ["device"], "paths": [self.files.set],
                           "runs": [self.files.run]}[p.name])
        if p.base == "vsplat_device" and p.stars:
            return (c.c_void_p * 1)(self.handles["vsplat_device"])
        if p.base in api.headers.prototypes:
            return self.function(p)
        if p.base == "float" and (p.stars or p.lengths) and p.const:
            return floats()
        if p.base == "double" and (p.stars or p.lengths) and p.const:
            known = {"eye": (0, 0, -2), "target": (0, 0, 0), "up": (0, 1, 0), "low": (-1, -1, -1), "high": (1, 1, 1),
                     "transform": (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1)}[p.name]
            return (c.c_double * len(known))(*known)
        if p.name == "removed":
            return (c.c_uint8 * GAUSSIANS)(1)
        if short == "scene_remove" and p.name == "count":
            return GAUSSIANS
        if p.base == "cl_event" and p.const:
            return (c.c_void_p * 1)(self.event())
        if short in ("model_load_memory", "scene_load_memory"):
            file = self.files.model if short.startswith("model") else self.files.scene
            held = file.read_bytes()
            return c.create_string_buffer(held, len(held)) if p.name == "bytes" else len(held)
        if p.base == "void":
            return None if p.name == "user" else c.create_string_buffer(16)
        if p.name == "bytes":
            return 16 if name == "vsplat_file_write" else 0
        if not p.is_pointer and not p.lengths and p.name in self.NUMBERS:
            return 1000 if name == "vsplat_plan_render" and p.name == "count" else self.NUMBERS[p.name]
        raise Unknown(f"{name}: tests/python/functions_fixtures.py does not know what to give for {p.base}{'*' * p.stars} {p.name}")

    def text(self, short, p):
        if p.name == "path":
            if short in self.PATHS:
                return c.create_string_buffer(str(getattr(self.files, self.PATHS[short])).encode())
            if short in ("mesh_save", "scene_save", "scene_save_with"):  # the ending names the format
                return c.create_string_buffer(str(self.files.output()).encode() + b".ply")
            if short.endswith(self.WRITERS):
                return c.create_string_buffer(str(self.files.output()).encode())
        elif p.name == "folder":
            return c.create_string_buffer(str(self.files.photos if short == "cameras_find_picture" else self.files.output()).encode())
        elif p.name == "text" and not p.const:
            out = c.c_void_p()
            self.api.call("vsplat_views_get_files", self.handles["vsplat_views"], c.byref(out))
            return out
        known = {"config": train_config(), "label": b"a label", "text": b"of this rank", "what": b"model", "name": b"micro", "format": b"ply",
                 "pictures": str(self.files.photos).encode(),
                 "texture": str(self.files.texture).encode()}
        if p.name not in known:
            raise Unknown(f"vsplat_{short}: tests/python/functions_fixtures.py does not know whether {p.name} is read or written")
        return c.create_string_buffer(known[p.name])

    def function(self, p):
        if p.name == "work":
            trim = self.api.functions["vsplat_device_trim"]
            body = lambda user, device, index, item: trim(device)
        elif p.base in ("vsplat_log_function", "vsplat_rank_text_function"):
            body = lambda user, number, text: None
        else:
            raise Unknown(f"tests/python/functions_fixtures.py does not know what a {p.base} is to do")
        out = self.api.headers.prototypes[p.base](body)
        self.handles.alive.append(out)
        return out

    def ending(self):
        """A progress function that stops its call."""
        out = self.api.headers.prototypes["vsplat_progress_function"](lambda user, stage, done: 0)
        self.handles.alive.append(out)
        return c.cast(out, c.c_void_p).value

    def record(self, device):
        """A profile of a drawing."""
        self.api.call("vsplat_device_profile", device, 1)
        self.api.call("vsplat_render", device, self.handles["vsplat_scene"], c.byref(camera(self.api)), None, c.byref(picture(self.api)))
        self.api.call("vsplat_device_profile", device, 0)

    def event(self):
        """A job that draws, finished or not."""
        if "event" not in self.handles.all:
            self.handles.all["event"] = self.api.made("vsplat_opencl_render", self.handles["vsplat_device"], self.handles["vsplat_scene"],
                                                      c.byref(camera(self.api)), None,
                                                      c.byref(self.api.struct("vsplat_opencl_picture", alpha=self.handles.buffer("alpha"))), 0, None)
        return self.handles.all["event"]

    def struct(self, function, p):
        api, handles = self.api, self.handles
        if p.base == "vsplat_camera":
            return camera(api)
        if p.base == "vsplat_picture":
            return picture(api)
        if p.base == "vsplat_gaussians":
            return gaussians(api, GAUSSIANS if function == "vsplat_scene_create" else self.scene_info().count)
        if p.base == "vsplat_scene_info":
            return self.scene_info() if "opencl" in function else api.struct("vsplat_scene_info", count=GAUSSIANS)
        if p.base == "vsplat_view":
            views = (api.headers.structs["vsplat_view"] * 2)(api.struct("vsplat_view"), api.struct("vsplat_view"))
            pixels = floats()
            handles.alive.append(pixels)
            for i in range(2):
                views[i].camera, views[i].pixels = camera(api, i), c.addressof(pixels)
            return views
        if p.base == "vsplat_opencl_handles":
            out = api.struct(p.base)
            api.call("vsplat_opencl_get_handles", handles["vsplat_device"], c.byref(out))
            return out
        if p.base == "vsplat_opencl_gaussians" and p.name == "buffers":
            out = api.struct(p.base)
            api.call("vsplat_opencl_scene_buffers", handles["vsplat_device"], handles["vsplat_scene"], c.byref(out))
            return out
        if p.base == "vsplat_scene_mesh_options":
            return api.struct(p.base, voxels=16)
        if p.base == "vsplat_mesh_arrays":
            out = api.struct(p.base, vertex_capacity=ROOM // 6, triangle_capacity=ROOM // 6)
            positions = floats()
            handles.alive.append(positions)
            set_field(out, "positions", positions)
            return out
        if p.base == "vsplat_mesh_views_options":
            return api.struct(p.base, views=2, pixels=EDGE)
        if p.base == "vsplat_model_options":
            return api.struct(p.base, config=b"micro")
        if p.base == "vsplat_reconstruct_options":
            return handles.reconstruction()
        if p.base == "vsplat_fit_options":
            return handles.fit()
        if p.base == "vsplat_selftest_options":
            return api.struct(p.base, quick=1, forget=1, **({} if WHOLE else {"progress": self.ending()}))
        if p.base == "vsplat_tune_options":
            return api.struct(p.base, seconds=0.01)
        if p.base == "vsplat_train_options":
            return api.struct(p.base, data=texts(self.files.set), num_data=1, output=str(self.files.output()).encode())
        if p.base == "vsplat_opencl_picture":
            return api.struct(p.base, alpha=handles.buffer("alpha"))
        if p.base == "vsplat_opencl_gaussians" and p.name == "out":
            return api.struct(p.base, means=handles.buffer("means"))
        if p.name in ("options", "job_options", "rules") or p.base == "vsplat_opencl_gaussians":
            return api.struct(p.base)
        raise Unknown(f"{function}: tests/python/functions_fixtures.py does not know what to fill {p.base} {p.name} with")

    def scene_info(self):
        out = self.api.struct("vsplat_scene_info")
        self.api.call("vsplat_scene_get_info", self.handles["vsplat_scene"], c.byref(out))
        return out
