#!/usr/bin/env python3
"""check_skipped.py RESULTS NAMES CASES: fails if a test was skipped or not run, unless tests/may-skip.txt names it.

RESULTS: the output of ctest --output-junit. NAMES: the output of `ctest --show-only=json-v1`. CASES: the folder in which GoogleTest wrote the
result of each case of a suite. A pattern that matches no test is an error, too."""
import fnmatch
import json
import pathlib
import sys
import xml.etree.ElementTree as xml

LIST = pathlib.Path(__file__).with_name("may-skip.txt")


def allowed():
    """Returns [(pattern, reason)]."""
    out = []
    for number, line in enumerate(LIST.read_text().splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            pattern, _, reason = line.partition(" ")
            if not reason.strip():
                sys.exit(f"{LIST}:{number}: {pattern} has no reason")
            out.append((pattern, reason.strip()))
    return out


def skipped(results):
    """Returns the names of the tests that did not run to their end."""
    cases = list(xml.parse(results).getroot().iter("testcase"))
    if not cases:
        sys.exit(f"{results}: no test ran")
    return [case.get("name") for case in cases if case.get("status") not in ("run", "fail")]


def cases_of_suites(folder):
    """Returns {name: whether it was skipped}. A suite that crashed has no entries; it counts as failed."""
    out = {}
    for path in sorted(pathlib.Path(folder).glob("*.xml")):
        for case in xml.parse(path).getroot().iter("testcase"):
            out[f'{case.get("classname")}.{case.get("name")}'] = case.get("result") != "completed"
    if not out:
        sys.exit(f"{folder}: no case ran")
    return out


def main():
    results, names, folder = sys.argv[1:]
    cases = cases_of_suites(folder)
    with open(names) as f:
        known = [test["name"] for test in json.load(f)["tests"]] + list(cases)
    patterns, wrong = allowed(), 0
    for pattern, _ in patterns:
        if not fnmatch.filter(known, pattern):
            print(f"{LIST.name}: {pattern} is the name of no test", file=sys.stderr)
            wrong += 1
    for name in skipped(results) + [name for name, was in cases.items() if was]:
        reason = next((reason for pattern, reason in patterns if fnmatch.fnmatchcase(name, pattern)), None)
        if reason:
            print(f"skipped: {name}: {reason}")
        else:
            print(f"skipped, which counts as failed: {name} (tests/may-skip.txt does not name it)", file=sys.stderr)
            wrong += 1
    sys.exit(1 if wrong else 0)


main()
