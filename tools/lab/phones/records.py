"""Prints tables of the records that the sample apps' benchmark makes, with the columns of docs/phones.md.

    python tools/lab/phones/records.py RECORD.json...

Times are milliseconds: the median, and the quartiles in brackets. Needs Python 3.11.
"""

import json
import sys
from pathlib import Path

#: Runs of which the table shows one stage.
PLAIN = ["8 layers", "15 layers", "30 layers", "plane sweep", "whole frame"]
#: Runs of which the table shows the encoder's time beyond that of the uncorrected run of 8 layers.
BEYOND = {"one step": "encoder with one step", "dark threshold and one step": "whole frame"}


def cells(runs):
    """The row of one phone at one size. runs: by name."""
    row = []
    for name in PLAIN:
        of = runs[name]["stages_ms"][runs[name]["stage"]] if "stages_ms" in runs.get(name, {}) else None
        row.append(f"{of['median']:.1f} ({of['lower']:.1f} to {of['upper']:.1f})" if of else "none")
    for run in BEYOND.values():
        both = [runs.get(name, {}).get("stages_ms") for name in (run, "8 layers")]
        encode = [stages["encode"]["median"] for stages in both if stages]
        row.append(f"{encode[0] - encode[1]:.1f}" if len(encode) == 2 else "none")
    return row


def conditions(runs):
    """Temperature and energy before the first run and after the last, as far as the system reports them."""
    first, last = runs[0]["before"], runs[-1].get("behind", runs[-1]["before"])
    return ", ".join(f"{name} {value} to {last.get(name)}" for name, value in sorted(first.items()))


def main():
    if not sys.argv[1:]:
        print("usage: records.py RECORD.json..., as the sample apps share them", file=sys.stderr)
        return 2
    records = [json.loads(Path(file).read_text("utf-8")) for file in sys.argv[1:]]
    sizes = sorted({(run["width"], run["height"]) for record in records for run in record["runs"]}, reverse=True)
    for width, height in sizes:
        names = ["phone", *PLAIN, *BEYOND]
        print(f"{width}×{height}, ms\n\n| {' | '.join(names)} |\n|{'---|' * len(names)}")
        for record in records:
            runs = {run["name"]: run for run in record["runs"] if (run["width"], run["height"]) == (width, height)}
            print(f"| {' | '.join([record['device']['model'], *cells(runs)])} |")
        print()
    for record in filter(lambda record: record["runs"], records):
        device = " ".join(f"{name} {value}," for name, value in record["device"].items())
        print(f"- {device} Phasefront {record['phasefront']}: {conditions(record['runs'])}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
