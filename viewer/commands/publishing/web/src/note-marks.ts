// The notes over the picture: a dot at its place, its title at the right or left of it, so that no title lies over another
// note.  The nearest notes have their titles first; one without room shows it when it is pointed at.

import { length, minus } from "./scene";
import type { View } from "./view";

const DOT = 13; // CSS pixels from the place to the ends of its dot, as in page.css
const SIDES = ["right", "left"] as const;
type Side = (typeof SIDES)[number];

interface Mark {
  element: HTMLElement;
  width: number; // of the whole, CSS pixels
  side: Side | undefined; // where its title was in the last picture
}

interface Box {
  left: number;
  right: number;
  y: number;
}

export class NoteMarks {
  private readonly marks: Mark[];
  private measured = ""; // the size of the picture for which the widths are known

  constructor(private readonly view: View, root: HTMLElement, open: (index: number) => void) {
    this.marks = view.scene.notes.map((note, index) => {
      const button = document.createElement("button");
      button.className = "note";
      button.type = "button";
      const dot = document.createElement("i");
      dot.style.background = note.colour;
      const name = document.createElement("span");
      name.textContent = note.title;
      button.append(dot, name);
      button.setAttribute("aria-label", `Note: ${note.title} (${note.status})`);
      button.addEventListener("click", () => open(index));
      root.append(button);
      return { element: button, width: 0, side: "right" };
    });
  }

  place(): void {
    const { view } = this;
    const [width, height] = view.size;
    if (this.measured !== view.size.join()) this.measure();
    const seen: { mark: Mark; x: number; y: number; away: number }[] = [];
    this.marks.forEach((mark, index) => {
      const point = view.scene.notes[index].position;
      const on = view.going || !view.place ? null : view.project(point);
      const shown = on !== null && on.x > 0 && on.x < width && on.y > 0 && on.y < height && view.sees(point);
      mark.element.hidden = !shown;
      if (on && shown) seen.push({ mark, x: on.x, y: on.y, away: length(minus(point, view.eye)) });
    });
    seen.sort((a, b) => a.away - b.away);
    const dots: Box[] = seen.map(({ x, y }) => ({ left: x - DOT, right: x + DOT, y }));
    const titles: Box[] = [];
    for (const { mark, x, y } of seen) {
      const boxes = { right: { left: x - DOT, right: x - DOT + mark.width, y }, left: { left: x + DOT - mark.width, right: x + DOT, y } };
      const free: (Side | undefined)[] = SIDES.filter((side) => {
        const box = boxes[side];
        if (box.left < 0 || box.right > width) return false;
        return !titles.some((other) => over(box, other)) && !dots.some((dot) => over(box, dot) && Math.hypot(dot.left + DOT - x, dot.y - y) > DOT);
      });
      const side = free.includes(mark.side) ? mark.side : free[0];
      if (side) titles.push(boxes[side]);
      if (side !== mark.side) {
        mark.side = side;
        mark.element.classList.toggle("left", side === "left");
        mark.element.classList.toggle("bare", !side);
      }
      mark.element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
  }

  private measure(): void {
    this.measured = this.view.size.join();
    for (const mark of this.marks) {
      mark.side = "right";
      mark.element.hidden = false;
      mark.element.classList.remove("bare", "left");
    }
    for (const mark of this.marks) mark.width = mark.element.offsetWidth;
  }
}

function over(a: Box, b: Box): boolean {
  return Math.abs(a.y - b.y) < 2 * DOT && a.left < b.right && b.left < a.right;
}
