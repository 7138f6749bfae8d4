"""IFC as a mesh: unit, placement, names of elements, georeference; and what is said where ifcopenshell is not installed."""


import numpy as np
import pytest
from command_line import run_here

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.readers.meshes import ifc_file
from pointglass.viewer.readers.meshes.mesh_file import read_mesh
from pointglass.viewer.work.meshes.laid_meshes import new_layer
from pointglass.viewer.work.meshes.pick_mesh import pick_mesh

PLACE = np.array([1.0, 2.0, 0.5])


def write_ifc(path, *, milli=True, conversion=None):
    """A wall of 4 x 0.3 x 2.5 m whose corner is at PLACE, in millimetres or metres."""
    api = pytest.importorskip("ifcopenshell.api")
    run = api.run
    file = run("project.create_file")
    run("root.create_entity", file, ifc_class="IfcProject", name="house")
    length = run("unit.add_si_unit", file, unit_type="LENGTHUNIT", prefix="MILLI" if milli else None)
    run("unit.assign_unit", file, units=[length])
    model = run("context.add_context", file, context_type="Model")
    body = run("context.add_context", file, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW",
               parent=model)
    if conversion is not None:
        run("georeference.add_georeferencing", file)
        metre = run("unit.add_si_unit", file, unit_type="LENGTHUNIT")
        run("georeference.edit_georeferencing", file, projected_crs={"Name": "EPSG:25832", "MapUnit": metre},
            coordinate_operation=conversion)
    wall = run("root.create_entity", file, ifc_class="IfcWall", name="North wall")
    matrix = np.eye(4)
    matrix[:3, 3] = PLACE
    run("geometry.edit_object_placement", file, product=wall, matrix=matrix, is_si=True)
    shape = run("geometry.add_wall_representation", file, context=body, length=4.0, height=2.5, thickness=0.3)
    run("geometry.assign_representation", file, product=wall, representation=shape)
    file.write(str(path))
    return path


@pytest.mark.parametrize("milli", [True, False])
def test_a_wall_is_read_at_its_place_in_metres_and_a_pick_says_its_name(tmp_path, milli):
    path = write_ifc(tmp_path / "house.ifc", milli=milli)
    mesh = read_mesh(path)
    assert np.abs(mesh.bounds - [PLACE, PLACE + (4.0, 0.3, 2.5)]).max() < 1e-9
    assert mesh.elements == ("IfcWall North wall",) and any("no georeference" in note for note in mesh.notes)
    layer = new_layer(path, 0.3048)  # a scan in feet
    assert layer.up == "z" and layer.scale == pytest.approx(1 / 0.3048)
    camera = from_fov(200, 100, 60, look_at(np.array((3.0, -5.0, 1.5)), np.array((3.0, 2.0, 1.5))))
    found = pick_mesh([MeshLayer(str(path))], (), camera, (100.0, 50.0), lambda path: mesh)
    assert found is not None and found[0].station == "model house.ifc · IfcWall North wall"
    assert np.abs(np.array(found[0].position) - (3.0, 2.0, 1.5)).max() < 1e-6


def test_a_plan_of_a_scan_and_an_ifc_file_has_the_wall_in_the_scans_unit(tmp_path, seed):
    write_ifc(tmp_path / "house.ifc")
    np.savetxt(tmp_path / "scan.xyz", np.random.default_rng(seed).uniform(0, 6, (4000, 3)), "%.4f")
    done = run_here("section", tmp_path / "scan.xyz", tmp_path / "house.ifc", "--plan", "1.5", "--out", tmp_path / "plan.dxf")
    assert done.returncode == 0, done.stderr
    assert "1 line of model house.ifc, 8.6 units in all" in done.stdout and "IFC: z is up, metres" in done.stderr


def test_a_georeference_brings_it_onto_the_map(tmp_path):
    turn = np.radians(30.0)
    conversion = {"Eastings": 500_000.0, "Northings": 5_400_000.0, "OrthogonalHeight": 300.0, "XAxisAbscissa": np.cos(turn),
                  "XAxisOrdinate": np.sin(turn)}
    for scale in ({"Scale": 0.001}, {}):  # of millimetres; and left out, as many programs do
        mesh = read_mesh(write_ifc(tmp_path / "house.ifc", conversion=conversion | scale))
        x, y = 5.0, 2.0  # the lower corner along the wall
        wanted = (500_000 + x * np.cos(turn) - y * np.sin(turn), 5_400_000 + x * np.sin(turn) + y * np.cos(turn), 300.5)
        assert np.abs(mesh.vertices - wanted).max(axis=1).min() < 1e-6
        assert any("EPSG:25832" in note for note in mesh.notes)


def test_damaged_files_and_a_missing_extra_are_said_in_a_line(tmp_path, monkeypatch):
    path = tmp_path / "x.ifc"
    path.write_text("ISO-10303-21;\nHEADER;\nnothing\n")
    monkeypatch.setattr(ifc_file.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"x\.ifc: IFC is read by ifcopenshell.*pointglass\[ifc\]") as refused:
        read_mesh(path)
    assert len(str(refused.value).splitlines()) == 1
    monkeypatch.undo()
    pytest.importorskip("ifcopenshell")
    with pytest.raises(InputError, match="cannot be read as IFC") as refused:
        read_mesh(path)
    assert len(str(refused.value).splitlines()) == 1
