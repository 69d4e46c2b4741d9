// Holds GLB files against the Khronos glTF validator; any error fails.
//
//   node .ci/validate-gltf.mjs a.glb b.glb ...
//
// GLTF_VALIDATOR names the folder that `npm install gltf-validator` was run in;
// .ci/peers sets it.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const folder = resolve(process.env.GLTF_VALIDATOR ?? ".");
const validator = createRequire(join(folder, "package.json"))("gltf-validator");

const files = process.argv.slice(2);
if (files.length === 0) {
  console.error("usage: node .ci/validate-gltf.mjs FILE.glb ...");
  process.exit(2);
}
let failed = 0;
for (const file of files) {
  const { issues } = await validator.validateBytes(new Uint8Array(readFileSync(file)), { uri: file, maxIssues: 100 });
  console.log(`${file}: ${issues.numErrors} errors, ${issues.numWarnings} warnings`);
  for (const { severity, code, message, pointer } of issues.messages) {
    // 0 is an error, 1 a warning; what is less is no one's business here.
    if (severity <= 1) console.log(`  ${severity === 0 ? "error" : "warning"} ${code} at ${pointer}: ${message}`);
  }
  failed += issues.numErrors > 0;
}
process.exit(failed > 0 ? 1 : 0);
