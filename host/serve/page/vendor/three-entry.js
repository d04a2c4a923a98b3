export { WebGLRenderer, Scene, PerspectiveCamera, Mesh, Points, PointsMaterial, BufferGeometry, BufferAttribute, MeshLambertMaterial, MeshBasicMaterial, AmbientLight, DirectionalLight, Color, Vector3, Box3, DoubleSide, GridHelper, AxesHelper, LineSegments, LineBasicMaterial, Group, SRGBColorSpace } from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
