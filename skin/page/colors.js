// What attributes are drawn in. Stops are sRGB; between them straight lines in sRGB.

const kMaps = {
  // black, red, orange, yellow, white: as hot things look
  temperature: ["#0b0a0d", "#2b0f12", "#5c1414", "#96200f", "#cf3f0a", "#f06d0e", "#fba21f", "#ffd65c", "#fff6cf"],
  speed: ["#0d1326", "#123a63", "#12697e", "#1f977c", "#67bd63", "#c3d84e", "#fbf3a1"],
  crust: ["#f0641e", "#c24a22", "#8f4432", "#6a4a45", "#5c5a5c", "#7b8086", "#b4bac0"],
  thickness: ["#1a1230", "#3b2069", "#6b2c87", "#a53b82", "#da5a6c", "#f58d5c", "#fdd08a"],
};

/// 256 texels of RGBA.
function mapTexels(stops) {
  const rgb = stops.map((s) => [1, 3, 5].map((k) => parseInt(s.slice(k, k + 2), 16)));
  const texels = new Uint8Array(4 * 256);
  for (let i = 0; i < 256; ++i) {
    const at = (i / 255) * (rgb.length - 1), k = Math.min(Math.floor(at), rgb.length - 2);
    for (let c = 0; c < 3; ++c) texels[4 * i + c] = Math.round(mix(rgb[k][c], rgb[k + 1][c], at - k));
    texels[4 * i + 3] = 255;
  }
  return texels;
}

const mapGradient = (name) => "linear-gradient(90deg," + kMaps[name].join(",") + ")";

// How attributes are called and counted.
const kAttributes = {
  temperature: { label: "Temperature", unit: "°C", shown: (kelvin) => kelvin - 273.15 },
  speed: { label: "Speed", unit: "m/s", shown: (v) => v },
  crust: { label: "Crust", unit: "", shown: (v) => v },
  thickness: { label: "Thickness", unit: "m", shown: (v) => v },
};

const kMinus = (text) => text.replace("-", "−");

/// Three or four digits, thin spaces between thousands.
function digits(value) {
  if (!isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e7)) return kMinus(value.toExponential(1));
  const decimals = size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
  const [whole, part] = value.toFixed(decimals).split(".");
  return kMinus(whole.replace(/\B(?=(\d{3})+$)/g, "\u2009") + (part && Number(part) !== 0 ? "." + part.replace(/0+$/, "") : ""));
}

/// 1.2e9 J: 1.2 GJ
function withUnit(value, unit) {
  if (unit === "J" || unit === "W") {
    const prefixes = [[1e15, "P"], [1e12, "T"], [1e9, "G"], [1e6, "M"], [1e3, "k"]];
    for (const [size, prefix] of prefixes) if (Math.abs(value) >= size) return digits(value / size) + " " + prefix + unit;
  }
  return digits(value) + (unit ? " " + unit : "");
}

/// 75.3 s: 1 min 15 s; precision: of the seconds
function duration(seconds, precision = 1) {
  if (seconds < 120) return seconds.toFixed(precision) + " s";
  if (seconds < 7200) return Math.floor(seconds / 60) + " min " + String(Math.floor(seconds % 60)).padStart(2, "0") + " s";
  if (seconds < 172800) return Math.floor(seconds / 3600) + " h " + String(Math.floor((seconds % 3600) / 60)).padStart(2, "0") + " min";
  return digits(seconds / 86400) + " days";
}
