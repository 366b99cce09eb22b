"""Pages that show a scene: what is in them, how the browser is started, and, in Chromium, what they show."""
import array
import base64
import gzip
import html
import json
import math
import os
import pathlib
import random
import re
import stat
import struct
import time
import unittest

import browser
import support

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = ROOT / "examples" / "data"
MOST_BYTES = 3_000_000  # of the gnome's page
LEAST_PSNR = 38  # between the page's picture and ours; 28 would not show a widening of 0.1 square pixels

RED_AND_BLUE = [((0.5, 0, 0), (1, 0, 0), 0.12, 0.95), ((-0.5, 0.2, 0), (0, 0, 1), 0.12, 0.95), ((0, -0.5, 0.4), (0, 0.8, 0), 0.1, 0.9)]


def element(page, name):
    """The text of a script of the page."""
    return re.search(rf'<script [^>]*id="{name}">(.*?)</script>', pathlib.Path(page).read_text(), re.S).group(1)


def pixels(path):
    """Width, height, and 8-bit RGB, over white."""
    width, height, values = support.read_png(path)
    if len(values) == 4 * width * height:
        values = bytes(255 + (values[i + c] - 255) * values[i + 3] // 255 for i in range(0, len(values), 4) for c in range(3))
    return width, height, values


def is_near(colour, values):
    return sum(1 for i in range(0, len(values), 3) if all(abs(values[i + c] - colour[c]) < 60 for c in range(3)))


class Pages(support.Case):
    """Without a browser."""

    def setUp(self):
        super().setUp()
        self.scene = self.path("s.ply")
        support.write_scene(self.scene, RED_AND_BLUE)

    def test_the_scene_is_inside(self):
        page = self.path("s.html")
        out, err = self.succeeds("view", self.scene, "--output", page, "--no-open", "--json")
        self.assertIn("s.html", err)
        record = json.loads(out)
        self.assertEqual((record["gaussians"], record["opened"], record["viewer"]), (3, False, page))
        self.assertIn("rotations are rounded", " ".join(record["lost"]))
        # SPZ of version 3: magic, version, number of Gaussians.
        spz = gzip.decompress(base64.b64decode(element(page, "scene-0")))
        self.assertEqual(struct.unpack("<4sII", spz[:12]), (b"NGSP", 3, 3))
        about = json.loads(element(page, "about"))
        self.assertEqual((about["title"], about["cameras"], len(about["scenes"])), ("s", [], 1))
        viewer = gzip.decompress(base64.b64decode(element(page, "viewer"))).decode()
        self.assertEqual(viewer, (ROOT / "model/cli/viewer/viewer.js").read_text())
        self.assertIn("Permission is hereby granted, free of charge", viewer)
        text = pathlib.Path(page).read_text()
        self.assertIn("default-src 'none'", text)
        self.assertEqual(re.findall(r'(?:src|href)="(?!data:)[^"]+"', text), [])
        again = self.path("again.html")
        self.succeeds("view", self.scene, "--output", again, "--no-open")
        for old in ("<title>s<", '"s"', '"s.spz"'):  # the names of the page and of what its button saves
            text = text.replace(old, old.replace("s<", "again<").replace('"s', '"again'))
        self.assertEqual(text, pathlib.Path(again).read_text())

    def test_cameras_and_photographs(self):
        page = self.path("s.html")
        self.succeeds("view", self.scene, "--cameras", self.views, "--output", page, "--no-open")
        cameras = json.loads(element(page, "about"))["cameras"]
        self.assertEqual([c["name"] for c in cameras], ["0.png", "1.png", "2.png"])
        for i, camera in enumerate(cameras):
            self.assertEqual((camera["fx"], camera["w"], camera["h"]), (20, self.SIDE, self.SIDE))
            c2w = support.camera_to_world(100 * i)
            # OpenGL's y and z axes are turned; the camera's centre becomes 0.
            centre = [c2w[r][3] for r in range(3)]
            rows = [camera["w2c"][4 * r:4 * r + 4] for r in range(3)]
            for r, row in enumerate(rows):
                sign = 1 if r == 0 else -1
                for c in range(3):
                    self.assertAlmostEqual(row[c], sign * c2w[c][r], 5)
                self.assertAlmostEqual(sum(row[c] * centre[c] for c in range(3)) + row[3], 0, 5)
            self.assertEqual(base64.b64decode(camera["picture"].split(",")[1])[:2], b"\xff\xd8")  # JPEG
        os.remove(self.path("views", "images", "1.png"))
        self.succeeds("view", self.scene, "--cameras", self.views, "--output", page, "--no-open", "--overwrite")
        self.assertEqual([bool(c["picture"]) for c in json.loads(element(page, "about"))["cameras"]], [True, False, True])

    def test_photographs_of_a_colmap_folder(self):
        """They lie in images/ beside the model, as `vsplat poses` writes them."""
        folder, page = pathlib.Path(self.path("set")), self.path("s.html")
        model = folder / "sparse" / "0"
        model.mkdir(parents=True)
        os.rename(self.path("views", "images"), folder / "images")
        (model / "cameras.txt").write_text(f"1 PINHOLE {self.SIDE} {self.SIDE} 20 20 8 8\n")
        (model / "images.txt").write_text("".join(f"{i + 1} 1 0 0 0 {0.1 * i} 0 4 1 {i}.png\n\n" for i in range(3)))
        (model / "points3D.txt").write_text("")
        _, err = self.succeeds("view", self.scene, "--cameras", folder, "--output", page, "--no-open")
        self.assertNotIn("looked for", err)
        self.assertEqual([(c["name"], bool(c["picture"])) for c in json.loads(element(page, "about"))["cameras"]],
                         [(f"{i}.png", True) for i in range(3)])

    def test_a_scene_that_spz_cannot_hold_is_named(self):
        far = self.path("far.ply")
        support.write_scene(far, [((1e9, 0, 0), (1, 0, 0), 0.1, 0.9)])
        page = self.path("s.html")
        self.refuses(1, [far, "SPZ holds numbers below"], "view", far, "--output", page, "--no-open")
        self.refuses(1, [far, "SPZ holds numbers below"], "view", self.scene, "--before", far, "--output", page, "--no-open")
        self.refuses(1, [far, "SPZ holds numbers below"], "render", far, "--viewer", page)
        support.write_scene(far, [])
        self.refuses(1, [far, "without Gaussians"], "view", far, "--no-open", "--output", page)
        self.assertFalse(os.path.exists(page))

    def test_distant_gaussians_are_left_out(self):
        """They would make the steps of all positions coarse."""
        far, page = self.path("far.ply"), self.path("s.html")
        support.write_scene(far, RED_AND_BLUE + [((0, y, 0), (0, 1, 0), 0.1, 0.9) for y in (2e7, 1e5)])
        for command in (["view", far, "--no-open", "--output", page], ["render", far, "--cameras", "orbit:1", "--size", "8x8", "--images", self.path("drawn"), "--viewer", page]):
            _, err = self.succeeds(*command, "--overwrite")
            self.assertIn(f"{page}: leaves out 2 of 5 Gaussians", err)
            near = self.path("near.spz")
            pathlib.Path(near).write_bytes(base64.b64decode(element(page, "scene-0")))
            self.assertEqual(json.loads(self.succeeds("info", near, "--json")[0])["gaussians"], 3)
        self.succeeds("view", self.scene, "--no-open", "--output", page, "--overwrite")

    def test_names_cannot_become_code(self):
        name = "</script><script>alert(1)</script><b>"
        scene = self.path(name.replace("/", "") + ".ply")
        support.write_scene(scene, RED_AND_BLUE)
        page = self.path("&<script>alert(1).html")
        self.succeeds("view", scene, "--before", self.scene, "--output", page, "--no-open")
        text = pathlib.Path(page).read_text()
        self.assertNotIn("<script>alert", text)
        self.assertIn("<title>" + html.escape("&<script>alert(1)", quote=False) + "</title>", text)
        about = json.loads(element(page, "about"))
        self.assertEqual([s["name"] for s in about["scenes"]], ["s.ply", os.path.basename(scene)])

    def test_commands_that_write_one(self):
        self.succeeds(*self.reconstruct("--viewer", self.path("r.html")))
        about = json.loads(element(self.path("r.html"), "about"))
        self.assertEqual((len(about["scenes"]), len(about["cameras"])), (1, 3))
        out, _ = self.succeeds("reconstruct", self.views, "--model", self.model, "--output", self.path("alone.html"), "--json")
        self.assertEqual(json.loads(out)["viewer"], self.path("alone.html"))
        self.assertEqual(sorted(f for f in os.listdir(self.folder) if f.startswith("alone")), ["alone.html"])
        self.assertEqual(element(self.path("r.html"), "scene-0"), element(self.path("alone.html"), "scene-0"))
        self.succeeds("render", self.scene, "--viewer", self.path("d.html"))
        self.succeeds("render", self.scene, "--cameras", self.views, "--viewer", self.path("e.html"))
        self.assertEqual([len(json.loads(element(self.path(f"{name}.html"), "about"))["cameras"]) for name in "de"], [0, 3])
        names = lambda page: [s["name"] for s in json.loads(element(self.path(page), "about"))["scenes"]]
        out, _ = self.succeeds("fit", self.views, "--start", self.scene, "--steps", 2, "--output", self.path("f.ply"), "--viewer", self.path("f.html"),
                               "--scale", 2, "--center", "0,0,0", "--json")
        self.assertEqual(names("f.html"), ["start", "fitted"] if json.loads(out)["returned"] == "fitted" else ["start"])
        out, _ = self.succeeds(*self.reconstruct("--refine", "--refine-steps", 2, "--viewer", self.path("g.html"), "--overwrite", "--json"))
        self.assertEqual(names("g.html"), ["network", "fitted"] if json.loads(out)["refined"]["returned"] == "fitted" else ["network"])

    def test_refusals(self):
        self.refuses(2, ["--viewer", ".html"], "render", self.scene, "--viewer", self.path("x.htm"))
        self.refuses(2, ["--no-open", "--output"], "view", self.scene, "--no-open")
        self.refuses(2, ["--pictures", "--cameras"], "view", self.scene, "--pictures", self.folder, "--output", self.path("x.html"), "--no-open")
        self.refuses(2, ["--profile", "--cameras"], "render", self.scene, "--viewer", self.path("x.html"), "--profile", self.path("p.json"))
        self.refuses(1, "none.ply", "view", self.path("none.ply"), "--output", self.path("x.html"), "--no-open")
        self.refuses(2, ["--viewer", "--output"], *self.reconstruct()[:4], "--output", self.path("x.html"), "--viewer", self.path("y.html"))
        pathlib.Path(self.path("here.html")).write_text("mine")
        self.refuses(1, "here.html", "view", self.scene, "--output", self.path("here.html"), "--no-open")

    def test_the_browser_gets_the_page(self):
        opener = self.path("opener")
        pathlib.Path(opener).write_text(f'#!/bin/sh\necho "$@" >"{self.path("opened")}"\n')
        os.chmod(opener, 0o700)
        temporary = self.path("tmp")
        os.mkdir(temporary)
        out, _ = self.succeeds("view", self.scene, "--json", env={"BROWSER": f"/does/not/exist:{opener}", "TMPDIR": temporary})
        self.assertTrue(json.loads(out)["opened"])
        page = pathlib.Path(self.path("opened")).read_text().strip()
        self.assertTrue(page.startswith(temporary) and page.endswith("/s.html") and os.path.isfile(page), page)
        self.assertEqual(stat.S_IMODE(os.stat(os.path.dirname(page)).st_mode), 0o700)
        # Without a browser, and with one that fails, the page stays and is named.
        pathlib.Path(opener).write_text("#!/bin/sh\nexit 3\n")
        for env in ({"BROWSER": opener}, {"BROWSER": "", "DISPLAY": "", "WAYLAND_DISPLAY": ""}):
            out, err = self.succeeds("view", self.scene, "--json", env={**env, "TMPDIR": temporary})
            self.assertFalse(json.loads(out)["opened"])
            named = re.search(r"warning: (\S+) is not opened", err).group(1)
            self.assertTrue(os.path.isfile(named), err)


@unittest.skipUnless(browser.CHROMIUM, "no browser to look at the pages with (chromium)")
class Shown(support.Case):
    """In Chromium, which draws by software."""
    SIZE = 256

    def shown(self, page, **more):
        shown = browser.Browser((self.SIZE, self.SIZE), **more)
        self.addCleanup(shown.__exit__)
        shown.open(page)
        shown.wait_for("window.vsplat && window.vsplat.ready.then(() => true)")
        return shown

    def is_quiet(self, shown, page):
        """Nothing was reported, and nothing but the page itself was fetched."""
        self.assertEqual(shown.problems, [])
        others = [url for url in shown.requests if not url.startswith(("data:", "blob:", "about:"))]
        self.assertEqual([url for url in others if not url.endswith("/" + os.path.basename(page))], [])

    def pictures_agree(self, shown, scene, cameras, *more):
        """Draws the scene from at most four cameras, and compares the page's pictures with ours."""
        folder, listed = self.path("drawn"), self.path("drawn.json")
        self.succeeds("render", scene, "--cameras", cameras, "--size", f"{self.SIZE}x{self.SIZE}", "--supersample", 1, "--images", folder, "--write-cameras",
                      listed, "--overwrite", *more)
        every = json.loads(pathlib.Path(listed).read_text())
        shown.evaluate("vsplat.bare()")
        for i in range(0, len(every), math.ceil(len(every) / 4)):
            camera = {**every[i], "w2c": sum(every[i]["w2c"], [])}
            shown.evaluate(f"vsplat.setCamera({json.dumps(camera)})")
            ours, page = pixels(os.path.join(folder, f"{i:04}.png")), pixels(shown.screenshot(self.path("page.png")))
            self.assertEqual(ours[:2], page[:2])
            self.assertLess(support.psnr(ours[2], bytes([255]) * len(ours[2])), 25, "the picture is nearly white")
            found = support.psnr(ours[2], page[2])
            print(f"{os.path.basename(scene)}, camera {i}: {found:.1f} dB between the page and vsplat render")
            self.assertGreaterEqual(found, LEAST_PSNR)
        shown.evaluate("vsplat.bare(false)")

    def seen(self, shown):
        """The page's picture of the scene alone, as it is now."""
        shown.evaluate("vsplat.settled()")
        shown.evaluate("vsplat.bare()")
        out = pixels(shown.screenshot(self.path("seen.png")))[2]
        shown.evaluate("vsplat.bare(false)")
        return out

    def test_a_sky_is_seen_from_inside(self):
        """A shell far around the scene, as a fitted sky is, does not count in the first view: the scene fills it."""
        scene, page, rest = self.path("sky.ply"), self.path("sky.html"), random.Random(5)
        for shell, scene_count in ((40, 200), (400, 100)):  # fewer and more Gaussians than the scene has
            sky = []
            for _ in range(shell):
                at = [rest.gauss(0, 1) for _ in range(3)]
                sky.append(([300 * v / math.hypot(*at) for v in at], (0.5, 0.5, 0.5), 60, 0.9))
            ball = [([0.3 * rest.gauss(0, 1) for _ in range(3)], (1, 0, 0), 0.15, 0.95) for _ in range(scene_count)]
            support.write_scene(scene, sky + ball)
            self.succeeds("view", scene, "--output", page, "--no-open", "--overwrite", "--quiet")
            red = is_near((255, 0, 0), self.seen(self.shown(page)))
            self.assertGreater(red, self.SIZE * self.SIZE / 20, f"{shell} Gaussians of a sky")

    @support.slow
    def test_the_gnome(self):  # Pages covers what is in the file
        views, scene, page = DATA / "garden_gnome", self.path("gnome.ply"), self.path("gnome.html")
        self.succeeds("reconstruct", views, "--output", scene, "--viewer", page)
        self.assertLessEqual(os.path.getsize(page), MOST_BYTES)
        shown = self.shown(page)
        # The first camera looks down; the page begins on the side of the second one, in front of the gnome.
        begun, second = shown.evaluate("vsplat.pose()"), json.loads(element(page, "about"))["cameras"][1]["w2c"]
        self.assertGreater(sum(a * b for a, b in zip(begun[8:11], second[8:11])), 0.9)
        self.pictures_agree(shown, scene, views)
        self.moves(shown)
        self.cameras_are_clicked(shown, sorted((views / "images").glob("*.png")))
        self.saves(shown, page)
        self.is_quiet(shown, page)

    def moves(self, shown):
        """Mouse, wheel, touch and keys change the picture, and R brings it back."""
        middle = (self.SIZE / 2, self.SIZE / 2)
        shown.evaluate("document.getElementById('reset').click()")
        start = now = self.seen(shown)
        moves = {
            "drag": lambda: shown.drag((40, 90), (120, 110)),
            "wheel": lambda: shown.mouse("mouseWheel", *middle, deltaX=0, deltaY=200),
            "pinch": lambda: shown.touch([(110, 120), (140, 120)], [(90, 120), (160, 120)], [(70, 120), (190, 120)]),
            "one finger": lambda: shown.touch([(60, 100)], [(90, 100)], [(130, 100)]),
            "arrow": lambda: [shown.key("ArrowLeft") for _ in range(3)],
            "pan": lambda: [shown.key("a") for _ in range(3)],
        }
        for name, move in moves.items():
            move()
            before, now = now, self.seen(shown)
            self.assertLess(support.psnr(before, now), 30, name)
        shown.key("r")
        self.assertGreater(support.psnr(start, self.seen(shown)), 45)

    def cameras_are_clicked(self, shown, photographs):
        """A click on a frustum shows the photograph where it was taken."""
        self.assertEqual(shown.evaluate("vsplat.cameras"), len(photographs))
        hide = "document.querySelectorAll('.panel').forEach((panel) => (panel.style.visibility = '%s'))"
        clicked = 0
        for i, photograph in enumerate(photographs):
            shown.resize(800, 800)  # so that more cameras are in sight
            for key in "r----------":
                shown.key(key)
            shown.evaluate("vsplat.settled()")
            place = shown.evaluate(f"vsplat.place({i})")
            if not place or not all(20 < v < 780 for v in place):
                continue
            on_top = shown.evaluate(f"document.elementFromPoint({place[0]}, {place[1]}).id")
            if on_top != "overlay":
                continue
            shown.click(*place)
            if shown.evaluate("vsplat.chosen()") != i:  # another camera is in front
                continue
            clicked += 1
            shown.evaluate("vsplat.settled()")
            shown.evaluate("document.getElementById('photograph').decode()")
            width, height, given = pixels(photograph)
            shown.resize(width, height)
            shown.evaluate(hide % "hidden")
            shown.evaluate("vsplat.settled()")
            page = pixels(shown.screenshot(self.path("stand.png")))
            shown.evaluate(hide % "visible")
            self.assertEqual(page[:2], (width, height))
            self.assertGreater(support.psnr(given, page[2]), 30, f"{photograph} is not what the page shows")
        self.assertGreater(clicked, 0)
        shown.resize(self.SIZE, self.SIZE)

    def saves(self, shown, page):
        folder = self.path("saved")
        os.mkdir(folder)
        shown.send("Page.setDownloadBehavior", behavior="allow", downloadPath=folder)
        shown.evaluate("document.getElementById('save').click()")
        name = os.path.basename(page).replace(".html", ".spz")
        until = time.monotonic() + 60
        while os.listdir(folder) != [name] and time.monotonic() < until:
            time.sleep(0.2)
        self.assertEqual(pathlib.Path(folder, name).read_bytes(), base64.b64decode(element(page, "scene-0")))
        self.succeeds("render", os.path.join(folder, name), "--cameras", "orbit:1", "--images", self.path("from-saved"))

    @support.slow
    def test_the_skull(self):  # 48 photographs, to which the network's scene belongs
        views, scene, page = DATA / "painted_skull", self.path("skull.ply"), self.path("skull.html")
        self.succeeds("reconstruct", views, "--output", scene, "--viewer", page)
        shown = self.shown(page)
        self.assertEqual(shown.evaluate("vsplat.cameras"), 48)
        self.pictures_agree(shown, scene, "orbit:4")
        shown.evaluate("vsplat.click(7)")
        self.assertTrue(shown.evaluate("document.getElementById('photograph').decode().then(() => !document.getElementById('photograph').hidden)"))
        self.is_quiet(shown, page)

    @support.slow
    def test_view_dependent_colour_of_a_million(self):
        """A million Gaussians of degree 3, elongated and turned: the page loads them and agrees."""
        scene, page = self.path("million.ply"), self.path("million.html")
        write_many(scene, 1_000_000)
        self.succeeds("view", scene, "--output", page, "--no-open")
        shown = self.shown(page)
        self.pictures_agree(shown, scene, "orbit:2")
        self.is_quiet(shown, page)

    @support.slow
    def test_the_slider(self):  # Pages tests the names beside it
        for name, colour in (("before", (1, 0, 0)), ("after", (0, 0, 1))):
            support.write_scene(self.path(f"{name}.ply"), [((0, 0, 0), colour, 0.4, 0.99)])
        page = self.path("two.html")
        self.succeeds("view", self.path("after.ply"), "--before", self.path("before.ply"), "--output", page, "--no-open")
        shown = self.shown(page)
        found = {}
        for at in (0, 0.5, 1):
            shown.evaluate(f"vsplat.split({at})")
            values = self.seen(shown)
            found[at] = (is_near((255, 0, 0), values), is_near((0, 0, 255), values))
        self.assertEqual((found[0][0], found[1][1]), (0, 0), found)
        self.assertGreater(min(found[0][1], found[1][0]), 500)
        for half, whole in zip(found[0.5], (found[1][0], found[0][1])):
            self.assertAlmostEqual(half / whole, 0.5, delta=0.1)
        self.is_quiet(shown, page)

    @support.slow
    def test_without_webgl(self):
        support.write_scene(self.path("s.ply"), RED_AND_BLUE)
        self.succeeds("view", self.path("s.ply"), "--output", self.path("s.html"), "--no-open")
        shown = browser.Browser((self.SIZE, self.SIZE), browser.WITHOUT_WEBGL)
        self.addCleanup(shown.__exit__)
        shown.open(self.path("s.html"))
        self.assertIn("WebGL 2", shown.wait_for("!document.getElementById('wait').textContent.startsWith('Loading') && document.body.innerText"))


def write_many(path, count):
    """A PLY of degree 3 on a bumpy sphere; the values that are not positions repeat after 1000 Gaussians."""
    made = random.Random(7)
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", *(f"f_rest_{i}" for i in range(45)), "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
             "rot_1", "rot_2", "rot_3"]
    block = array.array("f")
    for _ in range(1000):
        block.extend([0, 0, 0, *(made.uniform(-1.5, 1.5) for _ in range(3)), *(made.gauss(0, 0.12) for _ in range(45)), made.uniform(0, 4),
                      *(made.uniform(math.log(0.002), math.log(0.02)) for _ in range(3)), *(made.gauss(0, 1) for _ in range(4))])
    with open(path, "wb") as file:
        file.write((f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n" + "".join(f"property float {n}\n" for n in names)
                    + "end_header\n").encode())
        for _ in range(count // 1000):
            for k in range(1000):
                z, turn = made.uniform(-1, 1), made.uniform(0, 2 * math.pi)
                flat, far = math.sqrt(1 - z * z), 1 + 0.15 * math.sin(7 * z + 3 * turn)
                block[k * len(names)], block[k * len(names) + 1], block[k * len(names) + 2] = far * flat * math.cos(turn), far * flat * math.sin(turn), far * z
            file.write(block.tobytes())


if __name__ == "__main__":
    support.main()
