"""Runs, their events and their errors."""

from __future__ import annotations

import csv
import io
import subprocess
from pathlib import Path

import numpy as np
import pytest

import plyflow


def test_a_study_is_run_followed_and_read(dome: Path, tmp_path: Path) -> None:
    events: list[plyflow.Event] = []
    run = plyflow.run(dome, on_event=events.append, jobs=2)
    kinds = [e.kind for e in events]
    assert kinds.count("started") == kinds.count("finished") == 4
    assert events[-1].kind == "end" and events[-1].data["executed"] == 4
    assert all(0 <= e.data["fraction"] <= 1 for e in events if e.kind == "progress")

    study = run.study()
    frame = study.to_frame()
    assert list(frame.columns[:3]) == ["angle", "size", "shear"] and frame.attrs["units"] == {"angle": "deg", "size": "mm", "shear": "rad"}
    text = subprocess.run([plyflow.program(), "results", "--study", "--format", "csv", dome], capture_output=True, text=True, check=True).stdout
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [float(r["shear [rad]"]) for r in rows] == list(frame["shear"])
    pytest.importorskip("xarray", reason="xarray is not in this environment")
    data = study.to_xarray()
    assert dict(data.sizes) == {"angle": 2, "size": 2} and data["shear"].attrs["units"] == "rad"
    for _, row in frame.iterrows():
        assert float(data["shear"].sel(angle=row["angle"], size=row["size"])) == row["shear"]
    # Turned by 45 deg the corners of a square lie where a sphere shears least.
    assert (data["shear"].sel(angle=45) < data["shear"].sel(angle=0)).all()

    page = run.report(tmp_path / "page.html")
    assert "dome" in page.read_text(encoding="utf-8")
    again: list[plyflow.Event] = []
    plyflow.run(dome, on_event=again.append)
    assert {e.kind for e in again} == {"cached", "end"}, "what is in the store does not run again"


def test_points_that_are_no_grid_lie_along_one_dimension(tmp_path: Path) -> None:
    pytest.importorskip("xarray", reason="xarray is not in this environment")
    point = {"values": {"a": 1.0, "b": 2.0}, "responses": {"r": 3.0}, "status": "done", "failure": None}
    other = {"values": {"a": 2.0, "b": 1.0}, "responses": {"r": None}, "status": "failed"}
    other["failure"] = {"step": "s", "class": "plugin", "cause": "why"}
    variables = [{"name": n, "unit": "1 mm", "si_unit": "m"} for n in "ab"]
    told = {"workflow": "w", "variables": variables, "responses": [{"name": "r", "unit": "N"}], "optimisation": None}
    study = plyflow.Study({**told, "points": [{**point, "point": "p1"}, {**other, "point": "p2"}]})
    data = study.to_xarray()
    assert dict(data.sizes) == {"point": 2} and set(data.coords) == {"point", "a", "b"}
    frame = study.to_frame()
    assert np.isnan(frame.loc["p2", "r"]) and frame.loc["p2", "failed_step"] == "s"


def test_other_values_are_other_runs(dome: Path) -> None:
    run = plyflow.Run(dome, set={"drape.element_size": "12 mm"})
    assert {s.state for s in run} == {"to run"}
    assert all("element_size" in s.reason for s in run)


def test_errors_carry_file_line_column_and_hint(tmp_path: Path) -> None:
    file = tmp_path / "workflow.yaml"
    file.write_text("plyflow: 1\nname: w\nsteps:\n  a:\n    plugin: forming-kinematik\n  b:\n    plugn: x\n")
    with pytest.raises(plyflow.InvalidInput) as caught:
        plyflow.run(file)
    assert caught.value.code == 3
    found = {(f.line, f.column): f for f in caught.value.findings}
    assert "forming-kinematic" in str(found[5, 13]), "the nearest name is told"
    assert any(f.line == 7 and "plugn" in f.message + str(f.given) for f in found.values())
    assert all(Path(f.file).name == "workflow.yaml" for f in found.values())
    with pytest.raises(plyflow.InvalidInput):
        plyflow.open(file)
    with pytest.raises(plyflow.NotFound, match="nowhere.yaml"):
        plyflow.run(tmp_path / "nowhere.yaml")


def test_a_step_that_fails_is_told_with_its_reason(dome: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.stl").write_text("solid nothing\nendsolid nothing\n")
    scene = dome.with_name("scene.yaml").read_text()
    assert "hemisphere:" in scene
    workflow = plyflow.Workflow("broken")
    changed = {"file": str(dome.with_name("scene.yaml")), "set": {"tool": {"stl": {"file": str(tmp_path / "broken.stl"), "unit": "1 mm"}}}}
    workflow.step("drape", "forming-kinematic", scene=changed, element_size="8 mm")
    with pytest.raises(plyflow.RunFailed) as caught:
        plyflow.run(workflow, path=tmp_path / "workflow.yaml", report=False)
    assert caught.value.code == 4
    assert [f["step"] for f in caught.value.failures] == ["drape"] and "broken.stl" in str(caught.value)
    run = plyflow.open(tmp_path / "workflow.yaml")
    assert isinstance(run, plyflow.Run) and run["drape"].state == "failed"
    with pytest.raises(plyflow.NotFound, match="no artifact yet"):
        run["drape"].artifact  # noqa: B018


def test_an_error_of_the_one_who_listens_stops_the_run(dome: Path, tmp_path: Path) -> None:
    class Enough(Exception):
        pass

    def listen(event: plyflow.Event) -> None:
        if event.kind == "started":
            raise Enough

    with pytest.raises(Enough):
        plyflow.run(dome, on_event=listen, store=tmp_path, jobs=1, set={"drape.net_spacing": "0.5 mm"})
    # Nobody holds the lock any more: the run has ended, and can go on at once.
    run = plyflow.run(dome, store=tmp_path, jobs=2)
    assert all(s.state == "done" for s in run)


def test_a_missed_expectation_is_an_error_when_asked(dome: Path) -> None:
    text = dome.read_text() + "expect:\n  - {response: shear, maximum: 0.001 rad}\n"
    file = dome.with_name("strict.yaml")
    file.write_text(text)
    plyflow.run(file)
    with pytest.raises(plyflow.RunFailed) as caught:
        plyflow.run(file, check=True)
    assert caught.value.code == 5 and "shear" in str(caught.value)
