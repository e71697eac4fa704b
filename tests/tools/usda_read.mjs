// Reads .usda files by tinyusdz, a USD parser of its own compiled to WebAssembly: node usda_read.mjs MODULES FILE...
// One JSON line a file: {file, ok, error, counts, text}: how many values each attribute has at its time sample, and the layer as the parser
// understood it, long lists cut.
// The package is built for browsers and asks where it runs: it is told a worker.
import fs from 'fs';
import path from 'path';
import { pathToFileURL } from 'url';

const [modules, ...files] = process.argv.slice(2);
const read = (file) => fs.readFileSync(file);
const print = (line) => fs.writeSync(1, line + '\n');
Object.defineProperty(process, 'versions', { value: {} });
globalThis.self = globalThis;
globalThis.WorkerGlobalScope = function () {};
globalThis.location = { href: 'file:///' };
globalThis.importScripts = undefined;

const folder = path.join(modules, 'tinyusdz');
const start = (await import(pathToFileURL(path.join(folder, 'tinyusdz.js')).href)).default;
const usd = await start({ wasmBinary: read(path.join(folder, 'tinyusdz.wasm')), print: () => {}, printErr: () => {} });
for (const file of files) {
  const layer = new usd.TinyUSDZLoaderNative();
  const ok = layer.loadAsLayerFromBinary(new Uint8Array(read(file)), path.basename(file));
  const count = {};
  let text = '';
  for (const line of ok ? layer.layerToString().split('\n') : []) {
    const name = /^\s*(?:uniform )?([\w:\[\]]+ [\w:]+)\.timeSamples/.exec(line);
    if (name) text = name[1];
    const list = /^\s*(\d+): \[(.*)\],?$/.exec(line);
    if (list) count[text] = list[2] === '' ? 0 : list[2].startsWith('(') ? list[2].split('), (').length : list[2].split(', ').length;
  }
  // counts: values of each attribute's time sample
  print(JSON.stringify({ file, ok, error: layer.error(), counts: count, text: ok ? layer.layerToString().replace(/\[[^\]]{64,}\]/g, '[...]') : '' }));
}
