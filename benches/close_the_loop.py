#!/usr/bin/env python3
"""Puts what was diagnosed into the robot file and diagnoses again: nothing should be left to name.

    cargo build --release --workspace
    python3 benches/close_the_loop.py SEALED FOLDER --robot robot.yaml

Every recording of an opened folder (`labels.json`, `cameras.yaml`) is diagnosed. Where effects are named and explain it, `raven-identify
--add-effect` adds all of them to the robot file, and the recording is diagnosed against that; where two true ones are named, also with either one
added alone, which should leave the other. Reports that are in FOLDER from a run before are kept.
"""

import argparse
import json
import pathlib
import subprocess


class Rig:
    def __init__(self, told):
        self.folder, self.robot, self.cameras = told.folder, told.robot, told.sealed / "cameras.yaml"

    def diagnosed(self, log, robot, report):
        if not report.exists():
            run("raven-diagnose", log, "--robot", robot, "--cameras", self.cameras, "--json", report)
        return json.loads(report.read_text())

    def again(self, log, first, added, tag):
        """What is named once these are in the file; why not, where they cannot be."""
        robot, report = (self.folder / f"{log.stem}.{tag}.{kind}" for kind in ("yaml", "json"))
        arguments = [argument for place in added for argument in ("--add-effect", place)]
        robot.unlink(missing_ok=True)
        try:
            run("raven-identify", "--robot", self.robot, "--cameras", self.cameras, "--diagnosis", first, *arguments, "-o", robot)
        except subprocess.CalledProcessError as error:
            return error.stderr.strip()
        return places(self.diagnosed(log, robot, report)["effects"])


def run(program, *arguments):
    subprocess.run([f"target/release/{program}", *map(str, arguments)], check=True, capture_output=True, text=True)


def said(left):
    return left if isinstance(left, str) else ", ".join(left) or "nothing"


def places(effects):
    return sorted(effect["id"] + (f":{effect['joint']}" if effect["joint"] else "") for effect in effects)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("sealed", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--robot", type=pathlib.Path, required=True)
    told = parser.parse_args()
    told.folder.mkdir(parents=True, exist_ok=True)
    rig, labels = Rig(told), json.loads((told.sealed / "labels.json").read_text())
    nothing_left, other_left = [0, 0], [0, 0]
    for log in sorted(told.sealed.glob("*.mcap")):
        first = told.folder / f"{log.stem}.json"
        report = rig.diagnosed(log, told.robot, first)
        named = places(report["effects"])
        if report["verdict"] != "explained":
            continue
        left = rig.again(log, first, named, "all")
        print(f"{log.stem}: {', '.join(named)} added, left: {said(left)}", flush=True)
        if isinstance(left, str):
            continue
        nothing_left = [nothing_left[0] + (left == []), nothing_left[1] + 1]
        if len(named) == 2 and named == places(labels[log.stem]["effects"]):
            for k, (one, other) in enumerate([named, named[::-1]]):
                left = rig.again(log, first, [one], f"only{k}")
                print(f"{log.stem}: {one} added, left: {said(left)}", flush=True)
                other_left = [other_left[0] + (left == [other]), other_left[1] + 1]
    print(f"all added, nothing left: {nothing_left[0]} of {nothing_left[1]}")
    print(f"one of two added, the other left: {other_left[0]} of {other_left[1]}")


if __name__ == "__main__":
    main()
