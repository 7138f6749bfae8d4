// Loads data by <script>: a page that was opened as a file may neither fetch nor read the pixels of files beside it.

import type { PartData, SceneData } from "./scene";

type Receiver = (key: string, value: unknown) => void;
const waiting = new Map<string, (value: unknown) => void>();
const early = new Map<string, unknown>();

(window as unknown as { POINTGLASS: Receiver }).POINTGLASS = (key, value) => {
  const receive = waiting.get(key);
  waiting.delete(key);
  if (receive) receive(value);
  else early.set(key, value);
};

export class LoadError extends Error {}

function load<T>(key: string, address: string): Promise<T> {
  if (early.has(key)) {
    const value = early.get(key) as T;
    early.delete(key);
    return Promise.resolve(value);
  }
  return new Promise((resolve, reject) => {
    const element = document.createElement("script");
    waiting.set(key, resolve as (value: unknown) => void);
    const failed = (): void => {
      waiting.delete(key);
      element.remove();
      reject(new LoadError(`${address} cannot be loaded`));
    };
    element.onload = () => (waiting.has(key) ? failed() : element.remove()); // a file that was cut off has given nothing
    element.onerror = failed;
    element.src = address;
    document.head.append(element);
  });
}

export const loadScene = (): Promise<SceneData> => load("scene", "scene.js");

export function loadPart(place: number, part: "first" | "full" | "depth" | "second"): Promise<PartData> {
  return load(`${place}.${part}`, `places/${String(place).padStart(3, "0")}.${part}.js`);
}

export const loadNotePicture = (note: number): Promise<PartData> =>
  load(`note${note}.picture`, `notes/${String(note).padStart(3, "0")}.picture.js`);

export function bytes(base64: string): Uint8Array<ArrayBuffer> {
  const text = atob(base64);
  const out = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
  return out;
}

// Decoded beside the main thread where the browser can do that.
export async function picture(base64: string): Promise<ImageBitmap | HTMLImageElement> {
  if (typeof createImageBitmap === "function") {
    try {
      const options: ImageBitmapOptions = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
      return await createImageBitmap(new Blob([bytes(base64)], { type: "image/webp" }), options);
    } catch {
      // an older browser: below
    }
  }
  const image = new Image();
  image.src = `data:image/webp;base64,${base64}`;
  await image.decode();
  return image;
}

export async function inflated(data: Uint8Array<ArrayBuffer>): Promise<Uint8Array> {
  const stream = new Blob([data]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
