// The shown frame as a file: what the page holds of it, in world units.

/// Positions [m], normals, and the attributes by name: numbers, three for colours.
function numbersOf(mesh) {
  const { about, vertices } = mesh, n = about.vertices;
  const words = new Uint16Array(vertices), bytes = new Uint8Array(vertices);
  const positions = new Float32Array(3 * n), normals = new Float32Array(3 * n), scalars = {};
  for (let v = 0; v < n; ++v) {
    for (let k = 0; k < 3; ++k) positions[3 * v + k] = about.box[k] + (words[v * 8 + k] / 65535) * (about.box[3 + k] - about.box[k]);
    const x = bytes[v * kStride + kNormalAt] / 127.5 - 1, y = bytes[v * kStride + kNormalAt + 1] / 127.5 - 1, z = 1 - Math.abs(x) - Math.abs(y);
    const folded = z < 0 ? [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1), z] : [x, y, z];
    normals.set(unit(folded), 3 * v);
  }
  for (const name of about.planes) {
    if (!(name in kAttributes)) continue;
    const [low, high] = (about.ranges && about.ranges[name]) || [0, 1], at = kPlaneAt[name];
    scalars[name] = new Float32Array(n).map((_, v) => low + (bytes[v * kStride + at] / 255) * (high - low));
  }
  return { n, positions, normals, scalars, bytes, planes: about.planes };
}

const toLinear = (s) => (s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4);
const toSrgb = (l) => (l <= 0.0031308 ? 12.92 * l : 1.055 * l ** (1 / 2.4) - 0.055);

/// Reflected and emitted light, as a screen shows them, linear 0..1.
function displayColor(numbers, v, glow) {
  const { bytes, planes } = numbers, g = planes.includes("glow") ? bytes[v * kStride + kPlaneAt.glow] : 0;
  return [0, 1, 2].map((k) => clamp(toLinear(bytes[v * kStride + kColorAt + k] / 255) + 1 - Math.exp(-glow[3 * g + k]), 0, 1));
}

/// Binary PLY, z up, as effuse writes them.
function plyOf(mesh, page, frame) {
  const numbers = numbersOf(mesh), { n, positions, normals, scalars } = numbers, names = Object.keys(scalars);
  const ascii = (text) => text.replace(/[^\x20-\x7e]/g, "?");
  const header = ["ply", "format binary_little_endian 1.0", "comment effuse, metres, z up", "comment scene: " + ascii(page.title), "comment frame: " + frame.number, "comment time_s: " + frame.time,
    "comment origin: " + page.origin.join(" "), "comment crs: " + ascii(page.crs), "comment from a page: 16 bit positions, 8 bit attributes", "element vertex " + n,
    ...["x", "y", "z", "nx", "ny", "nz"].map((p) => "property float " + p), ...["red", "green", "blue"].map((p) => "property uchar " + p), ...names.map((p) => "property float " + p),
    "element face " + mesh.about.triangles, "property list uchar uint vertex_indices", "end_header", ""].join("\n");
  const stride = 27 + 4 * names.length, body = new ArrayBuffer(n * stride + 13 * mesh.about.triangles), out = new DataView(body);
  let at = 0;
  const float = (value) => {
    out.setFloat32(at, value, true);
    at += 4;
  };
  for (let v = 0; v < n; ++v) {
    for (let k = 0; k < 3; ++k) float(positions[3 * v + k]);
    for (let k = 0; k < 3; ++k) float(normals[3 * v + k]);
    for (const c of displayColor(numbers, v, page.glow)) out.setUint8(at++, Math.round(255 * toSrgb(c)));
    for (const name of names) float(scalars[name][v]);
  }
  for (let t = 0; t < mesh.indices.length; t += 3) {
    out.setUint8(at++, 3);
    for (let k = 0; k < 3; ++k, at += 4) out.setUint32(at, mesh.indices[t + k], true);
  }
  return new Blob([header, body], { type: "application/octet-stream" });
}

/// Binary glTF 2.0, y up, colours linear.
function glbOf(mesh, page, frame) {
  const numbers = numbersOf(mesh), { n, positions, normals, scalars } = numbers;
  const turned = (a) => Float32Array.from(a, (_, i) => (i % 3 === 0 ? a[i] : i % 3 === 1 ? a[i + 1] : -a[i - 1]));
  const color = new Uint16Array(4 * n);
  for (let v = 0; v < n; ++v) color.set([...displayColor(numbers, v, page.glow).map((c) => Math.round(65535 * c)), 65535], 4 * v);
  const arrays = [], views = [], accessors = [];
  let length = 0;
  const accessor = (array, componentType, type, more = {}, target = 34962) => {
    views.push({ buffer: 0, byteOffset: length, byteLength: array.byteLength, target });
    arrays.push(array);
    length += array.byteLength;
    accessors.push({ bufferView: views.length - 1, componentType, count: array.length / { SCALAR: 1, VEC3: 3, VEC4: 4 }[type], type, ...more });
    return accessors.length - 1;
  };
  const place = turned(positions), low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  place.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3], value);
    high[i % 3] = Math.max(high[i % 3], value);
  });
  const attributes = {
    POSITION: accessor(place, 5126, "VEC3", { min: low, max: high }),
    NORMAL: accessor(turned(normals), 5126, "VEC3"),
    COLOR_0: accessor(color, 5123, "VEC4", { normalized: true }),
  };
  for (const [name, values] of Object.entries(scalars)) attributes["_" + name.toUpperCase()] = accessor(values, 5126, "SCALAR");
  const indices = accessor(mesh.indices, 5125, "SCALAR", {}, 34963);
  const json = {
    asset: { version: "2.0", generator: "effuse", extras: { scene: page.title, frame: String(frame.number), time_s: String(frame.time), origin: page.origin.join(" "), crs: page.crs } },
    scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0, name: "lava" }], meshes: [{ primitives: [{ attributes, indices, material: 0 }] }],
    materials: [{ pbrMetallicRoughness: { metallicFactor: 0, roughnessFactor: 0.8 } }], buffers: [{ byteLength: length }], bufferViews: views, accessors,
  };
  let text = new TextEncoder().encode(JSON.stringify(json));
  const padded = new Uint8Array(Math.ceil(text.length / 4) * 4).fill(32);
  padded.set(text);
  const chunk = (size, kind) => new Uint32Array([size, kind]);
  return new Blob([new Uint32Array([0x46546c67, 2, 12 + 8 + padded.length + 8 + length]), chunk(padded.length, 0x4e4f534a), padded, chunk(length, 0x004e4942), ...arrays], { type: "model/gltf-binary" });
}

function offer(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}
