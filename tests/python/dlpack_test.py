"""examples/python: memory shared with other programs through DLPack and OpenCL, on the host and on the device."""
import ctypes as c
import datetime
import gc
import pathlib
import sys
import unittest
import weakref

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT / "examples" / "python")]

import numpy as np  # noqa: E402
import vsplat  # noqa: E402

try:
    import torch
except ImportError:
    torch = None

HEIGHT, WIDTH, COUNT = 33, 40, 50


def camera():
    w2c = np.eye(4)
    w2c[2, 3] = 2
    return vsplat.Camera(WIDTH, HEIGHT, 45, 44, 19.5, 17, w2c)


def gaussians():
    r = np.random.default_rng(1)
    return {"means": r.uniform(-0.5, 0.5, (COUNT, 3)), "scales": r.uniform(0.03, 0.12, (COUNT, 3)), "rotations": r.normal(size=(COUNT, 4)),
            "opacities": r.uniform(0.2, 0.9, COUNT), "sh": r.normal(size=(COUNT, 4, 3)) * 0.5}


class Tensor(c.Structure):
    """DLManagedTensor, as in dlpack.h."""
    _fields_ = [("data", c.c_void_p), ("device_type", c.c_int32), ("device_id", c.c_int32), ("ndim", c.c_int32), ("code", c.c_uint8),
                ("bits", c.c_uint8), ("lanes", c.c_uint16), ("shape", c.POINTER(c.c_int64)), ("strides", c.POINTER(c.c_int64)),
                ("byte_offset", c.c_uint64), ("context", c.c_void_p), ("deleter", c.c_void_p)]


class Foreign:
    """A tensor of another program, made by hand. `deleted` counts the calls of its deleter."""

    _all = []  # (a deleter in Python must outlive its caller)

    def __init__(self, data, shape, strides=None, device=1, code=2, bits=32, lanes=1, offset=0):
        self._all.append(self)
        self.deleted = 0
        self._deleter = c.PYFUNCTYPE(None, c.c_void_p)(self._delete)
        self._shape = (c.c_int64 * max(len(shape), 1))(*shape)
        self._strides = (c.c_int64 * len(strides))(*strides) if strides else None
        self.tensor = Tensor(data, device, 0, len(shape), code, bits, lanes, self._shape, self._strides, offset, None,
                             c.cast(self._deleter, c.c_void_p))
        new = c.pythonapi.PyCapsule_New
        new.restype, new.argtypes = c.py_object, [c.c_void_p, c.c_char_p, c.c_void_p]
        self._name = b"dltensor"
        self.capsule = new(c.addressof(self.tensor), self._name, None)

    def _delete(self, address):
        assert address == c.addressof(self.tensor)
        self.deleted += 1

    def __dlpack_device__(self):
        return self.tensor.device_type, 0

    def __dlpack__(self, stream=None):
        return self.capsule

    @property
    def is_used(self):
        is_valid = c.pythonapi.PyCapsule_IsValid
        is_valid.argtypes = [c.py_object, c.c_char_p]
        return bool(is_valid(self.capsule, b"used_dltensor"))


class OnTheHost(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.device = vsplat.Device()
        cls.scene = vsplat.Scene.from_arrays(**gaussians())

    def test_numpy_shares_a_picture(self):
        picture = self.device.render(self.scene, camera())
        self.assertEqual(picture.__dlpack_device__(), (1, 0))
        shared = np.from_dlpack(picture)
        self.assertEqual((shared.shape, shared.ctypes.data), ((HEIGHT, WIDTH, 3), picture.colour.ctypes.data))
        self.assertTrue(np.shares_memory(np.from_dlpack(picture.depth), picture.depth))
        colour = picture.colour.copy()
        del picture
        gc.collect()
        np.testing.assert_array_equal(shared, colour)  # the memory stays valid
        with self.assertRaisesRegex(vsplat.UsageError, "no colour"):
            self.device.render(self.scene, camera(), colour=False).__dlpack__()

    def test_reads_memory_where_it_lies(self):
        values = np.arange(12, dtype=np.float32)
        for shape, strides in (((4, 3), None), ((4, 3), (3, 1)), ((1, 12), (77, 1))):
            tensor = Foreign(values.ctypes.data, shape, strides)
            taken = vsplat._dlpack._array(tensor, shape, "x")
            self.assertEqual(taken.ctypes.data, values.ctypes.data)
            self.assertTrue(tensor.is_used)
            self.assertEqual(tensor.deleted, 0)
            view = taken[-1:]
            del taken
            gc.collect()
            self.assertEqual(tensor.deleted, 0)  # a part of it is still in use
            del view
            gc.collect()
            self.assertEqual(tensor.deleted, 1)
        turned = Foreign(values.ctypes.data, (2, 3), (1, 4), offset=8)
        np.testing.assert_array_equal(vsplat._dlpack._array(turned.capsule, (2, 3), "x"), [[2, 6, 10], [3, 7, 11]])
        self.assertEqual(turned.deleted, 1)  # it had to be copied
        half = np.arange(6, dtype=np.float16)
        np.testing.assert_array_equal(vsplat._dlpack._array(Foreign(half.ctypes.data, (6,), bits=16), (6,), "x"), np.arange(6))
        self.assertEqual(vsplat._dlpack._array(Foreign(None, (0, 3)), (0, 3), "x").shape, (0, 3))

    def test_refuses_in_words_and_takes_nothing(self):
        at = np.zeros(64).ctypes.data
        for words, tensor in {"is in memory of CUDA: memory of the host expected": Foreign(at, (3,), device=2),
                              "a device of DLPack type 77": Foreign(at, (3,), device=77), "memory of OpenCL": Foreign(at, (3,), device=4),
                              "without memory": Foreign(None, (3,)), "negative": Foreign(at, (3, -1))}.items():
            for given in (tensor, tensor.capsule):
                with self.assertRaisesRegex(vsplat.UsageError, f"opacities .*{words}"):
                    vsplat.Scene.from_arrays(**{**gaussians(), "opacities": given})
            self.assertEqual((tensor.is_used, tensor.deleted), (False, 0))
        for words, tensor in {"bfloat16": Foreign(at, (3,), code=4, bits=16), "complex64": Foreign(at, (3,), code=5, bits=64),
                              "float32x4": Foreign(at, (3,), lanes=4), "kind 99": Foreign(at, (3,), code=99),
                              "int4": Foreign(at, (3,), code=0, bits=4)}.items():
            with self.assertRaisesRegex(TypeError, f"opacities holds {words}"):
                vsplat.Scene.from_arrays(**{**gaussians(), "opacities": tensor})
            self.assertEqual((tensor.is_used, tensor.deleted), (False, 0))
        wrong = Foreign(at, (3, 5))
        with self.assertRaisesRegex(vsplat.UsageError, r"opacities has the shape \[3, 5\]: \[50\] expected"):
            vsplat.Scene.from_arrays(**{**gaussians(), "opacities": wrong})
        gc.collect()
        self.assertEqual((wrong.is_used, wrong.deleted), (True, 1))
        with self.assertRaisesRegex(vsplat.UsageError, "opacities is a DLPack capsule that was used before"):
            vsplat.Scene.from_arrays(**{**gaussians(), "opacities": wrong.capsule})
        with self.assertRaisesRegex(TypeError, "opacities gives no capsule with a DLPack tensor"):
            vsplat.Scene.from_arrays(**{**gaussians(), "opacities": datetime.datetime_CAPI})
        self.assertEqual(wrong.deleted, 1)

    def test_draws_into_memory_of_others(self):
        want = np.zeros((HEIGHT, WIDTH, 4), np.uint8)
        self.device.render(self.scene, camera(), out=want)
        frame = np.full((HEIGHT, 300), 77, np.uint8)
        out = Foreign(frame.ctypes.data, (HEIGHT, WIDTH, 4), (300, 4, 1), code=1, bits=8)
        picture = self.device.render(self.scene, camera(), out=out.capsule)
        np.testing.assert_array_equal(frame[:, :160].reshape(want.shape), want)
        self.assertTrue((frame[:, 160:] == 77).all())
        del picture
        gc.collect()
        self.assertEqual(out.deleted, 1)
        many = [np.zeros((HEIGHT, WIDTH, 4), np.uint8) for _ in range(3)]
        self.device.render_async(self.scene, [camera()] * 3,
                                 out=[Foreign(a.ctypes.data, a.shape, code=1, bits=8).capsule for a in many]).result()
        for each in many:
            np.testing.assert_array_equal(each, want)

    def test_takes_pictures_of_others(self):
        pixels = np.random.default_rng(2).integers(0, 256, (16, 24, 3), np.uint8)
        model = vsplat.Model.random("micro", seed=5)
        edge, back = model.info["image"], np.diag([-1.0, 1, -1, 1])
        front = np.eye(4)
        front[2, 3] = back[2, 3] = 2
        cameras = [vsplat.Camera(edge, edge, 20, 20, edge / 2, edge / 2, w2c) for w2c in (front, back)]
        part = pixels[:edge, :edge]
        gaps = Foreign(pixels.ctypes.data, part.shape, tuple(part.strides), code=1, bits=8)
        for given in (part, gaps, part / np.float32(255), Foreign(pixels.ctypes.data, part.shape, tuple(part.strides), code=1, bits=8).capsule):
            views = vsplat.Views.from_arrays([given, part.copy()], cameras).prepare(model)
            np.testing.assert_array_equal(views.picture(0), part / np.float32(255))
        gc.collect()
        self.assertEqual(gaps.deleted, 1)

    @unittest.skipIf(torch is None, "needs torch (Debian: python3-torch)")
    def test_torch_shares_memory(self):
        picture = self.device.render(self.scene, camera())
        self.assertEqual(torch.from_dlpack(picture).data_ptr(), picture.colour.ctypes.data)
        self.assertEqual(torch.from_dlpack(picture.alpha).data_ptr(), picture.alpha.ctypes.data)
        values = {name: torch.tensor(a, dtype=torch.float32) for name, a in gaussians().items()}
        self.assertEqual(vsplat._dlpack._array(values["means"], (COUNT, 3), "means").ctypes.data, values["means"].data_ptr())
        np.testing.assert_array_equal(self.device.render(vsplat.Scene.from_arrays(**values), camera()).colour, picture.colour)
        turned = {**values, "means": values["means"].T.contiguous().T, "sh": values["sh"].double()}
        np.testing.assert_array_equal(self.device.render(vsplat.Scene.from_arrays(**turned), camera()).colour, picture.colour)
        out = torch.zeros((HEIGHT, WIDTH + 9, 3), dtype=torch.float32)
        self.device.render(self.scene, camera(), out=out[:, 9:])
        np.testing.assert_array_equal(out[:, 9:].numpy(), picture.colour)
        self.assertEqual(out[:, :9].abs().max().item(), 0)
        for words, tensor in (("opacities cannot be had by DLPack", values["opacities"].clone().requires_grad_()),
                              ("opacities holds bfloat16|bfloat16", values["opacities"].bfloat16())):
            with self.assertRaisesRegex((vsplat.UsageError, TypeError), words):
                vsplat.Scene.from_arrays(**{**values, "opacities": tensor})


class OnTheDevice(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.device = vsplat.Device()
        cls.scene = vsplat.Scene.from_arrays(**gaussians())

    def buffer(self, values):
        values = np.asarray(values, np.float32)
        out = vsplat.Buffer(self.device, values.shape)
        out.write(values)
        return out

    def test_draws_into_buffers(self):
        want, size, background = self.device.render(self.scene, camera(), (0.2, 0.5, 0.7)), (HEIGHT, WIDTH), (0.2, 0.5, 0.7)
        data = np.zeros((*size, 4), np.uint8)
        for premultiplied in (False, True):
            self.device.render(self.scene, camera(), background, out=data, premultiplied=premultiplied)
            got = {"colour": vsplat.Buffer(self.device, (*size, 3)), "alpha": vsplat.Buffer(self.device, size),
                   "depth": vsplat.Buffer(self.device, size), "rgba": vsplat.Buffer(self.device, (*size, 4), "uint8")}
            self.device.render_to_buffers(self.scene, camera(), background, **got, premultiplied=premultiplied)
            np.testing.assert_array_equal(got["rgba"].numpy(), data)
            for name in ("colour", "alpha", "depth"):
                np.testing.assert_array_equal(got[name].numpy(), getattr(want, name))
        self.assertGreater(data[..., 3].max(), 100)

    def test_gradients_in_buffers(self):
        by = np.random.default_rng(3).normal(size=(HEIGHT, WIDTH, 3)).astype(np.float32)
        want, _ = self.device.render_backward(self.scene, camera(), colour=by)
        out = vsplat.Gaussians(**{name: vsplat.Buffer(self.device, a.shape) for name, a in vars(want).items()})
        self.device.render_backward_to_buffers(self.scene, camera(), out, colour=self.buffer(by))
        for name, a in vars(want).items():
            self.assertGreater(np.abs(a).max(), 0)
            np.testing.assert_array_equal(getattr(out, name).numpy(), a)

    def test_scenes_of_buffers_and_buffers_of_scenes(self):
        made = self.device.scene_from_buffers(**{name: self.buffer(a) for name, a in gaussians().items()})
        np.testing.assert_array_equal(made.arrays().sh, self.scene.arrays().sh)
        before = self.device.render(made, camera())
        there = self.device.scene_buffers(made)
        np.testing.assert_array_equal(there.means.numpy(), made.arrays().means)
        there.sh.write(-there.sh.numpy())
        changed = self.device.render(made, camera())
        self.assertGreater(np.abs(changed.colour - before.colour).max(), 0.05)
        np.testing.assert_array_equal(made.arrays().sh, self.scene.arrays().sh)
        self.device.store_buffers(made)
        np.testing.assert_array_equal(made.arrays().sh, -self.scene.arrays().sh)

    def test_another_program_opens_and_shares(self):
        """A device on another device's context; both see the same memory through DLPack."""
        context, device, queue = self.device.opencl
        beside = vsplat.Device.beside(context, device, queue)
        self.assertEqual(beside.opencl, (context, device, queue))
        ours = self.buffer(np.zeros((HEIGHT, WIDTH)))
        self.assertEqual(ours.__dlpack_device__(), (4, self.device.info["index"]))
        for given in (ours, ours.__dlpack__()):
            beside.render_to_buffers(self.scene, camera(), alpha=given)
        np.testing.assert_array_equal(ours.numpy(), self.device.render(self.scene, camera()).alpha)
        self.assertEqual(vsplat.Buffer.from_cl_mem(beside, ours.cl_mem, (HEIGHT, WIDTH)).numpy().max(), ours.numpy().max())
        with self.assertRaisesRegex(vsplat.UsageError, "theirs.context is null"):
            vsplat.Device.beside(0, device)
        elsewhere = vsplat.Device()
        if elsewhere.opencl[0] != context:
            with self.assertRaisesRegex(vsplat.UsageError, "another cl_context"):
                elsewhere.render_to_buffers(self.scene, camera(), alpha=ours)

    def test_memory_stays_until_the_last_has_gone(self):
        first = self.buffer([1, 2, 3])
        gone = weakref.ref(first)
        capsule = first.__dlpack__()
        del first
        gc.collect()
        self.assertIsNotNone(gone())  # the capsule keeps it alive
        second = vsplat.Buffer.from_dlpack(self.device, capsule)
        with self.assertRaisesRegex(vsplat.UsageError, "used before"):
            vsplat.Buffer.from_dlpack(self.device, capsule)
        del capsule
        gc.collect()
        self.assertEqual((gone() is None, second.numpy().tolist()), (False, [1, 2, 3]))
        third = vsplat.Buffer.from_dlpack(self.device, second)
        del second
        gc.collect()
        self.assertEqual((gone() is None, third.numpy().tolist()), (False, [1, 2, 3]))
        del third
        gc.collect()
        self.assertIsNone(gone())
        unused = self.buffer([1])
        gone = weakref.ref(unused)
        unused.__dlpack__()  # is never consumed
        del unused
        gc.collect()
        self.assertIsNone(gone())

    def test_takes_buffers_of_others(self):
        whole = self.buffer(np.arange(4096))
        part = Foreign(whole.cl_mem, (2, 3), device=4, offset=4096)
        taken = vsplat.Buffer.from_dlpack(self.device, part)
        np.testing.assert_array_equal(taken.numpy(), [[1024, 1025, 1026], [1027, 1028, 1029]])
        taken.write(np.zeros((2, 3)))
        self.assertEqual((whole.numpy()[1023:1031] == [1023, 0, 0, 0, 0, 0, 0, 1030]).all(), True)
        self.assertEqual(part.deleted, 0)
        del taken
        gc.collect()
        self.assertEqual(part.deleted, 1)
        with self.assertRaisesRegex(vsplat.Error, "taking the part of value that begins 2 bytes into its buffer"):
            vsplat.Buffer.from_dlpack(self.device, Foreign(whole.cl_mem, (3,), device=4, offset=2))

    def test_refuses(self):
        alpha = self.buffer(np.zeros((HEIGHT, WIDTH)))
        draw = self.device.render_to_buffers
        for error, words, call in (
                (vsplat.UsageError, "nothing to draw into", lambda: draw(self.scene, camera())),
                (vsplat.UsageError, r"colour holds float32 \[33, 40\]: float32 \[33, 40, 3\] expected",
                 lambda: draw(self.scene, camera(), colour=alpha)),
                (vsplat.UsageError, r"rgba holds float32 \[33, 40\]: uint8", lambda: draw(self.scene, camera(), rgba=alpha)),
                (vsplat.UsageError, "alpha is in memory of the host: memory of OpenCL expected",
                 lambda: draw(self.scene, camera(), alpha=np.zeros((HEIGHT, WIDTH), np.float32))),
                (TypeError, "alpha is a list", lambda: draw(self.scene, camera(), alpha=[1])),
                (vsplat.UsageError, "picture.alpha and picture.depth share memory", lambda: draw(self.scene, camera(), alpha=alpha, depth=alpha)),
                (vsplat.UsageError, "alpha has strides of",
                 lambda: draw(self.scene, camera(), alpha=Foreign(alpha.cl_mem, (HEIGHT, WIDTH), (1, HEIGHT), device=4))),
                (TypeError, "alpha is int32", lambda: draw(self.scene, camera(), alpha=Foreign(alpha.cl_mem, (HEIGHT, WIDTH), device=4, code=0))),
                (TypeError, "scene is a Device", lambda: draw(self.device, camera(), alpha=alpha)),
                (TypeError, "out is a Buffer", lambda: self.device.render_backward_to_buffers(self.scene, camera(), alpha, alpha=alpha)),
                (vsplat.UsageError, "opacities is null",
                 lambda: self.device.scene_from_buffers(**{**{n: self.buffer(a) for n, a in gaussians().items()}, "opacities": None})),
                (TypeError, "means is a vsplat.Buffer", lambda: vsplat.Scene.from_arrays(**{**gaussians(), "means": alpha})),
                (TypeError, "out is a vsplat.Buffer", lambda: self.device.render(self.scene, camera(), out=alpha)),
                (TypeError, "float16", lambda: vsplat.Buffer(self.device, (3,), "float16")),
                (vsplat.UsageError, "no empty buffers", lambda: vsplat.Buffer(self.device, (3, 0))),
                (vsplat.UsageError, "shape is -1", lambda: vsplat.Buffer(self.device, (-1,))),
                (vsplat.UsageError, "size in bytes", lambda: vsplat.Buffer(self.device, (1 << 62, 1 << 62))),
                (vsplat.UsageError, r"values has the shape \[3\]", lambda: alpha.write([1, 2, 3])),
                (vsplat.UsageError, "cl_mem is a buffer of 5280 bytes: 5284 expected",
                 lambda: vsplat.Buffer.from_cl_mem(self.device, alpha.cl_mem, (HEIGHT * WIDTH + 1,))),
                (vsplat.UsageError, "cl_mem is 0", lambda: vsplat.Buffer.from_cl_mem(self.device, 0, (1,))),
                (vsplat.UsageError, "stream is 1", lambda: alpha.__dlpack__(stream=1)),
                (BufferError, "no copy", lambda: alpha.__dlpack__(copy=True))):
            with self.assertRaisesRegex(error, words):
                call()


if __name__ == "__main__":
    unittest.main()
