"""The example that shows a scene in a window, on a separate screen."""
import os
import shutil
import subprocess
import sys
import unittest

import support

WINDOW = os.environ.get("VSPLAT_WINDOW", "")


@unittest.skipUnless(WINDOW and shutil.which("xvfb-run"), "no window example (libsdl2-dev), or no screen for it (xvfb, xauth)")
class Window(support.Case):
    def show(self, *arguments):
        for _ in range(3):
            done = subprocess.run(["xvfb-run", "-a", "-s", "-screen 0 800x600x24", WINDOW, *arguments], capture_output=True, text=True, timeout=120)
            if done.returncode != 5:  # the screen could not be made: another one took its number
                break
        return done.returncode, done.stderr

    def setUp(self):
        super().setUp()
        # Red on one side, blue on the other.
        support.write_scene(self.path("s.ply"), [((0.4, 0, 0), (1, 0, 0), 0.1, 0.95), ((-0.4, 0, 0), (0, 0, 1), 0.1, 0.95)])

    def colours(self, name):
        """Returns the columns of the red pixels and of the blue pixels."""
        width, height, pixels = support.read_png(self.path(name))
        red, blue = [], []
        for i in range(width * height):
            r, g, b = pixels[3 * i:3 * i + 3]
            if g < 100 and r > 200 > b:
                red.append(i % width)
            elif g < 100 and b > 200 > r:
                blue.append(i % width)
        return red, blue

    def test_the_scene_turns(self):
        for frames in (1, 90):
            code, err = self.show(self.path("s.ply"), str(frames), self.path(f"{frames}.png"))
            self.assertEqual(code, 0, err)
        (red, blue), (red_after, blue_after) = self.colours("1.png"), self.colours("90.png")
        for pixels in (red, blue, red_after, blue_after):
            self.assertGreater(len(pixels), 100)
        mean = lambda pixels: sum(pixels) / len(pixels)
        # After half a turn they have changed sides.
        self.assertGreater((mean(red) - mean(blue)) * (mean(blue_after) - mean(red_after)), 50 * 50)

    def test_it_rests_until_something_changes(self):
        inside = [sys.executable, os.path.join(os.path.dirname(os.path.abspath(__file__)), "window_rest.py"), WINDOW, self.path("s.ply")]
        done = subprocess.run(["xvfb-run", "-a", "-s", "-screen 0 800x600x24", *inside], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stderr)
        moved, sideways, up, resized = map(int, done.stdout.split())
        self.assertEqual(moved, 0, "a pointer that moves over the window changes nothing")
        self.assertEqual(sideways, 0, "a wheel that is rolled sideways changes nothing")
        self.assertGreater(up, 0)
        self.assertGreater(resized, 0)

    def test_what_is_no_scene_is_reported(self):
        code, err = self.show(self.path("none.ply"), "1")
        self.assertEqual(code, 1)
        self.assertIn("none.ply", err)
        self.assertEqual(self.show(self.path("s.ply"), "none")[0], 2)


if __name__ == "__main__":
    support.main()
