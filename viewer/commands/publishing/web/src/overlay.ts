// What is drawn over the picture: the places one can go to, notes, and measured lines.  Elements of the page, so that keys and
// screen readers reach them.

import { type Drawing, Lines } from "./lines";
import type { Measurement } from "./measure";
import { NoteMarks } from "./note-marks";
import { length, type MeasurementData, minus, type Vector } from "./scene";
import { far } from "./text";
import type { View } from "./view";

const MOST = 8; // places that are offered at once

interface Mark {
  element: HTMLElement;
  point: Vector;
}

export class Overlay {
  private hops: Mark[] = [];
  private readonly lines: Lines;
  private readonly notes: NoteMarks;
  private inSight: MeasurementData[] = [];
  shown = true; // the project's measurements

  constructor(
    private readonly view: View,
    private readonly root: HTMLElement,
    private readonly measurements: () => Measurement[],
    openNote: (index: number) => void,
  ) {
    this.lines = new Lines(view, root);
    this.notes = new NoteMarks(view, root, openNote);
    view.arrived.push(() => (this.offer(), this.choose()));
    view.drawn.push(() => this.place());
  }

  // Offers the places in sight, the nearest first; where none is, the nearest one.
  private offer(): void {
    for (const { element } of this.hops) element.remove();
    const { scene } = this.view;
    const here = this.view.index;
    const others = scene.places
      .map((place, index) => ({ place, index, away: length(minus(place.position, this.view.eye)) }))
      .filter(({ index }) => index !== here)
      .sort((a, b) => a.away - b.away);
    const seen = others.filter(({ place }) => {
      const [x, y, z] = place.position;
      return [0.15, 0.45, 0.75].some((share) => this.view.sees([x, y, z - share * (z - place.floor)]));
    });
    this.hops = (seen.length ? seen.slice(0, MOST) : others.slice(0, 1)).map(({ place, index, away }) => {
      const button = document.createElement("button");
      button.className = "hop";
      button.type = "button";
      button.setAttribute("aria-label", `Go to ${place.name}, ${far(scene, away)} away`);
      const ring = document.createElement("i");
      const name = document.createElement("span");
      name.textContent = `${place.name} · ${far(scene, away)}`;
      button.append(ring, name);
      button.addEventListener("click", () => void this.view.go(index));
      this.root.prepend(button);
      return { element: button, point: [place.position[0], place.position[1], place.floor] as Vector };
    });
  }

  private place(): void {
    const { view } = this;
    const [width, height] = view.size;
    for (const { element, point } of this.hops) {
      const on = view.going ? null : view.project(point);
      const shown = on !== null && on.x > -60 && on.x < width + 60 && on.y > -40 && on.y < height + 40;
      element.hidden = !shown;
      if (!on || !shown) continue;
      const away = length(minus(point, view.eye));
      const flat = Math.max(Math.abs(point[2] - view.eye[2]) / away, 0.18); // a ring on the floor, seen at this slant
      const size = Math.min(Math.max((0.36 * view.scene.metre) / on.depth / view.pixel, 11), 90);
      element.style.transform = `translate(${on.x.toFixed(1)}px, ${on.y.toFixed(1)}px)`;
      const ring = element.firstElementChild as HTMLElement;
      const shape = `${Math.round(2 * size)}px ${Math.round(2 * size * flat)}px`;
      if (ring.dataset.shape === shape) continue; // a new size costs a layout
      ring.dataset.shape = shape;
      [ring.style.width, ring.style.height] = shape.split(" ");
    }
    this.notes.place();
    this.drawLines();
  }

  // Of the project's measurements those of which something is in sight from here.
  private choose(): void {
    this.inSight = this.view.scene.measurements.filter(({ label, points }) => [label, ...points].some((point) => this.view.sees(point)));
  }

  private drawLines(): void {
    const drawings = new Map<Drawing, string>();
    if (this.shown) for (const made of this.inSight) drawings.set(made, "project");
    for (const made of this.measurements()) drawings.set(made.drawing, "own");
    this.lines.draw(drawings);
  }
}
