"""WINDOW SCENE, on the screen of $DISPLAY: prints, as four numbers, how many titles the window gets while the pointer moves over it, when the
wheel is rolled sideways, when it is rolled up, and when the window is resized. The window sets its title after each picture, and the X server
reports that."""
import ctypes
import subprocess
import sys
import time

NEW_TITLE = 28  # PropertyNotify
PRESS, RELEASE = 4, 5
UP, SIDEWAYS = 4, 6  # of a wheel, as buttons
x = ctypes.CDLL("libX11.so.6")
x.XOpenDisplay.restype = ctypes.c_void_p
x.XDefaultRootWindow.argtypes, x.XDefaultRootWindow.restype = [ctypes.c_void_p], ctypes.c_ulong
ids, id_ = ctypes.POINTER(ctypes.c_ulong), ctypes.c_ulong
x.XQueryTree.argtypes = [ctypes.c_void_p, id_, ids, ids, ctypes.POINTER(ids), ctypes.POINTER(ctypes.c_uint)]
x.XFetchName.argtypes = [ctypes.c_void_p, id_, ctypes.POINTER(ctypes.c_char_p)]
x.XSelectInput.argtypes = [ctypes.c_void_p, id_, ctypes.c_long]
x.XWarpPointer.argtypes = [ctypes.c_void_p, id_, id_] + [ctypes.c_int] * 6
x.XResizeWindow.argtypes = [ctypes.c_void_p, id_, ctypes.c_uint, ctypes.c_uint]
x.XCheckTypedEvent.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p]
x.XSendEvent.argtypes = [ctypes.c_void_p, id_, ctypes.c_int, ctypes.c_long, ctypes.c_void_p]
x.XSync.argtypes = [ctypes.c_void_p, ctypes.c_int]

# A window may be gone between its listing and the question for its title. Xlib ends the process on an error without a handler.
ignored = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(lambda display, error: 0)
x.XSetErrorHandler(ignored)
display = x.XOpenDisplay(None)
root = x.XDefaultRootWindow(display)


def shown():
    """Returns the window, once it has drawn."""
    parent, children, count, title = ctypes.c_ulong(), ids(), ctypes.c_uint(), ctypes.c_char_p()
    x.XQueryTree(display, root, ctypes.byref(parent), ctypes.byref(parent), ctypes.byref(children), ctypes.byref(count))
    for i in range(count.value):
        if x.XFetchName(display, children[i], ctypes.byref(title)) and title.value.endswith(b" ms"):
            return children[i]
    return None


def drawn(quiet):
    """Counts new titles until there is none for so many seconds."""
    event, count, last = ctypes.create_string_buffer(192), 0, time.time()
    while time.time() - last < quiet:
        x.XSync(display, 0)
        while x.XCheckTypedEvent(display, NEW_TITLE, event):
            count, last = count + 1, time.time()
        time.sleep(0.02)
    return count


class Button(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("sent", ctypes.c_int), ("display", ctypes.c_void_p), ("window", id_),
                ("root", id_), ("subwindow", id_), ("time", ctypes.c_ulong), ("x", ctypes.c_int), ("y", ctypes.c_int), ("x_root", ctypes.c_int),
                ("y_root", ctypes.c_int), ("state", ctypes.c_uint), ("button", ctypes.c_uint), ("same_screen", ctypes.c_int), ("room", ctypes.c_long * 24)]


def roll(window, button):
    for kind, mask in ((PRESS, 1 << 2), (RELEASE, 1 << 3)):
        event = Button(type=kind, display=display, window=window, root=root, x=200, y=200, button=button, same_screen=1)
        x.XSendEvent(display, window, 1, mask, ctypes.byref(event))


def roll_as_a_mouse(button):
    """For versions of SDL that ignore events which another client sends. Returns the number of new titles."""
    test = ctypes.CDLL("libXtst.so.6")
    test.XTestFakeButtonEvent.argtypes = [ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_ulong]
    for pressed in (1, 0):
        test.XTestFakeButtonEvent(display, button, pressed, 0)
    return drawn(2)


process = subprocess.Popen(sys.argv[1:])
try:
    while not (window := shown()):
        if process.poll() is not None:
            sys.exit("the window has ended")
        time.sleep(0.1)
    x.XSelectInput(display, window, 1 << 22)
    drawn(2)
    for i in range(20):
        x.XWarpPointer(display, 0, window, 0, 0, 0, 0, 100 + 10 * i, 100 + 5 * i)
        x.XSync(display, 0)
        time.sleep(0.05)
    moved = drawn(2)
    roll(window, SIDEWAYS)
    sideways = drawn(2)
    roll(window, UP)
    up = drawn(2) or roll_as_a_mouse(UP)
    x.XResizeWindow(display, window, 320, 240)
    print(moved, sideways, up, drawn(2))
finally:
    process.kill()
    process.wait()
