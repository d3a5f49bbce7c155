// SPDX-License-Identifier: Apache-2.0
// Draws the jobs that draw-pictures hands out, one after the other.
import * as THREE from 'three';
import {ColladaLoader} from 'three/addons/loaders/ColladaLoader.js';
import {DRACOLoader} from 'three/addons/loaders/DRACOLoader.js';
import {EXRLoader} from 'three/addons/loaders/EXRLoader.js';
import {FBXLoader} from 'three/addons/loaders/FBXLoader.js';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';
import {HDRLoader} from 'three/addons/loaders/HDRLoader.js';
import {KTX2Loader} from 'three/addons/loaders/KTX2Loader.js';
import {MTLLoader} from 'three/addons/loaders/MTLLoader.js';
import {OBJLoader} from 'three/addons/loaders/OBJLoader.js';
import {PLYLoader} from 'three/addons/loaders/PLYLoader.js';
import {STLLoader} from 'three/addons/loaders/STLLoader.js';
import {TDSLoader} from 'three/addons/loaders/TDSLoader.js';
import {TGALoader} from 'three/addons/loaders/TGALoader.js';
import {MeshoptDecoder} from 'three/addons/libs/meshopt_decoder.module.js';

const TONE_MAPS = {
  none: THREE.NoToneMapping,
  'pbr-neutral': THREE.NeutralToneMapping,
  aces: THREE.ACESFilmicToneMapping,
};
// Formats that lenticule takes with z up, those whose colours it takes as linear light, and the grey of what has
// no material.
const Z_UP = ['3ds', 'ply', 'stl'];
const LINEAR = ['obj', 'dae', 'fbx'];
const GREY = {'3ds': 0.3, obj: 0.6, ply: 0.6, stl: 0.6};

/** Returns the loader of glTF models with the decoders that come with three.js. */
function gltfLoader(renderer) {
  const libraries = '/three/examples/jsm/libs/';
  return new GLTFLoader()
      .setDRACOLoader(new DRACOLoader().setDecoderPath(libraries + 'draco/gltf/'))
      .setKTX2Loader(
          new KTX2Loader().setTranscoderPath(libraries + 'basis/').detectSupport(renderer))
      .setMeshoptDecoder(MeshoptDecoder);
}

/**
 * Pictures that loaders have begun to load: each promise becomes the texture, or the name of a picture that
 * is missing. Most loaders return models before their pictures are there.
 */
let pictures = [];
const PICTURE_LIMIT = 10000;  // milliseconds

/** Lets a class of loaders add what it loads to `pictures`. */
function watch(Loader) {
  const load = Loader.prototype.load;
  Loader.prototype.load = function (url, onLoad, onProgress, onError) {
    let texture;
    pictures.push(new Promise(done => {
      texture = load.call(
          this, url, (...loaded) => { onLoad?.(...loaded); done(texture); }, onProgress,
          error => { onError?.(error); done(String(url)); });
      setTimeout(() => done(String(url)), PICTURE_LIMIT);
    }));
    return texture;
  };
}
watch(THREE.TextureLoader);
watch(TGALoader);

/** Waits for the pictures of a model. Returns the textures that are there, and names those that are not. */
async function loadedPictures(job) {
  const answers = await Promise.all(pictures);
  pictures = [];
  const missing = answers.filter(answer => typeof answer === 'string');
  for (const name of missing) await fetch(`/missing/${job.number}`, {method: 'POST', body: name.slice(0, 100)});
  return new Set(answers);
}

/** Returns the materials that the lines mtllib of an OBJ file name; null if it names none or it is missing. */
async function materialsOf(url) {
  const text = await (await fetch(url)).text();
  const names = [...text.matchAll(/^\s*mtllib\s+(.+?)\s*$/gm)].map(match => match[1]);
  if (names.length === 0) return null;
  const file = new URL(encodeURI(names[0]), new URL(url, location.href)).href;
  return new MTLLoader().loadAsync(file).catch(() => null);
}

/** Returns the mesh of a format that has geometry alone, and perhaps colours of its vertices. */
function plainMesh(geometry) {
  const flatShading = !geometry.attributes.normal;
  return new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({flatShading}));
}

/** Returns the {scene, animations} of a model in any format of which three.js has a loader. */
async function loadModel(gltf, url) {
  switch (extensionOf(url)) {
    case 'obj': {
      const materials = await materialsOf(url);
      const scene = await new OBJLoader().setMaterials(materials).loadAsync(url);
      scene.traverse(object => {
        for (const material of [object.material ?? []].flat())
          material.userData.colourless = !materials?.materialsInfo[material.name]?.kd;
      });
      return {scene};
    }
    case 'dae': {
      const {scene} = await new ColladaLoader().loadAsync(url);
      return {scene, animations: scene.animations};
    }
    case 'fbx': {
      const scene = await new FBXLoader().loadAsync(url);
      return {scene, animations: scene.animations};
    }
    case '3ds':
      return {scene: await new TDSLoader().loadAsync(url)};
    case 'ply':
      return {scene: plainMesh(await new PLYLoader().loadAsync(url))};
    case 'stl':
      return {scene: plainMesh((await new STLLoader().loadAsync(url)).deleteAttribute('normal'))};
    default:
      return gltf.loadAsync(url);
  }
}

function extensionOf(url) {
  return url.split('.').pop().toLowerCase();
}

/**
 * Returns the matt material with the colour, pictures and opacity of one of Phong or Lambert, which no
 * environment lights, as lenticule reads them (docs/content/foreign-files.md): colours are linear light,
 * which these loaders of three.js take as sRGB, and a picture or colours of vertices take the colour's place.
 */
function matt(material, vertexColors, extension, there) {
  const to = new THREE.MeshPhysicalMaterial(
      {metalness: 0, roughness: 1, specularIntensity: 0, side: THREE.DoubleSide, vertexColors});
  for (const key of ['color', 'map', 'alphaMap', 'alphaTest', 'opacity', 'transparent', 'emissive',
                     'emissiveIntensity', 'emissiveMap', 'normalMap', 'flatShading']) {
    const value = material[key];
    if (value !== undefined && (!value?.isTexture || there.has(value))) to[key] = value;
  }
  if (to.map) to.map.colorSpace = THREE.SRGBColorSpace;  // which the loader of 3DS leaves out
  to.color = to.color.clone();
  to.emissive = to.emissive.clone();
  if (LINEAR.includes(extension)) {
    to.color.convertLinearToSRGB();
    to.emissive.convertLinearToSRGB();
  }
  if (to.opacity === 0) to.opacity = 1;
  const colourless = material.userData.colourless ?? material.name === '';
  if (colourless && GREY[extension]) to.color.setScalar(GREY[extension]);
  if (vertexColors || (to.map && extension !== 'obj')) to.color.set(0xffffff);
  return to;
}

/** Makes a model of another format than glTF lie, and be lit, as lenticule's is. */
async function likeOurs(model, extension, job) {
  const there = await loadedPictures(job);
  if (Z_UP.includes(extension)) model.rotation.x = -Math.PI / 2;
  const lights = [];
  model.traverse(object => {
    if (object.isLight) lights.push(object);
    if (object.isMesh) {
      const vertexColors = object.geometry.hasAttribute('color');
      const materials =
          [object.material].flat().map(material => matt(material, vertexColors, extension, there));
      object.material = Array.isArray(object.material) ? materials : materials[0];
    }
  });
  for (const light of lights) light.removeFromParent();
}

let environment = {file: null, texture: null};

/**
 * Returns the latitude-longitude picture; pictures of 8 bits are sRGB, others linear light. The last
 * one is kept, because its filtered copies are what takes most of the time.
 */
async function environmentTexture(job) {
  if (environment.file === job.environment) return environment.texture;
  const file = job.environment_url;
  const loaders = {hdr: HDRLoader, exr: EXRLoader};
  const Loader = loaders[file.split('.').pop().toLowerCase()] ?? THREE.TextureLoader;
  const texture = await new Loader().loadAsync(file);
  if (Loader === THREE.TextureLoader) texture.colorSpace = THREE.SRGBColorSpace;
  texture.mapping = THREE.EquirectangularReflectionMapping;
  environment = {file: job.environment, texture};
  return texture;
}

/**
 * Turns the environment about the vertical so that the middle of the picture, which three.js puts
 * at +x, lies in the direction `ahead`.
 */
function environmentRotation(ahead) {
  return new THREE.Euler(0, Math.atan2(-ahead[2], ahead[0]), 0);
}

/** Returns the camera in direction `toward` that sees the bounds of the model. */
function framing(model, toward, fov) {
  const bounds = new THREE.Box3().setFromObject(model, true);
  const radius = bounds.getSize(new THREE.Vector3()).length() / 2;
  const at = bounds.getCenter(new THREE.Vector3());
  const distance = radius / Math.sin(THREE.MathUtils.degToRad(fov / 2));
  return {from: new THREE.Vector3(...toward).multiplyScalar(distance).add(at), at, up: [0, 1, 0]};
}

function cameraOf(job, model) {
  const {toward, vertical_fov_degrees} = job.camera;
  const pose = toward ? framing(model, toward, vertical_fov_degrees) : job.camera;
  const from = new THREE.Vector3(...pose.from), at = new THREE.Vector3(...pose.at);
  const distance = from.distanceTo(at);
  const camera = new THREE.PerspectiveCamera(
      vertical_fov_degrees, job.width / job.height, distance / 100, distance * 100);
  camera.position.copy(from);
  camera.up.set(...pose.up);
  camera.lookAt(at);
  return camera;
}

// Shadow maps take texture units, of which a shader has sixteen.
const MOST_SHADOWS = 4;

/** Makes a light cast shadows of a model inside the sphere. */
function castShadows(light, sphere) {
  const at = light.getWorldPosition(new THREE.Vector3());
  if (light.isDirectionalLight) {
    // The light's distance has no meaning: it is put outside of the model.
    const aim = light.target.getWorldPosition(new THREE.Vector3());
    const direction = at.sub(aim).normalize();
    light.removeFromParent();
    light.position.copy(sphere.center).addScaledVector(direction, 2 * sphere.radius);
    light.target.removeFromParent();
    light.target.position.copy(sphere.center);
    const {camera} = light.shadow;
    camera.left = camera.bottom = -sphere.radius;
    camera.right = camera.top = sphere.radius;
    camera.near = 0.5 * sphere.radius;
    camera.far = 3.5 * sphere.radius;
  } else {
    light.shadow.camera.far = at.distanceTo(sphere.center) + sphere.radius;
    light.shadow.camera.near = light.shadow.camera.far / 1000;
  }
  light.shadow.mapSize.set(2048, 2048);
  light.shadow.bias = -0.0005;
  light.shadow.normalBias = sphere.radius / 500;
  light.castShadow = true;
}

/** Scales the model's lights as the job says, and lets them cast shadows if it wants that. */
function setLights(renderer, scene, model, job) {
  const sphere = new THREE.Box3().setFromObject(model, true).getBoundingSphere(new THREE.Sphere());
  const lights = [];
  model.traverse(object => {
    if (object.isLight) lights.push(object);
    if (!object.isMesh) return;
    object.receiveShadow = true;
    const materials = [object.material].flat();
    object.castShadow = !materials.some(material => material.transparent || material.transmission > 0);
    for (const material of materials) material.shadowSide = THREE.DoubleSide;
  });
  for (const light of lights) light.intensity *= job.light_scale ?? 1;
  renderer.shadowMap.enabled = Boolean(job.shadows) && lights.length > 0;
  if (!renderer.shadowMap.enabled) return;
  renderer.shadowMap.type = THREE.PCFSoftShadowMap;
  for (const light of lights.slice(0, MOST_SHADOWS)) {
    castShadows(light, sphere);
    if (light.isDirectionalLight) scene.add(light, light.target);
  }
}

async function drawScene(renderer, loader, job) {
  renderer.setPixelRatio(1);
  renderer.setSize(job.width, job.height, false);
  renderer.toneMapping = TONE_MAPS[job.tone_map];
  renderer.toneMappingExposure = job.exposure;

  const scene = new THREE.Scene();
  scene.background = new THREE.Color().setRGB(...job.background, THREE.LinearSRGBColorSpace);
  if (job.environment_url) {
    scene.environment = scene.background = await environmentTexture(job);
    const rotation = environmentRotation(job.environment_ahead);
    scene.environmentRotation.copy(rotation);
    scene.backgroundRotation.copy(rotation);
  }

  const model = await loadModel(loader, job.model_url);
  const extension = extensionOf(job.model_url);
  if (!extension.startsWith('gl')) await likeOurs(model.scene, extension, job);
  scene.add(model.scene);
  if (model.animations?.length > 0) {
    const mixer = new THREE.AnimationMixer(model.scene);
    mixer.clipAction(model.animations[0]).play();
    mixer.setTime(0);
  }

  model.scene.updateMatrixWorld(true);
  const camera = cameraOf(job, model.scene);
  setLights(renderer, scene, model.scene, job);
  renderer.render(scene, camera);
  discard(model.scene);
}

/** Frees the model's memory of the graphics driver. */
function discard(model) {
  model.traverse(object => {
    object.geometry?.dispose();
    for (const material of [object.material ?? []].flat()) {
      for (const value of Object.values(material)) {
        if (value?.isTexture) value.dispose();
      }
      material.dispose();
    }
  });
}

function newRenderer() {
  environment = {file: null, texture: null};
  const renderer = new THREE.WebGLRenderer({antialias: false, preserveDrawingBuffer: true});
  renderer.debug.onShaderError = (gl, program, vertex, fragment) => {
    throw new Error('shader: ' + gl.getShaderInfoLog(fragment) + gl.getShaderInfoLog(vertex));
  };
  return renderer;
}

async function drawAll() {
  let renderer = newRenderer();
  let loader = gltfLoader(renderer);
  for (;;) {
    const job = await (await fetch('/next')).json();
    if (job === null) return;
    let answer;
    try {
      await drawScene(renderer, loader, job);
      const png = await new Promise(done => renderer.domElement.toBlob(done, 'image/png'));
      answer = {kind: 'drawn', body: png};
    } catch (error) {
      answer = {kind: 'failed', body: String(error.message ?? error)};
      renderer.dispose();
      renderer.forceContextLoss();
      renderer = newRenderer();
      loader = gltfLoader(renderer);
    }
    await fetch(`/${answer.kind}/${job.number}`, {method: 'POST', body: answer.body});
  }
}

drawAll();
