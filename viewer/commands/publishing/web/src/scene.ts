// What scene.js and the scripts of places hold; written by viewer/commands/publishing/scene_data.py and publication.py.
// Frame: the upright world relative to `origin`, file units, z up; `axes` (columns) turn it back into file coordinates.

export type Vector = [number, number, number];

export interface PlaceData {
  name: string;
  position: Vector;
  floor: number; // height of the floor under it
  yaw: number; // of the first view, degrees counter-clockwise from x
  pitch: number; // of the first view, degrees
  around: boolean; // looks at a thing from outside: one is turned to it on arrival
  plan: number; // index into plans
  near: number; // depth of code 1
  step: number; // of the logarithm of depth between two codes
}

export interface PlanData {
  picture: string; // PNG, base64
  low: [number, number];
  high: [number, number];
  width: number;
  height: number;
}

export interface ViewpointData {
  name: string;
  place: number;
  yaw: number;
  pitch: number;
  fov: number;
  away: number; // distance from the viewpoint to the place
}

export interface NoteData {
  title: string;
  text: string;
  status: string;
  colour: string;
  link: string;
  position: Vector;
  picture: [number, number] | null; // width and height
}

export interface MeasurementData {
  name: string;
  kind: string;
  text: string;
  more: string; // further lines
  label: Vector;
  points: Vector[];
  lines: { points: Vector[]; closed: boolean; helper: boolean }[];
}

export interface SceneData {
  generator: string;
  title: string;
  view: string;
  second: string | null;
  change?: { picture: string; text: string }; // of the second view "change": legend and histogram (PNG), their words
  unit: string;
  metre: number; // units in a metre
  spacing: number; // of the scan's points
  origin: Vector;
  axes: [Vector, Vector, Vector]; // rows of the matrix: file = axes * upright + origin
  side: number;
  small: number;
  stride: number;
  places: PlaceData[];
  plans: PlanData[];
  viewpoints: ViewpointData[];
  notes: NoteData[];
  measurements: MeasurementData[];
}

export interface PartData {
  pictures?: string[]; // WebP, base64, in the order of FACES
  depth?: string;
}

export const FACE_COUNT = 6;
// Forward and up of each face; right = forward x up.  As FACES of cube_faces.py.
export const FACES: { forward: Vector; up: Vector; right: Vector }[] = [
  { forward: [1, 0, 0], up: [0, 0, 1], right: [0, -1, 0] },
  { forward: [-1, 0, 0], up: [0, 0, 1], right: [0, 1, 0] },
  { forward: [0, 1, 0], up: [0, 0, 1], right: [1, 0, 0] },
  { forward: [0, -1, 0], up: [0, 0, 1], right: [-1, 0, 0] },
  { forward: [0, 0, 1], up: [0, -1, 0], right: [1, 0, 0] },
  { forward: [0, 0, -1], up: [0, 1, 0], right: [1, 0, 0] },
];

export const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const minus = (a: Vector, b: Vector): Vector => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const plus = (a: Vector, b: Vector): Vector => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const times = (a: Vector, k: number): Vector => [a[0] * k, a[1] * k, a[2] * k];
export const length = (a: Vector): number => Math.hypot(a[0], a[1], a[2]);

export function inFile(scene: SceneData, p: Vector): Vector {
  return [0, 1, 2].map((row) => scene.origin[row] + dot(scene.axes[row], p)) as Vector;
}

export function direction(yaw: number, pitch: number): Vector {
  return [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
}
