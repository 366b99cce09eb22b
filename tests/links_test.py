"""The documents: every relative link and picture of every *.md leads to an existing file or anchor; README.md is short and narrow, and its
pictures are small; and the sub-commands and options that documents name exist, if $VSPLAT names the command. Uses no network."""
import json
import os
import pathlib
import re
import shlex
import subprocess
import unittest
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parent.parent
FENCE = re.compile(r"^(```|~~~)")
INLINE = re.compile(r"!?\[(?:[^\]\\]|\\.)*\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)")
DEFINITION = re.compile(r"^ {0,3}\[[^\]]+\]:\s+(\S+)", re.M)
TAG = re.compile(r"<(?:a|img)\b[^>]*?\b(?:href|src)=\"([^\"]*)\"")
SOURCES = {".h", ".hpp", ".c", ".cpp", ".cmake", ".txt", ".py", ".sh", ".S"}
MADE_UP = {"VSPLAT_DATA"}  # used by the scripts in model/weights/README.md
COMMANDS = [[], ["bench"], ["completion"], ["convert"], ["dataset", "info"], ["dataset", "procedural"], ["dataset", "render"], ["devices"], ["doctor"], ["evaluate"], ["fit"], ["help"], ["info"], ["init"], ["kernels"], ["mesh"], ["poses"],
            ["profile", "diff"], ["reconstruct"], ["render"], ["report"], ["selftest"], ["train"], ["tune"], ["view"], ["weights", "convert"], ["weights", "import"], ["weights", "info"], ["weights", "verify"]]
OTHERS_OPTIONS = {"--all", "--asan", "--strict"}  # of tests/run.sh
HEADING = re.compile(r"^#{1,6}\s+(.*?)\s*#*$")


def documents():
    """Returns every *.md that git tracks; without git, every *.md except those in build folders."""
    try:
        names = subprocess.run(["git", "-c", f"safe.directory={ROOT}", "ls-files", "-z", "--cached", "--others", "--exclude-standard",
                                "*.md"], cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0")
        found = [ROOT / name for name in names if name]
    except (OSError, subprocess.CalledProcessError):
        found = [p for p in ROOT.rglob("*.md") if p.relative_to(ROOT).parts[0] not in ("build", "out")]
    return sorted(p for p in found if p.is_file())


def lines_outside_code(text):
    """Returns (line number, line) of everything outside fenced blocks."""
    inside = False
    for number, line in enumerate(text.splitlines(), 1):
        if FENCE.match(line.lstrip()):
            inside = not inside
        elif not inside:
            yield number, line


def links(path):
    """Returns (line number, target) of all links and pictures, including HTML tags."""
    text = path.read_text(encoding="utf-8")
    prose = [""] * len(text.splitlines())
    for number, line in lines_outside_code(text):
        prose[number - 1] = re.sub(r"`[^`]*`", lambda code: code.group().replace("](", "] ("), line)  # text about a link is no link
    prose = "\n".join(prose)  # a link may span lines
    for pattern in (INLINE, DEFINITION, TAG):
        for match in pattern.finditer(prose):
            yield prose.count("\n", 0, match.start(1)) + 1, match.group(1)


def anchors(path):
    """Returns the anchors of a page's headings, as sites that show the page make them."""
    out = set()
    for _, line in lines_outside_code(path.read_text(encoding="utf-8")):
        match = HEADING.match(line)
        if not match:
            continue
        title = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", match.group(1)).lower()
        name = re.sub(r"[^\w\- ]", "", title).replace(" ", "-")
        again = 0
        while (f"{name}-{again}" if again else name) in out:
            again += 1
        out.add(f"{name}-{again}" if again else name)
    return out


def problem_with(path, target):
    """Returns what is wrong with a link of the document `path`, or None."""
    if re.match(r"[a-z][a-z0-9+.-]*:", target, re.I) or target.startswith("//"):
        return None  # external: not checked
    file, _, anchor = target.partition("#")
    to = (path.parent / urllib.parse.unquote(file)).resolve() if file else path
    if not to.is_relative_to(ROOT):
        return "leads out of the tree"
    if not to.exists():
        return "leads to nothing"
    if anchor and (to.suffix != ".md" or urllib.parse.unquote(anchor) not in anchors(to)):
        return f"no heading of {to.relative_to(ROOT)} has this anchor"
    return None


def commands(path):
    """Returns (line number, words) of each `vsplat ...` in a fenced block of shell code, without comments, with continued lines joined."""
    shell, text, begin = False, "", 0
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if FENCE.match(line.lstrip()):
            shell = line.strip()[3:] in ("sh", "bash", "shell") and not shell
            continue
        if not shell:
            continue
        begin = begin if text else number
        text += line
        if text.endswith("\\"):
            text = text[:-1] + " "
            continue
        words = shlex.split(text, comments=True)
        text = ""
        if words and words[0].rsplit("/", 1)[-1] == "vsplat":
            yield begin, words[1:]


def source_text():
    """Returns all sources and scripts, concatenated."""
    files = [p for folder in (".ci", "bench", "cmake", "examples", "model", "runtime", "tests") for p in sorted((ROOT / folder).rglob("*"))
             if p.is_file() and (p.suffix in SOURCES or folder == ".ci")]
    return "".join(p.read_text(encoding="utf-8", errors="replace") for p in [ROOT / "CMakeLists.txt", *files])


def found(folder, pattern):
    """Whether `a/b.{h,cpp}`, `a/*.cl`, `a/b`, or `a/b` without its ending exists."""
    braces = re.search(r"\{([^}]*)\}", pattern)
    if braces:
        return all(found(folder, pattern.replace(braces.group(), part, 1)) for part in braces.group(1).split(","))
    return any(any(folder.glob(name)) for name in (pattern, f"{pattern.rstrip('/')}.*"))


class Documents(unittest.TestCase):
    def test_links_lead_somewhere(self):
        checked, wrong = 0, []
        for path in documents():
            for number, target in links(path):
                problem = problem_with(path, target)
                checked += 1
                if problem:
                    wrong.append(f"{path.relative_to(ROOT)}:{number}: {target}: {problem}")
        self.assertEqual(wrong, [])
        self.assertGreater(checked, 50)

    def test_readme_is_short_and_narrow(self):
        lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
        self.assertGreaterEqual(len(lines), 60)
        self.assertLessEqual(len(lines), 90)
        self.assertEqual([f"{i}: {len(line)} columns" for i, line in enumerate(lines, 1) if len(line) > 100], [])

    def test_changes_are_few_and_dated(self):
        sections = re.split(r"^## ", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.M)[1:]
        titles = [section.split("\n", 1)[0] for section in sections]
        self.assertEqual(titles[0], "Unreleased")
        self.assertLess(len(sections[0].splitlines()), 30)
        for title, section in list(zip(titles, sections))[1:]:
            self.assertRegex(title, r"^\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)$")
            self.assertLessEqual(len(section.strip().splitlines()), 25, title)
        version = re.search(r"project\(vsplat VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
        self.assertEqual(titles[1].split()[0], version, "the newest release is what CMakeLists.txt says")

    def test_pictures_are_small(self):
        files = [p for p in (ROOT / "examples/pictures").rglob("*") if p.is_file()]
        shown = {target for _, target in links(ROOT / "README.md") if target.startswith("examples/pictures/")}
        self.assertGreater(len(shown), 0)
        self.assertLessEqual(sum(p.stat().st_size for p in files), 1 << 20)

    def test_a_page_without_errors_is_distinguished_from_one_with(self):
        readme = ROOT / "README.md"
        for target in ("no-such-file.md", "examples/pictures/none.png", "../outside.md", "#no-such-heading",
                       "CONTRIBUTING.md#no-such-heading", "LICENSE#heading"):
            self.assertIsNotNone(problem_with(readme, target), target)
        for target in ("CONTRIBUTING.md", "model/", "#two-commands", "CONTRIBUTING.md#folders", "https://example.org/none"):
            self.assertIsNone(problem_with(readme, target), target)

    def test_functions_and_files_exist(self):
        """`name()`, `Class::name()` and `folder/file` in the documents exist; paths are relative to the root or to the page's folder, and may lack
        their ending. Paths inside a data set or a run's folder are not checked."""
        words = set(re.findall(r"\w+", source_text()))
        top = {p.name for p in ROOT.iterdir() if p.is_dir()}
        checked, wrong = 0, []
        for path in documents():
            rooms = {p.name for p in path.parent.iterdir() if p.is_dir()} if path.parent != ROOT else set()
            for number, line in lines_outside_code(path.read_text(encoding="utf-8")):
                where = f"{path.relative_to(ROOT)}:{number}"
                for code in re.findall(r"`([^`]+)`", line):
                    if re.fullmatch(r"[A-Za-z_:]+\(\)", code):
                        checked += 1
                        if code[:-2].rsplit("::")[-1] not in words:
                            wrong.append(f"{where}: no function {code}")
                    elif re.fullmatch(r"[\w.-]+(/[\w.*{},-]+)+/?", code) and code.split("/")[0] in (top | rooms) - {"build", "out"}:
                        checked += 1
                        if not any(found(folder, code) for folder in (ROOT, path.parent)):
                            wrong.append(f"{where}: no file {code}")
        self.assertEqual(wrong, [])
        self.assertGreater(checked, 50)

    def test_environment_variables_exist(self):
        """Each VSPLAT_NAME in the documents occurs in a source, too."""
        sources, wrong = source_text(), []
        for path in documents():
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
                for name in re.findall(r"VSPLAT_[A-Z_]*[A-Z]", line):
                    if not re.search(rf"\b{name}\b", sources) and name not in MADE_UP:
                        wrong.append(f"{path.relative_to(ROOT)}:{number}: {name}")
        self.assertEqual(wrong, [])


@unittest.skipUnless(os.environ.get("VSPLAT"), "VSPLAT names no command")
class Commands(unittest.TestCase):
    """Sub-commands and options that the documents name exist."""

    @classmethod
    def setUpClass(cls):
        cls.known = {}  # options of each command

    def options(self, *words):
        """Returns the options of a command ("dataset", "render"), or None if there is no such command."""
        if words not in self.known:
            done = subprocess.run([os.environ["VSPLAT"], *words, "--help"], capture_output=True, text=True, timeout=60, check=False)
            there = done.returncode == 0 and f"Usage: {' '.join(['vsplat', *words])} " in done.stdout
            text = re.split(r"\nExamples?:", done.stdout)[0]
            self.known[words] = set(re.findall(r"(?<![\w-])--?[a-zA-Z][a-z-]*", text)) if there else None
        return self.known[words]

    def all_options(self):
        out = set()
        for words in COMMANDS:
            found = self.options(*words)
            self.assertIsNotNone(found, words)
            out |= found
        return out

    def test_commands_that_can_be_copied(self):
        checked, wrong = 0, []
        for path in documents():
            for number, words in commands(path):
                where = f"{path.relative_to(ROOT)}:{number}"
                name = words[:2] if words[0] in ("dataset", "profile", "weights") else words[:1]
                known = self.options(*name)
                checked += 1
                if known is None:
                    wrong.append(f"{where}: no command {' '.join(name)}")
                    continue
                for word in words[len(name):]:
                    option = word.split("=")[0]
                    if re.match(r"--?[a-zA-Z]", option) and option not in known:
                        wrong.append(f"{where}: {' '.join(name)} has no option {option}")
        self.assertEqual(wrong, [])
        self.assertGreater(checked, 30)

    def test_options_that_are_named(self):
        """`--option` in the text is an option of some command, and model/cli/README.md names every option of every command."""
        known, wrong, named = self.all_options(), [], set()
        for path in documents():
            for number, line in lines_outside_code(path.read_text(encoding="utf-8")):
                for code in re.findall(r"`([^`]+)`", line):
                    options = re.findall(r"(?<!\S)--?[a-zA-Z][a-z-]*", code) if re.match(r"--?[a-z]|vsplat ", code) else []
                    wrong += [f"{path.relative_to(ROOT)}:{number}: {o}" for o in options if o not in known | OTHERS_OPTIONS]
                    if path == ROOT / "model/cli/README.md":
                        named |= set(options)
        self.assertEqual(wrong, [])
        full = {o for o in known if o.startswith("--")} - {"--help", "--version"}
        self.assertEqual(sorted(full - named), [])

    def test_the_table_of_sizes_is_what_models_have(self):
        """The table's columns for `small`, with which a training begins, and for the built-in model."""
        run = lambda *args: subprocess.run([os.environ["VSPLAT"], *args], capture_output=True, text=True, timeout=60, check=True).stdout
        inside = json.loads(run("weights", "info", "--json"))["config"]
        rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| ([^|]+) \| ([^|]+) \| ([^|]+) \| [^|]+ \|$",
                          (ROOT / "model/networks/params/README.md").read_text(encoding="utf-8"), re.M)
        self.assertGreater(len(rows), 8)
        small = json.loads(run("train", "--print-config"))["model"]
        text = lambda value: "-" if value is None else " ".join(map(str, value)) if isinstance(value, list) else str(value)
        for names, *columns in rows:
            fields = re.findall(r"`(\w+)`", names)
            for shown, config in zip(columns[1:], (small, inside)):
                self.assertEqual(shown, ", ".join(text(config.get(field)) for field in fields), names)

    def test_fields_of_the_configurations_are_reported(self):
        done = subprocess.run([os.environ["VSPLAT"], "train", "--print-config"], capture_output=True, text=True, timeout=60, check=True)
        config = json.loads(done.stdout)
        for page, fields in (("model/train/README.md", config), ("model/networks/params/README.md", config["model"])):
            named = set(re.findall(r"`(\w+)`", (ROOT / page).read_text(encoding="utf-8")))
            self.assertEqual(sorted(set(fields) - named), [], page)


if __name__ == "__main__":
    unittest.main(verbosity=2)
