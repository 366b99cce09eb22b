"""vsplat fit: the page beside a scene, and its settings, which a later fit takes."""
import base64
import html.parser
import json
import os
import pathlib
import re
import subprocess
import time

import fit_case
import support


class Page(html.parser.HTMLParser):
    """A page's text, elements and attributes; asserts that every element is closed in its order."""
    SINGLE = ("meta", "img", "circle", "line", "path")

    def __init__(self, text):
        super().__init__()
        self.text, self.open, self.elements = "", [], []
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in self.SINGLE:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.SINGLE:
            assert self.open and self.open.pop() == tag, tag

    def handle_data(self, data):
        self.text += data

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


class FitPage(fit_case.FitCase):
    def page(self, name):
        return Page(pathlib.Path(self.path(name)).read_text())

    def test_its_page(self):
        """Curves, held-out pictures with their drawings, times and settings; no script, nothing fetched, names escaped."""
        listed = os.path.join(self.photos, "transforms.json")
        views = json.load(open(listed))
        odd = 'images/<b>"&\'.png'
        os.rename(os.path.join(self.photos, views["frames"][2]["file_path"]), os.path.join(self.photos, odd))
        views["frames"][2]["file_path"] = odd
        json.dump(views, open(listed, "w"))
        result = self.json_of(*self.fit("--holdout", "@2,@4", "--steps", 60, "--profile", self.path("profile.json")))
        self.assertEqual(result["page"], self.path("out.fit.html"))
        page = self.page("out.fit.html")
        self.assertEqual([page.all(tag) for tag in ("script", "link", "iframe", "b")][:3], [[], [], []])
        self.assertTrue(all(not value.startswith(("http", "//")) for _, attributes in page.elements for value in attributes.values() if value))
        self.assertIn("default-src 'none'", next(m["content"] for m in page.all("meta") if "http-equiv" in m))
        self.assertEqual(len(page.all("svg")), 4)
        self.assertEqual(len(page.all("img")), 6)
        for image in page.all("img"):
            kind, _, data = image["src"].partition(",")
            self.assertEqual(kind, "data:image/jpeg;base64")
            self.assertTrue(base64.b64decode(data, validate=True).startswith(b"\xff\xd8\xff"))
        self.assertIn(odd, page.text)  # as text: an element b would not close
        for picture in result["held_out"]:
            for figure in (f"{picture['psnr']:.2f}", f"{picture['psnr_cc']:.2f}", f"{picture['ssim']:.4f}"):
                self.assertIn(figure, page.text)
        for word in ("Loss", "PSNR, held out", "Gaussians", "Time of a step", "fitting", "by stage", "max-gaussians"):
            self.assertIn(word, page.text)
        self.json_of(*self.fit("--holdout", "none", "--steps", 2, "--page", "none", output="b.ply"))
        self.assertFalse(os.path.exists(self.path("b.fit.html")))
        self.json_of(*self.fit("--steps", 2, "--page", self.path("elsewhere.html"), output="c.ply"))
        self.assertIn("left out in turn", self.page("elsewhere.html").text)
        self.refuses(2, ["--page", ".html"], *self.fit("--page", "x.txt", output="d.ply"))

    def test_curves_of_a_long_fit(self):
        """They have fewer points than the fit has steps, and end at the last step. Its log has all."""
        for more in ((), ("--log", self.path("log.csv"))):
            self.json_of(*self.fit("--holdout", "@2", "--steps", 1000, "--overwrite", *more))
            text = pathlib.Path(self.path("out.fit.html")).read_text()
            xs = [float(x) for x in re.findall(r"([\d.]+) [\d.]+", re.search(r'class="curve"[^>]* d="([^"]*)"', text)[1])]
            self.assertTrue(200 < len(xs) < 500, len(xs))
            self.assertEqual(xs, sorted(xs))
            self.assertEqual(xs[-1], float(re.search(r'x="([\d.]+)"[^>]*>1000<', text)[1]))
        with open(self.path("log.csv")) as log:
            self.assertEqual([int(line.split(",")[0]) for line in log.readlines()[1:]], list(range(1, 1001)))

    def test_a_file_that_cannot_be_written_does_not_cost_the_scene(self):
        state = self.path("state")
        process = subprocess.Popen([support.VSPLAT, *map(str, self.fit("--holdout", "none", "--steps", 300, "--checkpoint", state, "--sheet",
                                                              self.path("gone", "sheet.png")))], stderr=subprocess.PIPE, text=True)
        while not os.path.isdir(state):
            self.assertIsNone(process.poll())
            time.sleep(0.005)
        pathlib.Path(self.path("gone")).write_text("a file where the sheet's folder should be")
        err = process.communicate(timeout=300)[1]
        self.assertEqual(process.returncode, 1, err)
        self.assertRegex(err, r"out\.ply is written; .*sheet\.png is not: .*gone")
        for name in ("out.ply", "out.fit.json", "out.fit.html"):
            self.assertTrue(os.path.getsize(self.path(name)) > 0, name)

    def test_its_settings_are_written_and_given_back(self):
        more = ("--holdout", "@1", "--steps", 12, "--size", 20, "--seed", 5, "--exposure", "--freeze", "rotations", "--quality", "normal", "--object",
                "--strategy", "error", "--antialias", "--background", "#204060", "--near", 0.3)
        for start in (self.ball, "random"):
            with self.subTest(start=start):
                self.succeeds(*self.fit(*more, start=start), "--overwrite")
                record = json.load(open(self.path("out.fit.json")))
                settings = record["settings"]
                self.assertEqual([settings[name] for name in ("start", "steps", "size", "seed", "exposure", "poses", "freeze", "holdout", "max-gaussians")],
                                 [start, 12, 20, 5, True, False, "rotations", "@1", None])
                self.assertEqual([settings[name] for name in ("quality", "object", "scene", "strategy", "antialias", "background", "near", "consolidate", "masks",
                                                              "invert-masks")],
                                 ["normal", True, False, "error", True, "#204060", 0.3, None, "object", False])
                self.assertEqual(record["derived"]["extent"], "object")
                self.assertEqual((record["counts"]["views"], record["counts"]["held_out"]), (5, 1))
                self.assertTrue(record["vsplat"] and record["device"]["name"])
                again = ("fit", self.photos, "--settings", self.path("out.fit.json"), "--output", self.path("again.ply"), "--overwrite", "--quiet")
                self.succeeds(*again)
                self.assertEqual(pathlib.Path(self.path("out.ply")).read_bytes(), pathlib.Path(self.path("again.ply")).read_bytes())
                self.assertEqual(json.load(open(self.path("again.fit.json")))["settings"], settings)
                self.succeeds(*again, "--seed", 6)  # the command line comes first
                self.assertEqual(json.load(open(self.path("again.fit.json")))["settings"], {**settings, "seed": 6})
                self.assertNotEqual(pathlib.Path(self.path("out.ply")).read_bytes(), pathlib.Path(self.path("again.ply")).read_bytes())

    def test_settings_in_effect_give_the_same_bytes_when_nothing_was_given(self):
        """Defaults, views left out in turn: the number of steps is found again."""
        self.succeeds(*self.fit("--time", 1e6, "--size", 12))
        settings = json.load(open(self.path("out.fit.json")))["settings"]
        self.assertEqual((settings["steps"], settings["holdout"], settings["sh"]), (None, "auto", 0))
        self.succeeds("fit", self.photos, "--settings", self.path("out.fit.json"), "--output", self.path("again.ply"), "--quiet")
        self.assertEqual(pathlib.Path(self.path("out.ply")).read_bytes(), pathlib.Path(self.path("again.ply")).read_bytes())
        self.succeeds(*self.fit("--holdout", "none", "--freeze", "means,sh", output="b.ply"))
        settings = json.load(open(self.path("b.fit.json")))["settings"]
        self.assertEqual((settings["steps"], settings["freeze"]), (100, "means,sh"))
        self.assertEqual([settings[name] for name in ("start", "quality", "strategy", "background", "masks")], [self.ball, "draft", "mcmc", "auto", "object"])

    def test_what_the_command_line_decides_is_not_taken_from_the_file(self):
        def settings(given, *more):
            result = self.json_of(*self.fit("--settings", self.write("given.json", given), "--holdout", "none", "--overwrite", *more))
            return json.load(open(result["settings"]))["settings"]
        self.assertEqual(settings({"scene": True, "steps": 3}, "--object")["object"], True)
        result = settings({"quality": "normal", "steps": 3, "size": 12}, "--quality", "draft")
        self.assertEqual((result["quality"], result["steps"], result["size"]), ("draft", 100, 512))
        result = settings({"quality": "normal", "steps": 3, "size": 12})
        self.assertEqual((result["quality"], result["steps"], result["size"]), ("normal", 3, 12))

    def test_names_like_numbers_come_back_as_they_were(self):
        for name, other in (("0001", "1.50"), ("0003", "1e3")):
            os.rename(os.path.join(self.photos, "images", name + ".png"), os.path.join(self.photos, "images", other + ".png"))
        listed = pathlib.Path(self.photos, "transforms.json")
        listed.write_text(listed.read_text().replace("0001.png", "1.50.png").replace("0003.png", "1e3.png"))
        for name in ("1.50", "1e3"):
            self.succeeds(*self.fit("--holdout", name, "--steps", 2), "--overwrite")
            self.assertEqual(json.load(open(self.path("out.fit.json")))["settings"]["holdout"], name)
            result = self.json_of("fit", self.photos, "--settings", self.path("out.fit.json"), "--output", self.path("again.ply"), "--overwrite", "--quiet")
            self.assertEqual([os.path.basename(each) for each in result["measured_on"]], [name + ".png"])

    def test_wrong_settings(self):
        def refused(words, settings):
            with open(self.path("wrong.json"), "w") as f:
                f.write(settings if isinstance(settings, str) else json.dumps(settings))
            self.refuses(1 if isinstance(settings, str) else 2, [self.path("wrong.json"), *words], "fit", self.photos, "--start", self.ball, "--output",
                         self.path("x.ply"), "--settings", self.path("wrong.json"))
        refused(["step:", "steps"], {"step": 3})
        refused(["settings.step:"], {"settings": {"step": 3}})
        refused(["colour"], {"settings": {}, "colour": 3})
        refused(["output:"], {"output": "y.ply"})
        refused(["poses", "true or false"], {"poses": 1})
        refused(["sh is 9"], {"sh": 9})
        refused(["steps", "text"], {"steps": {}})
        refused(["views is", "without commas"], {"views": ["a,b.png"]})
        refused(["object"], [3])
        refused(["settings.steps is", "many", "whole number"], {"settings": {"steps": "many"}})
        refused(["steps is", "1e+300"], {"steps": 1e300})
        refused(["near is", "-1"], {"near": -1})
        refused(["background is", "skyish"], {"background": "skyish"})
        refused(["object", "scene"], {"scene": True, "object": True})
        refused(["nested"], '{"steps": ' + "[" * 100000 + "]" * 100000 + "}")
        refused(["wrong.json: holds a number that is too large", "1e999"], '{"steps": 1e999}')
        refused(["is not valid JSON: parse error at line 1"], "{")
        self.refuses(2, "--steps is", "fit", self.photos, "--start", self.ball, "--output", self.path("x.ply"), "--steps", "many", "--settings",
                     self.write("fine.json", {"steps": 3}))
        self.refuses(1, ["nowhere.json"], *self.fit("--settings", self.path("nowhere.json")))

    def write(self, name, value):
        with open(self.path(name), "w") as f:
            json.dump(value, f)
        return self.path(name)


if __name__ == "__main__":
    support.main()
