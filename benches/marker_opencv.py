#!/usr/bin/env python3
"""Times raven-track's mask and contour against OpenCV's on the same frames, in the same run, each on one thread.

    cargo bench -p raven-track --bench marker --no-run
    python3 benches/marker_opencv.py target/release/deps/marker-*[0-9a-f]

Needs OpenCV's Python module. Frames are 640x480: a green disc of 14 px before textured patches, with noise. The pipeline is that of the paper:
HSV, threshold, 5x5 median, 3x3 erosion and dilation, outer contours, moments. Runs alternate; what is printed is the least
of all, as whatever else runs on the machine only adds.
"""

import json
import os
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

FRAMES, RUNS, WIDTH, HEIGHT = 12, 5, 640, 480
KERNEL = np.ones((3, 3), np.uint8)


def frame(seed):
    rng = np.random.default_rng(seed)
    patches = rng.uniform(50, 150, (HEIGHT // 40, WIDTH // 40, 1)) + rng.uniform(-18, 18, (HEIGHT // 40, WIDTH // 40, 3))
    image = cv2.resize(patches.astype(np.float32), (WIDTH, HEIGHT), interpolation=cv2.INTER_NEAREST)
    u, v = rng.uniform(120, WIDTH - 120), rng.uniform(120, HEIGHT - 120)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    inside = np.clip(14.5 - np.hypot(x - u, y - v), 0, 1)[..., None]
    image = cv2.GaussianBlur((image * (1 - inside) + np.array([40, 190, 30]) * inside).astype(np.float32), (0, 0), 0.8)
    return np.clip(np.rint(image + rng.normal(0, 3, image.shape)), 0, 255).astype(np.uint8), (u, v)


def clean(image):
    mask = cv2.inRange(cv2.cvtColor(image, cv2.COLOR_RGB2HSV), (45, 115, 38), (75, 255, 255))
    return cv2.dilate(cv2.erode(cv2.medianBlur(mask, 5), KERNEL), KERNEL)


def track(image):
    outlines, _ = cv2.findContours(clean(image), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return [cv2.moments(outline) for outline in outlines]


def milliseconds(images):
    times = []
    for _ in range(20):
        start = time.perf_counter()
        for image in images:
            track(image)
        times.append(1e3 * (time.perf_counter() - start) / len(images))
    return min(times)


def main():
    program = sys.argv[1]
    cv2.setNumThreads(1)
    images, middles = zip(*(frame(seed) for seed in range(FRAMES)))
    corners = [(round(u - 50), round(v - 50)) for u, v in middles]
    regions = [np.ascontiguousarray(i[y:y + 100, x:x + 100]) for i, (x, y) in zip(images, corners)]
    theirs, ours = [], []
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "frames.rgb")
        with open(path, "wb") as file:
            file.write(b"".join(i.tobytes() for i in images))
        command = [program, path, str(WIDTH), str(HEIGHT), *(str(c + 50) for corner in corners for c in corner)]
        for _ in range(RUNS):
            theirs.append([milliseconds(images), milliseconds(regions)])
            ours.append(json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))
        masks = np.fromfile(os.path.join(folder, "frames.masks"), np.uint8).reshape(FRAMES, HEIGHT, WIDTH)
    same = sum(int((clean(i) != m).sum()) for i, m in zip(images, masks))
    full, region = (min(run[i] for run in theirs) for i in (0, 1))
    own = {key: min(run[key] for run in ours) for key in ours[0]}
    print(f"pixels in which the masks differ: {same}")
    for name, key, other in (("full frame", "full_ms", full), ("region 100x100", "region_ms", region)):
        print(f"{name:15} OpenCV {cv2.__version__} {other:.4f} ms, raven-track {own[key]:.4f} ms, ratio {own[key] / other:.3f}")
    print(f"fit of a ball   {own['ball_ms']:.3f} ms, refined {own['refined_ms']:.3f} ms")


if __name__ == "__main__":
    main()
