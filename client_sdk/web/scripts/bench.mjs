// Prints the measurements of the web client in docs/measurements.md. Requires STRIDEWIRE_BIN.
import {spawnSync} from 'node:child_process';
import {fileURLToPath} from 'node:url';
import {build} from 'esbuild';

const folder = fileURLToPath(new URL('..', import.meta.url));
await build({
  entryPoints: [`${folder}/bench/measure.ts`],
  outfile: `${folder}/build/measure.mjs`,
  bundle: true,
  loader: {'.wasm': 'binary'},
  packages: 'external',
  platform: 'node',
  format: 'esm',
  target: 'node18',
  define: {STRIDEWIRE_ROOT: JSON.stringify(fileURLToPath(new URL('../../..', import.meta.url)))},
});
const run = spawnSync(process.execPath, ['--expose-gc', `${folder}/build/measure.mjs`,
                                          ...process.argv.slice(2)],
                      {stdio: 'inherit'});
process.exit(run.status ?? 1);
