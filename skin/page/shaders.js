// All light is linear until the last shader.

const kMeshVertex = `#version 300 es
layout(location = 0) in vec3 a_position;  // 0..1 in the mesh's box
layout(location = 1) in vec2 a_normal;    // on the unfolded octahedron, 0..1
layout(location = 2) in vec4 a_color;     // sRGB, and glow
layout(location = 3) in vec4 a_scalars;
uniform vec3 u_low, u_size;
uniform mat4 u_clip;
out vec3 v_position, v_normal;
out vec4 v_color, v_scalars;
void main() {
  v_position = u_low + a_position * u_size;
  vec2 p = 2.0 * a_normal - 1.0;
  vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
  if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
  v_normal = normalize(n);
  v_color = a_color;
  v_scalars = a_scalars;
  gl_Position = u_clip * vec4(v_position, 1.0);
}`;

const kLightFunctions = `
uniform vec3 u_eye, u_sun, u_sunLight, u_skyLight, u_bounce;
uniform mat4 u_shadowFromWorld;
uniform highp sampler2DShadow u_shadow;
uniform float u_shadowTexel, u_shadowBias;  // of the map; of the world [m]
uniform int u_shadowTaps;

float sunlit(vec3 position, vec3 n) {
  float facing = dot(n, u_sun);
  if (facing <= 0.0) return 0.0;
  // Off the surface, farther where it is grazed.
  vec3 p = (u_shadowFromWorld * vec4(position + n * u_shadowBias * (1.0 + 2.0 * (1.0 - facing)), 1.0)).xyz * 0.5 + 0.5;
  if (any(lessThan(p, vec3(0.0))) || any(greaterThan(p, vec3(1.0)))) return facing;
  if (u_shadowTaps == 1) return facing * texture(u_shadow, p);
  float lit = 0.0;
  for (int k = 0; k < 4; ++k) {
    vec2 off = vec2(float(k & 1) - 0.5, float(k >> 1) - 0.5) * 1.5 * u_shadowTexel;
    lit += texture(u_shadow, vec3(p.xy + off, p.z));
  }
  return facing * lit * 0.25;
}
vec3 skylight(vec3 n) { return mix(u_bounce, u_skyLight, 0.5 + 0.5 * n.z); }
vec3 linear(vec3 s) { return mix(s / 12.92, pow((s + 0.055) / 1.055, vec3(2.4)), step(0.04045, s)); }
`;

/// Tone curve and its inverse: what must look like its legend goes through the inverse first.
/// Source: Narkowicz 2015, ACES filmic tone mapping curve.
const kToneFunctions = `
vec3 toned(vec3 x) { return clamp((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0); }
vec3 untoned(vec3 y) {
  y = min(y, 0.99);
  vec3 a = 2.51 - 2.43 * y, b = 0.03 - 0.59 * y, c = -0.14 * y;
  return (-b + sqrt(b * b - 4.0 * a * c)) / (2.0 * a);
}
`;

const kLavaFragment = `#version 300 es
precision highp float;
in vec3 v_position, v_normal;
in vec4 v_color, v_scalars;
uniform sampler2D u_glow, u_map;
uniform int u_channel;      // -1: as it looks; 0..3: of the scalars
uniform vec2 u_ofRange;     // the byte's range on the page's
uniform float u_emission, u_exposure;
out vec4 o_light;           // a: share that blooms
${kLightFunctions}
${kToneFunctions}
void main() {
  vec3 n = normalize(v_normal);
  float sun = sunlit(v_position, n);
  if (u_channel < 0) {
    vec3 albedo = linear(v_color.rgb);
    vec3 emitted = texture(u_glow, vec2((v_color.a * 255.0 + 0.5) / 256.0, 0.5)).rgb * u_emission;
    vec3 toEye = normalize(u_eye - v_position), halfway = normalize(toEye + u_sun);
    // The chilled film is longer where it is seen aslant: what glows shows its shape.
    emitted *= mix(0.45, 1.0, smoothstep(0.0, 0.9, dot(n, toEye))) * (0.82 + 0.18 * n.z);
    // Glassy where it has just set: a dull highlight, sharper on hot lava.
    float shine = mix(18.0, 60.0, v_color.a), fresnel = 0.04 + 0.96 * pow(1.0 - max(dot(toEye, halfway), 0.0), 5.0);
    float gloss = pow(max(dot(n, halfway), 0.0), shine) * (shine + 2.0) / 8.0 * fresnel * mix(0.25, 0.8, v_color.a);
    vec3 mirrored = skylight(reflect(-toEye, n)) * (0.04 + 0.5 * pow(1.0 - max(dot(n, toEye), 0.0), 5.0)) * 0.5;
    o_light = vec4(albedo * (sun * u_sunLight + skylight(n)) + gloss * sun * u_sunLight + mirrored + emitted, 1.0);
    o_light.a = clamp(dot(emitted, vec3(0.3)) * 4.0, 0.0, 1.0);
  } else {
    float value = u_channel == 0 ? v_scalars.x : u_channel == 1 ? v_scalars.y : u_channel == 2 ? v_scalars.z : v_scalars.w;
    vec3 color = linear(texture(u_map, vec2((clamp(mix(u_ofRange.x, u_ofRange.y, value), 0.0, 1.0) * 255.0 + 0.5) / 256.0, 0.5)).rgb);
    float toEye = max(dot(n, normalize(u_eye - v_position)), 0.0);
    o_light = vec4(untoned(color * (0.62 + 0.23 * toEye + 0.15 * (0.5 + 0.5 * dot(n, u_sun)))) / u_exposure, 0.0);
  }
}`;

const kGroundFragment = `#version 300 es
precision highp float;
in vec3 v_position, v_normal;
uniform float u_contour, u_contours;  // interval [m]; how strong
uniform float u_grain;                // size of the ground's largest patches [m]
uniform sampler2D u_noise;            // r: patches, 16 wide; g: grains; repeats
uniform sampler2D u_glowMap;          // glow from above, blurred
uniform vec4 u_glowFrame;             // lower corner and size [m] of that
uniform float u_glowLight;
out vec4 o_light;
${kLightFunctions}
float lines(float height, float width) {
  float wide = fwidth(height);
  float apart = abs(fract(height - 0.5) - 0.5) / max(wide, 1e-5);
  return (1.0 - smoothstep(width - 0.5, width + 0.5, apart)) * (1.0 - smoothstep(0.15, 0.45, wide)) * smoothstep(0.0, 2e-4, wide);
}
void main() {
  vec3 n = normalize(gl_FrontFacing ? v_normal : -v_normal);
  vec2 xy = v_position.xy / (16.0 * u_grain);
  float patches = texture(u_noise, xy).r, grains = texture(u_noise, xy.yx * 7.7).g;
  float steep = smoothstep(0.62, 0.93, n.z);
  vec3 albedo = mix(vec3(0.088, 0.079, 0.073), vec3(0.073, 0.078, 0.060), steep * (0.35 + 0.65 * patches));
  albedo *= 0.78 + 0.30 * patches + 0.16 * grains;
  vec3 light = albedo * (sunlit(v_position, n) * u_sunLight + skylight(n));
  vec2 at = (v_position.xy - u_glowFrame.xy) / u_glowFrame.zw;
  vec2 inside = smoothstep(0.0, 0.08, at) * (1.0 - smoothstep(0.92, 1.0, at));
  if (u_glowLight * inside.x * inside.y > 0.0) light += albedo * u_glowLight * inside.x * inside.y * texture(u_glowMap, at).rgb;
  // A thirtieth of an interval higher than round numbers: on ground given in whole metres those run in steps along plateaus.
  float height = v_position.z / u_contour - 0.033;
  float line = max(0.5 * lines(height, 0.45), lines(height / 5.0, 0.8));
  light += u_contours * line * (0.16 * light + 0.045 * (u_skyLight + 0.35 * u_sunLight) + vec3(0.004));
  o_light = vec4(light, 0.0);
}`;

const kOtherFragment = `#version 300 es
precision highp float;
in vec3 v_position, v_normal;
in vec4 v_color;
uniform float u_deep, u_depth;  // strata of the block's walls: height of its foot, how far up
out vec4 o_light;
${kLightFunctions}
void main() {
  vec3 n = normalize(gl_FrontFacing ? v_normal : -v_normal);
  vec3 albedo = linear(v_color.rgb);
  if (u_depth > 0.0) albedo *= mix(0.35, 1.0, smoothstep(0.0, 1.0, (v_position.z - u_deep) / u_depth));
  o_light = vec4(albedo * (sunlit(v_position, n) * u_sunLight + skylight(n)), 0.0);
}`;

const kLineFragment = `#version 300 es
precision highp float;
uniform vec4 u_line;
out vec4 o_light;
void main() { o_light = u_line; }`;

const kDepthFragment = `#version 300 es
precision highp float;
void main() {}`;

/// One triangle over the whole picture.
const kScreenVertex = `#version 300 es
out vec2 v_at;
void main() {
  v_at = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));
  gl_Position = vec4(2.0 * v_at - 1.0, 1.0, 1.0);
}`;

const kSkyFragment = `#version 300 es
precision highp float;
in vec2 v_at;
uniform vec3 u_above, u_below;  // as the screen shows them, linear
uniform float u_exposure;
out vec4 o_light;
${kToneFunctions}
void main() { o_light = vec4(untoned(mix(u_below, u_above, smoothstep(0.0, 1.0, v_at.y))) / u_exposure, 0.0); }`;

/// Bright light alone, a quarter as wide: each reading is the mean of four texels.
const kBrightFragment = `#version 300 es
precision highp float;
in vec2 v_at;
uniform sampler2D u_image;
uniform vec2 u_texel;
out vec4 o_light;
vec3 bright(vec2 at) {
  vec4 c = texture(u_image, at);
  return min(c.rgb * c.a, vec3(8.0));
}
void main() {
  vec2 d = u_texel;
  o_light = vec4(0.25 * (bright(v_at + d * vec2(-1, -1)) + bright(v_at + d * vec2(1, -1)) + bright(v_at + d * vec2(-1, 1)) + bright(v_at + d * vec2(1, 1))), 1.0);
}`;

/// Gaussian of sigma three steps, along one axis, and a share of another picture.
const kBlurFragment = `#version 300 es
precision highp float;
in vec2 v_at;
uniform sampler2D u_image, u_also;
uniform vec2 u_step, u_shares;
out vec4 o_light;
void main() {
  // Thirteen steps by seven readings: between two texels the card gives their mean.
  vec3 sum = 0.1370 * texture(u_image, v_at).rgb;
  sum += 0.2393 * (texture(u_image, v_at + 1.4584 * u_step).rgb + texture(u_image, v_at - 1.4584 * u_step).rgb);
  sum += 0.1394 * (texture(u_image, v_at + 3.4040 * u_step).rgb + texture(u_image, v_at - 3.4040 * u_step).rgb);
  sum += 0.0527 * (texture(u_image, v_at + 5.3518 * u_step).rgb + texture(u_image, v_at - 5.3518 * u_step).rgb);
  o_light = vec4(u_shares.x * sum, 1.0);
  if (u_shares.y > 0.0) o_light.rgb += u_shares.y * texture(u_also, v_at).rgb;
}`;

const kEncodeFunction = `
vec3 encoded(vec3 c) {
  c = mix(12.92 * c, 1.055 * pow(max(c, 0.0), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
  // Dark gradients without bands.
  return c + (fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))) - 0.5) / 255.0;
}
`;

/// Light to what a screen shows: sRGB for the screen, or still linear in 0..1 so that pictures of a still scene can be averaged.
const kToneFragment = `#version 300 es
precision highp float;
in vec2 v_at;
uniform sampler2D u_image, u_bloom;  // the first of the screen's own size
uniform float u_exposure, u_bloomStrength;
uniform int u_screen;
out vec4 o_color;
${kToneFunctions}
${kEncodeFunction}
void main() {
  vec3 c = texelFetch(u_image, ivec2(gl_FragCoord.xy), 0).rgb;
  if (u_bloomStrength > 0.0) c += u_bloomStrength * texture(u_bloom, v_at).rgb;
  vec2 d = v_at - 0.5;
  c = toned(c * u_exposure * (1.0 - 0.35 * dot(d, d)));
  o_color = vec4(u_screen == 1 ? encoded(c) : c, 1.0);
}`;

const kShowFragment = `#version 300 es
precision highp float;
uniform sampler2D u_image;
out vec4 o_color;
${kEncodeFunction}
void main() { o_color = vec4(encoded(texelFetch(u_image, ivec2(gl_FragCoord.xy), 0).rgb), 1.0); }`;
