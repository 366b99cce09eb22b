#!/usr/bin/env python3
"""What cmake/install-packages.sh does on a system that it does not know, without apt, or where packages exclude each other."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "cmake" / "install-packages.sh"


class Packages(unittest.TestCase):
    def setUp(self):
        self.work = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.work)

    def run_on(self, release, *arguments, path=None):
        (self.work / "os-release").write_text(release)
        environment = dict(os.environ, VSPLAT_OS_RELEASE=str(self.work / "os-release"), PATH=path or os.environ["PATH"])
        return subprocess.run(["/bin/sh", SCRIPT, *arguments], capture_output=True, text=True, env=environment, check=False)

    def run_with_apt(self, apt_get):
        """On Ubuntu 24.04, where nothing is installed, with this text of a shell script in place of apt-get."""
        programs = {"apt-get": apt_get, "apt-cache": 'echo "  Candidate: 1.0"', "dpkg-query": "exit 1", "sudo": 'exec "$@"'}
        for name, text in programs.items():
            (self.work / name).write_text(f"#!/bin/sh\n{text}\n")
            (self.work / name).chmod(0o755)
        return self.run_on('ID=ubuntu\nVERSION_CODENAME=noble\nPRETTY_NAME="Ubuntu 24.04"\n', "--tests", path=f"{self.work}:{os.environ['PATH']}")

    def test_another_system(self):
        for release in ('ID=fedora\nPRETTY_NAME="Fedora Linux 41"\n', 'ID=ubuntu\nVERSION_CODENAME=jammy\nPRETTY_NAME="Ubuntu 22.04"\n', ""):
            done = self.run_on(release)
            self.assertEqual((done.returncode, done.stdout), (0, ""), release)
            self.assertIn("libopenexr-dev", done.stderr)
            self.assertNotIn("oclgrind", done.stderr)
            self.assertIn("this is Fedora Linux 41" if "fedora" in release else "this is Ubuntu" if release else "an unknown system", done.stderr)
        self.assertIn("oclgrind", self.run_on("ID=arch\n", "--tests").stderr)

    def test_known_system_without_apt(self):
        for program in ("sed", "fold", "tr"):
            (self.work / program).symlink_to(shutil.which(program))
        done = self.run_on('ID=debian\nVERSION_CODENAME=trixie\nPRETTY_NAME="Debian GNU/Linux 13"\n', path=str(self.work))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("libopenexr-dev", done.stderr)

    def test_packages_that_exclude_each_other(self):
        """As on Ubuntu 24.04: the one that comes later is left out, and its tests are named."""
        done = self.run_with_apt('case "$1 $2 $*" in "install -s "*mesa-opencl-icd*libclc-15*) exit 100 ;; "install -s "*) ;; '
                                 'install*) echo "$@" >"$0.asked" ;; esac')
        self.assertEqual(done.returncode, 0, done.stderr)
        asked = (self.work / "apt-get.asked").read_text().split()
        self.assertIn("mesa-opencl-icd", asked)
        self.assertIn("strace", asked)
        self.assertNotIn("libclc-15", asked)
        self.assertIn("no libclc-15 that fits the other packages: this leaves out the tests gpu_static*", done.stderr)
        self.assertEqual(done.stderr.count("leaves out"), 1, done.stderr)

    def test_apt_that_can_install_nothing(self):
        """Its own error is shown, and no package is called one that does not fit."""
        done = self.run_with_apt('case "$1" in install) echo "E: dpkg was interrupted" >&2; exit 100 ;; esac')
        self.assertNotEqual(done.returncode, 0, done.stderr)
        self.assertIn("E: dpkg was interrupted", done.stderr)
        self.assertNotIn("that fits", done.stderr)

    def test_list(self):
        done = self.run_on("ID=arch\n", "--list")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("libfmt-dev\n", done.stdout)
        self.assertNotIn("|", done.stdout)
        self.assertEqual(self.run_on("", "--lost").returncode, 2)


if __name__ == "__main__":
    unittest.main()
