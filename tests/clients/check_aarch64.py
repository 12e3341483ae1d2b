"""Compares the tracks of one log by two machines: python3 check_aarch64.py RUN OTHER.

Sums are not rounded alike on all processors, so that last digits may differ: boxes by up to a pixel,
positions by up to a millimetre. People, frames and IDs may not.
"""

import csv
import sys
from pathlib import Path

# File, number of columns at the left that are the same, and the largest difference of the others.
FILES = [("tracks.csv", 2, 1.0), ("tracks-metres.csv", 3, 0.001)]


def rows(path):
    with open(path, newline="") as file:
        return [row for row in csv.reader(file) if row and not row[0].startswith("#")]


def difference(one, other):
    """The difference of two cells; text that is not the same is infinitely far apart."""
    if one == other:
        return 0.0
    try:
        return abs(float(one) - float(other))
    except ValueError:
        return float("inf")


def main():
    here, there = Path(sys.argv[1]), Path(sys.argv[2])
    for name, keys, most in FILES:
        left, right = rows(here / name), rows(there / name)
        if not left or [row[:keys] for row in left] != [row[:keys] for row in right]:
            sys.exit(f"{name}: {len(left)} and {len(right)} rows, or other frames and IDs")
        cells = zip(sum(left, []), sum(right, []), strict=True)
        worst = max(difference(one, other) for one, other in cells)
        if worst > most:
            sys.exit(f"{name}: cells differ by up to {worst}")
        print(f"{name}: {len(left)} rows, the same within {worst:.2g}")


main()
