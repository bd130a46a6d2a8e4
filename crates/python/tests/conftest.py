"""Programs and folders that some tests need."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def answers():
    """The Rust example that answers all queries: CANTED_ANSWERS, else built with cargo."""
    given = os.environ.get("CANTED_ANSWERS")
    if given:
        return Path(given)
    if shutil.which("cargo") is None:
        pytest.skip("there is no cargo to build the example 'bindings'")
    command = ["cargo", "build", "--quiet", "--release", "--package", "canted", "--example", "bindings"]
    # A folder of its own, whatever the caller builds at the same time.
    target = ROOT / "target" / "answers"
    subprocess.run([*command, "--target-dir", str(target)], cwd=ROOT, check=True)
    return target / "release" / "examples" / "bindings"


def program():
    """The program canted: CANTED_PROGRAM, else the last one that cargo built."""
    given = os.environ.get("CANTED_PROGRAM")
    found = [ROOT / "target" / profile / "canted" for profile in ("release", "debug")]
    found = [Path(given)] if given else sorted((p for p in found if p.is_file()), key=lambda p: -p.stat().st_mtime)
    if not found:
        pytest.skip("the program canted is not built (set CANTED_PROGRAM)")
    return found[0]
