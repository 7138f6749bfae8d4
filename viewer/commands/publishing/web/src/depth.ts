// Depth of a place: decoding (the reference is depth_codes.py), looking it up, and measured surfaces with their uncertainty.

import { bytes, inflated } from "./loader";
import { dot, FACE_COUNT, FACES, times, type PlaceData, type Vector } from "./scene";

export interface Surface {
  point: Vector; // relative to the place
  across: number; // standard uncertainty at right angles to the ray, file units
  along: number; // and along the ray
  ray: Vector; // unit vector
}

const WINDOW = [3, 14]; // pixels to each side, at least and at most, whose measured depths make up a surface
const SPACINGS = 2.5; // the same in spacings of points where it is wider: some twenty points
const SNAP = 1.5; // spacings, at least 2.5 pixels: the farthest measured pixel from the pointer that still counts as hit
const FEWEST = 6; // measured pixels that a surface needs
const SAME = 0.03; // relative difference of inverse depth, beyond a plane's slope, up to which pixels are one surface

export class DepthMap {
  readonly count: number;

  // stride: this map has every stride-th pixel of faces `full` pixels wide.
  private constructor(
    readonly codes: Uint16Array,
    readonly measured: Uint8Array,
    readonly side: number,
    private readonly full: number,
    private readonly stride: number,
    private readonly place: PlaceData,
  ) {
    this.count = side * side;
  }

  static async decode(base64: string, place: PlaceData, full: number, stride: number): Promise<DepthMap> {
    const side = full / stride;
    const raw = await inflated(bytes(base64));
    const count = FACE_COUNT * side * side;
    const codes = new Uint16Array(count);
    for (let i = 0; i < count; i++) {
      const zigzag = (raw[i] << 8) | raw[count + i];
      codes[i] = (zigzag >> 1) ^ -(zigzag & 1);
    }
    for (let row = 0; row < FACE_COUNT * side; row++) {
      const top = row % side === 0;
      for (let column = 1, i = row * side + 1; column < side; column++, i++) codes[i] += codes[i - 1];
      if (!top) for (let column = 0, i = row * side; column < side; column++, i++) codes[i] += codes[i - side];
    }
    const measured = new Uint8Array(count);
    for (let i = 0; i < count; i++) measured[i] = (raw[2 * count + (i >> 3)] >> (7 - (i & 7))) & 1;
    return new DepthMap(codes, measured, side, full, stride, place);
  }

  depthOf(index: number): number {
    const code = this.codes[index];
    return code === 0 ? 0 : this.place.near * Math.exp((code - 1) * this.place.step);
  }

  // Coordinate on the face's plane at distance 1, -1 to 1, of a column (or, downwards, a row).
  at(column: number): number {
    return (2 * (column * this.stride + 0.5)) / this.full - 1;
  }

  // The face that a direction hits, and its column and row as fractions.
  locate(ray: Vector): { face: number; x: number; y: number; scale: number } {
    let face = 0;
    for (let k = 1; k < FACE_COUNT; k++) if (dot(ray, FACES[k].forward) > dot(ray, FACES[face].forward)) face = k;
    const z = dot(ray, FACES[face].forward);
    const back = (a: number) => (((a + 1) * this.full) / 2 - 0.5) / this.stride;
    return { face, x: back(dot(ray, FACES[face].right) / z), y: back(-dot(ray, FACES[face].up) / z), scale: z };
  }

  // Distance along a unit vector to the surface shown there, filled or not; Infinity where there is none.
  distance(ray: Vector): number {
    const { face, x, y, scale } = this.locate(ray);
    const clamp = (a: number) => Math.min(Math.max(Math.round(a), 0), this.side - 1);
    const z = this.depthOf(face * this.count + clamp(y) * this.side + clamp(x));
    return z === 0 ? Infinity : z / scale;
  }

  // Pixels between the scan's points, at view-space depth z.
  private between(spacing: number, z: number): number {
    return spacing / ((2 / this.full) * this.stride * Math.max(z, 1e-9));
  }

  // Of each pixel of a face 255 where a measured one is so near that a surface can be measured, else 0.  Distances are those of
  // a chamfer (3, 4), at most 6 % from the true ones.
  reaches(face: number, spacing: number): Uint8Array<ArrayBuffer> {
    const { side, count } = this, base = face * count;
    const away = new Uint16Array(count).fill(30000);
    for (let i = 0; i < count; i++) if (this.measured[base + i]) away[i] = 0;
    for (const sign of [1, -1]) {
      for (let step = 0; step < count; step++) {
        const i = sign > 0 ? step : count - 1 - step, column = i % side;
        const beside = i - sign, above = i - sign * side;
        const starts = sign > 0 ? column > 0 : column < side - 1, ends = sign > 0 ? column < side - 1 : column > 0;
        let least = away[i];
        if (starts) least = Math.min(least, away[beside] + 3);
        if (above >= 0 && above < count) {
          least = Math.min(least, away[above] + 3);
          if (starts) least = Math.min(least, away[above - sign] + 4);
          if (ends) least = Math.min(least, away[above + sign] + 4);
        }
        away[i] = least;
      }
    }
    const out = new Uint8Array(count);
    for (let i = 0; i < count; i++) if (away[i] <= 3 * this.snap(this.between(spacing, this.depthOf(base + i)))) out[i] = 255;
    return out;
  }

  // Pixels up to which a measured pixel counts as hit.  wide: pixels between points.
  private snap(wide: number): number {
    return Math.min(Math.max(SNAP * wide, 2.5), this.reach(wide));
  }

  private reach(wide: number): number {
    return Math.round(Math.min(Math.max(SPACINGS * wide, WINDOW[0]), WINDOW[1]));
  }

  ray(face: number, column: number, row: number): Vector {
    const { forward, right, up } = FACES[face];
    const a = this.at(column), b = -this.at(row);
    return [0, 1, 2].map((k) => forward[k] + a * right[k] + b * up[k]) as Vector;
  }

  // The measured surface where a ray meets it; null where nothing was measured near it.
  // pixel: the angle of a pixel on the screen, radians: as far as the pointer can be told.
  //
  // A plane is fitted to the inverse depths around the ray (a plane's are affine in the picture) and met by the ray.
  // Uncertainty (standard): across the ray a screen pixel and a depth pixel, each evenly distributed (GUM 4.3.7);
  // along it the scatter around the plane over the root of the count and half of it, by which a pixel that shows the front one of
  // several points is too near, the front of a slanted pixel, and the coding of depth.
  // spacing: of the scan's points.
  surface(ray: Vector, pixel: number, spacing: number): Surface | null {
    const { face, x, y, scale } = this.locate(ray);
    const base = face * this.count;
    const wide = this.between(spacing, this.distance(ray) * scale), reach = this.reach(wide);
    let nearest = -1, best = this.snap(wide) ** 2;
    const cx = Math.round(x), cy = Math.round(y), side = this.side;
    const inside = (c: number, r: number) => c >= 0 && r >= 0 && c < side && r < side;
    for (let r = cy - reach; r <= cy + reach; r++)
      for (let c = cx - reach; c <= cx + reach; c++) {
        if (!inside(c, r) || !this.measured[base + r * side + c]) continue;
        const away = (c - x) ** 2 + (r - y) ** 2;
        if (away < best) (best = away), (nearest = base + r * side + c);
      }
    if (nearest < 0) return null;
    const start = 1 / this.depthOf(nearest);
    let plane: [number, number, number] = [start, 0, 0];
    let scatter = 0, used = 0;
    for (let pass = 0; pass < 3; pass++) {
      const rows: [number, number, number][] = [];
      const limit = pass === 0 ? 4 * SAME : SAME;
      for (let r = cy - reach; r <= cy + reach; r++)
        for (let c = cx - reach; c <= cx + reach; c++) {
          const index = base + r * side + c;
          if (!inside(c, r) || !this.measured[index]) continue;
          const inverse = 1 / this.depthOf(index);
          if (Math.abs(inverse / (plane[0] + plane[1] * (c - x) + plane[2] * (r - y)) - 1) <= limit) rows.push([c - x, r - y, inverse]);
        }
      used = rows.length;
      if (used < FEWEST) break;
      const fitted = fit(rows);
      if (!fitted) break;
      plane = fitted;
      scatter = Math.sqrt(rows.reduce((sum, [a, b, i]) => sum + (i - plane[0] - plane[1] * a - plane[2] * b) ** 2, 0) / Math.max(used - 3, 1));
    }
    let inverse = plane[0];
    if (used < FEWEST || !(inverse > 0) || Math.abs(inverse / start - 1) > 0.2) {
      // thin things and edges: the measured pixel itself, and the depths beside it are not its own
      inverse = start;
      plane = [start, 0, 0];
      scatter = 0.5 * SAME * start;
      used = 1;
    }
    const z = 1 / inverse, far = z / scale;
    const footprint = (2 / this.full) * this.stride * z;
    const slope = (Math.hypot(plane[1], plane[2]) / inverse) * z; // change of z within a pixel
    const across = Math.hypot((pixel * far) / Math.sqrt(12), footprint / Math.sqrt(12 * Math.max(1, used / 4)));
    const noise = (scatter / inverse) * z; // of one point; a pixel shows the front one of those in it
    const along = Math.hypot(noise / Math.sqrt(used), noise / 2, slope / 2 / Math.sqrt(3), z * this.place.step / 2 / Math.sqrt(3)) / scale;
    return { point: times(ray, far), across, along, ray };
  }
}

// Least squares of i = a + b x + c y.  Null where the points lie in one line.
function fit(rows: [number, number, number][]): [number, number, number] | null {
  let n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0, i = 0, ix = 0, iy = 0;
  for (const [a, b, v] of rows) {
    n++, (x += a), (y += b), (xx += a * a), (xy += a * b), (yy += b * b), (i += v), (ix += v * a), (iy += v * b);
  }
  const mx = x / n, my = y / n;
  const sxx = xx - n * mx * mx, sxy = xy - n * mx * my, syy = yy - n * my * my;
  const six = ix - i * mx, siy = iy - i * my;
  const determinant = sxx * syy - sxy * sxy;
  if (determinant < 1e-6 * n * n) return null;
  const b = (six * syy - siy * sxy) / determinant, c = (siy * sxx - six * sxy) / determinant;
  return [i / n - b * mx - c * my, b, c];
}

// Length of the line between two points in the world, and its expanded uncertainty (k = 2).
export function distanceBetween(a: Vector, sa: Surface, b: Vector, sb: Surface): { value: number; uncertainty: number } {
  const way: Vector = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
  const value = Math.hypot(...way);
  let variance = 0;
  for (const s of [sa, sb]) {
    const share = value > 0 ? (dot(way, s.ray) / value) ** 2 : 0;
    variance += share * s.along ** 2 + (1 - share) * s.across ** 2;
  }
  return { value, uncertainty: 2 * Math.sqrt(variance) };
}
