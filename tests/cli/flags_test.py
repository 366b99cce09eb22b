"""The library's messages name fields and functions of its interface; the command replaces them by its options."""
import glob
import os
import re

import support

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")


def library_literals():
    """Returns (file and line, text) of every string in the library's sources."""
    for folder in ("model", "runtime"):
        for path in sorted(glob.glob(os.path.join(ROOT, folder, "**", "*.*"), recursive=True)):
            if not path.endswith((".cpp", ".h")) or os.path.join("model", "cli", "") in path:  # the command is not part of the library
                continue
            text = re.sub(r'"\s*\n\s*"', "", open(path).read())
            for number, line in enumerate(text.split("\n"), 1):
                if line.lstrip().startswith(("//", "#include")):
                    continue
                for literal in re.findall(r'"((?:[^"\\]|\\.)*)"', line):
                    yield f"{os.path.relpath(path, ROOT)}, about line {number}", literal


class Flags(support.Case):
    def test_the_library_names_no_option_of_the_command_line(self):
        for where, text in library_literals():
            # Command lines of other programs, and of the command that finds cameras.
            others = re.sub(r"`(?!vsplat)[^`]*`|\\n  (?!vsplat(?! poses))(?:(?!\\n).)*", "", text)
            self.assertIsNone(re.search(r"--[a-z]", others), f"{where}: {text}")

    def test_every_name_has_its_option(self):
        names = [set(re.findall(r"^ *(?:FIELD|FUNCTION)\((.*?)(?:, \"[^\"]*\")?\),$", open(os.path.join(ROOT, "model", *path)).read(), re.M))
                 for path in (("api", "option_names.cpp"), ("cli", "flags.cpp"))]
        of_c = {name.split(", ", 1)[1] for name in names[0]}  # FIELD(option, struct, field) or FUNCTION(option, name)
        self.assertGreater(len(of_c), 50)
        self.assertEqual(of_c, names[1])

    def test_messages_name_an_option_not_its_field(self):
        for where, text in library_literals():
            if not where.startswith(tuple(os.path.join("model", "api", own) for own in ("option_names.cpp", "include"))):
                self.assertIsNone(re.search(r"\bvsplat_((train|model|views|mesh|set)_\w+|\w+_options\.\w|file_rules\.\w)", text), f"{where}: {text}")

    def test_the_user_reads_the_option(self):
        err = self.refuses(1, ["no device", "(--device)"], *self.reconstruct("--device", "quantum"))
        self.assertNotIn("vsplat_", err)
        aside = self.reconstruct("--center", "0,500,0")  # in no view's picture
        err = self.refuses(1, ["outside", "--center and --scale, or --auto-frame", "(--force continues"], *aside)
        self.assertNotIn("vsplat_", err)
        self.refuses(2, "--views nobody", *self.reconstruct("--views", "0,nobody"))
        err = self.refuses(1, "(--max-memory, ", *self.reconstruct("--max-memory", "0.0005"))
        self.assertNotIn("vsplat_", err)
        _, err = self.succeeds(*aside, "--force")
        self.assertIn("warning: the centre", err)
        self.assertIn("--center and --scale", err)
        self.assertNotIn("vsplat_", err)


if __name__ == "__main__":
    support.main()
