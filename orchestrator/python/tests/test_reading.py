"""What is read from artifacts is what the program and other readers find there."""

from __future__ import annotations

import csv
import io
import pickle
import re
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import plyflow


def test_fields_of_the_last_frame_have_the_extremes_that_the_solver_reported(run: plyflow.Run) -> None:
    step = run["coarse"]
    shear = [step[ply].field("shear_angle") for ply in ("ply_1", "ply_2")]
    assert all(s.unit == "rad" and s.dtype == np.float32 for s in shear)
    # The solver reports in double precision what the file has in single.
    assert max(float(s.max()) for s in shear) == pytest.approx(step.results["shear_max"], rel=1e-6)
    assert min(float(s.min()) for s in shear) == pytest.approx(step.results["shear_min"], rel=1e-6)


def test_frames_are_those_that_vtkhdf_lists(run: plyflow.Run) -> None:
    step = run["coarse"]
    body, frames = step["ply_2"], step.artifact.frames
    assert frames > 2 and len(step.artifact.times) == frames
    with h5py.File(step.path) as file:
        block = file["VTKHDF/ply_2"]
        offsets = block["Steps/PointOffsets"][()]
        field = block["Steps/CellDataOffsets/shear_angle"][()]
        for frame in (0, frames // 2, -1):
            at = int(offsets[frame].ravel()[0])
            assert np.array_equal(body.points_at(frame), block["Points"][at : at + len(body.reference)])
            at = int(field[frame])
            assert np.array_equal(body.field("shear_angle", frame), block["CellData/shear_angle"][at : at + len(body.cells)])
    assert np.array_equal(body.points_at(np.int64(0)), body.points_at(0))
    with pytest.raises(TypeError, match="a frame is a whole number, 0 to .*; given 1.5"):
        body.field("shear_angle", frame=1.5)  # type: ignore[arg-type]
    assert not np.array_equal(body.points_at(0), body.points_at(-1)), "it has moved"
    assert np.ptp(body.reference[:, 2]) < 1e-12, "the reference is flat"


def test_a_body_that_does_not_move_is_the_same_in_all_frames(run: plyflow.Run) -> None:
    tool = run["coarse"]["tool"]
    assert not tool.is_moving and tool.cells.shape[1] == 3
    assert np.array_equal(tool.points_at(0), tool.points) and np.array_equal(tool.reference, tool.points)


def test_cells_turn_counter_clockwise_and_have_the_area_of_the_ply(run: plyflow.Run) -> None:
    body = run["coarse"]["ply_1"]
    corners = np.asarray(body.reference)[body.triangles()]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (cross[:, 2] > 0).all()
    assert 0.5 * cross[:, 2].sum() == pytest.approx(0.48 * 0.3, rel=1e-9), "480 by 300 mm"


def test_pyvista_has_the_same_mesh_and_fields(run: plyflow.Run) -> None:
    pytest.importorskip("pyvista", reason="pyvista is not in this environment")
    body = run["coarse"]["ply_1"]
    grid = body.to_pyvista()
    assert np.array_equal(grid.points, body.points)
    assert np.array_equal(grid.cell_data["shear_angle"], body.field("shear_angle"))
    assert "shear_angle=rad" in list(grid.field_data["units"])
    corners = np.asarray(body.points)[body.triangles()]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert grid.triangulate().area == pytest.approx(area, rel=1e-6)


def test_results_as_a_frame_are_those_that_the_program_writes_as_csv(run: plyflow.Run, demo: Path) -> None:
    frame = run.results()
    text = subprocess.run([plyflow.program(), "results", "--format", "csv", demo], capture_output=True, text=True, check=True).stdout
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(frame) == len(rows) > 100
    assert list(frame["result"]) == [r["result"] for r in rows]
    assert [float(r["value"]) for r in rows] == list(frame["value"])
    assert frame.attrs["units"]["flagged_area"] == "m2"
    assert set(run.results("defects")["step"]) == {"defects"}
    with pytest.raises(plyflow.NotFound, match="coarse"):
        run.results("corase")


def test_defects_are_counted_as_the_step_counted_them(run: plyflow.Run) -> None:
    frame = run.defects()
    local = frame[frame["model"].str.startswith("local")]
    for kind, result in (("wrinkle", "wrinkle_count"), ("bridging", "bridging_count")):
        assert (local["type"] == kind).sum() == run.result(result, "comparison")
    longest = local[local["type"] == "wrinkle"]["length"].max()
    assert longest > 0.001 and frame.attrs["units"]["length"] == "m"


def test_units_of_defects_are_those_of_the_schema() -> None:
    from plyflow.runs import _DEFECTS

    told = plyflow.schema("artifacts")["$defs"]
    properties = {**told["MeasuredDefect"]["properties"], **told["ComparedDefect"]["properties"]}
    for name, unit in _DEFECTS.items():
        found = re.search(r"\((1/m|m2|m|rad)[)/]", properties[name]["description"])
        assert (found[1] if found else "") == unit, name


def test_what_is_cut_out_keeps_its_unit_and_what_is_computed_has_none() -> None:
    values = plyflow.Values.of(np.arange(4.0), "m")
    assert values[1:3].unit == values.reshape(2, 2).unit == values.copy().unit == "m"
    assert pickle.loads(pickle.dumps(values)).unit == "m"
    for computed in (values * values, np.sqrt(values), values.sum(axis=0), values > 1, np.degrees(values)):
        assert not isinstance(computed, plyflow.Values)
    assert pickle.loads(pickle.dumps(plyflow.Number(2.0, "m"))).unit == "m"


def test_what_is_missing_is_told_with_what_there_is(run: plyflow.Run) -> None:
    step = run["coarse"]
    for wrong, there in (
        (lambda: run["corase"], "coarse"),
        (lambda: run["local"], r"local\[A\]"),
        (lambda: step["ply_3"], "ply_2"),
        (lambda: step["ply_1"].field("shear"), "shear_angle"),
        (lambda: step["ply_1"].points_at(10**6), "-1 for the last"),
        (lambda: step.array("history"), "history/kinetic"),
        (lambda: run.study(), "no study"),
        (lambda: plyflow.open("nowhere"), "nowhere"),
        (lambda: plyflow.material("silk"), "ncf-fcim359"),
    ):
        with pytest.raises(plyflow.NotFound, match=there):
            wrong()


def copy_of(step: plyflow.Step, folder: Path) -> Path:
    """An artifact and its record in another folder."""
    assert step.path is not None
    record = step.path.with_suffix(".record.json")
    shutil.copy(record, folder)
    return Path(shutil.copy(step.path, folder))


def test_an_artifact_is_read_only_if_it_is_as_it_was_written(run: plyflow.Run, tmp_path: Path) -> None:
    path = copy_of(run["defects"], tmp_path)
    with plyflow.open(path) as artifact:
        assert artifact.verified and artifact.kind == "defects"
    damaged = bytearray(path.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(plyflow.Damaged, match=path.name) as caught:
        plyflow.open(path)
    assert caught.value.code == 8
    path.with_suffix(".record.json").unlink()
    with plyflow.open(path) as artifact:
        assert not artifact.verified, "nothing lies beside it that could tell"


def test_a_closed_artifact_says_so(run: plyflow.Run, tmp_path: Path) -> None:
    with plyflow.open(copy_of(run["defects"], tmp_path)) as artifact:
        body = artifact["ply_1"]
    with pytest.raises(plyflow.PlyflowError, match="closed"):
        body.points  # noqa: B018


def test_what_is_no_artifact_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = [1.0]
    with pytest.raises(plyflow.PlyflowError, match="other.h5"):
        plyflow.open(tmp_path / "other.h5", verify=False)


def test_a_store_lists_what_all_steps_have_made(run: plyflow.Run, demo: Path) -> None:
    store = plyflow.open(demo.parent)
    assert isinstance(store, plyflow.Store)
    done = [s for s in run if s.state == "done"]
    assert {s.key for s in done} <= {s.key for s in store}
    assert store.verify() == [] and run.verify() == []
    assert {s.label for s in done} >= {"coarse", "local[A]", "comparison"}


def test_costs_are_of_all_steps(run: plyflow.Run) -> None:
    costs = run.costs()
    assert list(costs.index) == [s.label for s in run if s.state == "done"]
    assert (costs["cpu_seconds"] > 0).all() and costs.attrs["units"]["peak_memory"] == "B"


def test_provenance_names_plugin_and_parameters_in_si(run: plyflow.Run) -> None:
    made = run["coarse"].provenance
    assert made["plugin"]["name"] == "forming-explicit" and made["parameters"]["element_size"] == 0.016
    assert made["key"] == run["coarse"].key and len(made["plugin"]["hash"]) == 64


def test_a_package_that_is_missing_is_named_with_how_to_install_it(demo: Path) -> None:
    code = "import sys; sys.modules.update(pandas=None, pyvista=None, xarray=None)\nimport plyflow\n"
    code += f"run = plyflow.open({str(demo)!r})\n"
    for call, package in (("run.results()", "pandas"), ("run.defects()", "pandas"), ("run['coarse']['ply_1'].to_pyvista()", "pyvista")):
        done = subprocess.run([sys.executable, "-c", code + call], capture_output=True, text=True, check=False)
        assert f"pip install {package}" in done.stderr and "MissingPackage" in done.stderr, done.stderr


def test_an_export_writes_what_the_command_does_and_tells_of_it(run: plyflow.Run, demo: Path, tmp_path: Path) -> None:
    made = plyflow.export(demo, ["csv", "dxf"], step="coarse", to=tmp_path / "a", bodies=["ply_1"], unit="mm")
    assert isinstance(made, plyflow.Exported)
    assert [f.name for f in made.files] == ["coarse-ply_1-points.csv", "coarse-ply_1-cells.csv", "coarse-flat.dxf", "coarse-draped.dxf"]
    words = ["export", demo, "coarse", "--format", "csv,dxf", "--body", "ply_1", "--unit", "mm", "--to", tmp_path / "b"]
    subprocess.run([plyflow.program(), *words], check=True, capture_output=True)
    for file in made.files:
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes(), file.name
    with made.files[0].open(newline="") as table:
        rows = list(csv.DictReader(table))
    points = np.array([[float(row[f"{axis} (mm)"]) for axis in "xyz"] for row in rows])
    assert points == pytest.approx(1e3 * np.asarray(run["coarse"]["ply_1"].points), rel=1e-6, abs=1e-6)

    # A step of a run knows its artifact; what is there already with the same content is told as well.
    step = plyflow.export(run["coarse"], "csv", to=tmp_path / "a", bodies="ply_1", unit="mm")
    assert [f.name for f in step.files] == [f.name for f in made.files[:2]]
    made.files[0].write_text("mine", encoding="utf-8")
    with pytest.raises(plyflow.NotFound, match="in the way"):
        plyflow.export(run["coarse"], "csv", to=tmp_path / "a", bodies=["ply_1"], unit="mm")
    assert made.files[0].read_text(encoding="utf-8") == "mine"
    plyflow.export(run["coarse"], "csv", to=tmp_path / "a", bodies=["ply_1"], unit="mm", force=True)
    assert made.files[0].read_bytes() == (tmp_path / "b" / made.files[0].name).read_bytes()


def test_what_cannot_be_exported_is_told(run: plyflow.Run, demo: Path, tmp_path: Path) -> None:
    with pytest.raises(plyflow.NotFound, match="ply_9"):
        plyflow.export(demo, "csv", step="coarse", to=tmp_path, bodies=["ply_9"])
    with pytest.raises(plyflow.NotFound, match="there is no file"):
        plyflow.export(tmp_path / "none.yaml", "csv", step="coarse")
    with pytest.raises(plyflow.PlyflowError, match="for a workflow file"):
        plyflow.export(run["coarse"], "csv", step="coarse")
    with pytest.raises(plyflow.PlyflowError, match="is empty"):
        plyflow.export(run["coarse"], [])
    with pytest.raises(plyflow.PlyflowError, match="stl"):
        plyflow.export(run["coarse"], "stl", to=tmp_path)
    with pytest.raises(plyflow.PlyflowError, match="--net"):
        plyflow.export(run["coarse"], "dxf", net="20", to=tmp_path)
    assert not any(tmp_path.iterdir())
