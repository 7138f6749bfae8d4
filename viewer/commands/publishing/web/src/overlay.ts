// What is drawn over the picture: the places one can go to, notes, and measured lines.  Elements of the page, so that keys and
// screen readers reach them.

import type { Measurement } from "./measure";
import { length, minus, type Vector } from "./scene";
import { far } from "./text";
import type { View } from "./view";

const MOST = 8; // places that are offered at once
const SVG = "http://www.w3.org/2000/svg";

interface Mark {
  element: HTMLElement;
  point: Vector;
}

export class Overlay {
  private hops: Mark[] = [];
  private notes: Mark[] = [];
  private readonly lines: SVGSVGElement;
  private readonly labels: HTMLElement;

  constructor(
    private readonly view: View,
    private readonly root: HTMLElement,
    private readonly measurements: () => Measurement[],
    private readonly openNote: (index: number) => void,
  ) {
    this.lines = document.createElementNS(SVG, "svg");
    this.lines.setAttribute("class", "lines");
    this.lines.setAttribute("aria-hidden", "true");
    this.labels = document.createElement("div");
    root.append(this.lines, this.labels);
    view.scene.notes.forEach((note, index) => {
      const button = document.createElement("button");
      button.className = "note";
      button.type = "button";
      const dot = document.createElement("i");
      dot.style.background = note.colour;
      const name = document.createElement("span");
      name.textContent = note.title;
      button.append(dot, name);
      button.setAttribute("aria-label", `Note: ${note.title} (${note.status})`);
      button.addEventListener("click", () => this.openNote(index));
      root.append(button);
      this.notes.push({ element: button, point: note.position });
    });
    view.arrived.push(() => this.offer());
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
    for (const { element, point } of this.notes) {
      const on = view.going || !view.place ? null : view.project(point);
      const shown = on !== null && on.x > 0 && on.x < width && on.y > 0 && on.y < height && view.sees(point);
      element.hidden = !shown;
      if (on && shown) element.style.transform = `translate(${on.x.toFixed(1)}px, ${on.y.toFixed(1)}px)`;
    }
    this.drawLines();
  }

  private drawLines(): void {
    const { view } = this;
    const all = this.measurements();
    if (all.length === 0 && !this.lines.firstChild) return;
    this.lines.replaceChildren();
    this.labels.replaceChildren();
    for (const made of all) {
      const ends = made.points.map((point) => view.project(point.place));
      for (const end of ends) {
        if (!end) continue;
        const mark = document.createElementNS(SVG, "circle");
        mark.setAttribute("cx", end.x.toFixed(1));
        mark.setAttribute("cy", end.y.toFixed(1));
        mark.setAttribute("r", "5");
        this.lines.append(mark);
      }
      const [a, b] = this.clipped(made);
      if (!a || !b) continue;
      for (const kind of ["over", "under"]) {
        const line = document.createElementNS(SVG, "line");
        line.setAttribute("class", kind);
        line.setAttribute("x1", a.x.toFixed(1));
        line.setAttribute("y1", a.y.toFixed(1));
        line.setAttribute("x2", b.x.toFixed(1));
        line.setAttribute("y2", b.y.toFixed(1));
        this.lines.prepend(line);
      }
      const label = document.createElement("span");
      label.className = "length";
      label.textContent = made.text;
      label.style.transform = `translate(${((a.x + b.x) / 2).toFixed(1)}px, ${((a.y + b.y) / 2).toFixed(1)}px) translate(-50%, -50%)`;
      this.labels.append(label);
    }
  }

  // The ends of a line, as far as it lies in front of the camera.
  private clipped(made: Measurement) {
    if (made.points.length < 2) return [null, null];
    const [p, q] = made.points.map((point) => point.place);
    const mix = (t: number): Vector => [0, 1, 2].map((k) => p[k] + t * (q[k] - p[k])) as Vector;
    let from = 0, to = 1;
    for (let i = 0; i < 32 && !this.view.project(mix(from)) && from < 1; i++) from += 1 / 32;
    for (let i = 0; i < 32 && !this.view.project(mix(to)) && to > 0; i++) to -= 1 / 32;
    return from < to ? [this.view.project(mix(from)), this.view.project(mix(to))] : [null, null];
  }
}
