// Mouse, touch, keys and the sensors of a phone.

import type { View } from "./view";

const CLICK = 5; // CSS pixels that a pointer may move between press and release of a click
const TURN = 1.1; // radians a second, by key
const LINE = 16; // pixels of a line of a wheel

export interface Actions {
  click(x: number, y: number): void;
  hover(x: number, y: number): void;
  ahead(sign: 1 | -1): void;
  key(key: string): boolean;
}

export function listen(view: View, element: HTMLElement, actions: Actions): void {
  const pointers = new Map<number, { x: number; y: number }>();
  let travelled = 0, spread = 0;
  const fresh = () => (spread = distance([...pointers.values()]));

  element.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    element.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (pointers.size === 1) travelled = 0;
    fresh();
  });
  element.addEventListener("pointermove", (event) => {
    const box = element.getBoundingClientRect();
    const before = pointers.get(event.pointerId);
    if (!before) {
      if (event.pointerType === "mouse") actions.hover(event.clientX - box.left, event.clientY - box.top);
      return;
    }
    const dx = event.clientX - before.x, dy = event.clientY - before.y;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    travelled += Math.abs(dx) + Math.abs(dy);
    if (travelled <= CLICK) return;
    const share = view.pixel / pointers.size;
    view.turn(view.yaw + dx * share, view.pitch + dy * share);
    if (pointers.size === 2) {
      const now = distance([...pointers.values()]);
      if (spread > 0 && now > 0) view.turn(view.yaw, view.pitch, view.fov * (spread / now));
      spread = now;
    }
  });
  const up = (event: PointerEvent) => {
    const known = pointers.delete(event.pointerId);
    fresh();
    const box = element.getBoundingClientRect();
    if (known && event.type === "pointerup" && travelled <= CLICK && pointers.size === 0)
      actions.click(event.clientX - box.left, event.clientY - box.top);
  };
  element.addEventListener("pointerup", up);
  element.addEventListener("pointercancel", up);
  element.addEventListener("wheel", (event) => {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? LINE : 1);
    view.turn(view.yaw, view.pitch, view.fov * Math.exp(0.0012 * pixels));
  }, { passive: false });

  const held = new Set<string>();
  const steer = () => {
    const on = (key: string) => (held.has(key) ? 1 : 0);
    const zoom = Math.min(view.fov / 75, 1);
    view.speed = [TURN * zoom * (on("ArrowLeft") - on("ArrowRight")), TURN * zoom * (on("PageUp") - on("PageDown"))];
    view.redraw();
  };
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const target = event.target as HTMLElement;
    const inControl = target.closest("button, a, input, summary, [role=slider]") !== null;
    if (["ArrowLeft", "ArrowRight", "PageUp", "PageDown"].includes(event.key) && !inControl) held.add(event.key), steer();
    else if (event.key === "ArrowUp" && !inControl) actions.ahead(1);
    else if (event.key === "ArrowDown" && !inControl) actions.ahead(-1);
    else if ("+=".includes(event.key)) view.turn(view.yaw, view.pitch, view.fov / 1.15);
    else if (event.key === "-") view.turn(view.yaw, view.pitch, view.fov * 1.15);
    else if ((event.key === "Enter" || event.key === " ") && inControl) return;
    else if (!actions.key(event.key)) return;
    event.preventDefault();
  });
  window.addEventListener("keyup", (event) => {
    if (held.delete(event.key)) steer();
  });
  window.addEventListener("blur", () => {
    held.clear();
    steer();
  });
}

function distance(points: { x: number; y: number }[]): number {
  return points.length === 2 ? Math.hypot(points[0].x - points[1].x, points[0].y - points[1].y) : 0;
}

interface Asking {
  requestPermission?: () => Promise<"granted" | "denied">;
}

// Turns the view with the phone.  Returns what stops it; null where there is no sensor or it is not allowed.
export async function followPhone(view: View): Promise<(() => void) | null> {
  const asking = window.DeviceOrientationEvent as (typeof DeviceOrientationEvent & Asking) | undefined;
  if (!asking) return null;
  if (asking.requestPermission && (await asking.requestPermission().catch(() => "denied")) !== "granted") return null;
  let start: number | null = null, before = 0;
  return new Promise((resolve) => {
    const timer = window.setTimeout(() => (stop(), resolve(null)), 1000);
    const turn = (event: DeviceOrientationEvent) => {
      if (event.alpha === null || event.beta === null || event.gamma === null) return;
      const [yaw, pitch] = lookOf(event.alpha, event.beta, event.gamma);
      if (start === null) {
        start = view.yaw - yaw;
        before = yaw;
        window.clearTimeout(timer);
        resolve(stop);
      }
      view.turn(view.yaw + Math.atan2(Math.sin(yaw - before), Math.cos(yaw - before)), pitch);
      before = yaw;
    };
    const stop = () => window.removeEventListener("deviceorientation", turn);
    window.addEventListener("deviceorientation", turn);
  });
}

// Heading (counter-clockwise) and pitch of the direction behind the screen.  W3C Device Orientation, Z-X'-Y'' angles, degrees.
export function lookOf(alpha: number, beta: number, gamma: number): [number, number] {
  const [a, b, c] = [alpha, beta, gamma].map((angle) => (angle * Math.PI) / 180);
  // minus the third column of Rz(alpha) Rx(beta) Ry(gamma)
  const x = -(Math.cos(a) * Math.sin(c) + Math.sin(a) * Math.sin(b) * Math.cos(c));
  const y = -(Math.sin(a) * Math.sin(c) - Math.cos(a) * Math.sin(b) * Math.cos(c));
  const z = -(Math.cos(b) * Math.cos(c));
  return [Math.atan2(y, x), Math.asin(Math.min(Math.max(z, -1), 1))];
}
