"""Counted handles of the library, callbacks into Python, and unfinished jobs."""
from __future__ import annotations

import atexit
import ctypes as c
import os
import threading
from typing import TYPE_CHECKING, Any, Callable, Iterable

from ._c import Error, _bytes, _call, _lib, _progress

if TYPE_CHECKING:
    from ._devices import Job

Progress = Callable[[str, float], Any]
"""Called with stage and share done; returns False to stop."""


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


class _Reporter:
    """A progress function for C. An exception in it ends the call, and is raised again after it."""

    def __init__(self, progress: Progress | None):
        self.problem: BaseException | None = None

        def tell(_user: Any, stage: bytes, done: float) -> int:
            try:
                return 0 if progress(stage.decode(), done) is False else 1
            except BaseException as e:  # noqa: B902: KeyboardInterrupt, too
                self.problem = e
                return 0

        self.function = _progress(tell) if progress else _progress()

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
