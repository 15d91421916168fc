"""The case of the same bytes: a workflow is run with 1, 2 and 4 threads, with its steps in another order, killed and resumed, and made again.

Each way has a store of its own. Artifacts are compared byte by byte. What is in a store is not run again, but for kills and repetitions,
which are done anew each time.
"""

import hashlib
import itertools
import json
import pathlib
import re
import shutil
import signal
import subprocess
import time

import yaml

import runs

THREADS = (1, 2, 4)
# Where a step is killed: shares of its progress.
KILLED_AT = (0.15, 0.5, 0.85)
# How long a killed run's workers may take to end (s).
PATIENCE = 30.0


class Study:
    """The workflow and its stores. `costs` takes the CPU seconds of all steps, by store, step and item."""

    def __init__(self, name: str, costs: dict[tuple[str, str, str], float]):
        self.file, self.folder, self.costs = runs.STORE / "workflows" / f"{name}.yaml", runs.STORE / name, costs
        self.text = yaml.safe_load(self.file.read_text())
        self.steps = list(self.text["steps"])
        # Steps that may be killed in their midst: those that make checkpoints.
        self.long = [s for s, about in self.text["steps"].items() if about["plugin"] == "forming-explicit"]

    def command(self, way: str, *words: str, file: pathlib.Path | None = None) -> list[str]:
        return [runs.PLYFLOW, "run", str(file or self.file), "--store", str(self.folder / way), "--no-report", "--log-format", "json", *words]

    def run(self, way: str, *words: str, file: pathlib.Path | None = None) -> list[dict]:
        """Runs it to its end; the events."""
        done = subprocess.run(self.command(way, *words, file=file), stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        if done.returncode != 0:
            raise SystemExit(f"hard-cases: {self.file} ({way}) ended with code {done.returncode}:\n{done.stderr}")
        for step in self.told(way, file)["steps"]:
            self.costs[f"{self.folder}/{way}", step["step"], str(step["item"])] = step["cost"]["cpu_seconds"]
        return [json.loads(line) for line in done.stderr.splitlines() if line.startswith("{")]

    def told(self, way: str, file: pathlib.Path | None = None) -> dict:
        return json.loads(runs.plyflow("results", str(file or self.file), "--store", str(self.folder / way), "--format", "json"))

    def artifacts(self, way: str, file: pathlib.Path | None = None) -> dict[str, str]:
        """Hashes of what each step has made."""
        steps = self.told(way, file)["steps"]
        return {s["step"]: hashlib.sha256(pathlib.Path(s["artifact"]).read_bytes()).hexdigest() for s in steps}

    def cost(self, ways: list[str], steps: list[str]) -> float:
        places = [f"{self.folder}/{way}" for way in ways]
        return sum(c for (place, step, _), c in self.costs.items() if place in places and step in steps)


def measure(name: str, rows: list, costs: dict) -> None:
    """Puts into every row what came of its way (`threads` of one step; `order`, `killed` and `again` of all)."""
    study = Study(name, costs)
    # One by one: steps that could run at once would share the threads.
    for n, step in itertools.product(THREADS, study.steps):
        study.run(str(n), "--jobs", str(n), "--until", step)
    wanted = study.artifacts("1")
    for row in rows:
        if row.by == "threads":
            row.results, row.cost = threads(study, row.step, wanted)
        else:
            row.results, row.cost = {"order": order, "killed": killed, "again": again}[row.by](study, wanted)


def differing(wanted: dict[str, str], found: dict[str, str]) -> dict[str, float]:
    """How many steps were compared, and how many are not there or not the same."""
    return {"compared": len(found), "different": sum(found.get(s) != h for s, h in wanted.items())}


def threads(study: Study, step: str, wanted: dict[str, str]) -> tuple[dict[str, float], float]:
    """With 2 and with 4 threads beside 1; `threads` is the most that it really had."""
    others = [str(n) for n in THREADS[1:]]
    different = sum(study.artifacts(way)[step] != wanted[step] for way in others)
    used = [s["cost"]["threads"] for way in others for s in study.told(way)["steps"] if s["step"] == step]
    return {"compared": len(others), "different": different, "threads": max(used)}, study.cost([str(n) for n in THREADS], [step])


def order(study: Study, wanted: dict[str, str]) -> tuple[dict[str, float], float]:
    """With the steps in the file from last to first, two at once."""
    turned = study.file.with_name(f"{study.file.stem}-turned.yaml")
    steps = dict(reversed(study.text["steps"].items()))
    turned.write_text(yaml.safe_dump({**study.text, "steps": steps}, sort_keys=False))
    study.run("turned", "--jobs", "2", file=turned)
    return differing(wanted, study.artifacts("turned", turned)), study.cost(["turned"], study.steps)


def killed(study: Study, wanted: dict[str, str]) -> tuple[dict[str, float], float]:
    """With SIGKILL for the program and its workers in the midst of every long step, and with another number of threads after each."""
    shutil.rmtree(study.folder / "killed", ignore_errors=True)
    kills = resumed = 0
    for step in study.long:
        for share in KILLED_AT:
            jobs = str(1 + kills % 2)
            was_killed, went_on = kill_once(study.command("killed", "--jobs", jobs, "--checkpoint-every", "0 s"), step, share)
            kills, resumed = kills + was_killed, resumed + went_on
    events = study.run("killed", "--jobs", "1", "--checkpoint-every", "0 s")
    resumed += any(goes_on(e) for e in events)
    numbers = differing(wanted, study.artifacts("killed"))
    return {**numbers, "kills": kills, "resumed": resumed}, study.cost(["killed"], study.steps)


def goes_on(event: dict) -> bool:
    return event.get("event") == "log" and "goes on from a checkpoint" in event["text"]


def kill_once(command: list[str], step: str, share: float) -> tuple[bool, bool]:
    """Starts a run and kills it where the step has got so far: whether it was killed, and whether it had gone on from a checkpoint."""
    engine = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    was_killed = went_on = False
    for line in engine.stderr:
        event = json.loads(line) if line.startswith("{") else {}
        went_on |= goes_on(event)
        if not was_killed and event.get("event") == "progress" and event["step"] == step and event["fraction"] >= share:
            engine.send_signal(signal.SIGKILL)
            was_killed = True
    engine.wait()
    until = time.monotonic() + PATIENCE
    while workers(engine.pid) and time.monotonic() < until:
        time.sleep(0.02)
    if workers(engine.pid):
        raise SystemExit(f"hard-cases: workers of process {engine.pid} live on after it was killed")
    return was_killed, went_on


def workers(engine: int) -> int:
    """How many workers of a program live."""
    mark, count = f"--parent\0{engine}\0".encode(), 0
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            count += mark in (process / "cmdline").read_bytes()
        except OSError:
            pass
    return count


def again(study: Study, wanted: dict[str, str]) -> tuple[dict[str, float], float | None]:
    """By `plyflow verify --again`, with two threads what was made with one."""
    words = [word for step in study.steps for word in ("--again", step)]
    place = (str(study.file), "--store", str(study.folder / "1"))
    done = subprocess.run([runs.PLYFLOW, "verify", *place, *words, "--jobs", "2"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    same = len(re.findall("made again, the same", done.stdout))
    return {"compared": len(study.steps), "different": len(wanted) - same, "exit_code": done.returncode}, None
