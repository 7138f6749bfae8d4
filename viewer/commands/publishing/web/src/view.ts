// Where one stands and looks, and how that is drawn: on demand, and step by step while something moves.

import type { DepthMap } from "./depth";
import { LoadError } from "./loader";
import { Panorama } from "./panorama";
import { direction, plus, times, type SceneData, type Vector } from "./scene";
import type { LoadedPlace, Visits } from "./visit";

export const HOP = 300; // milliseconds
const SLOW = 36; // milliseconds of a picture above which there are fewer pixels, below half of which more
const STILL = 150; // milliseconds without a picture after which what is loaded ahead disturbs nobody
const UPLOAD = 400; // milliseconds that a texture waits for that, at most
const PICTURES = 5; // whose mean counts
const COARSEST = 0.5; // fewer pixels gain little: the browser puts the page together at full size (software WebGL, 1280x720)
const REST = 200; // milliseconds without a picture that count as rest
const HIDDEN = 5000; // milliseconds that no picture takes: the page was not shown
const FREE = 0.93; // share of the distance that must be free between two places for one to walk, not fade, from one to the other
const STEEPEST = (88 * Math.PI) / 180;
export const NARROWEST = 25, WIDEST = 100; // degrees, of the shorter side of the window

export class View {
  yaw = 0; // radians, counter-clockwise from x
  pitch = 0;
  fov = 75; // degrees, from edge to edge of the shorter side
  place!: LoadedPlace;
  second = -1; // share of the width up to which the second view is shown; -1: none
  tint = 0;
  speed: [number, number] = [0, 0]; // radians a second, of yaw and pitch
  eye: Vector = [0, 0, 0];
  ready = false;
  going = false;
  hopTime = 0; // milliseconds from the request to the last step of the last hop
  private asked = false;
  private coarse = 1; // share of the pixels a side, while something moves; learnt from how long pictures take
  private sharp = true;
  private slow: number[] = [];
  private rest = 0;
  private last = 0;
  private hop: { start: number; from: Vector; to: Vector; walked: boolean; turn: [number, number] | null; turned: number } | null = null;
  readonly drawn: (() => void)[] = [];
  readonly arrived: (() => void)[] = [];
  readonly calm = window.matchMedia("(prefers-reduced-motion: reduce)");

  constructor(readonly scene: SceneData, readonly panorama: Panorama, readonly visits: Visits) {
    visits.changed = (place) => {
      if (place === this.place && !this.hop) this.panorama.stand(place.textures, this.position(place.index));
      this.redraw();
    };
    visits.upload = (textures) => panorama.upload(textures, () => this.stillness(UPLOAD));
    if (/swiftshader|llvmpipe|softpipe|basic render/i.test(panorama.software)) this.coarse = COARSEST; // learnt before it is seen
    new ResizeObserver(() => this.resize()).observe(panorama.canvas.parentElement!);
    this.resize();
  }

  position(index: number): Vector {
    return this.scene.places[index].position;
  }

  get index(): number {
    return this.place?.index ?? -1;
  }

  get size(): [number, number] {
    const box = this.panorama.canvas.parentElement!;
    return [Math.max(box.clientWidth, 1), Math.max(box.clientHeight, 1)];
  }

  // Degrees from the top edge to the bottom edge.
  get vertical(): number {
    const [width, height] = this.size;
    if (width >= height) return this.fov;
    return (2 * Math.atan((Math.tan((this.fov * Math.PI) / 360) * height) / width) * 180) / Math.PI;
  }

  // Radians of a pixel in the middle of the window.
  get pixel(): number {
    return (2 * Math.tan((this.vertical * Math.PI) / 360)) / this.size[1];
  }

  turn(yaw: number, pitch: number, fov = this.fov): void {
    this.yaw = yaw;
    this.pitch = Math.min(Math.max(pitch, -STEEPEST), STEEPEST);
    this.fov = Math.min(Math.max(fov, NARROWEST), WIDEST);
    this.redraw();
  }

  private resize(): void {
    const [width, height] = this.size;
    this.panorama.resize(width, height, Math.min(window.devicePixelRatio || 1, 2) * (this.sharp ? 1 : this.coarse));
    this.redraw();
  }

  // Fewer pixels while something moves on a device that is too slow, all of them at rest.  elapsed: milliseconds from the
  // beginning of a picture until the browser could begin another one.
  private pace(elapsed: number): void {
    window.clearTimeout(this.rest);
    this.rest = window.setTimeout(() => {
      if (!this.sharp) (this.sharp = true), this.resize();
    }, REST);
    if (!this.asked || elapsed > HIDDEN) return; // a single picture, or a page that was not shown
    this.slow.push(elapsed);
    if (this.slow.length >= PICTURES) {
      const mean = this.slow.reduce((a, b) => a + b) / this.slow.length;
      this.slow = [];
      if (mean > SLOW) this.coarse = Math.max(this.coarse * 0.7, COARSEST);
      else if (mean < SLOW / 2) this.coarse = Math.min(this.coarse * 1.2, 1);
      else return;
      this.sharp = this.coarse === 1;
      this.resize();
    } else if (this.sharp && this.coarse < 1) (this.sharp = false), this.resize();
  }

  redraw(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame((now) => this.step(now));
  }

  // Goes to a place; `look` as of turn, once there.
  async go(index: number, look?: { yaw: number; pitch: number; fov: number }): Promise<void> {
    if (this.going || !this.scene.places[index]) return;
    const asked = performance.now();
    this.going = true;
    try {
      const next = await this.visits.get(index);
      const before = this.place;
      const { around, yaw, pitch } = this.scene.places[index];
      if (before && around) look ??= { yaw: (yaw * Math.PI) / 180, pitch: (pitch * Math.PI) / 180, fov: this.fov };
      if (before && before !== next && !this.calm.matches) await this.move(before, next, around && look ? look : null);
      this.place = next;
      this.eye = this.position(index);
      this.panorama.stand(next.textures, this.eye);
      if (look) this.turn(look.yaw, look.pitch, look.fov);
      this.ready = true;
      this.hopTime = performance.now() - asked;
      this.redraw();
      for (const tell of this.arrived) tell();
    } catch (error) {
      if (!this.ready || !(error instanceof LoadError)) throw error;
      this.failed(error); // one stays where one is, and may ask again
    } finally {
      this.going = false;
    }
    void this.visits.trim(index);
  }

  // Is told of data that were asked for and cannot be loaded.
  failed: (error: LoadError) => void = () => undefined;

  // Whether such data came.
  async loaded(part: Promise<void>): Promise<boolean> {
    try {
      await part;
      return true;
    } catch (error) {
      if (!(error instanceof LoadError)) throw error;
      this.failed(error);
      return false;
    }
  }

  private done: (() => void) | null = null;

  // look: what one is turned to on the way, by the shorter turn.
  private move(from: LoadedPlace, to: LoadedPlace, look: { yaw: number; pitch: number } | null): Promise<void> {
    const start = this.position(from.index), end = this.position(to.index);
    const way: Vector = [end[0] - start[0], end[1] - start[1], end[2] - start[2]], far = Math.hypot(...way);
    const free = (depth: DepthMap, sign: number) => far < 1e-6 || depth.distance(times(way, sign / far)) >= FREE * far;
    const walked = free(from.depth, 1) || free(to.depth, -1);
    if (walked) this.panorama.begin(from.textures, from.depth, start, to.textures, to.depth, end);
    else this.panorama.beginFade(from.textures, to.textures);
    const around = look && Math.atan2(Math.sin(look.yaw - this.yaw), Math.cos(look.yaw - this.yaw));
    this.hop = { start: performance.now(), from: start, to: end, walked, turn: look && [around!, look.pitch - this.pitch], turned: 0 };
    if (this.sharp && this.coarse < 1) (this.sharp = false), this.resize(); // its first picture is the dearest of all
    this.redraw();
    return new Promise((resolve) => (this.done = resolve));
  }

  private step(now: number): void {
    this.asked = false;
    let opacity = 0;
    const elapsed = Math.min((now - this.last) / 1000, 0.1);
    window.clearTimeout(this.rest); // the last picture may take longer than what counts as rest
    requestAnimationFrame((next) => this.pace(next - now));
    this.last = now;
    if (this.speed[0] || this.speed[1]) {
      this.turn(this.yaw + elapsed * this.speed[0], this.pitch + elapsed * this.speed[1]);
    }
    if (this.hop) {
      const t = Math.min((performance.now() - this.hop.start) / HOP, 1);
      const eased = t * t * (3 - 2 * t);
      this.eye = plus(times(this.hop.from, 1 - eased), times(this.hop.to, eased));
      if (this.hop.turn) {
        const [yaw, pitch] = times([...this.hop.turn, 0], eased - this.hop.turned);
        this.turn(this.yaw + yaw, this.pitch + pitch);
        this.hop.turned = eased;
      }
      const s = this.hop.walked ? Math.min(Math.max((eased - 0.2) / 0.6, 0), 1) : t;
      opacity = 1 - s * s * (3 - 2 * s);
      if (t >= 1) {
        this.hop = null;
        this.done?.();
        this.done = null;
      } else this.redraw();
    }
    if (!this.place && !this.hop) return;
    this.panorama.aim(this.eye, direction(this.yaw, this.pitch), this.vertical);
    const canvas = this.panorama.canvas;
    this.panorama.draw(this.second < 0 ? -1 : this.second * canvas.width, this.tint, opacity);
    for (const tell of this.drawn) tell();
  }

  private warmed = false;

  // Prepares the first hop, once.
  warm(): void {
    if (this.warmed || this.going) return;
    this.warmed = true;
    this.panorama.warm(this.place.textures, this.place.depth, this.position(this.index));
    this.redraw();
  }

  // Resolves once nothing moves, or after so many milliseconds.
  async stillness(longest: number): Promise<void> {
    const end = performance.now() + longest;
    while (performance.now() - this.last < STILL && performance.now() < end) await new Promise((done) => window.setTimeout(done, 50));
  }

  get moving(): boolean {
    return this.hop !== null;
  }

  // The ray through a position in the window, CSS pixels from its upper left corner.
  ray(x: number, y: number): Vector {
    const [width, height] = this.size;
    const tall = Math.tan((this.vertical * Math.PI) / 360);
    const forward = direction(this.yaw, this.pitch);
    const right: Vector = [Math.sin(this.yaw), -Math.cos(this.yaw), 0];
    const up: Vector = direction(this.yaw, this.pitch + Math.PI / 2);
    const a = ((2 * x) / width - 1) * tall * (width / height), b = (1 - (2 * y) / height) * tall;
    const out = plus(forward, plus(times(right, a), times(up, b)));
    return times(out, 1 / Math.hypot(...out));
  }

  // A point of the world seen from the eye: to the right, upwards, and its depth along the axis of view.
  before(point: Vector): Vector {
    const away: Vector = [point[0] - this.eye[0], point[1] - this.eye[1], point[2] - this.eye[2]];
    const on = (v: Vector) => away[0] * v[0] + away[1] * v[1] + away[2] * v[2];
    return [on([Math.sin(this.yaw), -Math.cos(this.yaw), 0]), on(direction(this.yaw, this.pitch + Math.PI / 2)),
      on(direction(this.yaw, this.pitch))];
  }

  // Where such a point, before the eye, appears: CSS pixels.
  onto([right, up, depth]: Vector): { x: number; y: number; depth: number } {
    const [width, height] = this.size;
    const scale = height / 2 / Math.tan((this.vertical * Math.PI) / 360) / depth;
    return { x: width / 2 + scale * right, y: height / 2 - scale * up, depth };
  }

  // Where a point of the world appears; null behind the camera.
  project(point: Vector): { x: number; y: number; depth: number } | null {
    const seen = this.before(point);
    return seen[2] <= 1e-6 ? null : this.onto(seen);
  }

  // Whether nothing stands between the eye and a point.
  sees(point: Vector, slack = 0.93): boolean {
    const away: Vector = [point[0] - this.eye[0], point[1] - this.eye[1], point[2] - this.eye[2]];
    const far = Math.hypot(...away);
    return far < 1e-6 || this.place.depth.distance(times(away, 1 / far)) >= slack * far;
  }
}
