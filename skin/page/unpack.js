// Meshes out of the page's text: base 85, deflate, and what pack_mesh.cpp did, backwards.

const kDigitOf = new Uint8Array(128);
for (let d = 0; d < 85; ++d) kDigitOf[35 + d] = d;
kDigitOf["x".charCodeAt(0)] = "<".charCodeAt(0) - 35;
kDigitOf["y".charCodeAt(0)] = "&".charCodeAt(0) - 35;
kDigitOf["z".charCodeAt(0)] = "\\".charCodeAt(0) - 35;

function bytesOfText(text, length) {
  const words = text.length / 5, bytes = new Uint8Array(4 * words);
  for (let w = 0, i = 0, o = 0; w < words; ++w) {
    let value = 0;
    for (let k = 0; k < 5; ++k) value = value * 85 + kDigitOf[text.charCodeAt(i++)];
    bytes[o++] = value >>> 24;
    bytes[o++] = value >>> 16;
    bytes[o++] = value >>> 8;
    bytes[o++] = value;
  }
  return bytes.subarray(0, length);
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// A vertex on its way to the graphics card: position (three 16 bit), normal (two bytes), then a byte each.
const kStride = 16, kNormalAt = 6, kColorAt = 8, kScalarsAt = 12;
const kPlaneAt = { red: 8, green: 9, blue: 10, glow: 11, temperature: 12, speed: 13, crust: 14, thickness: 15 };

/// about: as in the page's list of meshes. Gives { about, vertices (ArrayBuffer), indices (Uint32Array) }.
function unpackMesh(bytes, about) {
  const n = about.vertices, corners = 3 * about.triangles;
  const indices = new Uint32Array(corners), parentA = new Uint32Array(n), parentB = new Uint32Array(n);
  let at = n * (8 + about.planes.length), next = 0;
  for (let c = 0; c < corners; ++c) {
    let code = bytes[at++];
    if (code > 127) {
      code &= 127;
      for (let shift = 7; ; shift += 7) {
        const more = bytes[at++];
        code |= (more & 127) << shift;
        if (more < 128) break;
      }
    }
    if (code === 0) {
      const corner = c % 3, before = next === 0 ? 0 : next - 1;
      parentA[next] = corner === 0 ? before : indices[c - corner];
      parentB[next] = corner === 0 ? before : indices[c - 1];
      indices[c] = next++;
    } else {
      indices[c] = next - code;
    }
  }

  const buffer = new ArrayBuffer(n * kStride), out = new Uint8Array(buffer), words = new Uint16Array(buffer);
  let plane = 0;
  for (let k = 0; k < 3; ++k, plane += 2 * n) {
    const stride = kStride / 2;
    for (let v = 0; v < n; ++v) {
      const code = bytes[plane + v] | (bytes[plane + n + v] << 8);
      const mean = v === 0 ? 0 : (words[parentA[v] * stride + k] + words[parentB[v] * stride + k]) >> 1;
      words[v * stride + k] = mean + ((code >> 1) ^ -(code & 1));
    }
  }
  const offsets = [kNormalAt, kNormalAt + 1, ...about.planes.map((name) => kPlaneAt[name])];
  for (const offset of offsets) {
    for (let v = 0; v < n; ++v) {
      const mean = v === 0 ? 0 : (out[parentA[v] * kStride + offset] + out[parentB[v] * kStride + offset]) >> 1;
      out[v * kStride + offset] = bytes[plane + v] + mean;
    }
    plane += n;
  }
  return { about, vertices: buffer, indices };
}

/// The elements come in one after the other while the page loads.
function textOf(id) {
  const found = () => {
    const element = document.getElementById("mesh" + id);
    return element && (element.nextSibling || document.readyState !== "loading") ? element : null;
  };
  return new Promise((resolve, reject) => {
    const look = () => {
      const element = found();
      if (element) resolve(element.textContent);
      else if (document.readyState !== "loading") reject(new Error("This page is cut short: mesh " + id + " is missing."));
      else setTimeout(look, 30);
    };
    look();
  });
}

async function loadMesh(id, about) {
  const text = await textOf(id);
  try {
    return unpackMesh(await inflate(bytesOfText(text, about.bytes)), about);
  } catch (error) {
    throw new Error("This page is damaged or cut short: mesh " + id + " cannot be unpacked (" + error.message + ").");
  }
}
