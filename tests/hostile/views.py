"""Lists of cameras and the files that they name: names with escapes, files outside, devices and pipes."""
import json
import os
import shutil
import struct

from texts import nested


class Copy:
    """A copy of a sound object's folder, to be damaged."""
    def __init__(self, maker, kind, role="views", names="transforms.json"):
        self.maker, self.folder = maker, os.path.join(maker.out, *kind.split("/"))
        shutil.copytree(os.path.join(maker.sound, "set", "object"), self.folder)
        with open(self.path("transforms.json")) as f:
            self.data = json.load(f)
        maker.add(kind, role, self.folder, names)

    def path(self, *parts):
        return os.path.join(self.folder, *parts)

    def first(self, **fields):
        self.data["frames"][0].update(fields)
        return self.save()

    def save(self, text=None):
        with open(self.path("transforms.json"), "w", encoding="utf-8", errors="surrogateescape") as f:
            f.write(json.dumps(self.data) if text is None else text)
        return self


def lists(maker):
    choose = maker.random.choice
    Copy(maker, "views/nested").save(nested(maker))
    Copy(maker, "views/nested_frames").save('{"frames": ' + nested(maker) + "}")
    Copy(maker, "views/nested_pose").save('{"frames": [{"file_path": "a.png", "transform_matrix": ' + nested(maker) + "}]}")
    copy = Copy(maker, "views/twice")
    copy.save('{"fl_x": 1, ' + json.dumps(copy.data)[1:])
    for kind, value in (("nan_pose", float("nan")), ("infinite_pose", float("inf")), ("huge_pose", 1e308)):
        copy = Copy(maker, f"views/{kind}")
        copy.data["frames"][0]["transform_matrix"][maker.random.randrange(3)][maker.random.randrange(4)] = value
        copy.save()
    for kind, fields in (("huge_size", {"w": choose((2**31, 2**62, 1e300)), "h": 1 << 30}), ("zero_size", {"w": 0}), ("text_size", {"w": maker.escape()}),
                         ("side_fisheye", {"camera_model": "OPENCV_FISHEYE", "cx": 10.0 ** -choose((9, 30, 300)), "k1": 0.01}),
                         ("huge_focal", {"fl_x": 1e308}), ("nan_focal", {"fl_x": float("nan")}), ("huge_lens", {"k1": 1e300, "k2": -1e300}),
                         ("no_lens", {"k1": -maker.random.uniform(5, 50), "k2": 0.1}), ("huge_cube", {"aabb_half": 1e300}), ("nan_cube", {"aabb_center": [float("nan"), 0, 0]}),
                         ("no_frames", {"frames": []}), ("kinds", {"frames": {"a": 1}}), ("model", {"camera_model": maker.escape()})):
        copy = Copy(maker, f"views/{kind}")
        copy.data.update(fields)
        copy.save()
    copy = Copy(maker, "views/far")  # like photographs in national coordinates
    offset = [maker.random.uniform(-1, 1) * 10 ** maker.random.randint(5, 7) for _ in range(3)]
    for frame in copy.data["frames"]:
        for row, more in zip(frame["transform_matrix"], offset):
            row[3] += more
    copy.data["aabb_center"] = offset
    copy.save()
    copy = Copy(maker, "views/many")
    copy.data["frames"] = copy.data["frames"][:1] * (maker.random.randint(3000, 6000) // 3)
    copy.save()
    Copy(maker, "views/long_name").first(file_path="images/" + "a" * maker.random.randint(5000, 3_000_000))
    copy = Copy(maker, "views/no_utf8")
    copy.save(json.dumps(copy.data).replace("images/0000.png", "images/\udcff\udcfe.png"))


def names(maker):
    """An existing picture whose name affects a terminal."""
    copy = Copy(maker, "names/escape")
    name = maker.escape().replace("\n", "\x1b") + "a.png"
    os.rename(copy.path("images", "0000.png"), copy.path("images", name))
    copy.first(file_path="images/" + name)
    copy = Copy(maker, "names/escape_missing")
    copy.first(file_path="images/" + maker.escape() + ".png")
    copy = Copy(maker, "names/newline")
    os.rename(copy.path("images", "0000.png"), copy.path("images", "a\nvsplat: done.png"))
    copy.first(file_path="images/a\nvsplat: done.png")
    copy = Copy(maker, "names/unseen")
    os.rename(copy.path("images", "0000.png"), copy.path("images", "a\u202egnp.\u2028\u200b.png"))
    copy.first(file_path="images/a\u202egnp.\u2028\u200b.png")
    Copy(maker, "names/unseen_missing").first(file_path="images/a\u202egnp.\u2028\u200b\u2066.png")
    copy = Copy(maker, "names/escape_mask")
    copy.first(mask_path=maker.escape() + "mask.png")


def path_that(maker, kind, name, ending=".png"):
    """For a file called name + ending in images/: how a list may write it, and what only looks like it."""
    choose, words = maker.random.choice, lambda n: [maker.word() for _ in range(n)]
    file = name + ending
    return {"tails": lambda: "/".join(words(maker.random.randint(1, 60)) + ["images", file]),
            "deep": lambda: "a/" * maker.random.randint(1_000, 500_000) + file,
            "up": lambda: "../" * maker.random.randint(1, 50) + "images/" + file,
            "down_and_up": lambda: "images/../" * maker.random.randint(1, 300) + "images/" + file,
            "dots": lambda: choose(("./", ".//", "...//", "/./")) * maker.random.randint(1, 300) + file,
            "drive": lambda: choose(("C:", "z:", "C:C:")) + "\\" + "\\".join(words(maker.random.randint(1, 9)) + ["images", file]),
            "share": lambda: "\\\\" + "\\".join(words(3) + [file]),
            "mixed": lambda: "".join(word + choose(("/", "\\", "\\/", "//")) for word in words(maker.random.randint(1, 30))) + file,
            "case": lambda: "".join(choose((c.lower(), c.upper())) for c in "images/" + file),
            "ending": lambda: "images/" + name + choose((".JPEG", ".heic", ".", "", ending + ending, ".tar.gz", ".\u202e", ending + "/", ending + "\\", "\x00" + ending)),
            "only": lambda: choose((".", "..", "/", "\\", "C:", "images", "images/", ending, "~", "~/" + file, "%00", "%2e%2e/" + file, "\x00", " ", "\n")),
            "bait": lambda: choose(("C:\\..\\..\\bait\\bait.png", "images/../../../bait/BAIT.png", "/x/../../../bait/bait.png", "..\\..\\bait\\bait.png",
                                    "x/" * 50 + "../" * 53 + "bait/bait.png", "..\\/..\\/bait/bait.jpg"))}[kind]()


PATHS = ("tails", "deep", "up", "down_and_up", "dots", "drive", "share", "mixed", "case", "ending", "only", "bait")


def paths(maker):
    """Names that stress the search for listed files."""
    for kind in PATHS:
        Copy(maker, f"paths/picture_{kind}").first(file_path=path_that(maker, kind, "0000"))
        Copy(maker, f"paths/mask_{kind}").first(mask_path=path_that(maker, kind, "0000"))
    copy = Copy(maker, "paths/many")  # each is searched by every tail
    name = "/".join(maker.word() for _ in range(maker.random.randint(50, 400))) + "/"
    copy.data["frames"] = [{**copy.data["frames"][0], "file_path": f"{name}{i}.png"} for i in range(maker.random.randint(1000, 3000))] + copy.data["frames"][1:]
    copy.save()
    copy = Copy(maker, "paths/two_fit")
    for ending in (".jpg", ".exr", ".PNG"):
        shutil.copy(copy.path("images", "0001.png"), copy.path("images", "0000" + ending))
    copy.first(file_path="x/0000" + maker.random.choice((".tif", ".Png", "")))
    copy = Copy(maker, "paths/like_bait")  # found only by its stem, and a link
    os.symlink("../../../bait/bait.png", copy.path("images", "bait.png"))
    copy.first(file_path="bait/BAIT.jpg")
    for kind, target in (("pipe", None), ("zero", "/dev/zero"), ("bait", "../../bait/bait.json")):
        copy = Copy(maker, f"paths/list_{kind}", names="json")  # a file beside it differs only in case
        os.rename(copy.path("transforms.json"), copy.path("TRANSFORMS.json"))
        os.symlink(target, copy.path("Transforms.JSON")) if target else os.mkfifo(copy.path("Transforms.JSON"))


def outside(maker):
    up = "../../bait/bait.png"
    for kind, name in {**maker.outside(), "bait": up}.items():
        Copy(maker, f"outside/picture_{kind}").first(file_path=name)
        Copy(maker, f"outside/mask_{kind}").first(mask_path=name)
    for what in ("picture", "mask"):
        for kind, target in (("link_bait", "../../../bait/bait.png"), ("link_zero", "/dev/zero"), ("link_passwd", "/etc/passwd"), ("link_loop", "x.png")):
            copy = Copy(maker, f"outside/{what}_{kind}")
            os.symlink(target, copy.path("images", "x.png"))
            copy.first(**{"file_path" if what == "picture" else "mask_path": "images/x.png"})
        copy = Copy(maker, f"outside/{what}_pipe")
        os.mkfifo(copy.path("images", "pipe.png"))
        copy.first(**{"file_path" if what == "picture" else "mask_path": "images/pipe.png"})
        copy = Copy(maker, f"outside/{what}_folder")
        os.makedirs(copy.path("images", "folder.png"))
        copy.first(**{"file_path" if what == "picture" else "mask_path": "images/folder.png"})
    # The pictures that a scene is compared with.
    for kind, target in (("pipe", None), ("zero", "/dev/zero"), ("passwd", "/etc/passwd"), ("bait", "../../../bait/bait.png"), ("loop", "0000.png")):
        copy = Copy(maker, f"compare/{kind}", "compare", "0000.png")
        os.remove(copy.path("images", "0000.png"))
        os.symlink(target, copy.path("images", "0000.png")) if target else os.mkfifo(copy.path("images", "0000.png"))
    # A folder of textures.
    for kind, content in (("empty", None), ("damaged", b"\x89PNG\r\n\x1a\n" + b"\0" * 50), ("pipe", "pipe"), ("zero", "/dev/zero")):
        folder = maker.folder(f"textures/{kind}")
        if content == "pipe":
            os.mkfifo(os.path.join(folder, "a.png"))
        elif isinstance(content, str):
            os.symlink(content, os.path.join(folder, "a.png"))
        elif content:
            maker.write(os.path.join(folder, "a.png"), content)
        maker.add(f"textures/{kind}", "textures", folder, kind)


def colmap(maker):
    """Binary models: cameras.bin and images.bin."""
    def put(kind, cameras, images, text=False):
        folder, ending = maker.folder(f"colmap/{kind}"), ".txt" if text else ".bin"
        maker.write(os.path.join(folder, "cameras" + ending), cameras)
        maker.write(os.path.join(folder, "images" + ending), images)
        os.makedirs(os.path.join(folder, "images"))
        shutil.copy(maker.sound_picture(), os.path.join(folder, "images", "0.png"))
        maker.add(f"colmap/{kind}", "views", folder, kind)
    huge = maker.random.choice((2**63, 2**64 - 1, 2**40, 2**32))
    camera = struct.pack("<QIiQQ3d", 1, 1, 0, 16, 16, 20.0, 8.0, 8.0)
    def image(name, points=0, count=1):
        return struct.pack("<QI7dI", count, 1, 1, 0, 0, 0, 0, 0, 2, 1) + name + b"\0" + struct.pack("<Q", points)
    escape = maker.escape().encode("utf-8")
    put("huge_cameras", struct.pack("<Q", huge) + camera[8:], image(b"0.png"))
    put("huge_images", camera, image(b"0.png", count=huge))
    put("huge_points", camera, image(b"0.png", points=huge))
    put("huge_picture", struct.pack("<QIiQQ3d", 1, 1, 0, huge % 2**64, 16, 20.0, 8.0, 8.0), image(b"0.png"))
    put("unknown_model", struct.pack("<QIiQQ3d", 1, 1, maker.random.choice((-1, 99, 2**31 - 1)), 16, 16, 20.0, 8.0, 8.0), image(b"0.png"))
    put("escape", camera, image(escape + b".png"))
    put("no_utf8", camera, image(b"\xff\xfe\x80.png"))
    put("outside", camera, image(b"../../bait/bait.png"))
    put("outside_absolute", camera, image(b"/etc/passwd"))
    put("no_end", camera, image(b"0" * maker.random.randint(1_000_000, 4_000_000))[:-9])
    put("cut", camera[:maker.random.randint(1, 40)], image(b"0.png"))
    put("nan", camera, image(b"0.png").replace(struct.pack("<d", 2), struct.pack("<d", float("nan"))))
    put("text_escape", f"1 PINHOLE{maker.escape()} 16 16 20 20 8 8\n".encode(), b"1 1 0 0 0 0 0 2 1 0.png\n\n", True)
    for i, (a, b) in enumerate((("Cameras.TXT", "IMAGES.txt"), ("CAMERAS.txt", "Images.txt"))):
        put(f"case{i}", b"1 PINHOLE 16 16 20 20 8 8\n", b"1 1 0 0 0 0 0 2 1 " + maker.random.choice((b"0.PNG", b"IMAGES/0.png", b"C:\\x\\0.jpg")) + b"\n\n", True)
        folder = maker.folder(f"colmap/case{i}")
        os.rename(os.path.join(folder, "cameras.txt"), os.path.join(folder, a))
        os.rename(os.path.join(folder, "images.txt"), os.path.join(folder, b))
        if i:
            os.symlink("../../bait/bait.txt", os.path.join(folder, "cAMERAS.txt"))
    put("text_long", b"1 PINHOLE 16 16 " + b"9" * maker.random.randint(1_000_000, 4_000_000), b"1 1 0 0 0 0 0 2 1 0.png\n\n", True)


def make(maker):
    lists(maker)
    names(maker)
    paths(maker)
    outside(maker)
    colmap(maker)
