"""The workflow of the example as a user runs it; the same part with an STL file and listed points; and its file, read by another program."""

import json

import h5py
import meshio
import numpy as np
import pytest
from conftest import artifact, call

FORMING = ("draped", "formed")


def test_a_second_run_has_nothing_to_do_and_a_changed_module_runs_its_step_alone(study):
    def state():
        told = json.loads(call(study, "plan", "--trust", "--format", "json", "workflow.yaml"))
        return {s["step"]: s["state"] for s in told}

    assert set(state().values()) == {"cached"}
    module = study / "mesh_writing.py"
    text = module.read_text()
    try:
        module.write_text(text + "\n# changed\n")
        changed = state()
    finally:
        module.write_text(text)
    assert changed.pop("exported") == "run" and set(changed.values()) == {"cached"}


def test_what_the_steps_tell_of_the_files_is_what_was_drawn(study):
    told = json.loads(call(study, "results", "--format", "json", "workflow.yaml"))["results"]
    results = {(r["step"], r["result"]): r["value"] for r in told}
    assert results["tool", "solids"] == 1 and results["tool", "unit"] == 1e-3
    assert 0 < results["tool", "chord_error"] < 3e-4
    # The polygon of the hole and of the round corners lies within 0.05 mm of what was drawn.
    area = (236 * 160 - 3 * (1 - np.pi / 4) * 20**2 - 0.5 * 30**2 - np.pi * 12**2) * 1e-6
    assert results["blank", "area.blank"] == pytest.approx(area, abs=5e-5 * 0.2)
    assert results["blank", "holes.blank"] == 1
    assert results["draped", "coverage"] > 0.9


def test_the_same_part_from_an_stl_file_and_listed_points_has_the_same_data(study):
    tool, blank = artifact(study, "workflow.yaml", "tool"), artifact(study, "workflow.yaml", "blank")
    with h5py.File(tool.path) as file:
        body = file["VTKHDF/hat"]
        points = body["Points"][:]
        triangles = body["Connectivity"][:].reshape(-1, 3)
    with h5py.File(blank.path) as file:
        outline, hole = (file[f"data/outlines/blank/{name}"][:] for name in ("outline", "hole_0"))
    # As text, which is read with all its digits.
    lines = ["solid hat"]
    for corners in points[triangles]:
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()), "endloop", "endfacet"]
    (study / "hat.stl").write_text("\n".join([*lines, "endsolid hat", ""]))
    listed = lambda contour: "[" + ", ".join(f"[{x!r} m, {y!r} m]" for x, y in contour.tolist()) + "]"
    scene = (study / "scene.yaml").read_text()
    for old, new in (
        ("input: {body: hat}", "stl: {file: hat.stl, unit: 1 m}"),
        ("outline: {input: blank}", f"outline: {listed(outline)}\n    holes: [{listed(hole)}]"),
    ):
        assert old in scene
        scene = scene.replace(old, new)
    (study / "scene-listed.yaml").write_text(scene)
    workflow = (study / "workflow.yaml").read_text()
    begin = workflow.index("  tool:")
    steps = workflow[workflow.index("  draped:") : workflow.index("  exported:")]
    steps = steps.replace("    from: {geometry: [tool, blank]}\n", "").replace("scene.yaml", "scene-listed.yaml")
    # Under a name of its own: runs of one name in one store are one run.
    head = workflow[:begin].replace("name: files-of-others", "name: listed")
    (study / "workflow-listed.yaml").write_text(head + steps)
    call(study, "run", "--no-report", "workflow-listed.yaml")
    for step in FORMING:
        told = json.loads(call(study, "diff", "workflow.yaml", "workflow-listed.yaml", "--step", step, "--format", "json"))
        assert [one["status"] for one in told["compared"]] == ["same"], told


def test_the_exported_file_is_read_by_meshio_and_by_vtk_with_the_numbers_of_the_run(study, tmp_path):
    call(study, "extract", "workflow.yaml", "exported", "--to", str(tmp_path))
    assert [p.name for p in tmp_path.iterdir()] == ["ply.vtu"]
    formed = artifact(study, "workflow.yaml", "formed")["ply"]
    assert (tmp_path / "ply.vtu").read_bytes() == artifact(study, "workflow.yaml", "exported").files["ply.vtu"]
    mesh = meshio.read(tmp_path / "ply.vtu")
    assert (mesh.points == formed.points_at(-1)).all()
    (cells,) = mesh.cells
    assert cells.type == "quad" and (cells.data == formed.cells).all()
    fields = {**mesh.point_data, **{name: values[0] for name, values in mesh.cell_data.items()}}
    assert "shear_angle" in fields and "contact_pressure" in fields
    for name, values in fields.items():
        assert (values == formed.field(name, -1)).all(), name
    assert np.abs(fields["shear_angle"]).max() > 0.1

    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "ply.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfCells() == len(formed.cells)
    assert (vtk_to_numpy(grid.GetCellData().GetArray("shear_angle")) == fields["shear_angle"]).all()


def test_all_bodies_of_a_run_and_a_tool_without_frames_are_exported_in_the_other_formats(study, tmp_path):
    text = (study / "workflow.yaml").read_text().replace("name: files-of-others", "name: more")
    more = """  all:
    plugin: ./mesh_export.py
    from: {formed: formed}
    with: {format: abaqus, unit: 1 mm, frame: 0}
  skin:
    plugin: ./mesh_export.py
    from: {formed: tool}
    with: {format: abaqus, unit: 1 mm}
"""
    (study / "workflow-more.yaml").write_text(text + more)
    call(study, "run", "--no-report", "workflow-more.yaml")
    for step in ("all", "skin"):
        call(study, "extract", "workflow-more.yaml", step, "--to", str(tmp_path))
    formed, tool = (artifact(study, "workflow-more.yaml", step) for step in ("formed", "tool"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["hat.inp", "lower_film.inp", "ply.inp", "tool.inp", "upper_film.inp"]
    for name, body, of, unit in (("ply.inp", formed["ply"], "quad", 1e-3), ("tool.inp", formed["tool"], "triangle", 1e-3), ("hat.inp", tool["hat"], "triangle", 1e-3)):
        mesh = meshio.read(tmp_path / name)
        points = body.points_at(0) if body.is_moving else body.reference
        assert mesh.points * unit == pytest.approx(np.asarray(points), abs=1e-9), name
        (cells,) = mesh.cells
        assert cells.type == of and (cells.data == body.cells).all(), name


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("with: {file: hat.step,", "with: {file: blank.dxf,"), "this is no STEP file, which begins with ISO-10303-21"),
        (("{blank: PLY}", "{blank: PLIES}"), "no curve on a layer 'PLIES', which `layers.blank` names; curves lie on 'PLY'"),
        (("body: hat}", "body: tool}"), "no step that is wired to `geometry` has the body `hat`; expected a name of one of them: `tool` has tool; `blank` has no body"),
    ],
)
def test_what_is_wrong_with_a_file_or_a_name_is_told_by_the_step(study, change, says):
    text = (study / "workflow.yaml").read_text()
    assert change[0] in text
    (study / "workflow-wrong.yaml").write_text(text.replace(*change))
    assert says in call(study, "run", "--no-report", "--until", "draped", "workflow-wrong.yaml", code=4)
