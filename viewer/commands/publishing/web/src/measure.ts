// Distances between measured surfaces.  What was filled in cannot be measured, and says so.

import { distanceBetween, type Surface } from "./depth";
import type { Drawing } from "./lines";
import { inFile, plus, times, type Vector } from "./scene";
import { withUncertainty } from "./text";
import type { View } from "./view";

export interface MeasuredPoint {
  place: Vector; // in the world
  surface: Surface; // from where it was measured
}

export interface Measurement {
  points: MeasuredPoint[];
  text: string;
  parts: string;
  value: number;
  uncertainty: number;
  drawing: Drawing;
}

export const REFUSED = "Nothing was measured there: that surface is filled in. Choose a place that was measured.";

export class Measuring {
  on = false;
  readonly made: Measurement[] = [];

  // say: tells a person.  changed: the list is another.
  constructor(private readonly view: View, private readonly say: (text: string) => void, private readonly changed: () => void) {}

  async turn(on: boolean): Promise<void> {
    this.on = on;
    if (!on && this.made.at(-1)?.points.length === 1) this.made.pop();
    this.changed();
    if (!on) return;
    this.say("Click two measured places.");
    await this.view.loaded(this.view.visits.finest(this.view.place));
  }

  // The measured point at a position in the window, CSS pixels; null where nothing was measured.
  at(x: number, y: number): MeasuredPoint | null {
    const surface = this.view.place.depth.surface(this.view.ray(x, y), this.view.pixel, this.view.scene.spacing);
    return surface && { place: plus(this.view.position(this.view.index), surface.point), surface };
  }

  async click(x: number, y: number): Promise<void> {
    if (!(await this.view.loaded(this.view.visits.finest(this.view.place)))) return;
    const point = this.at(x, y);
    if (!point) {
      this.say(REFUSED);
      return;
    }
    const { scene } = this.view;
    const begun = this.made.at(-1);
    if (begun?.points.length === 1) {
      begun.points.push(point);
      const [a, b] = begun.points;
      const { value, uncertainty } = distanceBetween(a.place, a.surface, b.place, b.surface);
      begun.value = value;
      begun.uncertainty = uncertainty;
      begun.text = withUncertainty(value, uncertainty, scene.unit);
      const flat = Math.hypot(b.place[0] - a.place[0], b.place[1] - a.place[1]);
      const rise = b.place[2] - a.place[2];
      begun.parts = `horizontal ${withUncertainty(flat, uncertainty, scene.unit)}, vertical ${withUncertainty(Math.abs(rise), uncertainty, scene.unit)}`;
      begun.drawing = {
        lines: [{ points: [a.place, b.place], closed: false, helper: false }], points: [a.place, b.place],
        label: times(plus(a.place, b.place), 0.5), text: begun.text,
      };
      this.say(`${begun.text}; ${begun.parts}`);
    } else {
      const drawing = { lines: [], points: [point.place], label: null, text: "" };
      this.made.push({ points: [point], text: "", parts: "", value: 0, uncertainty: 0, drawing });
      const at = inFile(scene, point.place).map((value) => value.toFixed(3));
      this.say(`First point: x ${at[0]}, y ${at[1]}, z ${at[2]}. Click the second one.`);
    }
    this.changed();
  }

  remove(index: number): void {
    this.made.splice(index, 1);
    this.changed();
  }
}
