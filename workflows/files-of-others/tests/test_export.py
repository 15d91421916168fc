"""What `plyflow export` writes, opened by programs that are not ours, and held field by field against the artifact."""

import csv
import shutil
from pathlib import Path

import ezdxf
import meshio
import numpy as np
import pytest
import pyvista
from conftest import HERE, artifact, call
from pyNastran.bdf.bdf import BDF
from vtkmodules.vtkCommonCore import vtkDataArray

import dxf_reading

STEPS = ("draped", "formed")
FORMATS = "vtu,csv,abaqus,calculix,nastran,dxf"
MM = 1e-3


@pytest.fixture(scope="module")
def exported(study, tmp_path_factory):
    """All formats of both steps, in mm."""
    folder = tmp_path_factory.mktemp("exported")
    said = {step: call(study, "export", "workflow.yaml", step, "--trust", "--format", FORMATS, "--unit", "mm", "--net", "15 mm", "--to", str(folder)) for step in STEPS}
    return folder, said


def table(path):
    """Columns of a CSV file by their heads; NaN where nothing stands."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    return {name: np.array([float(row[at]) if row[at] else np.nan for row in rows]) for at, name in enumerate(head)}


class Formed:
    """A ply of a step, with its fibres computed here: by the derivatives of a quadrilateral's shape functions at its middle."""

    def __init__(self, study, step):
        self.artifact = artifact(study, "workflow.yaml", step)
        ply = self.artifact["ply"]
        self.ply, self.cells = ply, np.asarray(ply.cells)
        self.points = np.asarray(ply.points_at(-1))
        flat, formed = np.asarray(ply.reference)[self.cells, :2], self.points[self.cells]
        derivatives = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]]) / 4
        big, small = np.einsum("dk,ckx->cxd", derivatives, flat), np.einsum("dk,ckx->cxd", derivatives, formed)
        gradient = small @ np.linalg.inv(big)
        self.shaped = np.ones(len(self.cells), dtype=bool)
        if "draped" in ply.fields:
            self.shaped = np.asarray(ply.field("draped", -1)) == 1
        # The fibres of the scene lie along x and y.
        fibres = gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
        self.fibres = [fibres[:, :, 0], fibres[:, :, 1]]
        self.area_ratio = np.linalg.norm(np.cross(gradient[:, :, 0], gradient[:, :, 1]), axis=1)


@pytest.fixture(scope="module", params=STEPS)
def step(request, study):
    return request.param, Formed(study, request.param)


def directions(columns, family):
    return np.stack([columns[f"fibre_direction_{family}_{axis}"] for axis in "xyz"], axis=1)


def test_tables_have_the_fields_of_the_artifact_and_what_follows_from_the_shape(step, exported):
    name, formed = step
    columns = table(exported[0] / f"{name}-ply-cells.csv")
    shaped = formed.shaped
    for family in (1, 2):
        assert np.abs(directions(columns, family) - formed.fibres[family - 1])[shaped].max() < 1e-12
    sheet = next(s for s in formed.artifact.attributes["sheets"] if s["name"] == "ply")
    assert columns["thickness (mm)"][shaped] * MM == pytest.approx(sheet["thickness"] / formed.area_ratio[shaped], rel=1e-12)
    assert columns["areal_mass (kg/m2)"][shaped] == pytest.approx(sheet["areal_mass"] / formed.area_ratio[shaped], rel=1e-12)
    assert np.isnan(columns["thickness (mm)"][~shaped]).all() and (columns["ply"] == 1).all()
    assert (columns["shear_angle (rad)"] == formed.ply.field("shear_angle", -1)).all()
    cosine = np.einsum("cx,cx->c", *formed.fibres)
    assert np.cos(columns["fibre_angle (rad)"][shaped]) == pytest.approx(cosine[shaped], abs=1e-12)
    points = table(exported[0] / f"{name}-ply-points.csv")
    assert np.stack([points[f"{axis} (mm)"] for axis in "xyz"], axis=1) * MM == pytest.approx(formed.points, abs=1e-12)


def test_the_angle_of_formed_fibres_is_what_the_elements_call_shear(study, exported):
    """The membrane tells its shear angle by other code: it is what the right angle has lost. Its fields are of the step in time before the points."""
    formed = Formed(study, "formed")
    columns = table(exported[0] / "formed-ply-cells.csv")
    shear = columns["shear_angle (rad)"]
    frames = range(len(formed.artifact.times))
    before = np.array([np.asarray(formed.ply.field("shear_angle", frame), dtype=float) for frame in frames])
    fastest = np.abs(np.diff(before, axis=0) / np.diff(formed.artifact.times)[:, None]).max()
    bound = 1e-6 + formed.artifact.attributes["time_step"] * fastest
    assert bound < 2e-4 < 0.1 < np.abs(shear).max()
    assert np.abs(np.pi / 2 - columns["fibre_angle (rad)"] - shear).max() < bound


def test_vtk_files_are_read_by_meshio_vtk_and_pyvista_with_their_units(step, exported):
    name, formed = step
    folder = exported[0]
    columns = table(folder / f"{name}-ply-cells.csv")
    mesh = meshio.read(folder / f"{name}-ply.vtu")
    assert mesh.points * MM == pytest.approx(formed.points, abs=1e-12)
    (cells,) = mesh.cells
    assert cells.type == "quad" and (cells.data == formed.cells).all()
    blocks = pyvista.read(folder / f"{name}.vtm")
    assert blocks.keys() == formed.artifact.bodies
    grid = blocks["ply"]
    for values in (mesh.cell_data["fibre_direction_2"][0], grid.cell_data["fibre_direction_2"]):
        assert np.array_equal(values, directions(columns, 2), equal_nan=True)
    for field, head in (("thickness", "thickness (mm)"), ("fibre_angle", "fibre_angle (rad)"), ("areal_mass", "areal_mass (kg/m2)"), ("ply", "ply")):
        for values in (mesh.cell_data[field][0], grid.cell_data[field]):
            assert np.array_equal(values, columns[head], equal_nan=True), field
        unit = grid.GetCellData().GetArray(field).GetInformation().Get(vtkDataArray.UNITS_LABEL())
        assert unit == {"thickness": "mm", "fibre_angle": "rad", "areal_mass": "kg/m2", "ply": "1"}[field]
    # Every field of the artifact, of every body.
    for body in formed.artifact:
        for field, info in body.fields.items():
            data = blocks[body.name].point_data if info.on == "points" else blocks[body.name].cell_data
            assert (np.asarray(data[field]) == body.field(field, -1)).all(), field


def test_the_artifact_itself_is_read_by_pyvista_without_renaming(step):
    """pyvista gives the first frame."""
    _, formed = step
    blocks = pyvista.read(formed.artifact.path)
    assert blocks.keys() == formed.artifact.bodies
    assert (blocks["ply"].points == formed.ply.points_at(0)).all()
    assert (blocks["ply"].cell_data["shear_angle"] == formed.ply.field("shear_angle", 0)).all()


def keywords(path):
    """The blocks of an Abaqus file: a keyword, its parameters, its lines of data."""
    blocks = []
    for line in path.read_text().splitlines():
        assert len(line) <= 256
        if line.startswith("**"):
            continue
        words = [w.strip() for w in line.split(",")]
        if line.startswith("*"):
            pairs = [w.partition("=") for w in words[1:]]
            blocks.append((words[0][1:].lower(), {k.strip().lower(): v.strip() for k, _, v in pairs}, []))
        else:
            assert all(len(w) <= 20 for w in words) or blocks[-1][0] == "shell section", line
            blocks[-1][2].append(words)
    return blocks


def numbers(lines):
    return np.array([[float(w) for w in line] for line in lines])


def right_handed(axes, fibres):
    """Whether the axes begin along the fibres, and are at right angles and of length 1."""
    first, second = axes[:, :3], axes[:, 3:]
    assert np.abs(first - fibres).max() < 1e-6
    assert np.abs(np.einsum("cx,cx->c", first, second)).max() < 1e-9
    assert np.abs(np.linalg.norm(second, axis=1) - 1).max() < 1e-9


def test_abaqus_has_two_layers_with_a_distribution_each(step, exported):
    name, formed = step
    path = exported[0] / f"{name}.inp"
    shaped = formed.shaped
    mesh = meshio.read(path)
    (cells,) = mesh.cells
    assert cells.type == "quad" and len(cells.data) == shaped.sum()
    assert mesh.points[cells.data] * MM == pytest.approx(formed.points[formed.cells[shaped]], abs=1e-11)
    blocks = keywords(path)
    named = {(word, p.get("name", p.get("elset"))): (p, lines) for word, p, lines in blocks}
    section, layers = named["shell section", "PLY"]
    assert "composite" in section and len(layers) == 2
    for family, layer in enumerate(layers):
        orientation, lines = named["orientation", layer[3]]
        assert orientation["system"] == "RECTANGULAR" and lines[1] == ["3", "0."]
        distribution, rows = named["distribution", lines[0][0]]
        assert distribution["location"] == "ELEMENT" and rows[0][0] == ""
        assert named["distribution table", distribution["table"]][1] == [["COORD3D", "COORD3D"]]
        rows = numbers(rows[1:])
        assert (rows[:, 0] == np.arange(1, shaped.sum() + 1)).all()
        right_handed(rows[:, 1:], formed.fibres[family][shaped])
    rows = numbers(named["distribution", section["shell thickness"]][1][1:])
    assert rows[:, 1] == pytest.approx(table(exported[0] / f"{name}-ply-cells.csv")["thickness (mm)"][shaped], rel=1e-9)
    assert float(layers[0][0]) == float(layers[1][0])
    # The normal of the shell, by which layers count, is that of the orientation.
    corners = mesh.points[cells.data]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    axes = numbers(named["distribution", "PLY_FIBRE_1_AXES"][1][1:])[:, 1:]
    assert (np.einsum("cx,cx->c", np.cross(axes[:, :3], axes[:, 3:]), normal) > 0).all()


def test_calculix_has_a_section_for_each_element(step, exported):
    name, formed = step
    path = exported[0] / f"{name}-calculix.inp"
    shaped = formed.shaped
    (cells,) = meshio.read(path).cells
    assert cells.type == "quad8" and len(cells.data) == shaped.sum()
    named = {(word, p.get("name", p.get("elset"))): lines for word, p, lines in keywords(path)}
    count = int(shaped.sum())
    thickness = table(exported[0] / f"{name}-ply-cells.csv")["thickness (mm)"][shaped]
    for family in (1, 2):
        axes = numbers([named["orientation", f"CELL_{k}_{family}"][0] for k in range(1, count + 1)])
        right_handed(axes, formed.fibres[family - 1][shaped])
        layers = [named["shell section", f"CELL_{k}"][family - 1] for k in range(1, count + 1)]
        assert [layer[3] for layer in layers] == [f"CELL_{k}_{family}" for k in range(1, count + 1)]
        assert np.array([float(layer[0]) for layer in layers]) == pytest.approx(thickness / 2, rel=1e-9)


def test_nastran_has_an_element_with_a_material_angle_for_each_family(step, exported, tmp_path):
    name, formed = step
    shaped = formed.shaped
    (tmp_path / "model.bdf").write_text(f"MAT8,1,140000.,9000.,.3,5000.\nINCLUDE '{exported[0] / f'{name}.bdf'}'\n")
    model = BDF(debug=False)
    model.read_bdf(str(tmp_path / "model.bdf"), punch=True)
    count = int(shaped.sum())
    assert len(model.elements) == 2 * count and sorted(model.properties) == [11, 12]
    thickness = table(exported[0] / f"{name}-ply-cells.csv")["thickness (mm)"][shaped]
    for family in (1, 2):
        elements = [model.elements[k + 1 + (family - 1) * count] for k in range(count)]
        assert {e.pid for e in elements} == {10 + family} and {e.type for e in elements} == {"CQUAD4"}
        corners = np.array([e.get_node_positions() for e in elements])
        normals = np.array([e.Normal() for e in elements])
        sides = corners[:, 1] - corners[:, 0]
        lifted = np.einsum("cx,cx->c", sides, normals)[:, None] * normals
        first = sides - lifted
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        angles = np.radians([e.theta_mcid for e in elements])[:, None]
        along = np.cos(angles) * first + np.sin(angles) * np.cross(normals, first)
        fibres = formed.fibres[family - 1][shaped]
        assert np.abs(along - fibres).max() < 1e-6
        # pyNastran itself turns the side by the angle. Where a cell is warped it does not project the side first, as Nastran does.
        flat = np.flatnonzero(np.linalg.norm(lifted, axis=1) < 1e-7 * np.linalg.norm(sides, axis=1))
        if name == "draped":
            assert len(flat) > 20
        for k in flat:
            assert np.abs(elements[k].material_coordinate_system()[2] - fibres[k]).max() < 1e-6
        for corner in ("T1", "T2", "T3", "T4"):
            assert np.array([getattr(e, corner) for e in elements]) == pytest.approx(thickness / 2, rel=1e-9)
        offsets = np.array([e.zoffset for e in elements])
        assert offsets == pytest.approx((-1) ** family * thickness / 4, rel=1e-9)
        assert corners * MM == pytest.approx(formed.points[formed.cells[shaped]], abs=1e-10)


def drawing(path):
    """A drawing that its reader has nothing to complain of, and its lines by layer."""
    document = ezdxf.readfile(path)
    audit = document.audit()
    assert not audit.errors and not audit.fixes, [e.message for e in audit.errors + audit.fixes]
    assert document.units == ezdxf.units.MM
    layers = {}
    for entity in document.modelspace():
        layers.setdefault(entity.dxf.layer, []).append(entity)
    return layers


def test_the_flat_pattern_is_the_outline_that_the_ply_was_cut_by(step, exported, study):
    name, formed = step
    path = exported[0] / f"{name}-flat.dxf"
    layers = drawing(path)
    assert set(layers) == {"ply", "ply-draped", "ply-fibres_1", "ply-fibres_2"}
    # Read by the step that reads the drawings of others: the outline is that of the scene again.
    outline = dxf_reading.read(path, {"blank": "ply"}).outlines["blank"]
    blank = artifact(study, "workflow.yaml", "blank")
    expected = np.asarray(blank.array("outlines/blank/outline"))
    assert np.asarray(outline.outline) == pytest.approx(expected, abs=1e-9) and len(outline.holes) == 1
    # Lines of fibres are 15 mm apart, straight, and along the fibres.
    for family, (along, across) in ((1, (0, 1)), (2, (1, 0))):
        for line in layers[f"ply-fibres_{family}"]:
            points = np.array([p[:2] for p in line.get_points()])
            assert len(points) == 2 and abs(points[1, across] - points[0, across]) < 1e-9 < points[1, along] - points[0, along]
            assert points[0, across] / 15 == pytest.approx(round(points[0, across] / 15), abs=1e-9)


def test_draped_lines_lie_on_the_formed_ply(step, exported):
    name, formed = step
    layers = drawing(exported[0] / f"{name}-draped.dxf")
    assert set(layers) == {"ply", "ply-fibres_1", "ply-fibres_2"}
    # The boundary goes through nodes of the mesh: all that sides have which one cell alone has.
    sides = np.sort(np.concatenate([formed.cells[formed.shaped][:, [k, (k + 1) % 4]] for k in range(4)]), axis=1)
    sides, counts = np.unique(sides, axis=0, return_counts=True)
    edge = {tuple(p) for p in np.round(formed.points[np.unique(sides[counts == 1])] / MM, 6) + 0.0}
    drawn = [np.array([tuple(v.dxf.location) for v in line.vertices]) for line in layers["ply"]]
    assert {tuple(p) for line in drawn for p in np.round(line, 6) + 0.0} == edge
    assert all(line.is_closed for line in layers["ply"])
    # Fibres keep their lengths: as long on the part as in the flat ply.
    flat = drawing(exported[0] / f"{name}-flat.dxf")
    for family in (1, 2):
        long = lambda points: np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        on_flat = sum(long(np.array([p[:2] for p in line.get_points()])) for line in flat[f"ply-fibres_{family}"])
        on_part = sum(long(np.array([tuple(v.dxf.location) for v in line.vertices])) for line in layers[f"ply-fibres_{family}"])
        assert on_part == pytest.approx(on_flat, rel=0.02)


def test_a_second_export_has_the_same_bytes_and_says_so(study, exported):
    folder, said = exported
    before = {p.name: p.read_bytes() for p in folder.iterdir()}
    again = call(study, "export", "workflow.yaml", "draped", "--trust", "--format", FORMATS, "--unit", "mm", "--net", "15 mm", "--to", str(folder))
    assert all(line.endswith(", as it was") for line in again.splitlines() if not line.startswith("note: "))
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before
    assert "give the material WOVEN_38616 (`Woven 38616`) in your model" in said["draped"]
    # Another unit is another content, and nothing is replaced unasked.
    refused = call(study, "export", "workflow.yaml", "draped", "--trust", "--format", "csv", "--to", str(folder), code=2)
    assert "in the way, with another content" in refused


def test_artifacts_of_other_kinds_and_series_in_time_are_written_for_vtk(study, tmp_path):
    path = artifact(study, "workflow.yaml", "formed").path
    call(study, "export", str(path), "--format", "vtu", "--frame", "all", "--body", "ply", "--to", str(tmp_path))
    series = pyvista.get_reader(str(tmp_path / "formed.pvd"))
    times = artifact(study, "workflow.yaml", "formed").times
    assert series.time_values == pytest.approx(list(times))
    series.set_active_time_value(series.time_values[3])
    grid = series.read()[0]
    assert (grid.points == artifact(study, "workflow.yaml", "formed")["ply"].points_at(3)).all()
    call(study, "export", "workflow.yaml", "tool", "--trust", "--format", "vtu", "--to", str(tmp_path))
    assert meshio.read(tmp_path / "tool-hat.vtu").cells[0].type == "triangle"
    for words, says in (
        (("workflow.yaml", "tool", "--trust", "--format", "abaqus"), "the artifact of kind 'geometry' tells of no ply"),
        (("workflow.yaml", "blank", "--trust", "--format", "vtu"), "has no bodies, so there is nothing to export"),
        (("workflow.yaml", "--format", "vtu"), "of a workflow, name the step too"),
        ((str(path), "formed", "--format", "vtu"), "is an artifact, and no step of a workflow; leave 'formed' out"),
        (("none.vtkhdf", "--format", "vtu"), "there is no file none.vtkhdf"),
        ((str(path), "--format", "csv", "--frame", "all"), "--frame all is for vtu; csv holds one frame"),
        ((str(path), "--format", "csv", "--frame", "-1x"), "expected a number from 0 on, or `all`"),
        ((str(path), "--format", "csv", "--frame", "99"), f"the artifact has {len(times)} frames, from 0 to {len(times) - 1}"),
        ((str(path), "--format", "dxf", "--net", "5"), "--net '5': `5` has no unit"),
    ):
        assert says in call(study, "export", *words, "--to", str(tmp_path / "none"), code=2), words
    assert not (tmp_path / "none").exists()


def test_a_hemisphere_is_sheared_as_the_closed_form_says(tmp_path):
    """The corners of a ply of 96 mm over a hemisphere: the net with great circles as generators (workflows/kinematic/workflow-angles.yaml)."""
    for folder in ("kinematic", "materials"):
        shutil.copytree(HERE.parent / folder, tmp_path / folder, ignore=shutil.ignore_patterns(".plyflow"))
    here: Path = tmp_path / "kinematic"
    call(here, "run", "--no-report", "--quiet", "--until", "draped", "workflow-angles.yaml")
    call(here, "export", "workflow-angles.yaml", "draped@angle=0deg,size=96mm", "--format", "csv", "--to", "out")
    (path,) = (here / "out").glob("*-cells.csv")
    angles = np.degrees(table(path)["fibre_angle (rad)"])
    assert 90 - np.nanmin(angles) == pytest.approx(48.135, abs=0.1)
    assert np.nanmax(angles) - 90 == pytest.approx(48.135, abs=0.1)
