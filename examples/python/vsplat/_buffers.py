"""Values on the device, shared with programs that use OpenCL themselves."""
from __future__ import annotations

import ctypes as c
import math
from typing import TYPE_CHECKING, Any, Sequence

import numpy as np

from ._c import Error, UsageError, _lib, _whole
from ._dlpack import _DLManagedTensor, _DL_NEW, _DL_OPENCL, _Taken, _capsule_get, _is_capsule, _ndarray
from ._handles import _given

if TYPE_CHECKING:
    from ._devices import Device


def _device(value: Any) -> Device:
    from ._devices import Device  # which imports this module
    return _given(value, Device, "device")


class _Pretended:
    """Lets NumPy make the capsule, and the code that frees it, for an array in place of a Buffer's memory, which NumPy never reads."""

    def __init__(self, buffer: Buffer):
        self.buffer = buffer
        self.__array_interface__ = {"shape": buffer.shape, "typestr": buffer.dtype.str, "data": (buffer.cl_mem, False), "version": 3}


class Buffer:
    """Values in an OpenCL buffer of a device's context, for programs that use OpenCL themselves. Exchanges memory with them by `cl_mem`, and
    through DLPack (kDLOpenCL, whose data is a cl_mem) in both directions; the memory lives as long as its last owner.

    Queues do not wait for each other: finish writing a Buffer before the library reads it. The library's own calls return when they are
    finished."""

    def __init__(self, device: Device, shape: Sequence[int], dtype: Any = "float32"):
        """Makes a buffer of "float32" or "uint8" with undefined content."""
        self._begin(_device(device), tuple(_whole(n, "shape").value for n in shape), dtype)
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
        """Wraps and retains an existing buffer: `cl_mem` as a number (pyopencl's int_ptr)."""
        self = cls.__new__(cls)
        self._begin(_device(device), tuple(_whole(n, "shape").value for n in shape), dtype)
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
        """Shares the memory of an object with __dlpack__ on OpenCL, or of its DLPack capsule. It must be contiguous, and in the device's
        context."""
        return cls._of(_device(device), _Taken(value, _DL_OPENCL, "value"), "value")

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
        """Returns a copy on the host."""
        out = np.empty(self.shape, self.dtype)
        self._transfer("clEnqueueReadBuffer", "reading a buffer", out)
        return out

    def write(self, values: Any) -> None:
        """Copies values of this shape and type into the buffer."""
        given = np.ascontiguousarray(_ndarray(values, "values"), dtype=self.dtype)
        if given.shape != self.shape:
            raise UsageError(f"values has the shape {list(given.shape)}: {list(self.shape)} expected")
        self._transfer("clEnqueueWriteBuffer", "writing a buffer", given)

    def _transfer(self, name: str, doing: str, array: np.ndarray) -> None:
        _cl_call(name, doing, c.c_void_p(self.device.opencl[2]), c.c_void_p(self.cl_mem), c.c_uint32(1), c.c_size_t(0), c.c_size_t(self._size),
                 c.c_void_p(array.ctypes.data), c.c_uint32(0), None, None)


def _cl(name: str, result: Any) -> Any:
    """Returns a function of the OpenCL that the library is linked with."""
    function = getattr(_lib, name)
    function.restype = result
    return function


def _cl_check(error: int, doing: str) -> None:
    if error:
        raise Error("device", f"{doing}: OpenCL's error {error}")


def _cl_call(name: str, doing: str, *args: Any) -> None:
    _cl_check(_cl(name, c.c_int32)(*args), doing)


def _on_device(device: Device, value: Any, name: str) -> Buffer:
    """Returns a Buffer; wraps an object that has __dlpack__ on OpenCL."""
    if isinstance(value, Buffer):
        return value
    if not (_is_capsule(value) or hasattr(value, "__dlpack__")):
        raise TypeError(f"{name} is a {type(value).__name__}: a vsplat.Buffer, or what has __dlpack__ on OpenCL, expected")
    return Buffer._of(device, _Taken(value, _DL_OPENCL, name), name)


def _cl_mem(value: Any, shape: Sequence[int], dtype: str, device: Device, name: str, kept: list[Any]) -> int | None:
    """Returns the cl_mem of a value, which must have this shape, and adds the value to `kept`."""
    if value is None:
        return None
    kept.append(_on_device(device, value, name))
    if kept[-1].shape != tuple(shape) or kept[-1].dtype != dtype:
        raise UsageError(f"{name} holds {kept[-1].dtype} {list(kept[-1].shape)}: {dtype} {list(shape)} expected")
    return kept[-1].cl_mem
