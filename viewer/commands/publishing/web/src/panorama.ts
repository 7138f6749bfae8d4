// Draws places: the cube of one while one looks around, the depth meshes of two while one goes from the first to the second.

import {
  BufferAttribute, BufferGeometry, ClampToEdgeWrapping, DataTexture, GLSL3, Group, LinearFilter, Mesh, NearestFilter, NoColorSpace,
  type Matrix4, PerspectiveCamera, RedFormat, Scene, ShaderMaterial, Texture, UnsignedByteType, Vector3, Vector4, WebGLRenderer,
} from "three";
import type { DepthMap } from "./depth";
import { FACES, times, type Vector } from "./scene";

const GRID = 64; // cells of a face's mesh, a side
const TORN = 0.3; // relative difference of inverse depth within a cell from which on it spans two surfaces
const CORNERS = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
const FAR = 60; // of what has no depth, in multiples of the median depth

// The direction from the place, not a coordinate of the mesh, says what is shown: exact however the mesh is displaced.
const vertex = /* glsl */ `
uniform vec3 forward, right, up;
out vec3 on; // the face's plane: right, down, forward
void main() {
  on = vec3(dot(position, right), -dot(position, up), dot(position, forward));
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
#ifdef BEHIND
  gl_Position.z = gl_Position.w; // behind all else
#endif
}`;

const fragment = /* glsl */ `
precision highp float;
in vec3 on;
out vec4 colour;
uniform sampler2D first, second, measured;
uniform float split, opacity, tint;
void main() {
  vec2 uv = 0.5 + 0.5 * on.xy / on.z;
#ifdef PLAIN
  colour = vec4(texture(first, uv).rgb, opacity);
#else
  vec3 shown = gl_FragCoord.x < split ? texture(second, uv).rgb : texture(first, uv).rgb;
  if (tint > 0.0 && texture(measured, uv).r < 0.5) shown = mix(shown, vec3(0.93, 0.35, 0.72), 0.5 * tint);
  colour = vec4(shown, opacity);
#endif
}`;

export class PlaceTextures {
  first: Texture[] = [];
  second: Texture[] | null = null;
  measured: DataTexture[] = [];
  meshes: BufferGeometry[] | null = null; // by depth, made once

  release(): void {
    for (const mesh of this.meshes ?? []) mesh.dispose();
    for (const texture of [...this.first, ...(this.second ?? []), ...this.measured]) texture.dispose();
  }
}

export function textureOf(image: ImageBitmap | HTMLImageElement): Texture {
  const texture = new Texture(image);
  texture.colorSpace = NoColorSpace;
  texture.flipY = false;
  texture.generateMipmaps = false;
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.wrapS = texture.wrapT = ClampToEdgeWrapping;
  texture.needsUpdate = true;
  return texture;
}

// White where a surface can be measured (DepthMap.reaches).
export function maskTextures(depth: DepthMap, spacing: number): DataTexture[] {
  return FACES.map((_, face) => {
    const bits = depth.reaches(face, spacing);
    const texture = new DataTexture(bits, depth.side, depth.side, RedFormat, UnsignedByteType);
    texture.minFilter = texture.magFilter = NearestFilter;
    texture.unpackAlignment = 1;
    texture.needsUpdate = true;
    return texture;
  });
}

function materialOf(face: number, behind: boolean): ShaderMaterial {
  const { forward, right, up } = FACES[face];
  return new ShaderMaterial({
    glslVersion: GLSL3, vertexShader: vertex, fragmentShader: fragment, side: 2, defines: behind ? { BEHIND: 1 } : {},
    uniforms: {
      first: { value: null }, second: { value: null }, measured: { value: null }, forward: { value: forward }, right: { value: right },
      up: { value: up }, split: { value: -1 }, opacity: { value: 1 }, tint: { value: 0 },
    },
  });
}

function cubeFace(face: number, reach: number): BufferGeometry {
  const { forward, right, up } = FACES[face];
  const corners = CORNERS.flatMap(([a, b]) => forward.map((f, k) => reach * (f + a * right[k] + b * up[k])));
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(corners), 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  return geometry;
}

// A face displaced by its depth, without the cells that span two surfaces.
function depthFace(depth: DepthMap, face: number, background: number): BufferGeometry {
  const n = GRID + 1, side = depth.side;
  const positions = new Float32Array(n * n * 3), inverse = new Float32Array(n * n); // inverse: 0 where nothing is
  const { forward, right, up } = FACES[face];
  for (let row = 0, i = 0; row < n; row++)
    for (let column = 0; column < n; column++, i++) {
      const a = (2 * column) / GRID - 1, b = 1 - (2 * row) / GRID;
      const ray = forward.map((f, k) => f + a * right[k] + b * up[k]) as Vector, long = Math.hypot(...ray);
      const border = row === 0 || column === 0 || row === GRID || column === GRID;
      const c = Math.min(Math.floor((column / GRID) * side), side - 1), r = Math.min(Math.floor((row / GRID) * side), side - 1);
      // on a border both faces take the depth of the same pixel: no crack between them
      const edge = border ? depth.distance(times(ray, 1 / long)) / long : 0;
      const found = border ? (Number.isFinite(edge) ? edge : 0) : depth.depthOf(face * depth.count + r * side + c);
      const z = found || background;
      inverse[i] = found ? 1 / found : 0;
      for (let k = 0; k < 3; k++) positions[3 * i + k] = z * ray[k];
    }
  const solid: number[] = [];
  for (let row = 0; row < GRID; row++)
    for (let column = 0; column < GRID; column++) {
      const i = row * n + column;
      const low = Math.min(inverse[i], inverse[i + 1], inverse[i + n], inverse[i + n + 1]);
      const high = Math.max(inverse[i], inverse[i + 1], inverse[i + n], inverse[i + n + 1]);
      if (high - low > TORN * high) continue; // stretched between a thing and what is behind it
      solid.push(i, i + n, i + 1, i + 1, i + n, i + n + 1);
    }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  geometry.setIndex(solid);
  let near = Infinity, far = 0;
  for (const i of solid) (near = Math.min(near, inverse[i] ? 1 / inverse[i] : background)), (far = Math.max(far, inverse[i] ? 1 / inverse[i] : background));
  geometry.userData.hull = [near, far].flatMap((z) => CORNERS.map(([a, b]) => new Vector3(...forward.map((f, k) => z * (f + a * right[k] + b * up[k])))));
  return geometry;
}

// The meshes of a place, made when they are first asked for.
export function meshesOf(textures: PlaceTextures, depth: DepthMap): BufferGeometry[] {
  if (textures.meshes) return textures.meshes;
  const some: number[] = [];
  for (let i = 0; i < depth.codes.length; i += 997) if (depth.codes[i]) some.push(depth.depthOf(i));
  some.sort((a, b) => a - b);
  const background = FAR * (some[some.length >> 1] ?? 1);
  return (textures.meshes = FACES.map((_, face) => depthFace(depth, face, background)));
}

// Whether points, relative to a place, all lie beyond one side of what a camera sees.
function outside(points: Vector3[], place: Vector3, toClip: Matrix4): boolean {
  const clip = points.map((point) => new Vector4(point.x + place.x, point.y + place.y, point.z + place.z, 1).applyMatrix4(toClip));
  return [(p: Vector4) => p.x > p.w, (p: Vector4) => p.x < -p.w, (p: Vector4) => p.y > p.w, (p: Vector4) => p.y < -p.w, (p: Vector4) => p.z < -p.w]
    .some((beyond) => clip.every(beyond));
}

// The six faces of one place, as a cube or as a mesh by depth.
class Layer {
  readonly group = new Group();
  private readonly materials: ShaderMaterial[];
  private readonly cubes: Mesh[];
  private meshes: Mesh[] = [];

  // behind: a cube that is drawn where nothing else is.
  constructor(reach: number, behind = false) {
    this.materials = FACES.map((_, face) => materialOf(face, behind));
    if (behind) for (const material of this.materials) material.depthWrite = false;
    this.cubes = this.materials.map((material, face) => new Mesh(cubeFace(face, reach), material));
    for (const mesh of this.cubes) {
      this.group.add(mesh);
    }
    this.group.visible = false;
  }

  show(textures: PlaceTextures): void {
    this.materials.forEach((material, face) => {
      material.uniforms.first.value = textures.first[face];
      material.uniforms.second.value = (textures.second ?? textures.first)[face];
      material.uniforms.measured.value = textures.measured[face] ?? textures.first[face];
    });
  }

  set(split: number, tint: number, opacity: number): void {
    for (const { uniforms } of this.materials) {
      uniforms.split.value = split;
      uniforms.tint.value = tint;
      uniforms.opacity.value = opacity;
    }
    const plain = split < 0 && tint === 0; // one picture alone: a shader that software can draw fast
    for (const material of this.materials) {
      material.transparent = opacity < 1;
      if (("PLAIN" in material.defines) === plain) continue;
      if (plain) material.defines.PLAIN = 1;
      else delete material.defines.PLAIN;
      material.needsUpdate = true;
    }
  }

  // Whether colours are written, or depth alone.
  colours(written: boolean): void {
    for (const material of this.materials) material.colorWrite = written;
  }

  // Leaves out the meshes that are not in the picture.
  cull(toClip: Matrix4): void {
    for (const mesh of this.meshes) mesh.visible = !outside(mesh.geometry.userData.hull, this.group.position, toClip);
  }

  displace(shapes: BufferGeometry[] | null): void {
    for (const material of this.materials) material.depthTest = material.depthWrite = shapes !== null; // a cube hides nothing
    for (const mesh of this.meshes) this.group.remove(mesh);
    for (const cube of this.cubes) cube.visible = shapes === null;
    this.meshes = (shapes ?? []).map((shape, face) => {
      const mesh = new Mesh(shape, this.materials[face]);
      mesh.frustumCulled = false;
      this.group.add(mesh);
      return mesh;
    });
  }
}

export class Panorama {
  readonly camera = new PerspectiveCamera(75, 1, 0.05, 10000);
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly overScene = new Scene();
  private readonly here: Layer;
  private readonly over: Layer;
  private readonly behind: Layer[]; // both places as seen from there, the one that is left over the other, where no mesh has anything
  private readonly behindScenes = [new Scene(), new Scene()];
  private fading = false;
  private drawn = false;
  frames = 0;

  // metre: units in a metre.  Throws where the browser has no WebGL 2.
  constructor(readonly canvas: HTMLCanvasElement, metre: number) {
    const asked = { alpha: false, antialias: false, stencil: false, powerPreference: "high-performance" } as const;
    const context = canvas.getContext("webgl2", asked) as WebGL2RenderingContext | null;
    if (!context) throw new Error("no WebGL 2");
    this.renderer = new WebGLRenderer({ canvas, context, ...asked });
    this.renderer.autoClear = false;
    this.renderer.setClearColor(0x17191d); // as what is behind pictures (viewer.picture.background.PLAIN)
    this.here = new Layer(metre);
    this.over = new Layer(metre);
    this.scene.add(this.here.group);
    this.overScene.add(this.over.group);
    this.behind = this.behindScenes.map((scene) => {
      const layer = new Layer(metre, true);
      layer.group.visible = true;
      scene.add(layer.group);
      return layer;
    });
    this.camera.up.set(0, 0, 1);
    this.camera.near = 0.02 * metre;
    this.camera.far = 20000 * metre;
  }

  resize(width: number, height: number, ratio: number): void {
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
  }

  aim(position: Vector, forward: Vector, fov: number): void {
    this.camera.fov = fov;
    this.camera.position.set(...position);
    this.camera.lookAt(position[0] + forward[0], position[1] + forward[1], position[2] + forward[2]);
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    for (const layer of this.fading ? [this.here, this.over] : this.behind) layer.group.position.set(...position);
  }

  stand(textures: PlaceTextures, position: Vector): void {
    this.here.show(textures);
    this.here.group.position.set(...position);
    this.here.displace(null);
    this.here.group.visible = true;
    this.over.group.visible = false;
    this.over.displace(null);
    this.fading = false;
  }

  // From now on the place gone to fades in over the one that is left, both around the eye: where walls lie between them.
  beginFade(from: PlaceTextures, to: PlaceTextures): void {
    this.here.show(to);
    this.here.displace(null);
    this.over.show(from);
    this.over.displace(null);
    this.over.group.visible = this.fading = true;
  }

  // From now on the place gone to is drawn, by depth, under the one that is left.
  begin(from: PlaceTextures, fromDepth: DepthMap, fromAt: Vector, to: PlaceTextures, toDepth: DepthMap, toAt: Vector): void {
    this.here.show(to);
    this.here.group.position.set(...toAt);
    this.here.displace(meshesOf(to, toDepth));
    [to, from].forEach((textures, number) => this.behind[number].show(textures));
    this.over.show(from);
    this.over.group.position.set(...fromAt);
    this.over.displace(meshesOf(from, fromDepth));
    this.over.group.visible = true;
  }

  // opacity: of the place that is left, while one goes.  split: device pixels from the left up to which the second view is shown.
  draw(split: number, tint: number, opacity: number): void {
    this.here.set(split, tint, 1);
    this.over.set(split, tint, opacity);
    if (this.over.group.visible || !this.drawn) this.renderer.clear(); // a cube covers all
    this.drawn = true;
    const going = this.over.group.visible;
    if (going && !this.fading) {
      const toClip = this.camera.projectionMatrix.clone().multiply(this.camera.matrixWorldInverse);
      for (const layer of [this.here, this.over]) layer.cull(toClip);
    }
    this.renderer.render(this.scene, this.camera);
    if (going && !this.fading) {
      this.behindScenes.forEach((scene, number) => {
        this.behind[number].set(split, tint, number === 0 ? 1 : opacity);
        if (number === 0 || opacity > 0) this.renderer.render(scene, this.camera);
      });
      this.renderer.clearDepth();
    }
    if (going && opacity > 0) {
      for (const written of this.fading ? [true] : [false, true]) {
        // depth first: what lies behind must not shine through
        this.over.colours(written);
        this.renderer.render(this.overScene, this.camera);
      }
    }
    this.frames++;
  }

  // Draws a hop from a place to itself, both ways and a few pixels wide, so that the first one does not wait for its shaders:
  // drivers, and software most of all, finish them when they are first used.  The place must be drawn again after it.
  warm(textures: PlaceTextures, depth: DepthMap, position: Vector): void {
    const whole = this.renderer.getViewport(new Vector4());
    this.renderer.setViewport(0, 0, 8, 8);
    this.begin(textures, depth, position, textures, depth, position);
    this.draw(-1, 0, 0.5);
    this.beginFade(textures, textures);
    this.draw(-1, 0, 0.5);
    this.renderer.setViewport(whole);
    this.stand(textures, position);
  }

  // Gives textures to the GPU one a picture, so that no picture waits for all of them.  ready: is awaited before each.
  async upload(textures: Texture[], ready: () => Promise<void>): Promise<void> {
    for (const texture of textures) {
      await ready();
      this.renderer.initTexture(texture);
      await new Promise(requestAnimationFrame);
    }
  }

  get software(): string {
    const gl = this.renderer.getContext();
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    return info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  }
}
