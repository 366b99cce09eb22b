"""vsplat train on a full disk: a separate file system, which most users may not mount (see tests/may-skip.txt)."""
import json
import os
import re
import subprocess
import time

import support
import train_support


class FullDisk(train_support.Case):
    def full_disk(self, config, run):
        """A resumed run that cannot write a checkpoint, or its model, fails and loses none."""
        before = {n: self.read(run, n) for n in os.listdir(self.path(run)) if n.startswith("checkpoint-")}
        self.assertTrue(before)
        process = self.start(*self.train(config, run, "--resume"))
        err = process.communicate(timeout=120)[1]
        self.assertEqual(process.returncode, 1, err)
        self.assertRegex(err, re.escape(self.path(run)) + r"/(checkpoint-|model\.safetensors).*No space left")
        after = {n: self.read(run, n) for n in os.listdir(self.path(run)) if n.startswith("checkpoint-")}
        self.assertEqual(before, after)

    def stopped_run(self, config, run):
        """A run that was killed as soon as it had a checkpoint."""
        process = self.start(*self.train(config, run))
        while not any(n.endswith("02.safetensors") for n in os.listdir(self.path(run)) if n.startswith("checkpoint-")) \
                if os.path.isdir(self.path(run)) else True:
            self.assertIsNone(process.poll())
            time.sleep(0.005)
        process.kill()
        process.communicate()

    def test_full_disk(self):
        os.makedirs(self.path("disk"))
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8m", "none", self.path("disk")], capture_output=True).returncode != 0:
            self.skipTest("no file system can be mounted here")
        self.addCleanup(subprocess.run, ["umount", self.path("disk")])
        config = self.config(steps=200, log_every=50)
        self.stopped_run(config, os.path.join("disk", "run"))
        room = os.statvfs(self.path("disk"))
        with open(self.path("disk", "filler"), "wb") as f:
            f.write(b"\0" * max(0, room.f_bavail * room.f_bsize - 20000))
        self.full_disk(config, os.path.join("disk", "run"))
        os.remove(self.path("disk", "filler"))
        out, _ = self.succeeds(*self.train(self.config(steps=200, log_every=50, keep_checkpoints=1), os.path.join("disk", "run"), "--resume", "--json"))
        self.assertEqual(json.loads(out)["step"], 200)


if __name__ == "__main__":
    support.main()
