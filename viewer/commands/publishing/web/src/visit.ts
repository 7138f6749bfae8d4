// Loads places and keeps the last ones: pictures and depth, small first, then whole.

import { DepthMap } from "./depth";
import { loadPart, picture } from "./loader";
import { maskTextures, meshesOf, PlaceTextures, textureOf } from "./panorama";
import type { Texture } from "three";
import type { SceneData } from "./scene";

const KEPT = 9; // places whose pictures stay on the GPU

export class LoadedPlace {
  readonly textures = new PlaceTextures();
  depth!: DepthMap; // small at first
  whole: Promise<void> | null = null;
  second: Promise<void> | null = null;
  exact: Promise<void> | null = null;

  constructor(readonly index: number) {}
}

// What `load` promises; where that fails, `again` lets the next one try.
function retried(again: () => void, load: () => Promise<void>): Promise<void> {
  const loaded = load();
  loaded.catch(again);
  return loaded;
}

export class Visits {
  private readonly loaded = new Map<number, Promise<LoadedPlace>>();

  // Is told of pictures that came later.
  changed: (place: LoadedPlace) => void = () => undefined;
  // Gives textures to the GPU.
  upload: (textures: Texture[]) => Promise<void> = () => Promise.resolve();
  // Resolves when the data of a first place have come and the browser decodes them.
  readonly decoding: Promise<void>;
  private begun!: () => void;

  constructor(private readonly scene: SceneData) {
    this.decoding = new Promise((resolve) => (this.begun = resolve));
  }

  // A place with its first pictures.
  get(index: number): Promise<LoadedPlace> {
    let found = this.loaded.get(index);
    if (found) this.loaded.delete(index);
    else found = this.first(index);
    this.loaded.set(index, found); // as the last one
    found.catch(() => this.loaded.delete(index));
    return found;
  }

  // Makes a place ready to be gone to, or from, at once.
  async prepare(index: number): Promise<void> {
    const place = await this.get(index);
    await this.upload(place.textures.first);
    meshesOf(place.textures, place.depth);
  }

  // Lets go of places that were not visited for long.
  async trim(here: number): Promise<void> {
    for (const [index, promise] of [...this.loaded]) {
      if (this.loaded.size <= KEPT) return;
      if (index === here) continue;
      this.loaded.delete(index);
      (await promise).textures.release();
    }
  }

  private async first(index: number): Promise<LoadedPlace> {
    const data = await loadPart(index, "first");
    const place = new LoadedPlace(index);
    const { small, stride, places } = this.scene;
    const decoding = Promise.all([
      Promise.all(data.pictures!.map(picture)),
      DepthMap.decode(data.depth!, places[index], small, stride),
    ]);
    this.begun();
    const [images, depth] = await decoding;
    place.textures.first = images.map(textureOf);
    place.depth = depth;
    return place;
  }

  full(place: LoadedPlace): Promise<void> {
    return (place.whole ??= retried(() => (place.whole = null), async () => {
      const data = await loadPart(place.index, "full");
      const images = await Promise.all(data.pictures!.map(picture));
      const before = place.textures.first;
      const textures = images.map(textureOf);
      await this.upload(textures);
      place.textures.first = textures;
      this.changed(place);
      for (const texture of before) texture.dispose();
    }));
  }

  other(place: LoadedPlace): Promise<void> {
    return (place.second ??= retried(() => (place.second = null), async () => {
      const data = await loadPart(place.index, "second");
      const textures = (await Promise.all(data.pictures!.map(picture))).map(textureOf);
      await this.upload(textures);
      place.textures.second = textures;
      this.changed(place);
    }));
  }

  // Where it was measured, as textures.
  async masks(place: LoadedPlace): Promise<void> {
    await this.finest(place);
    if (place.textures.measured.length) return;
    place.textures.measured = maskTextures(place.depth, this.scene.spacing);
    this.changed(place);
  }

  // The whole depth, to measure on.
  finest(place: LoadedPlace): Promise<void> {
    return (place.exact ??= retried(() => (place.exact = null), async () => {
      const data = await loadPart(place.index, "depth");
      place.depth = await DepthMap.decode(data.depth!, this.scene.places[place.index], this.scene.small, 1);
    }));
  }
}
