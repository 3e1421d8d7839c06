#!/usr/bin/env python3
"""Times raven-calibrate's solution against OpenCV's on the same pictures, in the same run.

    cargo build --release -p raven-calibrate
    python3 benches/calibrate_opencv.py target/release/raven-calibrate 'FOLDER/left*.jpg' 'FOLDER/right*.jpg' 9x6 0.03

Needs OpenCV 5's Python module. Both find the corners in their own way; what is timed is from corners to two cameras and the pose between
them: each camera alone, then both together with all their numbers free. Medians of several runs, alternating, each on one thread.
"""

import glob
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

RUNS = 7


def corners(files, size):
    found = []
    for name in files:
        image = cv2.imread(name, cv2.IMREAD_GRAYSCALE)
        seen, points = cv2.findChessboardCorners(image, size)
        if seen:
            stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
            points = cv2.cornerSubPix(image, points, (5, 5), (-1, -1), stop)
        found.append(points if seen else None)
    return found, image.shape[::-1]


def opencv(board, left, right, shape):
    """Seconds alone, seconds together, RMS together, translation."""
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-9)
    flags = cv2.CALIB_FIX_K3
    start = time.perf_counter()
    alone = []
    for side in (left, right):
        seen = [p for p in side if p is not None]
        alone.append(cv2.calibrateCamera([board] * len(seen), seen, shape, None, None, flags=flags, criteria=stop))
    middle = time.perf_counter()
    both = [(a, b) for a, b in zip(left, right) if a is not None and b is not None]
    (_, k1, d1, *_), (_, k2, d2, *_) = alone
    result = cv2.stereoCalibrate(
        [board] * len(both), [a for a, _ in both], [b for _, b in both], k1, d1, k2, d2, shape,
        flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS, criteria=stop,
    )
    end = time.perf_counter()
    return middle - start, end - middle, result[0], result[6].ravel()


def ours(program, patterns, size, square):
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "result.json")
        command = [program, "cameras", "--left", patterns[0], "--right", patterns[1], "--board", size, "--square", square, "--json", path]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with open(path, encoding="utf-8") as file:
            return json.load(file)


def main():
    program, left, right, size, square = sys.argv[1:]
    columns, rows = (int(n) for n in size.split("x"))
    cv2.setNumThreads(1)
    board = np.zeros((columns * rows, 3), np.float32)
    board[:, :2] = np.mgrid[:columns, :rows].T.reshape(-1, 2) * float(square)
    points = []
    for pattern in (left, right):
        found, shape = corners(sorted(glob.glob(pattern)), (columns, rows))
        points.append(found)
    theirs, mine = [], []
    for _ in range(RUNS):
        theirs.append(opencv(board, *points, shape))
        mine.append(ours(program, (left, right), size, square))
    alone, together = (statistics.median(run[i] for run in theirs) for i in (0, 1))
    solve = statistics.median(run["solve_seconds"] for run in mine)
    stereo = mine[-1]["stereo"]
    print(f"OpenCV {cv2.__version__}: alone {1e3 * alone:.1f} ms, together {1e3 * together:.1f} ms, RMS {theirs[-1][2]:.4f} px, "
          f"t {1e3 * theirs[-1][3].round(7)} mm")
    print(f"raven-calibrate: alone and together {1e3 * solve:.1f} ms, RMS {stereo['rms_px']:.4f} px, gradient {stereo['gradient']:.1e}, "
          f"t {1e3 * np.round(stereo['translation_m'], 7)} mm")
    print(f"time over OpenCV's: {solve / (alone + together):.2f} (over its last step alone: {solve / together:.2f})")


if __name__ == "__main__":
    main()
