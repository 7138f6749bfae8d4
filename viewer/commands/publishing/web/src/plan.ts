// The plan: walls of the storey one is on, its places, and where one looks.

import type { SceneData } from "./scene";
import type { View } from "./view";

const SVG = "http://www.w3.org/2000/svg";

export class Plan {
  private storey = -1;
  private cone: SVGPathElement | null = null;

  constructor(private readonly view: View, private readonly root: HTMLElement) {
    view.arrived.push(() => this.update());
    view.drawn.push(() => this.aim());
  }

  private on(scene: SceneData, x: number, y: number): [number, number] {
    const { low, high } = scene.plans[this.storey];
    return [(x - low[0]) / (high[0] - low[0]), 1 - (y - low[1]) / (high[1] - low[1])];
  }

  private update(): void {
    const { scene, index } = this.view;
    const storey = scene.places[index].plan;
    if (storey !== this.storey) this.build(storey);
    for (const button of this.root.querySelectorAll<HTMLElement>("[data-place]")) {
      const here = Number(button.dataset.place) === index;
      button.classList.toggle("here", here);
      if (here) button.setAttribute("aria-current", "location");
      else button.removeAttribute("aria-current");
    }
    this.aim();
  }

  private build(storey: number): void {
    this.storey = storey;
    const { scene } = this.view;
    const plan = scene.plans[storey];
    const sheet = document.createElement("div");
    sheet.className = "sheet";
    const ratio = plan.width / plan.height;
    sheet.style.aspectRatio = `${plan.width} / ${plan.height}`;
    if (ratio < 1) sheet.style.width = `${(100 * ratio).toFixed(1)}%`;
    const picture = new Image();
    picture.src = `data:image/png;base64,${plan.picture}`;
    picture.alt = scene.plans.length > 1 ? `Plan, storey ${storey + 1} of ${scene.plans.length}` : "Plan";
    const drawing = document.createElementNS(SVG, "svg");
    drawing.setAttribute("viewBox", `0 0 ${plan.width} ${plan.height}`);
    drawing.setAttribute("aria-hidden", "true");
    this.cone = document.createElementNS(SVG, "path");
    this.cone.setAttribute("class", "cone");
    drawing.append(this.cone);
    sheet.append(picture, drawing);
    scene.places.forEach((place, index) => {
      if (place.plan !== storey) return;
      const button = document.createElement("button");
      button.type = "button";
      button.dataset.place = String(index);
      const [x, y] = this.on(scene, place.position[0], place.position[1]);
      button.style.left = `${(100 * x).toFixed(2)}%`;
      button.style.top = `${(100 * y).toFixed(2)}%`;
      button.title = place.name;
      button.setAttribute("aria-label", `Go to ${place.name}`);
      button.addEventListener("click", () => void this.view.go(index));
      sheet.append(button);
    });
    this.root.replaceChildren(sheet);
    if (scene.plans.length > 1) {
      const bar = document.createElement("div");
      bar.className = "storeys";
      scene.plans.forEach((_, level) => {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = String(level + 1);
        button.setAttribute("aria-label", `Storey ${level + 1}`);
        button.setAttribute("aria-pressed", String(level === storey));
        button.addEventListener("click", () => {
          this.build(level);
          this.aim();
        });
        bar.append(button);
      });
      this.root.append(bar);
    }
  }

  private aim(): void {
    const { scene, index } = this.view;
    if (!this.cone || index < 0) return;
    if (scene.places[index].plan !== this.storey) {
      this.cone.setAttribute("d", "");
      return;
    }
    const { width, height } = scene.plans[this.storey];
    const [x, y] = this.on(scene, this.view.eye[0], this.view.eye[1]);
    const reach = 0.16 * Math.max(width, height);
    const [w, h] = this.view.size;
    const half = Math.atan(Math.tan((this.view.vertical * Math.PI) / 360) * (w / h));
    const at = (angle: number) => `${(x * width + reach * Math.cos(angle)).toFixed(1)} ${(y * height - reach * Math.sin(angle)).toFixed(1)}`;
    const [from, to] = [this.view.yaw + half, this.view.yaw - half];
    this.cone.setAttribute("d", `M ${(x * width).toFixed(1)} ${(y * height).toFixed(1)} L ${at(from)} A ${reach} ${reach} 0 0 1 ${at(to)} Z`);
  }
}
