"""Prints the times of our kernels beside those of other programs for the same work, one thread.

Usage: python benches/peers/kernels.py   (benches/peers/run.sh installs all that it needs)

Ours and theirs take turns. A time is the median of calls in processor time of their thread, for
each program alike (`timing.py`), and the median of the rounds; the ratio is the median over the
rounds of the other's time by ours, so above 1 ours is faster. The answers are compared, too: a sum
of costs that differs from that of scipy ends the script.
"""

import contextlib
import io
import os
import subprocess
import sys
import tempfile

import cv2
import lap
import numpy as np
import supervision
import trackers
from filterpy.kalman import KalmanFilter
from mot17_trackeval import once, tree
from scipy.optimize import linear_sum_assignment
from scipy.stats import gaussian_kde
from timing import median_s, rows, statistic, time_once

ROUNDS = 7
SIZES = (5, 20, 100, 500)
PAIR_SIZE, DISPARITIES = (512, 384), 64


# What the other program is written in; all but the `mcap` crate are called from Python.
LANGUAGES = {
    "scipy": "C++", "lap": "C++", "numpy": "C", "KCF": "C++", "MOSSE": "C++", "OpenCV": "C++",
    "filterpy": "Python", "SORT": "Python", "ByteTrack": "Python", "TrackEval": "Python",
    "`mcap` crate": "Rust", "ours": "Rust",
}


def language(peer):
    """Returns the language of a peer by the longest name that is in it."""
    names = [name for name in LANGUAGES if name in peer]
    return LANGUAGES[max(names, key=len)]


def built(example):
    command = ["cargo", "build", "-q", "--release", "-p", "tagalong-benches", "--example", example]
    subprocess.run(command, check=True)
    folder = os.environ.get("CARGO_TARGET_DIR", "target")
    return os.path.join(folder, "release", "examples", example)


def lines(*command):
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return [line.split() for line in done.stdout.splitlines()]


def mixed(count):
    """The numbers of `time_assignment`, to the last bit."""
    with np.errstate(over="ignore"):
        i = np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        i = (i ^ i >> np.uint64(29)) * np.uint64(0xBF58476D1CE4E5B9)
    return (i >> np.uint64(11)).astype(np.float64) / 2.0**53


class Assignment:
    """Tracks to as many detections, every pair allowed."""

    def __init__(self):
        self.program = built("time_assignment")
        self.costs = {n: mixed(n * n).reshape(n, n) for n in SIZES}

    def ours(self):
        times = {}
        for size, us, total in lines(self.program, *map(str, SIZES)):
            costs = self.costs[int(size)]
            best = costs[linear_sum_assignment(costs)].sum()
            if abs(best - float(total)) > 1e-6:
                sys.exit(f"assignment of {size}: {total} instead of {best}")
            times[f"assignment, n = {size}"] = float(us) * 1e-6
        return times

    def theirs(self):
        for n, costs in self.costs.items():
            job = f"assignment, n = {n}"
            yield job, "scipy", median_s(lambda: linear_sum_assignment(costs))
            yield job, "lap", median_s(lambda: lap.lapjv(costs))


def splitmix(index):
    """The numbers of `number_at(1, index)`, between 0 and 1, to the last bit."""
    with np.errstate(over="ignore"):
        z = np.uint64(1) + (index.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ z >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ z >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
        z = z ^ z >> np.uint64(31)
    return (z >> np.uint64(11)).astype(np.float64) / 2.0**53


class Particles:
    """A frame of 625 particles, and the sum of 50 kernels at 625 places."""

    STEP, MAP = "a frame of 625 particles", "sum of 50 kernels at 625 places"

    def __init__(self):
        self.program = built("time_particles")
        values = splitmix(np.arange(2 * 675)).reshape(675, 2) - 0.5
        places = values * [0.6, 1.8]
        self.places, self.at = places[:50], places[50:]
        self.known = splitmix(np.arange(2000, 2050))
        self.random = np.random.default_rng(1)

    def ours(self):
        (_, step), (_, look_up, total) = lines(self.program)
        off = (self.places[:, None] - self.at) / [0.04, 0.1]
        wanted = (self.known @ np.exp(-0.5 * (off**2).sum(2))).sum()
        if abs(wanted - float(total)) > 1e-8:
            sys.exit(f"a sum of kernels: {total} instead of {wanted}")
        return {self.STEP: float(step) * 1e-6, self.MAP: float(look_up) * 1e-6}

    def theirs(self):
        kernels = gaussian_kde(self.places.T, weights=self.known)
        yield self.MAP, "scipy", median_s(lambda: kernels(self.at.T))
        self.states = np.zeros((625, 5)) + [3.0, 0.0, 1.6, 0.0, 0.0]
        yield self.STEP, "numpy, all sampled", median_s(self.step)

    def step(self):
        """Predicts, weighs and resamples (systematically) particles that have no covariances."""
        moved = self.states
        moved[:, :2] += 0.1 * moved[:, 3:]
        moved += self.random.normal(size=moved.shape) * [0.02, 0.02, 0.01, 0.1, 0.1]
        weights = np.exp(-0.5 * ((moved[:, :3] - [3.0, 0.0, 1.6]) ** 2).sum(1))
        weights /= weights.sum()
        mean = weights @ moved
        off = moved - mean
        covariance = (weights * off.T) @ off
        ladder = (np.arange(625) + self.random.random()) / 625
        self.states = moved[np.searchsorted(np.cumsum(weights), ladder).clip(max=624)]
        return mean, covariance


class Patches:
    """A support vector machine with 100 vectors of 400 numbers."""

    ONE, MANY = "SVM of 100 vectors, a patch", "SVM of 100 vectors, 1000 patches"

    def __init__(self):
        self.program = built("time_patches")
        vectors = splitmix(np.arange(1100 * 400)).reshape(1100, 400).astype(np.float32) - np.float32(0.5)
        vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
        self.support, self.patches = vectors[:100], vectors[100:]
        self.weights = np.where(np.arange(100) % 2 == 0, 1.5, -0.5)
        self.machine = cv2.ml.SVM_create()
        self.machine.setKernel(cv2.ml.SVM_RBF)
        self.machine.setGamma(0.5)
        # So hard a margin that all vectors support it.
        self.machine.setC(1e3)
        classes = np.where(self.weights > 0, 1, -1).astype(np.int32)
        self.machine.train(self.support, cv2.ml.ROW_SAMPLE, classes)
        if len(self.machine.getSupportVectors()) != 100:
            sys.exit("OpenCV's machine does not have 100 support vectors")

    def ours(self):
        ((us, total),) = lines(self.program, "100", "1000")
        squares = 2 - 2 * (self.support @ self.patches.T).astype(np.float64)
        wanted = (self.weights @ np.exp(-0.5 * squares)).sum()
        # Our vectors have 8 bits.
        if abs(wanted - float(total)) > 1e-3 * abs(wanted):
            sys.exit(f"decision values: {total} instead of {wanted}")
        return {self.ONE: float(us) * 1e-6, self.MANY: float(us) * 1e-3}

    def theirs(self):
        raw = cv2.ml.STAT_MODEL_RAW_OUTPUT
        one = self.patches[:1]
        yield self.ONE, "OpenCV", median_s(lambda: self.machine.predict(one, None, raw))
        yield self.MANY, "OpenCV", median_s(lambda: self.machine.predict(self.patches, None, raw))


class Filters:
    """A prediction and an update of a state of 5 by a measurement of 3."""

    JOB = "Kalman filter of a person"

    def __init__(self):
        self.program = built("time_filter")
        moves, sees = np.eye(5), np.eye(3, 5)
        moves[0, 3] = moves[1, 4] = 0.1
        self.seen = np.array([[3.0], [0.0], [1.6]])
        self.opencv = cv2.KalmanFilter(5, 3, 0, cv2.CV_64F)
        self.opencv.transitionMatrix, self.opencv.measurementMatrix = moves, sees
        self.opencv.processNoiseCov = 0.01 * np.eye(5)
        self.opencv.measurementNoiseCov = 0.01 * np.eye(3)
        self.opencv.errorCovPost = np.eye(5)
        self.filterpy = KalmanFilter(5, 3)
        self.filterpy.F, self.filterpy.H = moves, sees
        self.filterpy.Q, self.filterpy.R = 0.01 * np.eye(5), 0.01 * np.eye(3)

    def ours(self):
        ((us,),) = lines(self.program)
        return {self.JOB: float(us) * 1e-6}

    def theirs(self):
        yield self.JOB, "OpenCV", median_s(self.step_opencv)
        yield self.JOB, "filterpy", median_s(self.step_filterpy)

    def step_opencv(self):
        self.opencv.predict()
        self.opencv.correct(self.seen)

    def step_filterpy(self):
        self.filterpy.predict()
        self.filterpy.update(self.seen)


class Trackers:
    """A frame of people who are all seen: ours in space, with outlines and probabilities; theirs by
    the overlap of boxes."""

    PEERS = {"SORT": trackers.SORTTracker, "ByteTrack": trackers.ByteTrackTracker}
    SIZES = (5, 20, 100)

    def __init__(self):
        self.program = built("time_tracker")

    def ours(self):
        rows = lines(self.program, *map(str, self.SIZES))
        return {self.job(people): float(us) * 1e-6 for people, us in rows}

    def theirs(self):
        for people in self.SIZES:
            side = int(np.ceil(people**0.5))
            corner = np.array([[60.0 * (i % side), 60.0 * (i // side)] for i in range(people)])
            boxes = np.hstack([corner, corner + 40.0])
            for name, kind in self.PEERS.items():
                yield self.job(people), name, self.median_update(kind(), boxes)

    def median_update(self, tracker, boxes, frames=40):
        """The first frames confirm the tracks."""
        random, times = np.random.default_rng(1), []
        for _ in range(frames):
            found = supervision.Detections(xyxy=boxes + random.normal(0, 1, boxes.shape),
                                           confidence=np.full(len(boxes), 0.9),
                                           class_id=np.zeros(len(boxes), int))
            times.append(time_once(lambda: tracker.update(found)))
        return statistic(times[frames // 2 :])

    @staticmethod
    def job(people):
        return f"tracker, {people} people"


class Images:
    """Images as logs have them: depth in a PNG of 16 bits, colour in a JPEG."""

    JOBS = {
        "depth.png": "depth in a PNG as OpenCV writes it",
        "smallest.png": "depth in a smallest PNG (`compressedDepth`)",
        "colour.jpg": "JPEG",
    }

    def __init__(self, folder):
        self.program = built("time_images")
        y, x = np.mgrid[:480, :640].astype(np.float64)
        random = np.random.default_rng(1)
        noise = random.normal(size=(480, 640))
        # A floor, a wall and a person, in the steps of structured light, with noise of half a step
        # and with holes.
        depth = np.minimum(4000.0, 90000.0 / np.maximum(y - 200.0, 1.0))
        depth[(abs(x - 300) < 60) & (y > 120)] = 2000.0
        depth = 348000.0 / np.maximum(1.0, np.round(348000.0 / depth + noise / 2.0))
        depth[cv2.GaussianBlur(random.normal(size=depth.shape), (0, 0), 6) > 0.07] = 0
        wave = 110 + 60 * np.sin(x / 23) * np.cos(y / 17) + 4 * noise
        colour = np.stack([wave, np.roll(wave, 40, 1), 255 - wave], 2)
        self.paths = [os.path.join(folder, name) for name in self.JOBS]
        cv2.imwrite(self.paths[0], depth.astype(np.uint16))
        cv2.imwrite(self.paths[1], depth.astype(np.uint16), [cv2.IMWRITE_PNG_COMPRESSION, 9])
        cv2.imwrite(self.paths[2], colour.clip(0, 255).astype(np.uint8))
        self.data = [np.fromfile(path, np.uint8) for path in self.paths]
        self.jobs = [f"{job}, 640x480" for job in self.JOBS.values()]

    def ours(self):
        return {job: float(ms) * 1e-3 for job, (ms,) in zip(self.jobs, lines(self.program, *self.paths))}

    def theirs(self):
        *depths, colour = zip(self.jobs, self.data)

        def metres(data):
            return cv2.imdecode(data, cv2.IMREAD_UNCHANGED).astype(np.float32) * np.float32(1e-3)

        for job, data in depths:
            yield job, "OpenCV", median_s(lambda: metres(data))
        yield colour[0], "OpenCV", median_s(lambda: cv2.imdecode(colour[1], cv2.IMREAD_COLOR))


class Logs:
    """The messages of an MCAP file. The `mcap` crate needs the whole file in memory: it reads it, or has
    it already."""

    PEERS = ("`mcap` crate", "`mcap` crate, file in memory")

    def __init__(self):
        self.program = built("time_mcap")

    def ours(self):
        rows = lines(self.program)
        self.crate = {self.job(form): theirs for form, _, *theirs in rows}
        return {self.job(form): float(ms) * 1e-3 for form, ms, *_ in rows}

    def theirs(self):
        for job, times in self.crate.items():
            for peer, ms in zip(self.PEERS, times):
                yield job, peer, float(ms) * 1e-3

    @staticmethod
    def job(form):
        return f"MCAP, 61 MB, compression: {form}"


class Metrics:
    """Reading and scoring a sequence by CLEAR, Identity and HOTA."""

    JOB = "metrics, 1000 frames of 20 people"
    FRAMES, PEOPLE, NAME = 1000, 20, "MOT17-02-FRCNN"

    def __init__(self, folder):
        self.program = built("time_metrics")
        mot, self.root = os.path.join(folder, "mot"), os.path.join(folder, "trackeval")
        sequence = os.path.join(mot, "gt", "MOT17-train", self.NAME)
        tracker = os.path.join(mot, "tracker-output", "MOT17-train")
        os.makedirs(os.path.join(sequence, "gt"))
        os.makedirs(tracker)
        self.truth = os.path.join(sequence, "gt", "gt.txt")
        self.tracks = os.path.join(tracker, self.NAME + ".txt")
        random = np.random.default_rng(1)
        corners = random.uniform(0, 1800, (self.PEOPLE, 2))
        steps = random.normal(0, 1, (self.FRAMES, self.PEOPLE, 2)).cumsum(0)
        with open(self.truth, "w") as truth, open(self.tracks, "w") as tracks:
            for frame, places in enumerate(corners + steps, 1):
                for person, (x, y) in enumerate(places, 1):
                    truth.write(f"{frame},{person},{x:.1f},{y:.1f},60,120,1,1,1\n")
                    # A tracker that is a few pixels off, misses some, and changes numbers at times.
                    if random.random() < 0.9:
                        x, y = random.normal((x, y), 5)
                        number = person + 100 * ((frame + 37 * person) // 400)
                        tracks.write(f"{frame},{number},{x:.1f},{y:.1f},60,120,1,-1,-1,-1\n")
        with open(os.path.join(sequence, "seqinfo.ini"), "w") as info:
            info.write(f"[Sequence]\nname={self.NAME}\nseqLength={self.FRAMES}\n")
        tree(mot, self.root)

    def ours(self):
        ((ms,),) = lines(self.program, self.truth, self.tracks, str(self.FRAMES))
        return {self.JOB: float(ms) * 1e-3}

    def theirs(self):
        with contextlib.redirect_stdout(io.StringIO()):
            seconds = statistic([once(self.root) for _ in range(3)])
        yield self.JOB, "TrackEval", seconds


class Stereo:
    """A wall and a box before it; ours does all its tests, theirs what its name says. Two threads
    are compared with one of ours."""

    JOBS = {"block": "block matching", "semi-global": "semi-global matching"}

    def __init__(self, folder):
        self.program = built("time_pair")
        width, height = PAIR_SIZE
        noise = np.random.default_rng(2).integers(0, 256, (height, width + 64)).astype(np.float32)
        texture = cv2.GaussianBlur(noise, (3, 3), 0)
        left, right = texture[:, :width].copy(), texture[:, 8 : 8 + width].copy()
        right[100:, 150:300] = left[100:, 180:330]
        self.pair = [image.astype(np.uint8) for image in (left, right)]
        self.paths = [os.path.join(folder, name) for name in ("left.png", "right.png")]
        for path, image in zip(self.paths, self.pair):
            cv2.imwrite(path, image)

    def ours(self):
        def milliseconds(method, threads):
            return lines(self.program, method, *self.paths, str(DISPARITIES), "10", threads)[0]

        times, self.own = {}, {}
        for method, job in self.JOBS.items():
            job = f"{job}, 512x384, 64"
            total, own = milliseconds(method, "1")
            times[job] = float(total) * 1e-3
            self.own[f"{job}, two threads"] = float(own) * 1e-3
            # What else runs on the machine takes the second processor, but no processor time.
            times[f"{job}, two threads"] = float(milliseconds(method, "2")[1]) * 1e-3
        return times

    def theirs(self):
        block, semi = (f"{job}, 512x384, 64" for job in self.JOBS.values())
        bm = cv2.StereoBM_create(DISPARITIES, 15)
        yield block, "OpenCV BM", median_s(lambda: bm.compute(*self.pair))
        sgbm = (0, DISPARITIES, 5, 200, 800, 1, 0, 10, 100, 2)
        for name, mode in (("SGBM", cv2.STEREO_SGBM_MODE_SGBM), ("3WAY", cv2.STEREO_SGBM_MODE_SGBM_3WAY)):
            matcher = cv2.StereoSGBM_create(*sgbm, mode)
            yield semi, f"OpenCV {name}", median_s(lambda: matcher.compute(*self.pair))
        for job, seconds in self.own.items():
            yield job, "ours, one thread", seconds


class Scenes:
    """Scenes of two people weighed in a depth image: each person a template that is brought to size and
    moved to its depth, the nearer before the farther, and the capped differences summed."""

    NAMES = {"templates": "625 joint templates", "held": "50 joint templates, depth held"}
    COUNTS = {"templates": (625, 0.1), "held": (50, 0.0)}
    FOCAL, HEADS, CAP = 183.0, ((2.5, 0.1, 1.6), (3.4, -0.15, 1.65)), 0.3

    def __init__(self):
        random = np.random.default_rng(1)
        y, x = np.mgrid[-1:1:60j, -1:1:60j]
        self.template = np.where(x**2 + y**2 < 1, 0.1 * (x**2 + y**2), 9.0).astype(np.float32)
        self.depth = np.full((192, 256), 5.5, np.float32)
        self.scenes = {}
        for name, (count, deep) in self.COUNTS.items():
            off = random.uniform(-1, 1, (count, 2, 3)) * [deep, 0.2, 0.4 * deep]
            self.scenes[name] = np.array(self.HEADS) + off

    def times(self):
        for name, job in self.NAMES.items():
            scenes = self.scenes[name]
            calls = 3000 // len(scenes)
            yield job, "numpy and OpenCV", median_s(lambda: [self.weigh(scene) for scene in scenes])

    def weigh(self, scene):
        boxes = []
        for far, aside, high in scene:
            side = int(0.6 * self.FOCAL / far)
            left = int(128 - self.FOCAL * aside / far) - side // 2
            boxes.append((left, int(96 + self.FOCAL * (1.2 - high) / far), side, far))
        left, top = (min(box[k] for box in boxes) for k in (0, 1))
        right, bottom = (max(box[k] + box[2] for box in boxes) for k in (0, 1))
        drawn = np.full((bottom - top, right - left), 9.0, np.float32)
        for x, y, side, far in boxes:
            person = cv2.resize(self.template, (side, side), interpolation=cv2.INTER_NEAREST)
            part = drawn[y - top : y - top + side, x - left : x - left + side]
            np.minimum(part, person + np.float32(far), out=part)
        off = cv2.absdiff(drawn, self.depth[top:bottom, left:right])
        return np.minimum(off, self.CAP, out=off).sum()


class Appearance:
    """One person found again in a colour image, and learnt: the same images as `time_stages`, whose grey
    and integral images count as those of the peers do."""

    NAMES = {"compressive": "compressive tracking, a person and frame"}
    PEERS = {"KCF": cv2.TrackerKCF_create, "MOSSE": cv2.legacy.TrackerMOSSE_create}

    def __init__(self):
        y, x = np.mgrid[:480, :640]
        self.images = []
        for step in range(20):
            left = 270 + 2 * step
            inside = (abs(x - left - 50) < 50) & (abs(y - 220) < 50)
            person = ((2 * x - 2 * left) ** 2 // 64 + 7 * y) % 120 + 90
            grey = np.where(inside, person, (x**2 // 64 + 21 * y) % 120 + 20)
            self.images.append(cv2.cvtColor(grey.astype(np.uint8), cv2.COLOR_GRAY2BGR))

    def times(self):
        (job,) = self.NAMES.values()
        for name, create in self.PEERS.items():
            tracker, times = create(), []
            tracker.init(self.images[0], (270, 170, 100, 100))
            for image in self.images[1:]:
                times.append(time_once(lambda: tracker.update(image)))
            yield job, name, statistic(times)


class Wheels:
    """From a pair to speeds of the wheels: ours on simulated people with all its tests, theirs the same
    parts of OpenCV: matching, one template in 32 sizes, in depth of half the size as ours and of the full one, and
    a Kalman filter."""

    JOBS = {"block": "a pair to speeds of wheels, block", "semi-global": "a pair to speeds of wheels, semi-global"}
    SCENE, CONFIG = "configs/scenes/stereo-follow-passing.toml", "configs/stereo-ekf.toml"

    def __init__(self, folder, stereo):
        self.program, self.pair = built("time_frames"), stereo.pair
        self.log = os.path.join(folder, "pairs.mcap")
        simulate = ["simulate", self.SCENE, "-o", self.log, "--set", "duration_s=4"]
        subprocess.run(["cargo", "run", "-q", "--release", "--", *simulate], check=True, capture_output=True)
        self.configs = {}
        for method in self.JOBS:
            with open(self.CONFIG) as config:
                text = config.read().replace("[stereo]", f'[stereo]\nmethod = "{method}"')
            self.configs[method] = os.path.join(folder, f"{method}.toml")
            with open(self.configs[method], "w") as config:
                config.write(text)
        self.filter = Filters()
        y, x = np.mgrid[-1:1:60j, -1:1:60j]
        self.template = (0.1 * (x**2 + y**2)).astype(np.float32)

    def ours(self):
        def median_ms(config):
            return float(lines(self.program, "--once", self.log, config)[-1][5])

        return {job: 1e-3 * median_ms(self.configs[method]) for method, job in self.JOBS.items()}

    def theirs(self):
        block = cv2.StereoBM_create(DISPARITIES, 15)
        semi = cv2.StereoSGBM_create(0, DISPARITIES, 5, 200, 800, 1, 0, 10, 100, 2, cv2.STEREO_SGBM_MODE_SGBM_3WAY)
        for job, matcher in zip(self.JOBS.values(), (block, semi)):
            for part, size in ((2, "half"), (1, "full")):
                name = f"the same parts of OpenCV, templates of {size} size"
                yield job, name, median_s(lambda: self.steer(matcher, part))

    def steer(self, matcher, part):
        disparity = matcher.compute(*self.pair)[::part, ::part].astype(np.float32) / 16
        depth = 30.0 / np.maximum(disparity, 1.0)
        best = []
        for far in np.geomspace(0.8, 5.5, 32):
            side = max(8, int(0.6 * 214 / part / far))
            template = cv2.resize(self.template, (side, side)) + np.float32(far)
            best.append(cv2.minMaxLoc(cv2.matchTemplate(depth, template, cv2.TM_SQDIFF))[0] / side**2)
        self.filter.step_opencv()
        return best


class Stages:
    """What one call of `time_stages` times."""

    def __init__(self):
        self.program = built("time_stages")
        self.peers = (Scenes(), Appearance())

    def ours(self):
        us = {name: float(time) for name, time in lines(self.program)}
        return {job: 1e-6 * us[name] for peer in self.peers for name, job in peer.NAMES.items()}

    def theirs(self):
        for peer in self.peers:
            yield from peer.times()


def measured(seconds):
    return f"{1e6 * seconds:.2f} us" if seconds < 1e-3 else f"{1e3 * seconds:.2f} ms"


def main():
    cv2.setNumThreads(1)
    rounds = {}
    with tempfile.TemporaryDirectory() as folder:
        stereo = Stereo(folder)
        groups = (Assignment(), Particles(), Stages(), Patches(), Filters(), Trackers(),
                  Metrics(folder), Logs(), Images(folder), stereo, Wheels(folder, stereo))
        for _ in range(ROUNDS):
            for group in groups:
                ours = group.ours()
                for job, peer, seconds in group.theirs():
                    rounds.setdefault((job, peer), []).append((ours[job], seconds))
    print("| job, peer | its language | ours | peer's | ratio |")
    print("|---|---|---|---|---|")
    for (job, peer), (ours, theirs, ratio) in rows(rounds).items():
        times = f"{measured(ours)} | {measured(theirs)} | {ratio:.2f}"
        print(f"| {job}, beside {peer} | {language(peer)} | {times} |")


if len(sys.argv) != 1:
    sys.exit(__doc__)
main()
