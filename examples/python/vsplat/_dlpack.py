"""Arrays of other programs: NumPy's, objects with __dlpack__, and DLPack capsules."""
from __future__ import annotations

import ctypes as c
from typing import Any, Sequence

import numpy as np

from ._c import UsageError, _f32, _lib, devices


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
_DL_NEW, _DL_USED = b"dltensor", b"used_dltensor"  # (a capsule stores the pointer to its name)
_DL_HOST, _DL_OPENCL = (1, 3, 11), (4,)  # device types whose memory the host can read; and OpenCL
_DL_DEVICES = {1: "the host", 2: "CUDA", 3: "CUDA's memory on the host", 4: "OpenCL", 7: "Vulkan", 8: "Metal", 9: "VPI", 10: "ROCm",
               11: "ROCm's memory on the host", 13: "CUDA's managed memory", 14: "oneAPI", 15: "WebGPU", 16: "Hexagon"}
_DL_KINDS = {0: "int", 1: "uint", 2: "float", 4: "bfloat", 5: "complex", 6: "bool"}


class _Taken:
    """A tensor taken out of a capsule; its memory is given back when this is destroyed."""

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
        self._check(devices, what)  # while the capsule still owns it
        _capsule_rename(capsule, _DL_USED)
        self._address, self._delete = address, managed.deleter

    @staticmethod
    def _capsule_of(value: Any, devices: tuple[int, ...], what: str) -> Any:
        try:
            place = int(value.__dlpack_device__()[0]) if hasattr(value, "__dlpack_device__") else devices[0]
            capsule = value.__dlpack__() if place in devices else None
        except Exception as e:  # any error of a producer that cannot share its memory
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
    """Returns an array; shares the memory of an object with __dlpack__ or of a DLPack capsule."""
    if isinstance(values, np.ndarray):
        return values
    from ._buffers import Buffer  # which imports this module
    if isinstance(values, Buffer):
        raise TypeError(f"{what} is a vsplat.Buffer: an array on the host expected, as its numpy() gives one")
    if _is_capsule(values) or hasattr(values, "__dlpack__"):
        taken = _Taken(values, _DL_HOST, what)
        return np.asarray(taken) if 0 not in taken.shape else np.empty(taken.shape, taken.dtype)
    return np.asarray(values)


def _array(values: Any, shape: Sequence[int | None], what: str) -> np.ndarray:
    """Returns a contiguous float32 array of that shape (None: any size)."""
    given = _ndarray(values, what)
    try:
        out = np.ascontiguousarray(given, dtype=np.float32).reshape(given.shape)  # (NumPy makes [1] of a number)
    except (TypeError, ValueError):
        raise TypeError(f"{what} holds {given.dtype}: numbers expected") from None
    if out.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, out.shape)):
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise UsageError(f"{what} has the shape {list(out.shape)}: [{wanted}] expected")
    return out


def _pointer(array: np.ndarray | None) -> Any:
    return array.ctypes.data_as(_f32) if array is not None else None
