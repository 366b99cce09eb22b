"""Several processes, as mpirun starts them, give the same results as one."""
import glob
import json
import os
import pathlib
import shutil
import signal
import subprocess
import time
import unittest

import support
import train_support

MODULE = os.environ.get("VSPLAT_MPI_MODULE", "")
LAUNCH = ["mpirun", "--oversubscribe", "--allow-run-as-root", "--mca", "btl_vader_single_copy_mechanism", "none"]


def ranks(count, *arguments, env=None):
    """Returns exit code, stdout and stderr."""
    done = subprocess.run([*LAUNCH, "-n", str(count), support.VSPLAT, *map(str, arguments)], capture_output=True, text=True, errors="backslashreplace",
                          timeout=support.PATIENCE, env={**os.environ, "OMP_NUM_THREADS": "1", **(env or {})}, stdin=subprocess.DEVNULL)
    return done.returncode, done.stdout, done.stderr


@unittest.skipUnless(os.path.exists(MODULE) and shutil.which("mpirun"), "built without MPI, or mpirun is not there")
class Ranks(train_support.Case):
    def together(self, count, *arguments):
        code, out, err = ranks(count, *arguments)
        self.assertEqual(code, 0, err)
        return out, err

    def test_training_is_the_same_on_any_number(self):
        config = self.config(batch=2, accumulate=2, parts=4, procedural=0.5)
        self.succeeds(*self.train(config, "one"))
        for count in (2, 4):
            _, err = self.together(count, *self.train(config, f"ranks{count}"))
            self.assertEqual(err.count("at most"), 1, err)  # only one of them reports it
            self.same_training("one", f"ranks{count}", 6)

    def test_resumed_on_another_number(self):
        config = self.config(batch=4, parts=4, steps=4)
        self.succeeds(*self.train(config, "whole"))
        self.together(4, *self.train(config, "resumed"))
        for name in ("checkpoint-00000004.safetensors", "model.safetensors"):
            os.remove(self.path("resumed", name))
        self.together(2, *self.train(config, "resumed", "--resume"))
        self.same_training("whole", "resumed", 4)

    @support.slow
    def test_stages(self):
        """In the quick tests: a training of one stage."""
        config = self.config(batch=2, parts=2, stages=[{"steps": 2}, {"steps": 3, "lr": 1e-4}])
        self.succeeds(*self.train(config, "one"))
        self.together(2, *self.train(config, "two"))
        self.assertEqual(self.read("one", "model.safetensors"), self.read("two", "model.safetensors"))

    def test_what_is_wrong_ends_all_of_them(self):
        code, out, err = ranks(3, *self.train(self.config(batch=2, parts=2), "run"))
        self.assertEqual(code, 2, err)
        self.assertIn("3 processes share the parts", err)
        self.assertFalse(os.path.exists(self.path("run", "log.csv")))
        code, out, err = ranks(2, *self.train(self.config(batch=2, parts=2), "run", data=self.path("nothing")))
        self.assertNotEqual(code, 0)
        self.assertIn("nothing", err)
        bad = self.path("bad")
        shutil.copytree(self.solids, bad)
        for folder in sorted(os.listdir(bad)):
            for picture in glob.glob(os.path.join(bad, folder, "**", "*.png"), recursive=True):
                pathlib.Path(picture).write_bytes(b"no picture")
        code, out, err = ranks(2, *self.train(self.config(batch=2, parts=2), "run", data=bad))
        self.assertEqual(code, 1, err)
        self.assertIn(".png", err)

    def test_a_rank_that_is_killed(self):
        config = self.config(batch=4, parts=4, steps=100000, checkpoint_every=5)
        process = subprocess.Popen([*LAUNCH, "-n", "2", support.VSPLAT, *map(str, self.train(config, "run"))], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True, stdin=subprocess.DEVNULL)
        end = time.time() + support.PATIENCE
        while time.time() < end and not glob.glob(self.path("run", "checkpoint-*")):
            time.sleep(0.05)
        children = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True).stdout.split()
        victim = max(map(int, children))
        os.kill(victim, signal.SIGKILL)
        _, err = process.communicate(timeout=support.PATIENCE)
        self.assertNotEqual(process.returncode, 0)
        self.assertIn("rank", err)
        self.assertIn("signal 9", err)
        steps = max(int(os.path.basename(p)[11:19]) for p in glob.glob(self.path("run", "checkpoint-*.safetensors")))
        longer = self.config(batch=4, parts=4, steps=100000, checkpoint_every=5)
        started = subprocess.Popen([support.VSPLAT, *map(str, self.train(longer, "run", "--resume"))], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        line = ""
        while "going on from step" not in line:
            line = started.stderr.readline()
            self.assertTrue(line)
        started.send_signal(signal.SIGINT)
        started.communicate(timeout=support.PATIENCE)
        self.assertIn(f"going on from step {steps}", line)  # the last checkpoint is complete

    @support.slow
    def test_an_evaluation_is_the_same(self):
        """In the quick tests: a list, whose objects are shared in the same way."""
        model = self.path("model.safetensors")
        self.succeeds("init", "micro", "--seed", 3, "--output", model, "--quiet")
        arguments = ("evaluate", self.solids, "--model", model, "--json")
        one, _ = self.succeeds(*arguments, "--sheet", self.path("one.png"))
        for count in (2, 4):  # more than there are objects
            several, _ = self.together(count, *arguments, "--sheet", self.path(f"{count}.png"))
            self.assertEqual(one, several)
            self.assertEqual(self.read("one.png"), self.read(f"{count}.png"))

    @support.slow
    def test_parts_stay_with_their_kind_of_device(self):
        """In the quick tests: TrainerParts.EachPartStaysWithItsKindOfDevice."""
        config = self.config(batch=6, parts=6, steps=12)
        env = {"POCL_DEVICES": "basic pthread", "VSPLAT_DEVICE": ""}
        code, _, err = ranks(2, *self.train(config, "mixed", "-d", "0,1"), env=env)
        self.assertEqual(code, 0, err)
        self.assertNotIn("other kinds", err)

    def test_what_is_printed_arrives_in_a_pipe(self):
        model = self.path("model.safetensors")
        self.succeeds("init", "micro", "--seed", 3, "--output", model, "--quiet")
        pathlib.Path(self.path("list.txt")).write_text(f"{os.path.join(self.solids, sorted(os.listdir(self.solids))[0])}\tone\n{self.path('gone')}\n")
        command = f'"{support.VSPLAT}" reconstruct --list "{self.path("list.txt")}" --model "{model}" --output "{self.path("out")}" --json | cat'
        done = subprocess.run([*LAUNCH, "-n", "2", "sh", "-c", command], capture_output=True, text=True, timeout=support.PATIENCE, stdin=subprocess.DEVNULL)
        self.assertEqual(len(json.loads(done.stdout)["objects"]), 2, done.stderr)

    def test_one_that_is_asked_to_stop_delays_no_other(self):
        model = self.path("model.safetensors")
        self.succeeds("init", "micro", "--seed", 3, "--output", model, "--quiet")
        views = os.path.join(self.solids, sorted(os.listdir(self.solids))[0])
        pathlib.Path(self.path("list.txt")).write_text("".join(f"{views}\tn{i}\n" for i in range(4000)))
        process = subprocess.Popen([*LAUNCH, "-n", "2", support.VSPLAT, "reconstruct", "--list", self.path("list.txt"), "--model", model, "--output",
                                    self.path("out")], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, stdin=subprocess.DEVNULL)
        end = time.time() + support.PATIENCE
        while time.time() < end and not os.path.exists(self.path("out", "n9.ply")):
            time.sleep(0.02)
        children = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True).stdout.split()
        for child in children:
            os.kill(int(child), signal.SIGTERM)
        _, err = process.communicate(timeout=60)
        self.assertNotEqual(process.returncode, 0, err)
        self.assertIn("--skip-existing continues", err)

    def test_what_mpi_sees_alone_is_not_one_of_several(self):
        self.refuses(2, "sees only one", "evaluate", self.solids, env={"PMI_SIZE": "2"})
        code, _, err = ranks(2, "evaluate", "--table", self.path("table.json"))
        self.assertNotEqual(code, 0)

    def test_a_list_is_the_same(self):
        model = self.path("model.safetensors")
        self.succeeds("init", "micro", "--seed", 3, "--output", model, "--quiet")
        objects = sorted(os.path.join(self.solids, name) for name in os.listdir(self.solids))
        pathlib.Path(self.path("list.txt")).write_text("".join(f"{o}\ta{i}\n{o}\tb{i}\n" for i, o in enumerate(objects)) + self.path("gone") + "\n")
        arguments = ("reconstruct", "--list", self.path("list.txt"), "--model", model, "--json")
        result = {}
        for count in (1, 2, 4):
            code, out, err = ranks(count, *arguments, "--output", self.path(f"out{count}"))
            self.assertEqual(code, 1, err)
            self.assertIn(f"1 of {2 * len(objects) + 1} objects could not", err)
            result[count] = [os.path.basename(o["output"]) for o in json.loads(out)["objects"]]
            for name in os.listdir(self.path("out1")):
                self.assertEqual(self.read("out1", name), self.read(f"out{count}", name), name)
        self.assertEqual(result[1], result[2])
        self.assertEqual(result[1], result[4])
        _, _, err = ranks(2, *arguments, "--output", self.path("out2"), "--skip-existing")
        self.assertIn(f"0 scenes, {2 * len(objects)} were there", err)


class WithoutMpi(support.Case):
    def test_several_processes_do_not_each_do_all(self):
        if os.path.exists(MODULE):
            self.skipTest("built with MPI")
        self.refuses(2, ["one of several", "VSPLAT_MPI"], "evaluate", self.folder, env={"OMPI_COMM_WORLD_SIZE": "2"})


if __name__ == "__main__":
    support.main()
