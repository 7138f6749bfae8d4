// Lines over the picture: distances measured here and the measurements of the project.  Each drawing keeps its elements from one
// picture to the next; only the coordinates in them change.

import type { Vector } from "./scene";
import type { View } from "./view";

const SVG = "http://www.w3.org/2000/svg";
const SHORT = 190; // CSS pixels of a line across which its label, 150 wide, would hide it
const CLEAR = 12; // and between it and a label above it
const NEAR = 0.02; // metres before the eye at which lines are cut

export interface Polyline {
  points: Vector[];
  closed: boolean;
  helper: boolean; // explains a value, and is no measured thing
}

export interface Drawing {
  lines: Polyline[];
  points: Vector[];
  label: Vector | null;
  text: string;
}

// under and over of lines, helpers and points: dark around light, so that each is seen on any picture.
const KINDS = ["under", "helper", "over", "dots-under", "dots-over"] as const;

class Elements {
  readonly paths = Object.fromEntries(KINDS.map((kind) => {
    const path = document.createElementNS(SVG, "path");
    path.setAttribute("class", kind);
    return [kind, path];
  })) as Record<(typeof KINDS)[number], SVGPathElement>;
  readonly label = document.createElement("span");

  constructor(readonly kind: string) {
    this.label.className = `length ${kind}`;
  }

  remove(): void {
    for (const path of Object.values(this.paths)) path.remove();
    this.label.remove();
  }
}

export class Lines {
  private readonly svg = document.createElementNS(SVG, "svg");
  private readonly labels = document.createElement("div");
  private readonly drawn = new Map<Drawing, Elements>();

  constructor(private readonly view: View, root: HTMLElement) {
    this.svg.setAttribute("class", "lines");
    this.svg.setAttribute("aria-hidden", "true");
    this.labels.setAttribute("aria-hidden", "true"); // the list says the same in text
    root.append(this.svg, this.labels);
  }

  // kind: class of the elements.
  draw(drawings: Map<Drawing, string>): void {
    for (const [drawing, elements] of this.drawn)
      if (drawings.get(drawing) !== elements.kind) elements.remove(), this.drawn.delete(drawing);
    for (const [drawing, kind] of drawings) {
      let elements = this.drawn.get(drawing);
      if (!elements) {
        elements = new Elements(kind);
        for (const path of Object.values(elements.paths)) path.classList.add(kind), this.svg.append(path);
        this.labels.append(elements.label);
        this.drawn.set(drawing, elements);
      }
      this.place(drawing, elements);
    }
  }

  private place(drawing: Drawing, { paths, label }: Elements): void {
    const solid = drawing.lines.filter(({ helper }) => !helper).map((line) => this.path(line)).join("");
    paths.under.setAttribute("d", solid);
    paths.over.setAttribute("d", solid);
    paths.helper.setAttribute("d", drawing.lines.filter(({ helper }) => helper).map((line) => this.path(line)).join(""));
    const dots = drawing.points.map((point) => {
      const on = this.view.project(point);
      return on ? `M${on.x.toFixed(1)} ${on.y.toFixed(1)}h0` : "";
    }).join("");
    paths["dots-under"].setAttribute("d", dots);
    paths["dots-over"].setAttribute("d", dots);
    const on = drawing.label && this.labelAt(drawing);
    const [width, height] = this.view.size;
    const shown = drawing.text !== "" && on !== null && on.x > -200 && on.x < width + 200 && on.y > -50 && on.y < height + 50;
    label.hidden = !shown;
    if (!on || !shown) return;
    if (label.textContent !== drawing.text) label.textContent = drawing.text;
    label.style.transform = `translate(${on.x.toFixed(1)}px, ${on.y.toFixed(1)}px) translate(-50%, ${on.above ? "-100%" : "-50%"})`;
  }

  // Where the label of a drawing stands: on it, or above one that it would hide.
  private labelAt({ label, points }: Drawing): { x: number; y: number; above: boolean } | null {
    const on = label && this.view.project(label), ends = points.map((point) => this.view.project(point));
    if (!on || ends.length < 2 || ends.some((end) => end === null)) return on && { x: on.x, y: on.y, above: false };
    const [xs, ys] = [ends.map((end) => end!.x), ends.map((end) => end!.y)];
    const above = Math.hypot(Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys)) < SHORT;
    return { x: on.x, y: above ? Math.min(...ys) - CLEAR : on.y, above };
  }

  // The part of a line that lies before the eye.
  private path({ points, closed }: Polyline): string {
    const { view } = this, near = NEAR * view.scene.metre;
    const seen = points.map((point) => view.before(point));
    let out = "", last = "";
    for (let i = closed ? 0 : 1; i < seen.length; i++) {
      let a = seen[(i || seen.length) - 1], b = seen[i];
      if (a[2] < near && b[2] < near) continue;
      const cut = (p: Vector, q: Vector): Vector => {
        const t = (near - p[2]) / (q[2] - p[2]);
        return [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), near];
      };
      if (a[2] < near) a = cut(a, b);
      else if (b[2] < near) b = cut(b, a);
      const [from, to] = [a, b].map((p) => view.onto(p)).map(({ x, y }) => `${x.toFixed(1)} ${y.toFixed(1)}`);
      out += from === last ? `L${to}` : `M${from}L${to}`;
      last = to;
    }
    return out;
  }
}
