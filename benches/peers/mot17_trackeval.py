"""Times TrackEval on the MOT17 sequences that `cargo bench --bench eval` scores.

Usage: python benches/peers/mot17_trackeval.py ../shared/data/mot
Needs `pip install trackeval`. Prints seconds for reading and scoring with
CLEAR, Identity and HOTA, on one core, the median of three in processor time.
"""

import contextlib
import io
import os
import shutil
import sys
import tempfile

import numpy
from timing import statistic, time_once

# TrackEval was written for numpy 1, which had these names for Python's types.
numpy.float, numpy.int = float, int

# It prints the optional parts that it has nothing for.
with contextlib.redirect_stdout(io.StringIO()):
    import trackeval  # noqa: E402


def tree(mot, root):
    """Lays the files out as TrackEval wants them."""
    truth = f"{root}/gt/mot_challenge/MOT17-train"
    shutil.copytree(f"{mot}/gt/MOT17-train", truth)
    names = sorted(os.listdir(truth))
    os.makedirs(f"{root}/gt/mot_challenge/seqmaps")
    with open(f"{root}/gt/mot_challenge/seqmaps/MOT17-train.txt", "w") as file:
        file.write("name\n" + "\n".join(names) + "\n")
    shutil.copytree(f"{mot}/tracker-output/MOT17-train",
                    f"{root}/trackers/mot_challenge/MOT17-train/peer/data")


def once(root):
    """Processor time of one evaluation, s."""
    dataset = trackeval.datasets.MotChallenge2DBox({
        **trackeval.datasets.MotChallenge2DBox.get_default_dataset_config(),
        "BENCHMARK": "MOT17", "PRINT_CONFIG": False,
        "GT_FOLDER": f"{root}/gt/mot_challenge",
        "TRACKERS_FOLDER": f"{root}/trackers/mot_challenge",
    })
    evaluator = trackeval.Evaluator({
        **trackeval.Evaluator.get_default_eval_config(),
        "USE_PARALLEL": False, "PRINT_RESULTS": False, "PRINT_CONFIG": False,
        "OUTPUT_SUMMARY": False, "OUTPUT_DETAILED": False, "PLOT_CURVES": False,
        "TIME_PROGRESS": False, "BREAK_ON_ERROR": True,
    })
    metrics = [trackeval.metrics.HOTA(), trackeval.metrics.CLEAR({"PRINT_CONFIG": False}),
               trackeval.metrics.Identity({"PRINT_CONFIG": False})]
    return time_once(lambda: evaluator.evaluate([dataset], metrics))


def main(mot):
    with tempfile.TemporaryDirectory() as root:
        tree(mot, root)
        with contextlib.redirect_stdout(io.StringIO()):
            seconds = [once(root) for _ in range(3)]
        print(f"TrackEval, reading and scoring: {statistic(seconds):.2f} s")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
