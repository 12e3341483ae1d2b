"""Scores an exported tree with TrackEval and compares with report.json.

Usage: check_trackeval.py TREE REPORT_JSON
"""

import json
import sys

import numpy

# TrackEval was written for numpy 1, which had these names for Python's types.
numpy.float, numpy.int = float, int

import trackeval  # noqa: E402

FIGURES = {
    "HOTA": ["HOTA", "DetA", "AssA", "LocA", "DetRe", "DetPr", "AssRe", "AssPr"],
    "CLEAR": ["MOTA", "MOTP", "IDSW", "CLR_TP", "CLR_FN", "CLR_FP", "MT", "PT", "ML", "Frag"],
    "Identity": ["IDF1", "IDP", "IDR", "IDTP", "IDFN", "IDFP"],
}
OURS = {"CLR_TP": "TP", "CLR_FN": "FN", "CLR_FP": "FP"}
TOLERANCE = 1e-6


def score(tree):
    """TrackEval's figures by tracker and sequence."""
    evaluator = trackeval.Evaluator({
        **trackeval.Evaluator.get_default_eval_config(),
        "USE_PARALLEL": False, "PRINT_RESULTS": False, "PRINT_CONFIG": False,
        "OUTPUT_SUMMARY": False, "OUTPUT_DETAILED": False, "PLOT_CURVES": False,
        "TIME_PROGRESS": False, "BREAK_ON_ERROR": True,
    })
    dataset = trackeval.datasets.MotChallenge2DBox({
        **trackeval.datasets.MotChallenge2DBox.get_default_dataset_config(),
        "BENCHMARK": "Tagalong", "PRINT_CONFIG": False,
        "GT_FOLDER": f"{tree}/gt/mot_challenge",
        "TRACKERS_FOLDER": f"{tree}/trackers/mot_challenge",
    })
    metrics = [trackeval.metrics.HOTA(), trackeval.metrics.CLEAR({"PRINT_CONFIG": False}),
               trackeval.metrics.Identity({"PRINT_CONFIG": False})]
    results, _ = evaluator.evaluate([dataset], metrics)
    return results["MotChallenge2DBox"]


def compare(task, theirs):
    """Yields what differs."""
    for family, figures in FIGURES.items():
        for figure in figures:
            want = float(numpy.mean(theirs[family][figure]))
            got = task["image"][OURS.get(figure, figure)]
            # We leave out a rate that makes no sense; TrackEval prints 0 or 1.
            if got is not None and abs(got - want) > TOLERANCE:
                yield f"{figure}: {got}, TrackEval {want}"


def main(tree, report):
    with open(report, encoding="utf-8") as file:
        tasks = [task for task in json.load(file)["tasks"] if task["outcome"]["ended"] == "done"]
    results, compared, wrong = score(tree), 0, 0
    for task in tasks:
        if task["image"] is None:
            continue
        tracker = f"{task['pipeline']}-seed{task['seed']}"
        for line in compare(task, results[tracker][task["log"]]["pedestrian"]):
            print(f"{tracker} on {task['log']}: {line}")
            wrong += 1
        compared += 1
    if compared == 0:
        sys.exit("nothing to compare")
    if wrong:
        sys.exit(f"{wrong} figures differ")
    print(f"trackeval: ok, {compared} results agree")


main(*sys.argv[1:])
