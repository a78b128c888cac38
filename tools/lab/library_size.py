"""How many bytes the SDK is as a library that a phone needs, and which crates they are of.

    cargo build --release --example phone && python tools/lab/library_size.py target/release/examples/libphone.so

Needs strip and nm of the library's target (`--tools aarch64-linux-gnu-` for another one). Code counts to the crate that
a symbol's name begins with; generic code counts to the crate that it was written in, not to the one that uses it.
"""

import argparse
import collections
import re
import shutil
import subprocess
import tempfile
from pathlib import Path


def crate(symbol):
    """The crate of a demangled symbol: of `<A as B>::c` that of A, of what has none `other`."""
    name = symbol.lstrip("<&*([").removeprefix("mut ").removeprefix("dyn ")
    found = re.match(r"([a-z_][a-z0-9_]*)(\[|::)", name)
    return found[1] if found else "other"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("library", type=Path)
    parser.add_argument("--tools", default="", metavar="PREFIX", help="what the names of strip and nm begin with")
    parser.add_argument("--crates", type=int, default=12, metavar="N", help="how many are listed (default 12)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        stripped = Path(folder) / "library"
        shutil.copy(arguments.library, stripped)
        subprocess.run([f"{arguments.tools}strip", "--strip-all", stripped], check=True)
        print(f"{arguments.library}: {stripped.stat().st_size / 1e6:.2f} MB stripped")
    nm = [f"{arguments.tools}nm", "--print-size", "--demangle", arguments.library]
    sizes = collections.Counter()
    for line in subprocess.run(nm, check=True, capture_output=True, text=True).stdout.splitlines():
        address, size, kind, *name = line.split(maxsplit=3)
        if name and kind in "tTrRdD":
            sizes[crate(name[0])] += int(size, 16)
    print("\n| crate | MB |\n|---|---|")
    for name, size in sizes.most_common(arguments.crates):
        print(f"| {name} | {size / 1e6:.2f} |")


if __name__ == "__main__":
    main()
