// A matt surface in sun and sky light, computed for each corner: cheap where there is no graphics processor.

import * as THREE from "three";

const VERTEX = `
varying vec3 shade;
#ifdef PLAIN
uniform vec3 paint;
#endif
void main() {
  vec4 at = modelMatrix * vec4(position, 1.0);
  vec3 up = normalize(mat3(modelMatrix) * normal);
  if (dot(up, cameraPosition - at.xyz) < 0.0) up = -up;
  #ifndef PLAIN
  vec3 paint = color;
  #endif
  float light = 0.42 + 0.18 * up.z + 0.42 * max(0.0, dot(up, vec3(-0.33, -0.52, 0.79)));
  shade = pow(paint * light, vec3(1.0 / 2.2));
  gl_Position = projectionMatrix * viewMatrix * at;
}`;
const FRAGMENT = `
varying vec3 shade;
void main() { gl_FragColor = vec4(shade, 1.0); }`;

// Without a colour the geometry has one for each corner.
export function matt(colour = null) {
  const plain = colour === null ? {} : { defines: { PLAIN: 1 }, uniforms: { paint: { value: new THREE.Color(colour) } } };
  return new THREE.ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide, vertexColors: colour === null, ...plain });
}

// Whether pictures are computed by the processor: smooth edges then take too long. True without WebGL, too.
export function softwareOnly() {
  const gl = document.createElement("canvas").getContext("webgl2"), told = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl ? gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return !gl || /swiftshader|llvmpipe|software/i.test(name);
}
