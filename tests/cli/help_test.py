"""How the command describes itself: help, man pages and shell completion agree, and no option is accepted that has no effect."""
import os
import re
import shutil
import subprocess

import support

SHELLS = ("bash", "zsh", "fish")


def commands():
    """Every command as a list of words, read from --help only."""
    out, left = [], [[]]
    while left:
        at = left.pop(0)
        out.append(at)
        listed = re.search(r"^Subcommands:\n((?:  .*\n)+)", help_of(at), re.M)
        left += [at + [line.split()[0]] for line in (listed.group(1).splitlines() if listed else []) if re.match(r"  \S", line)]
    return out


def help_of(words):
    code, out, err = support.run(*words, "--help")
    assert code == 0, err
    return out


def options_of(words):
    """Returns [names of one option] for each option."""
    found = []
    for line in re.split(r"\nExamples?:", help_of(words))[0].splitlines():
        names = re.match(r"  (--?[a-zA-Z][\w,-]*)", line)
        if names:
            found.append(names.group(1).split(","))
    return found


class Help(support.FolderCase):
    def test_help_is_a_command(self):
        for words in commands():
            with self.subTest(words=words):
                self.assertEqual(support.run("help", *words)[:2], (0, help_of(words)))
        self.assertGreater(len(commands()), 15)
        self.refuses(2, ["no command redner", "did you mean render"], "help", "redner")
        self.refuses(2, "weights has no command infos; did you mean info", "help", "weights", "infos")

    def test_layout(self):
        """Names stand in column 3 and what they mean in column 39, whichever release of CLI11 is installed."""
        for words in commands():
            rows = re.findall(r"^  .*", re.split(r"\nExamples?:\n", help_of(words))[0], re.M)
            for row, after in zip(rows, rows[1:] + [""]):
                with self.subTest(words=words, row=row):
                    self.assertLessEqual(len(row), 118)
                    if not row.startswith("   ") and (len(row) <= 38 or row[37] != " "):        # a long name, alone
                        self.assertRegex(after, r"^ {38}\S") if len(row) >= 38 else None
                    else:
                        self.assertRegex(row, r"^  .{36}\S")
        self.assertIn("\nUsage: vsplat render [OPTIONS] SCENE\n\nPositionals:\n  SCENE REQUIRED  ", help_of(["render"]))
        self.assertIn("\nPictures:\n  --cameras CAMERAS|orbit:N|path:CAMERAS:N\n", help_of(["render"]))
        self.assertIn("\nExamples:\n  vsplat render ", help_of(["render"]))
        self.assertIn("Subcommands:\n  info        ", help_of(["weights"]))

    def test_man_pages(self):
        self.succeeds("help", "--man-pages", self.path("man1"))
        self.refuses(1, ["vsplat.1", "exists"], "help", "--man-pages", self.path("man1"))
        names = ["-".join(["vsplat", *words]) for words in commands()]
        self.assertEqual(sorted(os.listdir(self.path("man1"))), sorted(f"{name}.1" for name in names))
        for words, name in zip(commands(), names):
            with self.subTest(words=words):
                page = open(self.path("man1", f"{name}.1")).read()
                self.assertEqual(self.succeeds("help", "--man", *words)[0], page)
                plain = page.replace("\\-", "-").replace("\\e", "\\").replace("\\&", "")
                for option in options_of(words):
                    self.assertIn(", ".join(f"\\fB{n}\\fR".replace("\\fB-", "\\fB-") for n in option), plain)
                if shutil.which("groff"):
                    drawn = subprocess.run(["groff", "-man", "-Tascii", "-ww", "-P-c"], input=page, capture_output=True, text=True, check=True)
                    self.assertEqual(drawn.stderr, "")
                    examples = re.search(r"\n(  vsplat .*)\n", help_of(words))
                    self.assertIn(examples.group(1).strip(), drawn.stdout) if examples else None

    def test_completion_knows_every_option(self):
        for shell in SHELLS:
            text, _ = self.succeeds("completion", shell)
            for words in commands():
                for names in options_of(words):
                    for name in names:
                        shown = {"bash": name, "zsh": f"){name}[", "fish": f" -l {name[2:]}" if name[1] == "-" else f" -s {name[1:]}"}[shell]
                        self.assertIn(shown, text)
            if shutil.which(shell):
                subprocess.run([shell, "-n"], input=text, text=True, check=True)
        self.refuses(2, "shell", "completion")
        self.refuses(2, "csh", "completion", "csh")

    def complete(self, *words):
        """Returns what bash proposes for the last of these words."""
        open(self.path("vsplat.bash"), "w").write(self.succeeds("completion", "bash")[0])
        script = 'source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _vsplat; printf "%s\\n" "${COMPREPLY[@]}"'
        done = subprocess.run(["bash", "-c", script, "bash", self.path("vsplat.bash"), "vsplat", *words], capture_output=True, text=True, check=True)
        return done.stdout.split()

    def test_bash_completes(self):
        self.assertEqual(self.complete("recon"), ["reconstruct"])
        self.assertEqual(sorted(self.complete("")), sorted(words[0] for words in commands() if len(words) == 1))
        self.assertEqual(self.complete("weights", "v"), ["verify"])
        self.assertEqual(self.complete("weights", "convert", "--dt"), ["--dtype"])
        self.assertEqual(self.complete("weights", "convert", "--dtype", ""), ["f16", "f32"])
        self.assertEqual(self.complete("reconstruct", "photos", "--crop", "o"), ["object"])
        self.assertEqual(self.complete("dataset", "render", "--tex"), ["--texture"])
        self.assertEqual(self.complete("render", "--tex"), [])           # not the data set's option
        self.assertEqual(self.complete("bench", "--kernels", "g"), ["gpu"])
        self.assertEqual(self.complete("reconstruct", "--scale", ""), [])
        self.assertEqual(sorted(self.complete("render", "-")), sorted(n for names in options_of(["render"]) for n in names))


class Options(support.Case):
    def test_none_is_taken_that_does_nothing(self):
        commands = {("devices",): ["--profile", "--trace", "--device", "--kernels", "--gemm", "--max-memory", "--overwrite"],
                    ("init", "micro", "--seed", "1", "--output", self.path("x")): ["--profile", "--trace", "--device", "--kernels"],
                    ("kernels",): ["--profile", "--trace", "--allow-outside"],
                    ("weights", "info"): ["--profile", "--device", "--overwrite"],
                    ("weights", "verify"): ["--profile", "--device", "--overwrite"],
                    ("weights", "convert", self.model, "--dtype", "f16", "--output", self.path("x")): ["--profile", "--device", "--gemm"],
                    ("dataset", "procedural", "--count", "1", "--output", self.path("x")): ["--profile", "--device"],
                    ("dataset", "info", self.path("views")): ["--profile", "--device"]}
        values = {"--device": "cpu", "--kernels": "cpu", "--gemm": "own", "--max-memory": "1"}
        for command, options in commands.items():
            for option in options:
                with self.subTest(command=command[0], option=option):
                    value = [] if option == "--overwrite" else [values.get(option, self.path("p.json"))]
                    self.refuses(2, option, *command, option, *value)

    def test_options_that_others_make_useless(self):
        self.refuses(2, ["--seed", "random10"], "evaluate", self.path("views"), "--model", self.model, "--seed", 3)
        open(self.path("voxels.txt"), "w").write("1\n")
        self.refuses(2, ["--selection-seed", "--selection"], *self.reconstruct("--selection", self.path("voxels.txt"), "--selection-seed", 3))

    def test_a_dry_run_has_no_profile(self):
        for option in ("--profile", "--trace"):
            self.refuses(2, [option, "--dry-run"], *self.reconstruct("--dry-run", option, self.path("p.json")))
        support.write_scene(self.path("scene.ply"), [((0, 0, 0), (1, 0, 0), 0.1, 0.9)])
        self.refuses(2, "--profile", "render", self.path("scene.ply"), "--cameras", "orbit:1", "--dry-run", "--profile", self.path("p.json"))


if __name__ == "__main__":
    support.main()
