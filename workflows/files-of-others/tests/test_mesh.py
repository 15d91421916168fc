"""Files that are written are read by other programs: meshio for each format, and VTK for its own."""

import meshio
import numpy as np
import pytest

from mesh_writing import FORMATS, ExportError, Mesh, file_name, left_out, write


def sheet():
    """Two quads that share a side, with values that tell each point and cell apart."""
    points = np.array([[0, 1e-17, 0], [0.1, -4e-13, 0], [0.1, 0.1, 0.01], [0, 0.1, 0], [0.2, 0, 0], [0.2, 0.1, 0.03]])
    cells = np.array([[0, 1, 2, 3], [1, 4, 5, 2]], dtype=np.uint32)
    return Mesh(points, cells, {"contact_pressure": np.arange(6) * 1e5}, {"shear_angle": np.array([0.25, -0.125]), "axis": np.array([[1.0, 0, 0], [0, 1.0, 0]])})


@pytest.mark.parametrize("form", FORMATS)
def test_another_program_reads_the_same_mesh(tmp_path, form):
    mesh = sheet()
    path = tmp_path / file_name("ply", form)
    path.write_bytes(write(mesh, form, 1e-3))
    back = meshio.read(path)
    assert back.points == pytest.approx(mesh.points * 1e3, abs=1e-7)
    (block,) = back.cells
    assert block.type == "quad" and (block.data == mesh.cells).all()
    if left_out(mesh, form):
        assert left_out(mesh, form) == ["axis", "contact_pressure", "shear_angle"] and not back.point_data
    else:
        assert (back.point_data["contact_pressure"] == mesh.on_points["contact_pressure"]).all()
        assert (back.cell_data["shear_angle"][0] == mesh.on_cells["shear_angle"]).all()
        assert (back.cell_data["axis"][0] == mesh.on_cells["axis"]).all()


def test_vtk_itself_reads_its_format(tmp_path):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    mesh = sheet()
    path = tmp_path / "ply.vtu"
    path.write_bytes(write(mesh, "vtu"))
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    assert (vtk_to_numpy(grid.GetPoints().GetData()) == mesh.points).all()
    assert (vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4) == mesh.cells).all()
    assert (vtk_to_numpy(grid.GetCellData().GetArray("shear_angle")) == mesh.on_cells["shear_angle"]).all()


@pytest.mark.parametrize("form", FORMATS)
def test_the_same_mesh_gives_the_same_bytes(form):
    assert write(sheet(), form) == write(sheet(), form)


def test_what_a_format_cannot_hold_is_refused():
    with pytest.raises(ExportError, match="there is no format 'step'; expected one of vtu"):
        write(sheet(), "step")
    flat = Mesh(sheet().points, np.zeros((2, 5), dtype=np.uint32))
    with pytest.raises(ExportError, match="expected"):
        write(flat, "vtu")
