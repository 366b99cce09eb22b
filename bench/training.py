"""What the scripts that train have in common."""
import argparse
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def parser(description):
    ap = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("--vsplat", default="vsplat")
    ap.add_argument("--output", type=pathlib.Path, required=True)
    ap.add_argument("--config", type=pathlib.Path, default=ROOT / "model/weights/train.json", help="a training's, whose model is taken (default: %(default)s)")
    return ap


def run(command):
    """Tells of it, and returns what it prints."""
    print("+", " ".join(map(str, command)), file=sys.stderr, flush=True)
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
