"""Exports read back: meshes with their fields against closed forms of a sphere, series, tables and NetCDF against the dataset."""

import struct
import zlib
from base64 import b64decode
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
import pyvista
import xarray as xr
from tests.app.stores import make_map
from tests.shell import Shell, one_complaint

import shapespace as ss
from shapespace.study.tables import branch_dataset
from shapespace.view import style
from shapespace.view.mesh import AROUND, Mesh, ply_bytes, revolved, vtk_bytes

RADIUS = 1.3


def sphere(is_closed: bool = True) -> Mesh:
    """A sphere of radius 1.3, or its upper half, that swims upwards without changing its shape, with c = z."""
    u = np.linspace(0.0, 1.0 if is_closed else 0.5, 201)
    sin, cos = np.sin(np.pi * u), np.cos(np.pi * u)
    radius = RADIUS * sin
    radius[[0, -1] if is_closed else [0]] = 0.0
    fields = {
        "mesh_coordinate": u,
        "radius": radius,
        "axial_position": RADIUS * cos,
        "tangent_angle": np.pi * u,
        "tangential_velocity": -sin,
        "normal_velocity": cos,
        "concentration": RADIUS * cos,
    }
    return revolved(fields, is_closed)


def area_and_volume(mesh: Mesh) -> tuple[float, float]:
    """Of the triangles; the volume is that between them and the origin, positive where they are seen from outside."""
    a, b, c = (mesh.points[mesh.triangles[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    return float(0.5 * np.linalg.norm(across, axis=1).sum()), float(np.sum(a * across) / 6.0)


def test_a_sphere_is_a_closed_mesh():
    """Area, volume, outward orientation, Euler's number 2, the normal, and uniform velocity along the axis."""
    mesh = sphere()
    area, volume = area_and_volume(mesh)
    assert area == pytest.approx(4.0 * np.pi * RADIUS**2, rel=2e-3)
    assert volume == pytest.approx(4.0 / 3.0 * np.pi * RADIUS**3, rel=4e-3)
    edges = {
        tuple(sorted(pair)) for t in mesh.triangles.tolist() for pair in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0]))
    }
    assert len(mesh.points) - len(edges) + len(mesh.triangles) == 2
    np.testing.assert_allclose(mesh.data["normal"], mesh.points / RADIUS, atol=1e-12)
    np.testing.assert_allclose(mesh.data["velocity"], np.tile([0.0, 0.0, 1.0], (len(mesh.points), 1)), atol=1e-12)
    np.testing.assert_allclose(mesh.data["concentration"], mesh.points[:, 2], atol=1e-12)


def test_an_open_surface_has_a_rim():
    mesh = sphere(is_closed=False)
    area, _ = area_and_volume(mesh)
    assert area == pytest.approx(2.0 * np.pi * RADIUS**2, rel=2e-3)
    assert (np.abs(mesh.points[-AROUND:, 2]) < 1e-12).all()


def test_vtk_holds_what_the_mesh_has():
    """Decoded by hand: blocks of zlib in base64."""
    mesh = sphere()
    root = ET.fromstring(vtk_bytes(mesh, {"concentration": "c0"}, 2.5, {"peclet": 22.0}))
    arrays = {}
    for element in root.iter("DataArray"):
        text = (element.text or "").strip()
        _, length, _, packed = struct.unpack("<4Q", b64decode(text[:44]))
        raw = zlib.decompress(b64decode(text[44:]))
        assert (len(raw), len(b64decode(text[44:]))) == (length, packed)
        kind = {"Float32": "<f4", "Float64": "<f8", "Int64": "<i8"}[element.attrib["type"]]
        arrays[element.attrib["Name"]] = np.frombuffer(raw, kind)
    np.testing.assert_allclose(arrays["points"].reshape(-1, 3), mesh.points, atol=1e-6)
    np.testing.assert_allclose(arrays["velocity"].reshape(-1, 3), mesh.data["velocity"], atol=1e-6)
    np.testing.assert_array_equal(arrays["connectivity"].reshape(-1, 3), mesh.triangles)
    assert arrays["offsets"][-1] == mesh.triangles.size
    assert (arrays["TimeValue"].tolist(), arrays["peclet"].tolist()) == ([2.5], [22.0])


def test_pyvista_reads_both(tmp_path: Path):
    mesh = sphere()
    (tmp_path / "a.vtp").write_bytes(vtk_bytes(mesh, {}, 2.5, {"peclet": 22.0}))
    (tmp_path / "a.ply").write_bytes(ply_bytes(mesh, "closed-surface", (-RADIUS, RADIUS), {"peclet": 22.0}))
    for name in ("a.vtp", "a.ply"):
        read = pyvista.read(tmp_path / name)
        np.testing.assert_allclose(read.points, mesh.points, atol=1e-6)
        np.testing.assert_array_equal(read.regular_faces, mesh.triangles)
        assert read.area == pytest.approx(4.0 * np.pi * RADIUS**2, rel=2e-3)
        assert read.is_manifold
    read = pyvista.read(tmp_path / "a.vtp")
    assert {*read.point_data} == {*mesh.data}
    for name, values in mesh.data.items():
        np.testing.assert_allclose(read[name], values, atol=1e-6, err_msg=name)
    assert {name: float(read.field_data[name][0]) for name in read.field_data} == {"TimeValue": 2.5, "peclet": 22.0}


def read_ply(path: Path) -> tuple[np.ndarray, list[str]]:
    """The vertices of a binary PLY with all their properties, and its comments."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = head.decode().splitlines()
    types = {"float": "<f4", "uchar": "u1"}
    kinds = [
        (words[2], types[words[1]]) for line in lines if len(words := line.split()) == 3 and words[0] == "property"
    ]
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    return np.frombuffer(body, np.dtype(kinds), count), [line[8:] for line in lines if line.startswith("comment ")]


def test_ply_holds_what_the_mesh_has(tmp_path: Path):
    """Every field as a property with its values, also those that a reader of shapes leaves out, and the numbers of the state."""
    mesh = sphere()
    (tmp_path / "a.ply").write_bytes(ply_bytes(mesh, "closed-surface", (-RADIUS, RADIUS), {"peclet": 22.0}))
    vertices, comments = read_ply(tmp_path / "a.ply")
    assert comments == ["peclet 22.0"]
    columns = {"x": mesh.points[:, 0], "nz": mesh.data["normal"][:, 2], "velocity_z": mesh.data["velocity"][:, 2]}
    columns |= {name: values for name, values in mesh.data.items() if values.ndim == 1}
    for name, values in columns.items():
        np.testing.assert_allclose(vertices[name], values, atol=1e-6, err_msg=name)
    top, bottom = (vertices[["red", "green", "blue"]][i].tolist() for i in (0, -1))
    assert top == pytest.approx(255 * np.array(style.regulator_map()(1.0)[:3]), abs=1)
    assert bottom == pytest.approx(255 * np.array(style.regulator_map()(0.0)[:3]), abs=1)


def speed_of(data: xr.Dataset) -> np.ndarray:
    return np.hypot(data["tangential_velocity"], data["normal_velocity"]).to_numpy()


def timesteps(series: Path) -> list[float]:
    return [float(one.attrib["timestep"]) for one in ET.fromstring(series.read_bytes()).iter("DataSet")]


@pytest.fixture(scope="module")
def stores(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short run and a short branch with a pitchfork."""
    folder = tmp_path_factory.mktemp("stores")
    ss.run(ss.scenario("polar-swimmer", until=2e-3, elements=20), out=folder / "run")
    case = ss.scenario("polar-swimmer", elements=20)
    ss.branch(case, "peclet", 23.0, start=21.0, state="trivial", out=folder / "branch")
    return folder


def test_a_run_is_read_back(stores: Path, tmp_path: Path):
    data = ss.open_dataset(stores / "run")
    ss.export(stores / "run", tmp_path / "run.nc")
    xr.testing.assert_identical(xr.load_dataset(tmp_path / "run.nc"), data)
    ss.export(stores / "run", tmp_path / "run.csv", form="csv")
    table = pd.read_csv(tmp_path / "run.csv", comment="#")
    np.testing.assert_array_equal(table["time"], data["time"])
    np.testing.assert_array_equal(table["pressure"], data["pressure"])
    series = ss.export(stores / "run", tmp_path / "meshes", form="vtk")
    entries = [*ET.fromstring(series.read_bytes()).iter("DataSet")]
    np.testing.assert_array_equal([float(one.attrib["timestep"]) for one in entries], data["time"])
    last = pyvista.read(series.parent / entries[-1].attrib["file"])
    assert last.field_data["TimeValue"][0] == data["time"][-1]
    assert len(last.points) == 2 + AROUND * (data.sizes["point"] // 2 - 1)
    np.testing.assert_allclose(last["concentration"][0], data["concentration"][-1, 0], rtol=1e-6)
    np.testing.assert_allclose(last["concentration"][1::AROUND], data["concentration"][-1, 2::2], rtol=1e-6)
    np.testing.assert_allclose(
        np.linalg.norm(last["velocity"][1:-1:AROUND], axis=1), speed_of(data)[-1, 2:-1:2], rtol=1e-5
    )
    folder = ss.export(stores / "run", tmp_path / "ply", form="ply")
    assert len([*folder.glob("*.ply")]) == data.sizes["time"]


def test_a_branch_is_read_back(stores: Path, tmp_path: Path):
    """States with their shapes, the parameter, rates and labels, in the order of the branch."""
    branch = ss.open_branch(stores / "branch")
    ss.export(stores / "branch", tmp_path / "branch.nc")
    data = xr.load_dataset(tmp_path / "branch.nc")
    np.testing.assert_array_equal(data["peclet"], [point.parameter for point in branch.points])
    assert data["label"].to_numpy().tolist() == [point.label for point in branch.points]
    assert data["radius"].attrs["units"] == "R0"
    first = branch.points[0]
    np.testing.assert_allclose(data["growth_rate"][0][: len(first.growth_rates[:6])], first.growth_rates[:6, 0])
    np.testing.assert_allclose(data["radius"].max("point"), 1.0, rtol=1e-4)
    assert len(pd.read_csv(ss.export(stores / "branch", tmp_path / "b.csv", form="csv"), comment="#")) == len(
        data["label"]
    )
    series = ss.export(stores / "branch", tmp_path / "meshes", form="vtk")
    assert timesteps(series) == [point.parameter for point in branch.points]
    one = ss.export(f"{stores / 'branch'}:pitchfork-1", tmp_path / "one", form="vtk")
    assert timesteps(one) == pytest.approx([22.0])
    assert pyvista.read(one.parent / "000000.vtp").field_data["peclet"][0] == timesteps(one)[0]
    profile = pd.read_csv(ss.export(f"{stores / 'branch'}:pitchfork-1", tmp_path / "p.csv", form="csv"), comment="#")
    np.testing.assert_allclose(np.hypot(profile["radius"], profile["axial_position"]), 1.0, rtol=1e-6)


def test_where_a_key_turns_states_are_numbered(stores: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The key is in each file all the same."""
    branch = ss.open_branch(stores / "branch")
    turned = [replace(point, parameter=22.0 - abs(point.parameter - 22.0)) for point in branch.points]
    data = branch_dataset(replace(branch, points=tuple(turned)))
    monkeypatch.setattr("shapespace.view.export.stored_dataset", lambda _: data)
    series = ss.export(stores / "branch", tmp_path / "meshes", form="vtk")
    assert timesteps(series) == [*range(len(turned))]
    assert pyvista.read(series.parent / "000001.vtp").field_data["peclet"][0] == turned[1].parameter


@pytest.mark.parametrize(("name", "form"), [("a.nc", "csv"), ("a.csv", "netcdf"), ("a.ply", "vtk"), ("a.vtp", "csv")])
def test_an_ending_that_promises_another_form_is_refused(
    stores: Path,
    name: str,
    form: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
):
    monkeypatch.chdir(tmp_path)
    told = one_complaint(Shell(capsys)("export", stores / "run", name, f"--{form}"))
    assert f"{name}: its ending promises" in told
    assert not [*tmp_path.iterdir()]


def test_the_command_chooses_the_form(
    stores: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.chdir(tmp_path)
    shell = Shell(capsys)
    assert shell("export", stores / "run", "a.csv").out == "a.csv\n"
    assert shell("export", stores / "run", "here", "--vtk").out == "here/series.pvd\n"
    assert "--vtk" in one_complaint(shell("export", stores / "run"))
    assert "give only one" in one_complaint(shell("export", stores / "run", "--vtk", "--ply"))
    assert "end it in .nc" in one_complaint(shell("export", stores / "run", "a.txt"))


def test_a_map_is_read_back(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    """Numbers over both keys; of its surfaces only those that it stores, by their label."""
    make_map(tmp_path / "map", 3)
    data = ss.open_diagram(tmp_path / "map").dataset
    stored = xr.load_dataset(ss.export(tmp_path / "map", tmp_path / "map.nc"))
    np.testing.assert_array_equal(stored["velocity"], data["velocity"])
    assert stored["velocity"].attrs["units"] == data["velocity"].attrs["units"]
    table = pd.read_csv(ss.export(tmp_path / "map", tmp_path / "map.csv", form="csv"), comment="#")
    np.testing.assert_array_equal(
        table.set_index(["inverse_hydrodynamic_length", "peclet"])["velocity"].sort_index(),
        data["velocity"].to_numpy().ravel(),
    )
    for form in ("--vtk", "--ply"):
        told = one_complaint(Shell(capsys)("export", tmp_path / "map", tmp_path / "meshes", form))
        assert "is a diagram, a map without surfaces; export it as netcdf or csv" in told
    assert not (tmp_path / "meshes").exists()
    series = ss.export(f"{tmp_path / 'map'}:trivial-0", tmp_path / "one", form="vtk")
    assert len([*ET.fromstring(series.read_bytes()).iter("DataSet")]) == 1


@pytest.mark.slow
def test_curves_and_searches_are_read_back(stores: Path, tmp_path: Path):
    """Both parameters of every point of a curve, and all states of a search, with their surfaces in every form."""
    key = "saturation_concentration"
    start = ss.find_start(f"{stores / 'branch'}:pitchfork-1")
    value = start.scenario.values()[key]
    curve = ss.curve(f"{stores / 'branch'}:pitchfork-1", key, 1.1 * value, out=tmp_path / "curve")
    search = ss.search_states(ss.scenario("polar-swimmer", elements=20, peclet=23.0), out=tmp_path / "search")
    assert len(curve.points) > 1
    assert len(search.states) > 1
    for name, count in (("curve", len(curve.points)), ("search", len(search.states))):
        data = xr.load_dataset(ss.export(tmp_path / name, tmp_path / f"{name}.nc"))
        table = pd.read_csv(ss.export(tmp_path / name, tmp_path / f"{name}.csv", form="csv"), comment="#")
        assert data.sizes["state"] == len(table) == count
        np.testing.assert_array_equal(table["area"], data["area"])
        for form, ending in (("vtk", "vtp"), ("ply", "ply")):
            ss.export(tmp_path / name, tmp_path / f"{name}-{form}", form=form)
            assert len([*(tmp_path / f"{name}-{form}").glob(f"*.{ending}")]) == count
    stored = xr.load_dataset(tmp_path / "curve.nc")
    for i, name in enumerate(curve.keys):
        np.testing.assert_array_equal(stored[name], [point.parameters[i] for point in curve.points])
    energies = [one.frame.observables["bending_energy"] for one in search.states if one.frame]
    np.testing.assert_array_equal(xr.load_dataset(tmp_path / "search.nc")["bending_energy"], energies)
