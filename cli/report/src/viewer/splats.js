// Draws Gaussians with WebGL2 as `mba render` does: blended in linear light, then turned into what displays show.

const GAUSSIANS_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec2 place;
layout(location = 1) in vec4 code;
uniform vec2 colours;
out vec2 offset;
flat out vec4 colour;
void main() {
  gl_Position = vec4(place, 0.0, 1.0);
  // In standard deviations; the corners of a splat are where it is fainter than a step of eight bits.
  offset = (vec2(gl_VertexID & 1, gl_VertexID >> 1 & 1) * 2.0 - 1.0) * sqrt(2.0 * log(255.0 * code.a));
  colour = vec4(mix(vec3(colours.x), vec3(colours.y), code.rgb), code.a);
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
  /** For at most `count` Gaussians; `curve` has 1024 display values of light, `colours` is what the least and greatest code mean. */
  constructor(canvas, count, curve, colours) {
    const gl = canvas.getContext('webgl2', { alpha: false, antialias: false, depth: false });
    if (!gl) throw new Error('this browser has no WebGL2');
    this.gl = gl;
    // Half floats hold light as well as can be seen; where a browser cannot draw to them, GL blends sRGB bytes in linear light.
    this.isHalf = Boolean(gl.getExtension('EXT_color_buffer_float') || gl.getExtension('EXT_color_buffer_half_float'));
    this.program = this.link(GAUSSIANS_VERTEX, GAUSSIANS_FRAGMENT);
    this.display = this.link(DISPLAY_VERTEX, DISPLAY_FRAGMENT);
    this.curve = this.texture(gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, 1024, 1, 0, gl.RED, gl.FLOAT, curve);
    this.light = this.texture(gl.LINEAR);
    this.frame = gl.createFramebuffer();
    this.colours = colours;
    this.size = [0, 0];
    this.makeQuads(count);
  }

  /** Two triangles for every Gaussian, all in one draw: an instance each takes long without a graphics card. */
  makeQuads(count) {
    const { gl } = this;
    const corners = new Uint32Array(6 * count);
    for (let k = 0; k < count; k++) corners.set([4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 2, 4 * k + 1, 4 * k + 3], 6 * k);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, CORNER, 0);
    gl.vertexAttribPointer(1, 4, gl.UNSIGNED_SHORT, true, CORNER, 8);
    [0, 1].forEach((attribute) => gl.enableVertexAttribArray(attribute));
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

  /** Draws `count` splats, whose `corners` the projector computed, on a sheet of `size` pixels that fills the canvas. */
  draw({ corners, count, size }) {
    const { gl } = this;
    this.resize(size);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(0, 0, ...size);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    const { program, at } = this.program;
    gl.useProgram(program);
    gl.bufferData(gl.ARRAY_BUFFER, new Uint8Array(corners, 0, 4 * CORNER * count), gl.STREAM_DRAW);
    gl.uniform2fv(at.colours, this.colours);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.drawElements(gl.TRIANGLES, 6 * count, gl.UNSIGNED_INT, 0);
    this.show();
  }

  /** The same, of light that was painted: three floats of light for every pixel and one that does not count, rows going up. */
  drawPainted({ pixels, size }) {
    const { gl } = this;
    this.resize(size);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.light);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, ...size, gl.RGBA, gl.FLOAT, pixels);
    this.show();
  }

  /** Waits until everything is drawn. */
  finish() {
    const { gl } = this;
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
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
