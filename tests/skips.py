"""Functions of Python tests for a missing dependency. As a program, checks that no test skips on its own and that
tests/expected-skips has no unused names.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests/expected-skips"
# The helpers that all tests share.
SHARED = {"tests/skip.rs", "tests/skip.sh", "tests/skips.py"}
ENDINGS = {"", ".rs", ".py", ".sh", ".js", ".mjs", ".ts", ".kt", ".swift", ".c", ".cpp", ".cs"}
FORBIDDEN = re.compile(
    r"""["'`]skipped[: ]|pytest\.skip|importorskip|mark\.skip|skipif|skipTest|unittest\.skip|\b(?:test|it|describe)\.skip\(
    |XCTSkip|\bassume(?:True|False|That)|\bAssumptions\b|@(?:Enabled|Disabled)(?:If|On|For)|@Disabled|@Ignore|\#\[ignore(?!\ =\ "slow:\ )
    |Assert\.(?:Ignore|Inconclusive)|\b(?:exit|return)[ (]77\b""",
    re.VERBOSE,
)
# In Rust tests: printing a message and returning.
LEAVES = re.compile(r"println!\([^;]*\);\s*(?:return|continue)\b")


def expected():
    """Returns the steps of the list that may lack each name, with the reason."""
    rows = (line.split("|") for line in LIST.read_text("utf-8").splitlines() if line and not line.startswith("#"))
    return {name.strip(): ([step.strip() for step in steps.split(",")], why.strip()) for name, steps, why in rows}


def or_fail(what, why):
    """Records for tests/run that a test, or a part of it, does not run because `what` is missing. Raises AssertionError
    if the list does not name it; `why` then explains how to get it."""
    assert what in expected(), f"{what} is missing ({why}), and tests/expected-skips does not name it"
    print(f"skipped: {what}: {why}")
    if path := os.environ.get("PHASEFRONT_SKIPS"):
        with open(path, "a", encoding="utf-8") as file:
            file.write(f"{what}\t{why}\n")


def faults(name, text):
    """Returns the lines of a file that skip on their own."""
    found = list(FORBIDDEN.finditer(text))
    if name.endswith(".rs") and "/tests/" in name:
        found += LEAVES.finditer(text)
    for match in found:
        yield f"{name}:{text.count(chr(10), 0, match.start()) + 1}: {' '.join(match.group().split())}: see tests/expected-skips"


def main():
    listed = subprocess.run(["git", "ls-files", "-z", "-c", "-o", "--exclude-standard"], cwd=ROOT, capture_output=True, check=True)
    names = sorted(set(listed.stdout.decode().strip("\0").split("\0")) - SHARED)
    # release/try runs on a developer's machine and reports there what it did not try.
    names = [n for n in names if Path(n).suffix in ENDINGS and not n.startswith(("docs/", "release/")) and (ROOT / n).is_file()]
    texts = {name: (ROOT / name).read_text("utf-8", errors="replace") for name in names}
    wrong = [fault for name, text in texts.items() for fault in faults(name, text)]
    texts |= {name: (ROOT / name).read_text("utf-8") for name in SHARED}
    steps = {line.split(" | ")[3] for line in (ROOT / "tests/steps").read_text("utf-8").splitlines() if not line.startswith("#")}
    for name, (mine, _) in expected().items():
        wrong += [f"tests/expected-skips: {name}: tests/steps has no step {step!r}" for step in mine if step not in steps]
        asked = re.compile(rf"or_fail\(?\s*[\"']?{re.escape(name)}\b")
        if not any(asked.search(text) for text in texts.values()):
            wrong.append(f"tests/expected-skips: no test asks for {name!r}")
    print(*wrong, sep="\n", end="\n" if wrong else "")
    print(f"{len(texts)} files, {len(expected())} names, {len(wrong)} faults")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
