"""The process that reads meshes and HDF5: the errors if it is missing, crashes or sends nonsense; it ends with the command; and damaged
files end in an error, whatever they do to it."""
import os
import random
import shutil
import signal
import subprocess
import time

import support

LIBRARY = os.environ["VSPLAT_LIBRARY"]
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
PLY = ("ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\n"
       "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
# Inputs that once made the process hang or crash.
WAITS = b"ply\nformat ascii 1.0\n"
CRASHES = b"ply\nformat ascii 1.0\nelemant ve" + bytes.fromhex(
    "0000008020330a70000000000000000100000000000000000000000000803f0000000000000000000000000000803f0000000004000000000000000000803f000000000000")


def children(pid):
    out = []
    for task in os.listdir(f"/proc/{pid}/task"):
        with open(f"/proc/{pid}/task/{task}/children") as f:
            out += [int(child) for child in f.read().split()]
    return out


class MeshCase(support.FolderCase):
    def put(self, name, data):
        with open(self.path(name), "wb") as f:
            f.write(data if isinstance(data, bytes) else data.encode())
        return self.path(name)

    def render(self, *meshes):
        return ("dataset", "render", *meshes, "--output", self.path("set"), "--views", 1, "--size", 16, "--overwrite", "--quiet")

    def damage(self, seed, times):
        """Changed bits, bytes and ends: each gives one of our errors that names the file, or a data set."""
        turn = random.Random(seed)
        for name, text in (("a.obj", OBJ), ("a.ply", PLY)):
            for _ in range(times):
                data = bytearray(text.encode())
                for _ in range(turn.randrange(1, 4)):
                    data[turn.randrange(len(data))] ^= 1 << turn.randrange(8)
                mesh = self.put(name, bytes(data[:turn.choice([len(data), turn.randrange(len(data))])]))
                code, _, err = support.run(*self.render(mesh))
                self.assertIn(code, (0, 1), err)
                if code:
                    self.assertIn(mesh, err)
                    self.assertNotIn("terminate", err)


class Reader(MeshCase):
    def moved(self):
        """The library in another place, without its program. Returns the environment, and the place where the program is expected."""
        os.makedirs(self.path("lib"))
        name = os.path.basename(os.path.realpath(LIBRARY))
        shutil.copy(LIBRARY, self.path("lib", name))
        os.symlink(name, self.path("lib", ".".join(name.split(".")[:3])))
        return {"LD_LIBRARY_PATH": self.path("lib")}, self.path("libexec", "vsplat", "vsplat-read")

    def test_a_program_that_is_missing_or_another(self):
        mesh = self.put("a.obj", OBJ)
        env, program = self.moved()
        self.refuses(1, [program, "installed beside the library"], *self.render(mesh), env=env)
        os.makedirs(os.path.dirname(program))
        for body, words in (("exit 127", "ends as soon as it starts"), ("head -c 1000 /dev/zero >&3", "makes no sense")):
            with open(program, "w") as f:
                f.write("#!/bin/sh\n" + body + "\n")
            os.chmod(program, 0o700)
            self.refuses(1, [program, words], *self.render(mesh), env=env)

    def test_without_what_traces_rays(self):
        env, program = self.moved()
        shutil.copytree(os.path.join(os.path.dirname(LIBRARY), "..", "libexec"), self.path("libexec"))
        rays = os.path.join(os.path.dirname(program), "vsplat-rays.so")
        procedural = ("dataset", "procedural", "--count", 1, "--size", 16, "--views", 1, "--output", self.path("set"), "--overwrite", "--quiet")
        self.succeeds(*procedural, env=env)
        os.unlink(rays)
        self.refuses(1, [rays, "vsplat-rays.so, which draws meshes and random objects, cannot be loaded", "libvsplat1-data"], *procedural, env=env)
        shutil.copy(LIBRARY, rays)  # a library, but not the module
        self.refuses(1, [rays, "does not belong to vsplat"], *procedural, env=env)

    def test_other_formats(self):
        for name in ("a.off", "a.3mf", "a.md5mesh", "a.ase"):
            self.refuses(1, [name, ".obj, .ply, .stl, .gltf and .glb"], *self.render(self.put(name, OBJ)))

    def test_it_goes_with_the_command(self):
        """If the command is killed, its process ends, although nothing tells it to."""
        corners = "".join(f"v {i % 300} {i // 300} {i % 7}\n" for i in range(90000))
        mesh = self.put("a.obj", corners + "".join(f"f {i + 1} {i + 2} {i + 302}\n" for i in range(89000)) * 3)
        command = subprocess.Popen([support.VSPLAT, *map(str, self.render(mesh))], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        found = []
        while not found and command.poll() is None:
            found = children(command.pid)
        self.assertTrue(found)
        command.send_signal(signal.SIGKILL)
        command.wait()
        for _ in range(200):
            if not os.path.exists(f"/proc/{found[0]}") or "Z (zombie)" in open(f"/proc/{found[0]}/status").read():
                return
            time.sleep(0.01)
        self.fail("the process is still there")

    def test_damaged_meshes(self):
        self.damage(5, 2)

    def test_what_waits_and_what_crashes(self):
        begun = time.time()
        self.refuses(1, ["w.ply"], *self.render(self.put("w.ply", WAITS)))
        self.refuses(1, ["c.ply"], *self.render(self.put("c.ply", CRASHES)))
        self.assertLess(time.time() - begun, 60)

    @support.slow
    def test_more_damaged_meshes(self):
        self.damage(6, 10)


if __name__ == "__main__":
    support.main()
