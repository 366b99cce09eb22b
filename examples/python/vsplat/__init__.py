"""vsplat from Python: posed photographs in, Gaussians and pictures out, NumPy in and out.

A package on libvsplat's C interface, through ctypes: nothing is compiled, and it runs on every Python from 3.9 on. The library is
$VSPLAT_LIBRARY, else the one that this package was installed with (a wheel has it inside), else the one beside an installed `vsplat`
command, else the one that the system finds. It needs only NumPy; put the folder that contains the package on PYTHONPATH.

    import vsplat
    device = vsplat.Device()                                # the first GPU, else the first device
    model = vsplat.Model.load()                             # the built-in model
    scene = device.reconstruct(model, vsplat.Views.load("photos").prepare(model))
    picture = device.render(scene, scene.orbit(8)[0])       # picture.colour: float32 [H, W, 3]
    scene.save("scene.ply")

Conventions are the library's: cameras have OpenCV axes (x right, y down, z forward) and pixel centres at +0.5, `w2c` is
[4, 4], world to camera; pictures are float32 [H, W, C], sRGB-encoded in 0 to 1; K Gaussians, S = (degree + 1)^2.
Input arrays may be anything that NumPy accepts, or that has __dlpack__ on host memory, such as PyTorch's tensors. Contiguous float32 arrays
are read in place; `out` is written in place. Results are NumPy arrays; torch.from_dlpack(picture.colour) shares their memory. Buffer holds
values on the device, for programs that use OpenCL themselves. Failures raise vsplat.Error, with the library's message and `status`. Only
one thread at a time may use a Device, a stream of one (Device.stream) and what is made with it; other Python threads run during a call.

Training, evaluation, data sets, contact sheets and camera paths are only available in the C interface (vsplat/vsplat.h) and the command."""
from ._c import Error, UsageError, devices, version
from ._values import Camera, Gaussians, Picture, compare, psnr_cc
from ._scenes import Input, Mesh, Model, Scene, Views, describe_scene_file, scene_formats
from ._buffers import Buffer
from ._devices import Device, Job

__all__ = ["Buffer", "Camera", "Device", "Error", "Gaussians", "Input", "Job", "Mesh", "Model", "Picture", "Scene", "UsageError", "Views", "compare",
           "describe_scene_file", "devices", "psnr_cc", "scene_formats", "version"]

for _name in __all__:
    globals()[_name].__module__ = __name__  # shown like this in messages and by help()
del _name
