#!/usr/bin/env python3
"""Times raven-track against straightforward trackers in Python and OpenCV on the same recording, in the same run, each on one processor.

    cargo build --release -p raven-track
    python3 benches/track_opencv.py target/release/raven-track sinusoid.mcap robot.yaml cameras.yaml

Needs OpenCV's, NumPy's and mcap's Python modules. The Python trackers read the recording, decode every JPEG, look for the contour's centroid, pair
the cameras and triangulate: one in whole images, one in 100 x 100 pixels around where it was last while it is not lost. They do no kinematics, fit
no ball and write nothing, all of which raven-track does. What is compared is the processor's time of each, the least of several runs.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np
from mcap.reader import make_reader

RUNS = 5
KERNEL = np.ones((3, 3), np.uint8)


def centroid(image):
    mask = cv2.inRange(cv2.cvtColor(image, cv2.COLOR_BGR2HSV), (45, 115, 38), (75, 255, 255))
    mask = cv2.dilate(cv2.erode(cv2.medianBlur(mask, 5), KERNEL), KERNEL)
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        return None
    moments = cv2.moments(max(outlines, key=cv2.contourArea))
    return (moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]) if moments["m00"] > 30 else None


def anywhere(image, _):
    return centroid(image)


def nearby(image, last):
    if last is not None:
        x, y = max(0, round(last[0]) - 50), max(0, round(last[1]) - 50)
        found = centroid(image[y:y + 100, x:x + 100])
        if found is not None:
            return found[0] + x, found[1] + y
    return centroid(image)


def track(path, look):
    last, tracks = {"left": None, "right": None}, {"left": [], "right": []}
    frames = 0
    with open(path, "rb") as file:
        topics = [f"/stereo/{side}/image_raw/compressed" for side in last]
        for _, channel, message in make_reader(file).iter_messages(topics=topics):
            side = "left" if "/left/" in channel.topic else "right"
            start = message.data.find(b"\xff\xd8\xff")
            image = cv2.imdecode(np.frombuffer(message.data, np.uint8, offset=start), cv2.IMREAD_COLOR)
            last[side] = look(image, last[side])
            tracks[side].append((message.publish_time, last[side]))
            frames += 1
    p = np.array([[600, 0, 320, 0], [0, 600, 240, 0], [0, 0, 1, 0]], float)
    q = p.copy()
    q[0, 3] = -600 * 0.048
    pairs = [(a[1], b[1]) for a, b in zip(tracks["left"], tracks["right"]) if a[1] and b[1]]
    points = [cv2.triangulatePoints(p, q, np.array(a).reshape(2, 1), np.array(b).reshape(2, 1)) for a, b in pairs]
    return frames, len(points)


def main():
    program, log, robot, cameras = sys.argv[1:]
    cv2.setNumThreads(1)
    looks = {"whole images": anywhere, "100 x 100 pixels": nearby}
    theirs, ours = {name: [] for name in looks}, []
    with tempfile.TemporaryDirectory() as folder:
        command = [program, log, "--robot", robot, "--cameras", cameras, "-o", os.path.join(folder, "tracked.mcap")]
        for _ in range(RUNS):
            for name, look in looks.items():
                start = time.process_time()
                frames, seen = track(log, look)
                theirs[name].append(time.process_time() - start)
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, "RAYON_NUM_THREADS": "1"})
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            ours.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    own = min(ours)
    print(f"raven-track: {own:.2f} s for {frames} frames, {1e3 * own / frames:.3f} ms each, {seen} pairs of OpenCV {cv2.__version__}")
    for name, times in theirs.items():
        python = min(times)
        print(f"Python in {name}: {1e3 * python / frames:.3f} ms each; raven-track is {python / own:.2f} times as fast per processor")


if __name__ == "__main__":
    main()
