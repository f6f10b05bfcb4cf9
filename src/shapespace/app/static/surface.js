// The surface of revolution in three dimensions, coloured by one of its fields, with arrows of its flow.

import * as three from "./vendor/three.module.min.js";
import { row, table } from "./colours.js";
import { Orbit } from "./orbit.js";

const AROUND = 96;
const SPOKES = 8;
const ALONG = 11;
const ARROW = 0.42;

export class Surface {
  /** An Error where the browser cannot draw in three dimensions. */
  constructor(host, changed) {
    this.host = host;
    this.renderer = new three.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    host.append(this.renderer.domElement);
    this.scene = new three.Scene();
    this.camera = new three.PerspectiveCamera(26, 1, 0.01, 100);
    const light = new three.DirectionalLight(0xffffff, 1.5);
    light.position.set(-1.4, 2, 2);
    this.camera.add(light);
    this.scene.add(this.camera, new three.HemisphereLight(0xffffff, 0xb9c2d0, 1.75));
    this.orbit = new Orbit(host, () => { this.due(); changed(this.orbit.text()); });
    this.extent = 0;
    this.centre = 0;
    this.body = new three.Group();
    this.body.visible = false;
    this.scene.add(this.body);
    this.makeSkin();
    this.makeArrows();
    this.makeRings();
    this.room = { width: 0, height: 0 };
    new ResizeObserver(([{ contentRect }]) => {
      this.room = contentRect;
      this.due();
    }).observe(host);
  }

  makeSkin() {
    const material = new three.MeshStandardMaterial({ vertexColors: true, roughness: 0.62, metalness: 0, side: three.DoubleSide });
    this.skin = new three.Mesh(new three.BufferGeometry(), material);
    this.skin.frustumCulled = false;
    this.body.add(this.skin);
    this.rows = 0;
  }

  makeArrows() {
    const head = new three.ConeGeometry(0.085, 0.26, 14).translate(0, 0.87, 0);
    const shaft = new three.CylinderGeometry(0.03, 0.03, 0.75, 10).translate(0, 0.375, 0);
    const material = new three.MeshStandardMaterial({ roughness: 0.5 });
    this.arrowParts = [head, shaft].map((shape) => new three.InstancedMesh(shape, material, ALONG * SPOKES));
    this.swim = [head, shaft].map((shape) => new three.Mesh(shape, new three.MeshStandardMaterial({ roughness: 0.5 })));
    for (const part of [...this.arrowParts, ...this.swim]) {
      part.frustumCulled = false;
      this.body.add(part);
    }
  }

  makeRings() {
    const circle = (steps) => Array.from({ length: steps + 1 }, (_, k) => {
      const angle = (2 * Math.PI * k) / steps;
      return new three.Vector3(Math.cos(angle), 0, Math.sin(angle));
    });
    const shape = new three.BufferGeometry().setFromPoints(circle(128));
    this.ring = new three.Line(shape, new three.LineBasicMaterial({ color: 0xc8501e }));
    this.rim = new three.Line(shape, new three.LineBasicMaterial({ color: 0x66707d }));
    this.ring.visible = this.rim.visible = false;
    this.body.add(this.ring, this.rim);
  }

  setTheme(isDark) {
    this.arrowParts[0].material.color.set(isDark ? 0xff6b70 : 0xd81e2c);
    for (const part of this.swim) part.material.color.set(isDark ? 0x4fc991 : 0x00794a);
    this.ring.material.color.set(isDark ? 0xf0955e : 0xc8501e);
    this.due();
  }

  /** Forget the size of what was seen before. */
  reset() {
    this.extent = 0;
  }

  /** Show nothing. */
  hide() {
    this.body.visible = false;
    this.due();
  }

  /** Show a meridian: r, z, angle (m,), with values to colour, their scale, and velocities along and normal to it or null. */
  show({ r, z, angle, values, scale, flow, fastest, speed, isOpen }) {
    const rows = r.length;
    if (rows !== this.rows) this.makeMesh(rows);
    this.body.visible = true;
    let [low, high, wide] = [Infinity, -Infinity, 0];
    for (let i = 0; i < rows; i++) {
      low = Math.min(low, z[i]);
      high = Math.max(high, z[i]);
      wide = Math.max(wide, r[i]);
    }
    this.centre = (low + high) / 2;
    this.extent = Math.max(this.extent, Math.hypot(wide, (high - low) / 2));
    this.size = wide;
    this.fill(r, z, angle, values, scale);
    this.meridian = { r, z };
    this.setArrows(r, z, angle, flow, fastest);
    this.setSwim(speed, low, high);
    this.rim.visible = isOpen;
    this.rim.scale.set(r[rows - 1], 1, r[rows - 1]);
    this.rim.position.y = z[rows - 1] - this.centre;
    this.due();
  }

  makeMesh(rows) {
    this.rows = rows;
    const shape = new three.BufferGeometry();
    const count = rows * (AROUND + 1);
    for (const name of ["position", "normal", "color"]) {
      shape.setAttribute(name, new three.BufferAttribute(new Float32Array(3 * count), 3));
    }
    const index = [];
    for (let i = 0; i + 1 < rows; i++) {
      for (let k = 0; k < AROUND; k++) {
        const a = i * (AROUND + 1) + k;
        const b = a + AROUND + 1;
        index.push(a, a + 1, b, b, a + 1, b + 1);
      }
    }
    shape.setIndex(index);
    this.skin.geometry.dispose();
    this.skin.geometry = shape;
  }

  fill(r, z, angle, values, scale) {
    const { position, normal, color } = this.skin.geometry.attributes;
    const colours = scale ? linearTable(scale.map) : null;
    for (let i = 0; i < r.length; i++) {
      const [out, up] = [Math.sin(angle[i]), Math.cos(angle[i])];
      const from = colours ? 3 * row(values[i], scale) : 0;
      for (let k = 0; k <= AROUND; k++) {
        const [c, s] = [COS[k], SIN[k]];
        const at = 3 * (i * (AROUND + 1) + k);
        position.array[at] = r[i] * c;
        position.array[at + 1] = z[i] - this.centre;
        position.array[at + 2] = r[i] * s;
        normal.array[at] = out * c;
        normal.array[at + 1] = up;
        normal.array[at + 2] = out * s;
        for (let j = 0; j < 3; j++) color.array[at + j] = colours ? colours[from + j] : 0.6;
      }
    }
    for (const one of [position, normal, color]) one.needsUpdate = true;
  }

  setArrows(r, z, angle, flow, fastest) {
    for (const part of this.arrowParts) part.visible = flow !== null && fastest > 0;
    if (!this.arrowParts[0].visible) return;
    const longest = ARROW * this.size;
    const matrix = new three.Matrix4();
    const places = evenPlaces(r, z, ALONG);
    places.forEach((i, n) => {
      const out = flow.tangential[i] * Math.cos(angle[i]) + flow.normal[i] * Math.sin(angle[i]);
      const up = -flow.tangential[i] * Math.sin(angle[i]) + flow.normal[i] * Math.cos(angle[i]);
      for (let k = 0; k < SPOKES; k++) {
        const turn = (2 * Math.PI * (k + 0.5 * (n % 2))) / SPOKES;
        const velocity = new three.Vector3(out * Math.cos(turn), up, out * Math.sin(turn));
        const length = (velocity.length() / fastest) * longest;
        const spot = new three.Vector3(r[i] * Math.cos(turn), z[i] - this.centre, r[i] * Math.sin(turn));
        const lift = 0.012 * this.size;
        spot.add(new three.Vector3(Math.sin(angle[i]) * Math.cos(turn), Math.cos(angle[i]), Math.sin(angle[i]) * Math.sin(turn)).multiplyScalar(lift));
        // An arrow into the surface would be hidden in it: it ends there.
        if (out * Math.sin(angle[i]) + up * Math.cos(angle[i]) < 0) spot.addScaledVector(velocity, -length / (velocity.length() || 1));
        const isSeen = length > 0.06 * longest;
        arrowMatrix(matrix, spot, velocity, isSeen ? length : 0, Math.max(length, 0.55 * longest));
        for (const part of this.arrowParts) part.setMatrixAt(n * SPOKES + k, matrix);
      }
    });
    for (const part of this.arrowParts) part.instanceMatrix.needsUpdate = true;
  }

  setSwim(speed, low, high) {
    const isSwimming = Math.abs(speed) > 0;
    for (const part of this.swim) {
      part.visible = isSwimming;
      if (!isSwimming) continue;
      const side = Math.sign(speed);
      const tail = (side > 0 ? high : low) - this.centre + side * 0.1 * this.size;
      const matrix = new three.Matrix4();
      arrowMatrix(matrix, new three.Vector3(0, tail, 0), new three.Vector3(0, side, 0), 0.55 * this.size, 0.8 * this.size);
      part.matrixAutoUpdate = false;
      part.matrix.copy(matrix);
    }
  }

  /** The row of the meridian under the pointer, null beside the surface. */
  rowAt({ clientX, clientY }) {
    if (!this.body.visible || this.orbit.isHeld) return null;
    const { left, top, width, height } = this.host.getBoundingClientRect();
    const ray = new three.Raycaster();
    ray.setFromCamera(new three.Vector2((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height), this.camera);
    this.skin.geometry.computeBoundingSphere();
    const [hit] = ray.intersectObject(this.skin);
    return hit ? Math.floor(hit.faceIndex / (2 * AROUND)) : null;
  }

  /** A ring around the surface at a row of the meridian; none for null. */
  point(i) {
    this.ring.visible = i !== null && this.meridian !== undefined;
    if (this.ring.visible) {
      const radius = this.meridian.r[i] * 1.004 + 0.003 * this.size;
      this.ring.scale.set(radius, 1, radius);
      this.ring.position.y = this.meridian.z[i] - this.centre;
    }
    this.due();
  }

  due() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      this.render();
    });
  }

  render() {
    const { width, height } = this.room;
    if (!width || !height) return;
    if (this.room !== this.filled) this.renderer.setSize(width, height, false);
    this.filled = this.room;
    if (this.extent) this.placeCamera(width, height);
    this.renderer.render(this.scene, this.camera);
  }

  placeCamera(width, height) {
    this.camera.aspect = width / height;
    const half = (this.camera.fov * Math.PI) / 360;
    const reach = (1.16 * this.extent) / Math.sin(Math.min(half, Math.atan(Math.tan(half) * this.camera.aspect)));
    this.orbit.place(this.camera, reach);
    this.camera.near = 0.02 * reach;
    this.camera.far = 6 * reach;
    this.camera.updateProjectionMatrix();
  }
}

const COS = Array.from({ length: AROUND + 1 }, (_, k) => Math.cos((2 * Math.PI * k) / AROUND));
const SIN = Array.from({ length: AROUND + 1 }, (_, k) => Math.sin((2 * Math.PI * k) / AROUND));

const linearTables = new Map();

/** A colour map in the linear space that light is added in. */
function linearTable(name) {
  if (!linearTables.has(name)) linearTables.set(name, table(name).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)));
  return linearTables.get(name);
}

/** Rows evenly spaced along the curve, off its ends. */
function evenPlaces(r, z, count) {
  const length = [0];
  for (let i = 1; i < r.length; i++) length.push(length[i - 1] + Math.hypot(r[i] - r[i - 1], z[i] - z[i - 1]));
  let i = 0;
  return Array.from({ length: count }, (_, n) => {
    const wanted = ((n + 0.5) / count) * length.at(-1);
    while (i + 1 < length.length && length[i] < wanted) i++;
    return i;
  });
}

const UP = new three.Vector3(0, 1, 0);

function arrowMatrix(matrix, spot, direction, length, width) {
  const turn = new three.Quaternion().setFromUnitVectors(UP, direction.clone().normalize());
  matrix.compose(spot, turn, new three.Vector3(length && width, length, length && width));
}
