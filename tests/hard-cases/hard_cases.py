"""Runs the hard cases and writes their page; see scripts/hard-cases.

A case is a row of tests/hard-cases/suite.yaml: a step of a workflow and the criterion by which it is right, which was written before it
was run. A row is `right` when the step ended and its results are within the criterion, `stopped` when it ended with the located
statement that the criterion asks for, and `wrong` otherwise: a number beyond its bound, a stop that was not asked for, or no stop
where one was.
"""

import json
import math
import pathlib
import re
import subprocess
import sys

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs" / "pictures" / "make"))

import determinism  # noqa: E402
import recorded  # noqa: E402
import runs  # noqa: E402
import style  # noqa: E402

SUITE = ROOT / "tests" / "hard-cases" / "suite.yaml"
PAGE = ROOT / "docs" / "hard-cases.md"
# What every run has to keep beside its own criterion, where it has such a result.
ALWAYS = {"drift_ratio": {"maximum": 0.01}}
# What tells where a stop is: a place, the parameter that is refused, or the component that refuses.
LOCATED = re.compile(r"at \(-?[\d.]+, -?[\d.]+, -?[\d.]+\) mm|: given |^element '\w+'")
# Units of axes, and what numbers in SI are multiplied by for them.
SHOWN = {"1": 1.0, "s": 1.0, "mm": 1e3, "N/mm": 1e-3}
# CPU seconds of all steps that rows stand on, by workflow, step and item: one is counted once, in however many rows it is.
COSTS: dict[tuple[str, str, str], float] = {}
DEEP = ("ply_depth_ratio", "overlap_ratio")


class Row:
    """A row of the table: a case in one element."""

    def __init__(self, case: dict, about: dict):
        self.case, self.step = case, about["step"]
        # Of a comparison: the model that the row is about (`global`, `other.NAME`), or `zones` with the global run around them.
        self.of: str | None = about.get("of")
        # In which way a step is repeated, see determinism.py; of which table of a record a row is, see recorded.py.
        self.by: str | None = about.get("by")
        self.table: str | None = about.get("table")
        self.element = about.get("element", "")
        self.right: dict = about.get("right", case.get("right", {}))
        self.stops: str | None = about.get("stops", case.get("stops"))
        self.tells: str | None = about.get("tells", case.get("tells"))
        # The row with the settings that put it right, where it is wrong.
        self.right_as: str | None = about.get("right_as")
        self.results: dict[str, float] = {}
        self.warnings: list[str] = []
        self.failure: str | None = None
        self.cost: float | None = None

    def name(self) -> str:
        if self.by is not None:
            return self.by if self.step == "all" else f"{self.by}_{self.step}"
        if self.of is None:
            return self.step
        scene = self.step.split("_")[0]
        return {"global": f"{scene}_{self.element}", "zones": f"{scene}_zones_{self.element}"}.get(self.of, self.of.removeprefix("other."))

    def faults(self) -> list[str]:
        """Why it is wrong; empty when it is not."""
        if self.stops:
            if self.failure is None:
                return [f"ended, and should have stopped ({self.stops})"]
            if not re.search(self.stops, self.failure):
                return [f"stopped otherwise: {self.failure}"]
            return [] if LOCATED.search(self.failure) else [f"stopped without saying where: {self.failure}"]
        if self.failure is not None:
            return [f"stopped: {self.failure.split('. ')[0]}"]
        odd = [f"{name} is {value}" for name, value in self.results.items() if not math.isfinite(value)]
        if self.tells and not any(re.search(self.tells, w) for w in self.warnings):
            odd.append(f"no warning says {self.tells}")
        # A run that says that it is none has nothing to keep beside that.
        always = {} if self.tells else {k: v for k, v in ALWAYS.items() if k in self.results}
        for name, bound in {**always, **self.right}.items():
            if name not in self.results:
                odd.append(f"there is no result {name}")
            elif not within(self.results[name], bound):
                odd.append(f"{name} is {number(self.results[name])}, {bound_text(bound)} wanted")
        return odd

    def verdict(self) -> str:
        if self.faults():
            return "**wrong**"
        return "stopped" if self.stops else "right"

    def got(self) -> str:
        if self.failure is not None:
            return self.failure.split(". ")[0]
        return ", ".join(f"{name} {number(self.results[name])}" for name in self.right if name in self.results)


def within(value: float, bound: dict) -> bool:
    if "value" in bound:
        return abs(value - bound["value"]) <= bound["tolerance"]
    return bound.get("minimum", -math.inf) <= value <= bound.get("maximum", math.inf)


def bound_text(bound: dict) -> str:
    if "value" in bound:
        return f"{bound['value']:g} ± {bound['tolerance']:g}"
    parts = [f"at least {bound['minimum']:g}"] if "minimum" in bound else []
    return " and ".join(parts + ([f"at most {bound['maximum']:g}"] if "maximum" in bound else []))


def number(value: float) -> str:
    return f"{value:.3g}"


def run(name: str, rows: list[Row]) -> tuple[str, ...]:
    """Runs the steps of the rows in one workflow and puts into them what came of it. What is in the store is not run again."""
    file, store = runs.STORE / "workflows" / f"{name}.yaml", runs.STORE / name
    steps = [word for step in dict.fromkeys(r.step for r in rows) for word in ("--until", step)]
    place = (str(file), "--store", str(store))
    command = [runs.PLYFLOW, "run", *place, *steps, "--no-report", "--keep-going", "--log-format", "json"]
    events = subprocess.run(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    failures = {}
    for line in events.stderr.splitlines():
        event = json.loads(line) if line.startswith("{") else {}
        if event.get("event") == "failed" and not event.get("again"):
            failures[event["step"]] = event["reason"]
    if events.returncode != 0 and not failures and "expect" not in events.stderr:
        raise SystemExit(f"hard-cases: {' '.join(command)} ended with code {events.returncode}:\n{events.stderr}")
    told = json.loads(runs.plyflow("results", *place, "--format", "json"))
    for step in told["steps"]:
        COSTS[name, step["step"], str(step.get("item"))] = step["cost"]["cpu_seconds"]
    steps = {s["step"]: s for s in told["steps"]}
    for row in rows:
        row.failure = failures.get(row.step)
        row.results = {r["result"]: r["value"] for r in told["results"] if r["step"] == row.step and not r["item"]}
        if row.step in steps:
            row.cost = steps[row.step]["cost"]["cpu_seconds"]
            row.warnings = steps[row.step]["warnings"]
        if row.of is not None:
            row.cost = row.results.get(f"cost.{'total' if row.of == 'zones' else row.of}.cpu_seconds")
            row.results = of_model(row.results, row.of)
        if "pair" in row.case and row.failure is None:
            row.results |= of_pair(runs.artifact(place, row.step).attributes["penetration"], row.case["pair"])
        if row.failure is None and not row.results:
            row.failure = "was not run, because a step that it needs failed"
    return place


def of_pair(penetration: dict, pair: str) -> dict[str, float]:
    """How deep a pair of bodies was in each other, and whether it ever touched."""
    about = penetration.get(pair)
    if about is None:
        return {"pair_touches": 0}
    return {"pair_touches": int(about["peak"]["max"] > 0.0), "pair_overlap": about["overlap"], "pair_overlap_peak": about["peak"]["overlap"]}


def of_model(results: dict[str, float], of: str) -> dict[str, float]:
    """Results of one model of a comparison, by their names without it."""
    if of == "zones":
        return {name: value for name, value in results.items() if "." not in name}
    return {name.removesuffix(f".{of}"): value for name, value in results.items() if name.endswith(f".{of}")}


def ladder(case: dict, rows: list[Row]) -> str:
    """Draws error over cost of every fidelity, a part beside the other; the file's name."""
    done = [r for r in rows if r.failure is None and r.cost and r.results.get("distance_error")]
    scenes = list(dict.fromkeys(r.name().split("_")[0] for r in done))
    figure, plots = style.plt.subplots(1, len(scenes), figsize=(7.2, 3.2), layout="constrained", sharey=True, squeeze=False)
    colours = {"drape": style.INK, "m4": style.ORANGE, "rf4": style.GREEN, "s4": style.PURPLE}
    for scene, axes in zip(scenes, plots[0]):
        for row in (r for r in done if r.name().startswith(f"{scene}_")):
            # Zones are hollow: most of their cost is that of the run around them.
            fill = "none" if row.of == "zones" else colours[row.element]
            label = row.name().removeprefix(f"{scene}_").replace("_", " ")
            marker = "D" if row.of == "zones" else "o"
            axes.loglog(row.cost, 1e3 * row.results["distance_error"], marker, color=colours[row.element], markerfacecolor=fill, label=label)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        axes.set_title(scene)
        axes.set_xlabel("CPU time (s)")
        axes.margins(0.25)
    plots[0][0].set_ylabel("distance error (mm)")
    return style.save_svg(figure, f"hard-{case['name']}").name


def picture(case: dict, rows: list[Row], places: dict[str, tuple[str, ...]]) -> str | None:
    """Draws the plot of the case's artifacts that its `picture` names, a line for each row (of `only`); the file's name."""
    wanted = case.get("picture")
    done = [r for r in rows if r.failure is None and r.step in case.get("only", [r.step])]
    if not wanted or not done:
        return None
    if wanted == "ladder":
        return ladder(case, done)
    figure, axes = style.plt.subplots(figsize=(4.6, 2.9), layout="constrained")
    colours = (style.BLUE, style.ORANGE, style.GREEN, style.RED, style.PURPLE, style.SKY)
    closed = False
    for i, row in enumerate(done):
        artifact = runs.artifact(places[row.step], row.step)
        plot = next(p for p in artifact.attributes["plots"] if p["name"] == wanted)
        scale = [SHOWN[plot[axis]["unit"]] for axis in "xy"]
        for series in plot["series"]:
            x, y = (artifact.array(series[axis].removeprefix("data/")) * s for axis, s in zip("xy", scale))
            if series is plot["series"][0]:
                axes.plot(x, y, color=colours[i % len(colours)], label=row.case.get("labels", {}).get(row.step, row.step), linewidth=1.2)
            elif not closed:
                axes.plot(x, y, color=style.INK, linestyle="--", linewidth=0.9, label=series["label"])
                closed = True
        axes.set_xlabel(axis_text(plot["x"]))
        axes.set_ylabel(axis_text(plot["y"]))
    axes.legend()
    return style.save_svg(figure, f"hard-{case['name']}").name


def axis_text(axis: dict) -> str:
    return axis["label"] if axis["unit"] in ("1", "") else f"{axis['label']} ({axis['unit']})"


def remedies(rows: list[Row]) -> dict[str, str]:
    """Of the wrong rows, those that are right in the row that they name: by names."""
    known = {row.name(): row for row in rows}
    unknown = [row.right_as for row in rows if row.right_as and row.right_as not in known]
    if unknown:
        raise SystemExit(f"hard-cases: there is no row {', '.join(unknown)} in {SUITE.name}")
    cured = [row for row in rows if row.right_as and row.faults() and not known[row.right_as].faults()]
    return {row.name(): row.right_as for row in cured}


def cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def write(cases: list[tuple[dict, list[Row], str | None]]) -> str:
    rows = [r for _, rows, _ in cases for r in rows]
    count = {v: sum(r.verdict() == v for r in rows) for v in ("right", "stopped", "**wrong**")}
    cured = remedies(rows)
    cpu = sum(COSTS.values())
    out = [
        "# Hard cases",
        "",
        "<!-- Written by scripts/hard-cases from tests/hard-cases/suite.yaml; not by hand. -->",
        "",
        "Each case is made to break an element, a law, a contact or a process. Its criterion was written before it was run. A row is",
        "*right* when the run ended and kept its criterion, *stopped* when the criterion asks for a stop and it came with a place and",
        "with what to change, and *wrong* otherwise. A wrong row names the one whose settings put it right, where there is one.",
        "",
        f"**{len(cases)} cases, {len(rows)} rows: {count['right']} right, {count['stopped']} stopped, {count['**wrong**']} wrong**,"
        f" of which {len(cured)} are right with the settings of another row.",
        "",
        f"CPU time of all runs: {cpu / 60:.0f} minutes.",
        "",
        "```sh",
        "make hard-cases",
        "```",
        "",
        "This runs what is not yet in its store, and writes this page again. Drift is the largest energy that is unaccounted for over the",
        "work done. Depth is how far sheets are in each other or in a tool at the end, over the thinner thickness.",
        "",
    ]
    for case, rows, image in cases:
        out += [f"## {case['title']}", "", case["what"].strip(), "", f"**Criterion.** {case['criterion'].strip()}", ""]
        if image:
            out += [f"![{case['title']}](pictures/{image})", f"*{case['caption'].strip()} Run: `workflows/{case['workflow']}`.*", ""]
        out += ["| row | element | drift | depth | CPU | got | verdict |", "|---|---|---|---|---|---|---|"]
        for row in rows:
            drift = f"{100 * row.results['drift_ratio']:.2g} %" if "drift_ratio" in row.results else ""
            depth = next((f"{100 * row.results[d]:.0f} %" for d in DEEP if d in row.results), "")
            cost = f"{row.cost:.1f} s" if row.cost is not None else ""
            got = "; ".join(row.faults()) or row.got()
            verdict = row.verdict() + (f"; right as `{cured[row.name()]}`" if row.name() in cured else "")
            out.append(f"| `{row.name()}` | {row.element} | {drift} | {depth} | {cost} | {cell(got)} | {verdict} |")
        out.append("")
        if "after" in case:
            out += [case["after"].strip(), ""]
    return "\n".join(out).rstrip() + "\n"


def main(names: list[str]) -> int:
    suite = yaml.safe_load(SUITE.read_text())
    known = [c["name"] for c in suite["cases"]]
    unknown = [n for n in names if n not in known]
    if unknown:
        print(f"hard-cases: there is no case {', '.join(unknown)}; there are {', '.join(known)}", file=sys.stderr)
        return 2
    runs.workflows()
    done, bad = [], 0
    for case in suite["cases"]:
        if names and case["name"] not in names:
            continue
        rows = [Row(case, about) for about in case["rows"]]
        if "record" in case:
            recorded.read(case["record"], rows)
            place = ()
        elif any(r.by for r in rows):
            determinism.measure(case["workflow"], rows, COSTS)
            place = ()
        else:
            place = run(case["workflow"], rows)
        places = {row.step: place for row in rows}
        for row in rows:
            print(f"{case['name']:<24} {row.name():<28} {row.verdict().strip('*')}", flush=True)
            for fault in row.faults():
                print(f"    {fault}", flush=True)
                bad += 1
        done.append((case, rows, picture(case, rows, places)))
    if names:
        print("hard-cases: the page is written when all cases are run", file=sys.stderr)
    else:
        PAGE.write_text(write(done))
        print(f"hard-cases: {PAGE.relative_to(ROOT)}")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
