"""Prints the public items of the crate `phasefront`, with its re-exports of the crates below it.

`stable.py TARGET` reads the lists of `surface` for each crate in TARGET, and the JSON of rustdoc. It fails if a public
signature names a type that `phasefront` does not re-export, or if there are too many items.
"""

import json
import re
import sys
from pathlib import Path


# More items would be hard to learn.
MOST = 65


def exported(folder: Path) -> dict[str, str]:
    """Returns the path in `phasefront` of each item of another crate, by its path in that crate."""
    index = json.loads((folder / "phasefront.json").read_text())["index"]
    inside = {}
    for item in index.values():
        for child in item["inner"].get("module", {}).get("items", []):
            inside[str(child)] = item
    found = {}
    for key, item in index.items():
        use = item["inner"].get("use")
        if not use or not use["source"].startswith(("phasefront_core", "phasefront_gpu")):
            continue
        module = inside.get(key)
        path = [use["name"]]
        while module is not None:
            path.insert(0, module["name"])
            module = inside.get(str(module["id"]))
        for source in definitions(folder, use["source"]):
            found[source] = "::".join(path)
    return found


def definitions(folder: Path, path: str) -> list[str]:
    """Returns the paths of an item: `path`, and what the roots of crates re-export there, down to its definition."""
    crate, *rest = path.split("::")
    if len(rest) == 1:
        for item in json.loads((folder / f"{crate}.json").read_text())["index"].values():
            use = item["inner"].get("use")
            if use and use["name"] == rest[0]:
                source = use["source"].removeprefix("crate::").removeprefix("self::")
                next_path = source if source.startswith("phasefront_") else f"{crate}::{source}"
                return [path, *definitions(folder, next_path)]
    return [path]


def main(folder: Path) -> int:
    paths = exported(folder)
    # Longest first, because a path may begin with another path.
    any_of = re.compile("|".join(rf"{re.escape(path)}\b" for path in sorted(paths, key=len, reverse=True)))
    lines = [line for line in (folder / "phasefront.txt").read_text().splitlines() if not line.startswith("pub use ")]
    for crate in ("phasefront_core", "phasefront_gpu", "phasefront_kernels"):
        for line in (folder / f"{crate}.txt").read_text().splitlines():
            if line.startswith("pub use "):
                continue
            # The subject of the line: the type of an implementation, or the first path.
            about = line.rsplit(" for ", 1)[-1] if line.startswith("impl") else line
            if re.match(rf"impl {crate}::", line) and " for " in line:
                continue  # The trait is not public either.
            first = re.search(rf"{crate}::[\w:]+", re.sub(r"^impl<[^>]*> ", "", about))
            if first and any_of.match(first.group()):
                lines.append(line)
    lines = {any_of.sub(lambda found: paths[found.group()], line) for line in lines}
    lines = sorted(lines, key=lambda line: (re.findall(r"phasefront::[\w:]+", line), line))
    print("\n".join(lines))
    item = re.compile(r"\b(?:struct|enum|trait|type|fn|const|static) phasefront::(?:[a-z_]+::)*(\w+)(?![\w:])")
    count = len({found.group(1) for line in lines if (found := item.search(line))})
    print(f"phasefront: {count} public items; {MOST} are the most", file=sys.stderr)
    hidden = [line for line in lines if re.search(r"phasefront_(core|gpu|kernels)::", line)]
    for line in hidden:
        print(f"names a type that phasefront does not hand on: {line}", file=sys.stderr)
    return 1 if hidden or count > MOST else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
