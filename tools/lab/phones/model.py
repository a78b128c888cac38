"""Estimates the speed of phones that were not measured: llvm-mca counts the cycles of the kernels' inner loops, and
phones.toml gives cores and clocks. Prints the tables of docs/phones.md.

    python tools/lab/phones/model.py

Needs Python 3.11, Rust with the target aarch64-unknown-linux-gnu, and llvm-mca of LLVM 19 (Debian's llvm-19).

A network's time is its multiply-adds divided by the inner loop's multiply-adds a second, times the factor that two
measured machines took beyond that. The sweep scales a measured time by the ratio of its inner loops' multiply-adds a
second, the encoder by that of f32 lanes.
"""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
CACHE = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "phasefront/phone-model"
#: For each loop: the processor family, the function, the multiplying instruction, its multiply-adds, and how many of
#: these instructions the loop has at least.
LOOPS = {
    "dotprod": ("aarch64", r"neon_dotprod4sums", r"sdot", 16, 16),
    "i8mm": ("aarch64", r"neon_i8mm4sums", r"usdot", 16, 16),
    "neon f32": ("aarch64", r"4neon10hidden_row", r"fmla", 4, 16),
    "neon sweep": ("aarch64", r"3fir4neon3two", r"smlal2?", 4, 16),
    "avx2 f32": ("x86_64", r"4avx28f32_sums", r"vfmadd\w+", 8, 16),
    "avx2 sweep": ("x86_64", r"3fir4avx23two", r"vpmaddwd", 16, 8),
    "avx512 f32": ("x86_64", r"6avx5127filters", r"vfmadd\w+", 16, 16),
    "avx512 sweep": ("x86_64", r"3fir6avx5123two", r"vpdpwssd", 32, 8),
}
#: Measured machines (docs/benchmarks.md): llvm-mca's processor, cores, clock, and network times of 1920×1080. The clock
#: follows from the share of the peak that the run states.
MEASURED = [
    ("EPYC with VNNI", "znver4", 2, 3.64, "8 layers, f32", 8, "avx512 f32", (674.4, 757.7)),
    ("EPYC with VNNI", "znver4", 2, 3.64, "15 layers, f32", 15, "avx512 f32", (1598.6, 1598.6)),
    ("the same, AVX2 alone", "znver4", 2, 3.64, "8 layers, f32", 8, "avx2 f32", (717.6, 717.6)),
]
#: Stages other than networks on the last of these, ms, and the loop that each is scaled by: the sweep and the encoder
#: with the default steps and without.
STAGES = {"sweep": (95.3, "sweep"), "encode": (21.2, "f32"), "published": (10.4, "f32")}
#: The same times with AVX-512.
ALSO = {"sweep": 79.7, "published": 8.1}
#: Bytes that each pixel moves through memory: a frame in, a field out and in again, levels out.
BYTES = 16 + 2 * 24 + 3
FULL, APP = 1920 * 1080, 960 * 540


def assembly(family):
    """The kernels' assembly for a processor family."""
    target = f"{family}-unknown-linux-gnu"
    command = ["cargo", "rustc", "--quiet", "--release", "-p", "phasefront-kernels", "--lib", "--target", target]
    environment = os.environ | {"CARGO_TARGET_DIR": str(CACHE)}
    subprocess.run([*command, "--", "--emit", "asm", "-C", "codegen-units=1"], cwd=ROOT, env=environment, check=True)
    files = (CACHE / target / "release/deps").glob("phasefront_kernels-*.s")
    return max(files, key=lambda file: file.stat().st_mtime).read_text("utf-8", "replace")


def loops(text):
    """(function, lines) of each loop that ends in a jump back to its head."""
    function, body, labels = "", [], {}
    for line in map(str.strip, text.splitlines()):
        if match := re.match(r"([A-Za-z_][\w$.]*):", line):
            function, body, labels = match[1], [], {}
        elif match := re.match(r"(\.L\w+):", line):
            labels[match[1]] = len(body)
        elif line and not line.startswith((".", "#", "//")):
            body.append(line)
            jump = re.match(r"(?:b|b\.\w+|cbn?z|tbn?z|j\w+)\s.*?(\.L\w+)$", line)
            if jump and jump[1] in labels:
                yield function, body[labels[jump[1]] :]


class Loops:
    """Cycles of inner loops, by llvm-mca."""

    def __init__(self):
        self.texts = {family: list(loops(assembly(family))) for family in ("aarch64", "x86_64")}

    def inner(self, name):
        """The innermost loop of a kernel, and its multiply-adds."""
        family, function, instruction, macs, least = LOOPS[name]
        count = lambda lines: sum(bool(re.match(rf"{instruction}\s", line)) for line in lines)  # noqa: E731
        found = [(len(body), body) for of, body in self.texts[family] if re.search(function, of) and count(body) >= least]
        if not found:
            sys.exit(f"{name}: no loop with {instruction} in {function}; the kernels have changed")
        _, body = min(found, key=lambda pair: pair[0])
        return family, body, count(body) * macs

    def macs_a_cycle(self, name, processor):
        """Multiply-adds a cycle of a kernel's inner loop."""
        family, body, macs = self.inner(name)
        labels = {label for line in body for label in re.findall(r"\.L\w+", line)}
        source = "\n".join([*(f"{label}:" for label in labels), *body, ""])
        features = ["-mattr=+dotprod,+i8mm"] if family == "aarch64" else []
        command = ["llvm-mca-19", f"-mtriple={family}-linux-gnu", f"-mcpu={processor}", "-iterations=200", *features]
        told = subprocess.run(command, input=source, capture_output=True, text=True, check=True).stdout
        return 200 * macs / int(re.search(r"Total Cycles:\s+(\d+)", told)[1])


def network_macs(layers, kernels):
    """Multiply-adds a pixel of a network of 24 filters, with those that only fill the kernel's registers."""
    last = 6 if "f32" in kernels else 8
    return 9 * (4 * 24 + (layers - 2) * 24 * 24 + 28 * last)


def check(model):
    """The smallest and largest ratio of measured to modelled time."""
    ratios = []
    print("| machine | network | inner loop, multiply-adds a cycle | modelled ms | measured ms | measured / modelled |")
    print("|---|---|---|---|---|---|")
    for machine, processor, cores, clock, name, layers, kernels, measured in MEASURED:
        rate = model.macs_a_cycle(kernels, processor)
        ms = FULL * network_macs(layers, kernels) / (rate * cores * clock * 1e6)
        ratios += [time / ms for time in measured]
        low, high = (time / ms for time in measured)
        times = " to ".join(dict.fromkeys(f"{time:.0f}" for time in measured))
        beyond = " to ".join(dict.fromkeys(f"{ratio:.2f}" for ratio in (low, high)))
        print(f"| {machine} | {name} | {rate:.1f} | {ms:.0f} | {times} | {beyond} |")
    print("\n| stage | modelled ms | measured ms | measured / modelled |")
    print("|---|---|---|---|")
    for stage, measured in ALSO.items():
        ms, loop = STAGES[stage]
        ms *= model.macs_a_cycle(f"avx2 {loop}", "znver4") / model.macs_a_cycle(f"avx512 {loop}", "znver4")
        print(f"| {stage} | {ms:.1f} | {measured} | {measured / ms:.2f} |")
    return min(ratios), max(ratios)


def rate(model, cores, core, loop):
    """Multiply-adds of all cores together, 10⁹ a second. `loop` is int8, f32 or sweep."""
    kernels = lambda name: core[name]["kernels"] if loop == "int8" else f"neon {loop}"  # noqa: E731
    return sum(count * clock * model.macs_a_cycle(kernels(name), core[name]["mca"]) for count, name, clock in cores)


def times(model, phone, core, beyond):
    """Times of 1920×1080, ms, with the large cores alone and with all of them."""
    _, processor, count, clock, *_ = MEASURED[-1]
    rows = {}
    for cores in (phone["large"], phone["large"] + phone["small"]):
        int8 = rate(model, cores, core, "int8")
        found = {f"{n} layers": FULL * network_macs(n, "int8") / (int8 * 1e6) * beyond for n in (8, 15, 30)}
        for name, (ms, loop) in STAGES.items():
            measured = count * clock * model.macs_a_cycle(f"avx2 {loop}", processor)
            found[name] = ms * measured / rate(model, cores, core, loop)
        found["dark threshold and one step"] = found["encode"] - found["published"]
        found["sweep and encoder"] = found["sweep"] + found["encode"]
        found["8 layers and encoder"] = found["8 layers"] + found["encode"]
        for name, ms in found.items():
            rows.setdefault(name, []).append(ms)
    return rows


def main():
    told = tomllib.loads((HERE / "phones.toml").read_text("utf-8"))
    model = Loops()
    low, high = check(model)
    beyond = (low + high) / 2
    print(f"\nbeyond the inner loops: {beyond:.2f}, {low:.2f} to {high:.2f}\n")
    print("| core | llvm-mca's model | reason | int8, multiply-adds a cycle | f32 | sweep |\n|---|---|---|---|---|---|")
    for name, core in told["core"].items():
        loops = (core["kernels"], "neon f32", "neon sweep")
        cells = " | ".join(f"{model.macs_a_cycle(loop, core['mca']):.1f}" for loop in loops)
        print(f"| {name} | {core['mca']} | {core['why']} | {core['kernels']} {cells} |")
    print("\n| phone | large cores | small cores | source |\n|---|---|---|---|")
    for phone in told["phone"]:
        large, small = (", ".join(f"{n} {core} at {clock} GHz" for n, core, clock in phone[k]) for k in ("large", "small"))
        print(f"| {phone['name']} | {large} | {small} | {phone['source']} |")
    print(f"\nthrough memory: {BYTES * FULL / 1e6:.0f} MB a frame of 1920×1080")
    columns = ["8 layers", "15 layers", "30 layers", "sweep", "dark threshold and one step"]
    columns += ["sweep and encoder", "8 layers and encoder"]
    for title, share, text in (
        ("1920×1080, ms", 1, lambda ms: f"{ms:.0f}"),
        ("960×540, frames a second", APP / FULL, lambda ms: f"{1000 / ms:.1f}" if ms > 100 else f"{1000 / ms:.0f}"),
    ):
        print(f"\n{title}\n\n| phone | {' | '.join(columns)} |\n|{'---|' * (len(columns) + 1)}")
        for phone in told["phone"]:
            rows = times(model, phone, told["core"], beyond)
            cells = [sorted((text(share * ms) for ms in rows[column]), key=float) for column in columns]
            print(f"| {phone['name']} | {' | '.join(map(' to '.join, cells))} |")


if __name__ == "__main__":
    main()
