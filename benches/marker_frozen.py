#!/usr/bin/env python3
"""Writes what OpenCV makes of a few images: thresholded and cleaned masks, and the centroids of their contours.

    python3 benches/marker_frozen.py > track/src/tests/opencv.json

Needs OpenCV's Python module. The images follow from integer arithmetic, so that the test of raven-track makes the same ones.
"""

import json
import struct

import cv2
import numpy as np

# Width, height, seed, hue [deg], saturation, value, region.
CASES = [
    (640, 480, 1, (90, 150), 0.45, 0.15, (0, 0, 640, 480)),
    (640, 480, 1, (90, 150), 0.45, 0.15, (400, 230, 100, 100)),
    (640, 480, 2, (90, 150), 0.30, 0.20, (0, 0, 640, 480)),
    (333, 217, 3, (80, 160), 0.25, 0.10, (0, 0, 333, 217)),
    (333, 217, 3, (80, 160), 0.25, 0.10, (150, 60, 127, 91)),
    (200, 150, 4, (20, 110), 0.15, 0.30, (0, 0, 200, 150)),
    (130, 66, 5, (340, 60), 0.05, 0.30, (1, 2, 128, 64)),
    (64, 64, 6, (100, 140), 0.60, 0.05, (0, 0, 64, 64)),
    (65, 40, 7, (0, 358), 0.20, 0.00, (0, 0, 65, 40)),
]


def picture(width, height, seed):
    """The image of the test in track/src/tests/opencv.rs, red green blue."""
    y, x = np.mgrid[:height, :width].astype(np.int64)
    state = np.uint64(seed) ^ ((x.astype(np.uint64) << np.uint64(32)) | y.astype(np.uint64))

    def noise():
        nonlocal state
        state = state + np.uint64(0x9E3779B97F4A7C15)
        z = state
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return ((z ^ (z >> np.uint64(31))) >> np.uint64(33)).astype(np.int64)

    cx, cy, r = width * 11 // 20, height * 9 // 20, min(width, height) // 5
    dx, dy = x - cx, y - cy
    tilt = 40 * (dx + dy)
    shade = 100 - np.sign(tilt) * (np.abs(tilt) // (2 * r + 1))
    bands = np.array([[110, 100, 90], [60, 90, 70], [150, 150, 155], [90, 130, 80], [30, 30, 35], [70, 120, 60], [200, 190, 170]])
    base = bands[(x // 23 + 2 * (y // 17)) % 7]
    disc = np.array([40, 190, 30]) * shade[..., None] // 100
    base = np.where((dx * dx + dy * dy <= r * r)[..., None], disc, base)
    grain = np.stack([noise() % 41 - 20 for _ in range(3)], axis=-1)
    return np.clip(base + grain, 0, 255).astype(np.uint8)


def threshold(image, hue, saturation, value):
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    low, high = round(hue[0] / 2) % 180, round(hue[1] / 2) % 180
    least = int(saturation * 255 + 0.5), int(value * 255 + 0.5)
    if low <= high:
        return cv2.inRange(hsv, (low, *least), (high, 255, 255))
    return cv2.inRange(hsv, (low, *least), (179, 255, 255)) | cv2.inRange(hsv, (0, *least), (high, 255, 255))


def clean(mask):
    kernel = np.ones((3, 3), np.uint8)
    return cv2.dilate(cv2.erode(cv2.medianBlur(mask, 5), kernel), kernel)


def digest(mask):
    value = 0xCBF29CE484222325
    for byte in mask.tobytes():
        value = ((value ^ byte) * 0x100000001B3) % 2**64
    return [int((mask > 0).sum()), value]


def bits(number):
    return struct.unpack("<Q", struct.pack("<d", number))[0]


def contours(mask, x, y):
    found, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    centroids = []
    for i, outline in enumerate(found):
        moments = cv2.moments(outline)
        if tree[0][i][3] == -1 and moments["m00"] > 0:
            centroids.append([bits(moments["m10"] / moments["m00"] + x), bits(moments["m01"] / moments["m00"] + y)])
    return sorted(centroids)


def main():
    out = []
    for width, height, seed, hue, saturation, value, (x, y, w, h) in CASES:
        part = np.ascontiguousarray(picture(width, height, seed)[y:y + h, x:x + w])
        mask = threshold(part, hue, saturation, value)
        whole = clean(mask)
        out.append({
            "width": width, "height": height, "seed": seed, "hue_deg": hue, "min_saturation": saturation, "min_value": value,
            "region": [x, y, w, h], "threshold": digest(mask), "clean": digest(whole), "contours": contours(whole, x, y),
        })
    print("[\n" + ",\n".join(json.dumps(case) for case in out) + "\n]")


if __name__ == "__main__":
    main()
