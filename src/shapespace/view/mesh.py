"""Surfaces of revolution as triangle meshes with their fields, written as VTK (ParaView) and as PLY."""

import base64
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from shapespace.view import style
from shapespace.view.frames import REGULATORS

Array = NDArray[np.float64]

AROUND = 48
"""Vertices on a circle."""
EVERY = 2
"""Points of the meridian from one circle to the next."""
_PLACES = ("mesh_coordinate", "radius", "axial_position", "tangent_angle")


@dataclass(frozen=True)
class Mesh:
    """points (n, 3), axis along z; triangles (m, 3), seen from outside counterclockwise; data by name, (n,) or (n, 3)."""

    points: Array
    triangles: NDArray[np.int64]
    data: dict[str, Array]


def mesh_of(dataset: xr.Dataset, number: int) -> Mesh:
    """The mesh of frame or state `number` of a dataset with fields (time or state, point)."""
    fields = {
        str(name): variable.to_numpy()[number] for name, variable in dataset.data_vars.items() if variable.dims[1:] == ("point",)
    }  # fmt: skip
    return revolved(fields, is_closed=dataset.attrs["kind"] != "open-membrane")


def revolved(fields: Mapping[str, Array], is_closed: bool) -> Mesh:
    """The surface that a meridian from the upper pole down sweeps, with its fields, the normal, and the velocity as vectors."""
    last = len(fields["radius"]) - 1
    rows = np.unique(np.append(np.arange(0, last, EVERY), last))
    rings = rows[1:-1] if is_closed else rows[1:]
    angles = 2.0 * np.pi * np.arange(AROUND) / AROUND
    # Vertices: the upper pole, ring after ring, and the lower pole of a closed surface.
    row = np.concatenate([rows[:1], np.repeat(rings, AROUND), rows[-1:] if is_closed else rows[:0]])
    phi = np.concatenate([[0.0], np.tile(angles, len(rings)), [0.0] if is_closed else []])
    outward = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    column = {name: values[row][:, None] for name, values in fields.items()}
    sin, cos = np.sin(column["tangent_angle"]), np.cos(column["tangent_angle"])
    normal, along = sin * outward + cos * up, cos * outward - sin * up
    # On the axis there is no direction away from it; sin psi is zero there, up to round-off.
    on_axis = column["radius"] == 0.0
    normal, along = np.where(on_axis, np.sign(cos) * up, normal), np.where(on_axis, 0.0, along)
    data = {name: values[row] for name, values in fields.items() if name not in _PLACES}
    data["normal"] = normal
    data["velocity"] = column["tangential_velocity"] * along + column["normal_velocity"] * normal
    points = column["radius"] * outward + column["axial_position"] * up
    return Mesh(points, _triangles(len(rings), is_closed), data)


def _triangles(rings: int, is_closed: bool) -> NDArray[np.int64]:
    one = np.arange(AROUND)
    after = (one + 1) % AROUND
    parts = [np.stack([np.zeros_like(one), 1 + one, 1 + after], axis=1)]
    for ring in range(rings - 1):
        upper, lower = 1 + ring * AROUND, 1 + (ring + 1) * AROUND
        parts.append(np.stack([upper + one, lower + one, lower + after], axis=1))
        parts.append(np.stack([upper + one, lower + after, upper + after], axis=1))
    if is_closed:
        upper, pole = 1 + (rings - 1) * AROUND, 1 + rings * AROUND
        parts.append(np.stack([upper + one, np.full_like(one, pole), upper + after], axis=1))
    return np.concatenate(parts)


def vtk_bytes(mesh: Mesh, units: Mapping[str, str], time: float, numbers: Mapping[str, float]) -> bytes:
    """An XML PolyData file (.vtp), compressed: fields in single precision, time as TimeValue and numbers as field data in double
    precision, units as a comment. numbers: time, or the state's values of the keys that vary.
    """
    told = ", ".join(f"{name} {unit}" for name, unit in units.items() if name in mesh.data or name in numbers)
    about = "".join(_number(name, value) for name, value in {"TimeValue": time, **numbers}.items())
    count = len(mesh.triangles)
    data = "".join(_data_array(values.astype("<f4"), name) for name, values in mesh.data.items())
    return f"""<?xml version="1.0"?>
<!-- units: points {units.get("radius", "")}, {told} -->
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64" compressor="vtkZLibDataCompressor">
<PolyData>
<FieldData>{about}</FieldData>
<Piece NumberOfPoints="{len(mesh.points)}" NumberOfPolys="{count}">
<PointData Normals="normal">{data}</PointData>
<Points>{_data_array(mesh.points.astype("<f4"), "points")}</Points>
<Polys>{_data_array(mesh.triangles.astype("<i8").ravel(), "connectivity")}
{_data_array(3 * np.arange(1, count + 1, dtype="<i8"), "offsets")}</Polys>
</Piece>
</PolyData>
</VTKFile>
""".encode()


def _number(name: str, value: float) -> str:
    return _data_array(np.array([value], dtype="<f8"), name, 'NumberOfTuples="1"')


def _data_array(values: NDArray[np.generic], name: str, more: str = "") -> str:
    kind = {"f4": "Float32", "f8": "Float64", "i8": "Int64"}[values.dtype.str[1:]]
    raw = np.ascontiguousarray(values).tobytes()
    packed = zlib.compress(raw)
    # One block: how many, its length, that of a last shorter one, and its compressed length.
    header = struct.pack("<4Q", 1, len(raw), 0, len(packed))
    text = (base64.b64encode(header) + base64.b64encode(packed)).decode()
    width = values.shape[1] if values.ndim > 1 else 1
    return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" {more} format="binary">{text}</DataArray>\n'


def vtk_series(files: Mapping[str, float]) -> bytes:
    """The collection (.pvd) that ParaView opens as a series: time by file name."""
    entries = "".join(f'<DataSet timestep="{value!r}" file="{name}"/>\n' for name, value in files.items())
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0">\n<Collection>\n'
    return f"{head}{entries}</Collection>\n</VTKFile>\n".encode()


def ply_bytes(mesh: Mesh, kind: str, span: tuple[float, float], numbers: Mapping[str, float]) -> bytes:
    """A binary PLY file: points, normals, colours of the regulator or coat over `span`, and every field as a property; numbers
    of the state as comments.
    """
    carried = REGULATORS.get(kind, "")
    scalars = {name: values for name, values in mesh.data.items() if values.ndim == 1}
    low, high = span
    colours = style.coat_map() if kind == "open-membrane" else style.regulator_map()
    share = (scalars[carried] - low) / ((high - low) or 1.0) if carried in scalars else np.zeros(len(mesh.points))
    rgb = colours(share)[:, :3]
    columns = {name: mesh.points[:, i] for i, name in enumerate("xyz")}
    columns |= {name: mesh.data["normal"][:, i] for i, name in enumerate(("nx", "ny", "nz"))}
    columns |= {f"velocity_{axis}": mesh.data["velocity"][:, i] for i, axis in enumerate("xyz")} | scalars
    kinds = [(name, "<f4") for name in columns] + [(name, "u1") for name in ("red", "green", "blue")]
    vertices = np.empty(len(mesh.points), dtype=kinds)
    for name, values in columns.items():
        vertices[name] = values
    for i, name in enumerate(("red", "green", "blue")):
        vertices[name] = np.round(255.0 * rgb[:, i])
    faces = np.empty(len(mesh.triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.triangles
    properties = [f"property {'float' if form == '<f4' else 'uchar'} {name}" for name, form in kinds]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {name} {value!r}" for name, value in numbers.items()),
    ]
    header += [f"element vertex {len(vertices)}", *properties]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    return "\n".join(header).encode() + vertices.tobytes() + faces.tobytes()
