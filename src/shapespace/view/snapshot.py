"""Drawing one state: the surface of revolution in soft light, seen from slightly above, with its velocity arrows.

Orthographic camera at elevation e above the equator. A surface point at (r, azimuth f, z) lies at screen position
x = r sin f, y = z cos e - r cos f sin e, and at depth d = z sin e + r cos f cos e towards the viewer.
Velocity arrows stand on the two meridians f = +-90 deg, which lie in the plane of the picture.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colors import Normalize, PowerNorm
from matplotlib.quiver import Quiver
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from shapespace.study.telling import LEAST_CHANGE
from shapespace.view import style
from shapespace.view.frames import Array, Profile, Run

_RINGS = 132  # points of the drawn meridian
_FACETS = 72  # points of a drawn parallel
_OWN_SCALE_FACTOR = 10.0  # between the flows of the snapshots
_LIGHT = np.array([-0.42, 0.62, 0.66]) / np.linalg.norm([-0.42, 0.62, 0.66])
_SHADE = np.array([0.25, 0.32, 0.42])  # what is left of red, green and blue in full shade: bluish, as under a sky
_GLINT = (_LIGHT + np.array([0, 0, 1])) / np.linalg.norm(_LIGHT + np.array([0, 0, 1]))


@dataclass(frozen=True)
class Camera:
    """What all snapshots of one run share, so that they can be compared: view, colours, length of an arrow, limits."""

    elevation: float
    colours: ScalarMappable
    colours_exceed: bool
    arrow_scale: float  # length on the page, in units of radius, per unit of flow velocity; 0: no flow
    swim_scale: float  # the same for the swimming speed, whose arrow has a scale of its own; 0: does not swim
    size: float  # largest radius of the run
    is_open: bool
    arrow_width: float  # of a shaft, in inches

    @property
    def longest_arrow(self) -> float:
        """Length on the page of the fastest flow: no longer than the space between two arrows."""
        return (0.3 if self.is_open else 0.4) * self.size

    @property
    def shortest_arrow(self) -> float:
        """Shorter arrows are left out rather than drawn as dots."""
        return 0.05 * self.longest_arrow

    @property
    def shortest_swim(self) -> float:
        """The same for the thicker arrow of the swimming speed."""
        return 0.06 * self.size

    def for_flow(self, speed: float) -> "Camera":
        """The same camera with an arrow scale on which `speed` > 0 has the longest arrow."""
        return replace(self, arrow_scale=self.longest_arrow / speed)

    def quiver(self, axes: Axes, arrows: Array, colour: str, thick: float = 1.0) -> Quiver:
        """Arrows (4, n) given as x, y of their tails and vectors, on the scale of the axes."""
        return axes.quiver(
            *arrows,
            color=colour,
            edgecolor="white",
            linewidth=0.2,
            zorder=4,
            units="inches",
            angles="xy",
            scale_units="xy",
            scale=1.0,
            width=thick * self.arrow_width,
            headwidth=4.0,
            headlength=4.2,
            headaxislength=3.8,
            minlength=0.0,
            minshaft=1.2,
        )

    def project(self, x: Array, front: Array, z: Array) -> tuple[Array, Array]:
        """Screen coordinates of points given along the page, towards the viewer, and along the axis."""
        return x, z * np.cos(self.elevation) - front * np.sin(self.elevation)


@dataclass(frozen=True)
class Surface:
    """A drawn surface: vertices (n, 2), their colours (n, 4), visible triangles (m, 3) from back to front."""

    vertices: Array
    colours: Array
    triangles: NDArray[np.int64]


def make_camera(run: Run, profiles: Sequence[Profile], arrow_width: float = 1.15 / 72) -> Camera:
    """The common camera for `profiles`; the fastest flow among them gets the longest arrow."""
    size = max(float(p.radius.max()) for p in profiles)
    mappable, exceeds = _regulator_colours(run, profiles)
    fastest = max(fastest_flow(p, run.is_open) for p in profiles)
    swim = max(abs(p.swim) for p in profiles)
    # Round-off is not a flow, and a surface that stays where it is does not swim.
    rest = LEAST_CHANGE * run.scales.factor("velocity")
    swims = swim > max(rest, 1e-3 * fastest)
    camera = Camera(
        elevation=float(np.deg2rad(24.0 if run.is_open else 8.0)),
        colours=mappable,
        colours_exceed=exceeds,
        arrow_scale=0.0,
        swim_scale=0.4 * size / swim if swims else 0.0,
        size=size,
        is_open=run.is_open,
        arrow_width=arrow_width,
    )
    return camera.for_flow(fastest) if fastest > rest else camera


def arrow_flows(profiles: Sequence[Profile], camera: Camera, rest: float = 0.02, ignored: float = 0.0) -> Array:
    """The flow speed that gets the longest arrow, for each of `profiles`: one for all where one scale can serve.

    Where the flow dies away by more than a factor of ten, in more than the part `ignored` of the states, each state has
    its own; below the part `rest` of the fastest flow a state counts as at rest. All 0 if nothing flows.
    """
    flows = np.array([fastest_flow(p, camera.is_open) for p in profiles])
    fastest = float(flows.max())
    if camera.arrow_scale == 0:
        return np.zeros_like(flows)
    slow = float(np.quantile(flows[flows > rest * fastest], ignored))
    apart = fastest > _OWN_SCALE_FACTOR * slow
    return np.maximum(flows, rest * fastest) if apart else np.full_like(flows, fastest)


def fastest_flow(profile: Profile, is_open: bool) -> float:
    """The largest speed that an arrow shows."""
    return float(np.hypot(*arrow_velocity(profile, _arrow_places(is_open), tangential_only=is_open)).max())


def _regulator_colours(run: Run, profiles: Sequence[Profile]) -> tuple[ScalarMappable, bool]:
    """The colour scale over `profiles`, and whether a tiny area (under 1%) exceeds it, as at a narrow neck."""
    if run.regulator is None:
        return ScalarMappable(Normalize(0, 1), style.coat_map()), False
    values = np.concatenate([p.regulator for p in profiles if p.regulator is not None])
    if run.is_open:
        peak = values[np.argmax(np.abs(values))]
        return ScalarMappable(Normalize(min(0.0, float(peak)), max(0.0, float(peak)) or 1.0), style.coat_map()), False
    areas = np.concatenate([np.gradient(p.u) * p.radius / np.trapezoid(p.radius, p.u) for p in profiles])
    order = np.argsort(values)
    middle, top = np.interp([0.5 * len(profiles), 0.99 * len(profiles)], np.cumsum(areas[order]), values[order])
    exceeds = float(values.max()) > 1.25 * top
    limits = (min(0.0, float(values.min())), float(top if exceeds else values.max()))
    if limits[1] <= limits[0]:
        limits = (limits[0], limits[0] + 1.0)
    # A narrow peak would leave all else pale on a linear scale.
    norm = PowerNorm(0.5, *limits) if limits[0] == 0 and middle < 0.2 * limits[1] else Normalize(*limits)
    return ScalarMappable(norm, style.regulator_map()), exceeds


def _arrow_places(is_open: bool) -> Array:
    """The u at which arrows stand: off the poles, and on the equator of a closed surface."""
    count = 7 if is_open else 11
    return (np.arange(count) + 0.5) / count


def arrow_velocity(profile: Profile, at: Array, *, tangential_only: bool) -> tuple[Array, Array]:
    """(v_r, v_z) = v_u (cos psi, -sin psi) + v_n (sin psi, cos psi) at u = `at`, without v_n on request."""
    angle, tangential, normal = (
        np.interp(at, profile.u, v) for v in (profile.angle, profile.tangential, profile.normal)
    )
    cos, sin = np.cos(angle), np.sin(angle)
    normal = 0 * normal if tangential_only else normal
    return tangential * cos + normal * sin, -tangential * sin + normal * cos


def drawn_meridian(profile: Profile) -> tuple[Array, Array, Array, Array | None]:
    """(r, z, psi, regulator) at points shared out by arc length and turning: poles and narrow necks stay round."""
    turning = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(profile.angle)))])
    measure = profile.u + 0.6 * turning / max(float(turning[-1]), 1e-300)
    at = np.linspace(measure[0], measure[-1], _RINGS)
    r, z, psi = (np.interp(at, measure, v) for v in (profile.radius, profile.axial, profile.angle))
    regulator = None if profile.regulator is None else np.interp(at, measure, profile.regulator)
    return r, z, psi, regulator


def make_surface(profile: Profile, camera: Camera, offset: float = 0.0) -> Surface:
    """The visible part of the surface of revolution, moved by `offset` along the axis."""
    r, z, psi, regulator = drawn_meridian(profile)
    azimuth = np.linspace(-np.pi, np.pi, _FACETS + 1)
    sin_f, cos_f = np.sin(azimuth), np.cos(azimuth)
    cos_e, sin_e = np.cos(camera.elevation), np.sin(camera.elevation)
    x, y = camera.project(r[:, None] * sin_f, r[:, None] * cos_f, (z + offset)[:, None] + 0 * cos_f)
    depth = z[:, None] * sin_e + r[:, None] * cos_f * cos_e
    outward, up = np.sin(psi)[:, None], np.cos(psi)[:, None]
    normals = np.stack([outward * sin_f, up * cos_e - outward * cos_f * sin_e, up * sin_e + outward * cos_f * cos_e])
    base = camera.colours.to_rgba(regulator if regulator is not None else np.zeros_like(r))
    colours = _lit(np.repeat(base[:, None, :], azimuth.size, axis=1), normals)

    corner = np.arange(r.size * azimuth.size).reshape(r.size, azimuth.size)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    triangles = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    facing = normals[2].ravel()[triangles].max(axis=1) > 0
    triangles = triangles[facing]
    triangles = triangles[np.argsort(depth.ravel()[triangles].mean(axis=1))]
    return Surface(np.stack([x.ravel(), y.ravel()], -1), colours.reshape(-1, 4), triangles)


def _lit(colours: Array, normals: Array) -> Array:
    """Soft light from the upper left with a faint glint: hue is kept, so the colour bar stays valid."""
    diffuse = np.clip(np.tensordot(_LIGHT, normals, 1), 0, 1)
    limb = np.clip(normals[2], 0, 1) ** 0.5
    light = np.minimum((0.74 + 0.30 * diffuse) * (0.86 + 0.14 * limb), 1.0)[..., None]
    glint = 0.10 * np.clip(np.tensordot(_GLINT, normals, 1), 0, 1)[..., None] ** 24
    rgb = colours[..., :3] * (light + (1 - light) * _SHADE)
    return np.concatenate([np.clip(rgb + glint * (1 - rgb), 0, 1), colours[..., 3:]], axis=-1)


def silhouette(profile: Profile, camera: Camera, offset: float = 0.0) -> list[Array]:
    """The contour lines, where the normal is perpendicular to the view, and the rim of an open surface."""
    r, z, psi, _ = drawn_meridian(profile)
    cosine = -np.cos(psi) * np.tan(camera.elevation) / np.where(np.abs(np.sin(psi)) < 1e-9, 1e-9, np.sin(psi))
    seen = np.abs(cosine) <= 1
    seen |= np.roll(seen, 1) | np.roll(seen, -1)  # one ring more closes the gap where both contours meet
    front = r * np.clip(cosine, -1, 1)
    side = np.sqrt(np.maximum(r**2 - front**2, 0))
    lines = []
    for sign in (-1, 1):
        x, y = camera.project(sign * side, front, z + offset)
        lines.append(np.where(seen[:, None], np.stack([x, y], -1), np.nan))
    azimuth = np.linspace(0, 2 * np.pi, 121)
    rim = profile.radius[-1]
    x, y = camera.project(rim * np.sin(azimuth), rim * np.cos(azimuth), profile.axial[-1] + offset + 0 * azimuth)
    return [*lines, np.stack([x, y], -1)]


def velocity_arrows(profile: Profile, camera: Camera, offset: float = 0.0) -> tuple[Array, Array]:
    """Tails and vectors (n, 2) on the page of the arrows, at equal arc length on both meridians.

    They start on the surface; where they would cross the axis, as at a closing neck, they end on it.
    """
    at = _arrow_places(camera.is_open)
    v_r, v_z = arrow_velocity(profile, at, tangential_only=camera.is_open)
    r, z = (np.interp(at, profile.u, v) for v in (profile.radius, profile.axial + offset))
    tails, vectors = [], []
    crosses_axis = r + v_r * camera.arrow_scale < 0
    for sign in (-1, 1):
        vector = np.stack(camera.project(sign * v_r, 0 * r, v_z), -1) * camera.arrow_scale
        tail = np.stack(camera.project(sign * r, 0 * r, z), -1)
        tails.append(np.where(crosses_axis[:, None], tail - vector, tail))
        vectors.append(vector)
    return np.concatenate(tails), np.concatenate(vectors)


def swim_arrow(profile: Profile, camera: Camera, offset: float = 0.0) -> tuple[Array, Array]:
    """Tail and vector (1, 2) of the swimming-speed arrow, ahead of the leading pole."""
    ahead = float(profile.axial.max() if profile.swim >= 0 else profile.axial.min()) + offset
    gap = 0.12 * camera.size * (1 if profile.swim >= 0 else -1)
    tail = np.stack(camera.project(np.zeros(1), np.zeros(1), np.array([ahead + gap])), -1)
    vector = np.stack(camera.project(np.zeros(1), np.zeros(1), np.array([profile.swim])), -1) * camera.swim_scale
    return tail, vector


class SnapshotArtists:
    """The artists of one snapshot on given axes, made once and moved from state to state by `show`."""

    def __init__(self, axes: Axes, camera: Camera, *, with_swim: bool) -> None:
        self.camera = camera
        self._with_swim = with_swim
        self._outline = LineCollection([], colors=style.INK, linewidths=1.1, zorder=1)
        axes.add_collection(self._outline, autolim=False)
        self._axes = axes
        self._mesh: TriMesh | None = None
        self.flow = camera.quiver(axes, np.zeros((4, 2 * _arrow_places(camera.is_open).size)), style.RED)
        self.swim = camera.quiver(axes, np.zeros((4, 1)), style.GREEN, thick=1.9)

    def show(self, profile: Profile, offset: float = 0.0, flow: float = 0.0) -> None:
        """Draw `profile` moved by `offset` along the axis; a `flow` > 0 sets the speed of the longest arrow."""
        if flow > 0:
            self.camera = self.camera.for_flow(flow)
        surface = make_surface(profile, self.camera, offset)
        if self._mesh is not None:
            self._mesh.remove()
        triangulation = Triangulation(surface.vertices[:, 0], surface.vertices[:, 1], surface.triangles)
        self._mesh = TriMesh(triangulation, zorder=2)
        self._mesh.set(facecolor=surface.colours, rasterized=True)
        self._axes.add_collection(self._mesh, autolim=False)
        self._outline.set_segments(silhouette(profile, self.camera, offset))
        _set_arrows(self.flow, *velocity_arrows(profile, self.camera, offset), self.camera.shortest_arrow)
        if self._with_swim:
            _set_arrows(self.swim, *swim_arrow(profile, self.camera, offset), self.camera.shortest_swim)


def _set_arrows(quiver: Quiver, tails: Array, vectors: Array, shortest: float) -> None:
    """Move the arrows; those too short to be seen are left out."""
    hidden = np.hypot(*vectors.T) < shortest
    quiver.set_offsets(tails)
    quiver.XY = tails
    quiver.set_UVC(np.ma.array(vectors[:, 0], mask=hidden), np.ma.array(vectors[:, 1], mask=hidden))


def offset_of(camera: Camera, profile: Profile) -> float:
    """The shift along the axis that centres a closed surface; an open one stays on its rim."""
    return 0.0 if camera.is_open else -profile.centre


def extent(
    profile: Profile, camera: Camera, offset: float = 0.0, *, with_swim: bool
) -> tuple[float, float, float, float]:
    """(left, right, bottom, top) of everything drawn for `profile`, arrow heads included."""
    outline = np.concatenate([line[~np.isnan(line[:, 0])] for line in silhouette(profile, camera, offset)])
    pieces = [outline]
    arrows = [velocity_arrows(profile, camera, offset)]
    if with_swim:
        arrows.append(swim_arrow(profile, camera, offset))
    for tails, vectors in arrows:
        pieces += [tails, tails + vectors]
    points = np.concatenate(pieces)
    margin = 0.1 * camera.size
    (left, bottom), (right, top) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return float(left), float(right), float(bottom), float(top)
