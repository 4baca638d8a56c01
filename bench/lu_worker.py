# SPDX-License-Identifier: Apache-2.0
"""Runs lu-vp-detect in an environment of its own: a path on each input line, an answer in JSON on each output line.

It is a program for another interpreter, with another OpenCV: it imports nothing of this project.
"""

import json
import sys
import time

import cv2
from lu_vp_detect import VPDetection

LENGTH_THRESHOLD = 30  # px, its default
SEED = 1337  # of its random choice of line pairs


def main() -> None:
    """Answer until the input ends; the arguments are focal length and principal point, px."""
    focal_length, cx, cy = map(float, sys.argv[1:4])
    cv2.setNumThreads(1)
    detector = VPDetection(LENGTH_THRESHOLD, (cx, cy), focal_length, SEED)
    for line in sys.stdin:
        gray = cv2.imread(line.rstrip("\n"), cv2.IMREAD_GRAYSCALE)
        began = time.process_time()
        directions = detector.find_vps(gray)
        spent = time.process_time() - began
        print(json.dumps({"directions": directions.tolist(), "cpu_ms": 1e3 * spent}), flush=True)


if __name__ == "__main__":
    main()
