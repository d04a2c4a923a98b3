// The surface in three dimensions: turns until it is dragged.
import * as THREE from "./vendor/three.js";
import { table } from "./maps.js";
import { h } from "./ui.js";

/** Shows a PLY as farnear writes it; gives what ends it. `shade` is `depth` or `grey`. */
export function show(host, buffer, shade = "depth") {
  const geometry = parse(buffer, shade);
  const renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
  const canvas = renderer.domElement;
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  canvas.setAttribute("aria-label", "Surface; drag or use the arrows to turn it, plus and minus to zoom");
  host.replaceChildren(canvas);
  const scene = new THREE.Scene();
  scene.add(new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide })));
  scene.add(new THREE.AmbientLight(0xffffff, 1.4));
  const light = new THREE.DirectionalLight(0xffffff, 2.2);
  light.position.set(0.5, 1, 2);
  scene.add(light);
  geometry.computeBoundingSphere();
  const { center, radius } = geometry.boundingSphere;
  const camera = new THREE.PerspectiveCamera(35, 1, radius / 100, radius * 20);
  camera.position.set(center.x + 1.3 * radius, center.y + 0.9 * radius, center.z + 2.6 * radius);
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.target.copy(center);
  controls.enableDamping = true;
  controls.autoRotate = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  controls.autoRotateSpeed = 1.2;
  controls.addEventListener("start", () => { controls.autoRotate = false; });
  canvas.addEventListener("keydown", (event) => turn(event, camera, controls));

  const size = () => {
    const [width, height] = [host.clientWidth, host.clientHeight];
    if (!width || !height) return;
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
  };
  const watch = new ResizeObserver(size);
  watch.observe(host);
  size();
  // Without a graphics card a frame takes long: then as much time is left to the rest of the page.
  let next = 0;
  const pixel = new Uint8Array(4);
  const gl = renderer.getContext();
  renderer.setAnimationLoop(() => {
    if (!host.clientWidth || performance.now() < next) return;
    const begin = performance.now();
    controls.update();
    renderer.render(scene, camera);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); // waits until it is drawn
    next = performance.now() + (performance.now() - begin);
  });
  host.dataset.triangles = geometry.index.count / 3;
  return () => {
    renderer.setAnimationLoop(null);
    watch.disconnect();
    controls.dispose();
    geometry.dispose();
    renderer.dispose();
    renderer.forceContextLoss(); // a browser allows few contexts, and frees them late
    host.replaceChildren();
  };
}

/** Where there is no WebGL. */
export function sorry(host, error) {
  host.replaceChildren(h("p", { class: "empty" }, `This browser cannot show the surface: ${error.message.replace(/\.$/, "")}. mesh.ply opens in MeshLab or Blender.`));
}

function turn(event, camera, controls) {
  const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
  const zoom = { "+": 0.9, "=": 0.9, "-": 1.1 }[event.key];
  if (!step && !zoom) return;
  event.preventDefault();
  controls.autoRotate = false;
  const away = camera.position.clone().sub(controls.target);
  if (zoom) away.multiplyScalar(zoom);
  else {
    const radius = away.length();
    const around = Math.atan2(away.x, away.z) + step[0];
    const up = Math.max(0.1, Math.min(Math.PI - 0.1, Math.acos(away.y / radius) + step[1]));
    away.set(radius * Math.sin(up) * Math.sin(around), radius * Math.cos(up), radius * Math.sin(up) * Math.cos(around));
  }
  camera.position.copy(controls.target).add(away);
}

/** Binary PLY: x, y, z as float and three bytes of colour per vertex, triangles as (byte, 3 x int32). */
function parse(buffer, shade) {
  const begin = new TextDecoder().decode(new Uint8Array(buffer, 0, Math.min(buffer.byteLength, 2048)));
  const end = begin.indexOf("end_header\n");
  const count = (what) => Number(new RegExp(`element ${what} (\\d+)`).exec(begin)?.[1] ?? 0);
  const [vertices, faces] = [count("vertex"), count("face")];
  if (end < 0 || !vertices || !faces) throw new Error("the mesh is empty");
  const view = new DataView(buffer, end + 11);
  const positions = new Float32Array(3 * vertices);
  const colours = new Float32Array(3 * vertices);
  for (let at = 0; at < vertices; at++) {
    for (let axis = 0; axis < 3; axis++) {
      positions[3 * at + axis] = view.getFloat32(15 * at + 4 * axis, true);
      colours[3 * at + axis] = linear(view.getUint8(15 * at + 12 + axis) / 255);
    }
  }
  if (shade === "depth") byDepth(positions, colours);
  const triangles = new Uint32Array(3 * faces);
  for (let at = 0; at < faces; at++) {
    for (let corner = 0; corner < 3; corner++) triangles[3 * at + corner] = view.getInt32(15 * vertices + 13 * at + 1 + 4 * corner, true);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
  geometry.computeVertexNormals();
  return geometry;
}

function byDepth(positions, colours) {
  let [low, high] = [Infinity, -Infinity];
  for (let at = 2; at < positions.length; at += 3) {
    low = Math.min(low, positions[at]);
    high = Math.max(high, positions[at]);
  }
  const map = table("viridis");
  for (let at = 0; at < positions.length; at += 3) {
    const index = 3 * Math.round((255 * (positions[at + 2] - low)) / (high - low || 1));
    for (let channel = 0; channel < 3; channel++) colours[at + channel] = linear(map[index + channel] / 255);
  }
}

const linear = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
