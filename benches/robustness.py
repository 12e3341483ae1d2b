"""Prints how the figures of pipelines change on altered copies of annotated logs.

Usage: python3 benches/robustness.py FOLDER CONFIG... -- LOG.mcap...   (from the root of the repository)

TAGALONG names the program (target/release/tagalong). Each log needs LOG.people.csv beside it; the
copies and the report are written into FOLDER. `alone` is the log as it is; each other row has one
alteration of `tagalong alter`. Figures are means over the logs, and the sum of inherited IDs; `lost` is
what the mean MOTA loses, and is marked where that is more than 0.03; `worst` is the log that loses most.
"""

import csv
import os
import subprocess
import sys
from pathlib import Path

ALTERATIONS = {
    "half the rate": ["--every", "2"],
    "mirrored": ["--mirror"],
    "depth 2 % too far": ["--scale-depth", "1.02"],
    "depth 2 % too near": ["--scale-depth", "0.98"],
    "2 % wrong pixels": ["--salt", "0.02"],
}


def command(arguments):
    done = subprocess.run([str(part) for part in arguments], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        sys.exit(f"{arguments}: {done.stderr}")


def altered_logs(program, folder, logs):
    """The logs and their copies: file to (alteration, log)."""
    made = {}
    for log in logs:
        made[log] = ("alone", log.stem)
        for number, (name, arguments) in enumerate(ALTERATIONS.items()):
            copy = folder / f"{log.stem}-{number}.mcap"
            command([program, "alter", log, "-o", copy, "--overwrite", *arguments])
            made[copy] = (name, log.stem)
    return made


def mean(values):
    return sum(values) / len(values)


# Names in the report of `bench` by titles here.
FIGURES = {"HOTA": "HOTA", "AssA": "AssA", "MOTA": "MOTA", "IDF1": "IDF1",
           "inherited": "inherited_ids", "FP/frame": "fp_per_frame", "recall": "recall"}
# Loss of MOTA beyond which a row is marked.
MOST_LOST = 0.03


def shown(title, values):
    """The mean of a figure over the logs, or the sum of a count."""
    return f"{sum(values):.0f}" if title == "inherited" else f"{mean(values):.3f}"


def table(rows, alterations, made):
    """The lines of the table of one pipeline."""
    found = {name: {} for name in alterations}
    for row in rows:
        name, log = made[row["log"]]
        found[name][log] = {title: float(row[f"image.{figure}"] or "nan")
                            for title, figure in FIGURES.items()}
    lines = ["| log | " + " | ".join(FIGURES) + " | lost | worst |", "|---" * (len(FIGURES) + 3) + "|"]
    for name in alterations:
        of_logs = found[name].values()
        cells = [name, *(shown(title, [log[title] for log in of_logs]) for title in FIGURES)]
        loss = {log: found["alone"][log]["MOTA"] - of["MOTA"] for log, of in found[name].items()}
        worst = max(loss, key=loss.get)
        lost = mean(list(loss.values()))
        mark = " **missed**" if lost > MOST_LOST else ""
        told = ["", ""] if name == "alone" else [f"{lost:.3f}{mark}", f"{worst} {-loss[worst]:+.3f}"]
        lines.append("| " + " | ".join(cells + told) + " |")
    return lines


def main():
    arguments = sys.argv[1:]
    if "--" not in arguments or len(arguments) < 4:
        sys.exit(__doc__)
    split = arguments.index("--")
    folder, configs = Path(arguments[0]), arguments[1:split]
    logs = [Path(log) for log in arguments[split + 1 :]]
    program = os.environ.get("TAGALONG", "target/release/tagalong")
    folder.mkdir(parents=True, exist_ok=True)
    made = altered_logs(program, folder, logs)
    report = folder / "bench"
    command([program, "bench", "--configs", *configs, "--logs", *made, "-o", report])
    by_stem = {log.stem: place for log, place in made.items()}
    with open(report / "report.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    for pipeline in dict.fromkeys(row["pipeline"] for row in rows):
        print(f"\n**{pipeline}**\n")
        of = [row for row in rows if row["pipeline"] == pipeline]
        print("\n".join(table(of, ["alone", *ALTERATIONS], by_stem)))


if __name__ == "__main__":
    main()
