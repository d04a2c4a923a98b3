// What the page uses of three.js, for its type check: by name, not by shape.
type Any = any;
export const AmbientLight: Any;
export const BufferAttribute: Any;
export const BufferGeometry: Any;
export const DirectionalLight: Any;
export const DoubleSide: Any;
export const Mesh: Any;
export const MeshLambertMaterial: Any;
export const OrbitControls: Any;
export const PerspectiveCamera: Any;
export const Scene: Any;
export const WebGLRenderer: Any;
