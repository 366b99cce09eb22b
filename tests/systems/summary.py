#!/usr/bin/env python3
"""summary.py BUILD: prints how many tests passed, failed and were skipped, with the last two's names and reasons.

BUILD: a folder that tests/run.sh has built and tested."""
import pathlib
import re
import sys
import xml.etree.ElementTree as xml

build = pathlib.Path(sys.argv[1])
by_status = {"run": [], "fail": [], "notrun": []}
for case in xml.parse(build / "tests.xml").getroot().iter("testcase"):
    by_status.setdefault(case.get("status"), []).append(case)
print(f'  {len(by_status["run"])} tests passed, {len(by_status["fail"])} failed, {len(by_status["notrun"])} were skipped')


def reason(case):
    """What a test printed for its reason: unittest's, GoogleTest's, or the last line of a script."""
    text = case.findtext("system-out") or ""
    found = re.findall(r"skipped ['\"](.*)['\"]$", text, re.M) or re.findall(r"^.*: Skipped\n(.+)$", text, re.M)
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return "; ".join(dict.fromkeys(found)) or (lines[-1] if lines else "no output")


for status, word in (("fail", "failed"), ("notrun", "skipped")):
    for case in by_status[status]:
        print(f'  {word}: {case.get("name")}: {reason(case)[:200]}')
for path in sorted((build / "test_cases").glob("*.xml")):
    for case in xml.parse(path).getroot().iter("testcase"):
        if case.get("result") == "skipped":
            message = case.find("skipped").get("message", "").partition("\n")[2].strip()
            print(f'  skipped in its suite: {case.get("classname")}.{case.get("name")}: {message[:200]}')
if (build / "left_out.txt").is_file():
    for line in (build / "left_out.txt").read_text().splitlines():
        print(f"  left out: {line}")
