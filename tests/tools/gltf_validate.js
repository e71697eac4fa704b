// Runs the Khronos glTF validator on files: node gltf_validate.js MODULES FILE...
// One line a file and one a message; exit code 1 when any file has an error or a warning.
const fs = require('fs');
const path = require('path');
const [modules, ...files] = process.argv.slice(2);
const validator = require(path.join(modules, 'gltf-validator'));

(async () => {
  let bad = files.length === 0;
  for (const file of files) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
      uri: path.basename(file),
      maxIssues: 100,
    });
    const { numErrors, numWarnings, numInfos, messages } = report.issues;
    console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos`);
    for (const m of messages) console.log(`  severity ${m.severity} ${m.code} ${m.pointer || ''}: ${m.message}`);
    if (numErrors > 0 || numWarnings > 0) bad = true;
  }
  process.exit(bad ? 1 : 0);
})().catch((error) => {
  console.error(String(error));
  process.exit(1);
});
