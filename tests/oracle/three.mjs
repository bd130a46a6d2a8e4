// Pictures of glTF files by three.js, to look at beside ours: same camera, same sun and sky, no tone curve.
//
//   npm install three playwright-core            (in any folder; NODE_MODULES names its node_modules)
//   NODE_MODULES=... CANTED=target/release/canted CHROMIUM=/usr/bin/chromium node tests/oracle/three.mjs OUT FILE...
//
// For each FILE it writes OUT/NAME-canted.png, OUT/NAME-three.png and a line with the mean color of both. The camera is the one that
// `canted scene` chooses. three.js has no light between surfaces and no soft shadows, so creases are brighter there.
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const modules = path.resolve(process.env.NODE_MODULES ?? 'node_modules');
const canted = process.env.CANTED ?? 'target/release/canted';
const [size, spp] = [process.env.SIZE ?? '320x240', process.env.SPP ?? '64'];
const sky = [0.4, 0.5, 0.65];
const sun = { direction: [0.35, -0.75, -0.6], irradiance: [2.0, 1.9, 1.7] };
const [out, ...files] = process.argv.slice(2);
const [width, height] = size.split('x').map(Number);
fs.mkdirSync(out, { recursive: true });

const { chromium } = await import(pathToFileURL(path.join(modules, 'playwright-core/index.mjs')));
let root = '.';
const types = { '.js': 'text/javascript', '.html': 'text/html', '.wasm': 'application/wasm' };
const server = http.createServer((request, response) => {
  const name = decodeURIComponent(new URL(request.url, 'http://a').pathname);
  const file = name.startsWith('/modules/') ? path.join(modules, name.slice(9)) : path.join(root, name.slice(7));
  if (name === '/page') return response.setHeader('content-type', 'text/html').end(page());
  fs.readFile(file, (error, bytes) => {
    if (error) return response.writeHead(404).end();
    response.setHeader('content-type', types[path.extname(file)] ?? 'application/octet-stream').end(bytes);
  });
}).listen(0);
const origin = `http://localhost:${server.address().port}`;

function page() {
  return `<script type="importmap">{"imports":{"three":"/modules/three/build/three.module.js","three/addons/":"/modules/three/examples/jsm/"}}</script>
<body style="margin:0"><script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
window.draw = async ({ url, camera: c, sky, sun, width, height }) => {
  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.setSize(width, height);
  renderer.toneMapping = THREE.NoToneMapping;
  renderer.shadowMap.enabled = true;
  document.body.appendChild(renderer.domElement);
  const scene = new THREE.Scene();
  const color = new THREE.Color().setRGB(...sky, THREE.LinearSRGBColorSpace);
  const around = new THREE.Scene();
  around.add(new THREE.Mesh(new THREE.SphereGeometry(10), new THREE.MeshBasicMaterial({ color, side: THREE.BackSide })));
  scene.environment = new THREE.PMREMGenerator(renderer).fromScene(around).texture;
  scene.background = color;
  const gltf = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).loadAsync(url);
  const lights = [];
  gltf.scene.traverse((node) => { if (node.isLight) lights.push(node); node.castShadow = node.receiveShadow = node.isMesh; });
  lights.forEach((light) => light.removeFromParent());
  scene.add(gltf.scene);
  const box = new THREE.Box3().setFromObject(gltf.scene);
  const [center, radius] = [box.getCenter(new THREE.Vector3()), box.getSize(new THREE.Vector3()).length() / 2];
  const light = new THREE.DirectionalLight(new THREE.Color().setRGB(...sun.irradiance, THREE.LinearSRGBColorSpace), 1);
  light.position.copy(center).addScaledVector(new THREE.Vector3(...sun.direction).normalize(), -2 * radius);
  light.target.position.copy(center);
  light.castShadow = true;
  light.shadow.mapSize.set(2048, 2048);
  light.shadow.bias = -1e-3;
  Object.assign(light.shadow.camera, { left: -radius, right: radius, top: radius, bottom: -radius, near: radius / 2, far: 4 * radius });
  scene.add(light, light.target);
  const eye = new THREE.Vector3(...c.eye), target = new THREE.Vector3(...c.target);
  const far = eye.distanceTo(center) + 2 * radius;
  const camera = new THREE.PerspectiveCamera(c.fov, width / height, far / 2000, far);
  camera.up.set(...c.up);
  camera.position.copy(eye);
  camera.lookAt(target);
  renderer.render(scene, camera);
  return renderer.domElement.toDataURL('image/png');
};
</script>`;
}

/// The camera that `canted scene` writes.
function cameraOf(file) {
  const toml = path.join(out, 'scene.toml');
  execFileSync(canted, ['scene', file, '-o', toml, '--size', size, '--sun', '0,-1,0,1,1,1'], { stdio: 'ignore' });
  const text = fs.readFileSync(toml, 'utf8');
  const numbers = (key) => JSON.parse(text.match(new RegExp(`^${key} = (\\[[^\\]]*\\]|[-0-9.e]+)`, 'm'))[1]);
  return { eye: numbers('eye'), target: numbers('target'), up: numbers('up'), fov: numbers('fov_degrees') };
}

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'],
});
for (const file of files) {
  const name = path.basename(file).replace(/\W+/g, '_');
  try {
    const camera = cameraOf(file);
    const light = ['--env', sky.join(), '--sun', [...sun.direction, ...sun.irradiance].join()];
    const view = ['--eye', camera.eye.join(), '--target', camera.target.join(), '--up', camera.up.join(), '--fov', camera.fov];
    const ours = path.join(out, `${name}-canted.png`);
    const options = ['--integrator', 'path', '--spp', spp, '--size', size, '-q'];
    execFileSync(canted, ['render', file, '-o', ours, ...options, ...light.flatMap(equals), ...view.flatMap(equals)]);
    root = path.dirname(file);
    const tab = await browser.newPage({ viewport: { width, height } });
    tab.on('console', (message) => message.type() === 'error' && !message.text().includes('404') && console.error(`${name}: ${message.text()}`));
    await tab.goto(`${origin}/page`);
    await tab.waitForFunction(() => window.draw);
    const url = `/files/${encodeURIComponent(path.basename(file))}`;
    const picture = await tab.evaluate((options) => window.draw(options), { url, camera, sky, sun, width, height });
    fs.writeFileSync(path.join(out, `${name}-three.png`), Buffer.from(picture.split(',')[1], 'base64'));
    await tab.close();
    console.log(name);
  } catch (error) {
    console.log(`${name}: ${String(error.message).split('\n')[0]}`);
  }
}
await browser.close();
server.close();

/// Options whose values may begin with a minus are joined to them.
function equals(word, i, all) {
  return i % 2 === 0 ? [`${word}=${all[i + 1]}`] : [];
}
