"""Rendering, tracking and measuring, each kept on disk until something changes."""
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

from . import cases

OTHER = cases.ROOT / "tests/independent/render_sequence.py"


def run(command, log):
    """Standard output, which is also kept in `log` with the complaints."""
    log.parent.mkdir(parents=True, exist_ok=True)
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    log.write_text(done.stdout + done.stderr)
    if done.returncode != 0:
        said = (done.stderr.strip() or "failed").splitlines()[-1]
        raise RuntimeError(f"{' '.join(map(str, command))}: {said}")
    return done.stdout


def load(path):
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None


class Bench:
    """The program that is measured and the folders where everything is kept."""

    def __init__(self, program, data, tracks=None, renderer=None, again=False, jobs=0,
                 version=None):
        self.program = Path(program).resolve()
        self.data = Path(data).resolve()
        self.tracks = Path(tracks).resolve() if tracks else self.data / "tracks"
        self.renderer = Path(renderer).resolve() if renderer else self.program
        self.again = again
        self.jobs = jobs
        digest = version or hashlib.sha256(self.program.read_bytes()).hexdigest()[:12]
        self.measures = self.data / "measure" / digest

    def sequence(self, case):
        """Folder of the rendered sequence."""
        folder = self.data / "sequences" / case.name
        if load(folder / "spec.json") == case.spec() and (folder / "sequence.json").exists():
            return folder
        folder.mkdir(parents=True, exist_ok=True)
        for stale in ("spec.json", "sequence.json"):
            (folder / stale).unlink(missing_ok=True)
        tool = [self.renderer, "render"] if case.renderer == "alight" else [OTHER]
        run([*tool, "--rig", case.rig, *case.arguments, "--out", folder],
            folder / "render.log")
        (folder / "spec.json").write_text(json.dumps(case.spec()))
        return folder

    def track(self, name, sequence, rig):
        """Folder of the estimate, made again when program, rig or sequence are newer."""
        folder = self.tracks / name
        result = folder / "result.json"
        newest = max(os.path.getmtime(p) for p in
                     (self.program, rig, sequence / "sequence.json"))
        if result.exists() and os.path.getmtime(result) > newest and not self.again:
            return folder
        folder.mkdir(parents=True, exist_ok=True)
        run([self.program, "track", sequence, "--rig", rig, "--json", "--out", folder],
            folder / "track.log")
        return folder

    def measure(self, study, rows=True):
        """Summary of `alight measure` and the file of its rows."""
        name = study.name.replace(" ", "_").replace(",", "-")
        summary, table = self.measures / f"{name}.json", self.measures / f"{name}.csv"
        command = [self.program, "measure", "--rig", study.rig, "--first-seed", study.first,
                   "--seeds", study.seeds, "--jobs", self.jobs, "--json", *study.arguments]
        if rows:
            command += ["--rows", table]
        key = [str(c) for c in command[1:]] + [study.rig.read_text()]
        known = load(summary)
        if known and known.get("key") == key and (table.exists() or not rows):
            return known, table
        if sys.stderr.isatty():
            print(f"\r\033[K{study.name}", end="", file=sys.stderr)
        result = json.loads(run(command, self.measures / f"{name}.log"))
        summary.write_text(json.dumps(result | {"key": key}))
        return result, table
