"""vsplat fit --live: what is served, to whom, and, in Chromium, that the page follows the fit. Uses only Python's standard library."""
import gzip
import http.client
import json
import re
import signal
import socket
import struct
import subprocess
import time

import browser
import fit_case
import support


class LiveCase(fit_case.FitCase):
    def begin(self, *more, output="out.ply"):
        """A fit that does not end by itself; what it said until its page was there, and the port."""
        arguments = [support.VSPLAT, *map(str, self.fit("--steps", 1000000, "--holdout", 1, *more, output=output))]
        arguments.remove("--quiet")
        process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        for line in process.stderr:
            if found := re.search(r"^http://127\.0\.0\.1:(\d+)/ shows the fit", line):
                return process, int(found.group(1))
        raise AssertionError(f"it ended with {process.wait()} and no page")

    def end(self, process):
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=support.PATIENCE)
        self.assertEqual(process.returncode, 130)

    def get(self, port, path, method="GET", host=None, body=None):
        """-> status, type and body"""
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=support.PATIENCE)
        connection.request(method, path, body, {"Host": host or f"127.0.0.1:{port}"})
        answer = connection.getresponse()
        data = answer.read()
        connection.close()
        return answer.status, answer.getheader("Content-Type"), data

    def state(self, port):
        status, kind, body = self.get(port, "/state.json")
        self.assertEqual((status, kind), (200, "application/json"))
        return json.loads(body)

    def after(self, port, version):
        """The state with a newer scene than that."""
        until = time.monotonic() + support.PATIENCE
        while (state := self.state(port))["version"] <= version:
            self.assertLess(time.monotonic(), until, state)
            time.sleep(0.2)
        return state


class Live(LiveCase):
    """Without a browser."""

    def test_what_is_served(self):
        process, port = self.begin("--live")
        self.assertEqual(self.get(port, "/")[:2], (200, "text/html; charset=utf-8"))
        self.assertIn(b"state.json", self.get(port, "/")[2])
        first = self.after(port, 0)
        self.assertEqual(first["title"], "out.ply")
        self.assertIn("step", first["text"])
        scene = self.get(port, "/scene.spz")[2]
        self.assertEqual(struct.unpack_from("<III", gzip.decompress(scene))[::2], (0x5053474E, 60))
        viewer = self.get(port, "/scene.html")[2].decode()
        about = json.loads(re.search(r'id="about">(.*?)</script>', viewer, re.S).group(1))
        self.assertEqual(len(about["cameras"]), 5)
        page = self.get(port, "/fit.html")[2].decode()
        self.assertEqual((page.count("<svg"), page.count("data:image/jpeg")), (4, 3))
        self.assertIn("when this page was made", page)
        second = self.after(port, first["version"])
        self.assertGreater(second["share"], first["share"])
        self.assertNotEqual(self.get(port, "/scene.spz")[2], scene)
        self.end(process)
        with self.assertRaises(OSError):
            self.state(port)

    def test_drawings_are_over_the_background_of_the_photographs(self):
        process, port = self.begin("--live", "--background", "black")
        self.after(port, 0)
        shown = float(re.search(r"([0-9.]+) dB, psnr_cc", self.get(port, "/fit.html")[2].decode()).group(1))
        self.assertGreater(shown, 12)  # 1 dB if the drawing is over white
        self.end(process)

    def test_to_whom(self):
        process, port = self.begin("--live")
        for path in ("/nothing", "/../etc/passwd", "//"):
            self.assertEqual(self.get(port, path)[0], 404, path)
        self.assertEqual(self.get(port, "/state.json?x=1")[0], 200)
        self.assertEqual(self.get(port, "/", host=f"localhost:{port}")[0], 200)
        for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", "127.0.0.1:1"):
            self.assertEqual(self.get(port, "/state.json", host=host)[0], 403, host)
        for method in ("POST", "PUT", "DELETE", "OPTIONS"):
            self.assertEqual(self.get(port, "/", method, body=b"x" * 100000)[0], 405, method)
        self.assertEqual(self.get(port, "/", "HEAD")[::2], (200, b""))
        with socket.create_connection(("127.0.0.1", port)) as idle:  # neither this nor an end in the middle holds the fit up
            idle.sendall(b"GET / HT")
            self.assertEqual(self.get(port, "/")[0], 200)
        listening = [line.split()[1] for line in open("/proc/net/tcp") if line.split()[3] == "0A"]
        self.assertIn(f"0100007F:{port:04X}", listening)
        self.assertNotIn(f"00000000:{port:04X}", listening)
        second, other = self.begin("--live", output="second.ply")
        self.assertNotEqual(other, port)
        self.refuses_while_running(f"http://127.0.0.1:{port}/", "give another port", "--live", port)
        self.end(process)
        self.assertEqual(self.get(other, "/")[0], 200)
        self.end(second)

    def refuses_while_running(self, *words_and_arguments):
        words, arguments = words_and_arguments[:2], words_and_arguments[2:]
        code, _, err = support.run(*self.fit("--steps", 2, *arguments, output="third.ply"))
        self.assertEqual(code, 1, err)
        for word in words:
            self.assertIn(word, err)

    def test_wrong_ports(self):
        for port in ("0", "65536", "999999"):
            self.refuses(2, ["--live is", port, "1 to 65535"], *self.fit("--live=" + port))
        self.refuses(2, ["--live is \"x\""], *self.fit("--live=x"))

    def test_the_result_is_the_same(self):
        """The option's place among others does not matter, nor does the page: the bytes are those without it."""
        self.json_of(*self.fit("--steps", 30, "--holdout", 1))
        self.json_of("fit", "--live", self.photos, "--start", self.ball, "--output", self.path("live.ply"), "--quiet", "--steps", 30, "--holdout", 1)
        with open(self.path("out.ply"), "rb") as a, open(self.path("live.ply"), "rb") as b:
            self.assertEqual(a.read(), b.read())


@support.unittest.skipUnless(browser.CHROMIUM, "there is no Chromium")
class InTheBrowser(LiveCase):
    @support.slow
    def test_the_page_follows_the_fit(self):  # Live covers what is served
        process, port = self.begin("--live")
        with browser.Browser((1200, 800)) as shown:
            shown.send("Page.navigate", url=f"http://127.0.0.1:{port}/")
            shown.wait_for("window.live && live.shown.version > 0")
            first = shown.evaluate("live.shown.version")
            inside = "live.viewer().contentWindow.vsplat"
            before = shown.evaluate(f"{inside}.pose()")
            shown.screenshot(self.path("first.png"))
            shown.wait_for(f"live.shown.version > {first}")
            self.assertEqual(shown.evaluate(f"{inside}.pose()"), before)  # the view stays
            shown.screenshot(self.path("second.png"))
            self.assertEqual(shown.problems, [])
            hosts = {url.split("/")[2] for url in shown.requests if url.startswith("http")}
            self.assertEqual(hosts, {f"127.0.0.1:{port}"})
            with open(self.path("first.png"), "rb") as a, open(self.path("second.png"), "rb") as b:
                self.assertNotEqual(a.read(), b.read())
            self.end(process)
            shown.wait_for("document.getElementById('state').textContent.includes('has ended')")


if __name__ == "__main__":
    support.main()
