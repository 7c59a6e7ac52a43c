// dist/: the package's module with its dependencies outside, and its types.
import {execFileSync} from 'node:child_process';
import {cpSync, rmSync} from 'node:fs';
import {createRequire} from 'node:module';
import {fileURLToPath} from 'node:url';
import {build} from 'esbuild';

const folder = fileURLToPath(new URL('..', import.meta.url));
const tsc = createRequire(import.meta.url).resolve('typescript/bin/tsc');

rmSync(`${folder}/dist`, {recursive: true, force: true});
try {
  execFileSync(process.execPath, [tsc, '-p', `${folder}/tsconfig.types.json`], {stdio: 'inherit'});
} catch {
  process.exit(1);  // tsc has said what is wrong.
}
// What users see; the rest is this package's own affair.
for (const name of ['client', 'error', 'index', 'room', 'status', 'types']) {
  cpSync(`${folder}/build/types/src/${name}.d.ts`, `${folder}/dist/types/${name}.d.ts`);
}
await build({
  entryPoints: [`${folder}/src/index.ts`],
  outfile: `${folder}/dist/index.js`,
  bundle: true,
  packages: 'external',
  format: 'esm',
  target: 'es2022',
  sourcemap: true,
});
