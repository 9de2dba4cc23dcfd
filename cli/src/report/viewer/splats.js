// Draws Gaussians with WebGL2 as `mba render` does: blended in linear light, then turned into what displays show.

/** Floats of a Gaussian in the texture: centre, opacity, six of its covariance, colour. */
const FLOATS = 16;
/** Texels in a row of that texture: a multiple of four, so that a Gaussian lies in one row. */
const ROW = 2048;

const GAUSSIANS_VERTEX = `#version 300 es
precision highp float;
precision highp sampler2D;
precision highp usampler2D;
uniform sampler2D gaussians;
uniform usampler2D order;
uniform mat3 axes;
uniform vec3 place;
uniform vec4 camera;
uniform vec4 limits;
uniform vec2 size;
uniform float lowPass;
out vec2 offset;
flat out vec4 colour;
void main() {
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
  int quad = gl_VertexID >> 2;
  int first = int(texelFetch(order, ivec2(quad % ${ROW}, quad / ${ROW}), 0).r) * 4;
  ivec2 at = ivec2(first % ${ROW}, first / ${ROW});
  vec4 a = texelFetch(gaussians, at, 0);
  vec4 b = texelFetch(gaussians, at + ivec2(1, 0), 0);
  vec4 c = texelFetch(gaussians, at + ivec2(2, 0), 0);
  vec4 d = texelFetch(gaussians, at + ivec2(3, 0), 0);
  vec3 seen = (a.xyz - place) * axes;
  // The projection is linearised at the centre, but not far beyond the border of the image.
  vec2 slope = clamp(seen.xy / seen.z, limits.xy, limits.zw);
  vec2 scale = camera.xy / seen.z;
  vec3 toX = axes * vec3(scale.x, 0.0, -scale.x * slope.x);
  vec3 toY = axes * vec3(0.0, scale.y, -scale.y * slope.y);
  mat3 covariance = mat3(b.x, b.y, b.z, b.y, b.w, c.x, b.z, c.x, c.y);
  vec3 spread = covariance * toX;
  // A splat is never thinner than about a pixel of the recording: there is no more detail in the map.
  float xx = dot(spread, toX) + lowPass;
  float xy = dot(spread, toY);
  float yy = dot(covariance * toY, toY) + lowPass;
  // Up to where it is fainter than a step of eight bits.
  float reach2 = 2.0 * log(255.0 * a.w);
  if (reach2 <= 0.0) return;
  float middle = 0.5 * (xx + yy);
  float apart = length(vec2(0.5 * (xx - yy), xy));
  float longest = middle + apart;
  float shortest = max((xx * yy - xy * xy) / longest, 1e-6);
  vec2 along = apart < 1e-6 * middle ? vec2(1.0, 0.0)
    : normalize(xx > yy ? vec2(longest - yy, xy) : vec2(xy, longest - xx));
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1 & 1) * 2.0 - 1.0;
  offset = corner * sqrt(reach2);
  vec2 pixel = camera.xy * seen.xy / seen.z + camera.zw
    + offset.x * sqrt(longest) * along + offset.y * sqrt(shortest) * vec2(-along.y, along.x);
  vec2 screen = (pixel + 0.5) / size * 2.0 - 1.0;
  gl_Position = vec4(screen.x, -screen.y, 0.0, 1.0);
  colour = vec4(c.zw, d.x, a.w);
}`;

const GAUSSIANS_FRAGMENT = `#version 300 es
precision highp float;
in vec2 offset;
flat in vec4 colour;
out vec4 light;
void main() {
  float alpha = min(colour.a * exp(-0.5 * dot(offset, offset)), 0.999);
  if (alpha < 1.0 / 255.0) discard;
  light = vec4(colour.rgb * alpha, alpha);
}`;

const DISPLAY_VERTEX = `#version 300 es
out vec2 at;
void main() {
  at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0;
  gl_Position = vec4(at * 2.0 - 1.0, 0.0, 1.0);
}`;

// Knots of the curve are at the squares of their places: it is steep near black.
const DISPLAY_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D light;
uniform sampler2D curve;
in vec2 at;
out vec4 shown;
float display(float value) {
  float knot = sqrt(clamp(value, 0.0, 1.0)) * 1023.0;
  int below = min(int(knot), 1022);
  float a = texelFetch(curve, ivec2(below, 0), 0).r;
  float b = texelFetch(curve, ivec2(below + 1, 0), 0).r;
  float low = float(below * below) / 1046529.0;
  float high = float((below + 1) * (below + 1)) / 1046529.0;
  return mix(a, b, (clamp(value, 0.0, 1.0) - low) / (high - low));
}
void main() {
  vec3 value = texture(light, at).rgb;
  shown = vec4(display(value.r), display(value.g), display(value.b), 1.0);
}`;

class Splats {
  /** `curve` has 1024 display values of light; `gaussians` FLOATS numbers each. */
  constructor(canvas, gaussians, curve) {
    const gl = canvas.getContext('webgl2', { alpha: false, antialias: false, depth: false });
    if (!gl) throw new Error('this browser has no WebGL2');
    this.gl = gl;
    // Half floats hold light as well as can be seen; where a browser cannot draw to them, GL blends sRGB bytes in linear light.
    this.isHalf = Boolean(gl.getExtension('EXT_color_buffer_float') || gl.getExtension('EXT_color_buffer_half_float'));
    this.program = this.link(GAUSSIANS_VERTEX, GAUSSIANS_FRAGMENT);
    this.display = this.link(DISPLAY_VERTEX, DISPLAY_FRAGMENT);
    this.gaussians = this.texture(gl.NEAREST);
    const rows = Math.max(1, Math.ceil(gaussians.length / 4 / ROW));
    const texels = new Float32Array(rows * ROW * 4);
    texels.set(gaussians);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, ROW, rows, 0, gl.RGBA, gl.FLOAT, texels);
    this.curve = this.texture(gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, 1024, 1, 0, gl.RED, gl.FLOAT, curve);
    this.light = this.texture(gl.LINEAR);
    this.frame = gl.createFramebuffer();
    this.order = this.texture(gl.NEAREST);
    const orderRows = Math.max(1, Math.ceil(gaussians.length / FLOATS / ROW));
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.R32UI, ROW, orderRows);
    this.makeQuads(gaussians.length / FLOATS);
    this.count = 0;
    this.size = [0, 0];
  }

  /** Two triangles for every Gaussian, all in one draw: an instance each takes long without a graphics card. */
  makeQuads(count) {
    const { gl } = this;
    const corners = new Uint32Array(6 * count);
    for (let k = 0; k < count; k++) corners.set([4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 2, 4 * k + 1, 4 * k + 3], 6 * k);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
  }

  texture(filter) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, filter);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    return texture;
  }

  link(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || 'WebGL is lost');
    const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
    const names = Array.from({ length: count }, (_, k) => gl.getActiveUniform(program, k).name);
    return { program, at: Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(program, name)])) };
  }

  /** What is drawn from now on, the farthest first. */
  setOrder(sorted) {
    const { gl } = this;
    const rows = Math.ceil(sorted.length / ROW);
    const texels = new Uint32Array(rows * ROW);
    texels.set(sorted);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.order);
    if (rows > 0) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, ROW, rows, gl.RED_INTEGER, gl.UNSIGNED_INT, texels);
    this.count = sorted.length;
  }

  /** Draws to the whole canvas, at `share` of its resolution. The camera is in pixels of the canvas, `scale` of the recording's. */
  draw({ axes, place, focal: [fx, fy], centre: [cx, cy], scale }, share) {
    const { gl } = this;
    const { width, height } = gl.canvas;
    const size = [width, height].map((side) => Math.max(1, Math.round(side * share)));
    const [sx, sy] = [size[0] / width, size[1] / height];
    const camera = [fx * sx, fy * sy, (cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5];
    this.resize(size);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(0, 0, ...size);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    const { program, at } = this.program;
    gl.useProgram(program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.gaussians);
    gl.uniform1i(at.gaussians, 0);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.order);
    gl.uniform1i(at.order, 1);
    gl.uniformMatrix3fv(at.axes, false, axes.flat());
    gl.uniform3fv(at.place, place);
    gl.uniform4fv(at.camera, camera);
    gl.uniform4fv(at.limits, slopeLimits(size, camera));
    gl.uniform2fv(at.size, size);
    gl.uniform1f(at.lowPass, 0.3 * Math.max(1, scale * sx) ** 2);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.drawElements(gl.TRIANGLES, 6 * this.count, gl.UNSIGNED_INT, 0);
    this.show();
  }

  /** Light to the canvas. */
  show() {
    const { gl, display: { program, at } } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.disable(gl.BLEND);
    gl.useProgram(program);
    [this.light, this.curve].forEach((texture, k) => {
      gl.activeTexture(gl.TEXTURE0 + k);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    gl.uniform1i(at.light, 0);
    gl.uniform1i(at.curve, 1);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  resize(size) {
    if (size[0] === this.size[0] && size[1] === this.size[1]) return;
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.light);
    if (this.isHalf) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, ...size, 0, gl.RGBA, gl.HALF_FLOAT, null);
    else gl.texImage2D(gl.TEXTURE_2D, 0, gl.SRGB8_ALPHA8, ...size, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.light, 0);
    this.size = size;
  }
}

/** Slopes of rays, 0.3 of half the image beyond its borders: least x and y, greatest x and y. */
const slopeLimits = ([width, height], [fx, fy, cx, cy]) => {
  const [beyondX, beyondY] = [0.15 * width / fx, 0.15 * height / fy];
  return [
    (-0.5 - cx) / fx - beyondX, (-0.5 - cy) / fy - beyondY,
    (width - 0.5 - cx) / fx + beyondX, (height - 0.5 - cy) / fy + beyondY,
  ];
};
