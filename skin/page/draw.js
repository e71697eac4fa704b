// Draws one moment of the run: ground, block, things, lava; shadows of the sun, light of the lava on the ground, bloom.

class Program {
  constructor(gl, vertex, fragment) {
    const shader = (type, text) => {
      const s = gl.createShader(type);
      gl.shaderSource(s, text);
      gl.compileShader(s);
      return s;
    };
    const [v, f] = [shader(gl.VERTEX_SHADER, vertex), shader(gl.FRAGMENT_SHADER, fragment)];
    this.gl = gl;
    this.program = gl.createProgram();
    gl.attachShader(this.program, v);
    gl.attachShader(this.program, f);
    gl.linkProgram(this.program);
    this.shaders = [v, f];
  }
  /// After all were sent off, so that the driver can work on them side by side.
  finish() {
    const gl = this.gl;
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error("shader: " + (this.shaders.map((s) => gl.getShaderInfoLog(s)).join(" ").trim() || gl.getProgramInfoLog(this.program)));
    this.at = {};
    this.units = {};
    for (let k = 0, unit = 0; k < gl.getProgramParameter(this.program, gl.ACTIVE_UNIFORMS); ++k) {
      const { name, type } = gl.getActiveUniform(this.program, k);
      this.at[name] = { place: gl.getUniformLocation(this.program, name), type };
      if (type === gl.SAMPLER_2D || type === gl.SAMPLER_2D_SHADOW) this.units[name] = unit++;
    }
    return this;
  }
  /// Values by name; those that the shader does not have are passed over.
  use(...all) {
    const gl = this.gl;
    gl.useProgram(this.program);
    for (const values of all)
      for (const [name, value] of Object.entries(values)) {
        const uniform = this.at[name];
        if (!uniform) continue;
        const { place, type } = uniform;
        if (name in this.units) {
          gl.activeTexture(gl.TEXTURE0 + this.units[name]);
          gl.bindTexture(gl.TEXTURE_2D, value);
          gl.uniform1i(place, this.units[name]);
        } else if (type === gl.FLOAT_MAT4) gl.uniformMatrix4fv(place, false, value);
        else if (type === gl.INT) gl.uniform1i(place, value);
        else if (type === gl.FLOAT) gl.uniform1f(place, value);
        else if (type === gl.FLOAT_VEC2) gl.uniform2fv(place, value);
        else if (type === gl.FLOAT_VEC3) gl.uniform3fv(place, value);
        else gl.uniform4fv(place, value);
      }
  }
}

/// A mesh on the graphics card.
class GpuMesh {
  constructor(gl, mesh) {
    this.gl = gl;
    this.about = mesh.about;
    this.low = mesh.about.box.slice(0, 3);
    this.size = [0, 1, 2].map((k) => mesh.about.box[3 + k] - mesh.about.box[k]);
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    this.vertices = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.vertices);
    gl.bufferData(gl.ARRAY_BUFFER, mesh.vertices, gl.STATIC_DRAW);
    gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, true, kStride, 0);
    gl.vertexAttribPointer(1, 2, gl.UNSIGNED_BYTE, true, kStride, kNormalAt);
    gl.vertexAttribPointer(2, 4, gl.UNSIGNED_BYTE, true, kStride, kColorAt);
    gl.vertexAttribPointer(3, 4, gl.UNSIGNED_BYTE, true, kStride, kScalarsAt);
    for (let k = 0; k < 4; ++k) gl.enableVertexAttribArray(k);
    this.short = mesh.about.vertices <= 65535;
    this.indices = this.short ? new Uint16Array(mesh.indices) : mesh.indices;
    this.triangles = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.triangles);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.bytes = mesh.vertices.byteLength + 2 * this.indices.byteLength;
  }
  draw(lines = false) {
    const gl = this.gl, type = this.short ? gl.UNSIGNED_SHORT : gl.UNSIGNED_INT;
    if (lines && !this.edges) this.makeEdges();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, lines ? this.edges : this.triangles);
    gl.drawElements(lines ? gl.LINES : gl.TRIANGLES, lines ? this.edgeCount : this.indices.length, type, 0);
  }
  /// Of a closed mesh each edge runs both ways: the upward one is taken.
  makeEdges() {
    const gl = this.gl, of = this.indices, ends = [];
    for (let c = 0; c < of.length; c += 3)
      for (let k = 0; k < 3; ++k) {
        const a = of[c + k], b = of[c + ((k + 1) % 3)];
        if (a < b) ends.push(a, b);
      }
    this.edgeCount = ends.length;
    this.edges = gl.createBuffer();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.edges);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.short ? new Uint16Array(ends) : new Uint32Array(ends), gl.STATIC_DRAW);
  }
  free() {
    const gl = this.gl;
    gl.deleteVertexArray(this.array);
    for (const buffer of [this.vertices, this.triangles, this.edges]) if (buffer) gl.deleteBuffer(buffer);
  }
}

/// A texture to draw into. samples > 1: drawn into a multisampled buffer, resolve() makes the texture.
class Target {
  constructor(gl, format, depth = false, samples = 1) {
    Object.assign(this, { gl, format, depth, samples, width: 0, height: 0 });
  }
  resize(width, height) {
    if (width === this.width && height === this.height) return this;
    this.free();
    const { gl, format, samples } = this;
    Object.assign(this, { width, height });
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    this.resolved = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.resolved);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
    this.frame = this.resolved;
    this.buffers = [];
    const buffer = (kind, attachment) => {
      const b = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, b);
      if (samples > 1) gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, kind, width, height);
      else gl.renderbufferStorage(gl.RENDERBUFFER, kind, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, attachment, gl.RENDERBUFFER, b);
      this.buffers.push(b);
    };
    if (samples > 1) {
      this.frame = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
      buffer(format, gl.COLOR_ATTACHMENT0);
    }
    if (this.depth) buffer(gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT);
    return this;
  }
  bind() {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.frame);
    this.gl.viewport(0, 0, this.width, this.height);
  }
  resolve() {
    const { gl, width, height } = this;
    if (this.frame === this.resolved) return;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.frame);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.resolved);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
  }
  free() {
    if (!this.texture) return;
    const gl = this.gl;
    gl.deleteTexture(this.texture);
    for (const b of this.buffers) gl.deleteRenderbuffer(b);
    gl.deleteFramebuffer(this.resolved);
    if (this.frame !== this.resolved) gl.deleteFramebuffer(this.frame);
  }
}

/// What the sun sees: depths of some meshes.
class Shadow {
  constructor(gl, side) {
    Object.assign(this, { gl, side, of: null });
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, side, side);
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR], [gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE], [gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL]])
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    this.frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.texture, 0);
    gl.drawBuffers([gl.NONE]);
  }
  /// Unless it is of these meshes and this sun already.
  draw(program, box, sun, meshes) {
    const { gl, side } = this, of = [...meshes, ...sun];
    if (this.of && of.every((one, k) => one === this.of[k])) return;
    this.of = of;
    const view = lookAt(sun, [0, 0, 0]), [low, high] = boxSeen(view, box);
    this.fromWorld = product(orthographic(low, high), view);
    this.bias = (1.2 * Math.max(high[0] - low[0], high[1] - low[1])) / side;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(0, 0, side, side);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1.5, 2);
    for (const mesh of meshes) {
      if (!mesh) continue;
      program.use({ u_low: mesh.low, u_size: mesh.size, u_clip: this.fromWorld });
      mesh.draw();
    }
    gl.disable(gl.POLYGON_OFFSET_FILL);
  }
}

/// The lava's light from above, on a grid over its box and around: of each cell the mean of the vertices in it that face up. Linear, RGBA.
class GlowGrid {
  constructor(page) {
    this.side = 64;
    const box = page.lavaBox || [[0, 0, 0], [1, 1, 1]], margin = 0.35 * Math.max(box[1][0] - box[0][0], box[1][1] - box[0][1], 1e-3);
    this.low = [box[0][0] - margin, box[0][1] - margin];
    this.size = [0, 1].map((k) => box[1][k] + margin - this.low[k]);
    this.light = page.glow;
  }
  of(mesh) {
    const { side } = this, { about, vertices } = mesh, sums = new Float32Array(4 * side * side);
    if (!about.planes.includes("glow")) return sums;
    const words = new Uint16Array(vertices), bytes = new Uint8Array(vertices);
    const [sx, sy] = [0, 1].map((k) => (((about.box[3 + k] - about.box[k]) / 65535) * side) / this.size[k]), [ox, oy] = [0, 1].map((k) => ((about.box[k] - this.low[k]) * side) / this.size[k]);
    for (let v = 0; v < about.vertices; ++v) {
      const at = v * kStride;
      if (Math.abs(bytes[at + kNormalAt] - 127.5) + Math.abs(bytes[at + kNormalAt + 1] - 127.5) > 127.5) continue;  // the lower half of the octahedron
      const cell = 4 * (Math.floor(oy + words[v * 8 + 1] * sy) * side + Math.floor(ox + words[v * 8] * sx)), glow = 3 * bytes[at + kPlaneAt.glow];
      for (let k = 0; k < 3; ++k) sums[cell + k] += this.light[glow + k];
      ++sums[cell + 3];
    }
    for (let i = 0; i < sums.length; i += 4) {
      if (sums[i + 3] > 0) for (let k = 0; k < 3; ++k) sums[i + k] /= sums[i + 3];
      sums[i + 3] = 1;
    }
    return sums;
  }
}

class Renderer {
  constructor(canvas, page) {
    const gl = canvas.getContext("webgl2", { antialias: false, depth: false, alpha: false, powerPreference: "high-performance" });
    if (!gl) throw new Error("This page needs WebGL 2, which this browser does not give it.");
    Object.assign(this, { canvas, gl, page });
    // Half floats hold light brighter than white; without them hot lava is merely white.
    const light = gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float") ? gl.RGBA16F : gl.RGBA8;
    gl.getExtension("OES_texture_float_linear");
    this.programs = {};
    const programs = {
      lava: [kMeshVertex, kLavaFragment], ground: [kMeshVertex, kGroundFragment], other: [kMeshVertex, kOtherFragment], line: [kMeshVertex, kLineFragment],
      depth: [kMeshVertex, kDepthFragment], sky: [kScreenVertex, kSkyFragment], bright: [kScreenVertex, kBrightFragment],
      blur: [kScreenVertex, kBlurFragment], tone: [kScreenVertex, kToneFragment], show: [kScreenVertex, kShowFragment],
    };
    for (const [name, [vertex, fragment]] of Object.entries(programs)) this.programs[name] = new Program(gl, vertex, fragment);
    for (const program of Object.values(this.programs)) program.finish();
    const target = (...more) => new Target(gl, light, ...more);
    this.targets = {
      still: target(true), moving: target(true, Math.min(4, gl.getParameter(gl.MAX_SAMPLES))), sum: target(),
      bright: target(), between: target(), bloom: target(), wide: target(), wideBetween: target(),
      glowBetween: target(), glowNear: target(), glowMap: target(),
    };
    this.glowTexture = this.texture(256, gl.RGBA16F, gl.RGBA, gl.FLOAT, new Float32Array(page.glow.length / 3 * 4).map((_, i) => (i % 4 < 3 ? page.glow[3 * (i >> 2) + (i % 4)] : 1)));
    this.mapTextures = {};
    for (const [name, stops] of Object.entries(kMaps)) this.mapTextures[name] = this.texture(256, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, mapTexels(stops));
    this.empty = gl.createVertexArray();
    const names = gl.getExtension("WEBGL_debug_renderer_info");
    this.software = /swiftshader|llvmpipe|software|basic render/i.test(names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : gl.getParameter(gl.RENDERER));
    // Without a graphics card triangles cost as much as pixels: there the lava casts its shadow in still pictures only.
    this.shadow = new Shadow(gl, this.software ? 768 : 2048);
    this.groundShadow = this.software ? new Shadow(gl, 768) : null;
    this.glowGrid = new GlowGrid(page);
    this.glowCells = this.texture(1, gl.RGBA16F, gl.RGBA, gl.FLOAT, null);
    this.noise = this.makeNoise();
    this.sceneBox = page.box || [[-1, -1, -1], [1, 1, 1]];
    this.size = sizeOf(this.sceneBox);
    this.glowOf = null;  // the lava whose light the ground has
  }

  texture(width, inner, format, type, texels) {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, 1, 0, format, type, texels);
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    return texture;
  }

  /// Value noise that repeats, with mip maps, so that it fades where it gets finer than a pixel. Red: two octaves, 16 and 64 patches across; green: 128.
  makeNoise() {
    const gl = this.gl, side = 256, texels = new Uint8Array(2 * side * side), smooth = (t) => t * t * (3 - 2 * t);
    let seed = 7;
    const octave = (cells) => {
      const values = Float32Array.from({ length: cells * cells }, () => ((seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0) >>> 8) / 0xffffff), size = side / cells;
      return (x, y) => {
        const i = Math.floor(x / size), j = Math.floor(y / size), fx = smooth((x % size) / size), fy = smooth((y % size) / size), at = (a, b) => values[((b + j) % cells) * cells + ((a + i) % cells)];
        return mix(mix(at(0, 0), at(1, 0), fx), mix(at(0, 1), at(1, 1), fx), fy);
      };
    };
    const [large, small, grain] = [16, 64, 128].map(octave);
    for (let y = 0, o = 0; y < side; ++y)
      for (let x = 0; x < side; ++x) {
        texels[o++] = 255 * (0.6 * large(x, y) + 0.4 * small(x, y));
        texels[o++] = 255 * grain(x, y);
      }
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RG8, side, side, 0, gl.RG, gl.UNSIGNED_BYTE, texels);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, this.software ? gl.LINEAR_MIPMAP_NEAREST : gl.LINEAR_MIPMAP_LINEAR);
    gl.generateMipmap(gl.TEXTURE_2D);
    return texture;
  }

  upload(mesh) {
    const uploaded = new GpuMesh(this.gl, mesh);
    uploaded.glowCells = mesh.about.planes.includes("glow") ? this.glowGrid.of(mesh) : null;
    return uploaded;
  }

  mesh(program, mesh, ...values) {
    program.use({ u_low: mesh.low, u_size: mesh.size }, ...values);
    mesh.draw();
  }
  screen(program, target, ...values) {
    const gl = this.gl;
    if (target) target.bind();
    else {
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    }
    program.use(...values);
    gl.bindVertexArray(this.empty);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
  /// sigma: share of the picture, of its height; to: share of that, and of `also`.
  blur(from, between, to, sigma, share = 1, also = null, alsoShare = 0) {
    const aspect = to.height / to.width, blur = (image, target, step, shares) =>
      this.screen(this.programs.blur, target, { u_image: image.texture, u_also: (also || image).texture, u_step: step, u_shares: shares });
    blur(from, between, [(sigma / 3) * aspect, 0], [1, 0]);
    blur(between, to, [0, sigma / 3], [share, alsoShare]);
  }

  /// Day from 0 (night) to 1.
  light(day) {
    const dusk = [0.9, 0.62, 0.42], noon = [1, 0.95, 0.86], warm = [0, 1, 2].map((k) => mix(dusk[k], noon[k], day));
    return {
      sun: times(0.15 + 1.9 * day * day + 0.95 * day, warm),
      sky: times(0.10 + 0.62 * day, [0.55, 0.68, 0.95]),
      bounce: times(0.03 + 0.20 * day, [0.9, 0.75, 0.62]),
      exposure: mix(1.25, 0.95, day),
      above: times(0.35 + day, [0.0030, 0.0035, 0.0046]),
      below: times(0.35 + day, [0.0125, 0.0132, 0.0148]),
    };
  }

  /// What lies at the lava's side is lit by it, and what is seen from afar.
  drawGlow(lava) {
    const gl = this.gl, { glowBetween, glowNear, glowMap } = this.targets, side = this.glowGrid.side;
    for (const target of [glowBetween, glowNear, glowMap]) target.resize(side, side);
    gl.bindTexture(gl.TEXTURE_2D, this.glowCells);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, side, side, 0, gl.RGBA, gl.FLOAT, (lava && lava.glowCells) || new Float32Array(4 * side * side));
    gl.disable(gl.DEPTH_TEST);
    this.blur({ texture: this.glowCells }, glowBetween, glowNear, 0.0164);
    this.blur(glowNear, glowBetween, glowMap, 0.0656, 1.6, glowNear, 0.7);
    gl.enable(gl.DEPTH_TEST);
  }

  /// Pixels of the picture at its best.
  resize(width, height) {
    this.full = [Math.max(1, width), Math.max(1, height)];
  }

  /// scene: { terrain, base, others, lava }, meshes on the card or null; look: { channel, map, ofRange, wire, contours, contour, ground, day };
  /// scale: of the picture's width, for when it must be fast; sample: 0 for a moving picture, from 1 on of a still one, each adds to it.
  draw(scene, camera, look, scale, sample) {
    const gl = this.gl, { programs, targets } = this;
    const [width, height] = this.full.map((pixels) => Math.max(1, Math.round(pixels * scale)));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const still = sample > 0, main = still || scale < 1 ? targets.still : targets.moving;
    main.resize(width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);

    // The sun is a disc: each sample sees another point of it.
    const turn = 2.399963 * sample, out = still ? 0.022 * Math.sqrt((sample % 16) / 16) : 0;
    const sun = unit(add([-0.62, -0.50, 0.52], [out * Math.cos(turn), out * Math.sin(turn), 0]));
    const shadow = this.groundShadow && !still ? this.groundShadow : this.shadow;
    shadow.draw(programs.depth, this.sceneBox, sun, [scene.terrain, scene.others, shadow === this.groundShadow ? null : scene.lava]);
    if (this.glowOf !== scene.lava) this.drawGlow(scene.lava);
    this.glowOf = scene.lava;

    const light = this.light(look.day), own = look.channel < 0;
    const view = camera.view(), projection = camera.projection(width / height);
    if (still) {
      projection[8] += (2 * ((sample * 0.7548777) % 1) - 1) / width;
      projection[9] += (2 * ((sample * 0.5698403) % 1) - 1) / height;
    }
    const clip = product(projection, view);
    const common = {
      u_clip: clip, u_eye: camera.eye(), u_sun: sun, u_sunLight: light.sun, u_skyLight: light.sky, u_bounce: light.bounce,
      u_shadow: shadow.texture, u_shadowFromWorld: shadow.fromWorld, u_shadowTexel: 1 / shadow.side, u_shadowBias: shadow.bias,
      u_shadowTaps: scale < 1 ? 1 : 4,
    };
    main.bind();
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.DEPTH_TEST);
    this.screen(programs.sky, main, { u_above: light.above, u_below: light.below, u_exposure: light.exposure });
    gl.enable(gl.DEPTH_TEST);
    if (scene.lava) {
      // It is closed: what faces away is behind the rest, or in the ground.
      gl.enable(gl.CULL_FACE);
      this.mesh(programs.lava, scene.lava, common, {
        u_glow: this.glowTexture, u_map: this.mapTextures[look.map] || this.glowTexture, u_channel: look.channel, u_ofRange: look.ofRange,
        u_emission: mix(0.5, 0.62, look.day), u_exposure: light.exposure,
      });
      gl.disable(gl.CULL_FACE);
    }
    if (scene.others) this.mesh(programs.other, scene.others, common, { u_depth: 0 });
    if (scene.terrain && look.ground) {
      this.mesh(programs.ground, scene.terrain, common, {
        u_contour: look.contour, u_contours: look.contours ? 1 : 0, u_grain: this.size / 14, u_noise: this.noise, u_glowMap: targets.glowMap.texture,
        u_glowFrame: [...this.glowGrid.low, ...this.glowGrid.size], u_glowLight: own ? 1 : 0,
      });
      if (scene.base) this.mesh(programs.other, scene.base, common, { u_deep: scene.base.low[2], u_depth: 0.06 * this.size });
    }
    if (scene.lava && look.wire) {
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
      // A little nearer, so that lines lie on their triangles.
      const nearer = projection.slice();
      nearer[10] += 4e-5;
      programs.line.use({ u_low: scene.lava.low, u_size: scene.lava.size, u_clip: product(nearer, view), u_line: own ? [0.9, 0.95, 1, 0.22] : [0, 0, 0, 0.35] });
      scene.lava.draw(true);
      gl.disable(gl.BLEND);
    }
    main.resolve();
    gl.disable(gl.DEPTH_TEST);

    if (own) {
      const quarter = [Math.max(1, width >> 2), Math.max(1, height >> 2)], small = [Math.max(1, width >> 4), Math.max(1, height >> 4)];
      for (const target of [targets.bright, targets.between, targets.bloom]) target.resize(...quarter);
      for (const target of [targets.wide, targets.wideBetween]) target.resize(...small);
      this.screen(programs.bright, targets.bright, { u_image: main.texture, u_texel: [1 / width, 1 / height] });
      this.screen(programs.bright, targets.wide, { u_image: targets.bright.texture, u_texel: [1 / quarter[0], 1 / quarter[1]] });
      this.blur(targets.wide, targets.wideBetween, targets.wide, 0.055);
      this.blur(targets.bright, targets.between, targets.bloom, 0.0085, 0.1, targets.wide, 0.13);
    }
    const tone = { u_image: main.texture, u_bloom: (own ? targets.bloom : main).texture, u_bloomStrength: own ? 1 : 0, u_exposure: light.exposure };
    if (!still) return this.screen(programs.tone, null, tone, { u_screen: 1 });
    gl.enable(gl.BLEND);
    gl.blendColor(0, 0, 0, 1 / sample);
    gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    this.screen(programs.tone, targets.sum.resize(width, height), tone, { u_screen: 0 });
    gl.disable(gl.BLEND);
    this.screen(programs.show, null, { u_image: targets.sum.texture });
  }
}
